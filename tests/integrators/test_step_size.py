"""Steps of different lengths: right, fewer, differentiable; and the solver under diffrax's loop."""

import functools
from types import SimpleNamespace

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from runs import FIXED, one_by_one

import fencejax as fj
from fencejax.integrators import modal_step, next_step_size, time_loop as integrate
from fencejax.model import Contact
from fencejax.simulate import prepared

NAMES = ("peak_force", "tip_deflection", "impulse", "peak_stress", "furthest_y", "contact_time")
COARSE = fj.Fidelity(modes=2)


def sort(thickness, offset, fidelity, **options):
    scene = fj.scenes.whole_sort(
        fence=fj.Fence(thickness=thickness), front=0.7, offset=offset, duration=0.7,
        border=None, fence_corners=(1,), fence_friction=None, tip_contact=False,
    )
    return fj.simulate(scene, fidelity=fidelity, **options)


@functools.cache
def measured(longest):
    """Derivatives in the thickness of two sorts, and values."""
    fidelity = COARSE.replace(longest_stride=longest)

    def numbers(thickness, offset):
        result = sort(thickness, offset, fidelity, only=NAMES)
        found = jnp.stack([getattr(result, name) for name in NAMES])
        return found, found

    run = jax.jit(one_by_one(lambda sort: jax.jacfwd(numbers, has_aux=True)(*sort)))
    return run((jnp.array([0.045, 0.03]), jnp.array([0.05, 0.2])))


def test_fewer_steps_and_the_same_sort():
    history = sort(0.045, 0.05, COARSE).history
    assert history.time.size < 0.6 * (1 + round(0.7 / COARSE.step))
    assert np.max(np.diff(history.time)) == pytest.approx(2e-3)
    # While the force falls to nothing, and where it rises from it, steps are the shortest.
    force = np.asarray(history.fence_force)
    rises = np.flatnonzero((force[:-1] == 0) & (force[1:] > 0))
    assert np.diff(history.time)[rises] == pytest.approx(COARSE.step)
    # A stride lets the forces be off their straight continuation by 0.5 % of their size.
    values, alike = measured(None)[1], measured(1)[1]
    np.testing.assert_allclose(values[:, :5], alike[:, :5], rtol=5e-3)
    # Times of touch and parting lie within two of the shortest steps.
    np.testing.assert_allclose(values[:, 5], alike[:, 5], rtol=0, atol=2 * COARSE.step)
    assert not np.array_equal(values, alike)


def test_its_derivative():
    # The lengths are chosen by the values alone: the derivative is that of the steps as taken.
    found, alike = (np.asarray(measured(longest)[0]) for longest in (None, 1))
    scale = np.abs(alike).max(axis=0, keepdims=True)
    np.testing.assert_allclose(found / scale, alike / scale, rtol=0, atol=5e-2)


def test_inside_jit_the_last_sample_fills_the_room():
    inside = jax.jit(lambda: sort(0.045, 0.05, COARSE).history)()
    outside = sort(0.045, 0.05, COARSE).history
    taken = outside.time.size
    assert inside.time.size == 1 + round(0.7 / COARSE.step)
    np.testing.assert_array_equal(inside.time[taken:], outside.time[-1])
    np.testing.assert_allclose(inside.fence_force[:taken], outside.fence_force, rtol=1e-9)


def at_gap(gap, gap_rate, normal, place=0.5, sliding=0.0):
    """Forces of one corner at the fence."""
    zero = jnp.zeros(())
    contact = Contact(jnp.asarray(normal), zero, jnp.asarray(gap), jnp.asarray(gap_rate),
                      jnp.asarray(place), jnp.asarray(sliding))
    meeting = SimpleNamespace(contact=contact)
    return SimpleNamespace(fence=(meeting,), still=(), meetings=(meeting,))


def chosen(what, *, last=8.0, jump=0.0, before=0.0):
    fidelity = fj.Fidelity(tip_fade=0.01, stride_tolerance=5e-3)
    link = SimpleNamespace(reach=jnp.asarray(1.19))
    mechanics = SimpleNamespace(
        fidelity=fidelity, sides={}, fence_corners=(1,), link=link, drive=fj.HarmonicDrive(),
        edge_radius=None,
    )
    clock = SimpleNamespace(counts=(0, 1, 2, 4, 8), step=2.5e-4, unit=1)
    size = next_step_size(
        mechanics, clock, jnp.asarray(last), jnp.asarray(jump), what, (jnp.asarray(before),)
    )
    assert size.last == last
    return int(size.next)


