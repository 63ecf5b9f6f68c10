"""The parcel on the belt alone, and the fence beside it, against closed forms.

With mu_s = mu_k = mu the smoothed belt friction decelerates a sliding parcel by
mu g u / S(u), S(u) = sqrt(u^2 + eps^2), so that from u to rest it takes

    d(u) = integral of S / (mu g) = (u S + eps^2 asinh(u / eps)) / (2 mu g),
    t(u) = (S + eps / 2 ln((S - eps) / (S + eps))) / (mu g) + const,

against u^2 / (2 mu g) and u / (mu g) of dry friction. A spin phidot is the same with u = c phidot
and I_p / c^2 in place of m_p.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from runs import one_by_one
from scipy.integrate import solve_ivp

import fencejax as fj

MU, GRAVITY, DURATION = 0.5, 9.81, 0.4
# Smoothed so much that the closed forms show it.
STANDARD = fj.Fidelity.standard(step=2.5e-4, slip_speed=1e-3)
EPS, STEP = STANDARD.slip_speed, STANDARD.step
PARCEL = fj.Parcel(center_x=0.05, center_y=-0.02)
ARM = float(PARCEL.mean_distance)
# I_p / (m_p c^2), which is how much slower the belt stops a spin than a slip.
BULK = float(PARCEL.inertia / PARCEL.mass) / ARM**2
# Newton's method may leave 5e-7 of the weight, an acceleration of 5e-6 m/s^2. It is of one sign
# or the other from step to step: below 1e-6 m / 5 in the 0.2 s to rest.
LEFT = 5e-7 * GRAVITY


def slide(velocity, *, speed=0.0, mass=15.0, mu=MU, gravity=GRAVITY, fidelity=STANDARD,
          history=True):
    parcel = fj.Parcel(mass=mass, center_x=0.05, center_y=-0.02)
    belt = fj.Belt(speed=speed, friction=fj.Friction(mu, mu), gravity=gravity)
    scene = fj.scenes.free_motion(
        position=(0.0, 0.0), velocity=velocity, belt=belt, parcel=parcel, duration=DURATION
    )
    return fj.simulate(scene, fidelity=fidelity, history=history)


@functools.cache
def lanes(fidelity=STANDARD):
    """All the motions of this file, in one batch."""
    motions = {
        "slip": ((1.0, 0.0, 0.0), 0.0, 15.0),
        "slip across": ((0.0, 1.0, 0.0), 0.0, 15.0),
        "slip, belt moving": ((3.0, 0.0, 0.0), 2.0, 15.0),
        "spin": ((0.0, 0.0, 5.0), 0.0, 15.0),
        "spin back": ((2.0, 0.0, -5.0), 2.0, 3.0),
        "both": ((0.6, 0.8, 4.0), 0.0, 15.0),
        "both, mirrored": ((0.6, -0.8, -4.0), 0.0, 15.0),
        "both, turned, light, belt moving": ((1.2, 0.6, 4.0), 2.0, 3.0),
    }
    numbers = [np.array([np.hstack(motion) for motion in motions.values()])[:, k] for k in range(5)]

    @jax.jit
    @one_by_one
    def run(of_lane):
        *motion, speed, mass = of_lane
        return slide(tuple(motion), speed=speed, mass=mass, fidelity=fidelity)

    results = run([jnp.asarray(n) for n in numbers])
    return {
        name: jax.tree.map(lambda leaf, k=k: np.asarray(leaf[k]), results)
        for k, name in enumerate(motions)
    }


def smooth(u, eps):
    return np.sqrt(u**2 + eps**2)


def stopping_distance(u, eps):
    return (u * smooth(u, eps) + eps**2 * np.arcsinh(u / eps)) / (2 * MU * GRAVITY)


def clock(u, eps):
    """mu g t + const as a function of the speed."""
    s = smooth(u, eps)
    return s + eps / 2 * np.log((s - eps) / (s + eps))


@pytest.mark.parametrize("rung", ["coarse", "fast", "standard"])
def test_stopping_distance(rung):
    fidelity = getattr(fj.Fidelity, rung)()
    distance = lanes(fidelity)["slip"].final.x
    # The last step before rest, h, may be off by mu g h^2 / 8.
    late = MU * GRAVITY * fidelity.step**2 / 8
    exact = stopping_distance(1.0, fidelity.slip_speed)
    assert distance == pytest.approx(exact, abs=late + 1e-8)


@pytest.mark.parametrize(
    "fidelity", [STANDARD, fj.Fidelity.fast(slip_speed=2e-3)], ids=["standard", "fast"]
)
def test_bias_of_the_stopping_distance(fidelity):
    eps = fidelity.slip_speed
    distance = lanes(fidelity)["slip"].final.x
    # What the smoothing adds to dry friction, eps^2 (1/2 + ln(2 u / eps)) / (2 mu g), is 0.8
    # and 3 um.
    dry = 1.0 / (2 * MU * GRAVITY)
    bias = eps**2 * (0.5 + np.log(2 / eps)) / (2 * MU * GRAVITY)
    assert distance - dry == pytest.approx(bias, rel=0.02)


def test_stopping_time():
    history = lanes()["slip"].history
    sliding = history.body.x_rate > 10 * EPS
    speed, time = history.body.x_rate[sliding], history.time[sliding]
    exact = (clock(1.0, EPS) - clock(speed, EPS)) / (MU * GRAVITY)
    np.testing.assert_allclose(time, exact, atol=LEFT * DURATION / (MU * GRAVITY))
    # Dry friction's u - mu g t is off by eps^2 / 2 (1 / u - 1 / u0), whose own error is some
    # (eps / u)^2 / 8 of it, 1e-3 at u = 10 eps.
    bias = EPS**2 / 2 * (1 / speed - 1)
    late = LEFT * DURATION + 2e-3 * np.max(bias)
    np.testing.assert_allclose(speed - (1 - MU * GRAVITY * time), bias, atol=late)
    # And it has stopped when dry friction says, but for a few eps / (mu g).
    stopped = history.time[history.body.x_rate < 1e-2 * EPS][0]
    assert 0 < stopped - 1 / (MU * GRAVITY) < 8 * EPS / (MU * GRAVITY)


def test_spin_stops_by_the_moment_of_the_belt():
    # phiddot = -mu m g c / I: the angle is d(c phidot) (I / m c^2) / c.
    for name, sign in (("spin", 1), ("spin back", -1)):
        result = lanes()[name]
        turned = sign * stopping_distance(5 * ARM, EPS) * BULK / ARM
        assert result.final.angle == pytest.approx(turned, abs=1e-6 / ARM)
        early = result.history.time < 0.05
        spin = result.history.body.spin[early]
        falling = MU * GRAVITY / (BULK * ARM) * result.history.time[early]
        bias = EPS**2 / (2 * ARM**2 * np.abs(spin))
        assert np.all(np.abs(spin - sign * (5 - falling)) < bias + LEFT / ARM)
        # It does not go anywhere.
        at_rest = 2.0 * DURATION if name == "spin back" else 0.0
        assert result.final.x == pytest.approx(at_rest, abs=1e-12)
        assert result.final.y == 0


@pytest.mark.parametrize("name", ["both", "both, turned, light, belt moving"])
def test_limit_surface_sample_by_sample(name):
    # F = F_max u / S and T = -F_max c^2 phidot / S with S^2 = |u|^2 + c^2 phidot^2 + eps^2: F
    # points against the slip, (F, T / c) is as long as F_max s / S.
    result = lanes()[name]
    body, belt = result.history.body, result.history.belt
    mass, speed = (3.0, 2.0) if "light" in name else (15.0, 0.0)
    slip = np.stack([speed - body.x_rate, -body.y_rate, -ARM * body.spin])
    force = np.stack([belt.x, belt.y, belt.moment / ARM])
    square = np.sum(slip**2, 0)
    np.testing.assert_allclose(
        force, MU * mass * GRAVITY * slip / np.sqrt(square + EPS**2), atol=1e-10
    )
    np.testing.assert_allclose(belt.dissipated, np.sum(force * slip, 0), atol=1e-10)
    np.testing.assert_allclose(mass * result.history.acceleration.x, belt.x, atol=1e-10)


def test_combined_slip_against_scipy():
    def field(_, y):
        slip = np.array([y[3], y[4], ARM * y[5]])
        share = MU * GRAVITY / np.sqrt(slip @ slip + EPS**2)
        return np.concatenate([y[3:], -share * y[3:] / np.array([1, 1, BULK])])

    begin = (0, 0, 0, 0.6, 0.8, 4.0)
    truth = solve_ivp(field, (0, DURATION), begin, "LSODA", rtol=1e-10, atol=1e-12).y[:, -1]
    final = lanes()["both"].final
    # What Newton leaves, and h^2 / 12 of the change of the acceleration as it comes to rest:
    # mu g h^2 / 12 = 3e-8 m; an arm's length more in the angle.
    np.testing.assert_allclose(final[:3], truth[:3], atol=2e-6)
    np.testing.assert_allclose(final[3:], truth[3:], atol=1e-9)


def test_symmetries():
    # What Newton leaves differs from lane to lane: 1e-6 m, and an arm's length more in the angle.
    final = {name: result.final for name, result in lanes().items()}
    near = functools.partial(np.testing.assert_allclose, atol=2e-6)
    # No direction is another's better; the belt's speed is only added; the mass does not matter.
    near(final["slip across"].y, final["slip"].x)
    near(final["slip, belt moving"].x, final["slip"].x + 2 * DURATION)
    near(final["spin back"].angle, -final["spin"].angle, atol=2e-6 / ARM)
    # Mirrored in y; turned by 90 degrees.
    both, mirrored = final["both"], final["both, mirrored"]
    near(mirrored[:3], np.array(both[:3]) * [1, -1, -1], atol=2e-6 / ARM)
    turned = final["both, turned, light, belt moving"]
    near([turned.x - 2 * DURATION, turned.y], [-both.y, both.x])
    near(turned.angle, both.angle, atol=2e-6 / ARM)


def test_stays_at_rest_once_there():
    # The smoothing lets it creep exponentially with tau = eps / (mu g) = 0.2 ms, long over at
    # 0.35 s; the acceleration that Newton's method leaves keeps tau times as much of a speed, for
    # 0.05 s.
    creep = LEFT * EPS / (MU * GRAVITY)
    for result in lanes().values():
        body, time = result.history.body, result.history.time
        late = time > 0.35
        drift = result.final.x_rate * time
        end = float(result.final.x_rate)
        assert min(abs(end), abs(end - 2)) < creep
        for part in (body.x - drift, body.y):
            assert np.ptp(part[late]) < 0.05 * creep + 1e-12
        assert np.ptp(body.angle[late]) < 0.05 * creep / ARM + 1e-12


def test_rides_with_the_belt_exactly_and_differentiably():
    def end(u):
        velocity = (u["x"], jnp.zeros(()), jnp.zeros(()))
        result = slide(velocity, speed=u["speed"], mu=u["mu"], history=False)
        return result.final, result.energy

    numbers = {"x": jnp.asarray(2.0), "speed": jnp.asarray(2.0), "mu": jnp.asarray(MU)}
    (final, energy), (slopes, _) = jax.jit(lambda u: (end(u), jax.jacfwd(end)(u)))(numbers)
    assert float(final.x_rate) == 2.0
    assert float(final.x) == pytest.approx(2 * DURATION, rel=1e-14)
    assert [float(q) for q in (final.y, final.angle, final.y_rate, final.spin)] == [0] * 4
    assert all(float(leaf) == 0 for leaf in jax.tree.leaves(energy))
    # At rest the smoothed friction is viscous, u' = -u / tau with tau = eps / (mu g). The scheme
    # sums that to tau (1 - z^2 / 12), z = h / tau, for each m/s of slip.
    tau = EPS / (MU * GRAVITY)
    creep = tau * (1 - (STEP / tau) ** 2 / 12)
    assert float(slopes.x["x"]) == pytest.approx(creep, rel=1e-6)
    assert float(slopes.x["speed"]) == pytest.approx(DURATION - creep, rel=1e-9)
    assert float(slopes.x["mu"]) == 0
    assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(slopes))


def test_gradient_of_the_stopping_distance():
    # d(u) above: dd/du = S / (mu g), dd/dmu = -d / mu, dd/dg = -d / g, all else none.
    def end(u):
        velocity = (u["x"], jnp.zeros(()), jnp.zeros(()))
        return slide(velocity, mass=u["mass"], mu=u["mu"], gravity=u["g"], history=False).final.x

    numbers = {"x": 1.0, "mass": 15.0, "mu": MU, "g": GRAVITY}
    slopes = jax.jit(jax.grad(end))({k: jnp.asarray(v) for k, v in numbers.items()})
    distance = stopping_distance(1.0, EPS)
    # The trapezoid on the way to rest: z^2 / 12 of the creep, 5e-3 eps / (mu g) = 5e-6 s.
    assert float(slopes["x"]) == pytest.approx(smooth(1.0, EPS) / (MU * GRAVITY), abs=2e-5)
    assert float(slopes["mu"]) == pytest.approx(-distance / MU, rel=1e-4)
    assert float(slopes["g"]) == pytest.approx(-distance / GRAVITY, rel=1e-4)
    assert abs(float(slopes["mass"])) < 1e-7


def test_without_a_belt_it_goes_straight():
    scene = fj.scenes.free_motion(
        position=(0.1, 0.2), angle=0.3, velocity=(1.0, 0.7, -3.0), belt=None, parcel=PARCEL,
        duration=DURATION,
    )
    result = fj.simulate(scene)
    time = np.asarray(result.history.time)
    body = result.history.body
    # Round-off of 1600 additions.
    for start, rate, values in ((0.1, 1.0, body.x), (0.2, 0.7, body.y), (0.3, -3.0, body.angle)):
        np.testing.assert_allclose(values, start + rate * time, atol=1e-12)
    assert float(result.energy.residual) == 0
    # The motion back is the motion forth, backwards.
    back = fj.scenes.free_motion(
        position=(body.x[-1], body.y[-1]), angle=body.angle[-1], velocity=(-1.0, -0.7, 3.0),
        belt=None, parcel=PARCEL, duration=DURATION,
    )
    end = fj.simulate(back, history=False).final
    np.testing.assert_allclose(end[:3], [0.1, 0.2, 0.3], atol=1e-12)


def test_no_friction_is_no_belt():
    bare = slide((1.0, 0.7, -3.0), mu=0.0, history=False).final
    weightless = slide((1.0, 0.7, -3.0), gravity=0.0, history=False).final
    line = (DURATION, 0.7 * DURATION, -3.0 * DURATION)
    np.testing.assert_allclose(bare[:3], line, atol=1e-12)
    np.testing.assert_allclose(weightless[:3], line, atol=1e-12)
