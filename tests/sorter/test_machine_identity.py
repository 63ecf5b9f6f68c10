"""The identity of a sorter's design problem: evaluations of another one are not reused."""

import copy
import dataclasses

import pytest
from variants import variants

import fencejax as fj
from fencejax.design import Journal
from fencejax.sorter import Machine

NUMBERS = [0.0] * 6


@pytest.fixture(scope="module")
def machine():
    """A sorter with many of the possible numbers, some of them free or chosen."""
    return fj.Sorter(
        title="one", period="1.5 s",
        belt={"speed": 2.0, "edge": True},
        parcels={"mass": ["5 kg", "30 kg"], "height": 0.2, "corners": [1, 2]},
        fence={"material": ["PA6 dry", "POM"], "thickness": {"lower": 0.03, "upper": 0.06}},
        drive={"top_speed": [1.4, 1.5]},
        motor={"torque": 900.0, "rotor_inertia": 1e-3, "gear_ratio": 10.0, "efficiency": 0.9},
        limits={"tipping": {"center_height": 0.2, "contact_height": 0.1}, "peak_force": 2000.0},
        objective={"minimize": "peak_force", "over": "cvar", "level": 0.9},
    ).machine  # fmt: skip


def taken_over(folder, one, other):
    """Whether an evaluation of a problem, its key and data, counts as one of another's."""
    (key, data), (other_key, other_data) = one, other
    Journal(folder / "journal", key).add([0.5], data, NUMBERS)
    try:
        kept = Journal(folder / "journal", other_key)
    except ValueError:
        return False
    return kept.find([0.5], other_data) is not None


def of(machine):
    """The identity of a machine's problem: its key, and its parcels."""
    return machine.signature, {**machine.parcels.columns, "weight": machine.parcels.weights}


def test_every_number_and_choice_of_a_machine_makes_another_problem(machine, tmp_path):
    whole = of(machine)
    found = [(path, other) for path, other in variants(machine) if path != ".title"]
    for index, (path, other) in enumerate(found):
        folder = tmp_path / str(index)
        folder.mkdir()
        assert not taken_over(folder, whole, of(other)), path
    # Every field has been gone through, and its copy is the same.
    names = {path.lstrip(".").partition(".")[0].partition("[")[0] for path, _ in found}
    fields = {field.name for field in dataclasses.fields(Machine)}
    assert {name.split(" ")[0] for name in names} == fields - {"title"}
    assert taken_over(tmp_path, whole, of(copy.deepcopy(machine)))


@pytest.mark.parametrize(
    ("parcels", "other"),
    [
        ({"length": "0.3 m"}, {"breadth": "0.3 m"}),
        ({"corners": [1, 2]}, {"corners": [1]}),
        ({"mass": "5 kg"}, {"mass": "6 kg"}),
    ],
)
def test_files_of_other_parcels_are_other_problems(tmp_path, parcels, other):
    def known(given):
        problem = fj.Sorter(parcels=given, period="1.5 s").problem()
        return problem.machine.signature, problem.data(problem.candidates[0])

    assert not taken_over(tmp_path, known(parcels), known(other))
    assert taken_over(tmp_path, known(parcels), known(parcels))
