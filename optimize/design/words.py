"""The reports of the designs: tables and sentences."""

import jax
import numpy as np

from fencejax.design import Stop, fatigue
from fencejax.parts import DataSheet, materials
from fencejax.printing import shown
from fencejax.sorter import Look, Price, Solution, SorterProblem

from ..common import nearby, report
from ..common.amounts import plain


def worst(problem: SorterProblem, look: Look, name: str) -> tuple[float, int | None]:
    """The value of a limited quantity where its margin is least, and the parcel."""
    values = problem.bounded(name, look.measured)
    start = 0
    for other, rows in zip(problem.limit_names, problem.margin_rows, strict=True):
        if other == name:
            lane = int(np.argmin(look.margins[start : start + rows]))
            return float(values[lane]), lane if rows > 1 else None
        start += rows
    raise KeyError(name)


def measured(problem: SorterProblem, values: np.ndarray) -> float:
    """One number a parcel by the objective's measure over the parcels."""
    machine = problem.machine
    return float(machine.objective.over_parcels(values, machine.parcels.weights))


def objective(problem: SorterProblem) -> str:
    """The objective by its name: `"peak force"` of a worst case, `"CVaR of the peak force"`."""
    name, over = plain(problem.machine.objective.quantity.name), problem.machine.objective.over
    return {"mean": f"mean {name}", "cvar": f"CVaR of the {name}"}.get(over, name)


def hardest(problem: SorterProblem, look: Look) -> str:
    """The parcel with the largest objective; beside a mean or a CVaR, with its own number."""
    quantity = problem.machine.objective.quantity
    values = look.measured.values[quantity.name]
    lane = int(np.argmax(values))
    text = problem.machine.parcels.text(lane)
    if problem.machine.objective.over == "worst":
        return text
    return f"largest {shown(values[lane], quantity.unit)}, {text}"


def ranking_rows(problem: SorterProblem, solutions: list[Solution]) -> list[list[str]]:
    """Titles, and a row a candidate, the best first."""
    quantity = problem.machine.objective.quantity
    unit = lambda name: problem.limited(name).unit  # noqa: E731
    titles = ["candidate", *(name.partition(".")[2] for name in problem.variable_names)]
    titles += [objective(problem), *map(plain, problem.limit_names), ""]
    rows = [titles]
    for one in solutions:
        design = problem.values(one.after.point)
        row = [one.candidate.name]
        row += [shown(v, problem.unit(name)) for name, v in design.items()]
        row.append(shown(one.after.objective, quantity.unit))
        for name in problem.limit_names:
            value, _ = worst(problem, one.after, name)
            row.append(shown(value, unit(name), 3))
        row.append(verdict(one))
        rows.append(row)
    return rows


def ranking(problem: SorterProblem, solutions: list[Solution]) -> str:
    """The same as text."""
    return "\n".join(report.aligned(ranking_rows(problem, solutions)))


def verdict(one: Solution) -> str:
    """Whether a design holds the limits, in words."""
    if not np.isfinite(one.after.violation):
        return "cannot be evaluated"
    if not one.feasible:
        return f"breaks a limit by {100 * one.after.violation:.3g} %"
    return "holds all limits"


def before_and_after(problem: SorterProblem, one: Solution) -> str:
    """The design before and after with its bounds, and every limit with its margin and parcel."""
    looks = [one.before, one.after] if one.improved else [one.before]
    heads = ["before", "after"][: len(looks)]
    lines = [f"{'design':<26}" + "".join(f"{head:>20}" for head in heads) + "   bounds"]
    for index, name in enumerate(problem.variable_names):
        assert problem.space is not None
        variable, unit = problem.space.variables[index], problem.unit(name)
        cells = [problem.values(each.point)[name] for each in looks]
        share = looks[-1].point[index]
        note = " (on the lower one)" if share < 1e-3 else ""
        note = " (on the upper one)" if share > 1 - 1e-3 else note
        lines.append(
            f"{plain(name):<26}" + "".join(f"{shown(v, unit):>20}" for v in cells)
            + f"   {shown(variable.lower, unit)} ... {shown(variable.upper, unit)}{note}"
        )  # fmt: skip
    quantity = problem.machine.objective.quantity
    lines.append(f"{objective(problem):<26}" + "".join(
        f"{shown(each.objective, quantity.unit):>20}" for each in looks)
        + f"   {hardest(problem, looks[-1])}")  # fmt: skip
    for name, limit in problem.limits(one.candidate):
        found = [worst(problem, each, name) for each in looks]
        unit, sign = limit.quantity.unit, "<=" if limit.sense == "at most" else ">="
        lane = found[-1][1]
        where = "" if lane is None else f", {problem.machine.parcels.text(lane)}"
        title = f"{plain(name)} {sign} {shown(limit.bound, unit, 3)}"
        cells = [f"{shown(v, unit, 3)} ({float(limit.margin_of(v)):+.2f})" for v, _ in found]
        where += _lasting(one, name, found[-1][0])
        lines.append(f"{title:<26}" + "".join(f"{cell:>20}" for cell in cells) + f"   {where[2:]}")
    lines.append("(margins in brackets, with the parcel; a limit holds at 0 or more)")
    return "\n".join(lines)


