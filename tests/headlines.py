"""The default run of every job, and its headline figures beside those on record.

    python tests/headlines.py --out DIR                  # all jobs, compared with the record
    python tests/headlines.py --out DIR pareto sweep     # some
    python tests/headlines.py --out DIR --record pareto  # writes its figures on record anew

Each job runs with its defaults (the two that map accuracy with `--quick`) in a process of its own,
as many of them at once as there are cores, and has to end with status 0 within the time given
(`--limit`). The processor time is printed and recorded, which other programs disturb least. Its
figures may differ from the record, `figures.json`, by the tolerance that stands beside them: that
of the optimiser for optima, of the fidelity for simulations of given designs, of the sample for
statistics. The README takes its figures from there (`python tests/figures.py --write`).
"""

import argparse
import concurrent.futures
import functools
import json
import operator
import os
import shlex
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import figures

import fencejax as fj


class Figure(NamedTuple):
    """A figure of a job's output: the keys that lead to it, its unit, and by what share of itself
    it may differ from the record."""

    keys: tuple[str | int, ...]
    unit: str
    tolerance: float


class Run(NamedTuple):
    """A job's module, its arguments, the file that it writes and the figures in it; and what else
    is `demanded` of it, by name: the keys that lead to it and what must stand there."""

    module: str
    arguments: tuple[str, ...]
    file: str
    figures: dict[str, Figure]
    demanded: Mapping[str, tuple[tuple[str, ...], Any]] = {}


# Of a search: whether it ended at an optimum, how many of its evaluations failed, and how many of
# the numbers that confirm it are in doubt.
_OPTIMAL = {"optimal": (("optimal",), True)}
_CONFIRMED = {"numbers in doubt": (("in_doubt",), 0)}
_SEARCH = _OPTIMAL | _CONFIRMED | {"evaluations lost": (("lost",), 0)}


def _force(*keys: str | int, tolerance: float = 0.01) -> Figure:
    return Figure(keys, "N", tolerance)


def _paper(statement: str, number: str, unit: str = "1", tolerance: float = 0.01) -> Figure:
    """A number that a statement of the paper is judged by."""
    return Figure(("by_statement", statement, "numbers", number), unit, tolerance)


def _concepts(names: tuple[str, ...]) -> dict[str, Figure]:
    """The least force [N] and acceleration [g] of concepts, by parcels an hour."""
    return {
        f"{name}, {minimised} at {rate}": Figure(("fronts", minimised, name, rate), unit, 0.05)
        for name in names
        for minimised, unit in (("peak_force", "N"), ("peak_load", "g"))
        for rate in ("2400", "3000", "3600")
    }


