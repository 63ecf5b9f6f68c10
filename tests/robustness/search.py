"""A search for large errors under a good status, as an optimiser may stumble upon them.

    python tests/robustness/search.py --out search.json
    python tests/robustness/search.py --tolerance 1e-2 --generations 40 --of gradient

Designs of an oblique impact are bred, by differential evolution, for the largest error of the peak
force, or of its gradient, among those with a good status. The truth is the same model (modes and
friction's smoothing) by fixed steps of 12.5 us, so that what is found is the error of the steps.
`search.json` beside this file is what the first command found.
"""

import argparse
import json
import time
from pathlib import Path

import jax
import numpy as np
from robustness.extreme_scenes import ORDINARY, USUAL, WIDE
from robustness.peaks import gradient_error, peaks

import fencejax as fj

REALISTIC = {
    **USUAL, "modulus": (1e8, 2.1e11), "density": (400, 8000), "thickness": (3e-3, 0.09),
    "flexible": (0.15, 1.0), "damping_ratio": (0.002, 0.1), "mass": (0.2, 60),
    "stiffness": (1e7, 1e13), "damping": (1e1, 1e7),
}  # fmt: skip
"""What a real fence and parcel can have; E / rho is at most 1e8 m^2/s^2, besides."""
BOUNDS = {"realistic": REALISTIC, "wide": WIDE}
PLACES = ("across", "along")


def numbers(shares, bounds):
    """Numbers of lanes from shares in [0, 1] of the bounds, (lanes, variables)."""
    found = {name: np.full(len(shares), value) for name, value in ORDINARY.items()}
    for column, (name, (low, high)) in zip(shares.T, bounds.items(), strict=False):
        found[name] = np.exp(np.log(low) + column * np.log(high / low))
    for column, name in zip(shares.T[len(bounds) :], PLACES, strict=True):
        found[name] = column - 0.5
    found["modulus"] = np.minimum(found["modulus"], 1e8 * found["density"])
    found["ride"] = found["belt"]
    return found


def errors(fidelity, truth, x, of):
    """Of each lane: the error, relative to the peak force, or of the gradient to its norm or to the
    peak if that is more; -1 where the status is not good, nothing is touched or, for gradients,
    the truth has its peak elsewhere."""
    status, peak, when, slopes = jax.device_get(peaks(fidelity, of)(x))
    true_status, true, true_when, true_slopes = jax.device_get(peaks(truth, of)(x))
    good = np.maximum(status, true_status) <= fj.Status.LEFT_OVER_TIP
    good &= (status != fj.Status.NEVER_TOUCHED) & (true > 0)
    size = np.where(true > 0, true, 1.0)
    if of == "value":
        return np.where(good, np.abs(peak / size - 1), -1.0)
    off = gradient_error(slopes, true_slopes, size)
    return np.where(good & (np.abs(when - true_when) < 2e-3), off, -1.0)


def bred(rng, population, fitness):
    """Children: about the best or a random one, by differences of two others, parents mixed in."""
    lanes, count = population.shape
    best = population[np.argsort(-fitness)[: max(4, lanes // 10)]]
    one, two, three = (population[rng.permutation(lanes)] for _ in range(3))
    about = np.where(rng.random((lanes, 1)) < 0.6, best[rng.integers(len(best), size=lanes)], one)
    children = about + rng.uniform(0.1, 0.9, (lanes, 1)) * (two - three)
    children += rng.normal(0, 0.02, children.shape) * (rng.random(children.shape) < 0.2)
    children = np.where(rng.random((lanes, count)) < 0.8, children, population)
    children = np.abs(children)
    return np.clip(np.where(children > 1, 2 - children, children), 0, 1)


def search(fidelity, truth, bounds, of, lanes, generations, seed, tell=lambda *_: None):
    """The share of random designs with a good status, their largest error, and after each
    generation the largest error found; and the worst design's numbers."""
    rng = np.random.default_rng(seed)
    population = rng.random((lanes, len(bounds) + len(PLACES)))
    fitness = errors(fidelity, truth, numbers(population, bounds), of)
    good, course = float(np.mean(fitness >= 0)), [float(np.max(fitness))]
    for k in range(generations):
        children = bred(rng, population, fitness)
        found = errors(fidelity, truth, numbers(children, bounds), of)
        better = found > fitness
        population = np.where(better[:, None], children, population)
        fitness = np.where(better, found, fitness)
        course.append(float(np.max(fitness)))
        tell(k + 1, course[-1])
    worst = numbers(population[[np.argmax(fitness)]], bounds)
    return good, course, {name: float(f"{value[0]:.4g}") for name, value in worst.items()}


def true_to(fidelity):
    """The same model by short fixed steps."""
    return fidelity.replace(step=1.25e-5, step_tolerance=None, longest_stride=1)


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--tolerance", type=float, nargs="+", default=[1e-3])
    flags.add_argument("--of", nargs="+", choices=("value", "gradient"), default=["value"])
    flags.add_argument("--bounds", nargs="+", choices=tuple(BOUNDS), default=list(BOUNDS))
    flags.add_argument("--lanes", type=int, default=128, help="designs in a generation")
    flags.add_argument("--generations", type=int, default=24)
    flags.add_argument("--seed", type=int, default=20261122)
    flags.add_argument("--out", type=Path, default=Path("search.json"))
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    standard = fj.Fidelity.standard()
    cases = {"fixed steps": standard.replace(longest_stride=1)}
    cases |= {f"tolerance {t:g}": standard.replace(step_tolerance=t) for t in given.tolerance}
    report: dict = {name: getattr(given, name) for name in ("lanes", "generations", "seed")}
    began = time.perf_counter()
    for of in given.of:
        for bounds in given.bounds:
            for name, fidelity in cases.items():
                good, course, worst = search(
                    fidelity, true_to(fidelity), BOUNDS[bounds], of,
                    given.lanes, given.generations, given.seed,
                )  # fmt: skip
                told = {
                    "good of random": good, "error, random": course[0], "error, found": course[-1],
                    "by generation": [float(f"{error:.3g}") for error in course], "worst": worst,
                }  # fmt: skip
                report[f"{of}, {bounds}, {name}"] = told
                print(
                    f"{of}, {bounds}, {name}: good {100 * good:.0f} %, random {course[0]:.2e}, "
                    f"found {course[-1]:.2e} ({time.perf_counter() - began:.0f} s)", flush=True,
                )  # fmt: skip
                given.out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    fj.tune_compiler()
    main()
