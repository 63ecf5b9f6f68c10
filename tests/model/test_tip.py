"""The fence's tip against the parcel's side at one instant: gap, force and their continuity."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.model import FencePoint, Side, around, corner_from_arm, fence_touch
from fencejax.parts import SIDES
from fencejax.scenes import Body

REACH, FADE = 1.2, 5e-3
PARCEL = fj.Parcel()
CORNERS = {number: np.array(PARCEL.corner(number)) for number in SIDES}


def met(pose, number=1, tilt=0.3, length=FADE, radius=None):
    """The touch of a corner against a rigid straight fence at rest, at a pose (x, y, phi)."""
    x, y, angle = pose
    zero = jnp.zeros(())
    body = Body(x, y, angle, zero, zero, zero)
    turn = lambda v: (  # noqa: E731
        jnp.cos(angle) * v[0] - jnp.sin(angle) * v[1],
        jnp.sin(angle) * v[0] + jnp.cos(angle) * v[1],
    )
    arm, next_arm = turn(PARCEL.corner(number)), turn(PARCEL.corner(SIDES[number]))
    corner = corner_from_arm(body, *arm)
    foot = corner.x * jnp.cos(tilt) + corner.y * jnp.sin(tilt)
    place = jnp.minimum(foot, REACH)
    touch = fence_touch(
        corner, FencePoint(place, zero, zero, zero, zero), (jnp.cos(tilt), jnp.sin(tilt)), zero
    )
    size = PARCEL.side(number)
    side = Side((next_arm[0] - arm[0]) / size, (next_arm[1] - arm[1]) / size, size)
    return around(touch, zero, side, REACH - place, length, radius), touch


def poses(number, count=400, tilt=0.3):
    """Random poses with corner `number` within 3 cm of the tip, the fence's tangent turned from
    the side behind it by -1 to 3 rad."""
    rng = np.random.default_rng(number)
    theta = rng.uniform(-1.0, 3.0, count)
    # Direction from the corner to the next one: opposite to the tangent, turned back by theta.
    towards = tilt + np.pi - theta
    own, next_arm = CORNERS[number], CORNERS[SIDES[number]]
    angle = towards - np.arctan2(*(next_arm - own)[::-1])
    place = REACH + rng.uniform(-0.03, 0.03, count)
    depth = rng.uniform(-0.01, 0.03, count)
    x = place * np.cos(tilt) + depth * np.sin(tilt)
    y = place * np.sin(tilt) - depth * np.cos(tilt)
    x -= np.cos(angle) * own[0] - np.sin(angle) * own[1]
    y -= np.sin(angle) * own[0] + np.cos(angle) * own[1]
    return theta, place, depth, np.stack([x, y, angle], axis=-1)


@pytest.mark.parametrize(("number", "radius"), [(1, None), (2, None), (3, None), (4, 0.008)])
def test_force_is_the_gradient_of_the_gap(number, radius):
    *_, where = poses(number)

    def one(pose):
        touch, _ = met(pose, number, radius=radius)
        return touch.gap, touch.normal

    slopes, normal = jax.jit(jax.vmap(jax.grad(one, has_aux=True)))(where)
    np.testing.assert_allclose(np.stack(normal, axis=-1), -slopes, atol=1e-12)


def test_an_edge_of_a_radius():
    """Where the smoothing is over, the arc's depth in the side: that of its centre, and the radius;
    its force goes through the centre. One of no radius is a sharp one."""
    radius, tilt, number = 0.008, 0.3, 1
    theta, place, depth, where = poses(number)
    touch, _ = jax.jit(jax.vmap(lambda p: met(p, number, length=1e-9, radius=radius)))(where)
    center = REACH * np.array([np.cos(tilt), np.sin(tilt)])
    center = center + radius * np.array([np.sin(tilt), -np.cos(tilt)])
    inward = np.stack([-np.sin(tilt - theta), np.cos(tilt - theta)], 1)
    corner = np.stack([place * np.cos(tilt) + depth * np.sin(tilt),
                       place * np.sin(tilt) - depth * np.cos(tilt)], 1)  # fmt: skip
    inside = np.sum((center - corner) * inward, axis=1) + radius
    on_arc = (theta > 0) & (inside < depth)
    np.testing.assert_allclose(touch.gap[on_arc], inside[on_arc], atol=1e-8)
    on_face = (theta > 0) & (inside > depth)
    np.testing.assert_allclose(touch.gap[on_face], depth[on_face], atol=1e-8)
    assert min(on_arc.sum(), on_face.sum()) > 50
    x, y, moment = (np.asarray(part)[on_arc] for part in touch.normal)
    arm = (center - where[:, :2])[on_arc]
    np.testing.assert_allclose(moment, arm[:, 0] * y - arm[:, 1] * x, atol=1e-8)
    sharp, none = (jax.vmap(lambda p, r=r: met(p, radius=r))(where)[0] for r in (0.0, None))
    for ours, theirs in zip(jax.tree.leaves(sharp), jax.tree.leaves(none), strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_gap_is_the_lesser_of_corner_and_tip(number):
    """Where the smoothing is over: the corner's depth under the fence, or that of the tip in the
    side, by elementary geometry, upright or not."""
    theta, place, depth, where = poses(number)
    gap = jax.vmap(lambda p: met(p, number, length=1e-9)[0].gap)(where)
    inside = depth * np.cos(theta) + (REACH - place) * np.sin(theta)
    # Where the side falls below the fence, theta < 0, the tip's depth is the greater one beyond it.
    wanted = np.where(theta > 0, np.minimum(depth, inside), np.maximum(depth, inside))
    np.testing.assert_allclose(gap, wanted, atol=1e-8)


def parcel_at(point, along, theta, tilt=0.3, number=1):
    """The pose (x, y, phi) with a `point` of the fence's tangent frame at the tip, (along, inside)
    [m], on the side behind a corner: `along` [m] from there; the side turned by theta."""
    t, n = np.array([np.cos(tilt), np.sin(tilt)]), np.array([-np.sin(tilt), np.cos(tilt)])
    towards = -t * np.cos(theta) + n * np.sin(theta)
    own, next_arm = CORNERS[number], CORNERS[SIDES[number]]
    angle = np.arctan2(*towards[::-1]) - np.arctan2(*(next_arm - own)[::-1])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corner = (REACH + point[0]) * t + point[1] * n - along * towards
    return np.array([*(corner - turn @ own), angle])


def test_the_tip_meets_the_flat_side_at_any_angle():
    """From the first contact on, no corner at the fence: the whole force, along the side's normal
    and through the tip, where the parcel stands upright on the fence as well."""
    theta = np.linspace(0.05, 3.0, 60)
    depths = np.array([1e-6, 0.01])
    # The tip 0.1 m from the corner: beyond D tan(theta / 2) + l.
    where = [
        [parcel_at(-d * np.array([np.sin(q), np.cos(q)]), 0.1, q) for q in theta] for d in depths
    ]
    touch, _ = jax.vmap(jax.vmap(lambda p: met(p)))(np.array(where))
    by_polygon = np.broadcast_to(depths[:, None], touch.gap.shape)
    upright = 0.1 > depths[:, None] * np.tan(theta / 2) + 2 * FADE
    np.testing.assert_allclose(touch.gap[upright], by_polygon[upright], atol=1e-12)
    np.testing.assert_array_equal(touch.remaining(1.0)[upright], 1.0)
    inward = 0.3 - theta
    x, y, moment = (np.asarray(part) for part in touch.normal)
    np.testing.assert_allclose(x[0], -np.sin(inward), atol=1e-12)
    np.testing.assert_allclose(y[0], np.cos(inward), atol=1e-12)
    arm = REACH * np.array([np.cos(0.3), np.sin(0.3)]) - np.array(where)[0, :, :2]
    np.testing.assert_allclose(moment[0], arm[:, 0] * y[0] - arm[:, 1] * x[0], atol=1e-12)


def pressed(where, number, depth):
    """The force (x, y) of a contact at poses, in units of an elastic one's at a `depth` [m]."""
    touch, _ = jax.jit(jax.vmap(lambda p: met(p, number)))(where)
    size = touch.remaining(1.0) * np.maximum(touch.gap, 0.0) ** 4 / depth**4
    return np.stack([size * touch.normal[0], size * touch.normal[1]], 1)


