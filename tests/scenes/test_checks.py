"""Inputs are checked on the host: the message names the field, its value and the bound."""

from fractions import Fraction

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax import (
    Belt,
    Fence,
    Fidelity,
    Friction,
    Material,
    Parcel,
    PowerTaper,
    ProfileTaper,
    SplineDrive,
    _check,
    scenes,
)

# --- Numbers ------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [1, 1.5, np.float32(1.5), np.int64(2), np.array(1.5), True + 1])
def test_real_numbers_become_floating_arrays(value):
    array = _check.scalar("size", value)
    assert isinstance(array, jax.Array)
    assert jnp.issubdtype(array.dtype, jnp.floating)
    assert float(array) == float(value)


def test_type_of_floating_arrays_is_kept():
    assert _check.scalar("size", np.float32(1.5)).dtype == jnp.float32
    assert _check.scalar("size", 3).dtype == jnp.float64


@pytest.mark.parametrize(
    "value",
    ["1.0", b"1", None, 1j, np.complex128(1), True, np.bool_(True), object(), Fraction(1, 2), {}],
    ids=lambda value: type(value).__name__,
)
def test_other_things_are_refused(value):
    with pytest.raises(TypeError, match=r"`size` \[m\] must be a real number"):
        _check.scalar("size", value, unit="m")


@pytest.mark.parametrize(
    ("value", "bounds", "text"),
    [
        (np.nan, {}, "must be finite [m], but is nan"),
        (np.inf, {}, "must be finite [m], but is inf"),
        (-np.inf, {"least": 0}, "must be finite [m], but is -inf"),
        (0.0, {"above": 0}, "must be above 0 [m], but is 0"),
        (-2.5, {"above": 0}, "must be above 0 [m], but is -2.5"),
        (-0.5, {"least": 0}, "must be at least 0 [m], but is -0.5"),
        (1.25, {"least": 0, "most": 1}, "must be at most 1 [m], but is 1.25"),
        (np.array([0.5, 3.0, 2.0]), {"most": 1}, "must be at most 1 [m], but is 3"),
    ],
)
def test_numbers_out_of_bounds_are_refused(value, bounds, text):
    with pytest.raises(ValueError, match="Argument `size`") as error:
        _check.scalar("size", value, unit="m", remedy="Write 0.5.", **bounds)
    assert text in str(error.value)
    assert str(error.value).endswith("Write 0.5.")


def test_bounds_themselves_belong_where_they_should():
    assert float(_check.scalar("size", 0, least=0)) == 0
    assert float(_check.scalar("size", 1, most=1)) == 1


@pytest.mark.parametrize("transform", [jax.jit, jax.vmap, jax.grad])
def test_traced_values_pass(transform):
    # A traced number has no value to look at: whatever it is, it goes through.
    def build(x):
        return jnp.sum(_check.scalar("size", -x, above=0))

    value = jnp.array([1.0, 2.0]) if transform is jax.vmap else 1.0
    assert np.all(np.isfinite(transform(build)(value)))


def test_traced_constructors_give_gradients():
    # m (A^2 + B^2) / 12 in A: m A / 6, through every check of the constructor.
    slope = jax.jit(jax.grad(lambda length: Parcel(mass=15, length=length).inertia))(0.4)
    np.testing.assert_allclose(slope, 15 * 0.4 / 6, rtol=1e-14)


def test_vectors():
    array = _check.vector("angles", np.array([1, 2, 3]), size_least=3)
    assert array.dtype == jnp.float64
    with pytest.raises(ValueError, match=r"`angles` must be a vector of at least 4 numbers"):
        _check.vector("angles", np.array([1.0, 2, 3]), size_least=4)
    with pytest.raises(ValueError, match=r"`angles` must be a vector"):
        _check.vector("angles", 1.0)
    with pytest.raises(ValueError, match=r"`angles` must be at least 0 \[rad\], but is -2"):
        _check.vector("angles", np.array([1.0, -2.0]), least=0, unit="rad")


def test_counts():
    assert _check.count("modes", np.int64(3)) == 3
    for value in (3.0, "3", True, None):
        with pytest.raises(TypeError, match="`modes` must be a whole number, but is"):
            _check.count("modes", value)
    with pytest.raises(ValueError, match="`modes` must be at least 1, but is 0"):
        _check.count("modes", 0, least=1)


def test_static_numbers():
    assert _check.number("step", 1) == 1.0
    for value in ("x", None, [1.0]):
        with pytest.raises(TypeError, match="`step`"):
            _check.number("step", value)
    for value in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=r"`step` must be finite and above 0 \[s\], but is"):
            _check.number("step", value, above=0.0, unit="s")
    with pytest.raises(TypeError, match="known before the program is compiled"):
        jax.jit(lambda x: _check.number("step", x))(1.0)


def test_choices():
    assert _check.choice("geometry", "small", ("small", "chord")) == "small"
    with pytest.raises(ValueError, match=r"`geometry` .*'chord'.*, but is 'round'"):
        _check.choice("geometry", "round", ("small", "chord"))


# --- Constructors -------------------------------------------------------------------------------

