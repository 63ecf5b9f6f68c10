"""The drive laws: closed forms, consistent derivatives, and the time at an angle."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BSpline

from fencejax import (
    AbstractDrive,
    AbstractTorqueDrive,
    ConstantSpeedDrive,
    Fence,
    HarmonicDrive,
    HeldDrive,
    SCurveDrive,
    SplineDrive,
    TrapezoidDrive,
)

EPS = np.finfo(float).eps
CONTROL = np.array([0.05, 0.31, 0.52, 0.48, 0.2])

# name: (law, end angle, top speed), the last two as the law promises them (None: it does not).
LAWS = {
    "harmonic": (HarmonicDrive(), 1.53 * 1.36 / np.pi, 1.53),
    "held": (HeldDrive(0.3), 0.3, 0.0),
    "constant speed": (ConstantSpeedDrive(1.2, 0.5), 0.5, 1.2),
    "trapezoid": (TrapezoidDrive(0.7, 1.4, 5.0, 0.1), 0.7, 1.4),
    "s-curve": (SCurveDrive(0.7, 1.4, 8.0, 90.0, 0.15), 0.7, 1.4),
    "spline": (SplineDrive(CONTROL, 1.2), None, None),
}
SMOOTH = ("harmonic", "trapezoid", "s-curve", "spline")

sample = jax.jit(lambda drive, times: drive.motion(times))
reach = jax.jit(lambda drive, angles: jax.vmap(drive.time_at)(angles))
angle_at = jax.jit(lambda drive, times: drive.angle(times))


def knots(drive, name):
    """Times at which the angle is not smooth."""
    cycle, turning = float(drive.cycle), float(drive.turning_time)
    if name in ("held", "harmonic"):
        return np.array([0.0, cycle])
    if name == "constant speed":
        return np.array([cycle])
    if name == "spline":
        return np.linspace(0, cycle, len(CONTROL) + 4)
    ramp = drive.top_speed / drive.acceleration
    marks = [0.0, ramp, turning - ramp, turning]
    if name == "s-curve":
        t = drive.acceleration / drive.jerk
        marks = [0.0, t, ramp, ramp + t]
        marks += [turning - m for m in marks]
    marks = np.array(marks, dtype=float)
    return np.concatenate([marks, turning + float(drive.dwell) + marks])


@pytest.mark.parametrize("name", LAWS)
def test_speed_and_acceleration_are_the_derivatives(name):
    # Central differences over 2 d are exact to d^2 / 6 times the third derivative, below
    # (jerk 100) x 1e-8 / 6 in the speed; round-off eps / d in it and 4 eps / d^2 in the next.
    drive, _, _ = LAWS[name]
    d = 1e-4
    times = np.linspace(0.0, 1.05 * float(drive.cycle), 211) + 1e-3 / 7
    clear = np.min(np.abs(times[:, None] - knots(drive, name)), axis=1) > 1.5 * d
    times = times[clear]
    assert len(times) > 150
    motion = sample(drive, times)
    high, low = (np.array(angle_at(drive, times + s * d)) for s in (1, -1))
    middle = np.array(motion.angle)
    np.testing.assert_allclose(motion.speed, (high - low) / (2 * d), rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        motion.acceleration, (high - 2 * middle + low) / d**2, rtol=0, atol=1e-5
    )


@pytest.mark.parametrize("name", LAWS)
def test_start_end_and_top_speed(name):
    drive, end, top = LAWS[name]
    motion = sample(drive, np.linspace(0.0, float(drive.cycle), 2001))
    if name != "held":
        assert float(motion.angle[0]) == 0.0
    if name in SMOOTH:
        assert float(motion.speed[0]) == 0.0
    if end is not None:
        # Round-off of a sum of cubes of about 1 times 100.
        at_turn = float(angle_at(drive, drive.turning_time))
        np.testing.assert_allclose(at_turn, end, rtol=100 * EPS)
        np.testing.assert_allclose(np.max(np.abs(motion.angle)), end, rtol=1e-5)
        # The samples are cycle / 2000 apart: the top of a parabola may be missed by
        # 1/2 jerk (cycle / 4000)^2 < 1e-5, and never exceeded but by the round-off of a sum of
        # terms up to jerk cycle^2 / 2 = 200.
        assert np.max(np.abs(motion.speed)) <= top + 1e3 * EPS
        assert np.max(np.abs(motion.speed)) >= top - 1e-5


@pytest.mark.parametrize("name", LAWS)
def test_the_way_out_does_not_turn_back(name):
    drive, _, _ = LAWS[name]
    if name == "spline":  # `turn` is what the user says: take the largest angle here
        times = np.linspace(0, 1.2, 1201)
        turn = times[np.argmax(angle_at(drive, times))] / 1.2
        drive = SplineDrive(CONTROL, 1.2, turn)
    out = np.array(angle_at(drive, np.linspace(0.0, float(drive.turning_time), 501)))
    assert np.all(np.diff(out) >= -100 * EPS)


@pytest.mark.parametrize("name", SMOOTH)
def test_home_at_the_end_of_the_cycle(name):
    # Angle and speed are zero at `cycle` and stay so: round-off of sums of terms up to
    # jerk (cycle)^3 / 6 < 300.
    drive, _, _ = LAWS[name]
    after = sample(drive, float(drive.cycle) * np.array([1.0, 1.0 + 1e-9, 1.1, 1.5]))
    np.testing.assert_allclose(after.angle, 0.0, atol=2e3 * EPS)
    np.testing.assert_allclose(after.speed, 0.0, atol=2e4 * EPS)


@pytest.mark.parametrize("name", SMOOTH)
def test_acceleration_at_the_start_is_that_of_the_motion_that_begins(name):
    # The free swing of the fence starts from the acceleration at t = 0: it is the limit from the
    # right, within the change over 1e-9 s (jerk below 200).
    drive, _, _ = LAWS[name]
    start, just_after = np.array(sample(drive, np.array([0.0, 1e-9])).acceleration)
    np.testing.assert_allclose(start, just_after, rtol=0, atol=200e-9)


# --- Each law -----------------------------------------------------------------------------------


def test_harmonic_defaults_are_the_papers():
    # alpha_max = alphadot_max t_c / pi = 0.6623 rad; tip at y = 1.2 sin(0.6623) = 0.738 m: half a
    # unit of the last digit that is quoted.
    drive = HarmonicDrive()
    largest = float(drive.angle(drive.turning_time))
    assert abs(largest - 0.6623) < 5e-5
    assert abs(float(Fence().reach) * np.sin(largest) - 0.738) < 5e-4
    # Top speed at a quarter of the cycle; acceleration 2 pi^2 alpha_max / t_c^2 near the start.
    quarter = drive.motion(1.36 / 4)
    np.testing.assert_allclose(quarter.speed, 1.53, rtol=4 * EPS)
    np.testing.assert_allclose(quarter.acceleration, 0.0, atol=1e-14)
    np.testing.assert_allclose(
        drive.motion(1e-6).acceleration, 2 * np.pi**2 * largest / 1.36**2, rtol=1e-10
    )


def test_held_drive_stands_still():
    drive = HeldDrive(-0.2, 0.9)
    motion = drive.motion(0.4)
    assert [float(x) for x in motion[:3]] == [-0.2, 0.0, 0.0]
    assert float(drive.cycle) == 0.9
    assert float(drive.time_at(0.3)) == 0.0


def test_trapezoid_segments():
    # v = 1.4, a = 5, stroke 0.7: ramp 0.28 s, cruise until 0.5 s, stroke 0.78 s, dwell 0.1 s.
    drive, _, _ = LAWS["trapezoid"]
    times = np.array([0.1, 0.4, 0.6, 0.83, 0.98, 1.2, 1.5])
    motion = sample(drive, times)
    np.testing.assert_allclose(motion.acceleration, [5, 0, -5, 0, -5, 0, 5], atol=1e-12)
    np.testing.assert_allclose(
        motion.speed, [0.5, 1.4, 0.9, 0.0, -0.5, -1.4, -0.8], atol=1e-12
    )
    # theta = a t^2 / 2 on the ramp, v (t - ramp / 2) in cruise.
    np.testing.assert_allclose(motion.angle[:2], [0.025, 1.4 * (0.4 - 0.14)], rtol=1e-13)
    np.testing.assert_allclose(motion.angle[3], 0.7, rtol=1e-13)
    np.testing.assert_allclose(float(drive.cycle), 2 * 0.78 + 0.1, rtol=4 * EPS)


def test_s_curve_limits():
    # |acceleration| <= 8 and |jerk| <= 90, both attained; round-off of differences over 1 ms.
    drive, _, _ = LAWS["s-curve"]
    times = np.arange(0.0, float(drive.cycle), 1e-3) + 1e-5
    acceleration = np.array(sample(drive, times).acceleration)
    jerk = np.diff(acceleration) / 1e-3
    for found, limit in ((acceleration, 8.0), (jerk, 90.0)):
        np.testing.assert_allclose(np.max(found), limit, rtol=1e-9)
        np.testing.assert_allclose(np.min(found), -limit, rtol=1e-9)
    # Stroke = stroke / v + v / a + a / j.
    stroke = 0.7 / 1.4 + 1.4 / 8 + 8 / 90
    np.testing.assert_allclose(float(drive.turning_time), stroke, rtol=4 * EPS)
    np.testing.assert_allclose(float(drive.cycle), 2 * stroke + 0.15, rtol=4 * EPS)


def test_spline_is_the_cubic_b_spline():
    # alpha = sum c_k B_k(t) on uniform knots, whose gradient in c_k is B_k: against SciPy's basis,
    # to round-off, at 0, at the knots, between them and beyond the end.
    drive, _, _ = LAWS["spline"]
    spans = len(CONTROL) + 3
    grid = 1.2 * np.arange(-3, spans + 4) / spans
    times = np.concatenate([np.linspace(0, 1.2, 4 * spans + 1), [1.3]])
    basis = np.zeros((len(times), len(CONTROL)))
    for k in range(len(CONTROL)):
        element = BSpline.basis_element(grid[k + 3 : k + 8], extrapolate=False)
        basis[:, k] = np.nan_to_num(element(times))
    np.testing.assert_allclose(angle_at(drive, times), basis @ CONTROL, atol=20 * EPS)
    gradient = jax.jit(jax.jacrev(lambda c: SplineDrive(c, 1.2).angle(times)))(CONTROL)
    np.testing.assert_allclose(gradient, basis, atol=20 * EPS)


def test_spline_is_twice_continuously_differentiable():
    # Across a knot the acceleration changes by the jerk, below (2 spans / cycle)^3, times 2e-9 s.
    drive, _, _ = LAWS["spline"]
    spans = len(CONTROL) + 3
    inner = 1.2 * np.arange(spans + 1) / spans
    before, after = (sample(drive, inner + shift) for shift in (-1e-9, 1e-9))
    jerk = (2 * spans / 1.2) ** 3
    np.testing.assert_allclose(before.acceleration, after.acceleration, rtol=0, atol=jerk * 2e-9)
    assert np.max(np.abs(after.acceleration)) > 1.0


def test_derivatives_in_the_numbers_of_the_s_curve():
    # Against central differences, error d^2 / 6 times third derivatives (1e3 at most, d = 1e-5).
    numbers = np.array([0.7, 1.4, 8.0, 90.0, 0.15])
    times = jnp.array([0.05, 0.2, 0.45, 0.7, 1.1, 1.5])

    @jax.jit
    def angles(values):
        return SCurveDrive(*values).angle(times)

    ours = np.array(jax.jit(jax.jacrev(angles))(numbers))
    for k in range(5):
        d = 1e-5 * np.eye(5)[k]
        difference = (angles(numbers + d) - angles(numbers - d)) / 2e-5
        np.testing.assert_allclose(ours[:, k], difference, rtol=0, atol=1e-7)


# --- Time at an angle ---------------------------------------------------------------------------


def test_time_at_of_the_harmonic_law():
    # t = t_c / (2 pi) arccos(1 - 2 theta / alpha_max), d t / d theta = 1 / alphadot,
    # d t / d alphadot_max = -theta / (alphadot_max alphadot) at fixed t_c.
    speed, cycle = 1.5, 1.3
    largest = speed * cycle / np.pi
    theta = np.array([0.02, 0.1, 0.3, 0.5, 0.6])
    exact = cycle / (2 * np.pi) * np.arccos(1 - 2 * theta / largest)
    rate = np.pi * largest / cycle * np.sin(2 * np.pi * exact / cycle)

    def time(angle, speed, cycle):
        return HarmonicDrive(speed, cycle).time_at(angle)

    ours = jax.jit(jax.vmap(time, (0, None, None)))(theta, speed, cycle)
    # Round-off of the angle over the speed, 0.5 at the least of these.
    np.testing.assert_allclose(ours, exact, rtol=0, atol=10 * EPS)
    slopes = jax.jit(jax.vmap(jax.grad(time, (0, 1, 2)), (0, None, None)))(theta, speed, cycle)
    np.testing.assert_allclose(slopes[0], 1 / rate, rtol=1e-12)
    np.testing.assert_allclose(slopes[1], -theta / (speed * rate), rtol=1e-12)
    # theta = speed cycle / (2 pi) (1 - cos(2 pi t / cycle)) at fixed theta.
    by_cycle = theta / cycle - exact / cycle * rate
    np.testing.assert_allclose(slopes[2], -by_cycle / rate, rtol=1e-11)


@pytest.mark.parametrize("name", ["constant speed", "trapezoid", "s-curve", "harmonic"])
def test_time_at_inverts_the_angle(name):
    # Round-off of the angle over the speed, at least 0.1 rad/s at these times.
    drive, _, _ = LAWS[name]
    times = np.linspace(0.1, 0.9, 7) * float(drive.turning_time)
    found = reach(drive, angle_at(drive, times))
    np.testing.assert_allclose(found, times, rtol=0, atol=1e3 * EPS)


def test_time_at_ends_at_the_turn_where_the_angle_is_out_of_reach():
    # The angle is level there, so that its round-off leaves sqrt(eps) of the time.
    drive = HarmonicDrive()
    largest = float(drive.angle(0.68))
    times = reach(drive, np.array([0.9, largest + 5e-10, largest, 0.0, -0.1]))
    np.testing.assert_allclose(times, [0.68, 0.68, 0.68, 0.0, 0.0], rtol=0, atol=1e-7)


# --- Refused ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: HarmonicDrive(top_speed=-1), "top_speed"),
        (lambda: HarmonicDrive(cycle_time=0), "cycle_time"),
        (lambda: HeldDrive(held_angle=1.6), "held_angle"),
        (lambda: HeldDrive(hold_time=-1), "hold_time"),
        (lambda: ConstantSpeedDrive(speed=0), "speed"),
        (lambda: ConstantSpeedDrive(end_angle=3.2), "end_angle"),
        (lambda: TrapezoidDrive(acceleration=0), "acceleration"),
        (lambda: TrapezoidDrive(dwell=-0.1), "dwell"),
        (lambda: TrapezoidDrive(end_angle=0.3, top_speed=1.5, acceleration=6), "end_angle"),
        (lambda: SCurveDrive(jerk=0), "jerk"),
        (lambda: SCurveDrive(acceleration=20, jerk=80), "acceleration"),
        (lambda: SCurveDrive(end_angle=0.2), "end_angle"),
        (lambda: SplineDrive(CONTROL, cycle_time=0), "cycle_time"),
        (lambda: SplineDrive(CONTROL, turn=1.1), "turn"),
        (lambda: SplineDrive(np.array([0.1, np.nan])), "control_angles"),
    ],
)
def test_bad_numbers_are_refused_by_name(make, field):
    with pytest.raises(ValueError, match=f"`[^`]*{field}"):
        make()


def test_every_law_is_tested():
    tested = {type(law) for law, _, _ in LAWS.values()}
    here = AbstractDrive.__subclasses__()
    here += [c for law in here for c in law.__subclasses__()]
    ours = [c for c in here if c.__module__.startswith("fencejax")]
    # Those of a torque have no angle of their own: `test_torque_drive.py`.
    ours = [c for c in ours if not issubclass(c, AbstractTorqueDrive)]
    assert {c for c in ours if not inspect.isabstract(c)} == tested
