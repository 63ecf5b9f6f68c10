"""The page of the design job: `report.html`, with the fence's drawing and its DXF file."""

import math

import numpy as np

import fencejax as fj
from fencejax import plot
from fencejax.design import fatigue
from fencejax.plot import Trace
from fencejax.printing import shown
from fencejax.results import counted
from fencejax.sorter import Look

from ..common import pages, report
from ..common.amounts import changed, plain
from ..common.html_report import Figure, Part, Report, Section, Table, Text
from ..common.nearby import SHARE, room_text
from . import words
from .outcome import Outcome
from .tolerances import Moved, tolerances

_MOST_PARCELS, _MOST_BARS, _MOST_COLUMNS = 40, 5, 6


def write(outcome: Outcome) -> None:
    """Write the page and its files."""
    config, problem = outcome.config, outcome.problem
    machine = problem.machine
    title = machine.title or config.sorter
    Report(
        f"A fence for {title}",
        _question(outcome),
        "\n".join(_answer(outcome)),
        outcome.succeeded,
        [
            Section("The machine", pages.machine_tables(machine)),
            Section("The design", _design(outcome)),
            Section("Materials and sizes compared", _candidates(outcome)),
            Section("Results and limits", _results(outcome)),
            Section("Figures", _figures(outcome)),
            Section("What decides", _decides(outcome)),
            Section("Tolerances", _tolerances(outcome)),
            Section("Statuses and checks", _checks(outcome)),
            pages.assumptions(*_own_assumptions(outcome)),
            pages.again(config, "design"),
        ],
    ).write(config.out)


def _question(outcome: Outcome) -> str:
    machine = outcome.problem.machine
    worst = "worst " if machine.objective.over == "worst" else ""
    free = ", ".join(plain(n.rpartition(".")[2]) for n in outcome.problem.variable_names)
    kinds = len(outcome.problem.candidates)
    return (
        f"Which fence sorts the {machine.parcels.count} parcels and places of "
        f"{machine.title or 'this machine'} with the smallest "
        f"{worst}{words.objective(outcome.problem)}, within {len(outcome.problem.limit_names)} "
        f"limits? Free: {free or 'nothing'}; {kinds} candidate{'s' if kinds > 1 else ''} of "
        "material and sizes."
    )


def _answer(outcome: Outcome) -> list[str]:
    problem, best = outcome.problem, outcome.best
    lines = [words.mine(problem, best, outcome.stiff, outcome.push)]
    if not best.feasible:
        fighting = ", ".join(plain(price.name) for price in best.prices[:4])
        lines.insert(0, "No design was found that holds all limits; the nearest one is shown." + (
            f" These fight: {fighting}." if fighting else ""
        ))  # fmt: skip
    design = problem.values(best.after.point)
    numbers = ", ".join(
        f"{plain(n.rpartition('.')[2])} {shown(v, problem.unit(n))}" for n, v in design.items()
    )
    lines.append(f"{best.candidate.name}: {numbers or 'as described'}. It {words.verdict(best)}.")
    if not best.improved and best.optimum is not None:
        lines.append("Nothing better than the start was found.")
    if best.verified is not None and not best.verified.confirmed:
        lines.append(f"The finer fidelity has {best.verified.text}.")
    return lines


# ---- the design


def _looks(outcome: Outcome) -> dict[str, Look]:
    best = outcome.best
    if not best.improved:
        return {"as it is": best.after}
    return {"before": best.before, "after": best.after}


def _design(outcome: Outcome) -> list[Part | str]:
    problem, best, config = outcome.problem, outcome.best, outcome.config
    parts: list[Part | str] = []
    if problem.space is not None:
        looks = {
            name: problem.space.from_shares(look.point) for name, look in _looks(outcome).items()
        }
        parts.append(pages.design_table(problem.space, looks))
    scene, sheet = problem.scene(best.after.point, best.candidate, 0), best.candidate.material
    assert scene.fence is not None
    title = f"Fence, {problem.machine.title or config.sorter}"
    fence = pages.fence_parts(config.out, scene.fence, title, sheet.name, sheet.conditions)
    drive = pages.scene_table(scene, "The drive's numbers", _OTHERS)
    return [*parts, *fence, drive]


_OTHERS = ("parcel", "start", "belt", "fence", "fence_friction", "border", "motor")


