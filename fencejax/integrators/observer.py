"""What a time loop shows its samples to."""

from typing import Any, Protocol

from jaxtyping import Array

from ..model import NormalState, SceneState
from ..scenes import Body


class Observer(Protocol):
    """Whoever watches a scene advance. The loop carries its record along and looks at none of it.

    A record is a pytree of floating-point arrays whose shapes never change.
    """

    def begin(self, like: SceneState | NormalState, body: Body) -> Any:
        """The record before the first sample, of samples of the shapes of `like`, for a parcel that
        starts with the motion `body`."""

    def update(
        self, record: Any, state: SceneState | NormalState, length: Array, unbalance: Array
    ) -> Any:
        """The record with the next sample, one step of `length` [s] after the last (0 for the first
        sample), whose equations leave a force of `unbalance` [N] unbalanced."""

    def saved(self, record: Any) -> Any:
        """What of a record a history keeps at every sample."""
