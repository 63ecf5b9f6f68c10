"""The sorter that a job is for: one vocabulary for every job."""

import importlib
from pathlib import Path

import jax
import numpy as np
import pytest

import fencejax as fj
from fencejax.scenes import numbers as scene_numbers
from optimize.common import machine, pages
from optimize.common.encounters import Course, Encounter
from optimize.identify.configuration import IdentifyConfig
from optimize.peak_force.configuration import PeakForceConfig
from optimize.sensitivity.configuration import RANGES, SensitivityConfig
from optimize.sweep.configuration import SweepConfig

HUB = dict(sorter="parcel_hub")


def read(scene, *names):
    return [float(number) for number in scene_numbers.read(scene, names)]


def test_a_sorter_that_is_none_is_refused():
    message = "must be a file or one of honest, paper, parcel_hub, but is 'nosuch'"
    with pytest.raises(ValueError, match=message):
        machine.load("nosuch")


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


SHORT = """
[parcels]
mass = ["0.5 kg", "12 kg"]
[fence]
reach = "95 cm"
thickness = {lower = "4 mm", upper = "50 mm", start = "20 mm"}
material = "POM"
[belt]
speed = "4 m/s"
"""


@pytest.fixture
def short(tmp_path):
    """A sorter whose fence is shorter than the distance of the paper's impacts."""
    file = tmp_path / "short.toml"
    file.write_text(SHORT, encoding="utf-8")
    return str(file)


def test_a_fence_shorter_than_the_papers_impacts_are_far(short):
    sweep = SweepConfig(sorter=short, vary=("mass=0.5:12", "distance=0.4:0.9")).sweep()
    assert read(sweep.family.scene(np.array([5.0, 0.6])), "distance") == [0.6]
    # By default at the same share of the reach, however the reach or the distance is named.
    for given, distance in (
        ((), 0.792), (("reach=0.48",), 0.4), (("fence.reach=60 cm",), 0.5),
        (("start.place=0.7",), 0.7),
    ):  # fmt: skip
        family = SweepConfig(sorter=short, vary=("mass=0.5:12",), set=given).sweep().family
        assert read(family.scene(np.array([5.0])), "distance") == [distance]
    assert SweepConfig(sorter=short).varied == ("mass=1:30", "distance=0.396:0.871")
    assert SweepConfig(sorter=short).sweep().samples.names == ("mass", "distance")
    # No other mistake hides behind the distance.
    with pytest.raises(ValueError, match="'masss'"):
        SweepConfig(sorter=short, vary=("masss=1:2",)).sweep()
    with pytest.raises(ValueError, match="`distance` must be at most 0.95.* but is 0.96"):
        SweepConfig(sorter=short, vary=("mass=0.5:12",), set=("distance=0.96",)).sweep()
    identify = IdentifyConfig(records=("a.csv",), sorter=short, set=("distance=0.6",))
    assert read(identify.base(identify.numbers(0), 0.1), "distance") == [0.6]
    for kind in ("along_fence", "border_and_fence"):
        assert read(SensitivityConfig(scene=kind, sorter=short).base(), "distance") == [0.792]


def test_the_ranges_of_a_sensitivity_study_are_the_sorters(short):
    config = SensitivityConfig(sorter=short)
    scene = config.base()
    assert list(config.places(scene)) == ["distance=0.633 m", "distance=0.792 m"]
    assert config.line(scene) == ("distance", 0.396, 0.871)
    config.check()
    ends = {v.name: (v.lower, v.upper) for v in config.inputs(scene)}
    # A free number, the parcels, the reach's share, the number itself and the paper's range.
    assert ends["thickness"] == (0.004, 0.05)
    assert ends["mass"] == (0.5, 12)
    assert ends["distance"] == (0.554, 0.792)
    assert ends["belt_speed"] == (3.6, 4.4)
    assert ends["stiffness"] == (0.86e9, 3.44e9)
    # The paper's fence has the paper's numbers, with a sorter file and without one.
    for paper in (SensitivityConfig(), SensitivityConfig(sorter="paper")):
        scene = paper.base()
        assert list(paper.places(scene)) == ["distance=0.8 m", "distance=1 m"]
        assert paper.line(scene) == ("distance", 0.5, 1.1)
        inputs = {v.name: v for v in paper.inputs(scene)}
        assert inputs["distance"] == RANGES["distance"]
        assert inputs["belt_speed"] == RANGES["belt_speed"]
    own = SensitivityConfig()
    assert own.inputs(own.base()) == tuple(v for n, v in RANGES.items() if n not in NOT_IMPACTS)


