"""The rooms of the package and their floors: who may import whom, and how big a file may get.

The analysis is in `layout.py`. It is first shown to find each kind of violation in packages made
for the purpose, and then applied to this repository.
"""

import json
import subprocess
from pathlib import Path

import pytest
from layout import Layout, module_name

ROOT = Path(__file__).parents[1]
TOP = {"README.md", "fencejax", "notebooks", "optimize", "pyproject.toml", "tests"}

# A room imports rooms of lower floors only, which its `__init__.py` names behind "May import". The
# tools may be used by every room, and are not named there.
FLOORS = {
    "__main__": 7,
    "sorter": 6,
    "study": 5,
    "design": 4,
    "plot": 4,
    "simulate": 4,
    "integrators": 3,
    "results": 3,
    "model": 2,
    "_refusals": 2,
    "scenes": 1,
    "parts": 0,
    "fidelity": 0,
    "printing": 0,
    "lanes": 0,
    "_check": 0,
    "_elementary": 0,
    "_text": 0,
    "_xla": 0,
    "derivatives": 0,
    "_identity": 0,
    "_kept_programs": 0,
    "_kept_executables": 0,
}
TOOLS = {
    "derivatives", "fidelity", "lanes", "printing", "_check", "_elementary", "_identity", "_text",
    "_xla", "_kept_programs", "_kept_executables",
}  # fmt: skip
# Private tools have no face; the tests of a tool import its file, and nobody else outside does.
TESTED_TOOLS = {
    "tests/conftest.py",
    "tests/scenes/test_checks.py",
    "tests/test_elementary.py",
    "tests/test_identity.py",
    "tests/test_kept_programs.py",
    "tests/test_xla.py",
}
DEPTH, LINES = 10, 400


# --- The analysis, on packages made for the purpose ------------------------------------------


HOUSE = {
    "__init__.py": "from .upper import work as work\nfrom . import lower as lower\n",
    "tool.py": "",
    "lower/__init__.py": "from .a import x as x\nfrom . import b as b\n",
    "lower/a.py": "from ..tool import t\nfrom .b import y\n",
    "lower/b.py": "x = hidden = 1\n",
    "left/__init__.py": "l = 1\n",
    "right/__init__.py": "from ..lower import x, b\n",
    "upper/__init__.py": "from .c import work as work\n",
    "upper/c.py": "from ..lower import x\nfrom ..left import l\nfrom .. import right\n",
}


def house(folder, **changes):
    """The package `house` of `HOUSE`, with more lines in some of its files."""
    for name, text in HOUSE.items():
        file = folder / "house" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text + changes.pop(name.replace("/", "_").removesuffix(".py"), ""))
    assert not changes
    floors = {"upper": 2, "left": 1, "right": 1, "lower": 0, "tool": 0}
    return Layout(folder, "house", floors, {"tool"})


def violations(layout):
    """How often each rule is broken."""
    return {
        "circle": bool(layout.circle()),
        "climb": len(layout.climbs()),
        "inner": len(layout.inner_imports()),
        "floor": len(layout.rooms_without_a_floor()),
    }


SOUND = {"circle": False, "climb": 0, "inner": 0, "floor": 0}


def test_layout_finds_nothing_in_a_sound_package(tmp_path):
    layout = house(tmp_path)
    assert violations(layout) == SOUND
    # upper, left or right, lower, tool; in `lower` the face, a and b.
    assert (layout.depth_of_rooms(), layout.depth_within("lower")) == (4, 3)
    assert layout.graph["house.upper.c"] == {"house.lower", "house.left", "house.right"}


@pytest.mark.parametrize("hide", ["{}", "if TYPE_CHECKING:\n    {}", "def f():\n    {}"])
@pytest.mark.parametrize(
    ("file", "line", "broken"),
    [
        # A circle of two files, by both ways of naming a neighbour, and through the room's face.
        ("lower_b", "from . import a", {"circle": True}),
        ("lower_b", "import house.lower.a", {"circle": True}),
        ("lower_b", "from . import x", {"circle": True}),
        # A climb; here it closes a circle, too.
        ("lower_b", "from ..upper import work", {"circle": True, "climb": 1}),
        ("lower_b", "import house.upper", {"circle": True, "climb": 1}),
        ("tool", "from .lower import x", {"circle": True, "climb": 1}),
        ("lower_b", "from house import upper", {"circle": True, "climb": 1}),
        ("lower_b", "import house", {"circle": True, "climb": 1}),
        # Rooms of one floor.
        ("left___init__", "from ..right import r", {"climb": 1, "inner": 1}),
        ("left___init__", "from .. import right", {"climb": 1}),
        # Another room's inner file, named by its path or by its room without being exported.
        ("upper_c", "from ..lower.b import y", {"inner": 1}),
        ("upper_c", "import house.lower.a", {"inner": 1}),
        ("upper_c", "from ..lower import a", {"inner": 1}),
        ("upper_c", "from house.lower import hidden", {"inner": 1}),
        # What is allowed: a module that the face exports, and a tool.
        ("upper_c", "from ..lower import b", {}),
        ("upper_c", "from .. import tool, lower", {}),
    ],
)
def test_layout_finds_each_violation(tmp_path, hide, file, line, broken):
    layout = house(tmp_path, **{file: hide.format(line) + "\n"})
    assert violations(layout) == {**SOUND, **broken}


