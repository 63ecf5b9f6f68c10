"""The normal direction alone: a fence at rest, or a rigid wall."""


from jaxtyping import ArrayLike

from .. import _check
from ..parts import Fence, Parcel
from .arguments import duration_of, fence_of, parcel_of, place_of
from .scene import NormalScene


def normal_impact(
    *,
    fence: Fence | None = None,
    distance: ArrayLike | None = None,
    speed: ArrayLike = 2.426,
    parcel: Parcel | None = None,
    duration: float | None = None,
) -> NormalScene:
    """A parcel strikes a fence whose root is at rest, along its normal: the smallest scene with a
    fence.

    **Arguments:**

    - `distance`: arc coordinate [m] from the hinge where it strikes, by default R_z - 0.2 l_p.
    - `speed`: the normal approach speed v_n [m/s].
    - `fence`, `parcel`: by default the paper's.
    - `duration` [s], static, default 0.25.

    Raises `ValueError` where the distance is out of the fence's reach.

    >>> fj.scenes.normal_impact(speed=2.0, distance=1.0).speed.item()
    2.0
    """
    fence = fence_of(fence)
    if distance is None:
        distance = fence.reach - 0.2 * fence.flexible_length
    return NormalScene(
        parcel_of(parcel),
        _check.scalar("speed", speed, size=1.0, unit="m/s"),
        fence,
        place_of(distance, fence),
        duration_of(duration, 0.25),
    )


def rigid_wall(
    *, speed: ArrayLike = 2.426, parcel: Parcel | None = None, duration: float | None = None
) -> NormalScene:
    """A parcel strikes a rigid wall of infinite mass: N_stiff, one coordinate.

    `speed` is the normal approach speed v_n [m/s]; `duration` [s] is static, default 0.1.

    >>> print(f"{fj.simulate(fj.scenes.rigid_wall(speed=2.0)).peak_force:.0f} N")
    2440 N
    """
    return NormalScene(
        parcel_of(parcel),
        _check.scalar("speed", speed, size=1.0, unit="m/s"),
        None,
        None,
        duration_of(duration, 0.1),
    )
