"""Parameters from recordings: nonlinear least squares with derivatives through the simulation.

>>> list(fj.identify.PARAMETERS)[:3]
['youngs_modulus', 'density', 'damping_ratio']
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from .. import _check
from ..design import DesignVariable
from ..fidelity import Fidelity
from ..results import Status
from .fit_judgement import Fit, judged
from .fit_problem import (
    OFFSET,
    PARAMETERS as PARAMETERS,
    Experiment,
    Problem,
    parameters_of,
    starting_shares,
)
from .fit_search import first_scales, search, starts_from
from .recording import SIGNALS

# A recording larger or smaller than the model by this factor is in another unit.
_SUSPICIOUS = 100.0


def fit(
    experiments: Experiment | Sequence[Experiment],
    parameters: Sequence[str | DesignVariable],
    *,
    fidelity: Fidelity | None = None,
    noise: Mapping[str, float] | None = None,
    starts: int = 1,
    confidence: float = 0.95,
    seed: int = 0,
    most: int = 100,
    posterior: bool = False,
    refine: bool = True,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Find the parameters p with which scenes reproduce their recordings:

    minimise 1/2 sum_j ((s_j(p) - y_j) / sigma_j)^2 within bounds,

    with y_j the recorded numbers, s_j(p) the simulated signals at the same times, and sigma_j the
    noise of the signal. The search is a trust-region Gauss-Newton method (`scipy.optimize.
    least_squares`, Branch, Coleman and Li 1999) with derivatives through the simulation, in
    u = ln(p / a) / ln(b / a) of the bounds a, b (or linear in p, see `DesignVariable`).

    The covariance of the estimates is that of the linearised problem,
    C = s^2 (J^T J)^-1 with s^2 = sum of weighted squares / (N - n): correct for independent noise
    of constant size, a true model, and errors small enough for the linearisation. The standard
    errors do not include errors of the model or the fidelity: see `Fit.warnings`. Where the model
    is nonlinear within the errors, `posterior=True` computes the posterior with the model's second
    derivatives (`Posterior`).

    **Arguments:**

    - `experiments`: one or more, on the scenes' clocks (see `fencejax.study.align`); missing
      samples do not count. The scenes have the known numbers, and the search starts at the
      parameters' values in the first one. Parameters are common to all experiments, except
      `time_offset`, of which each recording has its own.
    - `parameters`: names of `PARAMETERS`, or any number of the scenes (`fencejax.scene_numbers`) as
      a `DesignVariable` with its bounds.
    - `noise`: sigma by signal [the signal's unit]. By default it is estimated from the residuals,
      repeatedly until it no longer changes: the most likely weights of several signals.
    - `starts`: the first is at the scene's own numbers, others are spread over the bounds; the best
      is kept.
    - `confidence`: of the intervals [1]. `seed`: of the starts. `most`: evaluations in a search.
    - `posterior`: also compute `Fit.posterior`: one more program, and two evaluations a parameter.
    - `refine`: where a simulation at the parameters found is in numerical doubt
      (`Status.numerical`), continue the search at the next finer rung of `Fidelity.ladder`, up to
      the last one; `Fit.rung` is the rung of the result.
    - `progress`: called with the evaluation's number and half the weighted sum of squares.

    Raises `ValueError` for impossible names, bounds, times or sizes; a recording whose times or
    values are off by orders of magnitude is refused as probably in other units.

    >>> history = fj.simulate(fj.scenes.rigid_wall()).history
    >>> force = {"force": np.asarray(history.fence_force)[1:140]}
    >>> recorded = fj.study.Recording(np.asarray(history.time)[1:140], force)
    >>> guess = fj.scenes.rigid_wall(parcel=fj.Parcel(stiffness=2e9))
    >>> found = fj.identify.fit(fj.study.Experiment(guess, recorded), ["stiffness"])
    >>> print(f"{found.values[0]:.3g} N/m^4")
    1.72e+09 N/m^4
    """
    if isinstance(experiments, Experiment):
        experiments = [experiments]
    experiments = tuple(experiments)
    if not experiments:
        raise ValueError("Argument `experiments` must hold at least one, but is empty.")
    fidelity = Fidelity.standard() if fidelity is None else fidelity
    _check.count("starts", starts, least=1)
    _check.count("most", most, least=1)
    if not 0 < _check.number("confidence", confidence) < 1:
        raise ValueError(f"Argument `confidence` must be within 0 and 1, but is {confidence:g}.")
    chosen = parameters_of(parameters, experiments)
    rows = sum(int(np.sum(recording.present)) for _, recording in experiments)
    if rows <= len(chosen):
        raise ValueError(
            f"Argument `experiments` must hold more recorded numbers than the {len(chosen)} "
            f"parameters {', '.join(one.name for one in chosen)}, but holds {rows}. Record more, "
            "or name fewer `parameters`."
        )
    _check_times(experiments, chosen, fidelity)
    begin = starting_shares(chosen, experiments[0].scene)
    problem = Problem(experiments, chosen, fidelity)
    _check_sizes(problem, begin)
    first = first_scales(experiments, noise)
    found = [
        search(problem, at, first, noise is None, most, progress)
        for at in starts_from(begin, starts, seed)
    ]
    # Each search has weights of its own; their results are compared with the first weights.
    compared = [0.5 * float(np.sum(problem.stacked(x, first)[0] ** 2)) for x, *_ in found]
    shares, weights, converged, stop = found[int(np.argmin(compared))]
    rung, rungs = 0, fidelity.ladder() if refine else (fidelity,)
    while rung + 1 < len(rungs) and problem.in_doubt(shares):
        rung += 1
        problem = Problem(experiments, chosen, rungs[rung], problem.evaluations)
        shares, weights, converged, stop = search(
            problem, shares, weights, noise is None, most, progress
        )
    return judged(
        problem, begin, shares, weights, converged, stop, compared, confidence, posterior, rung
    )


