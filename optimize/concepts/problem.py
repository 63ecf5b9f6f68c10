"""Groups of concepts that share a compiled program; a concept at a rate is data of it."""

from collections.abc import Iterable, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

import fencejax as fj
from fencejax.design import Limit
from fencejax.scenes import numbers as scene_numbers
from fencejax.sorter import Candidate, Machine, Objective, SorterProblem, scene_path

from ..common.encounters import inflexible
from .configuration import ConceptsConfig
from .means import Concept, Number
from .quantities import COSTS, FORCE, HOME_RING, LOAD, TIP_GIVE

SPEEDS, SHORTEST = (0.5, 6.0), 0.4
"""For a harmonic drive without free numbers in the sorter: top speeds [rad/s], and the shortest
cycle as a share of the period at the fastest rate."""
FRONT = (0.0, 0.3)
"""The span of the parcel's front at the drive's start [m], where the sorter does not free it."""
_RIDES, _ANGLES = "parcels.front", (-1e-3, 1.2)
_THICK = "fence.thickness"
_TOP, _CYCLE, _FORM = "drive.top_speed", "drive.cycle_time", "drive.control_angles"
_TORQUES, _AT_HINGE = "drive.torques", ("drive.inertia", "drive.damping", "drive.stiffness")
_MOST = 2e3
"""The bound of a torque drive's torque where the motor has no limit [N m]."""

Design = Mapping[str, float]
"""Free numbers [SI] by their paths in a sorter file."""


def period(rate: float) -> float:
    """The time from one parcel to the next [s] at a rate [1/h]."""
    return 3600.0 / rate


class Group:
    """Concepts whose sorts are one compiled program: flexible or rigid fences with a drive of one
    law. A part that a concept lacks has its numbers fixed at values at which it has no effect.

    **Fields:** `concepts`; `problem`, the sorter's with the numbers of all concepts free; `name`.
    """

    def __init__(self, config: ConceptsConfig, concepts: Iterable[Concept]):
        self.config, self.concepts = config, tuple(concepts)
        self.bends, self.law = self.concepts[0].bends, self.concepts[0].law
        self.name = f"{'bends' if self.bends else 'rigid'}-{self.law}"
        found = (n for concept in self.concepts for n in concept.numbers)
        self.numbers: dict[str, Number] = {n.path: n for n in found}
        self.fixed = tuple(
            path for path in self.numbers
            if not all(path in {n.path for n in c.numbers} for c in self.concepts)
        )  # fmt: skip
        machine = _machine(config, self.numbers, self.bends, self.law)
        self.problem = SorterProblem(
            machine, self.fidelity(config.fidelity), reserve=config.reserve, rungs=config.rungs,
            fixed=self.fixed, also=(FORCE, LOAD, *COSTS),
        )  # fmt: skip

    def fidelity(self, name: str) -> fj.Fidelity:
        """A fidelity by name, without modes where the fence is rigid."""
        chosen = getattr(fj.Fidelity, name)()
        return chosen if self.bends else inflexible(chosen)

    @property
    def problems(self) -> dict[str, SorterProblem]:
        """The problems by their objective; all use the same compiled sorts."""
        wanted = (FORCE, LOAD) if self.config.load else (FORCE,)
        return {q.name: self.problem.with_objective(Objective(q)) for q in wanted}

    def compile(self) -> None:
        """Compile all that a search needs."""
        problem, config = self.problem, self.config
        candidate = self.candidate(self.concepts[0], config.paces[0])
        problem.program(problem.start, *problem.data(candidate))
        for name in dict.fromkeys((config.check, config.verify)):
            problem.measure(problem.start, candidate, self.fidelity(name))

    def candidate(self, concept: Concept, rate: float) -> Candidate:
        """A concept at a rate [1/h]."""
        first, own = self.problem.candidates[0], {n.path for n in concept.numbers}
        fixed = {path: self.numbers[path].without for path in self.fixed if path not in own}
        bounds = dict.fromkeys(("cycle", "clear_period"), period(rate))
        return Candidate(first.material, {**first.numbers, **fixed}, bounds)  # pyright: ignore

    def design(self, concept: Concept, z: np.ndarray) -> dict[str, float]:
        """The free numbers of a concept at a point."""
        fixed = self.candidate(concept, self.config.paces[0]).numbers
        values = self.problem.values(z)
        return {path: float(fixed.get(path, value)) for path, value in values.items()}

    def point(self, design: Design, rate: float) -> np.ndarray:
        """z at a design of this group or another, within the bounds. Numbers that the design lacks
        have their start values, but a fence that was rigid becomes as thick as allowed. A cycle
        too long for the rate is shortened; the fence then swings as far as before."""
        space, problem = self.problem.space, self.problem
        assert space is not None
        start = problem.values(problem.start)
        given = dict(design)
        if self.law != "harmonic" and _TOP in given:
            drive = fj.HarmonicDrive(given[_TOP], given[_CYCLE])
            if self.law == "spline":
                path, values = _FORM, spline(drive, given[_CYCLE], self.config.controls)
            else:
                hinge = [given.get(path, start[path]) for path in _AT_HINGE]
                path = _TORQUES
                values = swinging(drive, problem.machine, hinge, self.config.controls)
            given |= {f"{path}[{k}]": float(value) for k, value in enumerate(values)}
        thickest = dict(zip(start, (v.upper for v in space.variables), strict=True))
        given.setdefault(_THICK, thickest.get(_THICK, 0.0))
        given = {**start, **{name: given[name] for name in start if name in given}}
        share = min(1.0, _ROOM * period(rate) / given[_CYCLE])
        given[_CYCLE] *= share
        if _TOP in given:
            given[_TOP] /= share
        return np.clip(np.asarray(space.to_shares(_within(space, given))), 0.0, 1.0)


