"""Signals of a result over time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import ArrayLike

from .. import _check
from ..results import Result, Sample
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Trace(NamedTuple):
    """Signals over time: `time` [s], `force` of the fence on the parcel [N], `deflection` of the
    tip [m]; each of shape (T,).

    >>> trace = fj.plot.Trace.of(fj.simulate(fj.scenes.oblique_impact()))
    >>> trace.force.shape == trace.time.shape
    True
    """

    time: ArrayLike
    force: ArrayLike
    deflection: ArrayLike

    @classmethod
    def of(cls, result: Result) -> "Trace":
        """The signals of a result.

        Raises `ValueError` where it has no history, or is that of a batch.
        """
        history = single_history(result)
        return cls(history.time, history.fence_force, history.tip_deflection)


Signals = Result | Trace | Mapping[str, Result | Trace]


def single_history(result: Result) -> Sample:
    """The history of a result.

    Raises `ValueError` where it has none, or that of a batch.
    """
    history = result.history
    if history is None:
        raise ValueError(
            "Argument `result` must hold the history of one scene, but holds none. Write "
            "simulate(scene, history=True)."
        )
    if np.ndim(history.time) != 1:
        raise ValueError(
            "Argument `result` must hold the history of one scene, but holds a batch. Take one "
            "lane of scene and result: jax.tree.map(lambda leaf: leaf[0], (scene, result))."
        )
    return history


def _drive(history: Sample, field: str) -> Any:
    return None if history.drive is None else getattr(history.drive, field)


def _total(contacts) -> Any:
    return sum(np.asarray(contact.normal) for contact in contacts) if contacts else None


def _belt_force(history: Sample) -> Any:
    belt = history.belt
    return None if belt is None else np.hypot(np.asarray(belt.x), np.asarray(belt.y))


# name: label with unit, factor from the SI, how to read it (None where the scene has no such part).
_SIGNALS = {
    "fence_force": ("force of the fence [N]", 1.0, lambda h: h.fence_force),
    "tip_deflection": ("tip deflection [mm]", 1e3, lambda h: h.tip_deflection),
    "stress": ("bending stress [MPa]", 1e-6, lambda h: h.stress),
    "torque": ("drive torque [N m]", 1.0, lambda h: h.torque),
    "drive_angle": ("drive angle [rad]", 1.0, lambda h: _drive(h, "angle")),
    "drive_speed": ("drive speed [rad/s]", 1.0, lambda h: _drive(h, "speed")),
    "border_force": ("force of the border [N]", 1.0, lambda h: _total(h.border)),
    "belt_force": ("belt friction [N]", 1.0, _belt_force),
    "parcel_x": ("parcel, x [m]", 1.0, lambda h: h.body.x),
    "parcel_y": ("parcel, y [m]", 1.0, lambda h: h.body.y),
    "parcel_angle": ("parcel's angle [rad]", 1.0, lambda h: h.body.angle),
    "parcel_speed": (
        "parcel's speed [m/s]",
        1.0,
        lambda h: np.hypot(np.asarray(h.body.x_rate), np.asarray(h.body.y_rate)),
    ),
}
SIGNALS = tuple(_SIGNALS)
"""Names that `histories` draws."""
_TIME = "time since the start [ms]"
# The time shown after the last force, as a share of the time until then.
_AFTER = 0.15


def histories(
    results: Result | Mapping[str, Result],
    names: Sequence[str] = ("fence_force", "tip_deflection"),
    *,
    axes: "Sequence[Axes] | None" = None,
) -> "tuple[Axes, ...]":
    """Signals over time [ms], one above the other, for one result or several by name.

    **Arguments:**

    - `results`: with histories, of one scene each.
    - `names`: of `SIGNALS`.
    - `axes`: one for each name; by default a figure of page width.

    Raises `ValueError` for an unknown name, for a signal that no result has, for a wrong number of
    axes, and where a result has no history or that of a batch.

    >>> result = fj.simulate(fj.scenes.oblique_impact())
    >>> [axes.get_ylabel() for axes in fj.plot.histories(result)]
    ['force of the fence [N]', 'tip deflection [mm]']
    """
    names = (names,) if isinstance(names, str) else tuple(names)
    for name in names:
        _check.choice("names", name, SIGNALS)
    many = results if isinstance(results, Mapping) else {"": results}
    lines = {title: single_history(one) for title, one in many.items()}
    if axes is None and names:
        made = style.figure(0.6 + 1.6 * len(names))
        panels = list(made.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0])
    else:
        panels = list(axes or ())
    if not names or len(panels) != len(names):
        raise ValueError(
            f"Argument `axes` must be one for each of the names {list(names)}, at least one, but "
            f"there are {len(panels)}."
        )
    colors = style.COLORS if len(lines) > 1 else style.LINES
    for name, panel in zip(names, panels, strict=True):
        style.prepared(panel)
        title, factor, read = _SIGNALS[name]
        drawn = 0
        for index, (label, history) in enumerate(lines.items()):
            values = read(history)
            if values is None:
                continue
            drawn += 1
            panel.plot(
                1e3 * np.asarray(history.time), factor * np.asarray(values),
                color=colors[index % len(colors)], label=label or None,
            )  # fmt: skip
        if not drawn:
            raise ValueError(
                f"Argument `names` must be signals of the scene, but it has no {name!r}: the part "
                "is missing from it."
            )
        panel.set_ylabel(title, fontsize="small")
    panels[-1].set_xlabel(_TIME)
    style.legend(panels[0])
    return tuple(panels)


def energies(result: Result, *, axes: "Axes | None" = None) -> "Axes":
    """Stored energies over time [J]: of the motions of parcel and fence, of the fence's bending and
    of the contacts.

    >>> axes = fj.plot.energies(fj.simulate(fj.scenes.oblique_impact()))
    >>> axes.get_ylabel()
    'energy held [J]'
    """
    history = single_history(result)
    axes = style.prepared(axes)
    for index, name in enumerate(("parcel", "fence", "strain", "contact")):
        title = {
            "parcel": "motion of the parcel",
            "fence": "motion of the fence",
            "strain": "bending of the fence",
            "contact": "pressed-in corners",
        }[name]
        values = np.asarray(getattr(history.energy, name))
        axes.plot(
            1e3 * np.asarray(history.time), values, color=style.LINES[index], label=title
        )
    axes.set_xlabel(_TIME)
    axes.set_ylabel("energy held [J]")
    style.legend(axes)
    return axes


def _named(signals: Signals) -> dict[str, Trace]:
    many = signals if isinstance(signals, Mapping) else {"": signals}
    return {
        name: one if isinstance(one, Trace) else Trace.of(one) for name, one in many.items()
    }


def _over_time(signals: Signals, field: str, factor: float, axes: "Axes | None") -> "Axes":
    axes = style.prepared(axes)
    many = _named(signals)
    colors = style.COLORS if len(many) > 1 else style.LINES
    for index, (name, trace) in enumerate(many.items()):
        value = factor * np.asarray(getattr(trace, field))
        color = colors[index % len(colors)]
        axes.plot(1e3 * np.asarray(trace.time), value, color=color, label=name or None)
    axes.set_xlabel(_TIME)
    return axes


def force(
    signals: Signals, *, stiff_force: float | None = None, axes: "Axes | None" = None
) -> "Axes":
    """Normal force of the fence on the parcel [N] over time [ms]. Without given axes the time axis
    ends soon after the last force.

    **Arguments:**

    - `signals`: a result or trace, or several by name (before, after).
    - `stiff_force`: N_stiff [N], drawn as a line across.
    - `axes`: where to draw; by default a figure of page width.

    >>> result = fj.simulate(fj.scenes.oblique_impact())
    >>> axes = fj.plot.force({"paper": result}, stiff_force=3294.0)
    """
    own = axes is None
    axes = _over_time(signals, "force", 1.0, axes)
    pressed = [np.asarray(t.time)[np.asarray(t.force) > 0] for t in _named(signals).values()]
    ends = [1e3 * times[-1] for times in pressed if times.size]
    if own and ends:
        begin, end = axes.get_xlim()
        axes.set_xlim(begin, min(end, max(ends) + _AFTER * (max(ends) - begin)))
    if stiff_force is not None:
        axes.axhline(
            stiff_force, color="black", linestyle="--", linewidth=1, label="rigid obstacle"
        )
    axes.set_ylabel("reaction force N [N]")
    axes.set_ylim(bottom=0)
    style.legend(axes)
    return axes


def tip_deflection(
    signals: Signals, *, limit: float | None = None, axes: "Axes | None" = None
) -> "Axes":
    """Deflection of the tip [mm] over time [ms], with `limit` [m] on either side.

    >>> result = fj.simulate(fj.scenes.oblique_impact())
    >>> axes = fj.plot.tip_deflection(result, limit=0.08)
    """
    axes = _over_time(signals, "deflection", 1e3, axes)
    if limit is not None:
        for side, label in ((1, "limit"), (-1, None)):
            axes.axhline(
                side * 1e3 * limit, color="black", linestyle="--", linewidth=1, label=label
            )
    axes.set_ylabel("tip deflection [mm]")
    style.legend(axes)
    return axes
