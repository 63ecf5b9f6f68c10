"""The paper's sorter file shows every key that a sorter file may have, and its examples are read.

An example is a comment `#     key = ...`; lines of them that follow each other are one example.
"""

import re
import tomllib
import warnings

import pytest

import fencejax as fj
from optimize.common.machine import SORTERS

TEXT = (SORTERS / "paper.toml").read_text(encoding="utf-8")
FILE = tomllib.loads(TEXT)
ON_FENCE = ("pad", "shaft", "rest_shape", "shear", "second_order")
DISTRIBUTIONS = ("uniform", "logarithmic", "normal", "lognormal")


def examples():
    """Each example as a table, with the name of the table that it stands in."""
    found, section, lines = [], "", []
    for line in [*TEXT.splitlines(), ""]:
        if example := re.match(r"#     (\w+ = .*)", line):
            lines.append(example[1])
        elif lines:
            found.append((section, tomllib.loads("\n".join(lines))))
            lines = []
        if header := re.match(r"\[(\w+)\]", line):
            section = header[1]
    return found


EXAMPLES = examples()


def keys(path, value):
    """The keys of a table and of those in it, such as `belt.speed`; where a table names its law or
    its distribution, that is in brackets: `drive(spline).turn`."""
    if isinstance(value, list):
        for each in value:
            yield from keys(path, each)
    if isinstance(value, dict):
        kind = value.get("law", value.get("distribution"))
        here = path if kind is None else f"{path}({kind})"
        for key, inner in value.items():
            yield f"{here}.{key}"
            yield from keys(f"{path}.{key}", inner)


SHOWN = {key for section, table in [*FILE.items(), *EXAMPLES] for key in keys(section, table)}


def accepted(*path, **beside):
    """The keys that a table may hold, as the reader says where it refuses another one."""
    tables = {**beside, "none_such": 1}
    for name in reversed(path):
        tables = {name: tables}
    with pytest.raises(ValueError, match="the unknown key `none_such`") as refused:
        fj.Sorter(**tables)
    return re.search(r"It may hold ([\w, ]*)\.", str(refused.value))[1].split(", ")


def test_every_table_is_there():
    assert set(FILE) == set(fj.sorter.SECTIONS)


@pytest.mark.parametrize(
    "path",
    ["belt", "border", "parcels", "fence", "motor", "objective", "fence.material"]
    + [f"fence.{part}" for part in ON_FENCE],
)  # fmt: skip
def test_every_key_of_a_table_is_shown(path):
    assert {f"{path}.{key}" for key in accepted(*path.split("."))} - SHOWN == set()


def test_every_key_of_a_free_number_is_shown():
    names = accepted("fence", "thickness", lower=0.01, upper=0.02)
    assert {f"fence.thickness.{key}" for key in names} - SHOWN == set()


@pytest.mark.parametrize(
    ("path", "law"),
    [("drive", law) for law in fj.parts.DRIVES]
    + [("fence_friction", law) for law in fj.parts.FRICTIONS]
    + [("fence.taper", law) for law in fj.parts.TAPERS],
)  # fmt: skip
def test_every_law_is_shown_with_its_numbers(path, law):
    assert f'"{law}"' in TEXT
    for name in filter(None, accepted(*path.split("."), law=law)):
        assert {f"{path}({law}).{name}", f"{path}.{name}"} & SHOWN


@pytest.mark.parametrize("kind", DISTRIBUTIONS)
def test_every_distribution_is_shown_with_its_numbers(kind):
    found = {key.rpartition("(")[2] for key in SHOWN}
    names = accepted("parcels", "mass", distribution=kind)
    assert {f"{kind}).{name}" for name in names} - found == set()


def test_there_are_no_other_distributions():
    with pytest.raises(ValueError, match="It may hold " + ", ".join(DISTRIBUTIONS)):
        fj.Sorter(parcels={"mass": {"distribution": "none_such"}})


def test_every_row_of_a_list_of_parcels_may_have_a_weight():
    with pytest.raises(ValueError, match="It may hold .*weight"):
        fj.Sorter(parcels={"list": [{"none_such": 1}]})
    assert "parcels.list.weight" in SHOWN


def test_every_limit_is_shown_with_its_settings():
    for row in fj.sorter.LIMIT_ROWS.values():
        wanted = {f"limits.{row.name}", *(f"limits.{row.name}.{name}" for name in row.settings)}
        assert wanted - SHOWN == set()
    assert "fencejax.OBJECTIVES" in TEXT


@pytest.mark.parametrize(("section", "table"), EXAMPLES)
def test_every_example_is_read(section, table, tmp_path):
    """The example instead of the lines with the same keys, and of those that it names."""
    (tmp_path / "parcels.csv").write_text("mass [kg],length [m],weight\n2,0.3,5\n20,0.6,1\n")
    instead = {"list": ("mass", "length"), "file": ("mass", "length"),
               "rigid_length": ("reach", "length_ratio")}  # fmt: skip
    gone = {name for key in table for name in instead.get(key, ())}
    rest = {key: value for key, value in FILE[section].items() if key not in gone}
    tables = {**FILE, section: table if "law" in table else {**rest, **table}}
    if section == "limits":
        ratings = {"rated_torque": "300 N m", "no_load_speed": "60 rpm"}
        tables["motor"] = {**FILE["motor"], **ratings}
    with warnings.catch_warnings():
        warnings.simplefilter("error", fj.sorter.ImplausibleNumberWarning)
        sorter = fj.Sorter(**tables, folder=tmp_path)
    assert "limit " in str(sorter)


def test_what_holds_where_a_file_says_nothing():
    """As the head of the file has it."""
    empty, paper = fj.Sorter(), fj.Sorter.parse(TEXT)
    assert float(empty.fence.material.damping_ratio) == pytest.approx(0.012)
    assert empty.parcels.count == 1
    assert float(empty.parcels.columns["parcel.mass"][0]) == 15
    assert float(empty.parcels.columns["start.offset"][0]) == 0
    assert empty.machine.duration == pytest.approx(float(paper.drive.cycle))
    assert empty.machine.motor.torque is None
    assert not empty.machine.free
    for name in ("thickness", "rigid_length", "flexible_length", "width"):
        assert float(getattr(empty.fence, name)) == pytest.approx(float(getattr(paper.fence, name)))
    bounds = dict(fj.sorter.settled(empty.machine.bounds, empty.machine, empty.materials[0]))
    assert set(bounds) == {
        "sorted", "stress", "fatigue_stress", "deflection_share", "indentation_share",
    }  # fmt: skip
    shares = bounds["deflection_share"].bound, bounds["indentation_share"].bound
    assert (bounds["sorted"].bound, *shares) == (0, 0.25, 0.5)
