"""What watches a scene advance: each state becomes a sample, and the samples running results."""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Smoothing
from ..model import FlexibleLink, Mechanics, NormalState, SceneState
from ..parts import Parcel
from ..scenes import Body
from . import accumulators
from .accumulators import Accumulator, Step
from .measures import Measure
from .peak import Span
from .resolution import RESOLUTION
from .sample import Sample, describe, describe_normal

# What a status is read from.
_JUDGED = (
    accumulators.FORCE, accumulators.TIP, accumulators.BORDER, accumulators.SURFACE,
    accumulators.CONTACT, accumulators.DEEPEST, accumulators.OVER_TIP, accumulators.UNBALANCE,
    RESOLUTION,
)  # fmt: skip


class Record(NamedTuple):
    """Running results: the last sample, the length of the last step [s] (`None` where all are
    alike), and the state of each accumulator by name."""

    last: Sample
    length: Array | None
    states: dict[str, Any]


class AbstractRecorder(eqx.Module):
    """An observer of a time loop that keeps running results.

    - `smoothing`: how dry friction is smoothed.
    - `wanted`: the accumulators that run, each after those it needs.
    - `alike`: whether all steps are of one length.
    """

    smoothing: eqx.AbstractVar[Smoothing]
    wanted: eqx.AbstractVar[tuple[Accumulator, ...]]
    alike: eqx.AbstractVar[bool]

    @abc.abstractmethod
    def sample(self, state: Any) -> Sample:
        """The sample of a scene's state."""

    def begin(self, like: Any, body: Body) -> Record:
        """The record before the first sample, of states of the shapes of `like`."""
        shapes = jax.eval_shape(self.sample, like)
        nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
        states = {each.name: each.start(nothing, body) for each in self.wanted}
        return Record(nothing, None if self.alike else nothing.time, states)

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
        step = Step(before, now, span, second, unbalance, self.smoothing, record.states)
        states = {each.name: each.update(record.states[each.name], step) for each in self.wanted}
        return Record(now, None if record.length is None else length, states)

    def saved(self, record: Record) -> Sample:
        """What a history keeps at every sample."""
        return record.last


def running(measures: tuple[Measure, ...], energy: bool) -> tuple[Accumulator, ...]:
    """The accumulators behind some measures, the ledger if its `energy` is wanted, and the status,
    each once."""
    found: dict[str, Accumulator] = {}

    def add(accumulator: Accumulator):
        for needed in accumulator.needs:
            add(needed)
        found.setdefault(accumulator.name, accumulator)

    for accumulator in _JUDGED:
        add(accumulator)
    for measure in measures:
        add(measure.accumulator)
    if energy:
        add(accumulators.WORK)
        add(accumulators.ORIGIN)
    return tuple(found.values())


class SceneRecorder(AbstractRecorder):
    """Of a scene in the plane."""

    mechanics: Mechanics
    smoothing: Smoothing = eqx.field(static=True)
    wanted: tuple[Accumulator, ...] = eqx.field(static=True)
    alike: bool = eqx.field(static=True)

    def __init__(self, mechanics: Mechanics, wanted: tuple[Accumulator, ...], alike: bool):
        self.mechanics, self.wanted, self.alike = mechanics, wanted, alike
        self.smoothing = mechanics.fidelity.smoothing

    def sample(self, state: SceneState) -> Sample:
        return describe(self.mechanics, *state)


class NormalRecorder(AbstractRecorder):
    """Of a scene of the normal direction alone."""

    parcel: Parcel
    link: FlexibleLink | None
    smoothing: Smoothing = eqx.field(static=True)
    wanted: tuple[Accumulator, ...] = eqx.field(static=True)
    alike: bool = eqx.field(static=True)

    def __init__(
        self,
        parcel: Parcel,
        link: FlexibleLink | None,
        wanted: tuple[Accumulator, ...],
        alike: bool,
    ):
        self.parcel, self.link, self.wanted, self.alike = parcel, link, wanted, alike
        # Nothing slides: any smoothing does.
        self.smoothing = Smoothing(1.0, 1.0)

    def sample(self, state: NormalState) -> Sample:
        return describe_normal(self.parcel, self.link, state)
