"""Sorter files: their contents, refusals and changes."""

import equinox as eqx
import jax
import numpy as np
import pytest

import fencejax as fj
from optimize.common.machine import SORTERS, load

TEXT = """
title = "mine"
period = "1.5 s"
[belt]
speed = "2.5 m/s"
width = "0.8 m"
friction = {kinetic = 0.6, static = 0.7}
[parcels]
mass = ["500 g", "30 kg"]
length = "0.6 m"
breadth = "0.4 m"
offset = ["50 mm", "200 mm"]
[fence]
reach = "1.0 m"
length_ratio = {lower = 0, upper = 3, start = 0.6}
width = "0.20 m"
thickness = {lower = "4 mm", upper = "90 mm", start = "30 mm"}
material = ["PA6 dry", "POM"]
[fence_friction]
law = "stribeck"
kinetic = 0.3
static = 0.4
stribeck_speed = "20 mm/s"
[drive]
law = "trapezoid"
top_speed = "120 deg/s"
acceleration = "10 rad/s^2"
end_angle = "60 deg"
[motor]
torque = "400 N m"
[limits]
tip_deflection = "60 mm"
stress = "30 MPa"
impulse = {at_most = "200 N s"}
[objective]
minimize = "peak_force"
"""


@pytest.fixture(scope="module")
def mine():
    """The sorter of `TEXT`."""
    return fj.Sorter.parse(TEXT)


def same(one, other):
    """Whether two parts have the same structure and numbers."""
    a, b = jax.tree.leaves(one), jax.tree.leaves(other)
    alike = jax.tree.structure(one) == jax.tree.structure(other)
    return alike and all(np.allclose(x, y, rtol=1e-14, atol=0) for x, y in zip(a, b, strict=True))


def test_parts_are_those_written_by_hand(mine):
    machine = mine.machine
    assert same(mine.belt, fj.Belt(2.5, 0.8, fj.Friction(0.6, 0.7)))
    pa6 = fj.materials.named("PA6 dry")
    assert same(mine.fence, fj.Fence(0.375, 0.625, 0.2, 0.03, pa6.material))
    law = fj.TrapezoidDrive(np.pi / 3, 2 * np.pi / 3, 10.0)
    assert same(mine.drive, law)
    assert same(machine.fence_friction, fj.friction_laws.Stribeck(0.3, 0.4, 0.02))
    assert same(machine.border, fj.Border())
    assert [sheet.name for sheet in mine.materials] == ["PA6 dry", "POM"]
    assert float(machine.motor.torque) == 400
    assert machine.duration == 1.5


def test_an_empty_description_is_the_papers_machine():
    paper = fj.Sorter()
    # But for the damping ratio, which is that of the material's data sheet.
    assert same(paper.drive, fj.HarmonicDrive())
    assert same(paper.belt, fj.Belt())
    sheet = fj.materials.named("PA6 dry")
    assert same(paper.fence, fj.Fence(material=sheet.material))
    scene = paper.scene()
    by_hand = fj.scenes.whole_sort(fence=paper.fence, duration=float(paper.drive.cycle))
    assert same(scene, by_hand)


def test_scenes_are_those_written_by_hand(mine):
    scenes = mine.scenes()
    masses, offsets = (0.5, 0.5, 30.0, 30.0), (0.05, 0.2, 0.05, 0.2)
    for lane, (mass, offset) in enumerate(zip(masses, offsets, strict=True)):
        by_hand = fj.scenes.whole_sort(
            offset=offset, fence=mine.fence, parcel=fj.Parcel(mass, 0.6, 0.4), belt=mine.belt,
            drive=mine.drive, fence_friction=mine.machine.fence_friction, duration=1.5,
        )  # fmt: skip
        assert same(mine.scene(lane), by_hand)
        assert same(jax.tree.map(lambda leaf, lane=lane: leaf[lane], scenes), by_hand)


