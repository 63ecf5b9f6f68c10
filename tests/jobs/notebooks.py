"""Notebooks run cell by cell, as a reader would run them."""

import ast
import json
import re
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from fencejax.plot import Film

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
# first_impact is short as it is, validation is quick as it is.
WITHOUT_SWITCH = ("first_impact", "validation")


def cells_of(path):
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def run(path, quick=True):
    """Run the code cells in one namespace, which is returned with what the cells show: the value
    of a last line that is an expression, by number of the cell."""
    names, shown, switches = {"__name__": "__main__"}, {}, 0
    for number, cell in enumerate(cells_of(path)):
        if cell["cell_type"] != "code":
            continue
        # Lines of Jupyter's own say where figures are shown.
        source = "".join(line for line in cell["source"] if not line.startswith("%"))
        if quick:
            source, found = re.subn(r"^quick = False\b", "quick = True", source, flags=re.M)
            switches += found
        tree, where = ast.parse(source), f"{path.name}, cell {number}"
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, where, "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), where, "eval"), names)
            if value is not None:
                shown[number] = value
    assert switches == (quick and path.stem not in WITHOUT_SWITCH)
    return names, shown


def assert_labelled(shown):
    """Something is drawn, and every axis says its unit."""
    drawn = [value for value in shown.values() if isinstance(value, Figure)]
    drawn += [value.axes.figure for value in shown.values() if isinstance(value, Film)]
    drawn += [plt.figure(number) for number in plt.get_fignums()]
    assert drawn
    for figure in drawn:
        for axes in figure.axes:
            shared = axes.get_shared_x_axes().get_siblings(axes)
            texts = [part.get_xlabel() for part in shared]
            assert axes.get_label() == "<colorbar>" or any(texts)
            assert all("[" in text for text in texts if text)
    plt.close("all")