# (what to build, the field, an acceptable value, values refused, words of the bound)
FIELDS = [
    (Fence, "rigid_length", 0, (-0.1,), "at least 0"),
    (Fence, "flexible_length", 1, (0, -1), "above 0"),
    (Fence, "width", 1, (0,), "above 0"),
    (Fence, "thickness", 1, (0,), "above 0"),
    (Material, "youngs_modulus", 10**9, (0,), "above 0"),
    (Material, "density", 1000, (0,), "above 0"),
    (Material, "damping_ratio", 0, (-0.01,), "at least 0"),
    (Parcel, "mass", 15, (0,), "above 0"),
    (Parcel, "length", 1, (0,), "above 0"),
    (Parcel, "breadth", 1, (0,), "above 0"),
    (Parcel, "inertia", 1, (0,), "above 0"),
    (Parcel, "stiffness", 0, (-1,), "at least 0"),
    (Parcel, "damping", 0, (-1,), "at least 0"),
    (Belt, "speed", 0, (-1,), "at least 0"),
    (Belt, "width", 1, (0,), "above 0"),
    (Belt, "gravity", 0, (-9.81,), "at least 0"),
    (lambda kinetic: Friction(kinetic, 0.5), "kinetic", 0, (-0.1,), "at least 0"),
    (lambda static: Friction(0.5, static), "static", 0, (-0.1,), "at least 0"),
    (PowerTaper, "exponent", 0, (-0.1,), "at least 0"),
    (PowerTaper, "exponent", 0.9, (1.0,), "at most 0.99"),
]


@pytest.mark.parametrize(
    ("build", "field", "good", "bad", "words"), FIELDS, ids=[f"{f[1]}-{f[4]}" for f in FIELDS]
)
def test_each_field_is_checked(build, field, good, bad, words):
    build(**{field: good})
    for value in bad:
        with pytest.raises(ValueError, match=f"`{field}` must be {words} ") as error:
            build(**{field: value})
        assert f"but is {value:g}" in str(error.value)
    with pytest.raises(ValueError, match=f"`{field}` must be finite"):
        build(**{field: np.nan})
    for value in ("0.5", 1j, True):
        with pytest.raises(TypeError, match=f"`{field}`"):
            build(**{field: value})


@pytest.mark.parametrize("field", ["center_x", "center_y"])
def test_the_centre_of_gravity_lies_inside(field):
    Parcel(length=0.4, breadth=0.4, **{field: -0.2})
    with pytest.raises(ValueError, match=f"{field}.* must be at most 1 .*inside the rectangle"):
        Parcel(length=0.4, breadth=0.4, **{field: 0.21})


def test_vectors_of_constructors():
    with pytest.raises(ValueError, match="`ratios` must be above 0"):
        ProfileTaper(np.array([1.0, 0.0]))
    with pytest.raises(ValueError, match="`ratios` must be a vector of at least 2"):
        ProfileTaper(np.array([1.0]))
    with pytest.raises(ValueError, match="`control_angles` must be a vector"):
        SplineDrive(0.3)


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"elements": 0}, ValueError, "`elements` must be at least 1"),
        ({"elements": 2.0}, TypeError, "`elements` must be a whole number"),
        ({"elements": 100_000}, ValueError, "`elements` must be at most 1000, but is 100000. The"),
        ({"halvings": 1000}, ValueError, "`halvings` must be at most 30, but is 1000"),
        ({"longest_stride": 2**60}, ValueError, "`longest_stride` must be at most 1048576, but is"),
        ({"modes": -1}, ValueError, "`modes` must be at least 0"),
        ({"modes": 41}, ValueError, "`modes` must be at most 2 `elements` = 40, but is 41"),
        ({"iterations": 0}, ValueError, "`iterations` must be at least 1"),
        ({"step": 0.0}, ValueError, "`step` must be finite and above 0"),
        ({"slip_speed": -1.0}, ValueError, "`slip_speed`"),
        ({"static_speed": 0.0}, ValueError, "`static_speed`"),
        ({"tip_fade": 0.0}, ValueError, "`tip_fade`"),
        ({"tolerance": np.nan}, ValueError, "`tolerance`"),
        ({"geometry": "round"}, ValueError, "`geometry` must be one of"),
        ({"integrator": "euler"}, ValueError, "`integrator` must be one of"),
        ({"gradient": "sideways"}, ValueError, "`gradient` must be one of"),
    ],
)
def test_fidelity_is_checked(changes, error, text):
    with pytest.raises(error, match=text):
        Fidelity(**changes)
    with pytest.raises(error, match=text):
        Fidelity().replace(**changes)


def test_a_history_that_does_not_fit_into_memory_is_refused(monkeypatch):
    # 240 samples of some thirty numbers.
    monkeypatch.setattr(_check, "_memory", lambda: 1e3)
    with pytest.raises(ValueError, match="`step` must ask for samples that fit into memory") as no:
        fj.simulate(scenes.rigid_wall(duration=0.019))
    assert str(no.value).endswith("Raise `step`, or write history=False.")
    assert "\n" not in str(no.value)


