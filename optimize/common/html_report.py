"""The self-contained page of a job's results: `report.html`.

A job provides its own sections of text, tables, figures and drawings; style, table of contents and
the command that reproduces the page are the same for all. The page loads nothing from elsewhere:
pictures are within the file, and there are no scripts. It is laid out for A4.
"""

import base64
import dataclasses
import functools
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from .files import write_whole

_TEMPLATE = Path(__file__).with_name("report.html.jinja")
NAME = "report.html"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclasses.dataclass(frozen=True)
class Text:
    """Paragraphs; lines that begin with "- " form a list."""

    text: str
    kind = "text"

    @property
    def blocks(self) -> list[tuple[bool, list[str]]]:
        """Whether it is a list, and its paragraphs or items."""
        found: list[tuple[bool, list[str]]] = []
        for line in (row for row in self.text.splitlines() if row.strip()):
            item = line.startswith("- ")
            if not found or found[-1][0] != item:
                found.append((item, []))
            found[-1][1].append(line.removeprefix("- "))
        return found


@dataclasses.dataclass(frozen=True)
class Table:
    """Rows of cells under titles; the first column is set to the left, numbers to the right.
    `strong`: rows set in bold."""

    titles: Sequence[str]
    rows: Sequence[Sequence[Any]]
    caption: str = ""
    note: str = ""
    strong: frozenset[int] = frozenset()
    kind = "table"

    @property
    def cells(self) -> list[list[tuple[str, bool]]]:
        """Texts of the cells, and whether most cells of the column are numbers."""
        texts = [[_raised(str(cell)) for cell in row] for row in self.rows]
        columns = [[text for text in column if text] for column in zip(*texts, strict=True)]
        numeric = [2 * sum(map(_numeric, column)) > len(column) for column in columns]
        return [list(zip(row, numeric, strict=True)) for row in texts]


@dataclasses.dataclass(frozen=True)
class Verbatim:
    """Verbatim text, such as a command or a file. `wrapped`: long lines are wrapped."""

    text: str
    caption: str = ""
    wrapped: bool = False
    kind = "verbatim"


@dataclasses.dataclass(frozen=True)
class Figure:
    """A picture with a caption. `data` is a URL that contains the picture."""

    data: str
    caption: str
    sheet: bool = False
    kind = "figure"

    @classmethod
    def of_file(cls, path: Path, caption: str) -> "Figure":
        """The figure in a PNG file."""
        return cls(_url("image/png", path.read_bytes()), caption)

    @classmethod
    def of_axes(cls, axes: Any, caption: str, sheet: bool = False) -> "Figure":
        """The figure of some axes as vector graphics; a `sheet` keeps its size and is
        printed on a page of its own."""
        import matplotlib

        stream = io.BytesIO()
        # Names of clipping paths depend on the salt alone: the same figure is the same file.
        with matplotlib.rc_context({"svg.hashsalt": "fencejax"}):
            none = dict.fromkeys(("Date", "Creator", "Format", "Type"))
            axes.get_figure(root=True).savefig(stream, format="svg", metadata=none)
        return cls(_url("image/svg+xml", stream.getvalue()), caption, sheet)


Part = Text | Table | Verbatim | Figure


@dataclasses.dataclass(frozen=True)
class Section:
    """A heading and what is below it."""

    title: str
    parts: Sequence[Part | str]


@dataclasses.dataclass(frozen=True)
class Report:
    """A page.

    **Fields:**

    - `title`: the job, and its subject.
    - `question`: of the job, a sentence.
    - `answer`: the result, a sentence or several lines.
    - `good`: whether the job succeeded; `None` where that does not apply.
    - `sections`: the rest, in order; empty ones are left out.
    """

    title: str
    question: str
    answer: str
    good: bool | None
    sections: Iterable[Section]

    def write(self, folder: Path) -> Path:
        """Write it into a folder as `report.html`."""
        sections = [
            {"id": f"s{index}", "title": one.title,
             "parts": [Text(part) if isinstance(part, str) else part for part in one.parts]}
            for index, one in enumerate((s for s in self.sections if s.parts), 1)
        ]  # fmt: skip
        page = _template().render(
            title=self.title, question=self.question, answer=Text(self.answer), good=self.good,
            sections=sections,
        )  # fmt: skip
        path = folder / NAME
        write_whole(path, page)
        return path


def figures(folder: Path, captions: dict[str, str]) -> list[Figure]:
    """The figures that exist in a folder, `NAME.png` by name."""
    places = {folder / f"{name}.png": caption for name, caption in captions.items()}
    return [Figure.of_file(path, text) for path, text in places.items() if path.exists()]


def of_markdown(text: str) -> list[Section]:
    """Sections of a page in Markdown that has headings, tables, pictures and paragraphs alone; the
    pictures are left out."""
    sections: list[tuple[str, list[Part | str]]] = [("", [])]
    for block in text.strip().split("\n\n"):
        lines = block.splitlines()
        if lines[0].startswith("#"):
            sections.append((lines[0].lstrip("# "), []))
            lines = lines[1:]
        if not lines or lines[0].startswith("!["):
            continue
        if lines[0].startswith("|"):
            rows = [[cell.strip(" `*") for cell in row.strip("|").split("|")] for row in lines]
            sections[-1][1].extend([Table(rows[0], rows[2:])] if rows[2:] else [])
        else:
            sections[-1][1].append(" ".join(lines))
    return [Section(title, parts) for title, parts in sections]


def _raised(text: str) -> str:
    """Integer powers as superscripts: m/s^2 as m/s²."""
    return re.sub(r"\^(-?\d)(?![\d.])", lambda found: found[1].translate(_RAISED), text)


def _numeric(text: str) -> bool:
    """Whether a cell is a number, with a unit perhaps."""
    bare = text[1:].strip() if text[:1] in ("+", "-", "−", "≤", "≥", "<", ">", "±") else text
    return len(text) < 32 and bare[:1].isdigit()


def _url(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


@functools.cache
def _template():
    import jinja2

    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    return environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
