"""The paper's polar form of the parcel's motion against plain vector Newton-Euler.

The reference is `newton_euler.py`, in vectors and cross products, which shares no code with
`polar.py`. The misprints of the paper are put back one at a time, and the same
comparison must then fail, for the corners and the quantities that the misprint touches.
"""

import numpy as np
import pytest
from reference import polar
from reference.newton_euler import (
    CORNERS,
    GRAVITY,
    MU_1,
    PAIRS,
    STATES,
    V,
    assert_same,
    centre,
    compare_along_fence,
    compare_border_and_fence,
    compare_foot_rate,
    compare_oblique_impact,
    corner_arm,
    dot,
    fence_frame,
    mean_distance_by_quadrature,
    scene,
    times,
    vec,
)


@pytest.mark.parametrize("j", CORNERS)
def test_oblique_impact_is_newton_euler(j):
    compare_oblique_impact(j)


@pytest.mark.parametrize(("j", "border_j"), PAIRS)
def test_border_and_fence_is_newton_euler(j, border_j):
    compare_border_and_fence(j, border_j)


def test_along_fence_is_newton_euler():
    compare_along_fence()


@pytest.mark.parametrize("j", CORNERS)
def test_foot_rate_is_the_rate_of_the_projection(j):
    compare_foot_rate(j)


@pytest.mark.parametrize("j", CORNERS)
def test_foot_rate_and_sliding_speed_differ_by_gap_times_rotation(j):
    """On a rigid fence about O, U = sigma t and v_U = sigma q5_dot n: foot rate = w - D q5_dot."""
    state, parcel, fence, _ = scene()
    t, n = fence_frame(fence)
    sigma = dot(centre(state)[0] + corner_arm(state.phi, parcel, j), t)
    point, velocity = times(sigma, t), times(sigma * fence["q5_dot"], n)
    fence_point = polar.FencePoint(
        point[:, 0], point[:, 1], fence["q5"], velocity[:, 0], velocity[:, 1], fence["q5_dot"]
    )
    d = polar.gap(state, fence_point, parcel, j)
    w = polar.sliding_speed(state, fence_point, parcel, j)
    foot = polar.foot_rate(state, fence_point, parcel, j)
    assert_same(foot, w - d * fence["q5_dot"], "foot_rate")


@pytest.mark.parametrize("j", CORNERS)
def test_gap_rate_is_the_rate_of_the_gap(j):
    """Central difference, a rigid fence about O, U the foot of the perpendicular.

    D''' is of the order of r w^3, at most 2000 m/s^3: truncation h^2 D'''/6 is below 5e-8 m/s at
    h = 1e-5 s, round-off eps/h near 1e-11 m/s.
    """
    state, parcel, fence, _ = scene()
    step = 1e-5

    def at(time):
        q5 = fence["q5"] + fence["q5_dot"] * time
        moved = polar.PolarState(
            state.r + state.r_dot * time,
            state.alpha + state.alpha_dot * time,
            state.phi + state.phi_dot * time,
            *state[3:],
        )
        x_c, y_c = polar.corner_position(moved, parcel, j)
        sigma = x_c * np.cos(q5) + y_c * np.sin(q5)
        fence_point = polar.FencePoint(
            sigma * np.cos(q5), sigma * np.sin(q5), q5,
            -sigma * fence["q5_dot"] * np.sin(q5), sigma * fence["q5_dot"] * np.cos(q5),
            fence["q5_dot"],
        )
        return moved, fence_point

    difference = (
        polar.gap(*at(step), parcel, j) - polar.gap(*at(-step), parcel, j)
    ) / (2 * step)
    np.testing.assert_allclose(
        polar.gap_rate(*at(0.0), parcel, j), difference, rtol=0, atol=1e-7
    )


def test_friction_takes_energy_out():
    state, parcel, _, (normal, _) = scene()
    w = state.r_dot
    assert np.all(polar.friction_at_corner(normal, w, 0.35, 0.5, 0.005, 0.001) * w >= 0)
    belt = polar.friction_on_belt(state, parcel, V, MU_1)
    cartesian = polar.cartesian_state_from_polar(state)
    u = vec(V, 0.0) - vec(cartesian.x_dot, cartesian.y_dot)
    e_r = vec(np.cos(state.alpha), np.sin(state.alpha))
    e_a = vec(-np.sin(state.alpha), np.cos(state.alpha))
    power = belt.belt_r * dot(u, e_r) + belt.belt_alpha * dot(u, e_a)
    power = power + belt.belt_torque * state.phi_dot
    # Limit surface: (|F_1|/F_max)^2 + (T/(c F_max))^2 = 1, and the dissipation is Lambda.
    f_max = MU_1 * parcel.mass * GRAVITY
    c = polar.mean_distance(parcel)
    ellipse = (belt.belt_r**2 + belt.belt_alpha**2) / f_max**2
    ellipse = ellipse + (belt.belt_torque / (c * f_max)) ** 2
    assert_same(ellipse, np.ones(STATES), "limit surface")
    assert_same(power, f_max * np.sqrt(dot(u, u) + (c * state.phi_dot) ** 2), "dissipation")


def test_friction_at_rest_is_zero_and_finite():
    parcel = polar.Parcel(15.0, 0.3, 0.4, 0.3, 0.0, 0.0)
    riding = polar.PolarState(1.0, 0.0, 0.0, V, 0.0, 0.0)
    assert polar.friction_on_belt(riding, parcel, V, MU_1) == (0.0, 0.0, 0.0)
    assert polar.friction_at_corner(100.0, 0.0, 0.35) == 0.0


