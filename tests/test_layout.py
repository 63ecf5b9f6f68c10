"""The code's own order: no circular imports, a map that names every module, a tidy top level."""

import ast
import graphlib
import re
import subprocess
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("fencejax", "optimize")
TOP = {"README.md", "fencejax", "notebooks", "optimize", "pyproject.toml", "tests"}


# --- Imports ------------------------------------------------------------------------------------


def modules(root, packages):
    """File of each module, by its dotted name; a package's is its `__init__`."""
    found = {}
    for package in packages:
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def executed(tree):
    """The nodes of a module, functions' bodies included, but what only type checkers read."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            continue
        yield node
        yield from executed(node)


def imports(name, file, known):
    """The modules of `known` that one of them imports, anywhere in it.

    A package that is imported on the way to one of its modules does not count: Python enters it
    first, whatever it holds.
    """
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    for node in executed(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            base = ".".join(above + ([node.module] if node.module else []))
            targets = {f"{base}.{alias.name}" for alias in node.names}
            yield from targets & known.keys()
            if base in known and not targets <= known.keys():
                yield base


def order(root, packages):
    """The modules, each after all that it imports.

    Raises `graphlib.CycleError` with the circle where there is one.
    """
    known = modules(root, packages)
    graph = {name: set(imports(name, file, known)) for name, file in known.items()}
    return list(graphlib.TopologicalSorter(graph).static_order())


def test_no_circular_imports():
    found = order(ROOT, PACKAGES)
    assert found.index("fencejax._check") < found.index("fencejax.simulate")
    assert found.index("fencejax.simulate") < found.index("fencejax")
    assert found.index("fencejax") < found.index("optimize.impacts")
    assert found.index("optimize.impacts") < found.index("optimize.peak_force")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("from . import second", "from . import first"),
        ("from .second import x", "import package.first"),
        ("from package.second import x", "def f():\n    from .first import y"),
        ("from . import x", ""),
    ],
)
def test_circles_are_found(tmp_path, first, second):
    package = tmp_path / "package"
    package.mkdir()
    (package / "__init__.py").write_text("from .first import y\n")
    (package / "first.py").write_text(first)
    (package / "second.py").write_text(second)
    with pytest.raises(graphlib.CycleError):
        order(tmp_path, ["package"])
    (package / "first.py").write_text(f"if TYPE_CHECKING:\n    {first}")
    assert set(order(tmp_path, ["package"])) == {"package", "package.first", "package.second"}


# --- The map and the top level ------------------------------------------------------------------


def mapped():
    """The paths in the first column of the README's map; a name alone is in the folder of the one
    before it."""
    section = (ROOT / "README.md").read_text().split("## Map of the code")[1].split("\n## ")[0]
    for row in re.findall(r"^\| (`.*?) \|", section, flags=re.MULTILINE):
        folder = ""
        for name in re.findall(r"`(.+?)`", row):
            folder = name[: name.rfind("/") + 1] or folder
            yield folder + name.removeprefix(folder)


def test_the_map_names_every_module_once():
    named = Counter(path for path in mapped() if path.startswith("fencejax/"))
    files = (ROOT / "fencejax").rglob("*.py")
    wanted = {str(file.relative_to(ROOT)) for file in files if file.name != "__init__.py"}
    missing, twice = sorted(wanted - named.keys()), [p for p in named if named[p] > 1]
    unknown = sorted(named.keys() - wanted)
    assert not missing, f"README's map lacks {missing}"
    assert not unknown, f"README's map names {unknown}, which are no modules"
    assert not twice, f"README's map names twice {twice}"


def test_the_map_names_what_there_is():
    paths = set(mapped())
    assert {"optimize/", "tests/", "notebooks/"} <= paths
    missing = [path for path in sorted(paths) if not (ROOT / path).exists()]
    assert not missing, f"README's map names {missing}, which are not there"


def test_top_level():
    if not (ROOT / ".git").exists():
        pytest.skip("no git checkout: nothing says which files belong to the repository")
    listed = subprocess.run(
        ["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, text=True, check=True
    )
    top = {path.split("/")[0] for path in listed.stdout.split("\0") if path}
    assert {name for name in top if not name.startswith(".")} == TOP
