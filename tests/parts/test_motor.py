"""A motor's numbers, and the refusal of invalid ones."""

import numpy as np
import pytest

import fencejax as fj


def test_what_is_not_known_bounds_nothing():
    motor = fj.Motor(400.0)
    assert float(motor.torque) == 400
    assert motor.reflected_inertia == 0
    assert fj.Motor().torque is None


def test_rotor_behind_a_gear():
    assert float(fj.Motor(rotor_inertia=2e-3, gear_ratio=30).reflected_inertia) == pytest.approx(
        2e-3 * 30**2
    )
    assert float(fj.Motor(rotor_inertia=2e-3).reflected_inertia) == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"torque": -1.0}, "`torque` must be above 0"),
        ({"efficiency": 1.1}, "`efficiency` must be at most 1"),
        ({"gear_ratio": 0}, "`gear_ratio` must be above 0"),
        ({"torque": 100.0, "rated_torque": 200.0}, "rated_torque / torque` must be at most 1"),
        (
            {"torque": 100.0, "stall_torque": 60.0, "no_load_speed": 8.0},
            "stall_torque / torque` must be at least 1 .*, but is 0.6. Give .* `rated_torque`",
        ),
        ({"no_load_speed": 8.0}, "`stall_torque` .* must be given with `no_load_speed`"),
        ({"stall_torque": 8.0}, "`no_load_speed` .* must be given with `stall_torque`"),
        ({"rotor_inertia": np.nan}, "`rotor_inertia` must be finite"),
    ],
)
def test_refusals(numbers, said):
    with pytest.raises(ValueError, match=said):
        fj.Motor(**numbers)
