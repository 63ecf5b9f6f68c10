"""Where each fidelity is right, where it warns and where it refuses.

    python -m optimize.stability_map --out out

varies every number of one oblique impact over the whole range of a sweep, by itself and in pairs,
and compares the peak force with `Fidelity.reference` along arcs; where its steps of 25 us do not
suffice, with steps of 12.5 us. A point is

- right: a good status, and the error of the peak within the fidelity's promise;
- off: a good status, and an error beyond the promise, which must not occur;
- warned: a status from `PEAK_AT_END` on, which says what to change, or no reliable reference;
- refused: out of bounds, or not a number.

Writes `stability_axes.png`, `stability_pairs.png` and `stability_map.json`. The exit status is 0
where no point is off.
"""

import dataclasses
import json
import time
from pathlib import Path

import jax
import numpy as np

import fencejax as fj
from fencejax.study import in_chunks

from ..common import command, flags
from ..common.report import write_json
from . import page
from .picture import draw_axes, draw_pairs
from .scenes import AXES, ORDINARY, impact

PROMISE = {"coarse": 0.015, "fast": 0.01, "standard": 0.01, "reference": 0.005}
PAIRS = (
    ("mass", "stiffness"), ("thickness", "modulus"), ("approach", "belt"), ("mass", "thickness"),
)


@dataclasses.dataclass(frozen=True)
class StabilityConfig:
    """Numbers of the job; see `--help`."""

    out: Path = flags.field(Path("out/stability"), "folder to write into")
    fidelities: tuple[str, ...] = flags.field(
        ("fast", "standard"), "the rungs to map", choices=flags.FIDELITIES, metavar="FIDELITIES"
    )
    points: int = flags.field(33, "points along an axis", least=2)
    side: int = flags.field(17, "points along each side of a pair", least=2)
    duration: float = flags.field(0.1, "length of an impact [s]", above=0)
    lanes: int = flags.field(64, "impacts run at once", least=1)

    def __post_init__(self):
        flags.check(self)

    def quick(self) -> "StabilityConfig":
        """One rung, few points."""
        return dataclasses.replace(self, fidelities=("fast",), points=9, side=5)


def _along(name: str, count: int) -> np.ndarray:
    low, high, _ = AXES[name]
    return np.geomspace(low, high, count)


def _rows(config: StabilityConfig) -> list[dict[str, float]]:
    """Axes one after the other, then the pairs."""
    rows = []
    for name in AXES:
        rows += [_changed({name: value}) for value in _along(name, config.points)]
    for one, other in PAIRS:
        for a in _along(one, config.side):
            rows += [_changed({one: a, other: b}) for b in _along(other, config.side)]
    return rows


def _changed(changes: dict[str, float]) -> dict[str, float]:
    row = ORDINARY | changes
    return row | {"ride": row["belt"]}


def _run(
    fidelity: fj.Fidelity, config: StabilityConfig, rows, say
) -> tuple[np.ndarray, np.ndarray]:
    """Statuses and peak forces [N] of all rows, `lanes` at a time."""

    @jax.jit
    @jax.vmap
    def run(x):
        scene = impact(x, config.duration)
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
        return result.status, result.peak_force

    def report(done, total):
        if done % (8 * config.lanes) == 0:
            say(f"  {done} of {total}")

    numbers = {name: np.array([row[name] for row in rows]) for name in ORDINARY}
    return in_chunks(run, numbers, config.lanes, progress=report)


RIGHT, OFF, WARNED, REFUSED = range(4)


def verdicts(status, peak, true, promise: float) -> np.ndarray:
    """RIGHT, OFF, WARNED or REFUSED for each point."""
    error = np.abs(peak - true) / np.where(true > 0, true, 1.0)
    kind = np.where(error <= promise, RIGHT, OFF)
    kind = np.where(status > fj.Status.LEFT_OVER_TIP, WARNED, kind)
    return np.where(status >= fj.Status.INCONSISTENT, REFUSED, kind)


def main(config: StabilityConfig, quiet: bool = False) -> bool:
    """Run the job; whether no point is off."""
    printed, began = command.begin(quiet), time.perf_counter()

    def say(text):
        printed(f"{time.perf_counter() - began:6.1f} s  {text}")

    config.out.mkdir(parents=True, exist_ok=True)
    rows = _rows(config)
    say(f"{len(rows)} impacts: the truth")
    truth = fj.Fidelity.reference(geometry="arc", modes=8)
    judged, true = _run(truth, config, rows, say)
    hard = np.flatnonzero(judged > fj.Status.LEFT_OVER_TIP)
    say(f"{hard.size} of them again, finer")
    finer = truth.replace(step=1.25e-5)
    judged[hard], true[hard] = _run(finer, config, [rows[k] for k in hard], say)
    doubt = np.where(judged > fj.Status.LEFT_OVER_TIP, fj.Status.PEAK_AT_END, 0)
    report: dict = {"impacts": len(rows), "promise": PROMISE, "fidelities": {}}
    kinds, fine = {}, True
    for name in config.fidelities:
        say(name)
        status, peak = _run(getattr(fj.Fidelity, name)(), config, rows, say)
        kind = verdicts(np.maximum(status, doubt), peak, true, PROMISE[name])
        kinds[name] = (kind, status)
        good, off = int(np.sum(kind <= OFF)), int(np.sum(kind == OFF))
        error = np.abs(peak - true) / np.where(true > 0, true, 1.0)
        fine = fine and off == 0
        report["fidelities"][name] = {
            "right": good - off, "off": off, "warned": int(np.sum(kind == WARNED)),
            "refused": int(np.sum(kind == REFUSED)),
            "largest error under a good status": float(np.max(error[kind <= OFF], initial=0.0)),
            "statuses": {
                s.name: int(np.sum(status == s)) for s in fj.Status if np.any(status == s)
            },
            "off at": [
                {k: rows[i][k] for k in rows[i] if rows[i][k] != ORDINARY[k]}
                | {"error": float(error[i])}
                for i in np.flatnonzero(kind == OFF)
            ],
        }
        counts = {k: v for k, v in report["fidelities"][name].items() if k != "off at"}
        say(f"{name}: {json.dumps(counts)}")
    write_json(config.out / "stability_map.json", report)
    axes = {name: _along(name, config.points) for name in AXES}
    draw_axes(config.out / "stability_axes.png", axes, kinds)
    begin = len(AXES) * config.points
    draw_pairs(config.out / "stability_pairs.png", PAIRS, config.side, begin, kinds)
    page.write(config, report, fine)
    say(f"written to {config.out}")
    return fine


configure = flags.reader(
    StabilityConfig,
    "optimize.stability_map",
    (__doc__ or "").split("\n")[0],
    quick="one rung, few points",
)


def run():
    """The job from the command line."""
    command.run("stability_map", configure, main, succeeded=bool)
