"""The statuses of random real designs at each fidelity, before and after those with a numerical
status are computed again (`fencejax.simulate_many`), and the cost of that.

From the folder `tests`:

    python -m robustness.doubt                 # some minutes
    python -m robustness.doubt --designs 256
    python -m robustness.doubt --record        # the table of TRUST.md anew

Designs are oblique impacts, log-uniform within what fences and parcels may really be (`USUAL` in
`extreme_scenes`), centre of gravity anywhere in the parcel, all in one batch. The cost is the
median of the ratios of five pairs of runs, as they are and refined, one after the other.

Whole sorts, in which blow follows on blow, are counted at `standard`: such as are like the paper's
(`random_scenes.sorts`), and such as a search looks at (`searched_scenes`, within realistic bounds).
"""

import argparse
import time

import figures
import jax
import numpy as np
from robustness import random_scenes
from robustness.extreme_scenes import USUAL, draw, impact
from robustness.searched_scenes import KINDS

import fencejax as fj
from fencejax.results import counted

_ONLY = ("peak_force", "tip_deflection", "impulse")
_NAMES = ("coarse", "fast", "standard")
_DOUBT = "numbers in doubt, in all"


def said(status):
    """What kind of statement a status is."""
    if status <= fj.Status.LEFT_OVER_TIP:
        return "numbers good"
    if status.numerical:
        return "numbers in doubt: computed finer"
    if status >= fj.Status.INCONSISTENT:
        return "no result: the scene's numbers"
    if status == fj.Status.PEAK_AT_END:
        return "not all of it was simulated: run longer"
    return "beyond the model: change the design"


def shares(statuses):
    """Percentages of designs by status, and of those in numerical doubt."""
    found = counted(statuses)
    part = {s.name: round(100 * found.get(s.name, 0) / len(statuses), 1) for s in fj.Status}
    doubted = sum(n for name, n in found.items() if fj.Status[name].numerical)
    return part | {_DOUBT: round(100 * doubted / len(statuses), 1)}


def measured(fidelity, scenes):
    """Shares as they are and refined, and how much longer refining takes."""

    def run(refine):
        return fj.simulate_many(scenes, fidelity=fidelity, only=_ONLY, refine=refine)

    plain, refined, ratios = run(False), run(True), []
    for _ in range(5):
        moments = [time.perf_counter()]
        for refine in (False, True):
            run(refine)
            moments.append(time.perf_counter())
        ratios.append((moments[2] - moments[1]) / (moments[1] - moments[0]))
    return shares(plain.status), shares(refined.status), float(np.median(ratios))


def sorts(count, seed):
    """Random whole sorts by name, such as are like the paper's and such as a search looks at."""
    kind = KINDS["sort"]
    points = np.random.default_rng(seed).random((count, kind.count("realistic")))
    return {
        "like the paper's": random_scenes.sorts(seed, count),
        "as searched": jax.vmap(kind.scene)(kind.numbers(points, "realistic")),
    }


def in_doubt(scenes):
    """Percentages in numerical doubt at `standard`, as they are and refined."""
    runs = (fj.simulate_many(scenes, only=_ONLY, refine=refine) for refine in (False, True))
    return [shares(run.status)[_DOUBT] for run in runs]


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--designs", type=int, default=1024)
    flags.add_argument("--sorts", type=int, default=256)
    flags.add_argument("--seed", type=int, default=20261123)
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    scenes = jax.vmap(impact)(draw(given.seed, given.designs, USUAL))
    columns_of, longer = {}, []
    for name in _NAMES:
        plain, refined, ratio = measured(getattr(fj.Fidelity, name)(), scenes)
        columns_of |= {f"`{name}`": plain, f"{name}, refined": refined}
        longer.append(round(ratio, 1))
        print(f"{name}: {plain}\nrefined: {refined}\n{ratio:.2f} times the time", flush=True)
    of_sorts = {}
    for name, some in sorts(given.sorts, given.seed).items():
        of_sorts[f"sorts {name}"] = (in_doubt(some), "%")
        print(f"sorts {name}: {of_sorts[f'sorts {name}'][0]}", flush=True)
    rows = {}
    for name in (*fj.Status.__members__, _DOUBT):
        meaning = said(fj.Status[name]) if name in fj.Status.__members__ else ""
        found = [column[name] for column in columns_of.values()]
        rows[name] = {"unit": "%", "values": [meaning, *found]}
    if given.record:
        known, command = figures.record(), "cd tests && python -m robustness.doubt --record"
        heads = ["status", "what it says", *columns_of]
        known["doubt"] = {"command": command, "columns": heads, "rows": rows}
        before, after = columns_of["`standard`"][_DOUBT], columns_of["standard, refined"][_DOUBT]
        cost = {
            "designs": (given.designs, "1"), "time": (longer, "1"),
            "in doubt at standard": (before, "%"), "left in doubt": (after, "%"),
            "sorts": (given.sorts, "1"), **of_sorts,
        }  # fmt: skip
        known["doubt's cost"] = figures.group(command, cost)
        figures.write(known)


if __name__ == "__main__":
    fj.tune_compiler()
    main()
