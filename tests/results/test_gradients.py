"""Gradients against converged differences of the independent version, and against each other."""

import functools
import json
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj

RECORDED = json.loads(
    (Path(__file__).parents[1] / "reference" / "recorded.json").read_text(encoding="utf-8")
)["cases"]
# The design variables, then what else the peak depends on.
DESIGN = ("thickness", "E", "rho", "zeta", "width", "l_s", "l_p", "top_speed")
OTHERS = ("belt_speed", "mass", "stiffness", "damping", "mu_fence", "mu_belt", "distance")
NAMES = DESIGN + OTHERS


# The fewest operations that hold every part, where accuracy is not asked for; steps of different
# lengths.
COARSE = fj.Fidelity(
    modes=1, elements=6, geometry="small", step=1e-3, step_tolerance=None, longest_stride=4
)


def recorded(name):
    (case,) = [case for case in RECORDED if case["name"] == name]
    return case


def build(x, duration=0.1):
    """The recorded impact as a function of all its variables."""
    material = fj.Material(x["E"], x["rho"], x["zeta"])
    fence = fj.Fence(x["l_s"], x["l_p"], x["width"], x["thickness"], material)
    return fj.scenes.oblique_impact(
        fence=fence,
        distance=x["distance"],
        parcel=fj.Parcel(mass=x["mass"], stiffness=x["stiffness"], damping=x["damping"]),
        drive=fj.HarmonicDrive(top_speed=x["top_speed"]),
        belt=fj.Belt(speed=x["belt_speed"], friction=fj.Friction(x["mu_belt"], 0.85)),
        fence_friction=fj.Friction(x["mu_fence"], 0.5),
        duration=duration,
    )


def values_at(case):
    return {name: jnp.asarray(case["derivatives"][name]["at"], dtype=float) for name in NAMES}


@functools.cache
def program(fidelity):
    """Peak force and tip deflection with their derivatives; compiled once for every case."""

    def outputs(x):
        result = fj.simulate(build(x), fidelity=fidelity, only=("peak_force", "tip_deflection"))
        values = {"peak_force": result.peak_force, "tip_deflection": result.tip_deflection}
        return values, values

    return jax.jit(jax.jacrev(outputs, has_aux=True))


def elasticities(case, fidelity, quantity):
    """d ln(quantity) / d ln(variable), ours and recorded, and the recorded error."""
    x = values_at(case)
    gradient, value = program(fidelity)(x)
    ours = np.array([float(gradient[quantity][n] * x[n] / value[quantity]) for n in NAMES])
    truth = case["values"][quantity]
    table = case["derivatives"]
    theirs = np.array([table[n][quantity]["derivative"] * table[n]["at"] / truth for n in NAMES])
    error = np.array([table[n][quantity]["error"] * table[n]["at"] / truth for n in NAMES])
    return ours, theirs, error


CONSISTENT = ["R = 1.0, consistent load, derivatives", "R = 0.8, consistent load, derivatives"]


@pytest.mark.parametrize("name", CONSISTENT)
def test_standard_within_one_percent_of_the_gradient(name):
    case = recorded(name)
    ours, theirs, _ = elasticities(case, fj.Fidelity.standard(), "peak_force")
    size = np.linalg.norm(theirs)
    assert np.linalg.norm(ours - theirs) < 1e-2 * size
    assert np.all(np.abs(ours - theirs) < 1e-2 * size)
    matters = np.abs(theirs) > 1e-2 * size
    assert np.all(np.sign(ours[matters]) == np.sign(theirs[matters]))
    # The same for the design variables alone, whose gradient is what a designer follows.
    design = slice(0, len(DESIGN))
    assert np.linalg.norm((ours - theirs)[design]) < 1e-2 * np.linalg.norm(theirs[design])


@pytest.mark.parametrize(("quantity", "power"), [("peak_force", 1), ("tip_deflection", 0)])
def test_rule_of_the_unit_of_mass(quantity, power):
    # Counted in another unit of mass the equations are the same, so that the elasticities obey
    # sum_i (power of mass in p_i) E_i = power of mass in the result: exactly, at any step. Newton's
    # method leaves 5e-7 of the force.
    powers = {"mass": 1, "stiffness": 1, "damping": 0.6, "E": 1, "rho": 1}
    for name in CONSISTENT:
        ours, *_ = elasticities(recorded(name), fj.Fidelity.standard(), quantity)
        found = sum(power * ours[NAMES.index(p)] for p, power in powers.items())
        assert found == pytest.approx(power, abs=2e-6)


