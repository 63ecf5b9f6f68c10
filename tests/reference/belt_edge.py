"""The effect of the belt's edge under the parcel on a whole sort.

From the folder `tests`:

    python -m reference.belt_edge            # two minutes
    python -m reference.belt_edge --record   # the table of VERIFICATION.md anew

The belt's load ends over a length (`FADE` in `fencejax.model.belt_edge`), as the parcel's last
part leaves the belt. What the measures change by with half and twice of it is printed, too.
"""

import argparse

import jax
import numpy as np

import fencejax as fj
from fencejax.model import belt_edge

NAMES = {
    "peak_force": ("peak force", "N", 1), "last_contact": ("end of the force", "s", 3),
    "leave_x": ("C_s there, x", "m", 3), "leave_y": ("C_s there, y", "m", 3),
    "furthest_y": ("furthest y", "m", 3),
}  # fmt: skip
OFFSETS = (0.0, 0.1, 0.2)
FACTORS = (0.5, 2.0)


def sorts(edge):
    """Of whole sorts that begin so far from the border [m], by measure."""
    found = []
    for offset in OFFSETS:
        scene = fj.scenes.whole_sort(offset=offset, belt=fj.Belt(edge=edge))
        result = fj.simulate(scene, only=list(NAMES))
        found.append([float(getattr(result, name)) for name in NAMES])
    return list(zip(*found, strict=True))


def changes(ends):
    """The largest relative change of any measure [1] with half and twice of the fade's length, from
    those `ends` that have it as it is."""
    found, usual = [], belt_edge.FADE
    for factor in FACTORS:
        belt_edge.FADE = factor * usual
        jax.clear_caches()
        found.append(float(np.max(np.abs(np.divide(sorts(True), ends) - 1))))
    belt_edge.FADE = usual
    jax.clear_caches()
    return found


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows, with_edge = {}, sorts(True)
    for (name, unit, digits), without, ends in zip(
        NAMES.values(), sorts(False), with_edge, strict=True
    ):
        pairs = zip(without, ends, strict=True)
        shown = [f"{a:.{digits}f} / {b:.{digits}f}" for a, b in pairs]
        rows[name] = {"unit": unit, "values": shown}
        print(f"{name:20}", "  ".join(rows[name]["values"]), unit)
    changed = changes(with_edge)
    print("changed by half and twice of the fade's length by at most", *changed)
    if given.record:
        import figures

        known = figures.record()
        known["belt's edge"] = {
            "command": "cd tests && python -m reference.belt_edge --record",
            "columns": ["measure", *(f"Delta s = {offset:g} m" for offset in OFFSETS)],
            "rows": {
                f"{name} [{row['unit']}]": {"unit": "", "values": row["values"]}
                for name, row in rows.items()
            },
        }
        known["belt's edge, fade"] = figures.group(
            known["belt's edge"]["command"],
            {
                "length": (1e3 * belt_edge.FADE, "mm"),
                "changes": ([float(f"{100 * change:.2g}") for change in changed], "%"),
            },
        )
        figures.write(known)


if __name__ == "__main__":
    main()
