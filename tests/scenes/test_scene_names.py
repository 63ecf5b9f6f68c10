"""One table of names: setting and reading a number by name refer to the same number."""

import jax
import numpy as np
import pytest

import fencejax as fj
from fencejax.scenes import names as scene_names, numbers as scene_numbers
from fencejax.study import SceneFamily, scene_family, scene_groups
from optimize.sensitivity.configuration import RANGES, SCENES

DRIVES = {
    "harmonic": fj.HarmonicDrive(),
    "held": fj.HeldDrive(0.0),
    "constant_speed": fj.ConstantSpeedDrive(),
    "trapezoid": fj.TrapezoidDrive(),
    "s_curve": fj.SCurveDrive(),
    "spline": fj.SplineDrive([0.2, 0.5, 0.2]),
    "torque": fj.TorqueDrive([60.0, -60.0]),
    "pneumatic": fj.PneumaticDrive(),
}


def scenes():
    """Scenes in which every number of the table occurs, by a title."""
    found = {name: fj.scenes.whole_sort(drive=drive) for name, drive in DRIVES.items()}
    found["touch"] = fj.scenes.oblique_impact(parcel=fj.Parcel(inertia=0.3))
    found["turned"] = fj.scenes.oblique_impact(parcel_angle=0.1, velocity=(2.0, 0.0, 0.0))
    found["free"] = fj.scenes.free_motion()
    fence = fj.Fence(
        pad=fj.Pad(), shaft=fj.Shaft(slip_torque=500.0), rest_shape=fj.RestShape(0.03),
        edge_radius=0.005, shear=fj.Shear(),
    )
    found["normal"] = fj.scenes.normal_impact(fence=fence)
    return found


@pytest.mark.parametrize("kind", scene_family.KINDS)
@pytest.mark.parametrize("drive", DRIVES)
def test_what_a_sweep_sets_is_what_is_read(kind, drive):
    # Every number at the middle of its bounds, the two lengths by their sum and ratio; whether such
    # a scene can be is another question.
    names = SceneFamily(kind, [], drive=DRIVES[drive], duration=0.1).known
    names = [name for name in names if name not in ("rigid_length", "flexible_length")]
    values = []
    for name in names:
        known = scene_family.VARIABLES.get(name.partition("[")[0])
        values.append(0.25 if known is None else 0.5 * (known.lower + known.upper))
    family = SceneFamily(kind, names, drive=DRIVES[drive], duration=0.1)
    # Traced numbers are not checked against each other.
    read = jax.jit(lambda v: scene_numbers.read(family.scene(v), names))(np.array(values))
    np.testing.assert_allclose(read, values, rtol=1e-14)


def test_a_family_takes_the_options_of_its_scene_and_checks_the_rest_shape():
    wall = fj.surfaces.Deflector(angle=0.3, length=0.5, hinge_x=2.0, hinge_y=0.5)
    family = SceneFamily(
        "whole_sort", "mass", options={"tip_contact": False, "surfaces": (wall,)}, duration=1.0
    )
    scene = family.scene([8.0])
    assert not scene.tip_contact
    assert scene.surfaces == (wall,)
    with pytest.raises(ValueError, match="`options` must be one of .*tip_contact"):
        SceneFamily("whole_sort", "mass", options={"fence": None})
    curved = fj.Fence(rest_shape=fj.RestShape(tip=0.05))
    with pytest.raises(ValueError, match="`rest_shape.steepness` must be at most"):
        SceneFamily("oblique_impact", "rest_tip", fence=curved).scene([3.0])


def test_every_number_of_the_table_is_in_a_scene():
    paths = {path for scene in scenes().values() for path in scene_numbers.names(scene)}
    vectors = {scene_names.element(path)[0] for path in paths}
    for number in scene_names.NUMBERS:
        assert number.path in {*paths, *vectors, *scene_names.DERIVED}, number.path


def test_a_name_is_one_number_of_a_scene():
    for title, scene in scenes().items():
        known = scene_numbers.names(scene)
        for name, paths in scene_names.PATHS.items():
            found = [path for path in paths if path in known]
            assert len(found) <= 1, (title, name)
            if found:
                assert scene_numbers.resolve(scene, name) == found[0]
                assert scene_numbers.short(scene, found[0]) == name


def test_fidelities_are_chosen_for_the_same_numbers():
    for scene in scenes().values():
        known = scene_numbers.names(scene)
        names = [n for n, paths in scene_names.PATHS.items() if set(paths) & set(known)]
        (group,) = scene_groups.grouped(scene, names)
        found = [float(leaf) for leaf in group.read(scene)]
        np.testing.assert_array_equal(found, np.array(scene_numbers.read(scene, names)))


def test_speed_is_differentiated_by_default_where_it_is_the_parcels():
    for title, expected in (("normal", True), ("constant_speed", False)):
        groups = scene_groups.grouped(scenes()[title], None)
        assert ("speed" in scene_groups.names(groups, None)) == expected
        assert len(groups[0].chosen) == len(scene_groups.names(groups, None))


def test_bounds_and_ranges_have_the_tables_units_and_signs():
    made = [getattr(fj.scenes, name)() for name in SCENES]
    for name, variable in RANGES.items():
        units = set()
        for scene in made:
            if not scene_numbers.has(scene, name):
                continue
            units.add(scene_numbers.number(scene, name).unit)
            scene_numbers.check(scene, name, variable.lower)
        assert units == {variable.unit}, name
    for number in scene_names.NUMBERS:
        if number.lower is not None and number.sign:
            assert number.lower > 0 or (number.lower == 0 and number.sign == scene_names.LEAST)


def test_the_table_asks_for_no_more_than_any_drive_does():
    asked = {None: 0, scene_names.LEAST: 1, scene_names.ABOVE: 2}
    for number in scene_names.DRIVE:
        name = number.path.removeprefix("drive.")
        found = [d.bounds[name] for d in map(type, DRIVES.values()) if name in d.bounds]
        signs = [
            scene_names.ABOVE if b.above == 0 else scene_names.LEAST if b.least == 0 else None
            for b in found
        ]
        assert {b.unit for b in found} == {number.unit}, name
        assert asked[number.sign or None] == min(asked[sign] for sign in signs), name


@pytest.mark.parametrize(
    ("drive", "name"),
    [
        ("constant_speed", "speed"),
        ("constant_speed", "end_angle"),
        ("trapezoid", "acceleration"),
        ("s_curve", "jerk"),
        ("spline", "turn"),
    ],
)
def test_what_a_drive_refuses_is_refused_by_name(drive, name):
    fields = {k: v for k, v in vars(DRIVES[drive]).items() if hasattr(v, "ndim")}
    with pytest.raises(ValueError, match=rf"`{name}` must be"):
        type(DRIVES[drive])(**(fields | {name: 0.0}))
    with pytest.raises(ValueError, match=rf"`{name}` must be above 0"):
        scene_numbers.check(fj.scenes.whole_sort(drive=DRIVES[drive]), name, 0.0)


@pytest.mark.parametrize("path", ["fence.hue", "reach.more", "mass"])
def test_a_path_that_no_scene_has(path):
    with pytest.raises(ValueError, match="must be the path"):
        scene_names.at(path)
