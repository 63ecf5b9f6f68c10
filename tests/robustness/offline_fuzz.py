"""Random scenes by the hundred thousand: finite or flagged, in value and in gradient.

From the folder `tests`:

    python -m robustness.offline_fuzz --seed 20261129 --out robustness/offline_fuzz.json
    python -m robustness.offline_fuzz --record    # the figures of TRUST.md, from that file

Half of them from end to end of what a sweep may ask for, half as real designs may be. A sample is
compared with `Fidelity.reference` (steps of 25 us, friction smoothed over 0.02 mm/s), in the peak
force and its gradient. A scene that differs by more than is promised, or has its peak at another
time, is looked at with steps of an eighth, as some derivatives need them: the gradient may be that
of another peak as high, within the promise. Both counts are printed. `offline_fuzz.json` beside
this file is what the first command found, an hour's work; no limit was set by its seed.
"""

import argparse
import functools
import json
import time
from pathlib import Path

import figures
import jax
import jax.numpy as jnp
import numpy as np
from robustness.extreme_scenes import USUAL, WIDE, draw, impact, riding
from robustness.peaks import gradient_error, peaks
from robustness.searched_scenes import KINDS

import fencejax as fj

LANES, DURATION, VARIED = 128, 0.1, KINDS["impact"].varied
HALVES = {"wide": WIDE, "usual": USUAL}
PROMISE = {"coarse": (0.025, 0.5), "fast": (0.025, 0.3), "standard": (0.025, 0.15)}
"""What a good status promises: of the peak force, and of its gradient."""
FIELDS = (
    "peak_force", "tip_deflection", "impulse", "peak_stress", "deepest", "peak_time", "furthest_y"
)


@functools.cache
def program(name="fast", **changes):
    """Numbers of lanes -> status, values (lanes, fields), slopes x df/dx (lanes, fields, varied),
    ledger's residual over what was turned over."""
    fidelity = getattr(fj.Fidelity, name)(**changes)

    @jax.jit
    @jax.vmap
    def run(x):
        def values(varied):
            scene = impact(riding(x, varied), DURATION)
            result = fj.simulate(scene, fidelity=fidelity, history=False)
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


TRUTH = fj.Fidelity.reference(
    step=2.5e-5, geometry="arc", modes=8, slip_speed=2e-6, static_speed=1e-4
)


def truth():
    """Numbers of lanes -> status, peak force, its time and its slopes."""
    return peaks(TRUTH)


def errors(outcome, true):
    """Of good lanes that touch, where the truth is good too: the peak's relative error, that of its
    gradient as elasticities and relative to their norm, or to 1 if that is larger, whether both are
    at the same of several peaks, to 2 ms, and which they are of all lanes; each (lanes,)."""
    status, found, slopes, _ = outcome
    true_status, peak, when, true_slopes = true
    good = np.maximum(status, true_status) <= fj.Status.LEFT_OVER_TIP
    good &= (status != fj.Status.NEVER_TOUCHED) & (peak > 0)
    off = gradient_error(slopes[good, 0], true_slopes[good], peak[good])
    same = np.abs(found[:, FIELDS.index("peak_time")] - when) <= 2e-3
    return np.abs(found[good, 0] / peak[good] - 1), off, same[good], np.flatnonzero(good)


def beyond(name, value, gradient):
    """Whether errors are larger than what a good status promises."""
    of_value, of_gradient = PROMISE[name]
    return (value > of_value) | (gradient > of_gradient)


@functools.cache
def closely():
    """Numbers of one scene -> its force over time by steps of an eighth of the truth's: time,
    force (n,) and peak force; slopes x df/dx (n, varied) and (varied,) of both forces."""

    @jax.jit
    def run(x):
        def force(varied):
            scene = impact(riding(x, varied), DURATION)
            fidelity = TRUTH.replace(step=TRUTH.step / 8)
            result = fj.simulate(scene, fidelity=fidelity, only=("history", "peak_force"))
            found = sum(c.normal for c in result.history.fence), result.peak_force
            return found, (result.history.time, *found)

        slopes, found = jax.jacfwd(force, has_aux=True)({k: x[k] for k in VARIED})
        along = [jnp.stack([s[k] * x[k] for k in VARIED], axis=-1) for s in slopes]
        return found, along

    return run


def looked_at(name, numbers, outcome, lane):
    """Errors of a lane in the peak force and in its gradient, against a closer look at the truth:
    its gradient at the highest peak or, if that is not as promised, at the peak that lies nearest;
    and whether it was the latter. There may be two as high as each other, within the promise; one
    is where the scene ends."""
    one = {k: v[lane] for k, v in numbers.items()}
    (time, force, peak), (along, slopes) = jax.device_get(closely()(one))
    found, when = (outcome[1][lane, FIELDS.index(f)] for f in ("peak_force", "peak_time"))

    ours = outcome[2][lane, 0]
    value, gradient = abs(found / peak - 1), gradient_error(ours, slopes, peak)
    if gradient <= PROMISE[name][1]:
        return value, gradient, False
    beside = np.pad(force, 1, constant_values=-np.inf)
    peaks = (force >= beside[:-2]) & (force >= beside[2:])
    peaks[-1] = True
    high = peaks & (force >= (1 - PROMISE[name][0]) * peak)
    nearest = min(np.flatnonzero(high), key=lambda place: abs(time[place] - when))
    if abs(time[nearest] - when) <= 2e-3:
        other = gradient_error(ours, along[nearest], force[nearest])
        if other < gradient:
            return value, other, True
    return value, gradient, False


