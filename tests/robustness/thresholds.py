"""What each constant of `fencejax.results.diagnostics` refuses and what it lets pass: of random
designs, with all others as they are.

From the folder `tests`:

    python -m robustness.thresholds                # some minutes
    python -m robustness.thresholds --scenes 2048 --seed 7 --rungs standard
    python -m robustness.thresholds --record       # the table of TRUST.md anew

Half of the designs are as real ones may be, half from end to end of what a sweep may ask for
(`USUAL` and `WIDE` in `extreme_scenes`). Each is computed with its gradient at a named fidelity and
compared with the truth (sixteen modes, steps of 12.5 us, a tenth of the friction's smoothing). A
good status is *wrong* where it breaks the promise of `offline_fuzz`, and a doubt is *needless*
where the promise is kept. A constant is changed by a factor, and told is how many good statuses are
then wrong and how many doubts needless; one that may be left out altogether without a wrong status
does not earn its keep by these designs.
"""

import argparse
import functools
import time

import figures
import jax
import jax.numpy as jnp
import numpy as np
from robustness.extreme_scenes import USUAL, WIDE, draw, impact, riding
from robustness.offline_fuzz import PROMISE
from robustness.peaks import gradient_error, peaks
from robustness.searched_scenes import KINDS

import fencejax as fj
from fencejax.results import diagnostics

CONSTANTS = (
    "_ROUGHNESS", "_REBOUND_ROUGHNESS", "_RINGING", "_DAMPER_HELD", "_LAGGING",
    "_RESIDUAL_DEFLECTION", "_NEGLIGIBLE_ROUGHNESS", "_SMOOTHED", "_CREEP_LOSS", "_CREEP_SPEED",
    "_CREEP_SHARE", "_STEP_SLIP",
)  # fmt: skip
# The last one is as good as none.
FACTORS = (0.5, 1.0, 2.0, 1e9)
_LANES = 128


@functools.cache
def program(name):
    """Numbers of lanes, and factors of the constants (12,), -> what `peaks` gives."""
    fidelity = getattr(fj.Fidelity, name)()
    usual = {constant: getattr(diagnostics, constant) for constant in CONSTANTS}
    varied_names = KINDS["impact"].varied

    def one(x, factors):
        def peak(varied):
            scene = impact(riding(x, varied), 0.1)
            result = fj.simulate(scene, fidelity=fidelity, only=("peak_force", "peak_time"))
            return result.peak_force, (result.status, result.peak_force, result.peak_time)

        varied = {n: x[n] for n in varied_names}
        for constant, factor in zip(CONSTANTS, factors, strict=True):
            setattr(diagnostics, constant, usual[constant] * factor)
        try:
            slopes, found = jax.jacfwd(peak, has_aux=True)(varied)
        finally:
            for constant, value in usual.items():
                setattr(diagnostics, constant, value)
        return *found, jnp.stack([slopes[n] * x[n] for n in varied_names], axis=-1)

    return jax.jit(jax.vmap(one, (0, None)))


def batched(run, numbers, *rest):
    """What a program finds, on the host."""
    count, parts = len(numbers["mass"]), []
    for first in range(0, count, _LANES):
        rows = np.minimum(np.arange(first, first + _LANES), count - 1)
        found = jax.device_get(run({n: v[rows] for n, v in numbers.items()}, *rest))
        parts.append([part[: count - first] for part in found])
    return [np.concatenate(columns) for columns in zip(*parts, strict=True)]


def kept(found, truth, name):
    """Of each lane: whether the promise is kept, and whether that can be told."""
    _, peak, when, slopes = found
    true_status, true, true_when, true_slopes = truth
    told = (true_status <= fj.Status.LEFT_OVER_TIP) & (true > 0) & (np.abs(when - true_when) < 2e-3)
    size = np.where(true > 0, true, 1.0)
    of_value, of_gradient = PROMISE[name]
    value = np.abs(peak / size - 1) <= of_value
    return value & (gradient_error(slopes, true_slopes, size) <= of_gradient), told


def counts(statuses, keeps, told):
    """Good statuses that are wrong, and numerical doubts that are needless."""
    good = statuses <= fj.Status.LEFT_OVER_TIP
    codes = [code for code in fj.Status if code.numerical]
    doubted = np.isin(statuses, codes)
    return int(np.sum(told & good & ~keeps)), int(np.sum(told & doubted & keeps))


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--scenes", type=int, default=1024)
    flags.add_argument("--seed", type=int, default=20261125)
    flags.add_argument("--rungs", nargs="+", choices=tuple(PROMISE), default=["standard", "coarse"])
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    began = time.perf_counter()
    halves = [
        draw(given.seed + k, given.scenes // 2, ranges) for k, ranges in enumerate((USUAL, WIDE))
    ]
    numbers = {n: np.concatenate([half[n] for half in halves]) for n in halves[0]}
    last = fj.Fidelity.reference()
    exact = fj.Fidelity.standard(
        modes=16, step=1.25e-5, step_tolerance=None, longest_stride=1, slip_speed=last.slip_speed,
        static_speed=last.static_speed,
    )  # fmt: skip
    truth = batched(peaks(exact), numbers)
    print(f"truth ({time.perf_counter() - began:.0f} s)", flush=True)
    rows: dict = {}
    for name in given.rungs:
        run = program(name)
        found = batched(run, numbers, np.ones(len(CONSTANTS)))
        keeps, told = kept(found, truth, name)
        wrong, needless = counts(found[0], keeps, told)
        print(f"{name}: {int(told.sum())} compared, {wrong} wrong, {needless} needless", flush=True)
        rows.setdefault("all as they are", {})[name] = f"{wrong} / {needless}"
        for k, constant in enumerate(CONSTANTS):
            cells = []
            for factor in FACTORS:
                factors = np.where(np.arange(len(CONSTANTS)) == k, factor, 1.0)
                statuses = found[0] if factor == 1 else batched(run, numbers, factors)[0]
                cells.append("{} / {}".format(*counts(statuses, keeps, told)))
            print(f"  {constant:24}", "   ".join(cells), flush=True)
            rows.setdefault(constant, {}).update(
                {f"{name}, {f:g} times": c for f, c in zip(FACTORS, cells, strict=True)}
            )
        print(f"{time.perf_counter() - began:.0f} s", flush=True)
    if given.record:
        _record(rows, given)


def _record(rows, given):
    known, command = figures.record(), "cd tests && python -m robustness.thresholds --record"
    factors = [factor for factor in FACTORS if factor != 1]
    heads = [
        f"{name}, {'without it' if factor > 100 else f'{factor:g} times'}"
        for name in given.rungs for factor in factors
    ]  # fmt: skip
    keys = [f"{name}, {factor:g} times" for name in given.rungs for factor in factors]
    known["thresholds"] = {
        "command": command,
        "columns": ["constant", "its value", *heads],
        "rows": {
            f"`{constant}`": {
                "unit": "",
                "values": [f"{getattr(diagnostics, constant):g}", *(row[key] for key in keys)],
            }
            for constant, row in rows.items() if constant in CONSTANTS
        },
    }  # fmt: skip
    usual = {name: cell for name, cell in rows["all as they are"].items()}
    known["thresholds, all"] = {
        "command": command,
        "figures": {
            "designs": {"value": given.scenes, "unit": "1"},
            **{name: {"value": cell, "unit": "1"} for name, cell in usual.items()},
        },
    }
    figures.write(known)


if __name__ == "__main__":
    fj.tune_compiler()
    main()
