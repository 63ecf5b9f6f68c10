"""Impacts and gradients a second over the number of lanes, on the accelerator that there is.

    pytest tests/peers/test_accelerator.py --bench DIR

On an NVIDIA GPU with XLA_FLAGS=--xla_gpu_enable_command_buffer=+WHILE,+CONDITIONAL before it: that
keeps the loop on the device.

Writes `accelerator.json`, `accelerator.md` and `accelerator.png` into DIR: values and gradients in
eight numbers a second, all lanes at once on JAX's default device; what a step of a loop costs there
that does nothing, which is what its launches cost; and how far results and statuses are from those
of the CPU, in groups of 64. Without an accelerator the same program runs on the CPU, and the page
says so. Skipped unless `--bench` asks for it, but for the page.
"""

import json
import re
import time
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import export

from fencejax import plot
from fencejax.plot import style

from .impacts import impact, spread

LONGEST = 30.0
"""Time [s] that a run may take: larger batches are left out."""
LANES = (1, 8, 64, 512, 4096, 32768, 262144, 1048576)
COMPARED = 4096
"""Lanes whose results are compared with the CPU's at most: more would take it minutes."""
STEPS = 1000
# In other company Newton's method stops elsewhere, where forces balance within 5e-7; gradients are
# sums of terms up to ten times as large as they are.
VALUE, GRADIENT = 5e-7, 5e-6


class Machine(NamedTuple):
    """The device that is measured: its name, and whether it is an accelerator."""

    name: str
    accelerated: bool

    @property
    def description(self) -> str:
        if self.accelerated:
            return f"Measured on {self.name}, all lanes at once; wall times."
        return (
            f"There is no accelerator on this machine: the program that would run on one ran on "
            f"its CPU ({self.name}), all lanes at once; processor times."
        )

    def now(self) -> float:
        """Time [s]; of a CPU processor time, which other programs disturb least."""
        return time.perf_counter() if self.accelerated else time.process_time()

    def median(self, run: Callable[[], Any]) -> float:
        """Of the times [s] of some runs, after a first."""
        jax.block_until_ready(run())
        runs: list[float] = []
        while len(runs) < 3 or (len(runs) < 15 and sum(runs) < 1.0):
            begin = self.now()
            jax.block_until_ready(run())
            runs.append(self.now() - begin)
        return float(np.median(runs))


def machine() -> Machine:
    device = jax.devices()[0]
    return Machine(device.device_kind, device.platform != "cpu")


def value(numbers):
    """Peak force [N] and status of an impact."""
    return impact()[1](numbers)


def gradient(numbers):
    """Peak force's gradient in the first eight numbers, and the status."""
    _, of = impact()
    slopes, status = jax.grad(lambda x: of([*x, *numbers[8:]]), has_aux=True)(numbers[:8])
    return slopes * numbers[:8], status


PROGRAMS = {"values": (value, VALUE), "gradients": (gradient, GRADIENT)}


def idle(lanes, steps):
    """A loop of so many steps that add to all lanes. How many is known while it runs, so that an
    accelerator asks after each whether it was the last, as it does in a simulation."""
    return jax.lax.while_loop(
        lambda state: state[0] < steps, lambda state: (state[0] + 1, state[1] + 1.0), (0, lanes)
    )


def of_cpu(function, batch):
    """What the CPU makes of lanes, in groups of 64."""
    with jax.default_device(jax.devices("cpu")[0]):
        lanes = jnp.asarray(np.asarray(batch))
        return jax.jit(lambda x: jax.lax.map(function, x, batch_size=64))(lanes)


def difference(found, known) -> float:
    """The largest difference of results, relative to the largest of a lane's; infinite where a
    status is another."""
    (a, status), (b, expected) = ((np.asarray(part) for part in pair) for pair in (found, known))
    if not np.array_equal(status, expected):
        return np.inf
    a, b = (part.reshape(len(status), -1) for part in (a, b))
    return float(np.max(np.abs(a - b) / np.max(np.abs(b), axis=1, keepdims=True)))


def measured(on: Machine, kind: str) -> list[dict[str, float]]:
    """A row for each number of lanes, until the next would take too long."""
    function, _ = PROGRAMS[kind]
    rows: list[dict[str, float]] = []
    numbers, _ = impact()
    known = of_cpu(function, spread(numbers, COMPARED))
    for lanes in LANES:
        if rows and rows[-1]["seconds"] * lanes / rows[-1]["lanes"] > LONGEST:
            break
        batch = spread(numbers, lanes)
        program = jax.jit(jax.vmap(function)).lower(batch).compile()
        few = min(lanes, COMPARED)
        found = jax.tree.map(lambda leaf, few=few: leaf[:few], program(batch))
        expected = jax.tree.map(lambda leaf, few=few: leaf[:few], known)
        seconds = on.median(lambda p=program, b=batch: p(b))
        rows.append({
            "lanes": lanes, "seconds": seconds, "a second": lanes / seconds,
            "difference": difference(found, expected),
        })  # fmt: skip
        print(kind, rows[-1], flush=True)
    return rows


