"""A flexible shaft between motor and hinge: its modes, and an impact against the independent
version."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.impact_parts import Impact
from reference.impact_shaft import solve

import fencejax as fj
from fencejax.model import FlexibleLink, dot

# A clutch that never slips.
NUMBERS = {"stiffness": 1e5, "damping": 150.0, "inertia": 0.5, "slip_torque": 1e9}
HORIZON = 0.07
# The modes of the independent version, and no more, in its small-deflection geometry.
FIDELITY = fj.Fidelity(
    step=1e-4, step_tolerance=None, modes=3, static_correction=False, geometry="small"
)
INDEPENDENT = Impact(
    modes=3, horizon=HORIZON, load="cubic", geometry="small", mu_belt=(0.0, 0.0),
    mu_fence=(0.0, 0.0),
)  # fmt: skip


def scene(shaft):
    return fj.scenes.oblique_impact(
        fence=fj.Fence(shaft=shaft), belt=None, velocity=(2.0, 0.0, 0.0), fence_friction=None,
        duration=HORIZON,
    )  # fmt: skip


@jax.jit
def struck(numbers):
    """Slopes of the peak force in the shaft's numbers, and the result."""

    def run(numbers):
        result = fj.simulate(
            scene(fj.Shaft(**numbers)), fidelity=FIDELITY,
            only=["peak_force", "peak_torque", "energy"],
        )  # fmt: skip
        return result.peak_force, result

    return jax.grad(run, has_aux=True)(numbers)


def run(**changes):
    return struck({k: jnp.asarray(v) for k, v in {**NUMBERS, **changes}.items()})


def independent(**changes):
    return solve(INDEPENDENT, *{**NUMBERS, **changes}.values())


@pytest.mark.parametrize(
    ("changes", "varied", "within"),
    [
        # The step is of the second order: 3e-5 of the peak at a tenth of a millisecond. The
        # differences of the independent version are good to 1e-3 of a slope, and with a clutch,
        # which begins to slip at a kink, slopes lose an order of the step.
        ({}, ("stiffness", "damping", "inertia"), 1e-2),
        ({"slip_torque": 600.0}, ("stiffness", "inertia", "slip_torque"), 1e-2),
        ({"stiffness": 2e4, "damping": 10.0}, (), 0.0),
    ],
    ids=["shaft", "clutch", "soft"],
)
def test_impact_against_the_independent_version(changes, varied, within):
    numbers = {**NUMBERS, **changes}
    slopes, result = run(**changes)
    peak, moment, _ = independent(**changes)
    assert float(result.peak_force) == pytest.approx(peak, rel=3e-4)
    assert float(result.peak_torque) == pytest.approx(moment, rel=1e-3)
    assert moment <= numbers["slip_torque"]
    exchanged = sum(abs(float(term)) for term in jax.tree.leaves(result.energy))
    assert abs(float(result.energy.residual)) < 1e-4 * exchanged
    for name in varied:
        value = numbers[name]
        low, high = (
            independent(**{**changes, name: share * value})[0] for share in (0.99, 1.01)
        )
        slope = (high - low) / (0.02 * value)
        assert float(slopes[name]) == pytest.approx(slope, rel=within), name


def test_a_stiff_shaft_is_none_and_a_clutch_that_holds_is_none():
    # The compliance is R^2 / k: what it changes falls with 1 / k, to nothing.
    bare = fj.simulate(scene(None), fidelity=FIDELITY, only=["peak_force"])
    off = [
        float(run(stiffness=k)[1].peak_force / bare.peak_force) - 1 for k in (1e9, 1e10, 1e14)
    ]
    assert off[0] == pytest.approx(10 * off[1], rel=0.02)
    assert abs(off[2]) < 1e-9
    plain = {name: value for name, value in NUMBERS.items() if name != "slip_torque"}
    alone = fj.simulate(scene(fj.Shaft(**plain)), fidelity=FIDELITY, only=["peak_force"])
    assert float(run()[1].peak_force) == pytest.approx(float(alone.peak_force), rel=1e-9)


def test_compliance_at_a_place():
    # By all modes, what the shaft adds to the fence at R is R^2 / k: 26 % at 1.08 m, 107 % at
    # 0.8 m; and a unit force turns the hinge by R / k.
    for place, share in ((1.08, 0.26), (0.8, 1.07)):
        found = []
        for shaft in (None, fj.Shaft(1e5)):
            link = FlexibleLink(fj.Fence(shaft=shaft), fj.Fidelity(modes=4))
            shape = link.shape(jnp.asarray(place))
            push = [
                load / (link.mass_scale * square)
                for load, square in zip(shape.load, link.frequency_squared, strict=True)
            ]
            found.append(float(dot(shape.load, push) + shape.residual))
        assert link.hinge is not None
        turn = float(jnp.sum(link.hinge.turn * jnp.stack(push)))
        assert turn == pytest.approx(place / 1e5, rel=1e-10)
        assert found[1] - found[0] == pytest.approx(place**2 / 1e5, rel=1e-9)
        assert found[1] / found[0] - 1 == pytest.approx(share, abs=0.03)


def test_it_is_described_and_named():
    sorter = fj.Sorter(fence={"shaft": {"stiffness": 2e5, "inertia": 0.3}})
    assert float(sorter.fence.shaft.stiffness) == 2e5
    sort = sorter.replace(free={"shaft_stiffness": (1e4, 1e6)}).scene()
    assert fj.scene_numbers.number(sort, "shaft_stiffness").unit == "N m/rad"
    assert np.isfinite(sort.fence.shaft.inertia)
    with pytest.raises(ValueError, match="`stiffness` must be above 0"):
        fj.Shaft(stiffness=0.0)
    fence = fj.Fence(shaft=fj.Shaft(slip_torque=500.0))
    with pytest.raises(ValueError, match="`slip_torque` of the fence's shaft must be None"):
        fj.simulate(fj.scenes.normal_impact(fence=fence))
