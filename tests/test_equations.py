"""Every equation of the paper has one home in the package, and the README's table says which."""

import re

import pytest
from equations import ALL, ROOT, claimed_twice, claims, homes, missing, table, written

# What the paper writes in polar coordinates, or for a parcel tied to the fence, the package has as
# Newton-Euler for a free parcel. `reference/polar.py` has these equations as they are printed, and
# the tests beside it compare: accelerations, gaps, rates and sliding speeds at random states.
POLAR = {"2.3", "2.4", "2.5", "2.6", "2.7", "2.12", *(f"2.{k}" for k in range(27, 34))}


def test_every_equation_has_one_home():
    found = homes(ROOT)
    assert missing(found) == []
    assert claimed_twice(found) == {}
    unknown = {equation.split("_")[0] for home in found for equation in home.equations} - {*ALL}
    assert not unknown


def test_equations_are_where_their_physics_is():
    # Nothing above the model computes an equation of the paper: stages are scenes.
    assert {home.file.split("/")[0] for home in homes(ROOT)} == {"parts", "scenes", "model"}


def test_polar_equations_are_written_out_in_the_reference():
    text = (ROOT / "tests/reference/polar.py").read_text()
    cited = set()
    for first, last in re.findall(r"\(2\.(\d+)\)(?:-\(2\.(\d+)\))?", text):
        cited |= {f"2.{k}" for k in range(int(first), int(last or first) + 1)}
    assert cited >= POLAR
    named = {
        equation: home.note
        for home in homes(ROOT)
        for equation in home.equations
        if equation in POLAR
    }
    assert all(note.startswith("There ") for note in named.values()), named


def test_readme_has_the_table():
    readme = (ROOT / "README.md").read_text()
    wanted = written(readme, homes(ROOT))
    assert readme == wanted, "run python tests/equations.py --write"


# --- The reading of citations ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("docstring", "found"),
    [
        ("Force.\n\n    Paper: (2.2).\n", [(("2.2",), "")]),
        ("Paper: (2.3)-(2.4), (2.8). There\n    more.", [(("2.3", "2.4", "2.8"), "There more.")]),
        ("Paper: (2.19)_1-3, (2.20).", [(("2.19_1", "2.19_2", "2.19_3", "2.20"), "")]),
        ("As in (2.2), which another function has.", []),
    ],
)  # fmt: skip
def test_claims_are_read(docstring, found):
    assert claims(docstring) == found


@pytest.mark.parametrize("docstring", ["Paper: 2.2.", "Paper: (2.2)", "Paper: the law."])
def test_claims_that_name_no_equation_are_refused(docstring):
    with pytest.raises(ValueError, match="names no equation"):
        claims(docstring)


def test_missing_and_double_homes_are_found(tmp_path):
    (tmp_path / "made").mkdir()

    def package(*numbers):
        source = "".join(
            f'def f{k}():\n    """Paper: {text}."""\n' for k, text in enumerate(numbers)
        )
        (tmp_path / "made" / "laws.py").write_text(source)
        return homes(tmp_path, "made")

    whole = package("(2.1)-(2.18)", "(2.19)_1-3, (2.20)", "(2.19)_4", "(2.21)-(2.34)")
    assert missing(whole) == []
    assert claimed_twice(whole) == {}
    assert "| (2.19)₁₋₃, (2.20) | `laws.py` | `f1` |  |" in table(whole)
    assert missing(package("(2.1)-(2.33)")) == ["2.34"]
    twice = package("(2.2), (2.3)", "(2.3)")
    assert claimed_twice(twice) == {"2.3": ["laws.py: f0", "laws.py: f1"]}
    assert [*claimed_twice(package("(2.19)", "(2.19)_4"))] == ["2.19"]
