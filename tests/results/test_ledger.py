"""The energy ledger and the balance of momentum, in every scene.

Momentum: v1 - v0 = h / 2 (a0 + a1 + s1 f1 - s0 f0 + lag (b1 - b0)) in every step, with f the
acceleration by the friction of the corners and s whether it holds them, 0 or 1, and b that by the
belt, whose lag is 0 where h mu g < 2 s, s being the slip, and never above 0.2. So m dv is the
trapezoidal sum of the forces exactly where no corner sticks and the parcel slips so fast, and else
within half of what these frictions change over the step. Newton's method leaves `defect`, at most a
step of which goes missing.

Energy: the powers are summed by the trapezoidal rule. What that differs by from the change of the
parcel's kinetic energy is h^2 / 8 (m |a|^2 + I phiddot^2) between the two ends, of the second
order; the rest is of the second order as well.
"""

import dataclasses
import functools

import jax
import numpy as np
import pytest
from runs import FIXED, SCENES, fixed

import fencejax as fj
from fencejax.results import diagnostics

LOSSES = (
    "contact_loss", "fence_friction_loss", "border_friction_loss", "belt_friction_loss",
    "damping_loss",
)


def turned_over(energy):
    """Everything that changed hands [J]."""
    return sum(abs(float(term)) for term in jax.tree.leaves(energy))


def spacing(history):
    return np.diff(history.time)


def arms_of(scene):
    """The four corners from C_s in the parcel's axes."""
    for number in (1, 2, 3, 4):
        yield number, tuple(float(q) for q in scene.parcel.corner(number))


def arms(scene, angle):
    """The four corners from C_s in fixed axes."""
    cosine, sine = np.cos(angle), np.sin(angle)
    for number, (x, y) in arms_of(scene):
        yield number, (cosine * x - sine * y, sine * x + cosine * y)


@functools.cache
def smooth(name, step):
    """The ledger where friction is smooth over many steps."""
    fidelity = fj.Fidelity.standard(
        step=step, step_tolerance=None, slip_speed=0.05, static_speed=0.25
    )
    result = fj.simulate(SCENES[name](), fidelity=fidelity, only=("energy",))
    # Friction is smoothed on purpose here.
    status = int(result.status)
    assert status <= fj.Status.LEFT_OVER_TIP or status == fj.Status.FRICTION_SMOOTHED
    return result


@pytest.mark.parametrize("name", ["oblique_impact", "along_fence", "border_and_fence"])
def test_closes_at_second_order(name):
    coarse, fine = (smooth(name, step).energy for step in (5e-5, 2.5e-5))
    order = np.log2(abs(float(coarse.residual) / float(fine.residual)))
    # 2 in the limit, or less is left than the equations' solution leaves: 5e-7 of the forces, of
    # either sign from step to step, of which a tenth adds up.
    unsolved = 5e-8 * turned_over(fine)
    assert order > 1.7 or abs(float(fine.residual)) < unsolved
    assert abs(float(fine.residual)) < 2e-5 * turned_over(fine)


@pytest.mark.parametrize("name", SCENES)
def test_closes_at_standard_fidelity(name):
    energy = fixed(name).energy
    assert abs(energy.residual) < 1e-3 * turned_over(energy)


@pytest.mark.parametrize("name", ["free_motion", "rigid_wall"])
def test_residual_in_closed_form(name):
    # Nothing but the parcel: the residual is -h^2 / 8 (m |a|^2 + I phiddot^2), end less start.
    # Newton leaves up to `defect` along the path, in each of the three motions.
    scene, result = SCENES[name](), fixed(name)
    history = result.history
    step = spacing(history)
    mass, inertia = float(scene.parcel.mass), float(scene.parcel.inertia)
    x, y, turn = history.acceleration
    size = mass * (x**2 + y**2) + inertia * turn**2
    wanted = -(step[0] ** 2) / 8 * (size[-1] - size[0])
    speeds = np.abs(history.body.x_rate) + np.abs(history.body.y_rate)
    speeds = speeds + np.sqrt(inertia / mass) * np.abs(history.body.spin)
    left = result.defect * step[0] * np.sum(speeds)
    assert abs(float(result.energy.residual) - wanted) < left + 1e-12


def imbalance(scene, result):
    """What is missing of momentum in each step [N s], of x, y and the angle, the latter over the
    parcel's radius of gyration, (3, steps), less what Newton's method leaves; and m, m, I / r."""
    history = result.history
    step = spacing(history)
    bodies = (history.body.x_rate, history.body.y_rate, history.body.spin)
    mass, inertia = float(scene.parcel.mass), float(scene.parcel.inertia)
    size = np.sqrt(inertia / mass)
    weights = np.array([mass, mass, inertia / size])
    missing = [
        weight * np.abs(np.diff(rate) - step * (acceleration[1:] + acceleration[:-1]) / 2)
        for weight, rate, acceleration in zip(weights, bodies, history.acceleration, strict=True)
    ]
    return np.array(missing) - step * result.defect * 1.001, weights


