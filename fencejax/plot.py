"""Figures of results and of optimisations: each function draws on axes and returns them.

matplotlib is imported where it is first used, and its global state is left alone: a figure is made
where no axes are given, and belongs to them (`axes.figure`).
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import ArrayLike

from .evaluator import Record
from .result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLORS = ("#8a8a8a", "#0b5fa5", "#c8501e", "#2a8c4a", "#7a4aa0", "#a08a20")
_WIDTH, _HEIGHT = 6.3, 3.2


class Trace(NamedTuple):
    """Signals over time: `time` [s], `force` of the fence on the parcel [N], `deflection` of the
    tip [m]; each of shape (T,)."""

    time: ArrayLike
    force: ArrayLike
    deflection: ArrayLike

    @classmethod
    def of(cls, result: Result) -> "Trace":
        """The signals of a result.

        Raises `ValueError` where it has no history, or is that of a batch.
        """
        history = result.history
        if history is None or np.ndim(history.time) != 1:
            raise ValueError(
                "Argument `result` must hold the history of one scene, but holds "
                f"{'none' if history is None else 'a batch'}. Write simulate(scene, history=True)."
            )
        return cls(history.time, history.fence_force, history.tip_deflection)


Signals = Result | Trace | Mapping[str, Result | Trace]


def _named(signals: Signals) -> dict[str, Trace]:
    many = signals if isinstance(signals, Mapping) else {"": signals}
    return {
        name: one if isinstance(one, Trace) else Trace.of(one) for name, one in many.items()
    }


def _prepared(axes: "Axes | None", height: float = _HEIGHT) -> "Axes":
    if axes is None:
        from matplotlib.figure import Figure

        axes = Figure(figsize=(_WIDTH, height), layout="constrained").subplots()
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def _over_time(signals: Signals, field: str, factor: float, axes: "Axes | None") -> "Axes":
    axes = _prepared(axes)
    many = _named(signals)
    colors = _COLORS if len(many) > 1 else _COLORS[1:]
    for index, (name, trace) in enumerate(many.items()):
        value = factor * np.asarray(getattr(trace, field))
        color = colors[index % len(colors)]
        axes.plot(1e3 * np.asarray(trace.time), value, color=color, label=name or None)
    axes.set_xlabel("time since the start [ms]")
    return axes


def _legend(axes: "Axes") -> None:
    count = len(axes.get_legend_handles_labels()[0])
    if count:
        columns = 2 if count == 4 else 3
        # Above the axes, where it hides nothing.
        axes.legend(
            frameon=False,
            fontsize="small",
            ncols=columns,
            loc="lower left",
            bbox_to_anchor=(0, 1.0),
            columnspacing=1.2,
        )


def force(
    signals: Signals, *, stiff_force: float | None = None, axes: "Axes | None" = None
) -> "Axes":
    """Normal force of the fence on the parcel [N] over time [ms].

    **Arguments:**

    - `signals`: a result or trace, or several by name (before, after).
    - `stiff_force`: N_stiff [N], drawn as a line across.
    - `axes`: where to draw; by default a figure of page width.
    """
    axes = _over_time(signals, "force", 1.0, axes)
    if stiff_force is not None:
        axes.axhline(
            stiff_force, color="black", linestyle="--", linewidth=1, label="rigid obstacle"
        )
    axes.set_ylabel("reaction force N [N]")
    axes.set_ylim(bottom=0)
    _legend(axes)
    return axes


def tip_deflection(
    signals: Signals, *, limit: float | None = None, axes: "Axes | None" = None
) -> "Axes":
    """Deflection of the tip [mm] over time [ms], with `limit` [m] on either side."""
    axes = _over_time(signals, "deflection", 1e3, axes)
    if limit is not None:
        for side, label in ((1, "limit"), (-1, None)):
            axes.axhline(
                side * 1e3 * limit, color="black", linestyle="--", linewidth=1, label=label
            )
    axes.set_ylabel("tip deflection [mm]")
    _legend(axes)
    return axes


def convergence(
    history: Sequence[Record],
    *,
    unit: str = "N",
    scale: float = 1.0,
    tolerance: float | None = None,
    axes: "tuple[Axes, Axes] | None" = None,
) -> "tuple[Axes, Axes]":
    """Above, the worst case [`unit`] at each evaluation; below, violation and the residual of the
    conditions of Karush, Kuhn and Tucker [1], with `tolerance` as a line.

    Evaluations that failed are left out of the lines and marked on the horizontal axis; a point
    with no violation has no mark below.
    """
    if axes is None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(_WIDTH, 1.6 * _HEIGHT), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True)
    else:
        upper, lower = axes
    _prepared(upper)
    _prepared(lower)
    good = [record for record in history if not record.failed]
    number = [record.evaluation for record in good]
    upper.plot(number, [scale * r.objective for r in good], "o-", color=_COLORS[1], markersize=3)
    upper.set_ylabel(f"worst case [{unit}]")
    for label, color, values in (
        ("largest violation", _COLORS[2], [record.violation for record in good]),
        ("KKT residual", _COLORS[1], [record.kkt for record in good]),
    ):
        shown = np.asarray(values, dtype=float)
        shown = np.where(shown > 0, shown, np.nan)
        lower.semilogy(number, shown, "o-", color=color, markersize=3, label=label)
    if tolerance is not None:
        lower.axhline(tolerance, color="black", linestyle="--", linewidth=1, label="tolerance")
    failed = [record.evaluation for record in history if record.failed]
    if failed:
        lower.plot(
            failed, [0] * len(failed), "x", color="black", clip_on=False, label="failed",
            transform=lower.get_xaxis_transform(),
        )  # fmt: skip
    lower.set_xlabel("evaluation")
    lower.set_ylabel("violation, residual [1]")
    if not any(record.violation > 0 or record.kkt > 0 for record in good):
        lower.set_yscale("linear")
    _legend(lower)
    return upper, lower


def gradient_bars(
    elasticities: Mapping[str, Mapping[str, float]], *, axes: "Axes | None" = None
) -> "Axes":
    """Elasticities d ln Q / d ln p [1] as bars: by quantity Q, then by variable p.

    1 means that a 1 % larger p makes Q 1 % larger.
    """
    variables = list(dict.fromkeys(name for row in elasticities.values() for name in row))
    axes = _prepared(axes, height=1.0 + 0.55 * max(3, len(variables)))
    thick = 0.8 / max(1, len(elasticities))
    places = np.arange(len(variables))
    for index, (quantity, row) in enumerate(elasticities.items()):
        axes.barh(
            places + (index - (len(elasticities) - 1) / 2) * thick,
            [row.get(name, 0.0) for name in variables],
            height=0.9 * thick,
            color=_COLORS[1 + index % (len(_COLORS) - 1)],
            label=quantity.replace("_", " "),
        )
    axes.set_yticks(places, [name.replace("_", " ") for name in variables])
    axes.invert_yaxis()
    axes.axvline(0, color="black", linewidth=0.8)
    axes.grid(False, axis="y")
    axes.set_xlabel("elasticity d ln Q / d ln p [1]")
    _legend(axes)
    return axes
