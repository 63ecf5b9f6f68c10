"""Design variables: the map to shares, the parts that they change, and refusals."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import VARIABLES, DesignSpace, DesignVariable

_FENCE = [
    "thickness", "length_ratio", "reach", "width", "youngs_modulus", "density", "damping_ratio",
]  # fmt: skip
_DRIVES = {
    "harmonic": fj.HarmonicDrive(),
    "held": fj.HeldDrive(),
    "constant": fj.ConstantSpeedDrive(),
    "trapezoid": fj.TrapezoidDrive(),
    "s-curve": fj.SCurveDrive(),
    "spline": fj.SplineDrive(jnp.array([0.1, 0.4, 0.6, 0.4, 0.1])),
}


STEPPED = fj.SteppedTaper(fj.PowerTaper(0.5), 4)


def exponent_of(name):
    return DesignVariable(name, 0.1, 0.9, scaling="linear")


def _drive_names(drive):
    return [name for name in vars(drive) if name in VARIABLES]


@pytest.mark.parametrize("name", _DRIVES)
def test_round_trip(name):
    drive = _DRIVES[name]
    space = DesignSpace([*_FENCE, *_drive_names(drive)], drive=drive)
    values = space.values_of(space.fence, drive)
    back = space.from_shares(space.to_shares(values))
    # Some of them lie on their bounds.
    span = np.array([v.upper - v.lower for v in space.variables])
    np.testing.assert_allclose((back - values) / span, 0, atol=1e-14)
    fence, moved = space.apply(values)
    np.testing.assert_allclose(space.values_of(fence, moved), values, rtol=1e-14)


@pytest.mark.parametrize("name", _DRIVES)
def test_each_variable_changes_its_own_number_and_no_other(name):
    drive = _DRIVES[name]
    space = DesignSpace([*_FENCE, *_drive_names(drive)], drive=drive)
    values = space.values_of(space.fence, drive)
    changed = jax.jacfwd(lambda v: space.values_of(*space.apply(v)))(values)
    np.testing.assert_allclose(changed, np.eye(len(values)), atol=1e-12)


def test_ends_are_the_bounds_and_the_logarithmic_middle_is_geometric():
    space = DesignSpace(["thickness", DesignVariable("density", 1000, 2000, "kg/m^3", "linear")])
    lower, middle, upper = (space.from_shares(jnp.full(2, z)) for z in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(lower, [0.01, 1000], rtol=1e-14)
    np.testing.assert_allclose(upper, [0.09, 2000], rtol=1e-14)
    np.testing.assert_allclose(middle, [0.03, 1500], rtol=1e-14)


def test_slope_of_the_map():
    # dp/ds = b - a, or p ln(b / a) on a logarithmic scale.
    space = DesignSpace(["thickness", "length_ratio"])
    share = jnp.array([0.7, 0.4])
    value = np.asarray(space.from_shares(share))
    expected = np.array([value[0] * np.log(9.0), 1.0])
    slope = jax.jacfwd(space.from_shares)(share)
    np.testing.assert_allclose(slope, np.diag(expected), rtol=1e-12, atol=1e-15)


def test_length_ratio_keeps_the_reach():
    space = DesignSpace(["length_ratio"])
    fence, drive = space.apply([0.2])
    assert float(fence.reach) == pytest.approx(1.2, rel=1e-15)
    assert float(fence.rigid_length) == pytest.approx(0.2, rel=1e-14)
    assert eqx.tree_equal(drive, space.drive)
    long, _ = DesignSpace(["length_ratio", "reach"]).apply([0.2, 1.5])
    assert float(long.rigid_length / long.flexible_length) == pytest.approx(0.2, rel=1e-14)
    assert float(long.reach) == pytest.approx(1.5, rel=1e-14)


def test_untouched_numbers_stay_exactly():
    space = DesignSpace(["damping_ratio"])
    fence, _ = space.apply(space.values_of(space.fence, space.drive))
    assert eqx.tree_equal(fence, space.fence)


def test_element_of_a_vector():
    drive = _DRIVES["spline"]
    space = DesignSpace(["control_angles[3]", "thickness"], drive=drive)
    assert space.names == ("control_angles[3]", "thickness")
    _, moved = space.apply([0.5, 0.03])
    np.testing.assert_allclose(moved.control_angles, [0.1, 0.4, 0.6, 0.5, 0.1])
    whole = DesignSpace(["control_angles"], drive=drive)
    assert whole.names == tuple(f"control_angles[{k}]" for k in range(5))


def test_named_and_traced():
    space = DesignSpace(["thickness", "top_speed"])
    assert space.named([0.05, 1.2]) == {"thickness": 0.05, "top_speed": 1.2}

    @jax.jit
    def twice(values):
        return space.from_shares(space.to_shares(values))

    np.testing.assert_allclose(twice(jnp.array([0.05, 1.2])), [0.05, 1.2], rtol=1e-12)


def test_taper_is_designed_like_any_other_number():
    exponent = exponent_of("fence.taper.exponent")
    space = DesignSpace([exponent, "thickness"], fj.Fence(taper=fj.PowerTaper(0.5)))
    fence, _ = space.apply([0.25, 0.05])
    assert eqx.tree_equal(fence, fj.Fence(thickness=0.05, taper=fj.PowerTaper(0.25)))
    np.testing.assert_allclose(space.values_of(fence, space.drive), [0.25, 0.05], rtol=1e-15)
    # Elements of a profile, and a profile in steps.
    ratios = DesignVariable("ratios", 0.2, 2.0)
    whole = DesignSpace([ratios], fj.Fence(taper=fj.ProfileTaper([1.0, 0.8, 0.5])))
    assert whole.names == ("ratios[0]", "ratios[1]", "ratios[2]")
    moved, _ = whole.apply([1.0, 0.9, 0.4])
    assert eqx.tree_equal(moved, fj.Fence(taper=fj.ProfileTaper([1.0, 0.9, 0.4])))
    stepped = DesignSpace([exponent_of("profile.exponent")], fj.Fence(taper=STEPPED))
    moved, _ = stepped.apply([0.25])
    assert eqx.tree_equal(moved, fj.Fence(taper=fj.SteppedTaper(fj.PowerTaper(0.25), 4)))


def test_peak_force_has_the_slope_in_the_taper_that_its_difference_has():
    space = DesignSpace([exponent_of("fence.taper.exponent")], fj.Fence(taper=fj.PowerTaper(0.5)))

    def peak(fence):
        scene = fj.scenes.normal_impact(fence=fence, distance=1.05, duration=0.04)
        fidelity = fj.Fidelity(step=2e-4, modes=2)
        return fj.simulate(scene, fidelity=fidelity, only=("peak_force",)).peak_force

    slope = jax.jit(jax.jacfwd(lambda values: peak(space.apply(values)[0])))(jnp.array([0.5]))[0]
    # Without the design space: fences by their constructor. The central difference is off by
    # h^2 f''' / 6 = 1e-8 of the slope, and the rounding of the eigen-solve by some 1e-12 f / h.
    made = jax.jit(lambda p: peak(fj.Fence(taper=fj.PowerTaper(p))))
    difference = (made(0.5 + 1e-4) - made(0.5 - 1e-4)) / 2e-4
    assert abs(slope) > 1.0
    np.testing.assert_allclose(slope, difference, rtol=1e-5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: DesignSpace(["colour"]), "`variables` must name numbers of the fence"),
        (lambda: DesignSpace(["control_angles[0]"]), "HarmonicDrive"),
        (lambda: DesignSpace(["control_angles[9]"], drive=_DRIVES["spline"]), r"angles\[9\]"),
        (lambda: DesignSpace(["thickness[0]"]), r"thickness\[0\]"),
        (lambda: DesignSpace(["thickness", "thickness"]), "must not repeat"),
        (lambda: DesignSpace([]), "at least one"),
        (lambda: DesignSpace("thickness"), "sequence"),
        (lambda: DesignSpace(["turn"], drive=_DRIVES["spline"]), "no default"),
        (lambda: DesignVariable("thickness", 0.1, 0.1, "m"), "lower` must be below `upper` = 0.1"),
        (lambda: DesignVariable("thickness", 0.0, 0.1, "m"), 'above 0 .* scaling="linear"'),
        (lambda: DesignVariable("thickness", 0.1, 0.2, "m", "square"), "must be one of"),
        (
            lambda: DesignSpace([DesignVariable("thickness", 0.05, 0.1, "m")]),
            "`thickness` must be at least 0.05 .m., but is 0.045. Widen the bounds",
        ),
        (
            lambda: DesignSpace(["thickness"]).to_shares([0.5]),
            "`thickness` must be at most 0.09 .m., but is 0.5",
        ),
        (lambda: DesignSpace(["thickness"]).apply([0.05, 0.1]), r"shape \(1,\)"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