@pytest.mark.parametrize(
    "name",
    ["rigid_wall", "normal_impact", "free_motion", "free_motion_with_fence", "no friction"],
)
def test_momentum_is_exact(name):
    if name == "no friction":
        scene = fj.scenes.oblique_impact(fence_friction=None, belt=None, velocity=(2.0, 0.0, 0.0))
        only = "peak_force", "defect", "history"
        result = jax.tree.map(np.asarray, fj.simulate(scene, fidelity=FIXED, only=only))
        assert result.peak_force > 100
    else:
        scene, result = SCENES[name](), fixed(name)
    missing, weights = imbalance(scene, result)
    # Round-off of the rate on top.
    assert np.max(missing / weights[:, None]) < 1e-13


@pytest.mark.parametrize(
    "name", ["oblique_impact", "along_fence", "border_and_fence", "whole_sort"]
)
def test_momentum_with_friction(name):
    scene, result = SCENES[name](), fixed(name)
    history = result.history
    missing, weights = imbalance(scene, result)
    size = np.sqrt(float(scene.parcel.inertia) / float(scene.parcel.mass))
    corners = np.array([np.hypot(*arm) for _, arm in arms_of(scene)])
    lever = max(1.0, np.max(corners) / size)
    exchanged, step = 0.0, spacing(history)
    if scene.belt is not None:
        moment = np.diff(history.belt.moment) / size
        exchanged = 0.2 * np.sqrt(
            np.diff(history.belt.x) ** 2 + np.diff(history.belt.y) ** 2 + moment**2
        )
    for c in (*history.fence, *history.border):
        # The fence turns meanwhile, and so does what friction acts along, by 0.02 at most.
        # What holds counts by its share at the step's end, of the mean normal force.
        share = np.abs(c.friction[1:]) / np.where(c.normal[1:] > 0, c.normal[1:], 1.0)
        by_normal = share * np.abs(np.diff(c.normal))
        turned = 0.02 * np.abs(c.friction[1:])
        exchanged = exchanged + lever * (np.abs(np.diff(c.friction)) + by_normal + turned)
    allowed = 0.5 * step * exchanged
    assert np.all(missing <= allowed + 1e-13 * weights[:, None])
    # Where every corner slides far above the smoothing, or is apart, and the parcel slips faster
    # than the belt stops it within a step, nothing is missing.
    sliding = np.full(history.time.shape, True)
    if scene.belt is not None:
        turning = float(scene.parcel.mean_distance) * history.body.spin
        slip = np.hypot(history.body.x_rate - float(scene.belt.speed), history.body.y_rate)
        largest = float(scene.belt.friction.static) * float(scene.belt.gravity)
        sliding &= np.hypot(slip, turning) > np.max(step) * largest
    for c in (*history.fence, *history.border):
        sliding &= (np.abs(c.sliding) > 0.2) | (c.normal == 0)
    slides = sliding[:-1] & sliding[1:]
    assert np.sum(slides) > 10
    assert np.max(missing[:, slides] / weights[:, None]) < 1e-13


@pytest.mark.parametrize("name", ["oblique_impact", "border_and_fence", "along_fence"])
def test_forces_in_the_history_make_the_acceleration(name):
    # m a less belt and border is what the fence gives. With one corner it is as long as (N, F)
    # and its moment about C_s is that of a force at the corner; both corners of a wall that lies
    # on the fence give what is along the wall and across.
    scene, history = SCENES[name](), fixed(name).history
    mass, inertia = float(scene.parcel.mass), float(scene.parcel.inertia)
    corner = dict(arms(scene, history.body.angle))
    force_x = mass * history.acceleration.x - history.belt.x
    force_y = mass * history.acceleration.y - history.belt.y
    moment = inertia * history.acceleration.angle - history.belt.moment
    for number, c in zip(scene.border_corners, history.border, strict=True):
        force_x, force_y = force_x - c.friction, force_y - c.normal
        moment = moment - corner[number][0] * c.normal + corner[number][1] * c.friction
    scale = 1 + np.max(np.hypot(force_x, force_y))
    if len(history.fence) == 1:
        (c,), (number,) = history.fence, scene.fence_corners
        np.testing.assert_allclose(
            np.hypot(force_x, force_y), np.hypot(c.normal, c.friction), atol=1e-9 * scale
        )
        arm_x, arm_y = corner[number]
        # The integrator turns the arms by a second-order formula, the error being cubic in a
        # turn of some 1e-6 rad.
        np.testing.assert_allclose(
            moment, arm_x * force_y - arm_y * force_x, atol=1e-9 * scale
        )
    else:
        length = sum(np.hypot(c.normal, c.friction) for c in history.fence)
        assert np.all(np.hypot(force_x, force_y) <= length + 1e-9 * scale)
        assert np.max(length) > 1.0


