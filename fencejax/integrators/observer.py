"""The interface by which a time loop passes its samples on."""

from typing import Any, Protocol

from jaxtyping import Array

from ..model import NormalState, SceneState
from ..scenes import Body


class Observer(Protocol):
    """A recorder of a scene as it advances. The time loop carries its record and does not read it.

    A record is a pytree of floating-point arrays whose shapes never change.
    """

    def begin(self, like: SceneState | NormalState, body: Body) -> Any:
        """The record before the first sample, of samples of the shapes of `like`, for a parcel that
        starts with the motion `body`."""

    def update(
        self, record: Any, state: SceneState | NormalState, length: Array, unbalance: Array
    ) -> Any:
        """The record with the next sample, after a step of `length` [s] (0 for the first sample)
        whose equations are out of balance by the force `unbalance` [N]."""

    def saved(self, record: Any) -> Any:
        """The part of a record that a history keeps at every sample."""
