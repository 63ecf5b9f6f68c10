"""The errors of all measures that can be an objective or a limit under a good status, in value and
gradient, at each named fidelity.

From the folder `tests`:

    python -m robustness.promises                  # some minutes
    python -m robustness.promises --record         # the table of TRUST.md anew

Designs are random: oblique impacts within what fences and parcels may really be (`USUAL` in
`extreme_scenes`, the centre of gravity anywhere in the parcel) and whole sorts (`random_scenes`).
The truth (`truths`) is the same model with twelve modes. Of impacts it has fixed steps of 12.5 us
and the friction of `reference`; of sorts that of `standard`, and steps that follow their error to a
256th of what this tolerates. An error is relative to the measure, that of the end of contact to the
contact's length, that of the place where it ends to the fence's reach; one of a gradient (by eight
numbers of the scene, each relative to itself) to its norm or, where that is less, to the same size.
"""

import argparse
import time

import figures
import jax
import jax.numpy as jnp
import numpy as np
from robustness import random_scenes, truths
from robustness.extreme_scenes import USUAL, draw, impact
from robustness.peaks import gradient_error

import fencejax as fj
from fencejax.study import in_chunks

MEASURES = (
    "peak_force", "impulse", "tip_deflection", "peak_stress", "peak_torque", "last_contact",
    "leave_x", "leave_y",
)  # fmt: skip
NUMBERS = (
    "fence.thickness", "fence.rigid_length", "fence.flexible_length",
    "fence.material.youngs_modulus", "fence.material.density", "parcel.mass", "parcel.stiffness",
    "drive.top_speed",
)  # fmt: skip
NAMES = ("coarse", "fast", "standard")
_ENDS = ("last_contact", "leave_x", "leave_y")
# Lanes that run side by side.
_LANES = 64


def scenes(kind, seed, count):
    """Random scenes of a kind, stacked."""
    if kind == "impacts":
        return jax.vmap(lambda x: impact(x, 0.2))(draw(seed, count, USUAL))
    return random_scenes.sorts(seed, count)


def truth_of(kind):
    """The finest computation of the truth in an acceptable time."""
    standard = fj.Fidelity.standard()
    if kind == "impacts":
        return truths.fixed(standard, 1.25e-5, modes=12, longest_stride=1, **truths.SHARPER)
    return truths.following(standard, 256, modes=12)


def _program(fidelity):
    """Scenes -> statuses, the measures (lanes, 8), their slopes (lanes, 8, 8), the length of the
    contact."""

    def one(scene):
        def found(factors):
            values = fj.scene_numbers.read(scene, NUMBERS)
            scaled = fj.scene_numbers.replace(scene, NUMBERS, jnp.stack(values) * factors)
            result = fj.simulate(
                scaled, fidelity=fidelity,
                only=(*MEASURES, "first_contact"),
            )  # fmt: skip
            rest = result.status, result.last_contact - result.first_contact
            values = jnp.stack([getattr(result, name) for name in MEASURES])
            return values, (values, *rest)

        slopes, (values, *rest) = jax.jacfwd(found, has_aux=True)(jnp.ones(len(NUMBERS)))
        return values, slopes, *rest

    return jax.jit(jax.vmap(one))


def errors(found, truth, reach):
    """Of each measure the errors of value and gradient [1] of the lanes with a good status, and
    the share of such lanes."""
    values, slopes, status, _ = found
    true, true_slopes, true_status, lasts = truth
    good = np.maximum(status, true_status) <= fj.Status.LEFT_OVER_TIP
    good &= (status != fj.Status.NEVER_TOUCHED) & (true_status != fj.Status.NEVER_TOUCHED)
    ended = good & (np.minimum(status, true_status) != fj.Status.IN_CONTACT_AT_END)
    ended &= np.maximum(status, true_status) != fj.Status.IN_CONTACT_AT_END
    sizes = {"last_contact": lasts, "leave_x": reach, "leave_y": reach}
    by_measure = {}
    for k, name in enumerate(MEASURES):
        some = ended if name in _ENDS else good
        size = sizes.get(name, np.abs(true[:, k]))
        off = np.abs(values[:, k] - true[:, k]) / size
        bent = gradient_error(slopes[:, k], true_slopes[:, k], size)
        by_measure[name] = off[some], bent[some], np.flatnonzero(some)
    return by_measure, float(np.mean(good))


def as_text(values):
    """Median, 99 % and largest [%]."""
    found = [100 * float(f(values)) for f in (np.median, lambda v: np.quantile(v, 0.99), np.max)]
    return " / ".join(f"{number:.2g}" for number in found)


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--impacts", type=int, default=512)
    flags.add_argument("--sorts", type=int, default=96)
    flags.add_argument("--seed", type=int, default=20261124)
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows, began = {}, time.perf_counter()
    counts = {"impacts": given.impacts, "sorts": given.sorts}
    for kind, count in counts.items():
        some = scenes(kind, given.seed, count)
        reach = np.asarray(some.fence.rigid_length + some.fence.flexible_length)
        truth = in_chunks(_program(truth_of(kind)), some, _LANES)
        print(f"truth of {kind} ({time.perf_counter() - began:.0f} s)", flush=True)
        by_rung = {}
        for name in NAMES:
            found = in_chunks(_program(getattr(fj.Fidelity, name)()), some, _LANES)
            by_rung[name], good = errors(found, truth, reach)
            print(f"{kind} {name}: good {100 * good:.0f} %", flush=True)
            for measure, (off, bent, where) in by_rung[name].items():
                worst = where[np.argmax(off)]
                print(f"  {measure:16} {as_text(off):>24} | {as_text(bent):>24}  lane {worst}")
        for measure in MEASURES:
            cells = [as_text(part) for name in NAMES for part in by_rung[name][measure][:2]]
            rows[f"{kind}: {measure}"] = {"unit": "1", "values": cells}
    if given.record:
        known, command = figures.record(), "cd tests && python -m robustness.promises --record"
        heads = [f"{kind}, `{name}`" for name in NAMES for kind in ("value", "gradient")]
        known["every measure"] = {"command": command, "columns": ["measure", *heads], "rows": rows}
        designs = {kind: (count, "1") for kind, count in counts.items()}
        known["every measure's designs"] = figures.group(command, designs)
        figures.write(known)


if __name__ == "__main__":
    fj.tune_compiler()
    main()