def shares(off, *limits):
    """Of errors: median, 99 %, largest, and how many are above the `limits`."""
    row = {
        "median": float(np.median(off)), "99 %": float(np.quantile(off, 0.99)),
        "largest": float(np.max(off)),
    }
    return row | {f"above {100 * limit:g} %": int(np.sum(off > limit)) for limit in limits}


@functools.cache
def sampled(half, seed, k):
    """The truth of a draw."""
    return jax.device_get(truth()(draw([seed, k], LANES, HALVES[half])))


def tally(name, half, given):
    """Counts of the statuses of random scenes at a fidelity, and errors of a sample of them."""
    counts, off, draws = np.zeros(len(fj.Status), int), [], -(-given.scenes // (2 * LANES))
    at_first = 0
    for k in range(draws):
        numbers = draw([given.seed, k], LANES, HALVES[half])
        outcome = jax.device_get(program(name)(numbers))
        check(numbers, outcome)
        counts += np.bincount(outcome[0], minlength=len(fj.Status))
        if 2 * k * LANES < given.sample:
            *found, same, lanes = errors(outcome, sampled(half, given.seed, k))
            other = np.zeros(len(lanes), bool)
            for j in np.flatnonzero(~same | beyond(name, *found)):
                at_first += int(beyond(name, *found)[j])
                *closer, other[j] = looked_at(name, numbers, outcome, lanes[j])
                for errors_of, error in zip(found, closer, strict=True):
                    errors_of[j] = error
            for j in np.flatnonzero(beyond(name, *found)):
                print(name, half, [given.seed, k], "beyond:", lanes[j], flush=True)
            off.append((*found, other))
    value, gradient, other = (np.concatenate(each) for each in zip(*off, strict=True))
    return {
        "scenes": int(counts.sum()),
        "statuses": {s.name: int(counts[s]) for s in fj.Status},
        "sample of good scenes": len(value),
        "beyond the promise": int(np.sum(beyond(name, value, gradient))),
        "beyond it at first sight": at_first,
        "error of the peak": shares(value, 0.02, 0.05),
        "at the other of two peaks": int(np.sum(other)),
        "error of the gradient": shares(gradient, 0.1, 0.25),
    }


def recorded(report):
    """The groups of figures of a report."""
    rows = {half: [report[name][half] for name in reversed(PROMISE)] for half in HALVES}
    every = [row for half in rows.values() for row in half]

    def of_real(error):
        return [float(f"{100 * row[error]['99 %']:.2g}") for row in rows["usual"]], "%"

    def total(name, of=every):
        return sum(row[name] for row in of), "1"

    command = "cd tests && python -m robustness.offline_fuzz --record"
    promised = {f"gradient, {name}": (100 * of[1], "%") for name, of in PROMISE.items()}
    largest = max(row["error of the peak"]["largest"] for row in rows["wide"])
    promises = {
        "peak": (100 * PROMISE["standard"][0], "%"), **promised,
        "results compared": total("sample of good scenes"),
        "results that were worse": total("beyond the promise"),
        "results at the other of two peaks": total("at the other of two peaks"),
        "peak of 99 % of real designs, standard, fast, coarse": of_real("error of the peak"),
        "gradient of 99 % of real designs, standard, fast, coarse":
            of_real("error of the gradient"),
        "results at corners": total("sample of good scenes", rows["wide"]),
        "worst peak at corners": (float(f"{100 * largest:.2g}"), "%"),
    }  # fmt: skip
    return {
        "promises": figures.group(command, promises),
        "finite": figures.group(command, {"random scenes": total("scenes")}),
    }


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--scenes", type=int, default=8_192, help="at each fidelity")
    flags.add_argument("--sample", type=int, default=4_096, help="scenes compared with reference")
    flags.add_argument("--seed", type=int, default=20261129)
    flags.add_argument("--record", action="store_true", help="write the record anew")
    flags.add_argument("--fidelities", nargs="+", default=["coarse", "fast", "standard"])
    flags.add_argument("--out", type=Path, default=Path("fuzz.json"))
    given = flags.parse_args()
    if given.record:
        kept = json.loads(Path(__file__).with_suffix(".json").read_text())
        figures.write(figures.record() | recorded(kept))
        return
    jax.config.update("jax_enable_x64", True)
    began = time.perf_counter()
    report: dict = {k: str(v) for k, v in vars(given).items() if k not in ("out", "fidelities")}
    for name in given.fidelities:
        report[name] = {}
        for half in HALVES:
            row = report[name][half] = tally(name, half, given)
            print(name, half, json.dumps(row, indent=1), f"{time.perf_counter() - began:.0f} s")
            given.out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    fj.tune_compiler()
    main()
