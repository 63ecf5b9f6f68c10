"""Record reference values and derivatives of the oblique impact in recorded.json.

Run from the repository root: python -m tests.independent.record (about ten minutes).

Derivatives are central differences with relative steps h, h/2, h/4 and one Richardson
extrapolation, (4 D(h/4) - D(h/2))/3. The error stated is the larger of its distance from
(4 D(h/2) - D(h))/3 and the change when the integrator's tolerance is ten times looser.
"""

import json
from dataclasses import replace
from pathlib import Path

from .impact import Impact, rigid_wall, solve

TOLERANCE = 1e-10
STEP = 0.008
# The corner's path crosses a node, where the load sharing (2.8) has a kink: the peak bends
# sharply in the variables that shift one against the other.
FINE_STEP = {"l_s": 0.001, "l_p": 0.001, "distance": 0.001}
TOTAL_LENGTH = 1.2
ONE_LINK = {"l_s": 0.0, "l_p": 1.2, "thickness": 0.073}
QUANTITIES = ("peak_force", "tip_deflection", "impulse")
DERIVED = {
    "R = 1.0, derivatives": {},
    "R = 1.0, consistent load, derivatives": {"load": "cubic"},
    "R = 0.8, consistent load, derivatives": {"load": "cubic", "distance": 0.8},
}
CASES = {
    "R = 0.8": {"distance": 0.8},
    "R = 0.9": {"distance": 0.9},
    "R = 1.05": {"distance": 1.05},
    "R = 1.08": {"distance": 1.08},
    "R = 1.0, one link": ONE_LINK,
    "R = 1.0, offset centre of gravity": {"center": (0.03, -0.02)},
}
PLAIN = (
    "thickness",
    "E",
    "rho",
    "zeta",
    "width",
    "l_s",
    "l_p",
    "top_speed",
    "belt_speed",
    "mass",
    "stiffness",
    "damping",
    "distance",
)


def variable(impact, name):
    """Value of a design variable: a field, a kinetic friction coefficient, or l_s/l_p [-]."""
    if name == "ratio":
        return impact.l_s / impact.l_p
    if name in ("mu_fence", "mu_belt"):
        return getattr(impact, name)[0]
    return getattr(impact, name)


def changed(impact, name, value):
    """The impact with one design variable at `value`; "ratio" keeps l_s + l_p."""
    if name == "ratio":
        l_p = TOTAL_LENGTH / (1 + value)
        return replace(impact, l_s=TOTAL_LENGTH - l_p, l_p=l_p)
    if name in ("mu_fence", "mu_belt"):
        return replace(impact, **{name: (value, getattr(impact, name)[1])})
    return replace(impact, **{name: value})


def differentiate(impact, name, rtol):
    """Two Richardson values, coarse and fine, of the derivatives in one variable."""
    value = variable(impact, name)
    largest = FINE_STEP.get(name, STEP) * value
    differences = []
    for step in (largest, largest / 2, largest / 4):
        ahead = solve(changed(impact, name, value + step), rtol)
        behind = solve(changed(impact, name, value - step), rtol)
        differences.append(
            [(getattr(ahead, q) - getattr(behind, q)) / (2 * step) for q in QUANTITIES]
        )
    coarse, middle, fine = differences
    return (
        [(4 * b - a) / 3 for a, b in zip(coarse, middle, strict=True)],
        [(4 * b - a) / 3 for a, b in zip(middle, fine, strict=True)],
    )


def derivatives(impact):
    """Derivatives of the recorded quantities in every variable, with their errors."""
    table = {}
    for name in (*PLAIN, "ratio", "mu_fence", "mu_belt"):
        coarse, fine = differentiate(impact, name, TOLERANCE)
        _, loose = differentiate(impact, name, 10 * TOLERANCE)
        table[name] = {"at": variable(impact, name)}
        for quantity, first, last, other in zip(QUANTITIES, coarse, fine, loose, strict=True):
            error = max(abs(last - first), abs(last - other))
            table[name][quantity] = {"derivative": last, "error": error}
        peak = table[name]["peak_force"]
        print(f"  d peak_force / d {name}: {peak['derivative']:.8g} +- {peak['error']:.1g}")
    return table


def values(impact):
    """Refined scalars of one impact."""
    found = solve(impact, TOLERANCE)
    names = (*QUANTITIES, "peak_time", "duration", "stiff_force")
    return {
        **{name: getattr(found, name) for name in names},
        "approach_speed": impact.approach_speed,
        "touch_time": float(impact.touch_time),
    }


def history(impact):
    """Histories of one impact every 5 ms up to 0.1 s."""
    found = solve(replace(impact, horizon=0.1), TOLERANCE, samples=21)
    names = ("time", "force", "gap", "tip", "arc", "parcel", "belt")
    return {name: getattr(found, name).tolist() for name in names}


def record():
    """Compute everything and write recorded.json beside this module."""
    cases = []
    for name, fields in CASES.items():
        cases.append({"name": name, "fields": fields, "values": values(Impact(**fields))})
        print(name, cases[-1]["values"], flush=True)
    for name, fields in DERIVED.items():
        impact = Impact(**fields)
        case = {"name": name, "fields": fields, "values": values(impact)}
        print(name, case["values"], flush=True)
        case["history"] = history(impact)
        case["derivatives"] = derivatives(replace(impact, horizon=0.1))
        cases.append(case)
    walls = []
    for speed in (2.426, 0.5):
        peak, restitution, time = rigid_wall(speed)
        wall = {"speed": speed, "peak_force": peak, "restitution": restitution, "peak_time": time}
        walls.append(wall)
    path = Path(__file__).with_name("recorded.json")
    path.write_text(json.dumps({"cases": cases, "rigid_wall": walls}, indent=1) + "\n")
    print("wrote", path)


if __name__ == "__main__":
    record()