def test_steps_that_single_precision_cannot_count_are_refused():
    with jax.enable_x64(False):
        scene = scenes.rigid_wall()
        with pytest.raises(ValueError, match=r"2\^`fidelity.halvings` must be at most 16777216"):
            fj.simulate(scene, fidelity=Fidelity(halvings=30))


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: scenes.oblique_impact(distance=1.3), "`distance` must be at most 1.2"),
        (lambda: scenes.oblique_impact(distance=-0.1), "`distance` must be at least 0"),
        (lambda: scenes.oblique_impact(drive_angle=0.7), "`drive_angle` must be at most 0.66"),
        (lambda: scenes.oblique_impact(corner=5), "`corner` must hold corners 1 ... 4"),
        (lambda: scenes.oblique_impact(duration=0.0), "`duration` must be finite and above 0"),
        (lambda: scenes.border_and_fence(fence_corner=2), "`fence_corner` and `border_corner`"),
        (lambda: scenes.border_and_fence(drive_angle=0.6), "does not span"),
        # Where a straight fence's point is as high as the parcel reaches, a curved one's is higher.
        (lambda: scenes.border_and_fence(
            fence=fj.Fence(rest_shape=fj.RestShape(tip=0.06, middle=0.02)), distance=1.15,
            drive_angle=0.345), "does not span"),
        (lambda: scenes.whole_sort(offset=-0.1), "`offset` must be at least 0"),
        (lambda: scenes.whole_sort(fence_corners=(0,)), "`fence_corners` must hold corners"),
        (lambda: scenes.oblique_impact(fence_corners=(2, 3)), "must hold corner 1, which"),
        (lambda: scenes.rigid_wall(speed=np.nan), "`speed` must be finite"),
        (
            lambda: scenes.oblique_impact(velocity=(2.0, np.nan, 0.0)),
            r"`velocity y` must be finite \[m/s\], but is nan",
        ),
        (
            lambda: scenes.oblique_impact(velocity=(2.0, 0.0, np.inf)),
            r"`velocity spin` must be finite \[rad/s\], but is inf",
        ),
        (
            lambda: scenes.free_motion(drive=fj.HarmonicDrive()),
            "`drive` must come with a `fence`, which it swings, but is HarmonicDrive",
        ),
    ],
)
def test_scenes_are_checked(build, text):
    with pytest.raises(ValueError, match=text):
        build()


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: scenes.oblique_impact(velocity=(1.0, 2.0)), r"`velocity` must be 3 numbers"),
        (lambda: scenes.free_motion(velocity=(1, 2, 3, 4)), r"`velocity` must be 3 numbers"),
        (lambda: scenes.free_motion(position=(1,)), r"`position` must be 2 numbers \(x, y\)"),
        (lambda: scenes.free_motion(position=0.3), "`position` must be a sequence"),
        (lambda: scenes.oblique_impact(fence_corners=2), "`fence_corners` must be a sequence"),
        (lambda: scenes.oblique_impact(corner=True), "`corner` must be a whole number"),
        (lambda: scenes.oblique_impact(corner=jnp.asarray(2)), "`corner` must be a whole number"),
        (lambda: fj.simulate(scenes.rigid_wall(), only=3), "`only` must be a sequence of names"),
        (lambda: fj.Fidelity(static_correction=3), "`static_correction` must be True or False"),
        (
            lambda: fj.minimize(lambda z: z @ z, [0.5]),
            r"`problem\(z\)` must be a sequence of results \(objectives, margins",
        ),
        (
            lambda: jax.jit(fj.simulate_many)(jax.vmap(_wall)(jnp.ones(2))),
            "`scenes` must hold concrete numbers",
        ),
    ],
)
def test_what_is_no_such_thing_is_refused_by_name(build, text):
    with pytest.raises((TypeError, ValueError), match=text):
        build()


def _wall(speed):
    return scenes.rigid_wall(speed=speed)


def test_a_scene_is_made_inside_a_program_with_parts_of_numbers():
    swing, push = fj.HarmonicDrive(), fj.TorqueDrive([60.0])
    fence = fj.Fence(rest_shape=fj.RestShape(0.01, 0.0))

    def mass(value):
        parcel = fj.Parcel(mass=value)
        fj.scenes.oblique_impact(fence=fence, drive=push, drive_angle=0.2, duration=0.1)
        fj.scenes.whole_sort(fence=fence, drive=swing, front=0.1, duration=1.0)
        return fj.scenes.oblique_impact(parcel=parcel, drive=swing, duration=0.1).parcel.mass

    assert jax.jit(mass)(3.0) == 3.0


def test_a_scene_is_made_within_a_program_that_traces_some_of_its_numbers():
    # What is known is checked on the host, what is traced is not, whatever else is.
    def start(mass):
        parcel = eqx.tree_at(lambda parcel: parcel.mass, fj.Parcel(), mass)
        for angle in (None, 0.5):
            scene = fj.scenes.oblique_impact(parcel=parcel, parcel_angle=angle)
        return scene.parcel.mass + scene.start.place

    assert float(jax.jit(start)(2.0)) == 3.0
