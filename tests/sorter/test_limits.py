"""The rows of a sorter's table of limits: bounds, settings, and what is asked for alone."""

import numpy as np
import pytest

import fencejax as fj
from fencejax.design import drivability, fatigue, objectives
from fencejax.sorter import LIMIT_ROWS, settled


def limits(material="PA6 dry", **tables):
    """The limits that hold for a sorter, by name."""
    sorter = fj.Sorter(fence={"material": material}, **tables)
    return dict(settled(sorter.machine.bounds, sorter.machine, sorter.materials[0]))


def test_life_is_the_fatigue_strength_for_so_many_sorts():
    assert limits()["fatigue_stress"].bound == pytest.approx(19e6)
    assert limits("UHMW-PE")["fatigue_stress"].bound == pytest.approx(5e6)
    # Ten times as many: by Basquin's exponent 10.
    assert limits(limits={"life": 1e8})["fatigue_stress"].bound == pytest.approx(19e6 * 0.1**0.1)
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
    # The same motor, the same quantities: a program that is compiled serves again.
    again = limits(motor=given)
    assert again["torque"].quantity is found["torque"].quantity
    motor = fj.Sorter(motor=given).machine.motor
    assert found["speed_torque"].quantity is drivability.speed_torque(motor)
    assert float(motor.no_load_speed) == pytest.approx(80 * 2 * np.pi / 60)
    with pytest.raises(ValueError, match="`no_load_speed`"):
        limits(motor={"torque": 400}, limits={"speed_torque": 1})
    objective = fj.Sorter(motor=given, objective="drive_work").machine.objective.quantity
    assert objective is drivability.drive_work(motor)


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


@pytest.mark.parametrize(
    ("table", "said"),
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
def test_refusals(table, said):
    with pytest.raises(ValueError, match=said):
        limits(limits=table)


def test_machines_that_differ_in_a_setting_are_told_apart():
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
