"""Golden numbers: what a dozen scenes of all kinds gave, value and gradient.

    python tests/reference/golden.py           # compares, bit by bit, on one machine
    python tests/reference/golden.py --record  # writes golden.json anew

A change that moves code and no arithmetic leaves every bit as it is. A change of the mechanics
moves these numbers; then record them anew and say so. `test_golden.py` compares them within what
processors and compiler settings differ by.
"""

import json
import os
import sys
from pathlib import Path

if __name__ == "__main__":
    os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=0")

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj

FILE = Path(__file__).parent / "golden.json"


def _stiff_fence():
    material = fj.Material(youngs_modulus=10e9, density=1800.0, damping_ratio=0.02)
    return fj.Fence(
        rigid_length=0.3, flexible_length=0.6, thickness=0.02, material=material, taper=fj.Uniform()
    )


# For each: the scene, the fidelity, and the measure whose gradient is taken.
CASES = {
    "oblique impact": (
        lambda: fj.scenes.oblique_impact(duration=0.12), fj.Fidelity(), "peak_force"
    ),
    "oblique impact, chords, six modes": (
        lambda: fj.scenes.oblique_impact(distance=0.9, duration=0.06),
        fj.Fidelity(modes=6, geometry="chord", step=1e-4), "peak_force",
    ),
    "oblique impact over the tip": (
        lambda: fj.scenes.oblique_impact(distance=1.15, tip_contact=True, duration=0.12),
        fj.Fidelity.fast(), "impulse",
    ),
    "oblique impact, reverse mode": (
        lambda: fj.scenes.oblique_impact(distance=0.8, duration=0.05),
        fj.Fidelity.coarse(gradient="reverse"), "peak_force",
    ),
    "uniform fence, S-curve, corner 2": (
        lambda: fj.scenes.oblique_impact(
            fence=_stiff_fence(), drive=fj.SCurveDrive(), corner=2, distance=0.7,
            drive_angle=0.2, duration=0.08,
        ),
        fj.Fidelity(load="shared"), "peak_stress",
    ),
    "along the fence": (
        lambda: fj.scenes.along_fence(duration=0.12), fj.Fidelity(), "peak_torque"
    ),
    "border and fence": (
        lambda: fj.scenes.border_and_fence(duration=0.12), fj.Fidelity(), "peak_border_force"
    ),
    "free motion beside a fence": (
        lambda: fj.scenes.free_motion(fence=fj.Fence(), duration=0.12), fj.Fidelity(),
        "tip_deflection",
    ),
    "whole sort": (lambda: fj.scenes.whole_sort(), fj.Fidelity.fast(), "peak_force"),
    "whole sort, four corners, off the border": (
        lambda: fj.scenes.whole_sort(
            offset=0.1, angle=0.2, fence_corners=(1, 2, 3, 4), duration=0.9
        ),
        fj.Fidelity.coarse(), "furthest_y",
    ),
    "rigid fence": (
        lambda: fj.scenes.oblique_impact(duration=0.05), fj.Fidelity(modes=0), "peak_force"
    ),
    "normal impact": (lambda: fj.scenes.normal_impact(), fj.Fidelity(), "peak_force"),
    "rigid wall": (lambda: fj.scenes.rigid_wall(), fj.Fidelity(), "peak_force"),
}


def compute(name):
    """Numbers of a case: each measure, and the gradient by the scene's field."""
    build, fidelity, measure = CASES[name]

    def run(scene):
        result = fj.simulate(scene, fidelity=fidelity, history=False)
        return getattr(result, measure), result

    gradient, result = jax.jit(jax.grad(run, has_aux=True))(build())
    found = {}
    for prefix, tree in (("", result), ("gradient ", gradient)):
        if prefix == "":
            tree = {**tree.measures, **{k: v for k, v in vars(tree).items() if k != "measures"}}
        for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
            key = jax.tree_util.keystr(path).lstrip(".").replace("['", "").replace("']", "")
            found[prefix + key] = [float(x) for x in np.atleast_1d(np.asarray(leaf)).ravel()]
    return found


def recorded():
    """The numbers on file, by case and name."""
    return json.loads(FILE.read_text())


def main():
    fj.tune_compiler()
    jax.config.update("jax_enable_x64", True)
    jnp.zeros(())
    found = {name: compute(name) for name in CASES}
    if "--record" in sys.argv:
        FILE.write_text(json.dumps(found, indent=0) + "\n")
        return 0
    bad = 0
    for name, known in recorded().items():
        if found[name].keys() != known.keys():
            print(f"{name}: other fields: {sorted(found[name].keys() ^ known.keys())}")
        for key in found[name].keys() & known.keys():
            a, b = found[name][key], known[key]
            if not np.array_equal(a, b, equal_nan=True):
                bad += 1
                print(f"{name}: {key}: {a} is not {b}")
    print(f"{len(found)} cases, {bad} numbers differ")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
