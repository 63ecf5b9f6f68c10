"""A search for large errors under a good status, as an optimiser might find them.

From the folder `tests`:

    python -m robustness.search --out search.json
    python -m robustness.search --kinds impact --tolerance 1e-2 --of gradient
    python -m robustness.search --kinds sort --rungs standard --sharper
    python -m robustness.search --record           # the table of TRUST.md, from search.json
    python -m robustness.search --again            # the worst designs of search.json, judged again

Designs of each kind of scene (`searched_scenes`) are bred, by differential evolution, for the
largest error of the peak force, or of its gradient, among those with a good status. The truth
(`truths`) is the same geometry with sixteen modes. Of impacts it has fixed steps of 10 us and the
friction of `reference`, a fifth of the smoothing. Of sorts it has the friction of what is judged
or, with `--sharper`, that of `reference`, too: then the search finds what the peak owes to the
speed over which static friction falls to kinetic. Its steps follow their error there, with a
tolerance 256 times as small as that of `standard`, and a first truth, of eight modes and four times
the tolerance, judges all designs; the truth itself those of each generation that come to more than
their parents, the largest errors first, up to a tenth of all: the errors reported are the truth's.
A finding, the largest error after a generation, is judged again by a second truth: that of values
of sorts has fixed steps of 10 us, every other one half the step, or a quarter of the tolerance, of
the first. Where the two truths differ by a quarter of the error, the truth itself is uncertain; so
it is where secants of the truth's forces do not find the error of a gradient: two truths may be
wrong alike, where the force is a sawtooth of the steps of both. Such a design is left out, and
their number is reported. Where the truth does not determine which of two maxima is the peak either,
it gives no gradient. `search.json` beside this file is what the first command found.
"""

import argparse
import json
import math
import time
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from robustness import search_record, truths
from robustness.peaks import gradient_error, peaks
from robustness.searched_scenes import KINDS, changed

import fencejax as fj
from fencejax.study import in_chunks

RECORD = Path(__file__).with_suffix(".json")
BOUNDS = ("realistic", "wide")
RUNGS = ("coarse", "fast", "standard")
# Lanes that run side by side; fewer of those that a truth judges after a first one.
_BATCH, _FEWER = 128, 32
# Share of a generation that it judges.
_JUDGED = 0.1
# Relative change of a number over which secants are taken [1]. Where the force is a sawtooth of the
# steps, its teeth are as wide as a step's share of the time until the touch, 1e-4 and less, and the
# slopes of a truth may be those of teeth; in an even course secants are off by the square of it.
_APART = 1e-3


def _friction(kind, sharper):
    """How a truth differs from what it judges in the friction."""
    return truths.SHARPER if sharper or KINDS[kind].step is not None else {}


def truth_of(fidelity, kind, sharper=False):
    """The finest computation of the truth in an acceptable time; of sorts with `sharper` friction
    on request."""
    step, friction = KINDS[kind].step, _friction(kind, sharper)
    if step is None:
        return truths.following(fidelity, 256, modes=16, **friction)
    return truths.fixed(fidelity, step, modes=16, longest_stride=1, **friction)


def first_truth_of(fidelity, kind, sharper=False):
    """A cheaper truth, to select the designs for the expensive one; `None` where that is cheap."""
    if KINDS[kind].step is not None:
        return None
    return truths.following(fidelity, 64, modes=8, **_friction(kind, sharper))


def second_truth_of(truth, of):
    """Another one, to judge a finding by."""
    if truth.step_tolerance is None:
        return truth.replace(step=truth.step / 2, stride_tolerance=truth.stride_tolerance / 4)
    if of == "value":
        return truths.fixed(truth, 1e-5)
    return truth.replace(
        step=truth.step / 2, stride_tolerance=truth.stride_tolerance / 4,
        step_tolerance=truth.step_tolerance / 4,
    )  # fmt: skip


def run(fidelity, kind, of, x, batch=_BATCH):
    """What `peaks` finds, on the host, in batches, the last one filled up."""
    lanes = len(x["mass"])
    # Few sizes, as each is compiled.
    batch = min(batch, 1 << (lanes - 1).bit_length())
    return in_chunks(peaks(fidelity, of, kind), x, batch)


def _against(truth, x, found, of, kind, where, batch=_BATCH):
    """The errors of the results `found` in the lanes `where`; -1 where the truth has no good
    status."""
    _, peak, _, slopes = (each[where] for each in found)
    # Filled up, so that one program serves any number of them.
    rows = np.append(where, np.full(-len(where) % batch, where[0]))
    true_status, true, _, true_slopes = (
        each[: len(where)]
        for each in run(truth, kind, of, {n: v[rows] for n, v in x.items()}, batch)
    )
    good = (true_status <= fj.Status.LEFT_OVER_TIP) & (true > 0)
    size = np.where(true > 0, true, 1.0)
    if of == "value":
        off = np.abs(peak / size - 1)
    else:
        off = gradient_error(slopes, true_slopes, size)
    return np.where(good, off, -1.0)


