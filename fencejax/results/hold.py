"""How close a corner on the fence was to sticking where it slid, or to sliding where it stuck.

Where static friction is above the kinetic one the motion goes one of two ways: a corner whose
sliding comes to rest sticks, or slides on the other way; a corner that sticks goes on sticking, or
breaks away. This is decided by the friction that a corner needs to stay at rest, compared with the
largest one, mu_max N. Where the two are about equal the smallest change decides, and the force
afterwards differs by up to (mu_max - mu_k) N.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._elementary import cos_sin
from ..fidelity import Smoothing
from ..model import corner_share
from ..parts import AbstractFriction, Parcel
from ..scenes import NormalScene, Scene
from .sample import Sample

# Sliding speeds [w_s]: those of which one has the largest smoothed friction, to within 1 % for a
# w_s of five to a hundred eps; and one with kinetic friction.
_SLOW_SPEEDS, _FAST_SPEED = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.3, 1.7), 10.0
# Share of the largest friction within which it is uncertain which way a corner goes.
_EDGE = 0.03


class Hold(NamedTuple):
    """The evidence that a corner might have stuck, or slid, instead.

    - `near` [N], by corner: the jump of friction if the corner, which needs nearly the largest
      friction to stick, slid instead.
    - `caught`, by corner: 1.0 where its sliding stopped to rest in the last step.
    - `edge` [N]: the largest jump of friction so far where it was uncertain which way a corner
      goes.
    """

    near: tuple[Array, ...]
    caught: tuple[Array, ...]
    edge: Array

    @classmethod
    def start(cls, nothing: Sample) -> "Hold":
        """Before a scene's first sample."""
        none = tuple(nothing.time for _ in nothing.fence)
        return cls(none, none, nothing.time)

    @property
    def unsure(self) -> Array:
        """The largest jump of friction [N] so far of which it is uncertain whether it happens."""
        found = self.edge
        for jump in self.near:
            found = jnp.maximum(found, jump)
        return found


class _Shares(NamedTuple):
    """Smoothed friction as a share of the normal force [1]: the `largest` one near rest, and the
    `jump`, by which that exceeds the friction of a corner that slides."""

    largest: Array
    jump: Array


def _shares(friction: AbstractFriction, smoothing: Smoothing, like: Array) -> _Shares:
    def at(speed: float) -> Array:
        sliding = jnp.full_like(like, speed * smoothing.static_speed)
        return jnp.abs(corner_share(friction, sliding, smoothing)[0])

    largest = at(_SLOW_SPEEDS[0])
    for speed in _SLOW_SPEEDS[1:]:
        largest = jnp.maximum(largest, at(speed))
    return _Shares(largest, jnp.maximum(largest - at(_FAST_SPEED), 0.0))


def _lightness(parcel: Parcel, now: Sample) -> Array:
    """The acceleration of the parcel along the fence's straight line by a unit force along it
    [1/kg]: 1 / m_p + d^2 / I_p, with d the distance of C_s from that line."""
    assert now.drive is not None
    cosine, sine = cos_sin(now.drive.angle)
    across = now.body.x * sine - now.body.y * cosine
    return 1 / parcel.mass + across**2 / parcel.inertia


def updated(
    known: Hold,
    before: Sample,
    now: Sample,
    length: Array,
    scene: NormalScene | Scene,
    smoothing: Smoothing,
) -> Hold:
    """The evidence after a step of the `length` [s] from one sample to the next.

    The friction that a corner needs to stick is |(F_0 + F_1) / 2 - (w_1 - w_0) / (h lambda)|, with
    lambda its lightness [1/kg]. It is uncertain which way a corner goes in these cases:

    - It slides on through rest, and the friction needed is less than the largest one, or hardly
      more.
    - It slides slowly and speeds up again the same way, so slowly that the jump of friction would
      have stopped it within the step.
    - It comes to rest, and the friction needed is nearly the largest one.
    - It sticks, and the friction needed has come near the largest one and fallen again.
    """
    if isinstance(scene, NormalScene) or scene.fence_friction is None or not now.fence:
        return known
    friction, parcel, before, now, length = jax.lax.stop_gradient(
        (scene.fence_friction, scene.parcel, before, now, length)
    )
    most, jump = _shares(friction, smoothing, now.time)
    impulse = jnp.where(length > 0, length, 1.0) * _lightness(parcel, now)
    rests, free = smoothing.static_speed, smoothing.slides_above
    near, caught, edge = [], [], known.edge
    for was, is_, close, new in zip(
        before.fence, now.fence, known.near, known.caught, strict=True
    ):
        pressed = (was.normal > 0) & (is_.normal > 0)
        at_rest = pressed & (jnp.abs(is_.sliding) < rests)
        slides = jnp.abs(is_.sliding) > free
        wanted = 0.5 * (was.friction + is_.friction) - (is_.sliding - was.sliding) / impulse
        normal = 0.5 * (was.normal + is_.normal)
        share = jnp.abs(wanted) / jnp.where(pressed, most * normal, 1.0)
        at_edge = at_rest & (share > 1 - _EDGE)
        back = pressed & ~slides & (close > 0) & (share < 1 - 2 * _EDGE)
        passed = pressed & slides & (was.sliding * is_.sliding < 0) & (share < 1 + _EDGE)
        # Slowest at the step's start, where static friction would have stopped it within the step.
        fast = jnp.abs(was.sliding)
        stops = fast < jump * normal * impulse
        speeds_up = (was.sliding * is_.sliding > 0) & (jnp.abs(is_.sliding) > fast)
        missed = pressed & slides & (fast > rests) & stops & speeds_up & (share < 1 + _EDGE)
        unsure = (at_edge & (new > 0)) | back | passed | missed
        edge = jnp.where(unsure, jnp.maximum(edge, jump * is_.normal), edge)
        close = jnp.where(at_edge, jnp.maximum(close, jump * is_.normal), close)
        near.append(jnp.where(slides | back | ~pressed, 0.0, close))
        stopped = at_rest & (jnp.abs(was.sliding) > free)
        caught.append(jnp.where(stopped, 1.0, 0.0))
    return Hold(tuple(near), tuple(caught), edge)
