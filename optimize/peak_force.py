"""The fence that hurts the parcel least: the smallest peak force over the worst of the impacts.

    python -m optimize.peak_force --out out

starts from the paper's two-link fence and minimises the largest peak reaction force over impacts
at several distances with several masses, under limits on the tip deflection, the bending stress,
the tip clearance and the sort itself. The limits are asked of every impact.

What is designed, by default: the thickness h_1 and the length ratio l_s / l_p at a fixed reach,
and Young's modulus, the choice of the material. The damping ratio and the density can be added,
but 1 % of theirs moves the worst peak force of the paper's fence by less than 0.1 %.

Whether the parcel is diverted is asked of the impacts themselves: within `duration` its centre of
gravity must pass the belt's far edge. Whole sorts of the optimum are then run as a check.
"""

import concurrent.futures
import dataclasses
import sys
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj
from fencejax.design import VARIABLES, DesignSpace, DesignVariable
from fencejax.lagrangian import Evaluation
from fencejax.optimizer import Optimum, minimize
from fencejax.plot import Trace

from . import impacts as batch, report
from .configuration import PeakForceConfig, configure


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the job found: the optimum, the designs [SI], measurements, and whether it stands."""

    optimum: Optimum
    space: DesignSpace
    before: np.ndarray
    after: np.ndarray
    measured: dict[str, dict[str, Any]]
    confirmed: bool | None
    sorted_out: bool | None
    elapsed: float

    @property
    def succeeded(self) -> bool:
        """Converged, feasible, and not contradicted by the reference or by the whole sorts."""
        stands = self.confirmed is not False and self.sorted_out is not False
        return self.optimum.converged and self.optimum.feasible and stands


def _space(config: PeakForceConfig) -> DesignSpace:
    given = {name: (lower, upper) for name, lower, upper in config.bounds}
    for name in given:
        if name not in config.variables:
            raise ValueError(
                f"Argument `bounds` must be of designed variables {list(config.variables)}, but "
                f"names {name!r}. Add it to `variables`."
            )
    chosen: list[str | DesignVariable] = []
    for name in config.variables:
        if name in given and name in VARIABLES:
            lower, upper = given[name]
            chosen.append(dataclasses.replace(VARIABLES[name], lower=lower, upper=upper))
        else:
            chosen.append(name)
    return DesignSpace(chosen)


def _measured(config: PeakForceConfig, optimum: Optimum, at: Evaluation) -> dict[str, Any]:
    """Values of an evaluation, from its margins."""
    lanes = at.objectives.size
    found: dict[str, Any] = {"peak_force": at.objectives * optimum.scale}
    rows = at.margins.reshape(len(config.limits), lanes) + config.reserve
    for limit, row in zip(config.limits, rows, strict=True):
        span = row * limit.unit_of_margin
        found[limit.name] = limit.bound - span if limit.sense == "at most" else limit.bound + span
    return found


class _Checks:
    """The programs run once the optimum is known, compiled beside the optimisation."""

    def __init__(self, config: PeakForceConfig, space: DesignSpace, impacts: batch.Impacts):
        name = "reference" if config.reference else config.fidelity
        fidelity = getattr(fj.Fidelity, name)()
        cycle = float(space.drive.cycle)

        def impact(values):
            return batch.measure(space, impacts, config.limits, fidelity, values)

        def sort(values):
            return batch.whole_sorts(
                space, config.sort_front, config.sort_masses, cycle, values
            )

        size = len(space.variables)
        pool = concurrent.futures.ThreadPoolExecutor(max_workers=1)

        def compiled(function, *shape):
            values = jax.ShapeDtypeStruct(shape, jnp.zeros(()).dtype)
            return pool.submit(lambda: jax.jit(function).lower(values).compile())

        self._impacts = compiled(jax.vmap(impact), 2, size)
        self._sorts = compiled(sort, size) if config.sort_masses else None
        pool.shutdown(wait=False)

    def impacts(self, before, after):
        """Measurements and signals of both designs, stacked."""
        return jax.device_get(self._impacts.result()(jnp.stack([before, after])))

    def sorts(self, after):
        """Measurements of the whole sorts; `None` where none are asked for."""
        if self._sorts is None:
            return None
        return jax.device_get(self._sorts.result()(jnp.asarray(after)))


def main(config: PeakForceConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, print what it does, and write its files into `config.out`."""
    begin = time.perf_counter()
    jax.config.update("jax_enable_x64", True)
    config = PeakForceConfig() if config is None else config
    say = (lambda *parts: None) if quiet else (lambda *parts: print(*parts, flush=True))
    space, limits = _space(config), config.limits
    impacts = batch.Impacts(
        config.distances, config.masses, config.drive_angle, config.duration
    )
    config.out.mkdir(parents=True, exist_ok=True)
    fidelity = getattr(fj.Fidelity, config.fidelity)()
    before = np.asarray(space.values_of(space.fence, space.drive))
    checks = _Checks(config, space, impacts)
    say(f"{len(impacts.lanes)} impacts, variables {', '.join(space.names)}; compiling ...")
    optimum = minimize(
        batch.problem(space, impacts, limits, fidelity, config.reserve),
        space.to_unconstrained(before),
        logits=True,
        method=config.method,
        tolerance=config.tolerance,
        feasibility=config.feasibility,
        penalty=config.penalty,
        budget=config.budget,
        progress=lambda record: say(report.progress_line(record)),
    )
    after = np.asarray(space.from_unconstrained(optimum.point))
    say(f"\nstopped: {optimum.stop.value} ({len(optimum.history)} evaluations)")
    return _confirm(config, optimum, space, impacts, checks, before, after, say, begin)