@pytest.mark.parametrize(
    ("what", "options", "count"),
    [
        # Far away, and coming at 1 m/s: 3 h |Ddot| + 25 h^2 is 0.5 mm short of 6.1 mm for 2 ms.
        (at_gap(-0.1, 0.0, 0.0), {}, 8),
        (at_gap(-0.0056, 1.0, 0.0), {}, 4),
        (at_gap(-0.0062, 1.0, 0.0), {}, 8),
        (at_gap(-0.9e-4, 0.0, 0.0), {}, 4),
        (at_gap(-1e-6, 0.0, 0.0), {}, 1),
        # No more than twice the last step, and the jump grows with the square of the length.
        (at_gap(-0.1, 0.0, 0.0), {"last": 2.0}, 4),
        (at_gap(-0.1, 0.0, 0.0), {"last": 4.0, "jump": 1.2e-3}, 8),
        (at_gap(-0.1, 0.0, 0.0), {"last": 4.0, "jump": 1.3e-3}, 4),
        (at_gap(-0.1, 0.0, 0.0), {"last": 8.0, "jump": 1.0}, 1),
        # Pressing steadily; let go within four steps; off the fence's end; coming back to it.
        (at_gap(1e-3, 0.0, 100.0), {"before": 100.0}, 8),
        (at_gap(1e-3, 0.0, 100.0), {"before": 192.0}, 4),
        (at_gap(1e-3, 0.0, 0.0, place=1.3, sliding=1.0), {}, 8),
        (at_gap(1e-3, 0.0, 0.0, place=1.204, sliding=-1.0), {}, 4),
    ],
)
def test_length_of_the_next_step(what, options, count):
    assert chosen(what, **options) == count


def test_longest_stride_is_checked():
    with pytest.raises(ValueError, match="`longest_stride` must be a power of two, but is 3"):
        fj.Fidelity(longest_stride=3)
    # Up to 2 ms under error control, and in long contacts; nowhere else.
    assert FIXED.settled(1.36).longest_stride == 8
    assert FIXED.settled(0.25).longest_stride == 1
    assert fj.Fidelity().settled(0.25).longest_stride == 4
    assert fj.Fidelity.coarse().settled(1.36).longest_stride == 2
    # Where nothing can touch there is nothing to control.
    free = fj.Fidelity().settled(0.0)
    assert (free.longest_stride, free.step_tolerance) == (1, None)
    assert fj.Fidelity.reference().settled(1.36).longest_stride == 1


def test_stepper_runs_a_whole_scene_under_diffeqsolve():
    # The same steps in diffrax's own loop as in the package's: the same numbers, but for the order
    # in which compilers sum. A step of no length gives the forces at the start.
    fidelity = fj.Fidelity.coarse(longest_stride=1, step_tolerance=None)
    scene = fj.scenes.oblique_impact(duration=0.06)
    samples = fj.simulate(scene, fidelity=fidelity).history
    steps = integrate.count_steps(scene.duration, fidelity.step)

    @jax.jit
    def solve(scene):
        mechanics, clock, memory = prepared(scene, fidelity)

        def advance(args, y, begins, ends):
            return modal_step.step(*args, y, begins, ends)[0]

        zero = jnp.zeros(())
        return diffrax.diffeqsolve(
            *integrate.as_diffrax(advance), t0=0.0, t1=steps, dt0=1.0,
            y0=advance((mechanics, clock), memory, zero, zero), args=(mechanics, clock),
            saveat=diffrax.SaveAt(
                ts=jnp.arange(steps + 1.0), fn=lambda t, y, args: (y.body, y.normals[0])
            ),
            adjoint=diffrax.ForwardMode(),
        ).ys

    body, normal = solve(scene)
    force = np.array(samples.fence[0].normal)
    assert force.max() > 500
    np.testing.assert_allclose(normal, force, rtol=1e-9, atol=1e-9 * force.max())
    for ours, theirs in zip(samples.body, body, strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-9)
