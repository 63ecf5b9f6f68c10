"""One lane of every program: a fence, a parcel, a drive, and the first contact."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj
from fencejax.scenes import Body, NormalScene, Scene
from fencejax.simulate import prepared

from .drives import FittedDrive
from .fences import FENCES


class Case(eqx.Module):
    """A parcel that a fence hits on the drive's way out.

    Built from plain numbers by `make`; lanes are stacked by `stack`, each leaf with the lane as its
    first axis.
    """

    fence: fj.Fence
    parcel: fj.Parcel
    drive: FittedDrive
    distance: Array
    """R [m], arc coordinate of the first contact."""
    drive_angle: Array
    """alpha_w [rad] at the first contact."""
    turn: Array
    """The parcel's rotation at the first contact [1]: 0, its sides along the belt; 1, its centre of
    gravity on the fence's normal through the corner."""

    def impact(self, duration: float, fidelity: fj.Fidelity) -> Scene:
        """The oblique impact, from its first contact on, for `duration` [s]."""
        central = self._touching(None, duration)
        angle = self.turn * _pose(central, fidelity)[1].angle
        return self._touching(angle, duration)

    def _touching(self, parcel_angle: Array | None, duration: float) -> Scene:
        return fj.scenes.oblique_impact(
            fence=self.fence,
            parcel=self.parcel,
            drive=self.drive,
            distance=self.distance,
            drive_angle=self.drive_angle,
            parcel_angle=parcel_angle,
            duration=duration,
        )

    def approach_speed(self, distance: Array) -> Array:
        """v_n = v sin(alpha_w) + R alphadot_w [m/s], the normal approach speed at R = `distance`
        [m] at the instant of the first contact."""
        rate = self.drive.motion(self.drive.time_at(self.drive_angle)).speed
        return fj.Belt().speed * jnp.sin(self.drive_angle) + distance * rate

    def wall(self) -> NormalScene:
        """The same parcel against a rigid obstacle at the same normal approach speed: N_stiff."""
        return fj.scenes.rigid_wall(
            speed=self.approach_speed(self.distance), parcel=self.parcel
        )


class Start(eqx.Module):
    """The parcel's place when the drive starts, as in `fencejax.scenes.whole_sort` [m, m, rad];
    each of shape () or (lanes,)."""

    front: Array
    offset: Array
    angle: Array


def _pose(scene: Scene, fidelity: fj.Fidelity) -> tuple[Array, Body]:
    """The drive's clock [s] and the parcel's motion at the first contact."""
    _, clock, memory = prepared(scene, fidelity)
    return clock.start, memory.body


@eqx.filter_jit
def starts(cases: Case, fidelity: fj.Fidelity) -> Start:
    """The places of parcels at t = 0 from which the belt carries them into the impacts of
    `cases`."""

    def one(case: Case) -> Start:
        time, body = _pose(case.impact(1.0, fidelity), fidelity)
        corners = [case.parcel.corner(number) for number in (1, 2, 3, 4)]
        cosine, sine = jnp.cos(body.angle), jnp.sin(body.angle)
        foremost = jnp.max(jnp.stack([cosine * x - sine * y for x, y in corners]))
        lowest = jnp.min(jnp.stack([sine * x + cosine * y for x, y in corners]))
        ridden = fj.Belt().speed * time
        return Start(body.x + foremost - ridden, body.y + lowest, body.angle)

    return fj.each_lane(one, cases)


def make(
    fence: str,
    *,
    distance: float,
    drive_angle: float,
    turn: float = 1.0,
    material: fj.Material | None = None,
    parcel: fj.Parcel | None = None,
    law: str = "harmonic",
) -> Case:
    """A lane of the fence named `fence`, one of `FENCES`; the numbers are those of `Case`.

    Raises `ValueError` where the distance or the angle is out of the fence's or the drive's reach.
    """
    made = FENCES[fence](material=material)
    parcel = fj.Parcel() if parcel is None else parcel
    drive = FittedDrive(law)
    # The scene's own checks, on the host.
    fj.scenes.oblique_impact(fence=made, drive=drive, distance=distance, drive_angle=drive_angle)
    numbers = (jnp.asarray(float(value)) for value in (distance, drive_angle, turn))
    return Case(made, parcel, drive, *numbers)


def undeformable(case: Case) -> Case:
    """The case with an undeformable fence: a billion times the modulus."""
    return eqx.tree_at(
        lambda c: c.fence.material.youngs_modulus,
        case,
        1e9 * case.fence.material.youngs_modulus,
    )


def stack(lanes: Sequence):
    """Lanes of the same structure as one, each leaf with the lane as its first axis."""
    return jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *lanes)


def lane(batch, index):
    """Lanes `index` (a number or a slice) of a batch."""
    return jax.tree.map(lambda leaf: leaf[index], batch)
