"""The random designs that each constant of `fencejax.results.diagnostics`, and of `hold` beside it,
refuses and accepts, with all other constants unchanged.

From the folder `tests`:

    python -m robustness.thresholds                # half an hour
    python -m robustness.thresholds --trials 'a clutch' --scenes 256 --seed 7
    python -m robustness.thresholds --record       # the table of TRUST.md anew

There is a trial for each kind of scene that a constant speaks of (`TRIALS`). Its designs get their
statuses at a named fidelity, with the constants as they are and with each of them halved, doubled
or left out. Those that one of these takes from a good status or gives one are computed with their
gradients and compared with the truth (sixteen modes, the friction of `reference`, steps of 12.5 us,
in whole sorts steps that follow their error): the status is to be good where they keep the promise
of `offline_fuzz`, and only there.
Constants that judge derivatives get the statuses that go with gradients. So `3 / 5` under *without*
means that the constant keeps three wrong results from a good status, and five right ones. One that
keeps no wrong one from it does not earn its keep by these designs.
"""

import argparse
import contextlib
import functools
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import figures
import jax
import jax.numpy as jnp
import numpy as np
from robustness import truths
from robustness.extreme_scenes import USUAL, WIDE, draw, impact, riding
from robustness.offline_fuzz import PROMISE
from robustness.peaks import gradient_error
from robustness.searched_scenes import KINDS

import fencejax as fj
from fencejax.results import diagnostics, hold, rivals
from fencejax.study import in_chunks

# The last one is as good as none.
FACTORS = (0.5, 2.0, 1e9)
RUNGS = ("standard", "coarse")
# These refuse the more the larger they are: their inverse is what is halved, doubled, left out.
_INVERSE = {"_IN_DOUBT", "_EDGE", "_MULTIPLIED"}
# Lanes that run side by side, and those of what is compared with the truth.
_LANES, _FEWER = 128, 32
_DURATION = 0.1
_VARIED = KINDS["impact"].varied


