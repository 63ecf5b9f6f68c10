"""The fence's elastic cover: its law, a blow against the independent version, and its energy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference import normal_impact
from reference.impact_parts import Impact

import fencejax as fj

PLACE, SPEED, HORIZON = 1.05, 2.426, 0.06
NUMBERS = dict(thickness=0.015, modulus=1.2e5, contact_length=0.04, retardation_time=2e-3)
# The modes of the independent version, and no more.
MODES = fj.Fidelity.standard(modes=3, static_correction=False)


def scene(pad):
    fence = fj.Fence(pad=pad)
    return fj.scenes.normal_impact(fence=fence, distance=PLACE, speed=SPEED, duration=HORIZON)


@jax.jit
def struck(numbers):
    """Slopes of the peak force in the pad's numbers, and the result."""

    def run(numbers):
        result = fj.simulate(
            scene(fj.Pad(**numbers)), fidelity=MODES, only=["peak_force", "energy"]
        )
        return result.peak_force, result

    return jax.grad(run, has_aux=True)(numbers)


def independent(numbers):
    impact = Impact(modes=3)
    return normal_impact.solve(impact, SPEED, PLACE, tuple(numbers.values()), HORIZON)


def test_law():
    # F_0 = E a z; N = F_0 e where e is small, 35 to 63 kPa at a quarter of the thickness, and never
    # closed; the slope and the energy are the derivative and the integral.
    pad = fj.Pad()
    scale = pad.force_scale(jnp.asarray(0.132))
    assert float(scale) == pytest.approx(1.9e5 * 0.05 * 0.132, rel=1e-12)
    forces = jnp.asarray([0.0, 1e-3, 300.0, 1e4, 1e7])
    strains = jax.vmap(lambda n: pad.strain(n, scale))(forces)
    assert float(strains[1]) == pytest.approx(1e-3 / float(scale), rel=1e-9)
    assert float(jnp.max(strains)) < 1
    slopes = jax.vmap(jax.grad(lambda n: pad.strain(n, scale)))(forces)
    np.testing.assert_allclose(pad.strain_slope(forces, scale), slopes, rtol=1e-12)
    per_strain = jax.vmap(jax.grad(lambda e: pad.stored_energy(e, scale)))(strains)
    np.testing.assert_allclose(per_strain, 0.01 * forces, rtol=1e-9, atol=1e-15)
    quarter = per_strain[0] + jax.grad(lambda e: pad.stored_energy(e, scale))(0.25) / 0.01
    assert 35e3 < float(quarter) / (0.05 * 0.132) < 63e3


def test_blow_against_the_independent_version():
    # 240 steps of second order in a blow of 60 ms: some 1e-5; slopes lose half an order.
    slopes, result = struck({k: jnp.asarray(v) for k, v in NUMBERS.items()})
    peak, stored, taken = independent(NUMBERS)
    assert float(result.peak_force) == pytest.approx(peak, rel=1e-4)
    energy = result.energy
    assert abs(float(energy.residual)) < 1e-3 * taken
    assert float(energy.contact_stored + energy.contact_loss) == pytest.approx(taken, rel=1e-3)
    assert 0 < stored <= float(energy.contact_stored) + 1e-3 * taken
    for name in ("thickness", "modulus"):
        ends = []
        for factor in (0.999, 1.001):
            ends.append(independent(NUMBERS | {name: factor * NUMBERS[name]})[0])
        slope = (ends[1] - ends[0]) / (0.002 * NUMBERS[name])
        assert float(slopes[name]) == pytest.approx(slope, rel=1e-3), name
    assert float(slopes["thickness"]) < 0


def test_without_thickness_it_is_not_there():
    thin = NUMBERS | {"thickness": 0.0}
    slopes, result = struck({k: jnp.asarray(v) for k, v in thin.items()})
    bare = fj.simulate(scene(None), fidelity=MODES, only=["peak_force", "energy"])
    assert float(result.peak_force) == pytest.approx(float(bare.peak_force), rel=1e-12)
    np.testing.assert_allclose(
        jax.tree.leaves(result.energy), jax.tree.leaves(bare.energy), rtol=1e-9, atol=1e-12
    )
    assert all(np.isfinite(slope) for slope in jax.tree.leaves(slopes))
    assert float(slopes["modulus"]) == 0.0
    assert float(slopes["thickness"]) < 0


def test_oblique_impact_on_a_rigid_fence_and_under_error_control():
    # The ledger closes at the order of the step, the loss in the cover included; on a fence without
    # modes it is the cover alone that gives way.
    forces = {}
    for modes, tolerance in ((2, 1e-3), (0, None)):
        fidelity = fj.Fidelity.standard(
            modes=modes, static_correction=False, geometry="small", step_tolerance=tolerance
        )
        impact = fj.scenes.oblique_impact(
            fence=fj.Fence(pad=fj.Pad(**NUMBERS)), belt=None, velocity=(2.0, 0.0, 0.0),
            fence_friction=None, duration=0.06,
        )  # fmt: skip
        result = fj.simulate(impact, fidelity=fidelity, only=["peak_force", "energy"])
        assert fj.Status(int(result.status)) <= fj.Status.LEFT_OVER_TIP
        changed = sum(abs(float(term)) for term in jax.tree.leaves(result.energy))
        assert abs(float(result.energy.residual)) < 2e-4 * changed
        assert float(result.energy.contact_loss) > 1.0
        forces[modes] = float(result.peak_force)
    # Against a rigid wall without a cover, at the same speed: 3294 N.
    assert forces[2] < forces[0] < 3294


def test_it_is_described_named_and_refused():
    sorter = fj.Sorter(fence={"pad": {"thickness": "12 mm", "modulus": "150 kPa"}})
    assert float(sorter.fence.pad.thickness) == pytest.approx(0.012)
    sort = sorter.replace(free={"pad_thickness": ("0 mm", "30 mm")}).scene()
    assert fj.scene_numbers.resolve(sort, "pad_modulus") == "fence.pad.modulus"
    assert fj.scene_numbers.number(sort, "pad_thickness").unit == "m"
    with pytest.raises(ValueError, match="must be 'modal' for a fence with a pad"):
        fj.simulate(sort, fidelity=fj.Fidelity(integrator="tsit5"))
    with pytest.raises(ValueError, match="`modulus` must be above 0"):
        fj.Pad(modulus=0.0)