# The longest cycle as a share of the period; a parcel on the border needs the rest to arrive.
_ROOM = 0.94


def _within(space: fj.DesignSpace, given: Mapping[str, float]) -> jnp.ndarray:
    """Values in the space's order, each within its bounds."""
    values = [
        min(max(value, variable.lower), variable.upper)
        for variable, value in zip(space.variables, given.values(), strict=True)
    ]
    return jnp.asarray(values)


def spline(drive: fj.AbstractDrive, cycle: float, controls: int) -> np.ndarray:
    """The control angles [rad] of the spline nearest to a drive, none below 0."""
    time = jnp.linspace(0.0, cycle, 400)
    units = np.eye(controls)
    columns = [np.asarray(fj.SplineDrive(row, cycle).angle(time)) for row in units]
    wanted = np.asarray(drive.angle(time))
    angles, *_ = np.linalg.lstsq(np.stack(columns, axis=1), wanted, rcond=None)
    return np.clip(angles, 0.0, _ANGLES[1])


def swinging(
    drive: fj.AbstractDrive, machine: Machine, hinge: Iterable[float], controls: int
) -> np.ndarray:
    """The torques [N m] at evenly spaced times of a drive's cycle with which a machine's fence
    follows that drive's motion. The torque drive has its inertia, damping and stiffness at the
    `hinge` [SI]. On the way out a parcel, dragged by the belt, acts at two thirds of the reach."""
    inertia, damping, stiffness = hinge
    time = jnp.linspace(0.0, drive.cycle, controls)
    swing = drive.motion(time)
    mass = float(np.mean(machine.parcels.columns[scene_path("parcels.mass")]))
    drag = machine.belt.friction.scales(machine.belt.speed)[0] * machine.belt.gravity * mass
    torque = (
        (inertia + machine.fence.inertia) * swing.acceleration + damping * swing.speed
        + stiffness * swing.angle + jnp.where(swing.speed > 0, drag * machine.fence.reach / 1.5, 0)
    )  # fmt: skip
    return np.asarray(torque)