def halves(seed, count):
    """Half of them as real designs may be, half from end to end of what a sweep may ask for."""
    drawn = [draw(seed + k, count // 2, ranges) for k, ranges in enumerate((USUAL, WIDE))]
    return {n: np.concatenate([half[n] for half in drawn]) for n in drawn[0]}


def drawn(seed, count, ranges):
    """Real designs, and further numbers of them, log-uniform."""
    rng = np.random.default_rng([seed, 1])
    return draw(seed, count, USUAL) | {
        name: np.exp(rng.uniform(np.log(low), np.log(high), count))
        for name, (low, high) in ranges.items()
    }


def steep(seed, count):
    """The same on belts whose static friction is up to a hundred times the kinetic."""
    numbers, rng = halves(seed, count), np.random.default_rng([seed, 1])
    kinetic, ratio = (
        np.exp(rng.uniform(np.log(low), np.log(high), count))
        for low, high in ((0.01, 1.0), (1.5, 100.0))
    )
    return numbers | {"belt_kinetic": kinetic, "belt_static": np.minimum(kinetic * ratio, 5.0)}


def at_tips(seed, count):
    """The same where parcels come to the tip: met anywhere on the fence, by a fast belt."""
    numbers, rng = halves(seed, count), np.random.default_rng([seed, 2])
    belt = np.exp(rng.uniform(np.log(0.5), np.log(20.0), count))
    place = rng.uniform(0.3, 0.99, count)
    return numbers | {"place": place, "belt": belt, "ride": belt}


def clutches(seed, count):
    """Real designs on a shaft of any stiffness, its damping a share of the critical, its clutch
    slipping under what pushes the parcel by 2 to 200 m/s^2."""
    ranges = {"shaft": (1e3, 1e9), "lag": (1e-3, 0.3), "hub": (1e-3, 3.0), "grip": (2.0, 200.0)}
    return drawn(seed, count, ranges)


def whole_sorts(seed, count):
    """Whole sorts of real fences and parcels."""
    sort = KINDS["sort"]
    shares = np.random.default_rng([seed, 3]).random((count, sort.count("realistic")))
    return sort.numbers(shares, "realistic")


def on_clutch(x):
    """The impact with the fence on such a shaft."""
    fence = impact(x, _DURATION).fence
    assert fence is not None
    inertia = x["hub"] + x["reach"] ** 3 * x["width"] * x["thickness"] * x["density"] / 3
    damping = 2 * x["lag"] * jnp.sqrt(x["shaft"] * inertia)
    limit = x["grip"] * x["mass"] * x["place"] * x["reach"]
    shaft = fj.Shaft(x["shaft"], damping, x["hub"], limit)
    on_shaft = fj.Fence(
        fence.rigid_length, fence.flexible_length, fence.width, fence.thickness, fence.material,
        shaft=shaft,
    )  # fmt: skip
    return impact(x, _DURATION, fence=on_shaft)


class Trial(NamedTuple):
    """Scenes that constants speak of: numbers from a seed and a count; how they make a scene; the
    constants; what of the fidelity is changed; what else is asked for, as statuses need it; how
    many times as many designs there are: four where few are concerned; whether the statuses are
    those that go with gradients; and whether the constants decide what is compiled."""

    numbers: Callable[[int, int], dict[str, Any]]
    scene: Callable[[Mapping[str, Any]], fj.Scene]
    constants: tuple[str, ...]
    changes: Mapping[str, Any] = {}
    only: tuple[str, ...] = ()
    more: int = 1
    of_gradients: bool = False
    decide: bool = False


def _impact(x):
    return impact(x, _DURATION)


TRIALS = {
    "impacts": Trial(
        halves, _impact,
        (
            "LAGGING", "_RESIDUAL_DEFLECTION", "_SMOOTHED", "_CREEP_LOSS", "_CREEP_SPEED",
            "_CREEP_SHARE", "_STEP_SLIP", "_REBOUND_ROUGHNESS", "_RINGING", "_DAMPER_HELD", "_HELD",
            "_EDGE",
        ),
    ),
    "impacts, fixed steps": Trial(
        halves, _impact,
        (
            "_ROUGHNESS", "_REBOUND_ROUGHNESS", "_NEGLIGIBLE_ROUGHNESS", "_RINGING",
            "_DAMPER_HELD",
        ),
        {"step_tolerance": None},
    ),
    "their ledgers": Trial(halves, _impact, ("_UNBALANCED",), {}, ("energy", "final")),
    "their ledgers, fixed steps": Trial(
        halves, _impact, ("_UNBALANCED",), {"step_tolerance": None}, ("energy", "final")
    ),
    "impacts, their gradients": Trial(
        halves, _impact, ("LAGGING", "_IN_DOUBT"), of_gradients=True
    ),
    "much static friction": Trial(steep, _impact, ("_CREEP_LOSS",), more=4),
    "parcels at the tip": Trial(at_tips, _impact, ("_ABOVE_SAMPLES",), more=4),
    "whole sorts": Trial(
        whole_sorts,
        KINDS["sort"].scene,
        ("_MULTIPLIED", "_HELD", "_EDGE", "_DRIFTED"),
    ),
    "blows in whole sorts": Trial(
        whole_sorts, KINDS["sort"].scene, ("_BLOWS", "_ONE_BLOW", "_TWO_BLOWS"), decide=True
    ),
    "a clutch": Trial(clutches, on_clutch, ("_SLIPPING",)),
}  # fmt: skip
"""Every trial by name."""


def _homes(constant):
    """The modules that have the constant."""
    return [each for each in (hold, rivals, diagnostics) if hasattr(each, constant)]


def _value(constant):
    return getattr(_homes(constant)[0], constant)


@contextlib.contextmanager
def _scaled(constants, factors):
    """With the constants times factors."""
    usual = {each: _value(each) for each in constants}
    try:
        for constant, factor in zip(constants, factors, strict=True):
            factor = 1 / factor if constant in _INVERSE else factor
            for home in _homes(constant):
                setattr(home, constant, usual[constant] * factor)
        yield
    finally:
        for constant, value in usual.items():
            for home in _homes(constant):
                setattr(home, constant, value)


def left_out(constants):
    """Without the constants: what is traced meanwhile refuses nothing by them."""
    return _scaled(constants, [FACTORS[-1]] * len(constants))


@functools.cache
def statuses_of(trial, fidelity):
    """Numbers of lanes, and rows of factors of the constants -> statuses (lanes, rows)."""
    given = TRIALS[trial]

    def status(x):
        only = ("peak_force", *given.only)
        return fj.simulate(given.scene(x), fidelity=fidelity, only=only).status

    def one(x, factors):
        with _scaled(given.constants, factors):
            return status(x)

    if not (given.of_gradients or given.decide):
        # The motion does not depend on the constants: it is computed once for all rows.
        return jax.jit(jax.vmap(jax.vmap(one, (None, 0)), (0, None)))

    programs = {}
    each = (lambda x: _peak(given, fidelity, x)[0]) if given.of_gradients else status

    def compiled(x, factors):
        """A program of its own, as what the constants decide, or judge of derivatives, is made with
        them; the same one for factors that make no difference."""
        jax.clear_caches()
        with _scaled(given.constants, factors):
            lowered = jax.jit(jax.vmap(each)).lower(x)
        text = lowered.as_text()
        if text not in programs:
            programs[text] = lowered.compile()
        return text

    texts = {}

    def rows(x, factors):
        listed = [tuple(row) for row in factors.tolist()]
        texts.update({row: compiled(x, row) for row in listed if row not in texts})
        found = {text: programs[text](x) for text in {texts[row] for row in listed}}
        return np.stack([found[texts[row]] for row in listed], axis=-1)

    return rows


def _peak(given, fidelity, x):
    """Status, peak force and its slopes (varied,)."""

    def peak(varied):
        scene = given.scene(riding(x, varied))
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
        return result.peak_force, (result.status, result.peak_force)

    slopes, found = jax.jacfwd(peak, has_aux=True)({n: x[n] for n in _VARIED})
    return *found, jnp.stack([slopes[n] * x[n] for n in _VARIED], axis=-1)


@functools.cache
def peaks_of(trial, fidelity):
    """Numbers of lanes -> status, peak force and its slopes (see `peaks`)."""
    return jax.jit(jax.vmap(functools.partial(_peak, TRIALS[trial], fidelity)))


def kept(found, truth, name):
    """For each lane, whether the promise is kept, and whether that is certain."""
    _, peak, slopes = found
    true_status, true, true_slopes = truth
    certain = (true_status <= fj.Status.LEFT_OVER_TIP) & (true > 0)
    size = np.where(true > 0, true, 1.0)
    of_value, of_gradient = PROMISE[name]
    value = np.abs(peak / size - 1) <= of_value
    return value & (gradient_error(slopes, true_slopes, size) <= of_gradient), certain


def truth_of(trial):
    """The finest computation of the truth in an acceptable time."""
    fidelity = fj.Fidelity.standard()
    if TRIALS[trial].numbers is whole_sorts:
        return truths.following(fidelity, 64, modes=16, **truths.SHARPER)
    return truths.fixed(fidelity, 1.25e-5, modes=16, longest_stride=1, **truths.SHARPER)


def tried(trial, scenes, seed, name):
    """Of a trial's constants, by name: of the designs that each of the `FACTORS` takes from a good
    status or gives one, those that break the promise and those that keep it; and the share of all
    designs that have a good status."""
    given = TRIALS[trial]
    numbers, constants = given.numbers(seed, given.more * scenes), given.constants
    each = np.eye(len(constants))[:, None] * (np.array(FACTORS)[:, None] - 1) + 1
    factors = np.concatenate([np.ones((1, len(constants))), each.reshape(-1, len(constants))])
    fidelity = getattr(fj.Fidelity, name)(**given.changes)
    judged = statuses_of(trial, fidelity)
    statuses = in_chunks(lambda some: judged(some, factors), numbers, _LANES)
    good = statuses <= fj.Status.LEFT_OVER_TIP
    changes = good[:, 1:] != good[:, :1]
    # The others need no truth.
    some = np.flatnonzero(changes.any(axis=1))
    cells = {constant: [(0, 0)] * len(FACTORS) for constant in constants}
    if some.size:
        x = {n: value[some] for n, value in numbers.items()}
        found, truth = (
            in_chunks(peaks_of(trial, f), x, _FEWER) for f in (fidelity, truth_of(trial))
        )
        keeps, certain = kept(found, truth, name)
        shape = len(some), len(constants), len(FACTORS)
        changed = changes[some].reshape(shape) & certain[:, None, None]
        for k, constant in enumerate(constants):
            cells[constant] = [
                (int(np.sum(by & ~keeps)), int(np.sum(by & keeps))) for by in changed[:, k].T
            ]
    return cells, float(np.mean(good[:, 0]))


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--trials", nargs="+", choices=tuple(TRIALS), default=list(TRIALS))
    flags.add_argument("--scenes", type=int, default=2048)
    flags.add_argument("--seed", type=int, default=20261125)
    flags.add_argument("--rungs", nargs="+", choices=tuple(PROMISE), default=list(RUNGS))
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows, began = {}, time.perf_counter()
    for trial in given.trials:
        for name in given.rungs:
            cells, good = tried(trial, given.scenes, given.seed, name)
            seconds = time.perf_counter() - began
            print(f"{trial}, {name}: {100 * good:.0f} % good ({seconds:.0f} s)", flush=True)
            for constant, pairs in cells.items():
                shown = ["{} / {}".format(*pair) for pair in pairs]
                print(f"  {constant:24}", "   ".join(shown), flush=True)
                value = f"{_value(constant):g}"
                rows.setdefault((constant, trial), [trial, value]).extend(shown)
    if given.record:
        _record(rows, given)


def _record(rows, given):
    known = figures.record()
    command = "cd tests && python -m robustness.thresholds --record"
    heads = [f"{name}, {head}" for name in given.rungs for head in ("half", "twice", "without")]
    columns = ["constant", "scenes", "its value", *heads]
    # Rows of trials that are not made anew stay.
    was = known["thresholds"]
    if was["columns"] == columns:
        old = {(n.strip("` "), row["values"][0]): row["values"] for n, row in was["rows"].items()}
        rows = {key: row for key, row in old.items() if key[1] not in given.trials} | rows
    shown: dict = {}
    # Names are one each: those of a constant's further rows end with blanks.
    for (constant, _), values in sorted(rows.items()):
        name = f"`{constant}`"
        while name in shown:
            name = f"{name} "
        shown[name] = {"unit": "", "values": values}
    known["thresholds"] = {"command": command, "columns": columns, "rows": shown}
    said = {"designs": given.scenes, "designs where few are concerned": 4 * given.scenes}
    known["thresholds, all"] = figures.group(command, {n: (v, "1") for n, v in said.items()})
    figures.write(known)


if __name__ == "__main__":
    fj.tune_compiler()
    main()
