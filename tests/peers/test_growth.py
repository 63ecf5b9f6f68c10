"""The growth of time and memory with lanes, modes, steps, corners and variables. Skipped unless
`pytest --bench DIR` asks for it.

    pytest tests/peers/test_growth.py --bench DIR

Writes `growth.json`, `growth.md` and `growth.png` into DIR. Times are processor times, which other
programs on the machine disturb least, medians over repeats, and one run where it takes longer than
a minute; memory is what the compiled program asks for: arguments, results and intermediate arrays.
The exponent p of a growth as n^p is fitted to the larger half of the sizes.
"""

import json
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax import plot
from fencejax.plot import style

from . import impacts
from .impacts import STANDARD

pytestmark = pytest.mark.bench

LONGEST = 200.0
"""Processor time [s] that a run may take: larger sizes are left out."""


class Axis(NamedTuple):
    """What grows: the sizes, and the program of a size with its argument."""

    title: str
    sizes: tuple[int, ...]
    program: Callable[[int], tuple[Callable[..., Any], Any]]


def peak(scene, fidelity=STANDARD):
    return fj.simulate(scene, fidelity=fidelity, only="peak_force").peak_force


def impact():
    """The 25 numbers of an oblique impact, and the function from them to its peak force."""
    numbers, of = impacts.impact()
    return numbers, lambda *given: of(*given)[0]


def lanes(grouped: bool):
    def program(count):
        numbers, of = impact()
        batch = impacts.spread(numbers, count)
        if grouped and count > 64:
            return lambda each: jax.lax.map(of, each, batch_size=64), batch
        return jax.vmap(of), batch

    return program


def modes(count):
    numbers, of = impact()
    return lambda x: of(x, STANDARD.replace(modes=count)), numbers


def steps(count):
    numbers, of = impact()
    fidelity = STANDARD.replace(step=impacts.DURATION / count, step_tolerance=None)
    return lambda x: of(x, fidelity), numbers


def corners(count):
    chosen = tuple(range(1, count + 1))
    scene = fj.scenes.whole_sort(fence_corners=chosen, border_corners=chosen)
    leaves, structure = jax.tree.flatten(scene)
    return lambda x: peak(jax.tree.unflatten(structure, list(x))), jnp.stack(leaves)


def variables(mode: str):
    def program(count):
        numbers, of = impact()
        fidelity = STANDARD.replace(gradient=mode)

        def along(x):
            return of([*x, *numbers[count:]], fidelity)

        return jax.value_and_grad(along), numbers[:count]

    return program


MANY = (1, 8, 64, 1024, 16384, 131072, 1048576)
COUNTS = (1, 2, 4, 8, 16, 25)
AXES = {
    "lanes, in groups of 64": Axis("lanes", MANY, lanes(True)),
    "lanes, all at once": Axis("lanes", MANY, lanes(False)),
    "modes": Axis("modes", (1, 2, 4, 8, 16, 39), modes),
    "steps": Axis("steps", (100, 1000, 10_000, 100_000), steps),
    "corners at fence and border each": Axis("corners", (1, 2, 3, 4), corners),
    "variables, gradient forward": Axis("variables", COUNTS, variables("forward")),
    "variables, gradient in reverse": Axis("variables", (1, 8, 25), variables("reverse")),
}


def measured(axis: Axis) -> Iterator[dict[str, float]]:
    """Times [s] and memory [bytes] by size, until the next would take too long."""
    last = None
    for size in axis.sizes:
        if last is not None and last["run"] * size / last["size"] > LONGEST:
            return
        function, argument = axis.program(size)
        begin = time.process_time()
        program = jax.jit(function).lower(argument).compile()
        compiling = time.process_time() - begin
        runs: list[float] = []
        while (len(runs) < 3 and sum(runs) < 60.0) or (len(runs) < 15 and sum(runs) < 1.0):
            begin = time.process_time()
            result = jax.block_until_ready(program(argument))
            runs.append(time.process_time() - begin)
            assert np.all(np.isfinite(jax.tree.leaves(result)[0]))
        asked = program.memory_analysis()
        memory = asked.temp_size_in_bytes + asked.output_size_in_bytes
        last = {
            "size": size, "run": float(np.median(runs)), "compile": compiling,
            "memory": memory + asked.argument_size_in_bytes,
        }  # fmt: skip
        yield last


