"""The equations of the source paper, (2.1)-(2.34), and the code that computes each of them.

    python tests/equations.py           # prints the table
    python tests/equations.py --write   # puts it into the README

A docstring claims an equation by a paragraph of its own that begins with `Paper:`, then the
numbers, then, where the code is not what is printed, what differs there:

    Paper: (2.3)-(2.7), (2.19)_1-3. There in polar coordinates.
"""

import ast
import re
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
ALL = [f"2.{number}" for number in range(1, 35)]
BEGIN, END = "<!-- equations -->", "<!-- end of equations -->"
_CLAIM = re.compile(r"^Paper: (?P<numbers>[^.]*(?:\.\d[^.]*)*)\.(?:\s+(?P<note>.*))?$", re.DOTALL)
_NUMBER = re.compile(r"\(2\.(\d+)\)(?:_([\d-]+))?(?:-\(2\.(\d+)\))?")


class Home(NamedTuple):
    """What claims equations: its file from the repository's root, its name, the equations and,
    where they are parts of a system such as (2.19)_4, which; and what the paper has in its place.
    """

    file: str
    name: str
    equations: tuple[str, ...]
    note: str


def _expanded(numbers: str) -> tuple[str, ...]:
    found = []
    for first, part, last in _NUMBER.findall(numbers):
        if part:
            low, _, high = part.partition("-")
            found += [f"2.{first}_{k}" for k in range(int(low), int(high or low) + 1)]
        else:
            found += [f"2.{k}" for k in range(int(first), int(last or first) + 1)]
    return tuple(found)


def claims(docstring: str) -> list[tuple[tuple[str, ...], str]]:
    """The equations that a docstring claims, each with its note.

    Raises `ValueError` for a claim that names none.
    """
    found = []
    for paragraph in re.split(r"\n\s*\n", docstring):
        text = " ".join(paragraph.split())
        if not text.startswith("Paper:"):
            continue
        claim = _CLAIM.match(text)
        equations = () if claim is None else _expanded(claim["numbers"])
        if not equations:
            raise ValueError(f"{text!r} names no equation.")
        found.append((equations, claim["note"] or ""))
    return found


def homes(root: Path, package: str = "fencejax") -> list[Home]:
    """Every claim of a package, in the order of the equations."""
    found = []

    def visit(node, names, file):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.FunctionDef, ast.ClassDef)):
                inner = [*names, child.name]
                for equations, note in claims(ast.get_docstring(child) or ""):
                    path = file.relative_to(root / package).as_posix()
                    found.append(Home(path, ".".join(inner), equations, note))
                visit(child, inner, file)

    for file in sorted((root / package).rglob("*.py")):
        visit(ast.parse(file.read_text()), [], file)
    return sorted(found, key=lambda home: _place(home.equations[0]))


def _place(equation: str) -> tuple[int, int]:
    number, _, part = equation.partition("_")
    return int(number.split(".")[1]), int(part or 0)


def missing(found: list[Home]) -> list[str]:
    """The paper's equations that nothing claims."""
    claimed = {equation.split("_")[0] for home in found for equation in home.equations}
    return [equation for equation in ALL if equation not in claimed]


def claimed_twice(found: list[Home]) -> dict[str, list[str]]:
    """Equations with more than one home; parts of a system may be in different ones."""
    by_equation = {}
    for home in found:
        for equation in home.equations:
            by_equation.setdefault(equation, []).append(f"{home.file}: {home.name}")
    whole = {equation for equation in by_equation if "_" not in equation}
    for equation in list(by_equation):
        number, _, part = equation.partition("_")
        if part and number in whole:
            by_equation[number] += by_equation.pop(equation)
    return {equation: names for equation, names in by_equation.items() if len(names) > 1}


def _spelled(equations: tuple[str, ...]) -> str:
    """(2.3)–(2.7), (2.19)₄: runs of numbers as ranges."""
    parts = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
    runs = []
    for equation in equations:
        number, part = _place(equation)
        last = runs[-1][-1] if runs else None
        if last in {(number - 1, 0), (number, part - 1)} and bool(part) == bool(last[1]):
            runs[-1].append((number, part))
        else:
            runs.append([(number, part)])
    texts = []
    for run in runs:
        (first, part), (last, last_part) = run[0], run[-1]
        if part:
            low, high = (str(k).translate(parts) for k in (part, last_part))
            texts.append(f"(2.{first}){low}" + (f"₋{high}" if high != low else ""))
        elif len(run) == 2:
            texts.append(f"(2.{first}), (2.{last})")
        else:
            texts.append(f"(2.{first})" + (f"–(2.{last})" if len(run) > 2 else ""))
    return ", ".join(texts)


def table(found: list[Home]) -> str:
    """The table of the README, in Markdown."""
    lines = ["| equation | file in `fencejax/` | function or class | what the paper has |"]
    lines.append("| --- | --- | --- | --- |")
    for home in found:
        note = home.note.removeprefix("There ").rstrip(".")
        equations = _spelled(home.equations)
        lines.append(f"| {equations} | `{home.file}` | `{home.name}` | {note} |")
    return "\n".join(lines)


def written(readme: str, found: list[Home]) -> str:
    """The README's text with the table between its markers."""
    before, rest = readme.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n{table(found)}\n{END}{after}"


def main(arguments):
    found = homes(ROOT)
    print(table(found))
    if "--write" in arguments:
        readme = ROOT / "README.md"
        readme.write_text(written(readme.read_text(), found))
    return int(bool(missing(found) or claimed_twice(found)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
