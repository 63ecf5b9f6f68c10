"""Reports of the design jobs: tables, sentences, JSON files and figures."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fencejax import plot
from fencejax.design import (
    DesignSpace,
    Evaluation,
    Limit,
    Optimum,
    Quantity,
    Record,
    Verification,
    objectives,
)
from fencejax.printing import shown
from fencejax.results import Status

from .files import write_figure, write_whole

_FORCE = objectives.PEAK_FORCE
# The most lanes named in a line.
_MOST_LANES = 3
_SHOWN = {"m": (1e3, "mm"), "Pa": (1e-6, "MPa"), "N": (1.0, "N"), "1": (1.0, "1")}


def progress_line(record: Record, objective: Quantity = _FORCE) -> str:
    """One line an evaluation."""
    if record.failed:
        text = f"failed: {Status(record.status).text}"
    else:
        title = objective.name.replace("_", " ")
        text = f"{title} {record.objective:9.6g} {objective.unit}"
        text += f"  violation {record.violation:8.1e}"
        if not math.isnan(record.kkt):
            text += f"  KKT {record.kkt:8.1e}"
    finer = sum(record.rungs[1:])
    text += f"  {finer} computed finer" if finer else ""
    text += f"  {record.in_doubt} in doubt" if record.in_doubt else ""
    return f"{record.evaluation:4d}  round {record.outer:2d}  {text}  {record.elapsed:6.1f} s"


def _worst(limit: Limit, values) -> tuple[float, float, int]:
    """Value and margin of the lane in which a limit is tightest, and that lane."""
    margin = np.asarray(limit.margin_of(np.asarray(values)))
    lane = int(np.argmin(margin))
    return float(np.asarray(values)[lane]), float(margin[lane]), lane


def table(
    rows: dict, limits: tuple[Limit, ...], lanes, stiff=None, objective: Quantity = _FORCE
) -> str:
    """Designs side by side: the worst impact of the objective and of every limit.

    `rows` holds measurements by column title; each column shows the value and, for a limit, its
    margin. `stiff`: the forces [N] of a rigid obstacle, one an impact, to compare with.
    """
    titles = list(rows)
    wide = 23
    lines = ["".join([f"{'worst of the impacts':<34}", *(f"{t:>{wide}}" for t in titles)])]
    cells = []
    for measured in rows.values():
        values = np.asarray(measured[objective.name])
        distance, mass = lanes[int(np.argmax(values))]
        cells.append(f"{values.max():.6g} ({distance:g} m, {mass:g} kg)")
    title = f"{objective.name.replace('_', ' ')} [{objective.unit}]"
    lines.append("".join([f"{title:<34}", *(f"{c:>{wide}}" for c in cells)]))
    if stiff is not None and objective is _FORCE:
        drops = [float(np.min(stiff / np.asarray(m["peak_force"]))) for m in rows.values()]
        title = "rigid obstacle's force over it [1]"
        lines.append("".join([f"{title:<34}", *(f"{d:>{wide}.2f}" for d in drops)]))
    for limit in limits:
        factor, unit = _SHOWN.get(limit.quantity.unit, (1.0, limit.quantity.unit))
        sign = "<=" if limit.sense == "at most" else ">="
        title = f"{limit.name.replace('_', ' ')} {sign} {factor * limit.bound:g} {unit}"
        cells = []
        for measured in rows.values():
            value, margin, _ = _worst(limit, measured[limit.name])
            cells.append(f"{factor * value:.2f} ({margin:+.4f})")
        lines.append("".join([f"{title:<34}", *(f"{c:>{wide}}" for c in cells)]))
    lines.append("(margins in brackets; a limit holds at 0 or more)")
    return "\n".join(lines)


def aligned(rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> list[str]:
    """Rows of cells as lines of columns, those named aligned to the left."""
    wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if index in left else cell.rjust(width)
            for index, (cell, width) in enumerate(zip(row, wide, strict=True))
        ).rstrip()
        for row in rows
    ]


def design_table(space: DesignSpace, before, after) -> str:
    """The variables before and after, with their bounds."""
    lines = [f"{'design':<34}{'before':>22}{'after':>22}   bounds"]
    for variable, old, new in zip(space.variables, before, after, strict=True):
        title = f"{variable.name.replace('_', ' ')} [{variable.unit}]"
        share = float(variable.share(new))
        note = "  (on its lower bound)" if share < 1e-2 else ""
        note = "  (on its upper bound)" if share > 1 - 1e-2 else note
        lines.append(
            f"{title:<34}{float(old):>22.5g}{float(new):>22.5g}   "
            f"{variable.lower:g} ... {variable.upper:g}{note}"
        )
    return "\n".join(lines)


def to_logarithms(space: DesignSpace, at: Evaluation) -> np.ndarray:
    """The factors from derivatives in the shares s to those in ln p: p / (dp / ds)."""
    values = np.asarray(space.from_shares(at.point))
    spans = [
        variable.upper - variable.lower
        if variable.scaling == "linear"
        else value * math.log(variable.upper / variable.lower)
        for variable, value in zip(space.variables, values, strict=True)
    ]
    return values / np.asarray(spans)


def elasticities(
    space: DesignSpace,
    limits: tuple[Limit, ...],
    at: Evaluation,
    measured,
    objective: Quantity = _FORCE,
) -> dict[str, dict[str, float]]:
    """d ln Q / d ln p [1] of the objective and of the limited quantities that are positive, each
    in the impact where it is worst; 0 for a variable whose value is 0."""
    factor = to_logarithms(space, at)
    count = at.objectives.size
    worst = int(np.argmax(at.objectives))
    rows = {objective.name: at.objective_rows[worst] / at.objectives[worst]}
    for index, limit in enumerate(limits):
        value, _, lane = _worst(limit, measured[limit.name])
        if value > 0:
            slope = at.margin_rows[index * count + lane] * limit.unit_of_margin / value
            rows[limit.name] = -slope if limit.sense == "at most" else slope
    return {
        name: dict(zip(space.names, (row * factor).tolist(), strict=True))
        for name, row in rows.items()
    }


def conditions(optimum: Optimum) -> str:
    """The residuals of the conditions of Karush, Kuhn and Tucker at an optimum, a line."""
    left = optimum.residual
    return (
        f"KKT: stationarity {left.stationarity:.1e}, complementarity {left.complementarity:.1e}, "
        f"violation {left.violation:.1e}\n"
    )


def verdict(fidelity: str, objective: Quantity, found: Verification) -> str:
    """The comparison of an optimum with a finer fidelity, a line."""
    return (
        f"{fidelity}: the optimiser's {objective.name.replace('_', ' ')} is off by "
        f"{100 * found.error:+.2f} %, margins by up to {found.margin_error:.3f}: {found.text}"
    )


def verified(fidelity: str, found: Verification) -> dict[str, Any]:
    """The same for a JSON file."""
    return {
        "fidelity": fidelity,
        "confirmed": found.confirmed,
        "doubts": found.doubts,
        "error": found.error,
        "margin_error": found.margin_error,
        "violation": found.violation,
    }


def most(limits: Sequence[Limit], name: str) -> float | None:
    """The largest value of a quantity within the limits; `None` where it is not limited."""
    bounds = (one.bound for one in limits if one.name == name and one.sense == "at most")
    return min(bounds, default=None)


def result_of(feasible: bool) -> str:
    """The beginning of the sentence with the result, for a feasible design or another one."""
    if feasible:
        return "Result for this machine:"
    return "No design holds all limits. The nearest one has"


def mine(
    value: float, quantity: Quantity, of: str, where: str = "", stiff: float | None = None,
    push: float | None = None, obstacle: float | None = None, feasible: bool = True,
) -> str:  # fmt: skip
    """The result for the machine in one sentence, with references to compare it with: a rigid fence
    of that shape, a constant push, a rigid obstacle. A design that is not `feasible` breaks limits,
    and the sentence says so."""
    text = f"{result_of(feasible)} {shown(value, quantity.unit)}, the {of}"
    text += f" ({where})" if where else ""
    if stiff is not None:
        text += f"; a fence of that shape that does not bend: {shown(stiff, quantity.unit)}"
    if push is not None:
        text += f"; a constant push would need {shown(push, 'N', 3)}"
    if obstacle is not None:
        text += f"; a rigid obstacle there: {shown(obstacle, 'N')}"
    return text + "."


def failed_start(text: Callable[[int], str], statuses: np.ndarray) -> str:
    """The message where the first design cannot be evaluated: the lanes, each as its `text`, their
    statuses with the meanings, and what to do."""
    lines = ["the search cannot begin, for the first design cannot be evaluated:"]
    for code in sorted(set(np.asarray(statuses).tolist()), reverse=True):
        status = Status(int(code))
        if status <= Status.LEFT_OVER_TIP or status.numerical:
            continue
        lanes = np.flatnonzero(np.asarray(statuses) == code)
        where = "; ".join(text(int(lane)) for lane in lanes[:_MOST_LANES])
        more = f"; and {len(lanes) - _MOST_LANES} more" if len(lanes) > _MOST_LANES else ""
        lines.append(f"  {where}{more}: {status.name}, {status.text}")
    lines.append(
        "Begin at another design, by --set with a sorter file; python -m optimize.design looks for "
        "one that can be evaluated by itself."
    )
    return "\n".join(lines)


def infeasible(optimum: Optimum) -> str:
    """The message where no feasible design was found."""
    return (
        "no feasible design found. The design above is the least-violating one of all that were "
        f"tried: it breaks a limit by {100 * optimum.residual.violation:.3g} %, reserve included. "
        "Relax that limit, widen the bounds, or add variables."
    )


def ended(optimum: Optimum) -> dict[str, Any]:
    """How a search ended, for a JSON file."""
    return {
        "stop": optimum.ended,
        "converged": optimum.converged,
        "feasible": optimum.feasible,
        "evaluations": len(optimum.history),
        "residual": optimum.residual._asdict(),
    }


def save(axes: Any, path: Path) -> None:
    """Write the figure that some axes are part of."""
    write_figure(path, axes.get_figure(root=True))


def _plain(value):
    """The same without arrays and without numbers that JSON lacks."""
    if isinstance(value, dict):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_json(path: Path, content) -> None:
    """Write plain numbers, indented; numbers that are not finite become null."""
    write_whole(path, json.dumps(_plain(content), indent=2, allow_nan=False) + "\n")


def history_rows(
    space: DesignSpace, optimum: Optimum, objective: Quantity = _FORCE
) -> list[dict]:
    """The evaluations as plain dictionaries."""
    rows = []
    for record in optimum.history:
        rows.append({
            "evaluation": record.evaluation,
            "round": record.outer,
            "design": space.named(space.from_shares(record.point)),
            objective.name: record.objective,
            "violation": record.violation,
            "stationarity": None if record.residual is None else record.residual.stationarity,
            "complementarity":
                None if record.residual is None else record.residual.complementarity,
            "status": Status(record.status).name,
            "failed": record.failed,
            "rungs": record.rungs,
            "elapsed": record.elapsed,
        })  # fmt: skip
    return rows


def draw(
    out: Path,
    force: dict[str, plot.Trace],
    deflection: dict[str, plot.Trace],
    stiff: float | None,
    tip_limit: float | None,
    optimum: Optimum,
    tolerance: float,
    bars: dict[str, dict[str, float]],
) -> None:
    """Write the four figures: force and deflection in the impacts where they are largest, the
    deflection with its limit, if any, and the convergence and gradients of the search."""
    drawn = {
        "force": plot.force(force, stiff_force=stiff),
        "tip_deflection": plot.tip_deflection(deflection, limit=tip_limit),
        "convergence": plot.convergence(optimum.history, tolerance=tolerance)[0],
        "gradient": plot.gradient_bars(bars),
    }
    for name, axes in drawn.items():
        save(axes, out / f"{name}.png")