def launches(on: Machine) -> list[dict[str, float]]:
    """The time [s] of a step that does nothing, by lanes."""
    rows = []
    for lanes in LANES:
        given = jnp.zeros(lanes), jnp.asarray(STEPS)
        program = jax.jit(idle).lower(*given).compile()
        seconds = on.median(lambda p=program, given=given: p(*given)) / STEPS
        rows.append({"lanes": lanes, "step": seconds})
    return rows


def page(on: Machine, found: dict[str, list[dict[str, float]]]) -> str:
    """What was found, as a page."""
    largest = max(len(rows) for rows in found.values())
    by_kind = {kind: {row["lanes"]: row for row in rows} for kind, rows in found.items()}
    lines = [
        on.description, "",
        "| lanes | values a second | off the CPU's | gradients a second | off the CPU's | an empty "
        "step [us] |", "| --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    for lanes in LANES[:largest]:
        cells = [f"{lanes:,}"]
        for kind in PROGRAMS:
            row = by_kind[kind].get(lanes)
            cells += ["", ""] if row is None else [
                f"{row['a second']:,.0f}", f"{row['difference']:.0e}"
            ]
        cells.append(f"{1e6 * by_kind['empty step'][lanes]['step']:.3g}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def picture(found: dict[str, list[dict[str, float]]], path) -> None:
    """How many a second, and the time of an empty step, over the lanes."""
    figure = plot.figure(3.4, 8.0)
    many, step = figure.subplots(1, 2)
    plot.panel(many, "lanes [1]", "a second [1/s]")
    plot.panel(step, "lanes [1]", "an empty step [us]")
    for kind, color in zip(PROGRAMS, style.LINES, strict=False):
        lanes, rates = zip(*((row["lanes"], row["a second"]) for row in found[kind]), strict=True)
        many.plot(lanes, rates, "o-", color=color, markersize=3, label=kind)
    lanes, steps = zip(*((r["lanes"], 1e6 * r["step"]) for r in found["empty step"]), strict=True)
    step.plot(lanes, steps, "o-", color=style.LINES[0], markersize=3)
    for each in (many, step):
        each.set(xscale="log", yscale="log")
    many.legend(frameon=False, fontsize="x-small", loc="upper left")
    figure.savefig(path, dpi=150)


@pytest.mark.bench
def test_accelerator(bench_directory):
    on = machine()
    found = {"empty step": launches(on)}
    for kind in PROGRAMS:
        found[kind] = measured(on, kind)
    row = {"device": on.name, "accelerated": on.accelerated, **found}
    (bench_directory / "accelerator.json").write_text(json.dumps(row, indent=1) + "\n")
    (bench_directory / "accelerator.md").write_text(page(on, found))
    picture(found, bench_directory / "accelerator.png")
    print(page(on, found))
    for kind, (_, bound) in PROGRAMS.items():
        assert max(row["difference"] for row in found[kind]) < bound


@pytest.mark.parametrize("accelerated", [True, False])
def test_the_page_says_where_it_was_measured(accelerated, tmp_path):
    rows = [{"lanes": 1, "seconds": 0.5, "a second": 2.0, "difference": 1e-12}]
    found = {"values": rows, "gradients": [], "empty step": [{"lanes": 1, "step": 1e-6}]}
    first, _, *table = page(Machine("a device", accelerated), found).splitlines()
    assert first.startswith("Measured on a device" if accelerated else "There is no accelerator")
    assert table[-1] == "| 1 | 2 | 1e-12 |  |  | 1 |"


def test_another_status_is_no_small_difference():
    same = np.ones((2, 3)), np.zeros(2)
    assert difference(same, same) == 0.0
    assert difference((same[0] + [[0, 0, 1e-3]], same[1]), same) == pytest.approx(1e-3)
    assert difference((same[0], np.array([0, 1])), same) == np.inf


@pytest.mark.parametrize("kind", PROGRAMS)
def test_the_programs_are_lowered_for_a_gpu_unchanged(kind):
    """The same operations as for the CPU, and no call of a library that a GPU would lack."""
    function, _ = PROGRAMS[kind]
    lanes = jax.ShapeDtypeStruct((64, impact()[0].size), jnp.float64)
    both = [
        export.export(jax.jit(jax.vmap(function)), platforms=[platform])(lanes)
        for platform in ("cuda", "cpu")
    ]
    texts = [program.mlir_module() for program in both]
    assert both[0].platforms == ("cuda",)
    operations, expected = (Counter(re.findall(r"stablehlo\.\w+", text)) for text in texts)
    assert operations == expected
    assert operations["stablehlo.while"] > 0
    assert operations["stablehlo.custom_call"] == 0
