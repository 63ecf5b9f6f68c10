"""Whole sorts and their stages at the limits of their arguments, as numbers of a few compiled
programs."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from robustness.extreme_scenes import RUNS_LONG, TRUTH as FINE, stack
from robustness.truth_record import Case, Truth, recorded
from runs import one_by_one

import fencejax as fj

ORDINARY = dict(
    thickness=0.045, reach=1.2, flexible=0.625, modulus=3e9, density=1130.0, damping_ratio=0.05,
    mass=15.0, length=0.4, aspect=0.75, across=0.0, along=0.0, stiffness=1.72e9, damping=3.3e5,
    belt=2.0, belt_kinetic=0.65, belt_static=0.85, kinetic=0.35, static=0.5, border=0.35,
    top_speed=1.53, cycle=1.36, front=0.1, offset=0.0, turn=0.0, place=0.75, angle=0.25,
)
MATERIALS = {
    "thickness-5mm": {"thickness": 5e-3},
    "thickness-0.1m": {"thickness": 0.1},
    "thickness-0.3m": {"thickness": 0.3},
    "one-link": {"flexible": 1.0, "thickness": 0.073},
    "tip-2cm": {"flexible": 0.02 / 1.2},
    "rubber": {"modulus": 1e6},
    "steel": {"modulus": 2.1e11, "density": 7850.0, "thickness": 0.01},
    "foam": {"density": 50.0},
    "undamped": {"damping_ratio": 0.0},
    "overdamped": {"damping_ratio": 2.0},
}
PARCELS = {
    "mass-1g": {"mass": 1e-3},
    "mass-100g": {"mass": 0.1},
    "mass-1kg": {"mass": 1.0},
    "mass-100kg": {"mass": 100.0},
    "mass-1t": {"mass": 1e3},
    "size-1cm": {"length": 0.01, "mass": 0.1},
    "size-10cm": {"length": 0.1, "mass": 1.0},
    "size-1m": {"length": 1.0, "mass": 40.0},
    "long-and-thin": {"aspect": 0.05},
    "wide-and-short": {"aspect": 20.0, "length": 0.03},
    "centre-at-an-edge": {"across": 0.5},
    "centre-low": {"along": -0.5},
    "stiffness-1e6": {"stiffness": 1e6},
    "stiffness-1e12": {"stiffness": 1e12},
    "no-damping": {"damping": 0.0},
    "damping-1e9": {"damping": 1e9},
}
FRICTIONS = {
    "no-friction": {
        "kinetic": 0.0, "static": 0.0, "belt_kinetic": 0.0, "belt_static": 0.0, "border": 0.0
    },
    "friction-5": {"kinetic": 5.0, "static": 5.0},
    "belt-friction-5": {"belt_kinetic": 5.0, "belt_static": 5.0},
    "static-is-kinetic": {"static": 0.35, "belt_static": 0.65},
    "static-far-above": {"static": 3.0, "belt_static": 3.0},
}
SPEEDS = {
    "belt-still": {"belt": 0.0},
    "belt-20": {"belt": 20.0},
    "drive-fast": {"top_speed": 3.0},
    "drive-slow": {"top_speed": 0.1},
}
SORT = {
    "never-touched": {"front": -5.0},
    "drive-still": {"top_speed": 0.0},
    "drive-50": {"top_speed": 50.0, "cycle": 0.04},
    "flat-impact": {"offset": 0.1},
    "all-but-flat": {"offset": 0.1, "turn": 1e-3},
    "corner-first": {"offset": 0.1, "turn": 0.2},
    "other-corner-first": {"offset": 0.1, "turn": -0.2},
    "at-the-hinge": {"front": 0.42, "belt": 0.0},
    "far-out": {"front": 0.9},
    "over-the-tip": {"front": 1.3, "offset": 0.05},
    "at-the-tip": {"front": 1.6, "offset": 0.3, "belt": 0.0},
    "grazing": {"offset": 0.62},
    "re-impact": {"offset": 0.02, "stiffness": 1e11, "damping": 0.0, "mass": 3.0},
    "chatter": {"stiffness": 1e12, "damping": 0.0, "mass": 1.0},
    "jam": {"length": 0.9, "belt": 0.5, "border": 5.0, "kinetic": 5.0, "static": 5.0},
}
STAGE = {
    "drive-slow": {"top_speed": 0.1, "angle": 0.02},
    "hinge": {"place": 0.2},
    "near-the-tip": {"place": 0.97},
    "drive-at-its-start": {"angle": 0.02},
    "drive-at-its-turn": {"angle": 0.6},
}
WEDGED = {"length": 1.2, "border": 5.0, "kinetic": 5.0, "static": 5.0}
COMMON = {"ordinary": {}} | MATERIALS | PARCELS | FRICTIONS | SPEEDS
ROWS = {
    "sort": COMMON | SORT,
    "flush": COMMON | STAGE,
    "border": COMMON | STAGE | {"jam": WEDGED},
}
VARIED = ("thickness", "mass", "stiffness", "belt", "kinetic")
TRUTH = FINE.replace(step=1e-4)
FIELDS = ("peak_force", "tip_deflection", "impulse", "furthest_y", "peak_border_force")


def scene(kind, x, duration=None):
    flexible = x["reach"] * x["flexible"]
    breadth = x["length"] * x["aspect"]
    parts = dict(
        fence=fj.Fence(
            x["reach"] - flexible, flexible, 0.132, x["thickness"],
            fj.Material(x["modulus"], x["density"], x["damping_ratio"]),
        ),
        parcel=fj.Parcel(
            x["mass"], x["length"], breadth, x["across"] * x["length"], x["along"] * breadth,
            None, x["stiffness"], x["damping"],
        ),
        drive=fj.HarmonicDrive(x["top_speed"], x["cycle"]),
        belt=fj.Belt(x["belt"], friction=fj.Friction(x["belt_kinetic"], x["belt_static"])),
        fence_friction=fj.Friction(x["kinetic"], x["static"]),
    )
    border = fj.Border(fj.Friction(x["border"], x["border"]))
    place, angle = x["place"] * x["reach"], x["angle"]
    if kind == "sort":
        return fj.scenes.whole_sort(
            front=x["front"], offset=x["offset"], angle=x["turn"], border=border,
            duration=duration or 1.36, **parts,
        )
    if kind == "flush":
        return fj.scenes.along_fence(
            distance=place, drive_angle=angle, duration=duration or 0.2, **parts
        )
    return fj.scenes.border_and_fence(
        distance=place, drive_angle=0.4 * angle, border=border, duration=duration or 0.2, **parts
    )


def numbers(kind):
    return stack([ORDINARY | changes for changes in ROWS[kind].values()])


def lane(kind, name):
    return list(ROWS[kind]).index(name)


@functools.cache
def program(kind, name, gradient=True):
    """Numbers -> status (lanes,), values (lanes, fields) and, with `gradient`, x dN/dx of the peak
    force (lanes, varied)."""
    fidelity = TRUTH if name == "truth" else getattr(fj.Fidelity, name)()

    def values(varied, x):
        # The ledger's status is asked for where no derivative is: it doubles the compiling.
        only = FIELDS if gradient else (*FIELDS, "energy", "final")
        result = fj.simulate(scene(kind, x | varied), fidelity=fidelity, only=only)
        found = jnp.stack([getattr(result, field) for field in FIELDS])
        return found[0], (result.status, found)

    # The truth runs eleven times.
    @(RUNS_LONG if (kind, name) == ("sort", "truth") else jax.jit)
    @(jax.vmap if name == "truth" else one_by_one)
    def run(x):
        varied = {k: x[k] for k in VARIED}
        if not gradient:
            return values(varied, x)[1]
        slopes, (status, found) = jax.jacfwd(values, has_aux=True)(varied, x)
        return status, found, jnp.stack([slopes[k] * x[k] for k in VARIED], axis=-1)

    return run


@functools.cache
def outcome(kind, name, gradient=False):
    """What the `program` finds for the rows."""
    return jax.device_get(program(kind, name, gradient)(numbers(kind)))


def rung(kind, fidelity):
    """What a rung finds for the rows, `coarse` with its gradient: the cheapest to compile."""
    return outcome(kind, fidelity, gradient=fidelity == "coarse")


@functools.cache
def truth(kind):
    """The truth of the rows, from the record."""
    return recorded(kind, numbers(kind), VARIED, TRUTH)


def truths():
    """What the record of truths has of the rows."""
    return {
        kind: Case(numbers(kind), VARIED, TRUTH, functools.partial(_computed, kind))
        for kind in ROWS
    }


def _computed(kind):
    status, values = outcome(kind, "truth")
    run = program(kind, "truth", False)
    slopes = [differences(run, kind, (k,))[:, 0] for k in VARIED]
    return Truth.without_time(status, values[:, 0], slopes)


def differences(run, kind, names, stretch=1e-3):
    """d f / d log(the numbers `names` together) by central differences, (lanes, fields)."""
    x = numbers(kind)
    ends = [
        {k: v * np.exp(by) if k in names else v for k, v in x.items()} for by in (stretch, -stretch)
    ]
    above, below = (jax.device_get(run(end))[1] for end in ends)
    return (above - below) / (2 * stretch)
