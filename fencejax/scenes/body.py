"""The parcel's motion."""

from typing import NamedTuple

from jaxtyping import Array


class Body(NamedTuple):
    """Motion of the parcel: C_s at (x, y) [m], angle phi [rad], and their rates.

    >>> scene = fj.scenes.free_motion(position=(0.0, 0.3))
    >>> motion = scene.start.motion
    >>> f"{motion.y:.1f} m, {motion.spin:.1f} rad/s"
    '0.3 m, 2.0 rad/s'
    """

    x: Array
    y: Array
    angle: Array
    x_rate: Array
    y_rate: Array
    spin: Array
