"""Golden numbers: the recorded values and gradients of a dozen scenes of all kinds.

    python tests/reference/golden.py             # compares, bit by bit, on one machine
    python tests/reference/golden.py --record    # writes golden.json anew
    python tests/reference/golden.py "rigid"     # only the cases whose name holds the word

A change that moves code and no arithmetic leaves every bit as it is. A change of the mechanics
moves these numbers; then record them anew and say so. `test_golden.py` compares the cheap cases
within what processors and compiler settings differ by.

A gradient costs four times its value to trace and compile, and is taken only where the derivative
runs through code of its own. Where FENCEJAX_TEST_CACHE names a folder, programs compiled before
are read from there: code that only moved is then compared in half the time.
"""

import json
import sys
from pathlib import Path

if __name__ == "__main__":
    # The compiler's settings of the tests, which order sums in a way of their own.
    sys.path.insert(0, str(Path(__file__).parents[1]))
    import conftest  # noqa: F401

import jax
import numpy as np

import fencejax as fj

FILE = Path(__file__).parent / "golden.json"


def _stiff_fence():
    material = fj.Material(youngs_modulus=10e9, density=1800.0, damping_ratio=0.02)
    return fj.Fence(
        rigid_length=0.3, flexible_length=0.6, thickness=0.02, material=material, taper=fj.Uniform()
    )


# For each: the scene, the fidelity, and the measure whose gradient is taken, if any.
CASES = {
    "oblique impact": (
        lambda: fj.scenes.oblique_impact(duration=0.12), fj.Fidelity(), "peak_force"
    ),
    "over the tip, chords, six modes": (
        lambda: fj.scenes.oblique_impact(distance=1.15, tip_contact=True, duration=0.12),
        fj.Fidelity(modes=6, geometry="chord", step=2.5e-4, step_tolerance=None), "impulse",
    ),
    "uniform fence, S-curve, corner 2": (
        lambda: fj.scenes.oblique_impact(
            fence=_stiff_fence(), drive=fj.SCurveDrive(), corner=2, distance=0.7,
            drive_angle=0.2, duration=0.08,
        ),
        fj.Fidelity(load="shared"), None,
    ),
    "power taper, small deflection": (
        lambda: fj.scenes.oblique_impact(
            fence=fj.Fence(taper=fj.PowerTaper(0.6)), belt=None, fence_friction=None, duration=0.05
        ),
        fj.Fidelity.coarse(geometry="small", modes=1), "peak_stress",
    ),
    "along the fence": (lambda: fj.scenes.along_fence(duration=0.12), fj.Fidelity(), None),
    "border and fence": (lambda: fj.scenes.border_and_fence(duration=0.12), fj.Fidelity(), None),
    "free motion beside a fence": (
        lambda: fj.scenes.free_motion(fence=fj.Fence(), duration=0.12), fj.Fidelity(),
        "peak_torque",
    ),
    "whole sort": (lambda: fj.scenes.whole_sort(), fj.Fidelity.coarse(), "furthest_y"),
    "whole sort, four corners, off the border": (
        lambda: fj.scenes.whole_sort(
            offset=0.1, angle=0.2, fence_corners=(1, 2, 3, 4), duration=0.9
        ),
        fj.Fidelity.fast(), None,
    ),
    "rigid fence, reverse mode": (
        lambda: fj.scenes.oblique_impact(belt=None, fence_friction=None, duration=0.05),
        fj.Fidelity(modes=0, gradient="reverse"), "peak_force",
    ),
    "normal impact": (lambda: fj.scenes.normal_impact(), fj.Fidelity(), "peak_force"),
    "rigid wall": (lambda: fj.scenes.rigid_wall(), fj.Fidelity(), "peak_force"),
}


def compute(name):
    """Numbers of a case: each measure, and the gradient by the scene's field."""
    build, fidelity, measure = CASES[name]

    def run(scene):
        result = fj.simulate(scene, fidelity=fidelity, history=False)
        return (0.0 if measure is None else getattr(result, measure)), result

    if measure is None:
        gradient, result = None, jax.jit(run)(build())[1]
    else:
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


def main(arguments):
    words = [argument for argument in arguments if not argument.startswith("--")]
    names = [name for name in CASES if all(word in name for word in words)]
    found = {name: compute(name) for name in names}
    if "--record" in arguments:
        kept = recorded() if words else {}
        FILE.write_text(json.dumps({**kept, **found}, indent=0) + "\n")
        return 0
    bad, known = 0, recorded()
    for name in names:
        for key in sorted(found[name].keys() | known[name].keys()):
            a, b = found[name].get(key), known[name].get(key)
            if b is None:
                print(f"{name}: {key} is new: {a}")
            elif a is None or not np.array_equal(a, b, equal_nan=True):
                bad += 1
                print(f"{name}: {key}: {a} is not {b}")
    print(f"{len(found)} cases, {bad} numbers differ")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