class Errors(NamedTuple):
    """The error of each lane, relative to the peak force, or of the gradient to its norm or to the
    peak if that is larger; -1 where the status is not good, nor that of the truth, or nothing is
    touched. `exact_lanes` are judged by the truth and not by a first one, and `apart` is the
    largest difference between the two."""

    errors: np.ndarray
    exact_lanes: np.ndarray
    apart: float = 0.0


def errors(fidelity, truth, x, of, kind="impact", first=None, least: np.ndarray | float = -1.0):
    """The errors of a fidelity; with a `first` truth, the truth judges only a share of what that
    finds to be above `least`, (lanes,) or a number."""
    found = run(fidelity, kind, of, x)
    status, lanes = found[0], len(found[0])
    off, exact_lanes = np.full(lanes, -1.0), np.ones(lanes, bool)
    # What is refused needs no truth.
    some = (status <= fj.Status.LEFT_OVER_TIP) & (status != fj.Status.NEVER_TOUCHED)
    where = np.flatnonzero(some)
    if not where.size:
        return Errors(off, exact_lanes)
    if first is None:
        off[where] = _against(truth, x, found, of, kind, where, min(_BATCH, lanes))
        return Errors(off, exact_lanes)
    off[where] = _against(first, x, found, of, kind, where)
    exact_lanes = ~some
    worth = np.flatnonzero(off > np.maximum(least, 0.0))
    worth = worth[np.argsort(-off[worth])][: max(1, round(_JUDGED * lanes))]
    if not worth.size:
        return Errors(off, exact_lanes)
    exact = _against(truth, x, found, of, kind, worth, _FEWER)
    apart = float(np.max(np.where(exact >= 0, np.abs(exact - off[worth]), 0.0)))
    off[worth], exact_lanes[worth] = exact, True
    return Errors(off, exact_lanes, apart)


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


def written(numbers):
    """The numbers as `search.json` has them, in six digits: what is judged is what is kept."""
    return {n: np.array([float(f"{v:.6g}") for v in values]) for n, values in numbers.items()}


class Found(NamedTuple):
    """The outcome of a search: the share of random designs with a good status; the largest error by
    the truth after each generation; the worst design's numbers; the difference of a first truth
    from it; and the number of designs left out as the truth was uncertain."""

    good: float
    course: list[float]
    worst: dict[str, float]
    apart: float
    unsure: int


def search(
    fidelity, truth, bounds, of, lanes, generations, seed, kind="impact", show=lambda _: None,
    first=None, certain=False, enough=math.inf,
):  # fmt: skip
    """Breed designs for the largest error, until it is above `enough`; with `certain`, of those
    that the truth is sure of."""
    rng, searched = np.random.default_rng(seed), KINDS[kind]

    def designs(shares):
        return written(searched.numbers(shares, bounds))

    def judged(shares, least: np.ndarray | float = -1.0):
        return errors(fidelity, truth, designs(shares), of, kind, first, least)

    def numbers(lane):
        return {name: float(each[0]) for name, each in designs(population[[lane]]).items()}

    def best_so_far():
        worst = numbers(int(np.argmax(np.where(exact_lanes, fitness, -1.0))))
        return Found(good, course, worst, apart, unsure)

    def largest(least):
        """The largest error by the truth, if it is certain where above `least`; and the number of
        uncertain ones."""
        left_out = 0
        while True:
            best = int(np.argmax(np.where(exact_lanes, fitness, -1.0)))
            most = float(fitness[best]) if exact_lanes[best] else -1.0
            if not certain or most <= max(least, 0.0):
                return most, left_out
            if sure(fidelity, truth, numbers(best), of, kind, most):
                return most, left_out
            fitness[best], left_out = -1.0, left_out + 1

    population = rng.random((lanes, searched.count(bounds)))
    fitness, exact_lanes, apart = judged(population)
    good = float(np.mean(fitness >= 0))
    most, unsure = largest(-1.0)
    course = [most]
    show(best_so_far())
    for _ in range(generations):
        if course[-1] > enough:
            break
        children = bred(rng, population, fitness)
        found, now_exact, off = judged(children, fitness)
        better = found > fitness
        population = np.where(better[:, None], children, population)
        fitness = np.where(better, found, fitness)
        exact_lanes = np.where(better, now_exact, exact_lanes)
        apart = max(apart, off)
        most, left_out = largest(course[-1])
        unsure += left_out
        course.append(most)
        show(best_so_far())
    return best_so_far()


def sure(fidelity, truth, worst, of, kind, error):
    """Whether a finding is certain: whether another truth confirms it and, for a gradient, so do
    the forces of the truth."""
    x = {name: np.array([value]) for name, value in worst.items()}
    finer = second_truth_of(truth, of)
    between = float(errors(truth, finer, x, of, kind).errors[0])
    if not 0 <= between < 0.25 * error:
        return False
    return of == "value" or gradient_off(fidelity, truth, x, kind) > 0.75 * error


