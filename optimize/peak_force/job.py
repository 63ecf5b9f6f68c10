"""The fence that hurts the parcel least: the smallest peak force over the worst of the impacts.

    python -m optimize.peak_force --out out

starts from the paper's two-link fence and minimises the largest peak reaction force, or another
quantity (`--objective`), over impacts at several distances with several masses, under limits on the
tip deflection, the bending stress, the tip clearance and the sort itself. The limits apply to
every impact.

By default the variables are the thickness h_1 and the length ratio l_s / l_p at a fixed reach, and
Young's modulus for the choice of the material. The damping ratio and the density can be added, but
a change of 1 % in them changes the worst peak force of the paper's fence by less than 0.1 %.

A limit ensures that the impacts divert the parcel: within `duration` its centre of gravity must
pass the belt's far edge. The optimum is then compared with the paper's two-link and one-link fences
at the reference fidelity, in the same impacts and in whole sorts.
`--worst-case` does all this for the paper's worst case alone.
"""

import concurrent.futures
import dataclasses
import importlib
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

import fencejax as fj
from fencejax.design import (
    DesignSpace,
    Evaluation,
    Optimum,
    Program,
    Stop,
    minimize,
    verify,
)
from fencejax.plot import Trace

from ..common import command, nearby, report
from . import impacts as batch, page
from .configuration import PeakForceConfig, configure
from .outcome import Outcome

_TITLES = {"before": "two-link", "after": "optimum", "one_link": "one-link"}
_THREE = tuple(_TITLES)


def _measured(config: PeakForceConfig, optimum: Optimum, at: Evaluation) -> dict[str, Any]:
    """Values of an evaluation, from its margins."""
    lanes = at.objectives.size
    found: dict[str, Any] = {config.quantity.name: at.objectives * optimum.scale}
    rows = at.margins.reshape(len(config.limits), lanes) + config.reserve
    for limit, row in zip(config.limits, rows, strict=True):
        span = row * limit.unit_of_margin
        found[limit.name] = limit.bound - span if limit.sense == "at most" else limit.bound + span
    return found


# Least optimisation by the compiler: a program takes two thirds of the time to compile and twice
# the time to run, which pays off for less than a hundred calls.
_SELDOM_RUN = {"xla_backend_optimization_level": 0}


class _Checks:
    """The checks of the two-link fence, the optimum and the one-link fence. They are compiled while
    the optimisation runs, and also computed then for the two given fences."""

    def __init__(self, config: PeakForceConfig, space: DesignSpace, impacts: batch.Impacts):
        name = "reference" if config.reference else config.fidelity
        fidelity = getattr(fj.Fidelity, name)()
        cycle = float(space.drive.cycle)
        # Read here: the programs below are traced, in which no bound can be computed.
        limits, quantity, sorter = config.limits, config.quantity, config.machine

        def impact(fence, drive):
            return batch.measure(fence, drive, impacts, limits, fidelity, objective=quantity)

        def sort(fence, drive):
            return batch.whole_sorts(
                fence, drive, config.sort_front, config.sort_masses, cycle, sorter
            )

        self._space = space
        paper = space.fence, space.drive
        known = [
            jax.tree.map(jnp.asarray, fences)
            for fences in (space.apply(space.values_of(*paper)), (config.one_link, space.drive))
        ]
        pool = concurrent.futures.ThreadPoolExecutor(max_workers=1)

        def computed(function, options):
            program = jax.jit(function, compiler_options=options)
            return program, [jax.device_get(program(*fences)) for fences in known]

        self._impacts = pool.submit(computed, impact, None)
        self._sorts = pool.submit(computed, sort, _SELDOM_RUN) if config.sort_masses else None
        pool.shutdown(wait=False)

    def _three(self, computed, after):
        """The results of all three fences, stacked."""
        program, (two_link, one_link) = computed.result()
        optimum = jax.tree.map(jnp.asarray, self._space.apply(after))
        found = two_link, jax.device_get(program(*optimum)), one_link
        return jax.tree.map(lambda *leaves: np.stack(leaves), *found)

    def impacts(self, after):
        """Measurements and signals of all three, stacked."""
        return self._three(self._impacts, after)

    def sorts(self, after):
        """Measurements of the whole sorts; `None` without any."""
        return None if self._sorts is None else self._three(self._sorts, after)