NOT_IMPACTS = ("offset", "speed")


@pytest.mark.parametrize(
    "text", ["mass=heavy", "mass", "mass=2 m", "fence.thickness=45", "mass=1,mass=2"]
)
def test_what_cannot_be_set(text):
    with pytest.raises(ValueError, match="`set`|`mass`"):
        machine.numbers("set", text)


@pytest.mark.parametrize("job", ["co_design", "pareto", "peak_force", "robust_design"])
def test_design_jobs_take_the_machine(job):
    module = importlib.import_module(f"optimize.{job}.configuration")
    flags = ["--sorter", "parcel_hub", "--set", "belt.speed=2.2 m/s"]
    config = module.configure([*flags, "--free", "fence.thickness=10mm:40mm"])
    assert float(config.machine.belt.speed) == 2.2
    if hasattr(config, "quick"):
        # A small version takes the sorter's parcels, too.
        assert module.configure([*flags, "--quick"]).machine.parcels.count == 6
    space = config.space
    assert float(space.fence.reach) == pytest.approx(1.0)
    span = space.variables[space.names.index("fence.thickness")]
    assert (span.lower, span.upper) == (0.01, 0.04)
    bounds = {limit.name: limit.bound for limit in config.limits}
    assert bounds["tip_deflection"] == 0.06
    assert bounds["peak_torque"] == 400
    with pytest.raises(ValueError, match="`taper` must be left out where a sorter file is given"):
        module.configure([*flags, "--taper", "uniform"])
    with pytest.raises(ValueError, match="`set` must come with a sorter file"):
        assert module.configure(["--set", "belt.speed=2.2"]).machine


def test_limits_that_a_sorter_names_hold_in_the_jobs_too():
    module = importlib.import_module("optimize.co_design.configuration")
    bounds = {limit.name: limit.bound for limit in module.configure(["--sorter", "honest"]).limits}
    assert bounds == {
        "crossing": 0.1, "tip_deflection": 0.08, "peak_stress": 40e6, "peak_torque": 1000,
        "fatigue_stress": pytest.approx(19e6), "tip_share": 0.1, "clear_period": 1.5,
    }  # fmt: skip
    mean = ["--sorter", "paper", "--set", "limits.share_damaged.spread=0.2"]
    mean += ["critical_load=40", "critical_velocity_change=1.5"]
    with pytest.raises(ValueError, match="`limits.share_damaged` must be left out for this job"):
        assert module.configure(mean).limits
    # What a job has no place for is refused, and not left as it is.
    with pytest.raises(ValueError, match="must name numbers of the fence or of the SplineDrive"):
        assert module.configure(["--sorter", "honest", "--free", "belt.speed=1:2"]).space


def test_limits_of_whole_sorts_are_left_out_of_single_impacts_by_name():
    whole = {"ring_amplitude", "clear_period"}
    impacts = {"peak_force": [], "pareto": ["--scenes", "impacts"]}
    for job, flags in impacts.items():
        module = importlib.import_module(f"optimize.{job}.configuration")
        config = module.configure(["--sorter", "honest", *flags])
        names = {limit.name for limit in config.limits}
        assert not names & whole
        assert {"tip_share", "fatigue_stress"} <= names
        # What remains can be computed in the impacts; the rest is named.
        note = config.notes[-1]
        assert "NOT held" in note
        assert "--set limits.ring=false limits.clear_period=false" in note
        off = ["--set", "limits.ring=false", "limits.clear_period=false"]
        quiet = module.configure(["--sorter", "honest", *off, *flags])
        assert quiet.limits == config.limits
        assert not any("NOT held" in line for line in quiet.notes)
    module = importlib.import_module("optimize.pareto.configuration")
    sorts = module.configure(["--sorter", "honest"])
    assert whole <= {limit.name for limit in sorts.limits}
    assert not any("NOT held" in line for line in sorts.notes)