def gradient_off(fidelity, truth, x, kind):
    """The error of a lane's gradient by secants of the truth's forces, over changes of `_APART` and
    of half of that, whichever is less."""
    varied = KINDS[kind].varied
    changes = np.array([1, -1, 0.5, -0.5]) * _APART
    factors = {name: np.ones((len(varied), len(changes))) for name in varied}
    for i, name in enumerate(varied):
        factors[name][i] += changes
    lanes = {name: np.repeat(value, factors[varied[0]].size) for name, value in x.items()}
    moved = {name: lanes[name] * np.ravel(each) for name, each in factors.items()}
    _, forces, _, _ = run(truth, kind, "value", changed(lanes, moved), _FEWER)
    rise = np.reshape(forces, (len(varied), 2, 2))
    secants = (rise[..., 0] - rise[..., 1]) / (2 * _APART * np.array([1, 0.5]))
    _, peak, _, slopes = run(fidelity, kind, "gradient", x)
    return float(np.min(gradient_error(slopes, secants.T, peak)))


def as_kept(found):
    """A search's findings as `search.json` has them."""
    return {
        "generations": len(found.course) - 1, "good of random": found.good,
        "error, random": found.course[0], "error, found": found.course[-1], "sure": True,
        "unsure, left out": found.unsure, "truths apart": found.apart,
        "by generation": [float(f"{error:.3g}") for error in found.course],
        "worst": found.worst,
    }  # fmt: skip


def _setting(name):
    """The fidelity of that name in the record: a rung, or `standard` with that tolerance."""
    if name in RUNGS:
        return getattr(fj.Fidelity, name)()
    return fj.Fidelity.standard(step_tolerance=float(name))


def judged_again(key, finding):
    """The status [1] of the worst design of a finding on record, and its error; -1 where the status
    is not good, or not that of the truth."""
    kind, _, what, name = key.split(" | ")
    of, sharper = what.split(",")[0], what.endswith("sharper friction")
    fidelity, x = _setting(name), {n: np.array([v]) for n, v in finding["worst"].items()}
    status = fj.Status(int(run(fidelity, kind, of, x)[0][0]))
    return status, float(errors(fidelity, truth_of(fidelity, kind, sharper), x, of, kind).errors[0])


def _again(given):
    """The worst designs on record of what is asked for, judged again."""
    for key, finding in json.loads(RECORD.read_text()).items():
        kind, bounds, what, name = key.split(" | ")
        asked = kind in given.kinds and bounds in given.bounds and name in given.rungs
        if asked and what.split(",")[0] in given.of:
            (status, error), was = judged_again(key, finding), finding["error, found"]
            print(f"{key}: {error:.2e} (on record {was:.2e}), {status.name}", flush=True)


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--kinds", nargs="+", choices=tuple(KINDS), default=list(KINDS))
    flags.add_argument("--rungs", nargs="+", choices=RUNGS, default=list(RUNGS))
    flags.add_argument("--tolerance", type=float, nargs="*", default=[], help="standard with these")
    flags.add_argument("--of", nargs="+", choices=("value", "gradient"), default=["value"])
    flags.add_argument("--bounds", nargs="+", choices=BOUNDS, default=list(BOUNDS))
    flags.add_argument("--lanes", type=int, default=1024, help="designs in a generation")
    flags.add_argument("--generations", type=int, default=10)
    flags.add_argument("--seed", type=int, default=20261123)
    flags.add_argument("--out", type=Path, default=Path("search.json"))
    flags.add_argument("--sharper", action="store_true", help="sorts: a truth of sharper friction")
    flags.add_argument("--record", action="store_true", help="write the table of the record anew")
    flags.add_argument("--again", action="store_true", help="judge the designs on record again")
    given = flags.parse_args()
    if given.record:
        search_record.write(RECORD, RUNGS)
        return
    jax.config.update("jax_enable_x64", True)
    if given.again:
        _again(given)
        return
    cases = {name: _setting(name) for name in (*given.rungs, *(f"{t:g}" for t in given.tolerance))}
    settings = {"lanes": given.lanes, "seed": given.seed}
    # Others that are there already stay.
    report = json.loads(given.out.read_text()) if given.out.exists() else {}
    began = time.perf_counter()
    for kind in given.kinds:
        for bounds in given.bounds:
            for of in given.of:
                what = f"{of}, sharper friction" if given.sharper else of
                for name, fidelity in cases.items():
                    truth = truth_of(fidelity, kind, given.sharper)
                    key = f"{kind} | {bounds} | {what} | {name}"

                    def keep(found, key=key):
                        """What was found after each generation, so that none is lost."""
                        report[key] = settings | as_kept(found)
                        given.out.write_text(json.dumps(report, indent=1) + "\n")
                        course = found.course
                        print(
                            f"{key}: generation {len(course) - 1}, good {100 * found.good:.0f} %, "
                            f"random {course[0]:.2e}, found {course[-1]:.2e}, {found.unsure} "
                            f"unsure left out ({time.perf_counter() - began:.0f} s)", flush=True,
                        )  # fmt: skip

                    search(
                        fidelity, truth, bounds, of, given.lanes, given.generations, given.seed,
                        kind, keep, first_truth_of(fidelity, kind, given.sharper), certain=True,
                    )  # fmt: skip


if __name__ == "__main__":
    fj.tune_compiler()
    main()