def exponent(rows: list[dict[str, float]], key: str) -> float:
    """The exponent of a growth as a power of the size, by least squares over the larger half."""
    rows = rows[-max(2, (len(rows) + 1) // 2) :]
    size, value = (np.log([max(row[k], 1e-300) for row in rows]) for k in ("size", key))
    return float(np.polyfit(size, value, 1)[0])


COLUMNS = {"run": ("run", "ms", 1e3), "memory": ("memory", "kB", 1e-3)}


def table(found: dict[str, list[dict[str, float]]]) -> str:
    lines = [
        "| what grows | sizes | run [ms] | exponent | memory [kB] | exponent | compile [s] |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, rows in found.items():
        cells = [name, f"{rows[0]['size']:,}–{rows[-1]['size']:,}"]
        for key, (_, _, unit) in COLUMNS.items():
            ends = [f"{unit * row[key]:.3g}" for row in (rows[0], rows[-1])]
            cells += ["–".join(ends), f"{exponent(rows, key):.2f}"]
        cells.append("–".join(f"{row['compile']:.1f}" for row in (rows[0], rows[-1])))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def picture(found: dict[str, list[dict[str, float]]], path) -> None:
    """A column for each kind of size: time above, memory below."""
    titles = list(dict.fromkeys(AXES[name].title for name in found))
    figure = plot.figure(4.6, 11.0)
    panels = figure.subplots(2, len(titles), squeeze=False)
    for at, title in enumerate(titles):
        names = [name for name in found if AXES[name].title == title]
        for above, (key, (label, unit, scale)) in zip(panels[:, at], COLUMNS.items(), strict=True):
            plot.panel(above, f"{title} [1]", f"{label} [{unit}]" if at == 0 else "")
            values = [scale * row[key] for name in names for row in found[name]]
            sizes = sorted({int(row["size"]) for name in names for row in found[name]})
            # A decade at least, and room for the legend.
            lowest, highest = min(values) / 2, max(values) * 5
            ends = lowest, max(highest, 10 * lowest)
            above.set(xscale="log", yscale="log", ylim=ends)
            if sizes[-1] < 100:
                above.set_xticks(sizes, [str(size) for size in sizes])
            above.tick_params(which="minor", labelbottom=False, labelleft=False)
            for name, color in zip(names, style.LINES, strict=False):
                rows = found[name]
                kind = name.partition(", ")[2]
                power = f"$n^{{{exponent(rows, key):.2f}}}$"
                above.plot(
                    [row["size"] for row in rows], [scale * row[key] for row in rows],
                    "o-", color=color, markersize=3, label=f"{kind} {power}".strip(),
                )  # fmt: skip
            above.legend(frameon=False, fontsize="x-small", loc="upper left")
    figure.savefig(path, dpi=150)


def test_growth(bench_directory):
    found = {}
    for name, axis in AXES.items():
        found[name] = []
        for row in measured(axis):
            found[name].append(row)
            print(name, row, flush=True)
        jax.clear_caches()
        # What is known so far is kept.
        (bench_directory / "growth.json").write_text(json.dumps(found, indent=1) + "\n")
        (bench_directory / "growth.md").write_text(table(found))
        picture(found, bench_directory / "growth.png")
    # Lanes one after the other in groups, and steps, cost what they are many.
    for name in ("lanes, in groups of 64", "steps"):
        assert exponent(found[name], "run") < 1.2
    # Of the steps nothing is kept but their ends, a number of eight bytes each.
    first, *_, last = found["steps"]
    assert last["memory"] - first["memory"] < 8.1 * (last["size"] - first["size"])
