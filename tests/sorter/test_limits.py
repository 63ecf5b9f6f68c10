"""The rows of a sorter's table of limits: bounds, settings, and limits only on request."""

import numpy as np
import pytest

import fencejax as fj
from fencejax.design import drivability, fatigue, objectives
from fencejax.sorter import LIMIT_ROWS, settled

FRAGILE = {"critical_load": 40, "critical_velocity_change": 1}


def same_motor(one, other):
    """Whether two motors have the same numbers."""
    return all(getattr(one, name) == getattr(other, name) for name in fj.Motor.bounds)


def limits(material="PA6 dry", **tables):
    """The limits that hold for a sorter, by name."""
    sorter = fj.Sorter(fence={"material": material}, **tables)
    return dict(settled(sorter.machine.bounds, sorter.machine, sorter.materials[0]))


def test_life_is_the_fatigue_strength_for_so_many_sorts():
    assert limits()["fatigue_stress"].bound == pytest.approx(19e6)
    assert limits("UHMW-PE")["fatigue_stress"].bound == pytest.approx(5e6)
    # Ten times as many: by the exponent of the line from 80 MPa at half a cycle to 19 MPa at 1e7.
    slope = np.log(80 / 19) / np.log(2e7)
    assert limits(limits={"life": 1e8})["fatigue_stress"].bound == pytest.approx(
        19e6 * 0.1**slope
    )
    plain = {"youngs_modulus": "3 GPa", "density": 1130, "fatigue_strength": "20 MPa"}
    for exponent, of in ((10.0, plain), (7.0, {**plain, "fatigue_exponent": 7})):
        bound = limits(of, limits={"life": 1e8})["fatigue_stress"].bound
        assert bound == pytest.approx(20e6 * 0.1 ** (1 / exponent))
    assert limits(limits={"life": "1e6"})["fatigue_stress"].sense == "at most"
    assert "fatigue_stress" not in limits(limits={"life": False})
    own = {"youngs_modulus": "3 GPa", "density": 1130}
    assert "fatigue_stress" not in limits(own)
    with pytest.raises(ValueError, match="`limits.life` must be left out for own material"):
        limits(own, limits={"life": 1e7})
    known = {**own, "fatigue_strength": "20 MPa"}
    assert limits(known)["fatigue_stress"].bound == pytest.approx(20e6)
    with pytest.raises(ValueError, match="`limits.life` must be above 0"):
        limits(limits={"life": 0})


def test_the_margin_of_sorting_is_a_share_of_the_belts_width():
    assert limits()["sorted"].unit_of_margin == 0.7
    wide = limits(belt={"width": "1.4 m"}, limits={"sorted": "70 mm"})["sorted"]
    assert float(wide.margin_of(0.0)) == pytest.approx(-0.05)
    # A limit of one's own has its own unit.
    own = limits(belt={"width": "1.4 m"}, limits={"sorted": objectives.diverted_limit(0.0, 0.2)})
    assert own["sorted"].unit_of_margin == 0.2


def test_a_motor_with_its_torque_alone_is_limited_by_it_alone():
    found = limits(motor={"torque": "400 N m"})
    assert found["torque"].quantity is objectives.PEAK_TORQUE
    assert not {"rms_torque", "speed_torque", "power", "energy"} & set(found)
    given = {
        "torque": 400, "rated_torque": 150, "no_load_speed": "80 rpm", "rotor_inertia": "8 kg cm^2",
        "gear_ratio": 40, "efficiency": "94 %",
    }  # fmt: skip
    found = limits(motor=given, limits={"power": "900 W"})
    assert found["torque"].quantity.name == "motor_torque"
    assert found["rms_torque"].bound == 150
    assert found["speed_torque"].bound == 1
    assert found["power"].bound == 900
    motor = fj.Sorter(motor=given).machine.motor
    assert found["speed_torque"].quantity is drivability.SPEED_TORQUE
    assert float(motor.no_load_speed) == pytest.approx(80 * 2 * np.pi / 60)
    assert same_motor(fj.Sorter(motor=given).scene().motor, motor)
    with pytest.raises(ValueError, match="`limits.speed_torque` must be left out"):
        limits(motor={"torque": 400}, limits={"speed_torque": 1})
    objective = fj.Sorter(motor=given, objective="drive_work").machine.objective.quantity
    assert objective is drivability.DRIVE_WORK


def test_a_material_without_a_number_that_others_have_is_named_with_it():
    own = {"name": "mine", "youngs_modulus": "3 GPa", "density": 1130}
    strong, lasting = {**own, "allowed_stress": "30 MPa"}, {**own, "fatigue_strength": "9 MPa"}
    for materials, number, key in (
        (["POM", lasting], "allowed_stress", "stress"),
        ([lasting, "POM"], "allowed_stress", "stress"),
        (["POM", strong], "fatigue_strength", "life"),
    ):
        problem = fj.Sorter(fence={"material": materials}).problem()
        with pytest.raises(ValueError, match=f"`{number}` for mine, as for POM.*limits.{key} ="):
            problem.limits(problem.candidates[1])


def test_a_limit_follows_the_motor_that_is_chosen():
    sorter = fj.Sorter(motor={"torque": ["400 N m", "650 N m"]})
    problem = sorter.problem()
    assert [dict(problem.limits(c))["torque"].bound for c in problem.candidates] == [400, 650]
    with pytest.raises(ValueError, match="`motor.torque` must be one number or a list, but is fre"):
        fj.Sorter(motor={"torque": {"lower": 300, "upper": 600}})


