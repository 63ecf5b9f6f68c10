"""The numbers of a scene by name: units, places, and names that cannot be."""


import numpy as np
import pytest

import fencejax as fj
from fencejax.parts import dimension
from fencejax.scenes import numbers as scene_numbers

SCENES = {
    "oblique_impact": lambda: fj.scenes.oblique_impact(velocity=(2.0, 0.0, 0.0)),
    "whole_sort": lambda: fj.scenes.whole_sort(
        drive=fj.SplineDrive([0.1, 0.4, 0.1]), fence=fj.Fence(taper=fj.PowerTaper(0.4))
    ),
    "free_motion": lambda: fj.scenes.free_motion(fence=fj.Fence()),
    "normal_impact": lambda: fj.scenes.normal_impact(),
    "rigid_wall": lambda: fj.scenes.rigid_wall(parcel=fj.Parcel(inertia=0.3)),
}


@pytest.mark.parametrize("kind", SCENES)
def test_every_number_has_a_name_a_unit_and_a_place(kind):
    scene = SCENES[kind]()
    paths = scene_numbers.names(scene)
    short = [scene_numbers.short(scene, path) for path in paths]
    assert [scene_numbers.resolve(scene, name) for name in short] == list(paths)
    assert all(len(dimension(scene_numbers.number(scene, path).unit)) == 3 for path in paths)
    numbers = np.asarray(scene_numbers.values(scene))
    again = scene_numbers.values(scene_numbers.with_values(scene, numbers))
    np.testing.assert_array_equal(again, numbers)
    # One number at a time, each way of replacing it, and nothing else moves.
    for k, name in enumerate(short):
        moved = np.where(np.arange(len(paths)) == k, numbers + 0.25, numbers)
        replaced = scene_numbers.replace(scene, [name], [np.asarray(moved[k])])
        np.testing.assert_array_equal(scene_numbers.values(replaced), moved)
        np.testing.assert_array_equal(
            scene_numbers.vary(scene, [name], [[moved[k]]]), moved[None]
        )
        assert float(scene_numbers.read(replaced, [name])[0]) == moved[k]


def test_derived_lengths():
    scene = fj.scenes.normal_impact()
    names = ["reach", "length_ratio"]
    moved = scene_numbers.replace(scene, names, [1.5, 0.25])
    assert float(moved.fence.rigid_length) == pytest.approx(0.3)
    assert float(moved.fence.flexible_length) == pytest.approx(1.2)
    lanes = scene_numbers.vary(scene, names, [[1.5, 0.25]])
    np.testing.assert_allclose(lanes[0], scene_numbers.values(moved), rtol=1e-15)
    assert scene_numbers.named(scene, names, lanes)[0] == pytest.approx([1.5, 0.25])
    # Chain rule: of l_s alone dQ = 1; l_s = reach ratio / (1 + ratio).
    slopes = np.array(
        [[[float(n == "fence.rigid_length") for n in scene_numbers.names(scene)]]]
    )
    found = scene_numbers.slopes_in(scene, names, lanes, slopes)[0, 0]
    assert found == pytest.approx([0.25 / 1.25, 1.5 / 1.25**2])


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (["nonsense"], "one of"),
        (["kinetic"], "tell apart"),
        (["thickness", "fence.thickness"], "twice"),
        (["reach", "rigid_length"], "twice"),
        ([], "empty"),
    ],
)
def test_names_that_cannot_be(names, text):
    with pytest.raises(ValueError, match=text):
        scene_numbers.together(fj.scenes.whole_sort(), names)


def test_values_that_cannot_be():
    scene = fj.scenes.oblique_impact()
    for name, value in (
        ("mass", 0.0), ("distance", 1.3), ("fence_kinetic_friction", -0.1), ("thickness", np.nan),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=name):
            scene_numbers.check(scene, name, value)
