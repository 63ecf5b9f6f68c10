"""The fence that hurts the parcel least: the smallest peak force over the worst of the impacts.

    python -m optimize.peak_force --out out

starts from the paper's two-link fence and minimises the largest peak reaction force over impacts
at several distances with several masses, under limits on the tip deflection, the bending stress,
the tip clearance and the sort itself. The limits are asked of every impact.

What is designed, by default: the thickness h_1 and the length ratio l_s / l_p at a fixed reach,
and Young's modulus, the choice of the material. The damping ratio and the density can be added,
but move the force by less than 0.1 % for each 1 % of theirs, and always the same way: they would
only go to a bound.

Whether the parcel is diverted is asked of the impacts themselves: within `duration` its centre of
gravity must pass the belt's far edge. Whole sorts of the optimum are then run as a check.
"""

import argparse
import dataclasses
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import fencejax as fj
import jax
import jax.numpy as jnp
import numpy as np
from fencejax import objectives
from fencejax.design import VARIABLES, DesignSpace, DesignVariable
from fencejax.optimizer import Optimum, minimize
from fencejax.plot import Trace

from . import impacts as batch, report


@dataclasses.dataclass(frozen=True)
class PeakForceConfig:
    """Every number of the job; `help` in the metadata is what `--help` shows."""

    out: Path = Path("out")
    distances: tuple[float, ...] = (0.8, 0.9, 1.0)
    masses: tuple[float, ...] = (10.0, 15.0, 20.0)
    drive_angle: float = 0.30
    duration: float = 0.25
    variables: tuple[str, ...] = ("thickness", "length_ratio", "youngs_modulus")
    bounds: tuple[tuple[str, float, float], ...] = ()
    tip_limit: float = 0.08
    stress_limit: float = 40e6
    tip_clearance: float = 0.02
    crossing: float = 0.0
    reserve: float = 0.005
    method: str = "lbfgs"
    tolerance: float = 1e-3
    feasibility: float = 1e-4
    penalty: float = 10.0
    budget: int = 120
    fidelity: str = "standard"
    reference: bool = True
    agreement: float = 0.01
    sort_masses: tuple[float, ...] = (10.0, 15.0, 20.0)
    sort_front: float = 0.1
    plots: bool = True

    @property
    def limits(self) -> tuple[objectives.Limit, ...]:
        """What every impact must hold."""
        return (
            objectives.tip_deflection_limit(self.tip_limit),
            objectives.stress_limit(self.stress_limit),
            objectives.diverted_limit(self.crossing),
            objectives.tip_clearance_limit(self.tip_clearance),
        )


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the job found: the optimum, the designs [SI], measurements, and whether it stands."""

    optimum: Optimum
    space: DesignSpace
    before: np.ndarray
    after: np.ndarray
    measured: dict[str, batch.Measurement]
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


def _measured(limits, optimum_objectives, optimum_margins, reserve) -> batch.Measurement:
    """Values of an evaluation, from its margins."""
    lanes = optimum_objectives.size
    found = batch.Measurement(peak_force=optimum_objectives)
    for limit, row in zip(limits, optimum_margins.reshape(len(limits), lanes), strict=True):
        span = (row + reserve) * limit.unit_of_margin
        found[limit.name] = limit.bound - span if limit.sense == "at most" else limit.bound + span
    return found


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
    return _confirm(config, optimum, space, impacts, before, after, say, begin)


def _confirm(config, optimum, space, impacts, before, after, say, begin) -> Outcome:
    """Re-run the two designs, say and write what came out."""
    limits = config.limits
    fidelity = fj.Fidelity.reference() if config.reference else getattr(
        fj.Fidelity, config.fidelity)()  # fmt: skip

    @jax.jit
    def both(designs):
        def one(values):
            return batch.measure(space, impacts, limits, fidelity, values)

        return jax.vmap(one)(designs)

    measured, signals = jax.device_get(both(jnp.stack([before, after])))
    old, new = ({k: v[i] for k, v in measured.items()} for i in (0, 1))
    found = _measured(limits, optimum.objectives, optimum.margins, config.reserve)
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
    sorted_out = _sorts(config, space, after, say)
    drop = 1 - np.max(new["peak_force"]) / np.max(old["peak_force"])
    outcome = Outcome(
        optimum, space, before, after, {"before": old, "found": found, "after": new},
        confirmed, sorted_out, time.perf_counter() - begin,
    )  # fmt: skip
    say("\n" + _verdict(outcome, drop))
    _write(config, outcome, impacts, signals, fj.Belt().speed)
    say(f"wrote {config.out} ({time.perf_counter() - begin:.1f} s in all)")
    return outcome


def _sorts(config, space, after, say) -> bool | None:
    """Whether whole sorts of the optimum divert the parcel; `None` where none are asked for."""
    if not config.sort_masses:
        return None
    fence, drive = space.apply(after)
    del fence
    run = jax.jit(
        lambda values: batch.whole_sorts(
            space, config.sort_front, config.sort_masses, float(drive.cycle), values
        )
    )
    sorts = jax.device_get(run(jnp.asarray(after)))
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
    text += f"the worst peak force falls by {100 * drop:.1f} %"
    if not optimum.converged:
        return text + ", but the design is not shown to be optimal: " + optimum.stop.value
    if not outcome.succeeded:
        return text + ", but a check above contradicts the design"
    return text


def _write(config, outcome, impacts, signals, belt_speed) -> None:
    space, optimum = outcome.space, outcome.optimum
    bars = report.elasticities(space, config.limits, optimum, outcome.measured["found"])
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
        lane = int(np.argmax(optimum.objectives))
        distance, mass = impacts.lanes[lane]
        where = f"R = {distance:g} m, {mass:g} kg"
        shown = {
            f"{name}, {where}": Trace(*(part[index, lane] for part in signals))
            for index, name in enumerate(("before", "after"))
        }
        stiff = batch.stiff_force(impacts, space.apply(outcome.after)[1], float(belt_speed), lane)
        report.draw(
            config.out, shown, stiff, config.tip_limit, optimum, config.tolerance, bars
        )


_HELP = {
    "out": "folder for history.json, result.json and the figures",
    "distances": "arc coordinates of the first touch [m]",
    "masses": "parcel masses [kg]",
    "drive_angle": "drive angle at the first touch [rad]",
    "duration": "length of each impact [s]; the parcel must be diverted within it",
    "variables": f"what is designed, of {', '.join(VARIABLES)}",
    "bounds": "bounds in SI units instead of the default ones, as name=lower:upper",
    "tip_limit": "largest tip deflection [m]",
    "stress_limit": "largest bending stress [Pa]; 40 MPa stays below the yield of PA6, dry or not",
    "tip_clearance": "shortest distance from a loaded corner to the tip [m]",
    "crossing": "how far the parcel's centre must get past the belt's edge [m]",
    "reserve": "kept in hand of every margin [1], for the difference to the reference fidelity",
    "method": "inner descent: lbfgs or adam",
    "tolerance": "on stationarity and complementarity [1]",
    "feasibility": "violation of a margin that counts as none [1]",
    "penalty": "penalty of the augmented Lagrangian at the start [1]",
    "budget": "evaluations at most",
    "fidelity": "fidelity of the optimisation: fast, standard or reference",
    "reference": "re-run the first and the last design at the reference fidelity",
    "agreement": "largest relative difference of the force at the reference that confirms it [1]",
    "sort_masses": "parcel masses of the whole sorts run as a check [kg]; none: no check",
    "sort_front": "where the parcel's front is when such a sort starts [m]",
    "plots": "draw the figures",
}


def _bounds(text: str) -> tuple[str, float, float]:
    name, _, span = text.partition("=")
    lower, _, upper = span.partition(":")
    try:
        return name, float(lower), float(upper)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"must be name=lower:upper, but is {text!r}") from error


def parser() -> argparse.ArgumentParser:
    """One flag for each field of the configuration."""
    result = argparse.ArgumentParser(
        prog="python -m optimize.peak_force",
        description=(__doc__ or "").partition("\n")[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    for field in dataclasses.fields(PeakForceConfig):
        flag, default = "--" + field.name.replace("_", "-"), field.default
        settings: dict = {"default": default, "help": _HELP[field.name]}
        if isinstance(default, bool):
            settings["action"] = argparse.BooleanOptionalAction
        elif field.name == "bounds":
            settings.update(type=_bounds, nargs="*", metavar="NAME=LOWER:UPPER")
        elif isinstance(default, tuple):
            kind = type(default[0])
            settings.update(type=kind, nargs="*" if field.name == "sort_masses" else "+")
        else:
            settings["type"] = type(default) if not isinstance(default, Path) else Path
        if field.name == "method":
            settings["choices"] = ("lbfgs", "adam")
        if field.name == "fidelity":
            settings["choices"] = ("fast", "standard", "reference")
        result.add_argument(flag, **settings)
    return result


def configure(arguments: Sequence[str] | None = None) -> PeakForceConfig:
    """The configuration that flags describe."""
    given = vars(parser().parse_args(arguments))
    return PeakForceConfig(
        **{name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
    )


if __name__ == "__main__":
    try:
        finished = main(configure())
    except (ValueError, TypeError) as error:
        sys.exit(f"peak_force: {error}")
    sys.exit(0 if finished.succeeded else 1)
