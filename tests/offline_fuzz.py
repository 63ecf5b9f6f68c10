"""Random scenes by the hundred thousand: finite or flagged, in value and in gradient.

    python tests/offline_fuzz.py --scenes 100000 --seed 20260101 --out fuzz.json

Half of them from end to end of what a sweep may ask for, half as real designs may be. A sample is
compared with `Fidelity.reference` (steps of 50 us, friction smoothed over 0.02 mm/s).
`offline_fuzz.json` beside this file is what that command found.
"""

import argparse
import functools
import json
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from extreme_scenes import USUAL, WIDE, draw, impact

import fencejax as fj

LANES, DURATION = 128, 0.1
FIELDS = ("peak_force", "tip_deflection", "impulse", "peak_stress", "deepest", "furthest_y")
VARIED = ("thickness", "modulus", "density", "damping_ratio", "mass", "stiffness", "belt", "reach")


@functools.cache
def program(name="fast"):
    """Numbers of lanes -> status, values (lanes, fields), slopes x df/dx (lanes, fields, varied),
    ledger's residual over what was turned over."""
    fidelity = getattr(fj.Fidelity, name)()

    @jax.jit
    @jax.vmap
    def run(x):
        def values(varied):
            result = fj.simulate(impact(x | varied, DURATION), fidelity=fidelity, history=False)
            found = jnp.stack([getattr(result, field) for field in FIELDS])
            final, mass = result.final, x["mass"]
            moving = 0.5 * mass * (final.x_rate**2 + final.y_rate**2)
            turned = moving + sum(jnp.abs(term) for term in jax.tree.leaves(result.energy))
            return found, (result.status, found, result.energy.residual / turned)

        varied = {k: x[k] for k in VARIED}
        slopes, (status, found, gain) = jax.jacfwd(values, has_aux=True)(varied)
        return status, found, jnp.stack([slopes[k] * x[k] for k in VARIED], axis=-1), gain

    return run


def check(numbers, outcome):
    """Raise `AssertionError` where a good status goes with a number that does not hold."""
    status, found, slopes, gain = outcome
    good = status <= fj.Status.LEFT_OVER_TIP
    finite = np.isfinite(found).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2))
    silent = good & ~finite
    assert not silent.any(), {k: v[silent] for k, v in numbers.items()}
    assert np.isfinite(slopes).all()
    # The share that the status allows, but for how the parcel's turning counts.
    assert np.all(gain[good] <= 0.055)
    assert np.all((found[good] >= 0)[:, :-1])


@functools.cache
def truth():
    fidelity = fj.Fidelity.reference(
        step=5e-5, geometry="arc", modes=8, slip_speed=2e-5, static_speed=1e-4
    )

    @jax.jit
    @jax.vmap
    def run(x):
        result = fj.simulate(impact(x, DURATION), fidelity=fidelity, only=("peak_force",))
        return result.status, result.peak_force

    return run


def errors(numbers, outcome):
    """Relative errors of the peaks of good lanes that touch, where the truth is good too."""
    status, found = outcome[:2]
    true_status, peak = jax.device_get(truth()(numbers))
    good = np.maximum(status, true_status) <= fj.Status.LEFT_OVER_TIP
    good &= (status != fj.Status.NEVER_TOUCHED) & (peak > 0)
    return np.abs(found[good, 0] / peak[good] - 1)


def tally(name, ranges, given):
    """Counts of the statuses of random scenes at a fidelity, and errors of a sample of them."""
    counts, off, draws = np.zeros(len(fj.Status), int), [], -(-given.scenes // (2 * LANES))
    for k in range(draws):
        numbers = draw([given.seed, k], LANES, ranges)
        outcome = jax.device_get(program(name)(numbers))
        check(numbers, outcome)
        counts += np.bincount(outcome[0], minlength=len(fj.Status))
        if 2 * k * LANES < given.sample:
            off.append(errors(numbers, outcome))
    off = np.sort(np.concatenate(off))
    return {
        "scenes": int(counts.sum()),
        "statuses": {s.name: int(counts[s]) for s in fj.Status},
        "sample of good scenes": len(off),
        "error of the peak": {
            "median": float(np.median(off)), "99 %": float(np.quantile(off, 0.99)),
            "largest": float(off[-1]), "above 2 %": int(np.sum(off > 0.02)),
            "above 5 %": int(np.sum(off > 0.05)),
        },
    }


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--scenes", type=int, default=100_000, help="at each fidelity")
    flags.add_argument("--sample", type=int, default=8_192, help="scenes compared with reference")
    flags.add_argument("--seed", type=int, default=20260101)
    flags.add_argument("--fidelities", nargs="+", default=["coarse", "fast", "standard"])
    flags.add_argument("--out", type=Path, default=Path("fuzz.json"))
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    began = time.perf_counter()
    report: dict = {k: str(v) for k, v in vars(given).items() if k not in ("out", "fidelities")}
    for name in given.fidelities:
        report[name] = {}
        for half, ranges in (("wide", WIDE), ("usual", USUAL)):
            told = report[name][half] = tally(name, ranges, given)
            print(name, half, json.dumps(told, indent=1), f"{time.perf_counter() - began:.0f} s")
            given.out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    fj.tune_compiler()
    main()