def test_a_corner_slides_over_the_tip_unhindered():
    """Corner 1 slides off the fence at 15 mm of depth, all four corners and sides there: the force
    passes to the side behind it without a jump, and the leading side, which the tip comes under
    from the fence and not from outside, holds the parcel back only while the corner lies on it."""
    depth, tangent = 0.015, np.array([np.cos(0.3), np.sin(0.3)])
    beyond, angles = np.linspace(-0.06, 0.06, 1201), (0.02, 0.3, 0.8, 1.3, 1.5, 1.6)
    where = np.array([[parcel_at((s, -depth), 0.0, theta) for s in beyond] for theta in angles])
    forces = [
        pressed(where.reshape(-1, 3), number, depth).reshape(len(angles), -1, 2)
        for number in (1, 2, 3, 4)
    ]
    total = np.sum(forces, axis=0)
    # The largest slopes: those of the fourth power over the depth, and of the fade over l.
    step = beyond[1] - beyond[0]
    assert np.abs(np.diff(total, axis=1)).max() < 2 * step * (4 / depth + 1.5 / FADE)
    for theta, force, leading in zip(angles, total, forces[3], strict=True):
        # Of the tip under it, D sin(theta) - s cos(theta), s before the corner, and faded there.
        before = np.linspace(0.0, FADE, 101)
        under = np.maximum(np.sin(theta) - before / depth * np.cos(theta), 0.0)
        faded = (before / FADE) ** 2 * (3 - 2 * before / FADE)
        most = max(np.cos(theta), 0.0) * np.max(faded * under**4)
        assert (force @ tangent).min() > -1.05 * most - 1e-9
        np.testing.assert_array_equal(leading[beyond > 1e-12], 0.0)


