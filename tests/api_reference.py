"""The reference of every public name, as web pages made by pdoc from the docstrings.

    pip install -e '.[dev]'
    python tests/api_reference.py DIR      # then open DIR/index.html

The pages need no network. That of `fencejax` has what a user calls; the rooms follow below it, a
page a file.
"""

import argparse
import inspect
import re
import typing
from pathlib import Path

from jaxtyping import Array, ArrayLike

_formatted = inspect.formatannotation
# Evaluated, `ArrayLike` is all that it stands for: half a line for each argument.
_MEMBERS = [_formatted(one) for one in typing.get_args(ArrayLike)]


def readable(annotation: str) -> str:
    """An annotation by the short names that the source has for it."""
    for glue in (", ", " | "):
        annotation = annotation.replace(glue.join(_MEMBERS), "ArrayLike")
    annotation = re.sub(r"(?:typing\.)?Union\[ArrayLike\]", "ArrayLike", annotation)
    annotation = re.sub(
        r"(?:typing\.)?Union\[ArrayLike, (?:NoneType|None)\]", "ArrayLike | None", annotation
    )
    annotation = annotation.replace(_formatted(Array), "Array")
    homes = r"\b(?:collections\.abc|typing|pathlib|fencejax(?:\.\w+)*)\.(?=[A-Z])"
    return re.sub(homes, "", annotation)


def write(folder: Path) -> Path:
    """Write the pages and return the first of them."""
    import pdoc

    def short(annotation, *arguments, **settings):
        return readable(_formatted(annotation, *arguments, **settings))

    # Both write signatures: `inspect` those of arguments, pdoc what is returned.
    inspect.formatannotation = pdoc.doc.formatannotation = short
    try:
        pdoc.render.configure(docformat="markdown", show_source=False)
        pdoc.pdoc("fencejax", output_directory=folder)
    finally:
        inspect.formatannotation = pdoc.doc.formatannotation = _formatted
    return folder / "index.html"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="DIR")
    print(f"wrote {write(parser.parse_args().folder)}")