def _machine(
    config: ConceptsConfig, numbers: Mapping[str, Number], bends: bool, law: str
) -> Machine:
    """The sorter with the numbers of some concepts and of the drive free, and with the limits that
    are the same for all concepts."""
    sorter = config.described
    given, longest = sorter.machine, period(config.paces[0])
    free: dict[str, Any] = {}
    for path, number in numbers.items():
        known = _known(given, path)
        ends = _own(given, path, (number.lower, number.upper))
        free[path] = _span(*ends, number.start if known is None else known)
    changed: dict[str, Any] = {"period": longest, "limits.clear_period": True}
    if not bends:
        shape = (_THICK, "fence.length_ratio")
        changed |= {path: _known(given, path) for path in shape if path in given.free}
    changed |= _limits(given)
    changed |= _drive(config, given, law, numbers, free)
    if _RIDES not in given.free:
        start = float(given.parcels.columns[scene_path(_RIDES)][0])
        free[_RIDES] = _span(*FRONT, start)
    return sorter.replace(set=changed, free=free).machine


def _span(lower: float, upper: float, start: Any) -> dict[str, Any]:
    several = isinstance(start, list)
    begin = start if several else min(max(float(start), lower), upper)
    return {"lower": lower, "upper": upper, "start": begin}


def _own(machine: Machine, path: str, usual: tuple[float, float]) -> tuple[float, float]:
    """The bounds of a number in a machine, or the usual ones."""
    span = machine.free.get(path)
    return usual if span is None else (span.lower, span.upper)


def _known(machine: Machine, path: str) -> float | None:
    """A number of a machine; `None` where it has none."""
    name = scene_path(path)
    if not scene_numbers.has(machine.parts, name):
        return None
    return float(scene_numbers.read(machine.parts, [name])[0])


def _limits(machine: Machine) -> dict[str, Any]:
    """Limits that replace those on the tip's deflection and on the fence's residual oscillation by
    ones that apply to every concept alike."""
    others = {"tip_deflection": TIP_GIVE, "ring": HOME_RING}
    return {
        f"limits.{row.name}": Limit(others[row.name], bound, row.sense, row.scale)
        for row, bound in machine.bounds if row.name in others and bound is not None
    }  # fmt: skip


def _drive(
    config: ConceptsConfig, machine: Machine, law: str, numbers: Mapping[str, Number],
    free: dict[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """The drive of a law, close to the sorter's own; adds its numbers to `free`."""
    own, cycle = machine.drive, float(machine.drive.cycle)
    limits = (SHORTEST * period(config.paces[-1]), period(config.paces[0]))
    free[_CYCLE] = _span(*_own(machine, _CYCLE, limits), cycle)
    if law == "spline":
        angles = spline(own, cycle, config.controls)
        free[_FORM] = _span(*_ANGLES, [float(angle) for angle in angles])
        return {"drive": {"law": "spline", "control_angles": [float(a) for a in angles]}}
    if law == "torque":
        hinge = {path: number.start for path, number in numbers.items() if path in _AT_HINGE}
        most = _MOST if machine.motor.torque is None else float(machine.motor.torque)
        torques = swinging(own, machine, hinge.values(), config.controls)
        torques = np.clip(torques, -most, most).tolist()
        free[_TORQUES] = _span(-most, most, torques)
        named = {path.rpartition(".")[2]: value for path, value in hinge.items()}
        return {"drive": {"law": "torque", "torques": torques, **named}}
    if isinstance(own, fj.HarmonicDrive):
        free[_TOP] = _span(*_own(machine, _TOP, SPEEDS), float(own.top_speed))
        return {}
    furthest = float(np.max(np.asarray(own.angle(jnp.linspace(0.0, cycle, 400)))))
    free[_TOP] = _span(*SPEEDS, np.pi * furthest / cycle)
    return {"drive": {"law": "harmonic"}}


def grouped(config: ConceptsConfig, concepts: Iterable[Concept]) -> list[Group]:
    """The concepts by the programs that they share."""
    found: dict[tuple[bool, str], list[Concept]] = {}
    for concept in concepts:
        found.setdefault((concept.bends, concept.law), []).append(concept)
    return [Group(config, each) for each in found.values()]


def torque(values: Mapping[str, np.ndarray]) -> float:
    """The largest measured torque at the hinge [N m]."""
    return float(np.max(values[COSTS[0].name]))


def mass(values: Mapping[str, np.ndarray]) -> float:
    """The measured mass of the fence [kg]."""
    return float(values[COSTS[1].name][0])