def _lasting(one: Solution, name: str, stress: float) -> str:
    """The number of sorts that a fence endures at a fatigue stress [Pa]; empty for other limits."""
    sheet = one.candidate.material
    strength = sheet.fatigue_strength
    if name != fatigue.FATIGUE_STRESS.name or strength is None or not stress > 0:
        return ""
    sorts = fatigue.life(stress, strength, fatigue.exponent_of(sheet.material))
    return f", for {float(sorts):.1g} sorts"


def decides(problem: SorterProblem, one: Solution) -> str:
    """The prices of the active limits and bounds of a design."""
    optimum = one.optimum
    if optimum is None or not one.prices:
        if optimum is not None and not optimum.converged:
            return f"No limit and no bound decides where the search ended: {optimum.ended}."
        return "No limit decides, and no bound that could give way."
    lines = []
    for price in one.prices[:6]:
        where = f" ({'; '.join(price.parcels[:3])})" if price.parcels else ""
        old, new = (shown(bound, price.unit) for bound in (price.bound, price.relaxed))
        lines.append(
            f"  {plain(price.name)}{where}: {new} instead of {old}, {gained(problem, one, price)}"
        )
    return "\n".join([decides_head(problem, one), *lines])


def gained(problem: SorterProblem, one: Solution, price: Price) -> str:
    """The gain from relaxing a limit or bound, in words."""
    if one.optimum is not None and one.optimum.feasible:
        return f"{shown(price.gain, problem.machine.objective.quantity.unit, 3)} less"
    return nearby.less_violated(price.gain)


def decides_head(problem: SorterProblem, one: Solution) -> str:
    """The heading of the prices."""
    optimum = one.optimum
    assert optimum is not None
    if optimum.feasible:
        head = f"What decides, and what relaxing it is worth in {objective(problem)}"
        head += ":" if optimum.converged else f" (nearly: {optimum.ended}):"
    elif optimum.stop is Stop.INFEASIBLE:
        head = "No design nearby holds all limits. These fight, and relaxing one is worth:"
    else:
        head = (
            f"No design that holds all limits was found ({optimum.ended}). At the nearest one "
            "these fight, and relaxing one is worth:"
        )
    return head


def start_troubles(problem: SorterProblem, one: Solution) -> str:
    """The sorts at the start without reliable numbers, and the limits that the start breaks."""
    lines = list(problem.troubles(one.before.measured.statuses))
    for name, limit in problem.limits(one.candidate):
        value, lane = worst(problem, one.before, name)
        if not limit.margin_of(value) >= -1e-3:
            where = "" if lane is None else f" ({problem.machine.parcels.text(lane)})"
            bound = shown(limit.bound, limit.quantity.unit, 3)
            value = shown(value, limit.quantity.unit, 3)
            lines.append(f"{plain(name)}{where}: {value}, {limit.sense} {bound}")
    if one.starts > 1:
        lines.append(f"the search began at another design, the {one.starts}th that was tried")
    return "".join(f"\n  the start: {text}" for text in lines)


def mine(
    problem: SorterProblem, one: Solution, stiff: float | None, push: float | None = None
) -> str:
    """The result for the machine in one sentence; of a mean or a CVaR, how it is formed in
    another."""
    machine, goal = problem.machine, problem.machine.objective
    largest = "largest " if goal.over == "worst" else ""
    of = (
        f"{largest}{objective(problem)} over the {machine.parcels.count} parcels and places of "
        f"{machine.title or 'this machine'}, by a fence of {one.candidate.name}"
    )
    where = hardest(problem, one.after) if largest else ""
    text = report.mine(
        one.after.objective, goal.quantity, of, where, stiff, push, feasible=one.feasible
    )
    return text if largest else f"{text} {_formed(problem)}"


def _formed(problem: SorterProblem) -> str:
    """How a mean or a CVaR is formed of the parcels' numbers, in a sentence."""
    goal, weights = problem.machine.objective, problem.machine.parcels.weights
    by = "by the parcels' weights" if np.ptp(weights) > 0 else "with all parcels counted alike"
    if goal.over == "mean":
        return f"Each of these numbers is the mean {by}."
    share = shown(100 * (1 - goal.level), "1", 3)
    return (
        f"Each of these numbers is the mean of the largest {share} % (CVaR at level "
        f"{goal.level:g}), {by}."
    )


def doubts(one: Solution) -> str:
    """The verdict of the finer fidelity."""
    if one.verified is None:
        return ""
    return (
        f"at the finer fidelity the objective differs by {100 * one.verified.error:+.2f} %: "
        f"{one.verified.text}"
    )


def material(sheet: DataSheet) -> str:
    """Where the numbers of a material come from, in a sentence."""
    text = f"The material is {sheet.name}, with numbers "
    conditions = f"for {sheet.conditions or 'no stated conditions'}"
    named = materials.named(sheet.name) if materials.known(sheet.name) else None
    if named is None or jax.tree.leaves(sheet) != jax.tree.leaves(named):
        return f"{text}from the sorter file, {conditions}."
    return (
        f"{text}{conditions}: typical of its class, to be replaced by the supplier's before "
        "anything is built."
    )