_SIDE = ("side_by_side",)
_NEAR = ("points", "distance=0.8 m", "elasticities", "peak_force")
_QUANTILES = ("quantiles", "peak_force")
_AT_FAST = ("fidelities", "fast")
_MEDIANS = [("rungs", k, "errors", "peak_force", "value") for k in (0, 1)]
RUNS = {
    "peak_force": Run("peak_force", (), "result.json", {
        "two-link fence": _force(*_SIDE, "two-link", "peak_force", tolerance=1e-3),
        "optimum": _force(*_SIDE, "optimum", "peak_force"),
        "evaluations": Figure(("evaluations",), "1", 0.5),
    }),
    "peak_force, worst case": Run("peak_force", ("--worst-case",), "result.json", {
        "two-link fence": _force(*_SIDE, "two-link", "peak_force", tolerance=1e-3),
        "one-link fence": _force(*_SIDE, "one-link", "peak_force", tolerance=1e-3),
        "optimum": _force(*_SIDE, "optimum", "peak_force"),
    }),
    "co_design": Run("co_design", (), "co_design.json", {
        "worst sort before": Figure(("worst_force_before",), "N", 1e-3),
        "worst sort": _force("worst_force_after"),
    }, _SEARCH),
    "co_design, honest": Run("co_design", ("--sorter", "honest"), "co_design.json", {
        "worst sort before": Figure(("worst_force_before",), "N", 1e-3),
        "worst sort": _force("worst_force_after"),
        "constant push": Figure(("constant_push",), "N", 0.02),
    }, _SEARCH),
    # The optimiser's tolerance is 0.5 %; the sample's interval is wider, but it is drawn alike.
    "robust_design": Run("robust_design", (), "robust.json", {
        "severity, after over before": Figure(("ratio", "value"), "1", 0.03),
    }, _OPTIMAL | {"parcels left out": (("fresh", "after", "excluded"), 0)}),
    # Designs within 2 % of each other are confirmed as one.
    "design": Run("design", (), "design.json", {
        "worst sort before": Figure(("solutions", 0, "objective", "before"), "N", 1e-3),
        "worst sort": Figure(("solutions", 0, "objective", "after"), "N", 0.02),
    }),
    "pareto": Run("pareto", (), "front.json", {
        "least force on the front": _force("least_force", tolerance=0.02),
    }, _CONFIRMED),
    "concepts": Run("concepts", (), "concepts.json", _concepts((
        "rigid", "rigid+pad", "rigid+shaft", "rigid+clutch", "rigid+motion", "rigid+torque",
        "one_link", "one_link+clutch", "two_link", "two_link+curved", "two_link+pad",
        "two_link+motion", "two_link+pad+motion", "two_link+torque",
    ))),
    "reproduce_paper": Run("reproduce_paper", (), "result.json", {
        "drop, two-link": _paper("drop", "N_stiff / N_max, two-link"),
        "drop, one-link": _paper("drop", "N_stiff / N_max, one-link"),
        "tip deflection, two-link": _paper("tip", "tip deflection, two-link", "m"),
        "tip deflection, one-link": _paper("tip", "tip deflection, one-link", "m"),
        "static friction, two-link": _paper("static", "static friction, two-link", "s", 0.05),
        "static friction, one-link": _paper("static", "static friction, one-link", "s", 0.05),
        "steps at which the force rises with the mass": _paper("mass", "rising steps, force"),
        "steps at which it rises with the place": _paper("R", "rising steps, force"),
        "largest loss": _paper("joint", "largest loss against the one-link fence"),
        "its place": _paper("joint", "largest loss at R", "m"),
        "loss at the outermost place": _paper("joint", "loss at the outermost R", "1", 0.05),
        "difference of the forces, impact":
            _paper("alike, impact", "difference of N_max", "1", 0.05),
        "difference of the forces, slide":
            _paper("alike, slide", "difference of N_max", "1", 0.05),
        "last contact of the impact":
            _paper("ends, impact", "y of C_s at the last contact, two-link", "m"),
        "last contact of the slide":
            _paper("ends, slide", "y of C_s at the last contact, two-link", "m"),
        "ringing left, two-link":
            _paper("ringing", "share of the deflection, two-link", "1", 0.1),
        "ringing left, one-link":
            _paper("ringing", "share of the deflection, one-link", "1", 0.1),
        "worst place, two-link": _paper("free end", "place of the largest N_max, two-link", "m"),
        "worst place, one-link": _paper("free end", "place of the largest N_max, one-link", "m"),
        "force at 0.8 m, two-link": _paper("rigid third", "N_max at R = 0.8 m, two-link", "N"),
        "force at 0.8 m, one-link": _paper("rigid third", "N_max at R = 0.8 m, one-link", "N"),
        "paths apart, impact":
            _paper("paths", "largest distance of the paths, impact", "m", 0.05),
        "restitution of 1 kg": _paper("restitution", "restitution, 1 kg"),
        "restitution of 30 kg": _paper("restitution", "restitution, 30 kg"),
        "speed at the corner": _paper("fall", "normal speed at the corner", "m/s"),
        "speed at the tip": _paper("fall", "normal speed at the tip", "m/s"),
    }),
    "identify": Run("identify", ("--demo",), "result.json", {
        "modulus": Figure(("parameters", "youngs_modulus", "value"), "Pa", 5e-3),
        "its standard error":
            Figure(("parameters", "youngs_modulus", "standard_error"), "1", 0.05),
    }),
    # `standard` promises values within 2.5 % and gradients within 15 %, and keeps them many times
    # over in ordinary impacts; the points of the sample are always the same.
    "sensitivity": Run("sensitivity", (), "result.json", {
        "elasticity of the mass": Figure((*_NEAR, "mass"), "1", 0.02),
        "elasticity of the thickness": Figure((*_NEAR, "thickness"), "1", 0.02),
        "share of the length ratio":
            Figure(("shares", "peak_force", "length_ratio", "total", "value"), "1", 0.02),
    }),
    "sweep, a grid": Run("sweep", (), "result.json", {
        "median": _force(*_QUANTILES, "0.5"),
        "in 95 %": _force(*_QUANTILES, "0.95"),
    }),
    # None may be off under a good status; which design is right or warned of may change where a
    # measure is just at its bound.
    "stability_map, quick": Run("stability_map", ("--quick",), "stability_map.json", {
        "designs": Figure(("impacts",), "1", 0.0),
        "right": Figure((*_AT_FAST, "right"), "1", 0.05),
        "off": Figure((*_AT_FAST, "off"), "1", 0.0),
    }),
    # Errors are small differences: their size is what is on record.
    "work_precision, quick": Run("work_precision", ("--quick",), "work_precision.json", {
        "median error at fast": Figure((*_MEDIANS[0], "median"), "1", 0.5),
        "median error at standard": Figure((*_MEDIANS[1], "median"), "1", 0.5),
    }),
}  # fmt: skip


