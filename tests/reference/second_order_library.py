"""The impacts of second_order.json by fencejax: each load by itself, and all of them.

From the folder `tests`:

    python -m reference.second_order_library            # some minutes, most of them compiling
    python -m reference.second_order_library --record   # their differences to figures.json, too

The library's geometry is the chords' here, as that of the independent version is, and its steps are
0.1 ms long.
"""

import argparse
import json

import jax
import jax.numpy as jnp

import fencejax as fj

from .second_order import FILE

LOADS = {
    "friction's moment": dict(second_order=fj.SecondOrderLoads(True, False, False)),
    "friction's force": dict(second_order=fj.SecondOrderLoads(False, True, False)),
    "normal force's turn": dict(second_order=fj.SecondOrderLoads(False, False, True)),
    "shear": dict(shear=fj.Shear()),
    "all": dict(second_order=fj.SecondOrderLoads(), shear=fj.Shear()),
}
NUMBERS = {"thickness": 0.045, "ratio": 0.6, "E": 3e9, "distance": 1.0}


def struck(numbers, name, geometry):
    """Peak force [N] of an impact of the record, and the result."""
    rigid = 1.2 * numbers["ratio"] / (1 + numbers["ratio"])
    fence = fj.Fence(
        rigid_length=rigid, flexible_length=1.2 - rigid, thickness=numbers["thickness"],
        material=fj.Material(youngs_modulus=numbers["E"]), **LOADS[name],
    )  # fmt: skip
    fidelity = fj.Fidelity.standard(
        modes=3, static_correction=False, geometry=geometry, step=1e-4, step_tolerance=None,
        slip_speed=1e-3, static_speed=5e-3, longest_stride=1,
    )  # fmt: skip
    scene = fj.scenes.oblique_impact(fence=fence, distance=numbers["distance"], duration=0.1)
    result = fj.simulate(scene, fidelity=fidelity, only=["peak_force", "tip_deflection", "energy"])
    return result.peak_force, result


def compared(name, geometry="chord"):
    """Largest relative differences from the record: of the peak, of the tip's deflection, and of
    the peak's derivatives; and the largest share of the energy that does not balance."""
    run = jax.jit(jax.value_and_grad(lambda n: struck(n, name, geometry), has_aux=True))
    known = json.loads(FILE.read_text(encoding="utf-8"))[name]
    worst = [0.0] * 4
    for place, expected in known["values"].items():
        numbers = {key: jnp.asarray(value) for key, value in NUMBERS.items()}
        (force, result), slopes = run(numbers | {"distance": jnp.asarray(float(place))})
        moved = sum(abs(float(term)) for term in jax.tree.leaves(result.energy))
        off = [float(force) / expected[0] - 1, float(result.tip_deflection) / expected[1] - 1, 0.0]
        if float(place) == NUMBERS["distance"]:
            off[2] = max(
                abs(float(slopes[key]) / slope - 1) for key, (slope, _) in known["slopes"].items()
            )
        off.append(float(result.energy.residual) / moved)
        worst = [max(a, abs(b)) for a, b in zip(worst, off, strict=True)]
    return worst


def main():
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("--record", action="store_true", help="write the figures anew")
    given = flags.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows = []
    for name in LOADS:
        rows.append(compared(name))
        print(f"{name:20}", "  ".join(f"{value:.1e}" for value in rows[-1]), flush=True)
    if given.record:
        import figures

        known = figures.record()
        known["second-order loads"] = {
            "command": "cd tests && python -m reference.second_order_library --record",
            "figures": {
                key: {"value": f"{max(each):.0e}".replace("e-0", "e-"), "unit": ""}
                for key, *each in zip(("peak", "tip", "gradient"), *rows, strict=False)
            },
        }
        figures.write(known)


if __name__ == "__main__":
    main()
