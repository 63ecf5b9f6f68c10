"""The points and scenes of a sweep, and which of these are possible."""

import dataclasses

import jax
import numpy as np
import pytest

import fencejax as fj
from fencejax.study import SceneFamily, Sweep, sampling, scene_family

# ---- points


def test_grid_runs_through_all_combinations():
    mass = sampling.variable("mass", 1.0, 100.0)
    found = sampling.grid([mass, sampling.variable("distance", 0.5, 1.0)], (3, 2))
    assert found.shape == (3, 2)
    expected = [[1, 0.5], [1, 1], [10, 0.5], [10, 1], [100, 0.5], [100, 1]]
    np.testing.assert_allclose(found.values, expected, rtol=1e-14)
    # Bounds are met exactly: what lies beyond them may be no scene.
    assert found.values[:, 0].max() <= 100.0
    assert found.values[:, 0].min() == 1.0


@pytest.mark.parametrize("lay", [sampling.latin_hypercube, sampling.sobol])
def test_each_slice_of_each_variable_holds_one_point(lay):
    count = 32
    found = lay(["mass", "distance", "thickness"], count, seed=5)
    assert found.values.shape == (count, 3)
    for variable, column in zip(found.variables, found.values.T, strict=True):
        if variable.scaling == "linear":
            share = (column - variable.lower) / (variable.upper - variable.lower)
        else:
            share = np.log(column / variable.lower) / np.log(variable.upper / variable.lower)
        assert sorted(np.floor(share * count).astype(int)) == list(range(count))
    again = lay(["mass", "distance", "thickness"], count, seed=5)
    np.testing.assert_array_equal(again.values, found.values)
    other = lay(["mass", "distance", "thickness"], count, seed=6)
    assert np.all(other.values != found.values)


def test_sobol_fills_the_square_evenly():
    # Scrambling keeps a (t, m, 2)-net: of 64 points, each 8 x 8 box holds one (t = 0 in 2-D).
    found = sampling.sobol([sampling.variable("distance", 0, 1), sampling.variable("turn", 0, 1)],
                           64, seed=1)  # fmt: skip
    boxes = np.floor(8 * found.values).astype(int)
    assert len({tuple(box) for box in boxes}) == 64


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: sampling.sobol(["mass"], 1000), "power of two.*Write 512 or 1024"),
        (lambda: sampling.grid(["mass", "mass"], 3), "must not repeat a name"),
        (lambda: sampling.grid(["mass"], 1), "`counts` must be at least 2.*`fixed`"),
        (lambda: sampling.grid(["mass"], (3, 3)), r"a number for each of \['mass'\].*holds 2"),
        (lambda: sampling.grid([], 3), "at least one name"),
        (lambda: sampling.variable("hue"), "`hue` must be given bounds"),
        (lambda: sampling.variable("mass", 0.0, 1.0), "`mass.lower` must be.* above 0"),
        (lambda: sampling.variable("mass", 2.0, 1.0), "`mass.lower` must be below"),
        (lambda: sampling.latin_hypercube(["mass"], 0), "`count` must be at least 1"),
        (lambda: sampling.given({"mass": [1.0, np.nan]}), "must be finite"),
        (lambda: sampling.given({"mass": [1.0, 1.0]}), "must vary"),
        (lambda: sampling.given({"mass": [1.0], "angle": [0, 1]}), "columns of one length"),
    ],
)
def test_bad_points_are_refused(make, text):
    with pytest.raises(ValueError, match=text):
        make()


@pytest.mark.parametrize(
    "sampled",
    [
        lambda: sampling.grid(["mass", "distance"], 10**9),
        lambda: sampling.latin_hypercube(["mass"], 10**15),
        lambda: sampling.sobol(["mass"], 2**60),
    ],
)
def test_more_points_than_fit_into_memory_are_refused_before_they_are_made(sampled):
    """2 x 8 x 10^18, 8 x 10^15 and 8 x 2^60 bytes: above any machine's."""
    with pytest.raises(ValueError, match="must ask for points that fit into memory, but .* GB"):
        sampled()