def _with_summaries(content: dict[str, Any]) -> dict[str, Any]:
    """The content of a job's file, with the extremes over its lanes by name."""
    for when in ("before", "after"):
        lanes = (content.get("measured") or {}).get(when, {})
        if "peak_force" in lanes:
            content[f"worst_force_{when}"] = max(lanes["peak_force"])
    if "statements" in content:
        content["by_statement"] = {each["key"]: each for each in content["statements"]}
    if isinstance(content.get("designs"), list):
        fronts = content["fronts"] = {}
        for each in content["designs"]:
            of = fronts.setdefault(each["minimised"], {}).setdefault(each["concept"], {})
            # What is not confirmed is no figure.
            value = each[each["minimised"]] if each["confirmed"] else float("nan")
            of[f"{each['parcels_an_hour']:.0f}"] = value
    if isinstance(content.get("points"), list):
        good = [p["peak_force"] for p in content["points"] if p["on_front"]]
        content["least_force"] = min(good)
    content["optimal"] = str(content.get("stop", "")).startswith(fj.Stop.OPTIMAL.value)
    content["lost"] = sum(each.get("failed", False) for each in content.get("history") or [])
    points = content.get("points")
    confirmed = [content, *(points if isinstance(points, list) else [])]
    checks = [each["verified"] for each in confirmed if each.get("verified")]
    content["in_doubt"] = sum(len(check["doubts"]) for check in checks)
    return content


# The exit status of a program that `timeout` ended.
_TOO_LONG = 124


def ended(process: subprocess.Popen, limit: float | None) -> tuple[int, float]:
    """The exit status of a process, ended after `limit` [s], and its processor time [s]."""
    late = threading.Event()

    def end():
        late.set()
        process.kill()

    timer = threading.Timer(limit or 0.0, end)
    if limit is not None:
        timer.start()
    _, status, used = os.wait4(process.pid, 0)
    timer.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    return _TOO_LONG if late.is_set() else process.returncode, used.ru_utime + used.ru_stime


def read(job: Run, folder: Path) -> dict[str, Any]:
    """The figures in what a job has written."""
    content, found = _with_summaries(json.loads((folder / job.file).read_text())), {}
    for label, figure in job.figures.items():
        value: Any = content
        for key in figure.keys:
            value = value[key]
        found[label] = float(value)
    for label, (keys, _) in job.demanded.items():
        found[label] = functools.reduce(operator.getitem, keys, content)
    return found


