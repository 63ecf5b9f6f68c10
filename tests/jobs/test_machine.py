"""The sorter that a job is for: one vocabulary for every job."""

import numpy as np
import pytest

import fencejax as fj
from fencejax.scenes import numbers as scene_numbers
from optimize.common import machine
from optimize.identify.configuration import IdentifyConfig
from optimize.sensitivity.configuration import SensitivityConfig
from optimize.sweep.configuration import SweepConfig

HUB = dict(sorter="parcel_hub")


def read(scene, *names):
    return [float(number) for number in scene_numbers.read(scene, names)]


def test_a_sweep_of_a_sorter():
    sweep = SweepConfig(
        scene="whole_sort", vary=("mass=1:30:3",), set=("offset=50 mm", "fence.material=POM"), **HUB
    ).sweep()
    scene = sweep.family.scene(np.array([7.0]))
    found = read(scene, "mass", "offset", "belt_speed", "reach", "density", "length")
    assert found == pytest.approx([7, 0.05, 2.5, 1.0, 1410, 0.6])
    with pytest.raises(ValueError, match="`fence` must be left out where a sorter file is given"):
        SweepConfig(fence="one_link", **HUB)
    # Without a sorter file the names are the same.
    plain = SweepConfig(vary=("mass=1:30:3",), set=("distance=900 mm",)).sweep()
    assert read(plain.family.scene(np.array([7.0])), "distance") == [0.9]


def test_a_sensitivity_study_of_a_sorter():
    config = SensitivityConfig(scene="whole_sort", set=("mass=5 kg", "mass=30,offset=0.1"), **HUB)
    scene = config.base()
    assert read(scene, "belt_speed", "width") == [2.5, 0.2]
    places = config.places(scene)
    assert list(places) == ["mass=5 kg", "mass=30 kg,offset=0.1 m"]
    assert list(places.values()) == [{"mass": 5.0}, {"mass": 30.0, "offset": 0.1}]
    wall = SensitivityConfig(scene="rigid_wall", **HUB).base()
    assert isinstance(wall, fj.NormalScene)
    assert read(wall, "mass") == [0.5]


def test_identification_on_a_sorter():
    config = IdentifyConfig(records=("a.csv",), set=("distance=0.9,mass=12 kg",), **HUB)
    scene = config.base(config.numbers(0), 0.1)
    assert read(scene, "distance", "mass", "belt_speed") == [0.9, 12, 2.5]


@pytest.mark.parametrize(
    "text", ["mass=heavy", "mass", "mass=2 m", "fence.thickness=45", "mass=1,mass=2"]
)
def test_what_cannot_be_set(text):
    with pytest.raises(ValueError, match="`set`|`mass`"):
        machine.numbers("set", text)