def test_what_holds_only_where_it_is_asked_for():
    assert not {"tip_share", "clear_period", "damage", "tipping"} & set(limits(period="1.5 s"))
    asked = {
        "tip_share": True, "clear_period": True,
        "damage": {"critical_load": 40, "critical_velocity_change": "1.2 m/s"},
        "tipping": {"center_height": "25 cm", "contact_height": "80 mm", "at_most": 0.7},
    }  # fmt: skip
    found = limits(period="1.5 s", limits=asked)
    assert {name: found[name].bound for name in asked} == {
        "tip_share": 0.1, "clear_period": 1.5, "damage": 1.0, "tipping": 0.7,
    }  # fmt: skip
    # g and the base's half: N 0.17 m over m g 0.15 m.
    scene = fj.scenes.whole_sort()
    result = type("Result", (), {"peak_force": 200.0})
    value = float(found["tipping"].quantity(result, scene))
    assert value == pytest.approx(200 * 0.17 / (15 * 9.81 * 0.15))
    assert limits(limits={"tip_share": 0.3})["tip_share"].bound == 0.3


def test_height_and_fragility_of_each_parcel():
    own = {"height": ["0.2 m", "0.8 m"], "critical_load": 40, "critical_velocity_change": 1.5}
    asked = {"tipping": {"contact_height": "80 mm"}, "damage": True}
    asked["share_damaged"] = {"spread": 0.3, "at_most": "2 %"}
    sorter = fj.Sorter(parcels=own, limits=asked)
    found = dict(settled(sorter.machine.bounds, sorter.machine, sorter.materials[0]))
    assert (found["damage"].bound, found["share_damaged"].bound) == (1.0, 0.02)
    scenes = sorter.scenes()
    result = type("Result", (), {"peak_force": np.full(2, 200.0), "pulse_impulse": 60.0})
    tipping = np.asarray(found["tipping"].quantity(result, scenes))
    weight = 15 * 9.81 * 0.15
    assert tipping == pytest.approx(200 * np.array([0.02, 0.32]) / weight)
    damage = np.asarray(found["damage"].quantity(result, scenes))
    assert damage == pytest.approx(200 / (15 * 9.81) / 40)
    # The share is a mean over the parcels, by how often each comes.
    problem = sorter.problem()
    assert problem.margin_rows[problem.limit_names.index("share_damaged")] == 1
    weighted = fj.Sorter(
        parcels={
            "list": [{"mass": 1, **FRAGILE, "weight": 3}, {"mass": 2, **FRAGILE, "weight": 1}],
        },
        limits={"share_damaged": {"spread": 0.3}},
    ).problem()  # fmt: skip
    values = {"share_damaged": np.array([0.1, 0.5])}
    measured = fj.sorter.Measured(values, np.zeros(2), np.zeros(2))
    assert weighted.bounded("share_damaged", measured) == pytest.approx([0.2])
    with pytest.raises(ValueError, match="or give height with the parcels"):
        limits(limits={"tipping": {"contact_height": 0.1}})


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"damage": 1.0}, "`limits.damage` must be a table with critical_load"),
        ({"damage": {"critical_load": 3}}, "must be a table with critical_load, critical_vel"),
        (
            {"tipping": {"center_height": 1, "contact_height": 0, "height": 2}},
            "unknown key `height`. Did you mean",
        ),
        ({"tipping": {"center_height": "1 s", "contact_height": 0}}, "of another dimension"),
        ({"ring": True}, "`limits.ring` must be a number, but is true"),
        ({"impulse": True}, "`limits.impulse` must be a number"),
    ],
)
def test_refusals(table, message):
    with pytest.raises(ValueError, match=message):
        limits(limits=table)


def test_machines_that_differ_in_a_setting_are_distinguished():
    one, other = (
        fj.Sorter(limits={"tipping": {"center_height": h, "contact_height": 0.1}}).machine
        for h in (0.2, 0.3)
    )
    assert one.signature != other.signature


def test_a_problem_reads_them_all():
    sorter = fj.Sorter(
        period="0.5 s", fence_friction=False, border=False,
        parcels={"mass": ["5 kg", "30 kg"], "front": 0.8, "offset": 0.01, "corners": [1]},
        fence={"material": ["PA6 dry", "spring steel"]},
        drive={"cycle_time": 0.5, "top_speed": 3},
        motor={"torque": 3000, "rotor_inertia": 1e-3, "gear_ratio": 20, "no_load_speed": 40},
        limits={
            "clear_period": True, "tip_share": True, "rms_torque": 500, "velocity_change": "3 m/s",
            "tipping": {"center_height": 0.2, "contact_height": 0.1}, "crossing_time": "1 s",
            "damage": {"critical_load": 40, "critical_velocity_change": 1},
        },
    )  # fmt: skip
    problem = sorter.problem(fj.Fidelity.coarse())
    candidate = problem.candidates[1]
    assert dict(problem.limits(candidate))["fatigue_stress"].bound == pytest.approx(500e6)
    found = problem.measure(problem.start, candidate, refine=False)
    for name in problem.limit_names:
        quantity = problem.limited(name)
        assert np.all(np.isfinite(found.values[quantity.name])), name
        assert found.values[quantity.name].shape == (2,)
    # What bends the fence once bends it back: between half and all of the largest stress.
    ratio = found.values["fatigue_stress"] / found.values["peak_stress"]
    assert np.all((ratio > 0.5) & (ratio < 1.1))
    _, margins, _ = problem.judged(found, candidate)
    assert margins.shape == (sum(problem.margin_rows),)
    assert {*LIMIT_ROWS, "fatigue_stress"} > set(problem.limit_names)
    assert fatigue.FATIGUE_STRESS in problem.quantities