def test_mean_distance_is_the_quadrature():
    _, parcel, _, _ = scene()
    assert_same(polar.mean_distance(parcel), mean_distance_by_quadrature(parcel), "c")


def test_mean_distance_of_unit_square():
    """Mean distance of a unit square from its centre: (sqrt 2 + asinh 1)/6."""
    square = polar.Parcel(1.0, 1.0, 1.0, 1.0, 0.0, 0.0)
    expected = (np.sqrt(2) + np.arcsinh(1)) / 6
    assert polar.mean_distance(square) == pytest.approx(expected, rel=1e-14)


def test_converters_invert_each_other_and_match_vectors():
    state, _, _, _ = scene()
    cartesian = polar.cartesian_state_from_polar(state)
    position, velocity = centre(state)
    assert_same(vec(cartesian.x, cartesian.y), position, "position")
    assert_same(vec(cartesian.x_dot, cartesian.y_dot), velocity, "velocity")
    back = polar.polar_state_from_cartesian(cartesian)
    for name in state._fields:
        assert_same(getattr(back, name), getattr(state, name), name)
    x_ddot, y_ddot = state.phi_dot, state.r_dot  # any two numbers will do
    polar_acceleration = polar.polar_acceleration_from_cartesian(state, x_ddot, y_ddot)
    again = polar.cartesian_acceleration_from_polar(state, *polar_acceleration)
    assert_same(again[0], x_ddot, "x_ddot")
    assert_same(again[1], y_ddot, "y_ddot")


def test_acceleration_converter_on_known_motion():
    """r = 1 + t^2, alpha = 3 t at t = 0.5, against the second derivative of r exp(i alpha)."""
    time = 0.5
    state = polar.PolarState(1 + time**2, 3 * time, 0.0, 2 * time, 3.0, 0.0)
    # z = r e^{3it}: z'' = (r'' + 6i r' - 9 r) e^{3it}
    exact = (2.0 + 6j * 2 * time - 9 * (1 + time**2)) * np.exp(3j * time)
    x_ddot, y_ddot = polar.cartesian_acceleration_from_polar(state, 2.0, 0.0)
    assert x_ddot + 1j * y_ddot == pytest.approx(exact, rel=1e-14)


# --- The misprints, put back --------------------------------------------------------------------


@pytest.mark.parametrize("j", CORNERS)
def test_printed_2_12_breaks_corners_1_and_3(monkeypatch, j):
    """Printed gamma_j + phi instead of gamma_j + u_j phi."""
    monkeypatch.setattr(polar, "corner_angle", lambda gamma, u, phi: gamma + phi)
    if j in (1, 3):
        with pytest.raises(AssertionError, match="gap"):
            compare_oblique_impact(j)
    else:
        compare_oblique_impact(j)


@pytest.mark.parametrize("j", CORNERS)
def test_printed_2_5_to_2_7_break_corners_3_and_4(monkeypatch, j):
    """Printed phi itself, not counted from the parcel turned by pi."""
    monkeypatch.setattr(polar, "orientation_from_fence_side", lambda phi, j: phi)
    if j in (3, 4):
        with pytest.raises(AssertionError, match="phi_ddot"):
            _compare_moment(j)
        with pytest.raises(AssertionError, match="gap_rate"):
            compare_oblique_impact(j)
    else:
        _compare_moment(j)
        compare_oblique_impact(j)


def _compare_moment(j):
    """The moment equation alone, with a friction force that does not depend on the corner."""
    state, parcel, fence, (normal, f_2) = scene()
    t, n = fence_frame(fence)
    arm = corner_arm(state.phi, parcel, j)
    push = times(normal, n) - times(f_2, t)
    moment = polar.fence_moment(state, fence["q5"], normal, f_2, parcel, j)
    assert_same(moment, np.cross(arm, push)[:, 2], "phi_ddot")


def test_printed_2_30_breaks_the_stage_along_the_fence(monkeypatch):
    """Printed (B + y_p)/2 instead of B/2 + y_p."""
    monkeypatch.setattr(polar, "wall_distance", lambda parcel: (parcel.width + parcel.y_p) / 2)
    with pytest.raises(AssertionError, match="gap"):
        compare_along_fence()


def test_printed_2_31_breaks_the_border_stage(monkeypatch):
    """Printed + r_C2[N_2 cos ... + F sin ...] instead of - r_C2[...]."""
    correct = polar.border_moment
    monkeypatch.setattr(polar, "border_moment", lambda *arguments: -correct(*arguments))
    with pytest.raises(AssertionError, match="phi_ddot"):
        compare_border_and_fence(1, 2)


def test_printed_2_33_breaks_the_foot_rate(monkeypatch):
    """Printed r_C1 (alpha_dot - q5_dot) sin(alpha + gamma_1 - phi), for corner 1."""

    def printed(state, q5, q5_dot, parcel, j):
        r_c, gamma, _ = polar.corner_geometry(parcel, j)
        return r_c * (state.alpha_dot - q5_dot) * np.sin(state.alpha + gamma - state.phi)

    monkeypatch.setattr(polar, "corner_rate_term", printed)
    with pytest.raises(AssertionError, match="foot_rate"):
        compare_foot_rate(1)