# ---- scenes by name


def changed(kind, name, drive=None):
    """Leaves of a scene that change with a named number, by their place in it."""
    family = SceneFamily(kind, [name], drive=drive, duration=0.1)
    known = scene_family.VARIABLES.get(name.partition("[")[0])
    lower, upper = (0.6, 0.8) if known is None else (known.lower, known.upper)
    middle = 0.5 * (lower + upper)
    scenes = [family.scene([value]) for value in (middle, 0.9 * middle + 0.1 * upper)]
    old, new = (jax.tree_util.tree_flatten_with_path(scene)[0] for scene in scenes)
    pairs = zip(old, new, strict=True)
    return {jax.tree_util.keystr(p) for (p, a), (_, b) in pairs if not np.array_equal(a, b)}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("thickness", {".fence.thickness"}),
        ("reach", {".fence.rigid_length", ".fence.flexible_length"}),
        ("youngs_modulus", {".fence.material.youngs_modulus"}),
        ("top_speed", {".drive.top_speed"}),
        ("mass", {".parcel.mass"}),
        ("stiffness", {".parcel.stiffness"}),
        ("belt_speed", {".belt.speed"}),
        ("gravity", {".belt.gravity"}),
        ("belt_static_friction", {".belt.friction.static"}),
        ("fence_kinetic_friction", {".fence_friction.kinetic"}),
        ("border_static_friction", {".border.friction.static"}),
        ("offset", {".start.offset"}),
        ("angle", {".start.angle"}),
    ],
)
def test_name_changes_its_number_alone(name, expected):
    assert changed("whole_sort", name) == expected


def test_every_name_of_every_kind_changes_something():
    for kind, own in scene_family.KINDS.items():
        names = SceneFamily(kind, []).known
        assert set(own) <= set(names)
        for name in names:
            assert changed(kind, name), (kind, name)


def test_element_of_a_free_form_drive():
    drive = fj.SplineDrive([0.2, 0.5, 0.2])
    assert changed("whole_sort", "control_angles[1]", drive) == {".drive.control_angles"}
    family = SceneFamily("whole_sort", ["control_angles[1]"], drive=drive, duration=1.36)
    found = family.scene([0.4]).drive
    assert isinstance(found, fj.SplineDrive)
    np.testing.assert_array_equal(found.control_angles, [0.2, 0.4, 0.2])


def test_numbers_of_a_taper_vary_by_path():
    fence = fj.Fence(taper=fj.SteppedTaper(fj.PowerTaper(0.5), 4))
    names = ["fence.taper.profile.exponent", "parcel.mass"]
    family = SceneFamily("oblique_impact", names, fence=fence)
    found = family.scene([0.3, 2.0])
    assert found.fence.taper.profile.exponent == 0.3
    assert found.parcel.mass == 2.0
    with pytest.raises(ValueError, match=r"profile.exponent` must be at most 0.99 \[1\]"):
        family.scene([1.2, 2.0])
    profile = fj.Fence(taper=fj.ProfileTaper([1.0, 0.8, 0.5]))
    found = SceneFamily("along_fence", ["ratios[1]"], fence=profile).scene([0.7])
    np.testing.assert_array_equal(found.fence.taper.ratios, [1.0, 0.7, 0.5])
    samples = sampling.grid([sampling.variable("fence.taper.profile.exponent", 0.2, 0.8)], 3)
    Sweep(SceneFamily("oblique_impact", samples.names, fence=fence), samples)
    samples = sampling.grid([sampling.variable("fence.taper.profile.exponent", 0.2, 1.8)], 3)
    with pytest.raises(ValueError, match="must be within the scene.*must be at most 0.99"):
        Sweep(SceneFamily("oblique_impact", samples.names, fence=fence), samples)