def _candidates(outcome: Outcome) -> list[Part | str]:
    titles, *rows = words.ranking_rows(outcome.problem, outcome.solutions)
    titles = [*map(plain, titles[:-1]), "limits", "the search ended"]
    every = [[*row, one.stop] for row, one in zip(rows, outcome.solutions, strict=True)]
    if len(every) == 1:
        return ["There is one candidate."]
    head = "Each was designed for itself; the first in rank is reported below and drawn above."
    if len(every) > _MOST_COLUMNS:
        return [head, Table(titles, every, "", "", frozenset({0}))]
    across = [list(row) for row in zip(titles, *every, strict=True)]
    return [head, Table(across[0], across[1:])]


# ---- results


def _results(outcome: Outcome) -> list[Part | str]:
    problem, best = outcome.problem, outcome.best
    looks, quantity = _looks(outcome), problem.machine.objective.quantity
    values = [shown(look.objective, quantity.unit) for look in looks.values()]
    titles = ["", "bound", *(each for name in looks for each in (name, "margin")), "where"]
    rows = [[
        words.objective(problem), "minimised", *(each for value in values for each in (value, "")),
        words.hardest(problem, best.after),
    ]]  # fmt: skip
    for name, limit in problem.limits(best.candidate):
        unit, sign = limit.quantity.unit, "≤" if limit.sense == "at most" else "≥"
        row, lane = [plain(name), f"{sign} {shown(limit.bound, unit, 3)}"], None
        for look in looks.values():
            value, lane = words.worst(problem, look, name)
            row += [shown(value, unit), f"{float(limit.margin_of(value)):+.3f}"]
        rows.append([*row, "" if lane is None else problem.machine.parcels.text(lane)])
    rows.append([
        "fence that does not bend", "for comparison",
        *("" for _ in range(2 * len(looks) - 2)), shown(outcome.stiff, quantity.unit), "", "",
    ])  # fmt: skip
    if outcome.push is not None:
        rows.append([
            "constant push, point mass", "for comparison",
            *("" for _ in range(2 * len(looks) - 2)), shown(outcome.push, "N"), "", "",
        ])  # fmt: skip
    note = (
        "A limit holds at a margin of 0 or more, of what its bound measures; the tightest parcel "
        "is shown. The search keeps "
        f"{outcome.config.reserve:g} of every sort's margin in hand."
    )
    return [Table(titles, rows, "Objective and limits", note, frozenset({0})), *_parcels(outcome)]


def _parcels(outcome: Outcome) -> list[Part | str]:
    """Every parcel's numbers, or the hardest ones'."""
    problem, best = outcome.problem, outcome.best
    parcels, measured = problem.machine.parcels, best.after.measured
    quantity = problem.machine.objective.quantity
    quantities = [q for q in problem.quantities if q.fields != ()]
    order = np.arange(parcels.count)
    caption = "Every parcel at the design"
    if parcels.count > _MOST_PARCELS:
        order = np.argsort(-measured.values[quantity.name], kind="stable")[:_MOST_PARCELS]
        caption = f"The {_MOST_PARCELS} hardest parcels of {parcels.count}"
    weighted = [] if np.ptp(parcels.weights) == 0 else ["weight"]
    titles = ["parcel", *weighted, *(plain(q.name) for q in quantities), "status"]
    rows = [
        [parcels.text(int(k)), *(f"{parcels.weights[k]:.4g}" for _ in weighted),
         *(shown(float(measured.values[q.name][k]), q.unit, 3) for q in quantities),
         fj.Status(int(measured.statuses[k])).name]
        for k in order
    ]  # fmt: skip
    return [Table(titles, rows, caption)]


def _figures(outcome: Outcome) -> list[Part | str]:
    best, problem = outcome.best, outcome.problem
    parts: list[Part | str] = []
    if outcome.config.picture:
        parts += _pictures(outcome)
    if best.optimum is None or len(best.optimum.history) < 2:
        return parts
    goal = problem.machine.objective
    label = "worst case" if goal.over == "worst" else words.objective(problem)
    drawn = plot.convergence(
        best.optimum.history, unit=goal.quantity.unit, label=label,
        tolerance=outcome.config.tolerance,
    )[0]  # fmt: skip
    parts.append(Figure.of_axes(
        drawn, f"The search: the {label}, what limits are broken by, and how far the conditions "
        "of optimality are from holding.",
    ))  # fmt: skip
    bars = _elasticities(outcome)
    if bars:
        parts.append(Figure.of_axes(
            plot.gradient_bars(bars),
            "What 1 % more of a number does in percent, by the exact gradient: to the "
            f"{label}, and to limited quantities where they are at their worst.",
        ))  # fmt: skip
    return parts


