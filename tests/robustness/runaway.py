"""The deflection of the tip above which a motion is out of control: `_RUNAWAY` of
`fencejax.results.diagnostics`.

From the folder `tests`:

    python -m robustness.runaway                   # some minutes
    python -m robustness.runaway --record          # the table of TRUST.md anew

Impacts on limp fences, as thin as a sheet, are computed at a named fidelity and at the last rung of
its ladder. Linear beam theory ends at a quarter of the flexible link, and the geometry of the bent
fence with it: a motion may then feed on itself until its numbers have nothing to do with the scene.
For each range of the tip's deflection, in such quarters, it prints in how many designs the peak
force is within a factor of two of the finer one's, and its gradient has a norm of less than a
hundred times the force.
"""

import argparse

import figures
import jax
import jax.numpy as jnp
import numpy as np
from robustness.extreme_scenes import USUAL, draw, impact, riding
from robustness.searched_scenes import KINDS

import fencejax as fj
from fencejax.results import diagnostics
from fencejax.study import in_chunks

RUNGS = ("coarse", "fast", "standard")
LIMP = USUAL | {"thickness": (1e-3, 2e-2), "modulus": (1e8, 1e10), "belt": (0.5, 8.0)}
EDGES = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 1e300)
_LANES = 128
_VARIED = KINDS["impact"].varied


def program(fidelity):
    """Numbers of lanes -> peak force, tip's deflection in quarters of the flexible link, and the
    norm of the force's gradient over the force."""

    def one(x):
        def peak(varied):
            scene = impact(riding(x, varied), 0.1)
            result = fj.simulate(scene, fidelity=fidelity, only=("peak_force", "tip_deflection"))
            assert scene.fence is not None
            tip = 4 * result.tip_deflection / scene.fence.flexible_length
            return result.peak_force, (result.peak_force, tip)

        slopes, (force, tip) = jax.jacfwd(peak, has_aux=True)({n: x[n] for n in _VARIED})
        norm = jnp.sqrt(sum((slopes[n] * x[n]) ** 2 for n in _VARIED))
        return force, tip, norm

    def run(x):
        # With no limit, a motion out of control has its derivatives still.
        usual, diagnostics._RUNAWAY = diagnostics._RUNAWAY, 1e300
        try:
            return jax.vmap(one)(x)
        finally:
            diagnostics._RUNAWAY = usual

    return jax.jit(run)


def judged(found, finer):
    """For each range of the deflection: designs, those whose force has to do with the finer one's,
    and those whose gradient is of a sensible size."""
    (force, tip, norm), true = found, finer[0]
    ratio = np.where((force > 0) & (true > 0), force / np.where(true > 0, true, 1.0), np.inf)
    alike, sensible = (ratio > 0.5) & (ratio < 2.0), norm < 100 * force
    rows = []
    for low, high in zip(EDGES[:-1], EDGES[1:], strict=True):
        some = (tip > low) & (tip <= high)
        rows.append(tuple(int(np.sum(some & also)) for also in (some, alike, sensible)))
    return rows


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--scenes", type=int, default=512)
    flags.add_argument("--seed", type=int, default=20261126)
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    numbers = draw(given.seed, given.scenes, LIMP)
    cells = {}
    for name in RUNGS:
        ladder = getattr(fj.Fidelity, name)().ladder()
        cells[name] = judged(
            *(in_chunks(program(f), numbers, _LANES) for f in (ladder[0], ladder[-1]))
        )
        print(name, cells[name], flush=True)
    if given.record:
        _record(cells, given.scenes)


def _record(cells, scenes):
    known, command = figures.record(), "cd tests && python -m robustness.runaway --record"
    rows = {}
    for k, (low, high) in enumerate(zip(EDGES[:-1], EDGES[1:], strict=True)):
        of = f"{low:g} to {high:g}" if high < 1e9 else f"above {low:g}"
        shown = ["{} / {} / {}".format(*cells[name][k]) for name in RUNGS]
        rows[of] = {"unit": "", "values": shown}
    columns = ["quarters", *(f"`{name}`" for name in RUNGS)]
    known["runaway"] = {"command": command, "columns": columns, "rows": rows}
    said = {"designs": (scenes, "1"), "limit": (diagnostics._RUNAWAY, "1")}
    known["runaway, all"] = figures.group(command, said)
    figures.write(known)


if __name__ == "__main__":
    fj.tune_compiler()
    main()