def test_fixed_numbers_and_parts_are_kept():
    family = SceneFamily(
        "oblique_impact",
        ["distance"],
        fixed={"mass": 3.0, "length_ratio": 0.0},
        fence=fj.Fence(width=0.2),
        options={"corner": 2},
        duration=0.2,
    )
    direct = fj.scenes.oblique_impact(
        fence=fj.Fence(rigid_length=0.0, flexible_length=1.2, width=0.2),
        parcel=fj.Parcel(mass=3.0), distance=0.9, corner=2, duration=0.2,
    )  # fmt: skip
    found = family.scene([0.9])
    assert jax.tree.structure(found) == jax.tree.structure(direct)
    pairs = zip(jax.tree.leaves(found), jax.tree.leaves(direct), strict=True)
    for a, b in pairs:
        np.testing.assert_allclose(a, b, rtol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "settings", "text"),
    [
        (("free_fall", ["mass"]), {}, "`kind` must be one of"),
        (("oblique_impact", ["offset"]), {}, "`names` must name numbers of .*holds 'offset'"),
        (("oblique_impact", ["border_static_friction"]), {}, "holds 'border_static_friction'"),
        (("oblique_impact", ["belt_speed"]), {"belt": None}, "holds 'belt_speed'"),
        (("oblique_impact", ["mass"]), {"fixed": {"mass": 2.0}}, "must not repeat a name"),
        (("oblique_impact", ["mass"]), {"options": {"angle": 2.0}}, "`options` must be one of"),
        (("whole_sort", ["cycle_time"]), {}, "`duration` .* must be given where .*cycle_time"),
    ],
)
def test_bad_names_are_refused(arguments, settings, text):
    with pytest.raises(ValueError, match=text):
        SceneFamily(*arguments, **settings)


@pytest.mark.parametrize(
    ("kind", "name", "bounds", "text"),
    [
        ("oblique_impact", "mass", (-1.0, 2.0), "`mass` must be above 0"),
        ("oblique_impact", "distance", (0.5, 1.3), "`distance` must be at most 1.2"),
        ("oblique_impact", "drive_angle", (0.1, 0.7), "The drive turns back there"),
        ("oblique_impact", "center_x", (-0.3, 0.3), "lies inside the rectangle"),
        ("whole_sort", "offset", (-0.1, 0.3), "`offset` must be at least 0"),
        ("whole_sort", "top_speed", (-2.0, 2.0), "`top_speed` must be at least 0"),
    ],
)
def test_bound_without_a_scene_is_refused(kind, name, bounds, text):
    samples = sampling.grid([sampling.variable(name, *bounds, scaling="linear")], 3)
    with pytest.raises(ValueError, match=f"`{name}` must be within the scene.*{text}"):
        Sweep(SceneFamily(kind, samples.names, duration=0.25), samples)


def test_possible_agrees_with_the_checks_of_the_scene():
    drive = fj.SCurveDrive()
    names = ["reach", "distance", "drive_angle", "acceleration", "center_y"]
    family = SceneFamily("border_and_fence", names, drive=drive)
    # Each row but the first breaks one bound.
    rows = np.array([
        [1.2, 1.0, 0.10, 8.0, 0.0],
        [0.9, 1.0, 0.10, 8.0, 0.0],
        [1.2, 1.0, 0.70, 8.0, 0.0],
        [1.2, 1.0, 0.60, 8.0, 0.0],
        [1.2, 1.0, 0.10, 20.0, 0.0],
        [1.2, 1.0, 0.10, 8.0, 0.2],
    ])  # fmt: skip
    possible = jax.jit(jax.vmap(lambda row: family.possible(family.scene(row))))(rows)
    allowed = []
    for row in rows:
        try:
            scene = family.scene(row)
            fj.SCurveDrive(**{f.name: getattr(scene.drive, f.name)
                              for f in dataclasses.fields(drive)})  # fmt: skip
            allowed.append(True)
        except ValueError:
            allowed.append(False)
    assert allowed == [True, False, False, False, False, False]
    np.testing.assert_array_equal(possible, allowed)