def _check_times(experiments, parameters, fidelity: Fidelity) -> None:
    latest = max([p.upper for p in parameters if p.name.startswith(OFFSET)], default=0.0)
    for scene, recording in experiments:
        time = np.asarray(recording.time)
        last, span = float(time[-1]), float(time[-1] - time[0])
        if last + latest > scene.duration * (1 + 1e-9):
            raise ValueError(
                f"{recording.source}: times must end within the scene, {scene.duration:g} s less "
                f"the largest time_offset {latest:g} s, but end at {last:g} s. Give the scene "
                f"duration={last + latest:g}, cut the recording (`fencejax.study.align`) or, if "
                "these are milliseconds, write `time [ms]` in the header."
            )
        if span < 10 * fidelity.step:
            raise ValueError(
                f"{recording.source}: times must span at least ten steps of {fidelity.step:g} s, "
                f"but span {span:g} s. If they are not in seconds, name their unit in the header, "
                "for example `time [ms]`."
            )


def _check_sizes(problem: Problem, shares) -> None:
    """Refuse a recording that is larger or smaller than the model by orders of magnitude."""
    for (modelled, _, status), (_, recording) in zip(
        problem.models(shares), problem.experiments, strict=True
    ):
        if not np.all(np.isfinite(modelled)):
            raise ValueError(
                f"{recording.source}: the scene must run at the start of the search, but ends with "
                f"{Status(status).name}: {Status(status).text}."
            )
        for name, of_model, of_record in zip(
            recording.names, modelled, recording.values, strict=True
        ):
            # For a position only its change counts.
            shift = name in ("x", "y", "angle")
            size, own = (
                float(np.ptp(a) if shift else np.max(np.abs(a)))
                for a in (of_record[np.isfinite(of_record)], of_model)
            )
            if own == 0 or not 1 / _SUSPICIOUS < size / own < _SUSPICIOUS:
                raise ValueError(
                    f"{recording.source}, signal `{name}`: must be of the model's size, {own:.3g} "
                    f"{SIGNALS[name]} at the start of the search, but is {size:.3g}. Name its "
                    f"unit in the header, for example `{name} "
                    f"[{'kN' if name == 'force' else 'mm'}]`, or start from better numbers."
                )
