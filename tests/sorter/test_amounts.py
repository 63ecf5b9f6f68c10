"""Numbers with units, unknown names, and implausible numbers."""

import math

import numpy as np
import pytest

import fencejax as fj
from fencejax.sorter import amount, span, value


@pytest.mark.parametrize(
    ("given", "unit", "si"),
    [
        ("45 mm", "m", 0.045),
        ("45mm", "m", 0.045),
        ("3 GPa", "Pa", 3e9),
        ("400 N m", "N m", 400.0),
        ("400 Nm", "N m", 400.0),
        ("60 deg", "rad", math.pi / 3),
        ("15 rpm", "rad/s", math.pi / 2),
        ("3000 revolution/min", "rad/s", 100 * math.pi),
        ("180 deg/s^2", "rad/s^2", math.pi),
        ("2 N m/deg", "N m/rad", 360 / math.pi),
        ("2 N m s/rad", "N m s/rad", 2.0),
        ("2.5 m/s", "m/s", 2.5),
        ("150 m/min", "m/s", 2.5),
        ("1.13 g/cm^3", "kg/m^3", 1130.0),
        ("35 %", "1", 0.35),
        ("3.3e5 N s kg^-0.4 m^-3", "N s kg^-0.4 m^-3", 3.3e5),
        ("3.3e5 kg^0.6 m^-2 s^-1", "N s kg^-0.4 m^-3", 3.3e5),
        ("-3e-1 m", "m", -0.3),
        ("0.045", "m", 0.045),
        (0.045, "m", 0.045),
        (2, "m", 2.0),
        (np.float32(0.5), "m", 0.5),
    ],
)
def test_numbers_with_units(given, unit, si):
    # A sum of a few products: rounding alone.
    assert amount("x", given, unit) == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize(
    ("given", "unit", "message"),
    [
        ("2.5 kg", "m/s", "`belt.speed` must be in m/s .* '2.5 kg', of another dimension"),
        ("2.5 m", "m/s", "another dimension"),
        ("2 A", "m", "another dimension"),
        ("4 foos", "m", "'foos' is no unit"),
        ("1,5 m", "m", "Write a decimal point"),
        ("fast", "m/s", 'a number with or without a unit, such as "2.5 m/s", but is \'fast\''),
        ("", "m", "a number with or without"),
        ("1e999 m", "m", "must be finite"),
        (math.nan, "m", "must be finite"),
    ],
)
def test_what_is_no_such_number_is_refused(given, unit, message):
    with pytest.raises(ValueError, match=message):
        amount("belt.speed", given, unit)


@pytest.mark.parametrize(
    ("given", "unit", "remedy"),
    [
        ("3000 1/min", "rad/s", 'Write "3000 rpm", which is "314.2 rad/s", where 1/min counts'),
        ("50 Hz", "rad/s", '"3000 rpm", .* and "50 rad/s" where it counts radians'),
        ("2 1/s", "rad/s", "Write"),
        ("2 1/s^2", "rad/s^2", 'Write, for example, "2 rad/s.2"'),
        ("2 rad^2/s", "rad/s", "Write"),
        ("2 N m/Hz", "N m s/rad", 'Write, for example, "2 N m s/rad"'),
        ("2 N m", "N m/rad", 'Write, for example, "2 N m/rad"'),
        ("30 %", "rad", 'Write, for example, "30 deg"'),
    ],
)
def test_a_unit_without_the_angle_is_refused(given, unit, remedy):
    with pytest.raises(ValueError, match=f"`drive.speed` must be in .* with an angle.*{remedy}"):
        amount("drive.speed", given, unit)


@pytest.mark.parametrize("given", [True, None, [1.0], {"a": 1}])
def test_what_is_no_number_at_all_is_refused(given):
    with pytest.raises(TypeError, match="`belt.speed` .* must be a number"):
        amount("belt.speed", given, "m/s")


def test_texts_of_flags():
    assert value("2.5") == 2.5
    assert value("45 mm") == "45 mm"
    assert value("PA6 dry") == "PA6 dry"
    assert value("['POM', 'PET']") == ["POM", "PET"]
    assert value("false") is False
    assert span("4mm:90mm") == {"lower": "4mm", "upper": "90mm"}
    assert span("0:3:linear") == {"lower": 0, "upper": 3, "scaling": "linear"}
    assert span("45 mm") == "45 mm"


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"fence": {"thickness": 45}}, "`fence.thickness` is 45 .* Is it 45 mm"),
        ({"fence": {"thickness": [0.03, 45]}}, "`fence.thickness` is 45"),
        ({"fence": {"thickness": {"lower": 0.03, "upper": 90}}}, "`fence.thickness` is 90"),
        (
            {"fence": {"material": {"name": "POM", "density": 1.13}}},
            "`fence.material.density` is 1.13 .* Is it 1.13 g/cm",
        ),
        (
            {"fence": {"material": {"name": "POM", "youngs_modulus": 3}}},
            "is 3 .* Is it 3 GPa",
        ),
        (
            {"fence": {"material": {"name": "POM", "damping_ratio": 5}}},
            "damping_ratio` is 5 .* Is it 5 %",
        ),
        ({"fence_friction": {"kinetic": 35, "static": 0.5}}, "is 35 .* Is it 35 %"),
        ({"drive": {"cycle_time": 1360, "top_speed": 0.01}, "period": 1.5}, "Is it 1360 ms"),
        ({"drive": {"law": "pneumatic", "pressure": 6}}, "pressure` is 6 .* Is it 6 MPa or 6 bar"),
        ({"belt": {"speed": 250}}, "belt.speed` is 250 .* Is it 250 mm/s"),
        ({"parcels": {"mass": [5, 5000]}}, "mass` is 5000 .* Is it 5000 g"),
    ],
)
def test_implausible_numbers_are_reported_with_the_likely_unit(tables, message):
    with pytest.warns(fj.sorter.ImplausibleNumberWarning, match=message):
        fj.Sorter(**tables)


def test_the_papers_machine_is_plausible():
    assert fj.Sorter().doubts == ()