def _pictures(outcome: Outcome) -> list[Part | str]:
    """The hardest parcel's sort from above, and its force over time."""
    problem, best = outcome.problem, outcome.best
    values = best.after.measured.values[problem.machine.objective.quantity.name]
    lane = int(np.argmax(values))
    scene = problem.scene(best.after.point, best.candidate, lane)
    fidelity = getattr(fj.Fidelity, outcome.config.check)()
    result = fj.simulate(scene, fidelity=fidelity, history=True)
    trace = Trace.of(result)
    pressed = np.asarray(trace.time)[np.asarray(trace.force) > 0]
    first, last = (float(pressed[0]), float(pressed[-1])) if pressed.size else (0.0, scene.duration)
    times = np.linspace(first, last, 4)
    text = problem.machine.parcels.text(lane)
    above = plot.draw_scene(scene, result, times, path=True, fidelity=fidelity)
    return [
        Figure.of_axes(above, f"The hardest parcel, {text}, from the first contact to the last."),
        Figure.of_axes(plot.force({text: trace}), f"The force of the fence on it, {text}."),
        Figure.of_axes(plot.tip_deflection({text: trace}), f"How far the tip bends, {text}."),
    ]


def _elasticities(outcome: Outcome) -> dict[str, dict[str, float]]:
    problem, best = outcome.problem, outcome.best
    at = None if best.optimum is None else best.optimum.last
    if at is None or at.failed or problem.space is None or not best.improved:
        return {}
    quantity, values = problem.machine.objective.quantity, best.after.measured.values
    bars = report.elasticities(problem.space, (), at, values, quantity)
    if problem.machine.objective.over != "worst":
        bars = {words.objective(problem): row for row in bars.values()}
    factor, start, near = report.to_logarithms(problem.space, at), 0, []
    limits = problem.limits(best.candidate)
    for (name, limit), rows in zip(limits, problem.margin_rows, strict=True):
        value, lane = words.worst(problem, best.after, name)
        slope = at.margin_rows[start + (lane or 0)] * limit.unit_of_margin
        start += rows
        if value > 0 and limit.name not in bars:
            slope = (-slope if limit.sense == "at most" else slope) / value * factor
            near.append((float(limit.margin_of(value)), limit.name, slope))
    for _, name, slope in sorted(near, key=lambda row: row[0]):
        bars[name] = dict(zip(problem.space.names, slope.tolist(), strict=True))
    kept = list(bars)[:_MOST_BARS]
    return {name: dict(_short(bars[name])) for name in kept if any(bars[name].values())}


def _short(row: dict[str, float]) -> list[tuple[str, float]]:
    """The numbers by the ends of their paths, where these are unique."""
    ends = [name.rpartition(".")[2] for name in row]
    return list(zip(ends if len(set(ends)) == len(ends) else row, row.values(), strict=True))


# ---- what decides, tolerances


def _decides(outcome: Outcome) -> list[Part | str]:
    problem = outcome.problem
    parts: list[Part | str] = []
    for one in outcome.solutions:
        if not one.prices:
            if one is outcome.best:
                parts.append(words.decides(problem, one))
            continue
        rows = [
            [plain(price.name), shown(price.bound, price.unit), shown(price.relaxed, price.unit),
             words.gained(problem, one, price), "; ".join(price.parcels[:4])]
            for price in one.prices
        ]  # fmt: skip
        head = words.decides_head(problem, one).rstrip(":")
        titles = ["limit or bound", "now", "relaxed to", "worth", "parcels that decide"]
        parts.append(Table(titles, rows, f"{one.candidate.name}. {head}"))
    parts.append(
        "Each is a shadow price: the rate at which the objective falls, times a tenth of the "
        "bound. It holds near the design, one at a time. What is not in the table costs nothing."
    )
    return parts


