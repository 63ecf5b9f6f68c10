"""The Pareto front of cost and error, and points likely to lie on it."""

from collections.abc import Mapping, Sequence

import numpy as np

import fencejax as fj
from fencejax.plot import non_dominated

from .errors import Outcome


def pareto(cost: Sequence[float], error: Sequence[float]) -> list[int]:
    """Indices of the points on the front, from the cheapest on: no other point has at most the same
    cost and error, and a smaller value of one. Points that are not finite are left out; of equal
    points the first one stays.

    Raises `ValueError` where the two are not of one length.
    """
    if len(cost) != len(error):
        raise ValueError(
            f"Arguments `cost` and `error` must be of one length, but are {len(cost)} and "
            f"{len(error)} long."
        )
    points = np.column_stack([cost, error])
    kept = np.flatnonzero(non_dominated(points))
    # In the order of their costs, the first of equal ones.
    _, first = np.unique(points[kept], axis=0, return_index=True)
    return [int(k) for k in kept[first]]


def superposed(base: Outcome, effects: Sequence[Outcome]) -> Outcome:
    """The outcome that several knobs together would have if their effects added up, scene by
    scene: logarithms of the values, and elasticities.

    `effects` are the outcomes with one knob changed from the base each.
    """
    values, slopes = np.log(np.abs(base.values)), base.slopes
    assert slopes is not None
    for one in effects:
        assert one.slopes is not None
        assert base.slopes is not None
        values = values + np.log(np.abs(one.values)) - np.log(np.abs(base.values))
        slopes = slopes + one.slopes - base.slopes
    return Outcome(np.exp(values), slopes, base.status)


def work(fidelity: fj.Fidelity) -> float:
    """An estimated cost of a lane in a large batch, for ordering only: steps a second of motion
    times operations a step. A single run has other bottlenecks, and chords cost it far less (see
    `fencejax.study.expected_cost`)."""
    turn = {"small": 0.9, "arc": 1.0, "chord": 1.0 + 0.5 * fidelity.mode_count}[fidelity.geometry]
    return (4.0 + fidelity.mode_count) * turn / fidelity.step


def likely(
    predicted: Mapping[fj.Fidelity, tuple[float, float]], count: int
) -> list[fj.Fidelity]:
    """At most `count` fidelities likely to be on a front, the cheapest first.

    `predicted` holds errors of value and gradient [1] by fidelity. Fronts of work against either
    error, and against the larger of the value's error over 1 % and the gradient's over 5 %, are
    removed one after another until there are enough points; of the last front points are taken at
    even spacing.
    """
    left, chosen = dict(predicted), []
    while left and len(chosen) < count:
        names = list(left)
        cost = [work(name) for name in names]
        value, slope = ([left[name][k] for name in names] for k in (0, 1))
        joint = [max(v / 0.01, s / 0.05) for v, s in zip(value, slope, strict=True)]
        layer = {names[k] for error in (joint, slope, value) for k in pareto(cost, error)}
        if not layer:
            break
        ordered = sorted(layer, key=work)
        room = count - len(chosen)
        if len(ordered) > room:
            picks = np.unique(np.round(np.linspace(0, len(ordered) - 1, room)).astype(int))
            ordered = [ordered[k] for k in picks]
        chosen += ordered
        left = {name: error for name, error in left.items() if name not in layer}
    return sorted(chosen, key=work)
