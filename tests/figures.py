"""The measured figures of the README and its pages: one record, and the blocks that show them.

    python tests/figures.py            # every figure, with the command that measures it again
    python tests/figures.py --write    # writes the pages' blocks anew

`figures.json` is the record. A group holds figures, or the rows of a table, and the `command` that
measures them; those of jobs are written by `headlines.py --record`, the others by hand from
what their command says. `figures.md` holds the text of the blocks: `{group[name]}` is a figure,
with a format such as `{group[name]:.0f}`, and with ` u` at the format's end its unit follows;
`{group}` is a whole table, `{group[row, column]}` one of its cells, and
`{group[row + row, column]}` the sum of several. In a page of `PAGES` a block stands between
`<!-- figures: NAME -->` and `<!-- end of figures -->`; whoever changes its text changes it in
`figures.md`.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
RECORD = Path(__file__).with_suffix(".json")
TEXTS = Path(__file__).with_suffix(".md")
# The README, and what referees read, beside what makes it.
PAGES = (
    ROOT / "README.md",
    ROOT / "optimize/concepts/CONCEPTS.md",
    ROOT / "tests/design/OPTIMIZERS.md",
    ROOT / "tests/peers/SPEED.md",
    ROOT / "tests/reference/VERIFICATION.md",
    ROOT / "tests/robustness/TRUST.md",
)
_LISTS = {"figures", "rows"}
BLOCK = re.compile(r"<!-- figures: (\w+) -->\n(.*?)\n<!-- end of figures -->", re.DOTALL)


def _shown(value: Any, form: str = "") -> str:
    """A value as text: nothing for what is not known, several with strokes between."""
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, list):
        return " / ".join(_shown(each, form) for each in value)
    if form.endswith("%"):
        return f"{100 * value:{form[:-1]}f} %"
    return format(value, form or ",g")


class Figure(NamedTuple):
    """A number, several, or a text, and its unit."""

    value: Any
    unit: str

    def __format__(self, spec: str) -> str:
        form = spec.removesuffix(" u")
        return _shown(self.value, form) + (f" {self.unit}" if form != spec else "")


class Group:
    """Figures by name, or a table, that one command measures."""

    def __init__(self, content: dict[str, Any], used: set):
        self._content, self._used = content, used

    def __getitem__(self, name: str) -> Figure:
        if "rows" in self._content:
            return self._cell(name)
        self._used.add((id(self._content), name))
        return Figure(**self._content["figures"][name])

    def _cell(self, name: str) -> Figure:
        """What stands in a row and a column of the table, or in several rows, summed."""
        names, _, column = name.rpartition(", ")
        rows = [self._content["rows"][row] for row in names.split(" + ")]
        cells = [row["values"][self._content["columns"].index(column) - 1] for row in rows]
        return Figure(cells[0] if len(cells) == 1 else sum(cells), rows[0]["unit"])

    def __format__(self, spec: str) -> str:
        self._used.add((id(self._content), None))
        first, *columns = self._content["columns"]
        lines = [f"| {' | '.join([first, *columns])} |", "| --- " * (1 + len(columns)) + "|"]
        for name, row in self._content["rows"].items():
            unit = f" {row['unit']}" if row["unit"] else ""
            cells = [
                _shown(value) + ("" if value is None or isinstance(value, str) else unit)
                for value in row["values"]
            ]
            lines.append(f"| {' | '.join([name, *cells])} |")
        return "\n".join(lines)


def record() -> dict[str, dict[str, Any]]:
    """The groups by name."""
    return json.loads(RECORD.read_text())


def group(command: str, found: dict[str, tuple[Any, str]]) -> dict[str, Any]:
    """A group of the record: what a command has found, each a value and its unit, by name."""
    named = {name: {"value": value, "unit": unit} for name, (value, unit) in found.items()}
    return {"command": command, "figures": named}


def table(command: str, head: str, rows: dict[str, dict[str, str]], columns) -> dict[str, Any]:
    """A group that is a table: `rows` of cells by column, empty where a row has none, under the
    title `head` and the titles of the `columns`."""
    cells = {
        name: {"unit": "", "values": [row.get(column, "") for column in columns]}
        for name, row in rows.items()
    }
    return {"command": command, "columns": [head, *columns], "rows": cells}


def write(groups: dict[str, dict[str, Any]]) -> None:
    """Write the record, a line a figure."""
    parts = []
    for name, group in groups.items():
        lines = [f" {_plain(name)}: {{"]
        lines += [f"  {_plain(k)}: {_plain(v)}," for k, v in group.items() if k not in _LISTS]
        (kind,) = group.keys() & _LISTS
        figures = (f"   {_plain(k)}: {_plain(v)}" for k, v in group[kind].items())
        parts.append("\n".join([*lines, f'  "{kind}": {{', ",\n".join(figures), "  }", " }"]))
    RECORD.write_text("{\n" + ",\n".join(parts) + "\n}\n")


def _plain(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def blocks() -> tuple[dict[str, str], list[str]]:
    """The text of every block with its figures, and the figures on record that none shows."""
    groups, used = record(), set()
    known = {name: Group(content, used) for name, content in groups.items()}
    texts = {name: text.format_map(known) for name, text in BLOCK.findall(TEXTS.read_text())}
    unused = []
    for group, content in groups.items():
        names = content.get("figures") or {None: ...}
        unused += [f"{group}: {n}" for n in names if (id(content), n) not in used]
    return texts, unused


def written(page: str) -> str:
    """A page's text with its blocks as they are to be."""
    texts, _ = blocks()

    def block(match: re.Match) -> str:
        return f"<!-- figures: {match[1]} -->\n{texts[match[1]]}\n<!-- end of figures -->"

    return BLOCK.sub(block, page)


def main(arguments) -> int:
    if "--write" in arguments:
        for page in PAGES:
            page.write_text(written(page.read_text()))
        return 0
    for name, group in record().items():
        print(f"\n{name}: {group['command']}")
        for title, figure in group.get("figures", {}).items():
            print(f"    {title}: {Figure(**figure):.6g u}")
        for title, row in group.get("rows", {}).items():
            print(f"    {title} [{row['unit']}]: {' | '.join(map(_shown, row['values']))}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