def test_what_is_free(mine):
    free = mine.machine.free
    assert list(free) == ["fence.length_ratio", "fence.thickness"]
    assert free["fence.thickness"][:2] == (0.004, 0.09)
    # Of one number alone: fixed.
    fixed = mine.replace(free={"fence.thickness": "20mm:20mm", "length_ratio": "1"})
    assert not fixed.machine.free
    assert float(fixed.fence.thickness) == 0.02
    freed = mine.replace(free={"fence.width": ("150 mm", "250 mm"), "drive.top_speed": "1:3"})
    assert freed.machine.free["fence.width"][:2] == (0.15, 0.25)
    assert float(freed.fence.width) == 0.2
    # Beginning at the nearer bound where the number is out of them.
    assert float(mine.replace(free={"fence.width": "1cm:5cm"}).fence.width) == 0.05


def test_any_number_of_the_machine_can_be_free(mine):
    spans = {
        "belt.speed": "2 m/s:3 m/s", "belt.friction.kinetic": "0.4:0.7", "front": "0:0.2",
        "motor.gear_ratio": "20:60", "fence.material.density": "900:1400",
        "fence_friction.stribeck_speed": "10 mm/s:30 mm/s", "border.friction.static": "0.3:0.6",
    }  # fmt: skip
    motor = {"motor.gear_ratio": 40, "motor.rotor_inertia": 1e-3, "fence.material": "POM"}
    problem = mine.replace(motor).replace(free=spans).problem()
    freed = dict(zip(problem.variable_names, problem.space.variables, strict=True))
    assert freed["belt.speed"].unit == "m/s"
    assert freed["fence_friction.stribeck_speed"].upper == pytest.approx(0.03)
    at = problem.values(problem.start)
    assert at["belt.speed"] == pytest.approx(2.5)
    assert at["motor.gear_ratio"] == pytest.approx(40)
    # Elsewhere in the spans: every number of every parcel's scene is there.
    point = np.full(problem.start.size, 0.3)
    values, scene = problem.values(point), problem.scene(point, problem.candidates[0], 3)
    assert float(scene.belt.speed) == pytest.approx(values["belt.speed"])
    assert float(scene.motor.gear_ratio) == pytest.approx(values["motor.gear_ratio"])
    assert float(scene.start.front) == pytest.approx(0.06)
    assert float(scene.start.offset) == 0.2
    assert float(scene.parcel.mass) == 30


def test_lists_are_choices(mine):
    sold = mine.replace({"thickness": ["20 mm", "25 mm", "30 mm"]})
    assert sold.machine.choices == {"fence.thickness": (0.02, 0.025, 0.03)}
    problem = sold.problem()
    assert len(problem.candidates) == 6
    assert problem.candidates[1].name == "PA6 dry, thickness 0.025"
    lanes = problem.lanes(problem.candidates[-1])
    np.testing.assert_array_equal(lanes["fence.thickness"], np.full(4, 0.03))
    assert lanes["fence.material.density"][0] == 1410


def test_a_candidates_sort_has_all_numbers_of_its_material():
    own = {"youngs_modulus": "3 GPa", "density": 1200, "damping_ratio": 0.02}
    sheets = [{"name": "mine", **own, "allowed_stress": 3e7, "fatigue_strength": 1e7}, "PC", "POM"]
    problem = fj.Sorter(fence={"material": sheets}).problem()
    found = [problem.scene(problem.start, each, 0).fence.material for each in problem.candidates]
    # As the sheets print them, with four digits.
    exponents = [float(each.fatigue_exponent) for each in found[1:]]
    assert exponents == pytest.approx([6.894, 12.26], rel=5e-4)
    # Where a material has none, the exponent that its life is judged by.
    assert float(found[0].fatigue_exponent) == 10.0
    for each, material in zip(problem.candidates, found, strict=True):
        for name in ("youngs_modulus", "density", "damping_ratio"):
            assert float(getattr(material, name)) == float(getattr(each.material.material, name))