def _tolerances(outcome: Outcome) -> list[Part | str]:
    problem, best = outcome.problem, outcome.best
    unit = problem.machine.objective.quantity.unit
    if not math.isfinite(best.after.violation):
        return ["The design cannot be evaluated, so nothing can be said of designs near to it."]
    found = tolerances(problem, best, getattr(fj.Fidelity, outcome.config.check)())
    if not found.rows:
        return ["Nothing of this design can be moved: no number is free or one of several."]

    def row(one: Moved) -> list[str]:
        linear, margin, room = "", "", ""
        if one.predicted is not None and one.predicted_margin is not None:
            linear, margin = changed(one.predicted, found.objective), f"{one.predicted_margin:+.3f}"
            room = room_text(one.room or 0.0)
        more = one.doubtful - found.doubtful
        doubt = f"; {more} more in doubt" if more > 0 else ""
        broken = one.margin < -outcome.config.feasibility
        breaks = f"{plain(one.limit)} broken" if broken else "held"
        return [
            plain(one.name).replace(".", ", "), shown(one.value, one.unit),
            f"{100 * one.share:+.0f} %", linear, changed(one.simulated, found.objective), margin,
            f"{one.margin:+.3f}", (breaks if one.limit else "") + doubt, room,
        ]  # fmt: skip

    titles = [
        "number", "value", "moved by", "objective, gradient", "objective, simulated",
        "least margin, gradient", "least margin, simulated", "limits, simulated",
        "may be off by so much",
    ]  # fmt: skip
    rows = [row(one) for one in found.rows]
    holds = found.margin >= -outcome.config.feasibility
    kept = [0, 1, 2, 3, 4, 5, 6, 7, 8] if holds else [0, 1, 2, 3, 4, 5, 6, 7]
    if not any(r[3] for r in rows):
        kept = [0, 1, 2, 4, 6, 7]
    titles, rows = [titles[k] for k in kept], [[r[k] for k in kept] for r in rows]
    note = (
        f"The design as it is: {shown(found.objective, unit)}, least margin {found.margin:+.3f}. "
        "Gradient: exact derivatives from the search, along a straight line. Simulated: every sort "
        f"again with the number moved, at {outcome.config.check}."
    )
    if 8 in kept:
        note += (
            " The last column: how far the number may be off that way until the first limit is "
            "used up, by the gradient."
        )
    parts: list[Part | str] = [
        f"Each number of the design by itself is {100 * SHARE:g} % smaller and larger; all else "
        "is as designed.",
        Table(titles, rows, "", note),
    ]
    if found.still:
        parts.append(f"Of {', '.join(map(plain, found.still))} no share can be taken: it is 0.")
    if len(problem.machine.materials) == 1:
        parts.append(
            "Of the material's own numbers this run has no derivatives: modulus, density and "
            "damping are moved, too, where a sorter file names several materials."
        )
    return parts


# ---- statuses, assumptions


def _checks(outcome: Outcome) -> list[Part | str]:
    problem, best, config = outcome.problem, outcome.best, outcome.config
    parts: list[Part | str] = [
        pages.status_table(counted(best.after.measured.statuses), "Sorts at the design by status")
    ]
    trouble = problem.troubles(best.after.measured.statuses)
    if trouble:
        parts += ["Not to be relied on:", Text("\n".join(f"- {text}" for text in trouble))]
    if best.optimum is not None:
        parts.append(pages.search_text(best.optimum))
    if best.verified is not None:
        checked = words.doubts(best)
        parts.append(f"Searched at the fidelity {config.fidelity}; {checked} ({config.check}).")
    start = words.start_troubles(problem, best)
    if start:
        parts.append(Text("\n".join(f"- {line.strip()}" for line in start.strip().splitlines())))
    return parts


def _own_assumptions(outcome: Outcome) -> list[str]:
    machine, best = outcome.problem.machine, outcome.best
    sheet = best.candidate.material
    lines = [
        words.material(sheet),
        f"The {machine.parcels.count} parcels and places stand for all that the machine meets.",
    ]
    if sheet.fatigue_strength is not None:
        borne = f"1e7 reversed cycles bear {shown(float(sheet.fatigue_strength), 'Pa')}."
        lines.append(f"The stress is compared with what is allowed once; {borne}")
        if fatigue.FATIGUE_STRESS in outcome.problem.quantities:
            lines[-1] = (
                f"For the life {borne} Cycles are counted as rainflow, their means taken in after "
                "Smith, Watson and Topper, summed by Miner's rule along Basquin's line, exponent "
                f"{shown(float(fatigue.exponent_of(sheet.material)), '1', 3)}."
            )
    return lines