def test_layout_finds_rooms_without_a_floor(tmp_path):
    layout = house(tmp_path)
    (tmp_path / "house" / "attic.py").touch()
    floors = {"cellar": 0, **layout.floors}
    found = Layout(tmp_path, "house", floors, {"tool"}).rooms_without_a_floor()
    assert found == ["attic", "cellar"]


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("import house\nfrom house import lower, work\nfrom house.lower import x, b", 0),
        ("from house.lower.b import y", 1),
        ("def f():\n    import house.lower.b", 1),
        ("from house.lower import a", 1),
        ("from house import _private", 1),
    ],
)
def test_layout_finds_what_scripts_and_notebooks_reach_inside(tmp_path, source, count):
    layout = house(tmp_path)
    script, notebook = tmp_path / "script.py", tmp_path / "notebook.ipynb"
    script.write_text(source)
    cell = {"cell_type": "code", "source": "%time\n!ls\n" + source}
    notebook.write_text(json.dumps({"cells": [cell]}))
    assert len(layout.outside(script, "script")) == count
    assert len(layout.outside(notebook, "notebook")) == count


def test_layout_counts_lines(tmp_path):
    layout = house(tmp_path, lower_b="\n" * 11)
    assert layout.long_files(12) == []
    assert layout.long_files(11) == [f"{tmp_path / 'house/lower/b.py'}: 12 lines"]


# --- This repository -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def package():
    """The layout of fencejax."""
    return Layout(ROOT, "fencejax", FLOORS, TOOLS)


@pytest.fixture(scope="module")
def jobs():
    """The layout of optimize: a job stands on `common` and knows no other job."""
    rooms = {path.stem for path in (ROOT / "optimize").iterdir() if path.stem[0] != "_"}
    floors = {room: int(room != "common") for room in rooms}
    return Layout(ROOT, "optimize", floors, set())


def listed(found):
    """A failure's message: one violation a line, paths from the repository's root."""
    return "\n" + "\n".join(found).replace(f"{ROOT}/", "")


def test_every_room_has_its_floor(package):
    assert package.rooms_without_a_floor() == []


def test_no_circles(package, jobs):
    assert not package.circle(), " -> ".join(package.circle())
    assert not jobs.circle(), " -> ".join(jobs.circle())


def test_no_climbs(package, jobs):
    found = package.climbs() + jobs.climbs()
    assert not found, listed(found)


def test_rooms_import_faces(package):
    found = package.inner_imports()
    assert not found, listed(found)


def test_outside_imports_faces(package):
    found = []
    for folder in ("optimize", "tests", "notebooks"):
        for file in sorted((ROOT / folder).rglob("*")):
            name = str(file.relative_to(ROOT))
            if file.suffix in {".py", ".ipynb"} and name not in TESTED_TOOLS:
                found += package.outside(file, module_name(file, ROOT))
    assert not found, listed(found)


def test_imports_are_shallow(package, jobs):
    rooms = [room for room in FLOORS if (ROOT / "fencejax" / room).is_dir()]
    depths = {room: package.depth_within(room) for room in rooms}
    depths |= {f"optimize.{room}": jobs.depth_within(room) for room in jobs.floors}
    depths["all rooms"] = package.depth_of_rooms()
    assert {room: depth for room, depth in depths.items() if depth > DEPTH} == {}


def test_no_file_is_long(package, jobs):
    found = package.long_files(LINES) + jobs.long_files(LINES)
    assert not found, listed(found)


def test_top_level():
    if not (ROOT / ".git").exists():
        pytest.skip("no git checkout: nothing says which files belong to the repository")
    files = subprocess.run(
        ["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, text=True, check=True
    )
    top = {path.split("/")[0] for path in files.stdout.split("\0") if path}
    assert {name for name in top if not name.startswith(".")} == TOP