def main(config: PeakForceConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, print its progress, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = PeakForceConfig() if config is None else config
    space, limits = config.space, config.limits
    impacts = batch.Impacts(
        config.distances, config.masses, config.drive_angle, config.duration, config.machine
    )
    impacts.check(space.fence, space.drive)
    for mass in config.sort_masses:
        cycle = float(space.drive.cycle)
        batch.whole_sort(
            space.fence, space.drive, config.sort_front, mass, cycle, config.machine
        )
    config.out.mkdir(parents=True, exist_ok=True)
    fidelity = getattr(fj.Fidelity, config.fidelity)()
    before = np.asarray(space.values_of(space.fence, space.drive))
    program = Program(
        batch.problem(space, impacts, limits, config.reserve, config.quantity), fidelity.ladder(),
        compiler_options=_SELDOM_RUN,
    )  # fmt: skip
    start = np.asarray(space.to_shares(before))
    for line in config.notes:
        say(line)
    say(
        f"{len(impacts.lanes)} impacts, variables {', '.join(space.names)}; compiling, the first "
        "time ..."
    )
    # The slowest one first: programs are traced one at a time, and compiled in parallel.
    program.trace(start)
    checks = _Checks(config, space, impacts)
    optimum = minimize(
        program,
        start,
        method="sqp" if config.method == "sqp" else optax.adam(1e-2),
        tolerance=config.tolerance,
        feasibility=config.feasibility,
        penalty=config.penalty,
        budget=config.budget,
        progress=lambda record: say(report.progress_line(record, config.quantity)),
    )
    after = np.asarray(space.from_shares(optimum.point))
    say(f"\nstopped: {optimum.ended} ({len(optimum.history)} evaluations)")
    return _confirm(config, optimum, space, impacts, checks, before, after, say, begin)


def _confirm(config, optimum, space, impacts, checks, before, after, say, begin) -> Outcome:
    """Simulate the two designs again, print and write the results."""
    limits = config.limits
    if config.plots:
        # Takes a second, while the checks are computed.
        importlib.import_module("matplotlib.backends.backend_agg")
    stacked, signals = checks.impacts(after)
    old, new, other = ({k: v[i] for k, v in stacked.items()} for i in range(3))
    found = _measured(config, optimum, optimum.last)
    stiff = batch.stiff_forces(impacts, space.drive, float(config.belt.speed))
    label = "reference" if config.reference else config.fidelity
    rows = {
        f"two-link, {label}": old,
        f"one-link, {label}": other,
        f"optimum, {config.fidelity}": found,
        f"optimum, {label}": new,
    }
    say("\n" + report.design_table(space, before, after))
    say("\n" + report.table(rows, limits, impacts.lanes, stiff, config.quantity))
    confirmed = None
    if config.reference:
        rows = [np.zeros(0), *map(np.asarray, batch.margins(limits, new).values())]
        at_reference = new[config.quantity.name], np.concatenate(rows), new["status"]
        verified = verify(
            lambda z: at_reference,
            optimum,
            agreement=config.agreement,
            feasibility=config.feasibility,
        )
        confirmed = verified.confirmed
        say(report.verdict("reference", config.quantity, verified))
    outcome = Outcome(
        optimum, space, before, after,
        {"before": old, "found": found, "after": new, "one_link": other}, {}, stiff,
        confirmed, None, limits, config.quantity, 0.0,
    )  # fmt: skip
    bars = _bars(config, outcome)
    report.write_json(
        config.out / "history.json", report.history_rows(space, optimum, config.quantity)
    )
    stacked = checks.sorts(after)
    sorts = {} if stacked is None else {
        name: {k: v[i] for k, v in stacked.items()} for i, name in enumerate(_THREE)
    }  # fmt: skip
    sorted_out = _sorted_out(config, sorts, say)
    elapsed = time.perf_counter() - begin
    outcome = dataclasses.replace(
        outcome, sorts=sorts, sorted_out=sorted_out, elapsed=elapsed
    )
    say("\n" + _verdict(outcome, impacts))
    unit = config.quantity.unit
    if optimum.stop is not Stop.FAILED_START:
        say("\n" + nearby.price_text(space, optimum, page.rows(outcome, impacts), unit))
        say("\n" + page.mine(config, outcome, impacts))
    rows = _side_by_side(outcome, config.one_link)
    _write(config, outcome, impacts, bars, rows)
    if config.plots:
        _draw(config, outcome, impacts, signals, bars)
    page.write(config, outcome, impacts, _verdict(outcome, impacts), rows)
    say(f"wrote {config.out} ({time.perf_counter() - begin:.1f} s in all)")
    return outcome


def _sorted_out(config, sorts, say) -> bool | None:
    """Whether whole sorts of the optimum divert the parcel; `None` where none were run."""
    if not sorts:
        return None
    least = float(np.min(sorts["after"]["crossing"]))
    worst = fj.Status(int(np.max(sorts["after"]["status"])))
    fine = least >= config.crossing and worst <= fj.Status.LEFT_OVER_TIP
    say(
        f"whole sorts (front at {config.sort_front:g} m, {len(config.sort_masses)} masses): C_s "
        f"at least {1e3 * least:.0f} mm past the belt's edge, status {worst.name}: "
        f"{'diverted' if fine else 'NOT diverted'}"
    )
    peaks = (float(np.max(sorts[name]["peak_force"])) for name in ("before", "one_link", "after"))
    say("in them, two-link, one-link, optimum: {:.1f}, {:.1f}, {:.1f} N at most".format(*peaks))
    return fine


def _drop(outcome: Outcome, paper: str) -> str:
    """The optimum's worst objective compared with that of one of the paper's fences, in words."""
    name = outcome.objective.name
    ratio = np.max(outcome.measured["after"][name])
    change = 1 - float(ratio / np.max(outcome.measured[paper][name]))
    return f"{100 * abs(change):.1f} % {'below' if change > 0 else 'above'}"


def _verdict(outcome: Outcome, impacts: batch.Impacts) -> str:
    optimum = outcome.optimum
    if optimum.stop is Stop.FAILED_START:
        return report.failed_start(impacts.text, outcome.measured["before"]["status"])
    text = report.conditions(optimum)
    if not optimum.feasible:
        return text + report.infeasible(optimum)
    title = outcome.objective.name.replace("_", " ")
    text += (
        f"the worst {title} is {_drop(outcome, 'before')} the two-link fence's and "
        f"{_drop(outcome, 'one_link')} the one-link fence's"
    )
    for name, title in (("before", "two-link"), ("one_link", "one-link")):
        rows = batch.margins(outcome.limits, outcome.measured[name])
        broken = [key.replace("_", " ") for key, row in rows.items() if np.min(row) < 0]
        if broken:
            text += f"; the {title} fence breaks the limits of {', '.join(broken)}"
    if not optimum.converged:
        return text + ", but the design is not shown to be optimal: " + optimum.ended
    if not outcome.succeeded:
        return text + ", but a check above contradicts the design"
    return text


def _side_by_side(outcome: Outcome, one_link: fj.Fence) -> dict[str, dict[str, float | None]]:
    """The three fences [SI] and the worst of each number over the impacts."""
    space = outcome.space
    fences = {
        "before": space.fence,
        "one_link": one_link,
        "after": space.apply(outcome.after)[0],
    }
    rows = {}
    for name, fence in fences.items():
        found = outcome.measured[name]
        worst = {
            limit.name: float(np.asarray(found[limit.name])[np.argmin(margin)])
            for limit, margin in (
                (x, np.asarray(x.margin_of(found[x.name]))) for x in outcome.limits
            )
        }
        rows[_TITLES[name]] = {
            "thickness": float(fence.thickness),
            "rigid_length": float(fence.rigid_length),
            "flexible_length": float(fence.flexible_length),
            "youngs_modulus": float(fence.material.youngs_modulus),
            "fence_mass": float(found["fence_mass"][0]),
            "peak_force": float(np.max(found["peak_force"])),
            "rigid_obstacle_over_peak": float(np.min(outcome.stiff / found["peak_force"])),
            **worst,
            "peak_force_in_sorts":
                float(np.max(outcome.sorts[name]["peak_force"])) if outcome.sorts else None,
        }  # fmt: skip
    return rows


def _bars(config, outcome) -> dict[str, Any]:
    """Elasticities of objective and limits at the first and the last design."""
    optimum = outcome.optimum
    first = _measured(config, optimum, optimum.first)
    return {
        when: report.elasticities(outcome.space, config.limits, at, values, config.quantity)
        for when, at, values in (
            ("before", optimum.first, first),
            ("after", optimum.last, outcome.measured["found"]),
        )
    }


def _write(config, outcome, impacts, bars, rows) -> None:
    space, optimum = outcome.space, outcome.optimum
    content = {
        "config": dataclasses.asdict(config),
        "notes": config.notes,
        **report.ended(optimum),
        "confirmed_by_reference": outcome.confirmed,
        "whole_sorts_diverted": outcome.sorted_out,
        "elapsed": outcome.elapsed,
        "design": {
            "before": space.named(outcome.before),
            "after": space.named(outcome.after),
        },
        "impacts": [{"distance": d, "mass": m} for d, m in impacts.lanes],
        "weights": optimum.weights,
        "multipliers": {
            limit.name: row
            for limit, row in zip(
                config.limits,
                optimum.multipliers.reshape(len(config.limits), -1),
                strict=True,
            )
        },
        "measured": outcome.measured,
        "rigid_obstacle": outcome.stiff,
        "whole_sorts": outcome.sorts,
        "margins": batch.margins(config.limits, outcome.measured["after"]),
        "side_by_side": rows,
        "elasticities": bars,
    }
    report.write_json(config.out / "result.json", content)


def _draw(config, outcome, impacts, signals, bars) -> None:
    found = outcome.measured["found"]

    def shown(lane):
        distance, mass = impacts.lanes[lane]
        return {
            f"{name}, R = {distance:g} m, {mass:g} kg": Trace(
                *(part[index, lane] for part in signals)
            )
            for index, name in enumerate(_TITLES.values())
        }

    worst = int(np.argmax(found[config.quantity.name]))
    report.draw(
        config.out,
        shown(worst),
        shown(int(np.argmax(found["tip_deflection"]))),
        float(outcome.stiff[worst]),
        report.most(config.limits, "tip_deflection"),
        outcome.optimum,
        config.tolerance,
        {
            f"{name}, {when}": bars[when][name]
            for name in (config.quantity.name, "tip_deflection")
            for when in ("before", "after")
        },
    )


def run():
    """The job from the command line."""
    command.run("peak_force", configure, main)