def test_overrides_by_path_and_by_short_name(mine):
    changed = mine.replace({
        "belt.speed": "3 m/s", "mass": [1, 2], "drive.dwell": "0.1 s", "start.front": "50 mm",
        "fence.material": "UHMW-PE", "border": False, "fence.material.damping_ratio": "8 %",
        "limits.stress": "10 MPa", "fence.taper": "uniform",
    })  # fmt: skip
    assert float(changed.belt.speed) == 3
    assert float(changed.belt.width) == 0.8
    np.testing.assert_array_equal(changed.parcels.columns["parcel.mass"], [1, 1, 2, 2])
    np.testing.assert_array_equal(changed.parcels.columns["start.front"], np.full(4, 0.05))
    assert float(changed.drive.dwell) == 0.1
    assert changed.machine.border is None
    assert float(changed.fence.material.damping_ratio) == pytest.approx(0.08)
    assert float(changed.fence.material.density) == 930
    assert isinstance(changed.fence.taper, fj.Uniform)
    # The description itself is as it was.
    assert float(mine.belt.speed) == 2.5


def test_lengths_by_either_pair():
    by_lengths = fj.Sorter(fence={"rigid_length": "0.4 m", "flexible_length": "0.6 m"})
    longer = by_lengths.replace({"reach": "1.5 m"}).fence
    assert (float(longer.rigid_length), float(longer.flexible_length)) == pytest.approx((0.6, 0.9))
    by_reach = fj.Sorter(fence={"reach": 1.0, "rigid_length": 0.25})
    assert float(by_reach.fence.flexible_length) == pytest.approx(0.75)
    with pytest.raises(ValueError, match="`fence` must give its length by rigid_length and"):
        fj.Sorter(fence={"reach": 1.0, "rigid_length": 0.2, "flexible_length": 0.7})


def test_parts_in_place_of_tables():
    sorter = fj.Sorter(belt=fj.Belt(speed=2.5), drive=fj.SplineDrive([0.1, 0.2]))
    assert float(sorter.replace({"belt.speed": 3}).belt.speed) == 3
    changed = sorter.replace({"drive.cycle_time": "2 s"})
    assert isinstance(changed.drive, fj.SplineDrive)
    np.testing.assert_allclose(changed.drive.control_angles, [0.1, 0.2])


