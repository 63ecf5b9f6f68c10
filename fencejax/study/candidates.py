"""Candidate fidelities: their ladder, their expected cost, and which of two is finer."""

import math
from collections.abc import Iterable, Sequence

from ..fidelity import Fidelity
from ..scenes import NormalScene, Scene

# Work of a step by geometry, from the coarsest to the finest.
_GEOMETRY_WORK = {"small": 1.0, "arc": 1.1, "chord": 1.3}
_INTEGRATOR_WORK = {"modal": 1.0, "tsit5": 100.0, "kvaerno5": 300.0}


def ladder() -> tuple[Fidelity, ...]:
    """The default candidates: tolerances of 1 % to 0.002 %, each with several numbers of modes,
    geometries and smoothing speeds of friction."""
    rungs = (
        # step_tolerance [1], step [s], modes, geometry, static_speed [m/s]
        (1e-2, 1e-3, 0, "small", 0.1),
        (1e-2, 1e-3, 2, "small", 0.1),
        (1e-2, 1e-3, 4, "arc", 0.1),
        (3e-3, 1e-3, 2, "small", 0.1),
        (3e-3, 1e-3, 3, "arc", 0.1),
        (3e-3, 1e-3, 4, "arc", 2.5e-2),
        (5e-4, 5e-4, 3, "arc", 0.1),
        (5e-4, 5e-4, 4, "arc", 2.5e-2),
        (5e-4, 5e-4, 6, "chord", 1e-2),
        (1e-4, 2.5e-4, 6, "arc", 1e-2),
        (1e-4, 2.5e-4, 8, "chord", 5e-3),
        (2e-5, 1.25e-4, 8, "chord", 5e-3),
    )
    return tuple(
        Fidelity(
            step_tolerance=tolerance, step=step, modes=modes, geometry=geometry,
            slip_speed=static / 50, static_speed=static,
        )
        for tolerance, step, modes, geometry, static in rungs
    )  # fmt: skip


def expected_cost(fidelity: Fidelity) -> float:
    """The work for a second of simulated time, in steps of one mode, by which candidates are
    ordered. The defect of a smooth force is proportional to the square of the step: with a
    tolerance below 1 % the steps are proportional to its root."""
    share = 1.0
    if fidelity.step_tolerance is not None:
        share = min(1.0, math.sqrt(fidelity.step_tolerance / 1e-2))
    work = _GEOMETRY_WORK[fidelity.geometry] * _INTEGRATOR_WORK.get(str(fidelity.integrator), 300.0)
    return work * (1 + 0.05 * fidelity.mode_count) / (share * fidelity.step)


def as_fine(one: Fidelity, other: Fidelity) -> bool:
    """Whether `one` is at least as fine as `other` in every knob."""

    def key(f: Fidelity):
        finer_above = (f.mode_count, f.elements, f.iterations, _GEOMETRY_WORK[f.geometry])
        controlled = math.inf if f.step_tolerance is None else f.step_tolerance
        finer_below = (
            controlled, f.step, f.slip_speed, f.static_speed, f.tip_fade, f.tolerance,
        )  # fmt: skip
        precise = f.precision != "float32"
        return (*finer_above, f.static_correction, precise, *(-x for x in finer_below))

    same = (one.integrator, one.load) == (other.integrator, other.load)
    return same and all(a >= b for a, b in zip(key(one), key(other), strict=True))


def distinct(
    candidates: Iterable[Fidelity], scenes: Sequence[NormalScene | Scene]
) -> list[Fidelity]:
    """Candidates that differ for these scenes, the cheapest first."""
    fence = any(scene.fence is not None for scene in scenes)
    full = any(isinstance(scene, Scene) for scene in scenes)
    seen, kept = set(), []
    for candidate in sorted(dict.fromkeys(candidates), key=expected_cost):
        same = {}
        if not full:
            same |= dict(geometry="small", slip_speed=1.0, static_speed=1.0)
        if not fence:
            same |= dict(geometry="small", modes=0, elements=1, static_correction=True)
        key = candidate.replace(**same)
        if key not in seen:
            seen.add(key)
            kept.append(candidate)
    return kept


def describe(fidelity: Fidelity) -> str:
    """A fidelity's main knobs in one line."""
    modes = f"{'all' if fidelity.modes is None else fidelity.modes} modes"
    if fidelity.modes == 1:
        modes = "1 mode"
    step = f"{1e3 * fidelity.step:g} ms"
    if fidelity.step_tolerance is not None:
        step = f"tolerance {fidelity.step_tolerance:g}, {step}"
    if fidelity.integrator != "modal":
        solver = fidelity.integrator
        name = solver if isinstance(solver, str) else type(solver).__name__
        step = f"{name} {fidelity.tolerance:g}"
    return f"{step}, {modes}, {fidelity.geometry}, eps {fidelity.slip_speed:g} m/s"