def run(name: str, out: Path, limit: float | None = None) -> dict[str, Any]:
    """Run a job and read its figures; `status` is its exit status, 124 after `limit` [s]."""
    job = RUNS[name]
    folder = out / name.replace(", ", "-").replace(" ", "-")
    command = [sys.executable, "-m", f"optimize.{job.module}", *job.arguments, "--out", str(folder)]
    print(f"{name}: {' '.join(command[1:])}", flush=True)
    # Its time counts the compilation.
    environment = os.environ | {"JAX_ENABLE_COMPILATION_CACHE": "false"}
    out.mkdir(parents=True, exist_ok=True)
    log = folder.with_suffix(".log")
    with log.open("w") as said:
        process = subprocess.Popen(command, stdout=said, stderr=said, env=environment)
        status, seconds = ended(process, limit)
    found: dict[str, Any] = {"status": status, "seconds": round(seconds)}
    if status:
        print("\n".join(log.read_text().splitlines()[-15:]), flush=True)
    if job.figures and (folder / job.file).exists():
        found |= read(job, folder)
    shown = [f"{k} {found[k]:.5g} {f.unit}" for k, f in job.figures.items() if k in found]
    line = f"{name}: status {status}, {found['seconds']} s of a processor  {', '.join(shown)}"
    print(line, flush=True)
    return found


def differences(name: str, found: dict[str, Any], known: dict[str, Any]) -> list[str]:
    """What of a job's figures is not as on record, a line each."""
    wrong = []
    if found["status"]:
        wrong.append(f"{name}: exit status {found['status']}")
    for label, figure in RUNS[name].figures.items():
        value, expected = found.get(label), known.get(label, {}).get("value")
        if value is None or expected is None:
            wrong.append(f"{name}: {label}: {value} found, {expected} on record")
        elif not abs(value - expected) <= figure.tolerance * abs(expected):
            wrong.append(
                f"{name}: {label}: {value:.5g} {figure.unit}, {expected:.5g} on record, "
                f"may differ by {100 * figure.tolerance:g} %"
            )
    for label, (_, wanted) in RUNS[name].demanded.items():
        if found.get(label) != wanted:
            wrong.append(f"{name}: {label}: {found.get(label)} found, {wanted} demanded")
    return wrong


def recorded(name: str, found: dict[str, Any]) -> dict[str, Any]:
    """A job's group of the record."""
    return {
        "command": f"python tests/headlines.py --out DIR --record {shlex.quote(name)}",
        "seconds": found["seconds"],
        "figures": {
            label: {"value": found[label], "unit": figure.unit}
            for label, figure in RUNS[name].figures.items()
        },
    }


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("jobs", nargs="*", default=[], help=f"of {', '.join(RUNS)}; by default all")
    parser.add_argument("--out", type=Path, required=True, help="folder for what the jobs write")
    parser.add_argument("--record", action="store_true", help="write the record anew")
    parser.add_argument("--at-once", type=int, default=os.cpu_count(), help="jobs at a time")
    parser.add_argument("--limit", type=float, help="time that each job may take [s]")
    given = parser.parse_args(arguments)
    known = figures.record()
    wrong, begin = [], time.perf_counter()
    names = given.jobs or list(RUNS)
    for name in names:
        if name not in RUNS:
            parser.error(f"no job {name!r}: of {', '.join(RUNS)}")
    with concurrent.futures.ThreadPoolExecutor(given.at_once) as pool:
        runs = {pool.submit(run, name, given.out, given.limit): name for name in names}
        for done in concurrent.futures.as_completed(runs):
            name, found = runs[done], done.result()
            if given.record and RUNS[name].figures and not found["status"]:
                known[name] = recorded(name, found)
                figures.write(known)
            wrong += differences(name, found, known.get(name, {}).get("figures", {}))
    print(f"{time.perf_counter() - begin:.0f} s in all")
    print("\n".join(wrong) if wrong else "all figures as on record")
    return len(wrong) > 0


if __name__ == "__main__":
    sys.exit(main())