REFUSED = [
    ({"belt": {"sped": 2}}, "`belt` holds the unknown key `sped`. Did you mean `speed`"),
    ({"fence": {"thickness": "2 kg"}}, "`fence.thickness` must be in m .* another dimension"),
    ({"fence": {"thickness": 0}}, "`fence.thickness` must be above 0"),
    ({"fence": {"material": "POMM"}}, "Did you mean 'POM'"),
    ({"fence": {"material": {"density": 900}}}, "must give `youngs_modulus`"),
    ({"fence": {"material": []}}, "must name one at least"),
    ({"fence": {"material": ["POM", "POM"]}}, "must not repeat a material"),
    ({"fence": {"thickness": {"lower": 0.03}}}, "lacks `upper`"),
    ({"fence": {"thickness": {"lower": 0.03, "upper": 0.02}}}, r"at most `upper` = 0.02 \[m\]"),
    (
        {"fence": {"thickness": {"lower": 0.03, "upper": 0.05, "start": 0.06}}},
        r"`fence.thickness.start` must be within 0.03 ... 0.05 \[m\], but is 0.06",
    ),
    (
        {"fence": {"reach": "1.2 m", "rigid_length": "1.5 m"}},
        "`fence.rigid_length` must be below `reach` = 1.2 m, but is 1.5 m",
    ),
    (
        {"fence": {"reach": "1.2 m", "flexible_length": "1.5 m"}},
        "`fence.flexible_length` must be at most `reach` = 1.2 m, but is 1.5 m",
    ),
    ({"fence": {"reach": 0}}, r"`fence.reach` must be above 0 \[m\], but is 0"),
    ({"fence": {"pad": "10 mm"}}, r"is '10 mm'. Write, for example, pad = {thickness = .*fj.Pad\("),
    ({"fence": {"second_order": 3}}, "Write, for example, second_order = true"),
    (
        {"fence": {"thickness": {"lower": 0.03, "upper": 0.05, "scaling": "log"}}},
        "`fence.thickness.scaling` must be one of .*logarithmic.* but is 'log'",
    ),
    ({"parcels": {"corners": [7]}}, r"`parcels.corners` must hold corners 1 .* but is \[7\]"),
    ({"parcels": [{"mass": 3}]}, r"`parcels` must be a table, but is \[.*Write \[parcels\], once"),
    ({"limits": 3}, r"`limits` must be a table, but is 3"),
    ({"fence": {"taper": "unifrom"}}, "Did you mean `uniform`"),
    ({"fence": {"taper": fj.Uniform}}, "`fence.taper` must be an instance .* the class Uniform"),
    ({"fence": {"reach": {"lower": 1, "upper": 2}, "rigid_length": 0.2}}, "reach and length_ratio"),
    ({"belt": 2.0}, "`belt` must be a table of numbers or the part itself, but is 2.0"),
    ({"drive": {"law": "harmonics"}}, "Did you mean `harmonic`"),
    (
        {"drive": "spline"},
        r"`drive` of law spline needs control_angles, e.g. control_angles = \[0, 0.3, 0.6\] \[rad",
    ),
    (
        {"drive": {"law": "spline", "control_angles": 0.3}},
        r"`drive.control_angles` must be a list of numbers, but is 0.3. Write, .* = \[0, 0.3",
    ),
    (
        {"drive": {"law": "spline", "control_angles": "0.1 rad, 0.2 rad"}},
        "`drive.control_angles` must be a list of numbers, but is '0.1 rad, 0.2 rad'",
    ),
    (
        {"drive": {"law": "torque", "torques": 60}},
        r"`drive.torques` must be a list .* but is 60. Write, for example, torques = \[60, 0",
    ),
    ({"fence": {"taper": {"law": "profile", "ratios": 0.5}}}, "`fence.taper.ratios` must be a li"),
    (
        {"drive": {"law": "spline", "control_angles": {"lower": 0, "upper": 1, "start": 0.3}}},
        "`drive.control_angles.start` must be a list of numbers, but is 0.3",
    ),
    (
        {"fence_friction": {"law": "stribeck", "kinetic": 0.3}},
        "`fence_friction` of law stribeck needs static, stribeck_speed, e.g. static = 0.35, "
        'stribeck_speed = "20 mm/s"',
    ),
    ({"drive": {"top_speed": {"lower": 1, "upper": 2}}}, "`period` .* must be given"),
    ({"drive": {"law": "trapezoid", "top_speed": 9}}, "`drive`: .*the stroke is too short"),
    ({"motor": 400}, "`motor` must be an instance of Motor, but is 400"),
    ({"limits": {"tip_deflexion": 1}}, "Did you mean `tip_deflection`"),
    ({"limits": {"tip": 1}}, "Did you mean `tip_deflection`"),
    ({"limits": {"impulse": 0}}, "`limits.impulse` must not be 0"),
    ({"limits": {"impulse": {"below": 3}}}, "`at_most` or `at_least`"),
    ({"objective": "peak_forse"}, "Did you mean `peak_force`"),
    ({"objective": {"over": "median"}}, "`objective.over` must be one of"),
    ({"objective": {"over": "cvar", "level": 1}}, "above 0 and below 1 .* is 1. "),
    ({"objective": {"over": "cvar", "level": 0}}, "`objective.level` must be above 0"),
    ({"limits": {"power": -3}}, r"`limits.power` must be above 0 \[W\], but is -3"),
    ({"limits": {"rms_torque": "-3 N m"}}, r"`limits.rms_torque` must be above 0 \[N m\]"),
    (
        {"motor": {"torque": 9, "stall_torque": 3, "no_load_speed": 3}},
        "stall_torque / torque` must be at least 1",
    ),
    (
        {"belt": {"width": "0.8 m"}, "parcels": {"offset": [0.1, "0.9 m"]}},
        "`parcels.offset` must be below the belt's width, 800 mm, but is 900 mm: .* beside the bel",
    ),
    (
        {"parcels": {"list": [{"offset": 0.1}, {"offset": 2}]}},
        r"`parcels.list\[1\].offset` must be below the belt's width",
    ),
    ({"parcels": {"offset": {"lower": 0, "upper": 2}}}, "`parcels.offset` must be below"),
    ({"parcels": {"mass": []}}, "`parcels.mass` must hold one at least"),
    ({"parcels": {"masses": 3}}, "Did you mean `mass`"),
    ({"parcels": {"list": [{"mass": 1}, {"length": 1}]}}, "must give the same numbers"),
    ({"parcels": {"list": [{"mass": 1}], "mass": 3}}, "must be given once"),
    ({"parcels": {"mass": {"distribution": "gauss"}}}, "unknown key `gauss`"),
    ({"parcels": {"mass": {"distribution": "normal", "mean": 2}}}, "must give `deviation`"),
    (
        {"parcels": {"mass": {"distribution": "uniform", "lower": 3, "upper": 2}}},
        r"`parcels.mass.lower` must be at most `upper` = 2 \[kg\], but is 3",
    ),
    (
        {"parcels": {"mass": {"distribution": "normal", "mean": 2, "deviation": 0}}},
        r"`parcels.mass.deviation` must be above 0 \[kg\], but is 0",
    ),
]


