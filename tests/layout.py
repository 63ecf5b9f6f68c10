"""The imports between modules, read from the source, for `test_layout.py`.

Every import statement counts, also inside functions and under `TYPE_CHECKING`: a reader follows
them all.
"""

import ast
import graphlib
import json
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import NamedTuple


class Import(NamedTuple):
    """One imported name: the file and line that import it, the importing module, the module that
    the statement names, and the name, `None` for `import module`."""

    file: Path
    line: int
    importer: str
    module: str
    name: str | None

    def __str__(self):
        what = self.module if self.name is None else f"{self.name} from {self.module}"
        return f"{self.file}:{self.line} imports {what}"


def module_name(file: Path, root: Path) -> str:
    """Dotted name of a file; a package's is its folder's."""
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def statements(tree: ast.AST, importer: str, is_package: bool, file: Path) -> Iterator[Import]:
    """The imports of a syntax tree."""
    parts = importer.split(".")
    package = parts if is_package else parts[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(file, node.lineno, importer, alias.name, None)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                yield Import(file, node.lineno, importer, base, alias.name)


def notebook_source(file: Path) -> str:
    """The code cells of a notebook, without IPython's own lines."""
    lines = []
    for cell in json.loads(file.read_text())["cells"]:
        if cell["cell_type"] == "code":
            lines += "".join(cell["source"]).splitlines()
    return "\n".join("" if line.lstrip().startswith(("%", "!")) else line for line in lines)


def _longest(graph: Mapping[str, set[str]]) -> int:
    """How many nodes the longest way through a graph without circles passes."""
    depths = {}
    for node in graphlib.TopologicalSorter(graph).static_order():
        depths[node] = 1 + max((depths[other] for other in graph.get(node, ())), default=0)
    return max(depths.values(), default=0)


class Layout:
    """A package in rooms: `floors` says on which floor each room stands, a folder or a file right
    under the package; `tools` are the rooms that every other one may use."""

    def __init__(self, root: Path, package: str, floors: Mapping[str, int], tools: set[str]):
        self.root, self.package, self.floors, self.tools = root, package, floors, tools
        self.files = {
            module_name(file, root): file for file in sorted((root / package).rglob("*.py"))
        }

    @cached_property
    def imports(self) -> list[Import]:
        """Every import between modules of the package."""
        found = []
        for name, file in self.files.items():
            tree = ast.parse(file.read_text())
            for one in statements(tree, name, file.name == "__init__.py", file):
                if one.module.split(".")[0] == self.package:
                    found.append(one)
        return found

    def room(self, module: str) -> str | None:
        """The room of a module; `None` for the package's own face."""
        parts = module.split(".")
        return parts[1] if len(parts) > 1 else None

    def target(self, one: Import) -> str:
        """The module that an import reaches: the one it names or, where the name is itself a
        module, that one, so that a module importing a neighbour does not import the room's face.
        """
        inner = f"{one.module}.{one.name}"
        if one.name is not None and inner in self.files:
            neighbours = self.room(inner) == self.room(one.importer)
            if neighbours or one.module == self.package:
                return inner
        return one.module

    @cached_property
    def graph(self) -> dict[str, set[str]]:
        """The modules that each module imports, faces of rooms included."""
        graph = {name: set() for name in self.files}
        for one in self.imports:
            if one.importer != (target := self.target(one)):
                graph[one.importer].add(target)
        return graph

    def circle(self) -> list[str]:
        """A circle of imports, or nothing."""
        try:
            graphlib.TopologicalSorter(self.graph).prepare()
        except graphlib.CycleError as error:
            return error.args[1]
        return []

    def rooms_without_a_floor(self) -> list[str]:
        """Rooms that the table lacks, and rooms of the table that are not there."""
        rooms = {room for name in self.files if (room := self.room(name)) is not None}
        return sorted(rooms ^ self.floors.keys())

    def climbs(self) -> list[str]:
        """Imports of a room from a floor that is not below, of the package's own face, and by a
        tool of anything but tools."""
        found = []
        for one in self.imports:
            here, there = self.room(one.importer), self.room(self.target(one))
            if here is None or here == there:
                continue
            if there is None:
                found.append(f"{one}: the package's face")
            elif there not in self.tools and self.floors[there] >= self.floors[here]:
                floors = f"floor {self.floors[there]} from floor {self.floors[here]}"
                found.append(f"{one}: {floors}")
        return found

    @cached_property
    def exports(self) -> dict[str, set[str]]:
        """The names that each package's `__init__` exports, as `X as X` or by `__all__`."""
        found = {}
        for name, file in self.files.items():
            if file.name != "__init__.py":
                continue
            names = found.setdefault(name, set())
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom):
                    names |= {a.asname for a in node.names if a.asname == a.name}
                elif isinstance(node, ast.Assign):
                    names |= {t.id for t in node.targets if isinstance(t, ast.Name)}
        return found

    def _reaches_inside(self, one: Import) -> bool:
        """Whether an import from outside a room goes past the room's face."""
        inner = f"{one.module}.{one.name}"
        if one.name is not None and inner in self.files and one.module == self.package:
            return False
        if self.room(one.module) is None:
            return False
        if one.module.count(".") > 1:
            return True
        # A file right under the package is its own face.
        return one.module in self.exports and one.name not in {None, *self.exports[one.module]}

    def inner_imports(self) -> list[str]:
        """Imports between rooms of what the other room's face does not export."""
        return [
            str(one)
            for one in self.imports
            if self.room(one.importer) not in (None, self.room(one.module))
            and self._reaches_inside(one)
        ]

    def outside(self, file: Path, importer: str) -> list[str]:
        """The same of a file outside the package, a script, test or notebook."""
        source = notebook_source(file) if file.suffix == ".ipynb" else file.read_text()
        found = statements(ast.parse(source), importer, file.name == "__init__.py", file)
        ours = (one for one in found if one.module.split(".")[0] == self.package)
        return [str(one) for one in ours if self._reaches_inside(one) or self._is_private(one)]

    def _is_private(self, one: Import) -> bool:
        """Whether an import takes a name of the package that begins with an underscore."""
        names = [*one.module.split("."), *([] if one.name is None else [one.name])]
        return any(name.startswith("_") and not name.endswith("__") for name in names)

    def depth_of_rooms(self) -> int:
        """The most rooms that an import runs through, the package's face aside."""
        graph = {}
        for one in self.imports:
            here, there = self.room(one.importer), self.room(self.target(one))
            if here is not None and there is not None and here != there:
                graph.setdefault(here, set()).add(there)
        return _longest(graph)

    def depth_within(self, room: str) -> int:
        """The most files of a room that an import of it runs through, its face included."""
        graph = {
            name: {other for other in used if self.room(other) == room}
            for name, used in self.graph.items()
            if self.room(name) == room
        }
        return _longest(graph)

    def long_files(self, lines: int) -> list[str]:
        """Files of the package with more lines than that."""
        sizes = {file: len(file.read_text().splitlines()) for file in self.files.values()}
        return [f"{file}: {size} lines" for file, size in sizes.items() if size > lines]