def _confirm(config, optimum, space, impacts, checks, before, after, say, begin) -> Outcome:
    """Re-run the two designs, say and write what came out."""
    limits = config.limits
    measured, signals = checks.impacts(before, after)
    old, new = ({k: v[i] for k, v in measured.items()} for i in (0, 1))
    found = _measured(config, optimum, optimum.last)
    label = "reference" if config.reference else config.fidelity
    rows = {f"before, {label}": old, f"after, {config.fidelity}": found, f"after, {label}": new}
    say("\n" + report.design_table(space, before, after))
    say("\n" + report.table(rows, limits, impacts.lanes))
    confirmed = None
    if config.reference:
        difference = float(np.max(new["peak_force"]) / np.max(found["peak_force"]) - 1)
        least = min(float(np.min(v)) for v in batch.margins(limits, new).values())
        # The reference must find the same force, and no limit broken.
        confirmed = abs(difference) <= config.agreement and least >= -config.feasibility
        confirmed = confirmed and int(np.max(new["status"])) <= fj.Status.LEFT_OVER_TIP
        say(
            f"reference: peak force {100 * difference:+.3f} % of the optimiser's, smallest margin "
            f"{least:+.4f}, status {fj.Status(int(np.max(new['status']))).name}: "
            f"{'confirmed' if confirmed else 'NOT confirmed'}"
        )
    sorted_out = _sorted_out(config, checks.sorts(after), say)
    drop = 1 - np.max(new["peak_force"]) / np.max(old["peak_force"])
    outcome = Outcome(
        optimum, space, before, after, {"before": old, "found": found, "after": new},
        confirmed, sorted_out, time.perf_counter() - begin,
    )  # fmt: skip
    say("\n" + _verdict(outcome, drop))
    _write(config, outcome, impacts, signals)
    say(f"wrote {config.out} ({time.perf_counter() - begin:.1f} s in all)")
    return outcome


def _sorted_out(config, sorts, say) -> bool | None:
    """Whether whole sorts of the optimum divert the parcel; `None` where none were run."""
    if sorts is None:
        return None
    least = float(np.min(sorts["crossing"]))
    worst = fj.Status(int(np.max(sorts["status"])))
    fine = least >= config.crossing and worst <= fj.Status.LEFT_OVER_TIP
    say(
        f"whole sorts (front at {config.sort_front:g} m, {len(config.sort_masses)} masses): C_s "
        f"at least {1e3 * least:.0f} mm past the belt's edge, status {worst.name}: "
        f"{'diverted' if fine else 'NOT diverted'}"
    )
    return fine


def _verdict(outcome: Outcome, drop: float) -> str:
    optimum = outcome.optimum
    left = optimum.residual
    text = (
        f"KKT: stationarity {left.stationarity:.1e}, complementarity {left.complementarity:.1e}, "
        f"violation {left.violation:.1e}\n"
    )
    if not optimum.feasible:
        return text + (
            "no feasible design found. The design above is the least-violating one of all that "
            f"were tried: it breaks a limit by {100 * left.violation:.3g} % (reserve included). "
            "Relax that limit, widen the bounds, or add variables."
        )
    word = "falls" if drop > 0 else "rises, to hold the limits,"
    text += f"the worst peak force {word} by {100 * abs(drop):.1f} %"
    if not optimum.converged:
        return text + ", but the design is not shown to be optimal: " + optimum.stop.value
    if not outcome.succeeded:
        return text + ", but a check above contradicts the design"
    return text


def _write(config, outcome, impacts, signals) -> None:
    space, optimum = outcome.space, outcome.optimum
    first = _measured(config, optimum, optimum.first)
    bars = {
        when: report.elasticities(space, config.limits, at, values)
        for when, at, values in (
            ("before", optimum.first, first),
            ("after", optimum.last, outcome.measured["found"]),
        )
    }
    report.write_json(config.out / "history.json", report.history_rows(space, optimum))
    content = {
        "config": dataclasses.asdict(config),
        "stop": optimum.stop.value,
        "converged": optimum.converged,
        "feasible": optimum.feasible,
        "confirmed_by_reference": outcome.confirmed,
        "whole_sorts_diverted": outcome.sorted_out,
        "evaluations": len(optimum.history),
        "elapsed": outcome.elapsed,
        "residual": optimum.residual._asdict(),
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
        "margins": batch.margins(config.limits, outcome.measured["after"]),
        "elasticities": bars,
    }
    report.write_json(config.out / "result.json", content)
    if config.plots:
        _draw(config, outcome, impacts, signals, bars)


def _draw(config, outcome, impacts, signals, bars) -> None:
    found = outcome.measured["found"]

    def shown(lane):
        distance, mass = impacts.lanes[lane]
        return {
            f"{name}, R = {distance:g} m, {mass:g} kg": Trace(
                *(part[index, lane] for part in signals)
            )
            for index, name in enumerate(("before", "after"))
        }

    worst = int(np.argmax(found["peak_force"]))
    drive, speed = outcome.space.apply(outcome.after)[1], float(fj.Belt().speed)
    report.draw(
        config.out,
        shown(worst),
        shown(int(np.argmax(found["tip_deflection"]))),
        batch.stiff_force(impacts, drive, speed, worst),
        config.tip_limit,
        outcome.optimum,
        config.tolerance,
        {
            f"{name}, {when}": bars[when][name]
            for name in ("peak_force", "tip_deflection")
            for when in ("before", "after")
        },
    )


if __name__ == "__main__":
    fj.tune_compiler()
    try:
        finished = main(configure())
    except (ValueError, TypeError) as error:
        sys.exit(f"peak_force: {error}")
    sys.exit(0 if finished.succeeded else 1)
