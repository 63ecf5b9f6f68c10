"""Every notebook runs from top to bottom, cell by cell, as a reader would run it."""

import json
from pathlib import Path

import matplotlib
import numpy as np
import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


@pytest.fixture
def lenient():
    """A reader's session: JAX's default promotion, figures drawn off screen."""
    import jax

    strict = {
        name: getattr(jax.config, name)
        for name in ("jax_numpy_dtype_promotion", "jax_numpy_rank_promotion")
    }
    backend = matplotlib.get_backend()
    jax.config.update("jax_numpy_dtype_promotion", "standard")
    jax.config.update("jax_numpy_rank_promotion", "allow")
    matplotlib.use("Agg")
    yield
    for name, value in strict.items():
        jax.config.update(name, value)
    matplotlib.use(backend)


def run(path):
    """Run the code cells in one namespace, which is returned."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    names = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            exec(compile(source, f"{path.name}, cell {number}", "exec"), names)
    return names


def test_there_are_notebooks():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs_and_carries_no_output(path, lenient):
    import matplotlib.pyplot as plt

    names = run(path)
    assert plt.get_fignums()
    for number in plt.get_fignums():
        for axes in plt.figure(number).axes:
            assert axes.get_xlabel() or axes.get_shared_x_axes().get_siblings(axes)
    plt.close("all")
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert all(not cell.get("outputs") for cell in cells)
    if path.stem == "first_impact":
        assert np.isclose(float(names["result"].peak_force), 1115.6, rtol=1e-2)
        assert 1.3 < names["elasticity"]["thickness $h_1$"] < 1.6
    if path.stem == "validation":
        assert names["outcome"].agrees
        # At the default settings N_stiff / N_max is 3.05: the open numbers move it either way.
        assert names["values"].min() < 3.05 < names["values"].max()
