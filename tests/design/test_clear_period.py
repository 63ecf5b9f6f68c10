"""The shortest period without contact of the next parcel, against a search over positions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import sorting


def harmonic(time, top_speed, cycle):
    rise = 0.5 * top_speed * cycle / np.pi
    return np.where(time < cycle, rise * (1 - np.cos(2 * np.pi * time / cycle)), 0.0)


def searched(angle, cycle, speed, front, offset, turned=0.0):
    """The shortest period by halving: is every corner of the next parcel, 0.4 m x 0.3 m, above the
    fence's line or not there yet, at each of many times?"""
    time = np.linspace(0, cycle, 100_001)[1:-1]
    alpha = angle(time)
    along, across = np.cos(alpha), np.sin(alpha)
    cosine, sine = np.cos(turned), np.sin(turned)
    x = np.array([x * cosine - y * sine for x in (-0.2, 0.2) for y in (-0.15, 0.15)])
    y = np.array([x * sine + y * cosine for x in (-0.2, 0.2) for y in (-0.15, 0.15)])
    x, y = x - x.max() + front, y - y.min() + offset
    low, high = 0.5, 3.0
    while high - low > 1e-10:
        period = 0.5 * (low + high)
        clear = True
        for corner_x, corner_y in zip(x, y, strict=True):
            ahead = corner_x - speed * (period - time)
            above = corner_y * along - ahead * across >= 0
            clear = clear and np.all(above)
        low, high = (low, period) if clear else (period, high)
    return high


@pytest.mark.parametrize(
    ("front", "offset", "turned"), [(0.1, 0.02, 0.0), (0.3, 0.15, 0.0), (0.1, 0.05, 0.3)]
)
def test_shortest_period(front, offset, turned):
    point = np.array([1.53, 1.36, 2.0, front, offset])

    def ours(p):
        return sorting.shortest_period(
            fj.scenes.whole_sort(
                drive=fj.HarmonicDrive(p[0], p[1]), belt=fj.Belt(speed=p[2]), front=p[3],
                offset=p[4], angle=turned, duration=1.36,
            )
        )  # fmt: skip

    def theirs(p):
        return searched(lambda t: harmonic(t, p[0], p[1]), p[1], *p[2:], turned)

    value, slope = jax.jit(jax.value_and_grad(ours))(jnp.asarray(point))
    # 100,000 times: the largest of a parabola is missed by some 50 1/s (7 us)^2.
    assert float(value) == pytest.approx(theirs(point), abs=1e-8)
    for i, one in enumerate(np.eye(5) * 2e-4):
        expected = (theirs(point + one) - theirs(point - one)) / 4e-4
        assert float(slope[i]) == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_on_the_border_the_fence_has_to_be_home():
    # A trapezoid with a dwell: home after two strokes of (1 rad) / 2 + 2 / 10 s and the dwell.
    drive = fj.TrapezoidDrive(end_angle=1.0, top_speed=2.0, acceleration=10.0, dwell=0.1)
    scene = fj.scenes.whole_sort(drive=drive, front=0.1, duration=1.5)
    home = 2 * (0.5 + 0.2) + 0.1
    assert float(sorting.CLEAR_PERIOD(None, scene)) == pytest.approx(home + 0.1 / 2.0)
    # A little beside it: nearly so.
    beside = fj.scenes.whole_sort(drive=drive, front=0.1, offset=1e-6, duration=1.5)
    assert float(sorting.shortest_period(beside)) == pytest.approx(home + 0.1 / 2.0, abs=0.01)
    with pytest.raises(ValueError, match="whole_sort"):
        sorting.shortest_period(fj.scenes.oblique_impact())


def test_of_a_torque_drive_it_follows_from_the_sort():
    # A drive that no blow moves: phi = t^2 / 2 at 1 rad/s^2, as it ends its cycle far out.
    heavy = 1e7
    drive = fj.TorqueDrive([heavy], cycle_time=0.7, turn=1.0, inertia=heavy)
    scene = fj.scenes.whole_sort(
        drive=drive, offset=0.05, duration=0.8, fence_friction=None, border=None
    )
    wanted = sorting.CLEAR_PERIOD_OF_TORQUE
    result = fj.simulate(
        scene, fidelity=fj.Fidelity.coarse(modes=0), only=wanted.fields, measures=wanted.measures
    )
    expected = searched(lambda t: 0.5 * t**2, 0.7, 2.0, 0.1, 0.05)
    # The largest is at the cycle's end, up to which the last sample is a stride of 2 ms away.
    assert expected - 4e-3 < float(wanted(result, scene)) <= expected + 1e-6
