"""What a status still means: how random real designs end at each fidelity, as they are and with
those in doubt computed again (`fencejax.simulate_many`), and what that costs.

    python tests/robustness/doubt.py --out doubt.json
    python tests/robustness/doubt.py --designs 256 --fidelity standard --out doubt.json

Designs are oblique impacts, log-uniform within what fences and parcels may really be (`USUAL` in
`extreme_scenes`), centre of gravity anywhere in the parcel. The cost is the median of the times of
batches of 64, as they are and refined, side by side. `doubt.json` beside this file is what the
first command found.
"""

import argparse
import json
import time
from pathlib import Path

import jax
import numpy as np
from robustness.extreme_scenes import USUAL, draw, impact

import fencejax as fj
from fencejax.results import counted

_BATCH = 64
_ONLY = ("peak_force", "tip_deflection", "impulse")


def ended(statuses):
    """Shares of designs [1]: without numerical doubt, with a good status, and by status."""
    told = [fj.Status(int(status)) for status in statuses]
    return {
        "numerically good": float(np.mean([not status.numerical for status in told])),
        "good": float(np.mean([status <= fj.Status.LEFT_OVER_TIP for status in told])),
        **{name: number / len(told) for name, number in counted(statuses).items()},
    }


def measured(name, scenes, lanes):
    """How the designs of a batch of scenes end at a fidelity, plain and refined, and the cost."""
    fidelity = getattr(fj.Fidelity, name)()
    statuses, rungs, times = {False: [], True: []}, [], {False: [], True: []}
    batches = [
        jax.tree.map(lambda leaf, k=k: leaf[k : k + _BATCH], scenes)
        for k in range(0, lanes, _BATCH)
    ]
    # Compiled before the clock runs.
    for batch in batches:
        fj.simulate_many(batch, fidelity=fidelity, only=_ONLY)
    for batch in batches:
        for refine in (False, True):
            began = time.perf_counter()
            found = fj.simulate_many(batch, fidelity=fidelity, only=_ONLY, refine=refine)
            times[refine].append(time.perf_counter() - began)
            statuses[refine].append(found.status)
        rungs.append(found.rung)
    ratio = float(np.median(np.array(times[True]) / np.array(times[False])))
    return {
        "plain": ended(np.concatenate(statuses[False])),
        "refined": ended(np.concatenate(statuses[True])),
        "by rung": (np.bincount(np.concatenate(rungs)) / lanes).tolist(),
        "time, refined over plain": ratio,
    }


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--designs", type=int, default=1024, help="a multiple of 64")
    flags.add_argument(
        "--fidelity", nargs="+", default=["coarse", "fast", "standard"],
        choices=("coarse", "fast", "standard"),
    )
    flags.add_argument("--seed", type=int, default=20261123)
    flags.add_argument("--out", type=Path, default=Path("doubt.json"))
    given = flags.parse_args()
    if given.designs % _BATCH:
        flags.error(f"--designs must be a multiple of {_BATCH}, but is {given.designs}")
    jax.config.update("jax_enable_x64", True)
    scenes = jax.vmap(impact)(draw(given.seed, given.designs, USUAL))
    report: dict = {"designs": given.designs, "seed": given.seed}
    for name in given.fidelity:
        report[name] = measured(name, scenes, given.designs)
        print(name, json.dumps(report[name], indent=1), flush=True)
        given.out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    fj.tune_compiler()
    main()
