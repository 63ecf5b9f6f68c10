"""Recorders: observers that turn each state of a scene into a sample, and samples into running
results."""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import FlexibleLink, Mechanics, NormalState, SceneState
from ..scenes import Body, NormalScene, Scene
from . import accumulators
from .accumulators import Accumulator, Course, Step, Trace
from .measures import Measure
from .peak import Span
from .resolution import RESOLUTION, cutoff
from .rivals import STEPS_MISS, rivals
from .sample import Sample, describe, describe_normal
from .slopes import SLOPES

# The accumulators that a status is decided by.
_JUDGED = (
    accumulators.FORCE, accumulators.TIP, accumulators.BORDER, accumulators.SURFACE,
    accumulators.CONTACT, accumulators.DEEPEST, accumulators.OVER_TIP, accumulators.UNBALANCE,
    RESOLUTION,
)  # fmt: skip

_RIVALS = rivals(0.0)


class Record(NamedTuple):
    """Running results: the last sample, the length of the last step [s] (`None` where all are
    equal), the state of each accumulator by name, and each trace's signal at the last sample."""

    last: Sample
    length: Array | None
    states: dict[str, Any]
    signals: dict[str, Any]


class Saved(NamedTuple):
    """The values kept at every sample: for a history the sample itself, else `None`; and the
    courses of the traces, by name."""

    history: Sample | None
    courses: dict[str, Course]


class Kept(NamedTuple):
    """The choice of what a recorder keeps.

    - `accumulators`: those that run, each after the ones that it needs.
    - `traces`: the signals that are kept at every sample.
    - `alike`: whether all steps have the same length.
    - `history`: whether every sample is kept.
    """

    accumulators: tuple[Accumulator, ...]
    traces: tuple[Trace, ...]
    alike: bool
    history: bool


class AbstractRecorder(eqx.Module):
    """An observer of a time loop that keeps running results of a `scene`."""

    scene: eqx.AbstractVar[Any]
    kept: eqx.AbstractVar[Kept]

    @property
    @abc.abstractmethod
    def smoothing(self) -> Smoothing:
        """The smoothing of dry friction."""

    @property
    @abc.abstractmethod
    def step(self) -> float:
        """The length of a step that nothing shortens [s]; 0 where no corner can come to the
        tip, which is all that it is needed for."""

    @property
    @abc.abstractmethod
    def flexible_link(self) -> FlexibleLink | None:
        """The flexible link, if there is one."""

    @abc.abstractmethod
    def sample(self, state: Any) -> Sample:
        """The sample of a scene's state."""

    def begin(self, like: Any, body: Body) -> Record:
        """The record before the first sample, of states of the shapes of `like`."""
        shapes = jax.eval_shape(self.sample, like)
        nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
        states = {each.name: each.start(nothing, body) for each in self.kept.accumulators}
        signals = {each.name: each.signal(nothing) for each in self.kept.traces}
        length = None if self.kept.alike else nothing.time
        return Record(nothing._replace(stresses=None), length, states, signals)

    def update(self, record: Record, state: Any, length: Array, unbalance: Array) -> Record:
        """The record with the next sample, one step of `length` [s] after the last; 0 for the
        first sample."""
        now, before = self.sample(state), record.last
        first = length == 0
        ratio = 1.0
        if record.length is not None:
            known = (record.length > 0) & ~first
            ratio = jnp.where(known, record.length, 1.0) / jnp.where(known, length, 1.0)
        span = Span(length, first, ratio)
        # Times count from the scene's first sample.
        second = ~first & (before.time == 0)
        step = Step(
            before, now, span, second, unbalance, self.smoothing, self.step,
            cutoff(self.flexible_link), record.states, self.scene,
        )  # fmt: skip
        states = {
            each.name: each.update(record.states[each.name], step)
            for each in self.kept.accumulators
        }
        signals = {each.name: each.signal(now) for each in self.kept.traces}
        kept = None if record.length is None else length
        return Record(now._replace(stresses=None), kept, states, signals)

    @property
    def saves(self) -> bool:
        """Whether anything is kept at every sample."""
        return self.kept.history or bool(self.kept.traces)

    def saved(self, record: Record) -> Saved:
        """The values kept at every sample."""
        time = record.last.time
        courses = {name: Course(time, signal) for name, signal in record.signals.items()}
        return Saved(record.last if self.kept.history else None, courses)


def running(
    measures: tuple[Measure, ...], energy: bool, slopes: float | None
) -> tuple[Accumulator, ...]:
    """The accumulators behind some measures, each once; those of the ledger if `energy` is set;
    those of the error of the peak force's derivatives by steps of the tolerance `slopes`, unless
    that is `None`; and those of the status.

    Raises `ValueError` where two have one name.
    """
    found: dict[str, Accumulator] = {}

    def add(accumulator: Accumulator):
        for needed in accumulator.needs:
            add(needed)
        _one_of_a_name(accumulator, found.setdefault(accumulator.name, accumulator))

    for accumulator in _JUDGED:
        add(accumulator)
    for measure in measures:
        if isinstance(measure.accumulator, Accumulator):
            add(measure.accumulator)
    for reserved in (SLOPES, _RIVALS):
        # Other accumulators may not have these names, whether these are wanted or not.
        _one_of_a_name(reserved, found.get(reserved.name, reserved))
    if energy:
        add(accumulators.WORK)
        add(accumulators.ORIGIN)
    if slopes is not None:
        add(SLOPES)
        add(rivals(STEPS_MISS * slopes))
    return tuple(found.values())


def traced(measures: tuple[Measure, ...]) -> tuple[Trace, ...]:
    """The traces behind some measures, each once.

    Raises `ValueError` where two have one name.
    """
    found: dict[str, Trace] = {}
    for measure in measures:
        if isinstance(trace := measure.accumulator, Trace):
            _one_of_a_name(trace, found.setdefault(trace.name, trace))
    return tuple(found.values())


def _one_of_a_name(given: Accumulator | Trace, known: Accumulator | Trace) -> None:
    if given != known:
        raise ValueError(
            f"Argument `measures` must be read from {type(given).__name__}s of different names, "
            f"but two that are not the same are named {given.name!r}. Name one's own otherwise, "
            "and make what several measures read once for all of them."
        )


class SceneRecorder(AbstractRecorder):
    """The recorder of a scene in the plane."""

    scene: Scene
    mechanics: Mechanics
    kept: Kept = eqx.field(static=True)

    @property
    def smoothing(self) -> Smoothing:
        return self.mechanics.fidelity.smoothing

    @property
    def step(self) -> float:
        return self.mechanics.fidelity.step

    @property
    def flexible_link(self) -> FlexibleLink | None:
        return self.mechanics.link

    def sample(self, state: SceneState) -> Sample:
        return describe(self.mechanics, *state)


class NormalRecorder(AbstractRecorder):
    """The recorder of a scene of the normal direction alone."""

    scene: NormalScene
    link: FlexibleLink | None
    kept: Kept = eqx.field(static=True)

    @property
    def smoothing(self) -> Smoothing:
        # Nothing slides: the smoothing has no effect.
        return Smoothing(1.0, 1.0)

    @property
    def step(self) -> float:
        return 0.0

    @property
    def flexible_link(self) -> FlexibleLink | None:
        return self.link

    def sample(self, state: NormalState) -> Sample:
        return describe_normal(self.scene.parcel, self.link, state)
