"""Second-order loads and shear: the virtual work of a force on a bent line, the moment and the
shear compliance in closed form, and an impact against the independent version."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from model.links import ELEMENTS, FENCE, LENGTH, RIGID, ROOT_STIFFNESS, make, vibration
from reference.second_order import FILE
from reference.second_order_library import compared

import fencejax as fj

LOADS = {
    "moment": fj.SecondOrderLoads(friction_force=False, normal_force=False),
    "force": fj.SecondOrderLoads(friction_moment=False, normal_force=False),
    "normal": fj.SecondOrderLoads(friction_moment=False, friction_force=False),
    "all": fj.SecondOrderLoads(),
}
RATIO, SHARE = 0.35, 0.83
PLACE = RIGID + SHARE * LENGTH


def fence(taper=None, **parts):
    numbers = dict(rigid_length=RIGID, flexible_length=LENGTH, width=0.12, thickness=0.05)
    return fj.Fence(**numbers, material=FENCE.material, taper=taper, **parts)


@pytest.fixture(scope="module")
def bent():
    """By load: the link, its shape at the place, that of a load that follows, and the amplitudes of
    a link that is bent by 11 degrees."""

    @jax.jit
    def made():
        found = {}
        for name, loads in LOADS.items():
            link = make(3, fence(second_order=loads))
            amplitude = vibration(link, scale=-1.0).amplitude
            shape = link.shape(jnp.asarray(PLACE))
            followed = link.followed(shape, amplitude).with_friction(jnp.asarray(RATIO))
            found[name] = link, shape, followed, amplitude
        return found

    return made()


def test_loads_are_the_virtual_work_of_the_force(bent):
    # -Q_i / N = (n - rho t) . dU / dq_i + rho integral of (h / 2) phi_i'', U on the chords: to
    # round-off of differences of the nodes.
    link, shape, _, amplitude = bent["all"]
    moved = jax.jit(jax.jacfwd(lambda q: link._chain(shape.place, q)))(amplitude)
    slope = float(sum(a * b for a, b in zip(shape.slope, amplitude, strict=True)))
    assert 0.08 < abs(slope) < 0.3
    x, y = (np.array(part) for part in moved)
    phi = np.array(shape.deflection)
    # The curvature of the cubics by their slope, in 4000 slices; h is straight along a chord here,
    # off by Delta^2 / (8 l_p^2) of itself near the root and more towards the tip.
    x = RIGID + SHARE * LENGTH * (np.arange(4000) + 0.5) / 4000
    bend = jax.jit(jax.vmap(jax.jacfwd(lambda p: link.shape(p).slope)))(x)
    halves = 0.025 * np.sqrt(1 - (x - RIGID) / LENGTH)
    moments = RATIO * np.array([np.sum(halves * b) * SHARE * LENGTH / 4000 for b in bend])
    x = np.array(moved[0])
    more = {
        "moment": moments,
        "force": -RATIO * (np.cos(slope) * x + np.sin(slope) * y),
        "normal": np.cos(slope) * y - np.sin(slope) * x - phi,
    }
    more["all"] = sum(more.values())
    for name, expected in more.items():
        _, shape, followed, _ = bent[name]
        found = np.array(followed.load) - np.array(shape.load)
        error = 1e-9 if name in ("force", "normal") else 2e-3
        allowed = error * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=allowed, err_msg=name)
    # And its moment about the hinge is that of the force at U.
    place = np.array(link._chain(shape.place, amplitude))
    along, across = np.sin(slope) + RATIO * np.cos(slope), np.cos(slope) - RATIO * np.sin(slope)
    arm = across * place[0] + along * place[1]
    assert float(bent["all"][2].arm) == pytest.approx(arm, rel=1e-12)
    # None of them is no state.
    assert make(1, fence(second_order=fj.SecondOrderLoads(False, False, False))).section is None


def test_bending_moment_under_a_static_load(bent):
    # E I w'' = -N times the lever of the force about the section, which is exact with any number of
    # modes: (x_U - x) across + (y_U - y) along, and rho h / 2 of the section more up to U.
    load = 400.0
    link, shape, followed, amplitude = bent["all"]
    still = tuple(
        -load * phi / (link.mass_scale * value)
        for phi, value in zip(followed.load, link.frequency_squared, strict=True)
    )
    found = link.bending_stress(still, (load,), (followed,)) / link.stress_scale
    along_link = jax.jit(jax.vmap(lambda place: link._chain(place, amplitude)))
    x, y = np.array(along_link(jnp.append(RIGID + link.stations, shape.place)))
    (x, x_u), (y, y_u) = ((part[:-1], part[-1]) for part in (x, y))
    slope = float(sum(a * b for a, b in zip(shape.slope, amplitude, strict=True)))
    along, across = np.sin(slope) + RATIO * np.cos(slope), np.cos(slope) - RATIO * np.sin(slope)
    face = 0.025 * np.sqrt(1 - np.arange(ELEMENTS) / ELEMENTS)
    lever = across * (x_u - x) + along * (y_u - y) + RATIO * face
    inside = np.arange(ELEMENTS) / ELEMENTS < SHARE
    # Beyond the lever of a straight fence, to round-off of the sum over the modes.
    np.testing.assert_allclose(found[inside], -load * lever[inside], rtol=1e-9, atol=1e-9 * load)
    np.testing.assert_allclose(found[~inside], 0, atol=1e-9 * load)


@pytest.mark.parametrize(
    ("taper", "exact"),
    [
        (fj.ConstantStrength(), lambda x: 2 * (1 - np.sqrt(1 - x))),
        (fj.Uniform(), lambda x: x),
    ],
)
def test_shear_compliance(taper, exact):
    # c = integral of 1 / (k G z h) from the root, to round-off: of these g^2 is straight.
    shear = fj.Shear(poissons_ratio=0.3, coefficient=0.8)
    link, bare = make(2, fence(taper, shear=shear)), make(2, fence(taper))
    scale = LENGTH * 2 * (1 + 0.3) / (0.8 * 2.2e9 * 0.12 * 0.05)
    for share in (0.0, 0.41, 0.83):
        place = jnp.asarray(RIGID + share * LENGTH)
        with_shear, without = link.shape(place), bare.shape(place)
        for name in ("residual", "residual_tip"):
            more = float(getattr(with_shear, name) - getattr(without, name))
            assert more == pytest.approx(scale * exact(share), rel=1e-9, abs=1e-9 * scale)
        mode = with_shear.residual_mode[0]
        assert float(mode**2) == pytest.approx(float(with_shear.residual), rel=1e-6, abs=1e-15)
    # sqrt(c) and its derivative, where no modes are left out.
    whole = make(2, fence(taper, shear=shear), static_correction=False)
    mode, slope = jax.jvp(
        lambda p: whole.shape(p).residual_mode[0], (jnp.asarray(PLACE),), (jnp.asarray(1.0),)
    )
    _, given_slope = whole.shape(jnp.asarray(PLACE)).residual_mode
    assert float(given_slope) == pytest.approx(float(slope), rel=1e-6)
    # Infinitely stiff, it is not there; the share of shear is a small one.
    stiff = make(2, fence(taper, shear=fj.Shear(coefficient=1e12)))
    now = stiff.shape(jnp.asarray(PLACE))
    assert float(now.residual) == pytest.approx(float(bare.shape(now.place).residual), rel=1e-9)
    assert float(now.left_out) == float(bare.shape(now.place).residual)
    assert float(mode) ** 2 < 0.2 * (SHARE * LENGTH) ** 3 / (3 * ROOT_STIFFNESS)


def test_impact_against_the_independent_version():
    # As much as the arc is off the chords, at R = 1.08 m 7e-4, and the shear of a corner that
    # slides, near the joint. Derivatives: the friction reverses near the peak at R = 1.0 m.
    peak, tip, slope, unbalanced = compared("all", "arc")
    assert peak < 1e-3
    assert tip < 1e-3
    assert slope < 1e-2
    assert unbalanced < 2e-4


def test_record_is_converged():
    for known in json.loads(FILE.read_text(encoding="utf-8")).values():
        for slope, error in known["slopes"].values():
            assert error < 1e-3 * abs(slope)


def test_they_are_described_named_and_refused():
    sorter = fj.Sorter(fence={"shear": {"poissons_ratio": 0.35}, "second_order": True})
    assert sorter.fence.second_order.normal_force
    sort = sorter.replace(free={"poissons_ratio": (0.3, 0.45)}).scene()
    assert fj.scene_numbers.resolve(sort, "shear_coefficient") == "fence.shear.coefficient"
    with pytest.raises(ValueError, match="must be 'modal' for a fence with"):
        fj.simulate(sort, fidelity=fj.Fidelity(integrator="tsit5"))
    with pytest.raises(ValueError, match="`poissons_ratio` must be at most 0.5"):
        fj.Shear(poissons_ratio=0.6)
    with pytest.raises(TypeError, match="must be True or False"):
        fj.SecondOrderLoads(friction_moment=1)
