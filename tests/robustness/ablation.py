"""A search for errors under a good status, with constants of the statuses left out.

From the folder `tests`:

    python -m robustness.ablation --constants _RINGING _DAMPER_HELD --kinds impact --out FILE
    python -m robustness.ablation --record --out FILE     # the table of TRUST.md

`thresholds` asks what a constant refuses among random designs. Where it refuses hardly any, whether
it is worth having is asked of a search: it breeds designs for the largest error, as `search` does,
among those that have a good status without the constants named, all of them left out at once. It
ends where the promise is broken, for certain. The constants, or one of them, are needed then, if
the worst design has no good status with all of them. Where the promise is kept to the end, nothing
has shown that they are needed in such scenes.
"""

import argparse
import json
import time
from pathlib import Path

import figures
import jax
from robustness import search
from robustness.offline_fuzz import PROMISE
from robustness.searched_scenes import KINDS
from robustness.thresholds import left_out

import fencejax as fj


def found_without(constants, kind, of, name, lanes, generations, seed, keep):
    """Search realistic designs without the constants until the promise is broken, for certain, or
    for so many `generations`. `keep(finding, text)` gets what is found after each, as `search.json`
    has it, with whether the promise is `"broken"`, and a line about it."""
    fidelity, promised = getattr(fj.Fidelity, name)(), PROMISE[name][of == "gradient"]

    def look(found):
        most = found.course[-1]
        finding = {"lanes": lanes, "seed": seed} | search.as_kept(found)
        keep(
            finding | {"broken": most > promised},
            f"generation {len(found.course) - 1}, good {100 * found.good:.0f} %, "
            f"found {most:.2e}, promised {promised:g}",
        )

    # What is traced for a search with other constants does not hold for this one.
    jax.clear_caches()
    with left_out(constants):
        search.search(
            fidelity, search.truth_of(fidelity, kind), "realistic", of, lanes, generations, seed,
            kind, look, search.first_truth_of(fidelity, kind), certain=True, enough=promised,
        )  # fmt: skip


def _table(out):
    """The findings as a table: what is found without which constants, of what is promised."""
    rows = {}
    for key, finding in json.loads(out.read_text()).items():
        constants, kind, of, name = key.split(" | ")
        judged = finding["lanes"] * (1 + finding["generations"])
        error = float(f"{100 * finding['error, found']:.2g}")
        verdict = "**broken**" if finding["broken"] else "kept"
        row = rows.setdefault(f"`{constants}`, {kind}", {})
        row[f"{of}, `{name}`"] = f"{error:g} % of {judged:,}, {verdict}"
    columns = sorted({column for row in rows.values() for column in row})
    known = figures.record()
    command = "cd tests && python -m robustness.ablation --record --out robustness/ablation.json"
    known["ablation"] = figures.table(command, "without", rows, columns)
    figures.write(known)


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--constants", nargs="+", default=[], help="left out, all at once")
    flags.add_argument("--kinds", nargs="+", choices=tuple(KINDS), default=["impact"])
    flags.add_argument("--rungs", nargs="+", choices=tuple(PROMISE), default=["standard"])
    flags.add_argument("--of", nargs="+", choices=("value", "gradient"), default=["value"])
    flags.add_argument("--lanes", type=int, default=1024, help="designs in a generation")
    flags.add_argument("--generations", type=int, default=10)
    flags.add_argument("--seed", type=int, default=20261129)
    flags.add_argument("--out", type=Path, default=Path("ablation.json"))
    flags.add_argument("--record", action="store_true", help="write the table of FILE anew")
    given = flags.parse_args()
    if given.record:
        _table(given.out)
        return
    jax.config.update("jax_enable_x64", True)
    began = time.perf_counter()
    for kind in given.kinds:
        for of in given.of:
            for name in given.rungs:
                key = f"{', '.join(given.constants)} | {kind} | {of} | {name}"

                def keep(finding, text, key=key):
                    """What is found after each generation, so that none is lost."""
                    # Others that are there already stay.
                    report = json.loads(given.out.read_text()) if given.out.exists() else {}
                    report[key] = finding
                    given.out.write_text(json.dumps(report, indent=1) + "\n")
                    print(f"{key}: {text} ({time.perf_counter() - began:.0f} s)", flush=True)

                found_without(
                    given.constants, kind, of, name, given.lanes, given.generations, given.seed,
                    keep,
                )  # fmt: skip


if __name__ == "__main__":
    fj.tune_compiler()
    main()
