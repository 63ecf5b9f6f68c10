"""The effect of the belt's edge under the parcel on a whole sort.

From the folder `tests`:

    python -m reference.belt_edge            # a minute
    python -m reference.belt_edge --record   # the table of VERIFICATION.md anew
"""

import argparse

import jax

import fencejax as fj

NAMES = {
    "peak_force": ("peak force", "N", 1), "last_contact": ("end of the force", "s", 3),
    "leave_x": ("C_s there, x", "m", 3), "leave_y": ("C_s there, y", "m", 3),
    "furthest_y": ("furthest y", "m", 3),
}  # fmt: skip
OFFSETS = (0.0, 0.1, 0.2)


def sorts(edge):
    """Of whole sorts that begin so far from the border [m], by measure."""
    found = []
    for offset in OFFSETS:
        scene = fj.scenes.whole_sort(offset=offset, belt=fj.Belt(edge=edge))
        result = fj.simulate(scene, only=list(NAMES))
        found.append([float(getattr(result, name)) for name in NAMES])
    return list(zip(*found, strict=True))


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--record", action="store_true", help="write the record anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows = {}
    for (name, unit, digits), without, ends in zip(
        NAMES.values(), sorts(False), sorts(True), strict=True
    ):
        pairs = zip(without, ends, strict=True)
        shown = [f"{a:.{digits}f} / {b:.{digits}f}" for a, b in pairs]
        rows[name] = {"unit": unit, "values": shown}
        print(f"{name:20}", "  ".join(rows[name]["values"]), unit)
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
        figures.write(known)


if __name__ == "__main__":
    main()
