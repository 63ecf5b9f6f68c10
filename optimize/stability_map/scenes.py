"""One oblique impact as plain numbers: the ordinary one, and the ranges of the varied numbers."""

import jax.numpy as jnp

import fencejax as fj

# Numbers of one oblique impact: SI units; `flexible`, `aspect`, `place` and `angle` are shares (of
# the reach, of the length, of the reach and of the drive's stroke), `across` and `along` the
# centre of gravity in sides.
ORDINARY = dict(
    thickness=0.045, reach=1.2, flexible=0.625, width=0.132, modulus=3e9, density=1130.0,
    damping_ratio=0.05, mass=15.0, length=0.4, aspect=0.75, across=0.0, along=0.0,
    stiffness=1.72e9, damping=3.3e5, belt=2.0, gravity=9.81, belt_kinetic=0.65, belt_static=0.85,
    kinetic=0.35, static=0.5, top_speed=1.53, place=0.83, angle=0.45, approach=0.0, ride=2.0,
)

# The whole ranges of a sweep; the other numbers have their ordinary values.
AXES = dict(
    thickness=(1e-3, 0.3, "m"), reach=(0.1, 5.0, "m"), flexible=(0.02, 1.0, "1"),
    modulus=(1e6, 2.1e11, "Pa"), density=(50.0, 8000.0, "kg/m^3"),
    damping_ratio=(1e-3, 2.0, "1"), mass=(1e-3, 1e3, "kg"), length=(1e-2, 2.0, "m"),
    aspect=(0.01, 100.0, "1"), stiffness=(1e3, 1e14, "N/m^4"),
    damping=(1.0, 1e9, "N s kg^-0.4 m^-3"), approach=(1e-6, 50.0, "m/s"), belt=(0.01, 20.0, "m/s"),
    top_speed=(0.01, 3.4, "rad/s"), belt_kinetic=(1e-3, 5.0, "1"), belt_static=(1e-3, 5.0, "1"),
    kinetic=(1e-3, 5.0, "1"), gravity=(0.1, 100.0, "m/s^2"), place=(0.02, 1.0, "1"),
)

TITLES = dict(
    thickness="fence's thickness", reach="fence's reach", flexible="flexible length / reach",
    modulus="Young's modulus", density="fence's density", damping_ratio="fence's damping ratio",
    mass="parcel's mass", length="parcel's length", aspect="breadth / length",
    stiffness="parcel's stiffness", damping="parcel's damping", approach="approach speed",
    belt="belt speed", top_speed="drive's top speed", belt_kinetic="belt's kinetic friction",
    belt_static="belt's static friction", kinetic="fence's kinetic friction", gravity="gravity",
    place="R / reach",
)
"""The titles of the axes."""


def impact(x, duration=0.12, **parts):
    """The oblique impact of such numbers."""
    flexible = x["reach"] * x["flexible"]
    breadth = x["length"] * x["aspect"]
    drive = fj.HarmonicDrive(x["top_speed"])
    stroke = x["top_speed"] * drive.cycle_time / jnp.pi
    given = dict(
        fence=fj.Fence(
            x["reach"] - flexible, flexible, x["width"], x["thickness"],
            fj.Material(x["modulus"], x["density"], x["damping_ratio"]),
        ),
        parcel=fj.Parcel(
            x["mass"], x["length"], breadth, x["across"] * x["length"], x["along"] * breadth,
            None, x["stiffness"], x["damping"],
        ),
        drive=drive,
        belt=fj.Belt(
            x["belt"], friction=fj.Friction(x["belt_kinetic"], x["belt_static"]),
            gravity=x["gravity"],
        ),
        fence_friction=fj.Friction(x["kinetic"], x["static"]),
    )
    return fj.scenes.oblique_impact(
        distance=x["place"] * x["reach"], drive_angle=x["angle"] * stroke,
        velocity=(x["ride"], -x["approach"], 0.0 * x["mass"]), duration=duration,
        **{**given, **parts},
    )