def test_a_job_says_what_of_the_sorter_it_uses(short):
    module = importlib.import_module("optimize.peak_force.configuration")
    assert module.configure([]).notes == []
    fence, parcel = module.configure(["--sorter", short]).notes
    assert fence == "the fence is of POM"
    assert "first of the sorter's 2" in parcel
    assert "no other parcel is used" in parcel
    mean = ["--sorter", short, "--set", "objective.over=cvar"]
    assert "not the sorter's own, the cvar peak_force" in module.configure(mean).notes[2]
    swept = SweepConfig(sorter=short, set=("fence.material=PA6 dry",)).notes
    assert swept[0] == "the fence is of PA6 dry"
    assert "first of the sorter's 2" in swept[1]
    assert SweepConfig().notes == []
    # A list is said to be cut short only where nothing else is set.
    file = Path(short)
    listed = SHORT.replace('{lower = "4 mm", upper = "50 mm", start = "20 mm"}', "[0.02, 0.03]")
    file.write_text(listed, encoding="utf-8")
    assert SweepConfig(sorter=short).notes[1].startswith("fence.thickness is 0.02, the first of")
    for given in (dict(set=("thickness=0.04",)), dict(vary=("fence.thickness=0.02:0.03",))):
        assert len(SweepConfig(sorter=short, **given).notes) == 2


def test_the_page_of_a_job_for_one_material_shows_no_other():
    config = importlib.import_module("optimize.peak_force.configuration").configure(
        ["--sorter", "parcel_hub"]
    )
    scene = config.machine.scene(0)
    section = pages.machine_section(config.machine, scene, config.notes, parcels=False)
    _, materials, parcel, notes = section.parts
    assert [row[0] for row in materials.rows] == ["PA6 dry"]
    assert materials.caption == "The material"
    assert ["parcel: mass", "0.5 kg"] in parcel.rows
    assert all(row[0].startswith("parcel: ") for row in parcel.rows)
    assert "The fence is of PA6 dry, the first of the sorter's 4 materials" in notes
    page = importlib.import_module("optimize.peak_force.page")
    rows = {"two-link": {"thickness": 0.03}, "optimum": {"thickness": 0.04}}
    assert page._comparison(config, rows).caption.startswith("The sorter's own fence")
    assert page._comparison(PeakForceConfig(), rows).caption.startswith("The paper's fences")
    # A job that sorts the sorter's parcels shows them.
    assert len(pages.machine_section(config.machine, scene).parts[2].rows) == 6


def test_a_job_for_one_material_says_which():
    sorter = machine.load("parcel_hub", ("fence.thickness=30 mm",))
    (message,) = machine.notes(sorter.machine)
    assert message.startswith("the fence is of PA6 dry, the first of the sorter's 4 materials")
    assert "--set fence.material='POM'" in message
    sold = fj.Sorter(fence={"material": "POM", "thickness": ["20 mm", "30 mm"]}).machine
    assert machine.notes(sold) == [
        "the fence is of POM",
        "fence.thickness is 0.02, the first of the sorter's list; for another write "
        "--set fence.thickness=0.03",
    ]
    assert machine.notes(None) == []


def test_the_motion_that_a_job_designs_is_freed_beside_the_sorter():
    module = importlib.import_module("optimize.co_design.configuration")
    arguments = ["--sorter", "parcel_hub", "--free", "fence.thickness=10mm:40mm"]
    space = module.configure([*arguments, "cycle_time=0.9 s:1.3 s"]).space
    spans = {v.name: (v.lower, v.upper) for v in space.variables}
    assert spans["fence.thickness"] == (0.01, 0.04)
    assert spans["cycle_time"] == (0.9, 1.3)


def test_encounters_of_a_machine_are_its_sorts():
    sorter = machine.load("parcel_hub", ("parcels.angle=5 deg",))
    encounters = Encounter.of(sorter.machine)
    course = Course("sorts", sorter.machine.duration, fj.Fidelity.fast(), machine=sorter.machine)
    for lane in range(encounters.lanes):
        one = Encounter(**encounters.named(lane))
        scene = course.scene(sorter.fence, sorter.drive, one)
        ours = sorter.scene(lane)
        assert jax.tree.structure(scene) == jax.tree.structure(ours)
        np.testing.assert_allclose(jax.tree.leaves(scene), jax.tree.leaves(ours), rtol=1e-14)