def test_force_is_continuous_as_a_wall_turns():
    """The tip under a wall, at either end and between, as it turns from below the fence to beyond
    upright: no jump where it lies flat nor anywhere else."""
    theta = np.linspace(-0.3, 2.5, 2801)
    where = np.array(
        [parcel_at((0.0, -0.012), along, q) for along in (0.003, 0.1, 0.397) for q in theta]
    )
    force = pressed(where, 1, 0.012).reshape(3, -1, 2)
    # A radian changes the depth by 12 mm, the direction by 1, and where the far corner lies by
    # 0.4 m sin(0.3), of which the force ends over l.
    step = theta[1] - theta[0]
    assert np.abs(np.diff(force, axis=1)).max() < step * (4 + 1 + 1.5 * 0.4 * np.sin(0.3) / FADE)


def test_a_corner_that_a_scene_leaves_out_is_reported():
    """The corner before or after cannot touch the fence: reported where it lies lower, under the
    fence, or its side under the tip."""

    def missed(along, inside, theta, follows):
        pose = parcel_at((along, inside), 0.0, theta)
        x, y, angle = pose
        zero = jnp.zeros(())
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        arms = [turn @ CORNERS[k] for k in (1, 2)]
        place = REACH + min(along, 0.0)
        axes = np.cos(0.3), np.sin(0.3)
        point = FencePoint(jnp.asarray(place), zero, zero, zero, zero)
        body = Body(*(jnp.asarray(q) for q in (x, y, angle)), zero, zero, zero)
        touch = fence_touch(corner_from_arm(body, *arms[0]), point, axes, zero)
        side = Side(*((arms[1] - arms[0]) / 0.4), jnp.asarray(0.4), follows, jnp.asarray(0.3))
        return float(around(touch, zero, side, REACH - place, FADE).missed)

    assert missed(-0.5, -0.005, 0.4, False) == 0.0
    # Corner 2, lower by 0.4 m x sin(0.1); the same where it may touch.
    assert missed(-0.5, 0.02, -0.1, False) == 1.0
    assert missed(-0.5, 0.02, -0.1, True) == 0.0
    # Corner 4, lower by 0.3 m x cos(1.8), on the fence and beyond the tip; clear of the fence.
    assert missed(-0.5, 0.02, 1.8, True) == 1.0
    assert missed(-0.2, 0.02, 1.8, True) == 1.0
    assert missed(-0.2, 0.06, 1.8, True) == 0.0


def test_is_the_corner_far_from_the_tip():
    pose = jnp.array([0.95, 0.55, -0.5])
    here, plain = met(pose)
    for ours, theirs in zip(here[:6], plain[:6], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-15)
