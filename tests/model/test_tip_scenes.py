"""The fence's tip against the parcel's side, over time: an independent version, the general
integrators, the ledger, continuity across the tip, and whole sorts."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from runs import one_by_one
from scipy.integrate import solve_ivp

import fencejax as fj
from fencejax.scenes import Pose

REACH, FADE = 1.2, 5e-3


# --- A version of its own: rigid fence, no friction, a potential differenced numerically ---------


def strike(distance=1.18, edge_radius=None, duration=0.08, **changes):
    fence = fj.Fence(0.45, 0.75, edge_radius=edge_radius)
    return fj.scenes.oblique_impact(
        fence=fence, distance=distance, fence_friction=None, belt=None,
        velocity=(2.0, 0.0, 0.0), duration=duration, tip_contact=True, **changes,
    )  # fmt: skip


def independent(scene, times, fade=FADE, radius=0.0):
    """Position and angle (times, 3) of the parcel by LSODA. The gap is written down from the two
    depths, its force is -N grad g by central differences, and its rate as well."""
    parcel, drive = scene.parcel, scene.drive
    mass, inertia = float(parcel.mass), float(parcel.inertia)
    stiffness, viscosity = float(parcel.stiffness), float(parcel.damping * parcel.mass**0.4)
    own, next_corner = (np.array(parcel.corner(k), dtype=float) for k in (1, 2))
    reach = float(scene.fence.reach)
    begin = float(drive.time_at(scene.start.drive_angle))
    top, cycle = float(drive.top_speed), float(drive.cycle_time)

    def gap(q, tilt):
        cosine, sine = np.cos(q[2]), np.sin(q[2])
        turn = np.array([[cosine, -sine], [sine, cosine]])
        corner = q[:2] + turn @ own
        along, up = np.array([np.cos(tilt), np.sin(tilt)]), np.array([-np.sin(tilt), np.cos(tilt)])
        depth, before = -corner @ up, reach - corner @ along
        edge = turn @ (next_corner - own)
        inward = np.array([edge[1], -edge[0]]) / np.linalg.norm(edge)
        theta = np.arctan2(inward @ along, inward @ up)
        round_ = radius if theta > 0 else 0.0
        x = before - (depth - round_) * np.tan(theta / 2)
        if x >= fade:
            return depth
        if x <= -fade:
            return (reach * along - round_ * up - corner) @ inward + round_
        # psi is minus the integral of the cubic fade from x to l.
        s = np.linspace((x / fade + 1) / 2, 1, 2001)
        weight = 1 - s**2 * (3 - 2 * s)
        area = np.sum(0.5 * (weight[1:] + weight[:-1])) * (s[1] - s[0])
        return depth - np.sin(theta) * 2 * fade * area

    def tilt(t):
        return 0.5 * top * cycle / np.pi * (1 - np.cos(2 * np.pi * t / cycle))

    def slope(t, y):
        q, v, small = y[:3], y[3:], 1e-6
        here = gap(q, tilt(t))
        force = np.zeros(3)
        if here > 0:
            ahead = gap(q + small * v, tilt(t + small)) - gap(q - small * v, tilt(t - small))
            normal = max(0.0, here**2 * (viscosity * ahead / (2 * small) + stiffness * here**2))
            for k, step in enumerate(small * np.eye(3)):
                force[k] = -normal * (gap(q + step, tilt(t)) - gap(q - step, tilt(t))) / (2 * small)
        return np.concatenate([v, force / (mass, mass, inertia)])

    body = scene.start.body(
        parcel, None, _pose(reach, float(scene.start.place), float(scene.start.drive_angle), scene)
    )
    solution = solve_ivp(
        slope, (begin, begin + times[-1]), np.array(body, dtype=float), method="LSODA",
        t_eval=begin + times, rtol=1e-8, atol=1e-10, max_step=1e-3,
    )
    assert solution.success
    return solution.y[:3].T


def _pose(reach, place, tilt, scene):
    drive = scene.drive.motion(scene.drive.time_at(scene.start.drive_angle))
    zero = jnp.zeros(())
    return Pose(place * jnp.cos(tilt), place * jnp.sin(tilt), zero, place * drive.speed, drive)


def test_against_a_version_of_its_own():
    """A sharp tip, and one with an edge of a radius; how the place at the end goes with it."""
    scene = strike(duration=0.03)

    @jax.jit
    def run(radius):
        def place(radius):
            result = fj.simulate(
                strike(duration=0.03, edge_radius=radius),
                fidelity=fj.Fidelity(modes=0, step=1e-4, step_tolerance=None),
                only=["final", "history"],
            )  # fmt: skip
            return jnp.stack(result.final[:3]), result

        return jax.jacfwd(place, has_aux=True)(radius)

    for radius in (0.0, 0.012):
        slope, result = run(radius)
        assert int(result.status) == fj.Status.SUCCESSFUL
        history = result.history
        pressed = np.asarray(history.fence[0].normal) > 0
        # It runs over the tip and the force goes on.
        assert np.asarray(history.fence[0].place)[pressed].max() > REACH + 0.02
        theirs = independent(scene, np.asarray(history.time), radius=radius)
        found = np.stack([history.body.x, history.body.y, history.body.angle], axis=-1)
        # The step's h^2, and the differences' 1e-10 / 1e-6 relative in the force.
        np.testing.assert_allclose(found, theirs, atol=2e-5)
    low, high = (
        independent(scene, np.asarray(history.time)[[0, -1]], radius=0.012 + change)[-1]
        for change in (-5e-4, 5e-4)
    )
    np.testing.assert_allclose(slope, (high - low) / 1e-3, rtol=1e-2)


# --- The flexible fence -------------------------------------------------------------------------


def test_against_a_general_integrator():
    """The same equations, the foot found anew and the loads from the state: what the own integrator
    foresees of them is of the second order."""
    plain = dict(modes=2, static_correction=False, slip_speed=0.05, static_speed=0.25)
    scene = fj.scenes.oblique_impact(distance=1.15, duration=0.05, tip_contact=True)
    ours = fj.simulate(scene, fidelity=fj.Fidelity(step=1e-4, step_tolerance=None, **plain))
    theirs = fj.simulate(
        scene, fidelity=fj.Fidelity(step=1e-4, integrator="tsit5", tolerance=1e-6, **plain)
    )
    place = np.asarray(ours.history.fence[0].place)
    assert place[np.asarray(ours.history.fence_force) > 10].max() > REACH
    for field in ("peak_force", "impulse", "tip_deflection", "peak_stress", "furthest_y"):
        assert float(getattr(ours, field)) == pytest.approx(
            float(getattr(theirs, field)), rel=1e-3
        ), field
    force = np.asarray(theirs.history.fence_force)
    # Within 1 % of the peak all along, the turn at the tip included.
    np.testing.assert_allclose(ours.history.fence_force, force, atol=0.01 * force.max())


def test_ledger_closes_at_second_order():
    def residual(step):
        fidelity = fj.Fidelity(
            step=step, step_tolerance=None, slip_speed=0.05, static_speed=0.25, tip_fade=0.01
        )
        scene = fj.scenes.oblique_impact(distance=1.15, duration=0.05, tip_contact=True)
        energy = fj.simulate(scene, fidelity=fidelity, history=False).energy
        return abs(float(energy.residual)), sum(abs(float(e)) for e in jax.tree.leaves(energy))

    (coarse, _), (fine, turned) = residual(4e-4), residual(1e-4)
    assert fine < 2e-4 * turned
    assert fine < coarse / 8


@functools.cache
def across(tip_contact):
    """Impulse [N s], with the tip's contact also its derivative in the place [N s/m], for places up
    to the tip."""
    places = jnp.linspace(1.12, 1.199, 80)
    # So smooth that the turns of friction do not show, and the same steps in every lane.
    fidelity = fj.Fidelity.fast(
        step=5e-4, step_tolerance=None, slip_speed=2e-3, static_speed=1e-2
    )

    @jax.jit
    @one_by_one
    def run(place):
        def impulse(place):
            scene = fj.scenes.oblique_impact(
                distance=place, duration=0.08, tip_contact=tip_contact
            )
            result = fj.simulate(scene, fidelity=fidelity, only=("impulse", "peak_force"))
            return result.impulse, (result.impulse, result.peak_force, result.status)

        if not tip_contact:
            return jnp.zeros(()), impulse(place)[1]
        return jax.jacfwd(impulse, has_aux=True)(place)

    slope, (impulse, peak, status) = jax.device_get(run(places))
    return np.asarray(places), impulse, slope, peak, status


def test_value_and_gradient_are_continuous_across_the_tip():
    places, impulse, slope, peak, status = across(True)
    _, ended, _, _, left = across(False)
    over = (fj.Status.LEFT_OVER_TIP, fj.Status.PEAK_AT_TIP)
    assert not np.any(np.isin(status, over))
    assert np.any(left == fj.Status.PEAK_AT_TIP)
    # The force goes on where it used to end.
    assert np.all(impulse[10:55] > 1.2 * ended[10:55])
    step = places[1] - places[0]
    scale = impulse.max()
    # No jump: what 1 mm changes is the gradient's mean, but for h^3 / 12 of the third derivative,
    # which a smoothing over 5 mm lets grow to about scale / (5 mm)^3.
    by_trapezoid = 0.5 * step * (slope[1:] + slope[:-1])
    assert np.abs(np.diff(impulse) - by_trapezoid).max() < step**3 / 12 / 5e-3**3 * scale
    # The gradient has no jump either: it changes by no more than scale / (5 mm)^2 a metre.
    assert np.abs(np.diff(slope)).max() < step / 5e-3**2 * scale / 10
    assert np.abs(np.diff(peak)).max() < 0.05 * peak.max()


# --- Whole sorts, and what is not there ----------------------------------------------------------


def test_nothing_changes_away_from_the_tip():
    results = [
        fj.simulate(
            fj.scenes.oblique_impact(distance=0.9, duration=0.08, tip_contact=flag), history=False
        )
        for flag in (False, True)
    ]
    # Newton's method lets 5e-7 of the forces be, and so 5e-7 of the defect, a share of them.
    ours, theirs = (result.measures.pop("defect") for result in results)
    assert abs(ours - theirs) < 5e-7
    for ours, theirs in zip(*map(jax.tree.leaves, results), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-9)


def test_a_flush_wall_hands_over_from_corner_to_corner():
    """The wall lies on the fence and slides over the tip: corner 1's force goes on at the tip until
    that comes to corner 2, and all the while the parcel keeps to the fence."""
    scene = fj.scenes.along_fence(distance=0.95, duration=0.3, tip_contact=True)
    result = fj.simulate(scene)
    history = result.history
    first, second = (np.asarray(c.place) for c in history.fence)
    assert int(result.status) in (fj.Status.SUCCESSFUL, fj.Status.IN_CONTACT_AT_END)
    between = (first > REACH + 0.03) & (second < REACH - 0.03)
    assert between.any()
    # The tip carries: without it, corner 2 alone would press, and the parcel turn over the tip.
    assert np.asarray(history.fence[0].normal)[between].max() > 1.0


def test_a_flag_is_a_flag():
    with pytest.raises(TypeError, match="`tip_contact` must be True or False, but is 1"):
        fj.scenes.oblique_impact(tip_contact=1)