@pytest.mark.parametrize(("tables", "message"), REFUSED)
def test_what_cannot_be_is_refused_where_it_is_given(tables, message):
    with pytest.raises((ValueError, TypeError), match=message):
        fj.Sorter(**tables)


def test_bounds_of_what_can_be_negative_and_wide_belts_are_accepted():
    limits = {"net_energy": -5, "sorted": "-10 mm", "crossing_time": 1}
    sorter = fj.Sorter(limits=limits, objective={"over": "cvar", "level": 0.99})
    bounds = {row.name: bound for row, bound in sorter.machine.bounds}
    assert (bounds["net_energy"], bounds["sorted"]) == (-5, pytest.approx(-0.01))
    for width in ([0.5, 1.0], {"lower": 0.5, "upper": 1.0, "start": 0.6}):
        assert fj.Sorter(belt={"width": width}, parcels={"offset": 0.8}).parcels.count == 1


def test_a_file_names_itself_in_its_refusals(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[belt]\nspeed = 2 m/s\n')
    with pytest.raises(ValueError, match="mine.toml: .* text in quotes"):
        fj.Sorter.load(file)
    file.write_text("[bolt]\nspeed = 2\n")
    with pytest.raises(ValueError, match="unknown key `bolt`. Did you mean `belt`"):
        fj.Sorter.load(file)
    for content, message in ((b"", "is empty"), (b"\n \n", "is empty"), (b"\x89PNG\xff", "UTF-8")):
        file.write_bytes(content)
        with pytest.raises(ValueError, match=f"mine.toml: must .*{message}"):
            fj.Sorter.load(file)
    file.write_bytes("title = 'Gr\u00f6\u00dfe'".encode("latin-1"))
    with pytest.raises(ValueError, match="mine.toml: must be text in UTF-8, .* Save it as UTF-8"):
        fj.Sorter.load(file)
    with pytest.raises(ValueError, match="names 'material'. Did you mean `fence.material`"):
        fj.Sorter().replace({"material": "POM"})
    with pytest.raises(ValueError, match=r"names 'colour'\.$"):
        fj.Sorter().replace({"colour": "red"})
    with pytest.raises(ValueError, match="names 'belt_sped'. Did you mean `belt_speed`"):
        fj.Sorter().replace({"belt_sped": 2})


def test_a_parcel_whose_sort_cannot_be_is_named(mine):
    with pytest.raises(ValueError, match=r"parcel 0.5 kg, offset 0 m.*clear of the fence"):
        mine.replace({"offset": [0.0, 0.5], "drive": {"law": "held", "held_angle": 0.3}}).problem()


# ---- the files that come with the jobs, and parts of a wrong kind


@pytest.mark.parametrize("file", sorted(path.stem for path in SORTERS.glob("*.toml")))
def test_files_that_come_with_the_jobs_are_read(file):
    sorter = load(file)
    assert sorter.machine.free
    assert sorter.doubts == ()
    assert len(sorter.problem().candidates) == len(sorter.materials)


def test_what_a_flag_says_is_not_put_down_to_the_file(tmp_path):
    with pytest.raises(ValueError, match="^--set: Argument `fence.thickness` must be above 0"):
        load("paper", ("fence.thickness=-3mm",))
    with pytest.raises(ValueError, match="^--set: `fence.thickness` is 45 "):
        load("paper", ("fence.thickness=45",))
    with pytest.raises(ValueError, match="^--free: Argument `fence.width.lower` must be above 0"):
        load("paper", ("fence.thickness=20mm",), ("fence.width=-1:1",))
    with pytest.raises(TypeError, match="^--set: Argument `belt` must be a table"):
        load("paper", ("belt=2",))
    file = tmp_path / "mine.toml"
    file.write_text("[belt]\nspeed = -2\n")
    with pytest.raises(ValueError, match="mine.toml: Argument `belt.speed` must be at least 0"):
        load(str(file), ("fence.thickness=20mm",))


def test_jobs_refuse_numbers_that_no_machine_has():
    with pytest.raises(ValueError, match="`fence.thickness` is 45 .* Is it 45 mm"):
        load("paper", ("fence.thickness=45",))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fj.Fence(material="POM"), "`material` must be an instance of Material, but is 'P"),
        (lambda: fj.Fence(taper=fj.Uniform), "`taper` .* the class Uniform, not made yet"),
        (lambda: fj.Belt(friction=0.5), "`friction` must be an instance of AbstractFriction"),
        (lambda: fj.Border(friction=0.5), "`friction` must be an instance of AbstractFriction"),
        (lambda: fj.surfaces.Deflector(0.6, friction=0.35), "`friction` must be an instance of A"),
        (lambda: fj.SteppedTaper("x", 4), "`profile` must be an instance of AbstractTaper, but is"),
        (lambda: fj.Parcel(contact="hard"), "`contact` must be an instance of AbstractContactLaw"),
        (lambda: fj.scenes.whole_sort(belt=2.0), "`belt` must be an instance of Belt, but is 2.0"),
        (lambda: fj.scenes.oblique_impact(fence=0.045), "`fence` must be an instance of Fence"),
        (lambda: fj.scenes.along_fence(drive=fj.HarmonicDrive), "the class HarmonicDrive"),
        (lambda: fj.scenes.rigid_wall(parcel=15.0), "`parcel` must be an instance of Parcel"),
        (lambda: fj.scenes.whole_sort(border=0.0), "`border` must be an instance of Border"),
        (lambda: fj.scenes.whole_sort(fence_friction=0.3), "`fence_friction` must be an instance"),
    ],
)
def test_parts_of_a_wrong_kind_are_refused_where_they_are_given(make, message):
    with pytest.raises(TypeError, match=message):
        make()


def test_materials_are_plausible_and_differentiable():
    for name in fj.materials.MATERIALS:
        sheet = fj.materials.named(name)
        assert sheet.name == name
        assert sheet.conditions
        assert fj.Sorter(fence={"material": name}).doubts == ()
        # By their rule no material bears more for 1e7 cycles than it bears once.
        assert float(sheet.fatigue_strength) <= float(sheet.allowed_stress)
        assert len(jax.tree.leaves(eqx.filter(sheet, eqx.is_array))) == 6
    assert fj.materials.named("pa6-DRY").name == "PA6 dry"


def test_a_drive_that_is_not_home_in_time_is_refused():
    with pytest.raises(ValueError, match="`period` must be at least the drive's cycle, 1.36"):
        fj.Sorter(period="1.2 s").problem()


def test_a_held_fence_is_home_in_any_period():
    for angle in (0.3, {"lower": 0.2, "upper": 0.5}):
        drive = {"law": "held", "held_angle": angle}
        problem = fj.Sorter(period="1 s", drive=drive, parcels={"front": -0.3}).problem()
        assert "cycle" not in problem.limit_names
        lane = problem.scene(problem.start, problem.candidates[0], 0)
        assert float(lane.duration) == 1.0