@pytest.mark.parametrize("name", SCENES)
def test_losses_are_losses(name):
    result = fixed(name)
    for term in LOSSES:
        assert getattr(result.energy, term) >= -1e-9 * turned_over(result.energy), term
    # Friction and damping dissipate at every instant, not only on the whole.
    power = result.history.power
    for rate in (power.fence_friction, power.border_friction, power.belt_friction):
        assert np.all(rate >= 0)
    assert np.all(power.beam_damping >= 0)


ABSENT = {
    "oblique_impact": {"border_friction_loss"},
    "along_fence": {"border_friction_loss"},
    "border_and_fence": set(),
    "free_motion": {
        "drive_work", "fence_kinetic", "strain", "damping_loss", "geometry_work", "contact_loss",
        "contact_stored", "fence_friction_loss", "border_friction_loss",
    },
    "free_motion_with_fence": {
        "geometry_work", "contact_loss", "contact_stored", "fence_friction_loss",
        "border_friction_loss",
    },
    "whole_sort": set(),
    "normal_impact": {
        "drive_work", "geometry_work", "belt_work", "fence_friction_loss", "border_friction_loss",
        "belt_friction_loss",
    },
    "rigid_wall": {
        "drive_work", "fence_kinetic", "strain", "damping_loss", "geometry_work", "belt_work",
        "fence_friction_loss", "border_friction_loss", "belt_friction_loss",
    },
}


@pytest.mark.parametrize("name", SCENES)
def test_absent_parts_do_no_work(name):
    # Left at 0 exactly, and what is there is not 0 (the contact is over at most ends).
    terms = {k: float(v) for k, v in vars(fixed(name).energy).items()}
    for term, value in terms.items():
        if term in ABSENT[name]:
            assert value == 0, term
        elif term != "contact_stored" and (name, term) != ("whole_sort", "parcel_kinetic"):
            # A sorted parcel rides as fast as before.
            assert value != 0, term


def test_totals_are_sums_of_the_history():
    result = fixed("border_and_fence")
    history = result.history
    step = spacing(history)

    def integral(values):
        return np.sum(step / 2 * (values[1:] + values[:-1]))

    # Of the steps in which a blow ends the impulse counts the part until then; of all others as the
    # motion does.
    force = np.asarray(history.fence_force)
    ends = (force[:-1] > 0) & (force[1:] == 0)
    of_ends = np.sum((step / 2 * force[:-1])[ends])
    share = 1 - (integral(force) - float(result.impulse)) / of_ends
    assert np.sum(ends) == 1
    assert 0 < share < 1
    # It is where the force was last seen.
    last = np.asarray(history.time)[:-1][ends] + share * step
    np.testing.assert_allclose(result.last_contact, last, rtol=1e-12)
    assert result.energy.belt_work == pytest.approx(integral(history.belt.x) * 2.0, rel=1e-12)
    assert result.energy.drive_work == pytest.approx(
        integral(history.torque * history.drive.speed), rel=1e-12
    )
    (c,) = history.border
    assert result.energy.border_friction_loss == pytest.approx(
        integral(-c.friction * c.sliding), rel=1e-12
    )


@pytest.mark.parametrize("sign", [1, -1])
def test_a_ledger_that_does_not_close_is_said(sign):
    """Energy that comes from nowhere or goes nowhere, a little less and more than 5 % of what was
    turned over with the parcel's at the end."""
    name = "oblique_impact"
    scene, result = SCENES[name](), fixed(name)
    parcel, final = scene.parcel, result.final
    exchanged = 0.5 * parcel.mass * (final.x_rate**2 + final.y_rate**2)
    exchanged = float(exchanged + 0.5 * parcel.inertia * final.spin**2)

    def status(share):
        # share = more / (turned + more), but for the residual that is there.
        more = share / (1 - share) * (turned_over(result.energy) + exchanged)
        loss = result.energy.contact_loss
        drive = result.energy.drive_work
        changed = dict(contact_loss=loss + more) if sign > 0 else dict(drive_work=drive + more)
        energy = dataclasses.replace(result.energy, **changed)
        status = np.asarray(result.status, float)
        other = dataclasses.replace(result, energy=energy, status=status)
        return int(diagnostics.of_result(scene, other).status)

    assert status(0.045) == result.status
    assert status(0.055) == fj.Status.ENERGY_UNBALANCED
