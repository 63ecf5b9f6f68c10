"""Text of files that other programs have saved, and its columns."""

import csv
import io
import itertools
import re
from pathlib import Path

_HEADER = re.compile(r"\s*([^\[\]()]+?)\s*(?:[\[(]\s*([^\[\]()]*?)\s*[\])])?\s*")
# The first line of a file by Excel, which names the separator.
_SEPARATOR = re.compile(r"\s*\"?sep=([,;\t])\"?[\s,;]*", re.IGNORECASE)


def refuse_folder(path: Path) -> None:
    """Raise `OSError` where a folder is named in place of a file to read."""
    if path.is_dir():
        raise IsADirectoryError(f"{path} must be a file, but is a folder. Name a file in it.")


def of(path: Path) -> str:
    """A file's text: UTF-8, UTF-16 or, as spreadsheets save it, the Windows encoding of western
    Europe.

    Raises `OSError` where there is no such file, or a folder, and `ValueError` that names it where
    it is no text.
    """
    refuse_folder(path)
    data = path.read_bytes()
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding == "utf-8-sig" and 0 not in data:
            try:
                return data.decode("cp1252")
            except UnicodeDecodeError:
                pass
        raise ValueError(
            f"{path}: must be text in UTF-8, but byte {error.start} is not. Save it as CSV."
        ) from error


class Rows:
    """The lines of a file without comments and empty lines, split into cells.

    **Fields:**

    - `path`: of the file.
    - `first`, `header`: number and text of the line of titles; `titles`: its cells.
    - `separator`: a comma, semicolon or tab, as the first line `sep=` names it, or else the one
      that is most frequent in the header.
    - `rows`: the number and the cells of every further line.
    """

    def __init__(self, path: Path):
        """**Arguments:** `path` of the file.

        Raises `OSError` where there is no such file, and `ValueError` that names the file and the
        line where it is empty, or a row has another number of cells than the header.
        """
        self.path = path
        lines = [
            (number, line)
            for number, line in enumerate(of(path).splitlines(), start=1)
            if line.strip() and not line.lstrip().startswith("#")
        ]
        named = _SEPARATOR.fullmatch(lines[0][1]) if lines else None
        lines = lines[1:] if named else lines
        lines = list(itertools.dropwhile(lambda line: not line[1].strip(" ,;\t"), lines))
        if not lines:
            raise ValueError(f"{path}: must hold a header and rows of numbers, but is empty.")
        self.first, self.header = lines[0]
        self.separator = named[1] if named else max(",;\t", key=self.header.count)
        self.titles = [title.strip() for title in self._cells(*lines[0])]
        self.rows = [(number, self._row(number, line)) for number, line in lines[1:]]

    def _cells(self, line: int, text: str) -> list[str]:
        try:
            return next(csv.reader(io.StringIO(text), delimiter=self.separator, strict=True))
        except csv.Error as error:
            raise ValueError(
                f"{self.path}, line {line}: cannot be read as CSV: {error}."
            ) from error

    def _row(self, line: int, text: str) -> list[str]:
        cells, wanted = self._cells(line, text), len(self.titles)
        if len(cells) != wanted:
            # Each number is split in two.
            commas = self.separator == "," and len(cells) == 2 * wanted
            remedy = " If these are decimal commas, separate columns by semicolons." * commas
            raise ValueError(
                f"{self.path}, line {line}: must have {wanted} columns as the header, but has "
                f"{len(cells)}.{remedy}"
            )
        return cells


def name_and_unit(title: str) -> tuple[str, str | None]:
    """A title's name and unit: `"Mass (g)"` and `"Mass [g]"` are `"Mass"` in `"g"`."""
    match = _HEADER.fullmatch(title)
    return ("", None) if match is None else (match[1].strip(), match[2])


def key(title: str) -> str:
    """The key that a title's name stands for: `"Tip deflection [mm]"` is `"tip_deflection"`."""
    return re.sub(r"[\s-]+", "_", name_and_unit(title)[0].lower())