def test_converged_gradient():
    # The paper's load sharing, all modes: what is left is the step, 25 us, and the recorded error.
    case = recorded("R = 1.0, derivatives")
    fidelity = fj.Fidelity.reference(
        modes=None, load="shared", slip_speed=1e-3, static_speed=5e-3
    )
    ours, theirs, error = elasticities(case, fidelity, "peak_force")
    assert np.linalg.norm(ours - theirs) < 3e-4 * np.linalg.norm(theirs) + np.linalg.norm(error)


def test_tip_deflection():
    case = recorded("R = 1.0, consistent load, derivatives")
    ours, theirs, _ = elasticities(case, fj.Fidelity.standard(), "tip_deflection")
    assert np.linalg.norm(ours - theirs) < 2e-2 * np.linalg.norm(theirs)


def test_transformations_compose():
    def peak(speed):
        return fj.simulate(fj.scenes.rigid_wall(speed=speed), history=False).peak_force

    speed = jnp.array([1.0, 2.0, 3.0])
    slope = jax.jit(jax.grad(peak))
    each = jnp.stack([slope(v) for v in speed])
    np.testing.assert_allclose(jax.jit(jax.vmap(jax.grad(peak)))(speed), each, rtol=1e-8)
    np.testing.assert_allclose(jax.jacfwd(lambda v: jax.vmap(peak)(v))(speed), jnp.diag(each))
    value, slope = jax.jvp(peak, (speed[1],), (jnp.asarray(2.0),))
    np.testing.assert_allclose(slope, 2 * each[1], rtol=1e-12)
    np.testing.assert_allclose(jax.vmap(peak)(speed)[1], value, rtol=1e-9)


SCENES = {
    "never_touches": lambda: fj.scenes.whole_sort(front=-3.0, duration=0.4),
    "along_fence": lambda: fj.scenes.along_fence(duration=0.1),
    "border_and_fence": lambda: fj.scenes.border_and_fence(
        drive=fj.SplineDrive(jnp.array([0.1, 0.4, 0.7, 0.7, 0.4, 0.1])), duration=0.1
    ),
    "free_motion": lambda: fj.scenes.free_motion(duration=0.2),
    "whole_sort": lambda: fj.scenes.whole_sort(duration=0.4),
    "rigid_wall": lambda: fj.scenes.rigid_wall(),
    "oblique_impact": lambda: fj.scenes.oblique_impact(
        fence=fj.Fence(taper=fj.PowerTaper(0.5)), duration=0.06
    ),
}
QUANTITIES = (
    "peak_force", "tip_deflection", "peak_stress", "impulse", "contact_time", "peak_torque",
    "peak_border_force", "furthest_y", "deepest",
)


@eqx.filter_jit
def jacobian(scene):
    """Derivatives of every quantity in every number of a scene, and the quantities."""
    numbers, structure = eqx.partition(scene, eqx.is_inexact_array)

    def quantities(numbers):
        scene = eqx.combine(numbers, structure)
        result = fj.simulate(scene, fidelity=COARSE, only=QUANTITIES)
        values = {q: getattr(result, q) for q in QUANTITIES}
        return values, values

    return jax.jacrev(quantities, has_aux=True)(numbers)


@pytest.mark.parametrize("name", SCENES)
def test_every_gradient_is_finite(name):
    """Every scalar of every part, every quantity of the result, every kind of scene."""
    slopes, value = jacobian(SCENES[name]())
    for quantity in QUANTITIES:
        assert np.isfinite(value[quantity]), quantity
        for path, leaf in jax.tree_util.tree_leaves_with_path(slopes[quantity]):
            assert np.all(np.isfinite(leaf)), (quantity, jax.tree_util.keystr(path))
    if name in ("never_touches", "free_motion"):
        assert value["peak_force"] == 0
        assert all(np.all(leaf == 0) for leaf in jax.tree.leaves(slopes["peak_force"]))
    else:
        assert value["peak_force"] > 0


def test_forward_and_reverse_agree():
    # The same program, of steps of different lengths, differentiated two ways: round-off, grown
    # over 60 steps.
    scene = SCENES["oblique_impact"]()
    forward = jacobian(scene)[0]["peak_force"]
    numbers, structure = eqx.partition(scene, eqx.is_inexact_array)

    @jax.jit
    def reverse(numbers):
        def peak(numbers):
            result = fj.simulate(
                eqx.combine(numbers, structure), fidelity=COARSE.replace(gradient="reverse"),
                only=("peak_force",),
            )
            return result.peak_force

        return jax.grad(peak)(numbers)

    found = jax.tree.leaves(reverse(numbers))
    assert sum(bool(np.any(leaf != 0)) for leaf in found) > 15
    for one, other in zip(jax.tree.leaves(forward), found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-12)
