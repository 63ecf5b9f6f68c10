"""The cost of one impact in a fresh process: compile times, run times, memory.

    python -m optimize.work_precision.cold '{"modes": 4}'

prints them as JSON, for the fidelity whose fields are given.
"""

import dataclasses
import json
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

import jax
import jax.numpy as jnp

import fencejax as fj

from .cases import VARIABLES, Family, impacts, outcome
from .measure import Times, memory


def _rss() -> int:
    """Peak resident memory of this process so far [bytes]."""
    # Linux reports the memory of this program; ru_maxrss may include that of its parent.
    status = pathlib.Path("/proc/self/status")
    if status.exists():
        (line,) = (row for row in status.read_text().splitlines() if row.startswith("VmHWM:"))
        return 1024 * int(line.split()[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def measure(fidelity: fj.Fidelity, duration: float, repeats: int) -> dict:
    """The numbers of one fidelity in this process: value, and value with gradient in eight
    variables, of the peak force of the paper's impact."""
    family: Family = impacts(0, 0, duration)
    row, ones = jnp.asarray(family.numbers[0]), jnp.ones(len(VARIABLES))

    def peak(factors):
        return outcome(family, fidelity, row, factors)[0][0]

    found: dict = {"resident before [B]": _rss()}
    for name, function in (("value", peak), ("gradient", jax.value_and_grad(peak))):
        begin = time.perf_counter()
        lowered = jax.jit(function).lower(ones)
        traced = time.perf_counter() - begin
        program = lowered.compile()
        seconds = time.perf_counter() - begin
        times = Times.of(lambda run=program: run(ones), repeats)
        found[name] = {
            "trace [s]": traced,
            "compile [s]": seconds,
            "run": dataclasses.asdict(times),
            "intermediate [B]": memory(program),
            "peak resident [B]": _rss(),
        }
    return found


def elsewhere(fidelity: fj.Fidelity, duration: float, repeats: int) -> dict:
    """The same in a process of its own, and again in one that finds the programs in the
    compilation cache ("cached compile [s]").

    Raises `RuntimeError` with the output of the process where it fails.
    """
    with tempfile.TemporaryDirectory() as cache:
        settings = {"duration": duration, "repeats": repeats, "cache": cache}
        asked = json.dumps(dataclasses.asdict(fidelity) | settings)
        first, again = (_measured(asked) for _ in range(2))
    for name in ("value", "gradient"):
        first[name]["cached compile [s]"] = again[name]["compile [s]"]
    return first


def _measured(asked: str) -> dict:
    call = [sys.executable, "-m", "optimize.work_precision.cold", asked]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"The process of its own failed: {done.stderr.strip()[-400:]}")
    return json.loads(done.stdout.splitlines()[-1])


def main(arguments: list[str]) -> int:
    """Measure the fidelity given as JSON and print the numbers."""
    fj.tune_compiler()
    jax.config.update("jax_enable_x64", True)
    given = json.loads(arguments[0])
    cache = given.pop("cache", None)
    jax.config.update("jax_enable_compilation_cache", cache is not None)
    jax.config.update("jax_compilation_cache_dir", cache)
    duration, repeats = given.pop("duration", 0.13), given.pop("repeats", 15)
    print(json.dumps(measure(fj.Fidelity(**given), duration, repeats)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
