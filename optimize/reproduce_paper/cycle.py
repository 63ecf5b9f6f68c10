"""Whole sorts over the drive's cycle, as in Figs. 8 and 11."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import fencejax as fj

from .case import Case, Start
from .drives import CYCLE_TIME

_PRESSES = 0.01
"""Least normal force [N] that counts as a contact: negligible, but far above rounding."""


class Cycle(NamedTuple):
    """A whole sort. Signals have the time as their last axis; a batch has its lanes before it."""

    time: Array
    """Time since the drive's start [s]."""
    x: Array
    y: Array
    angle: Array
    """The parcel: C_s [m, m] and its turn [rad]."""
    drive_angle: Array
    """alpha_w [rad]."""
    force: Array
    """N [N], normal force of the fence on the parcel."""
    deflection: Array
    """Deflection of the tip [m], negative where the parcel pushes it back."""
    belt_force: Array
    """|F_1| [N], friction of the belt on the parcel."""
    load: Array
    """The load of everything but the belt on the belt's friction [N]: sqrt(|F|^2 + (T / c)^2), with
    F the force, T the moment about C_s and c the mean distance of (2.20)."""
    hold: Array
    """mu_1s m_p g [N], the largest load that static friction can carry."""
    peak_force: Array
    """N_max [N]."""
    first_contact: Array
    """Time of the first contact [s], between samples."""
    tip_deflection: Array
    """Largest deflection of the tip [m], either way."""
    status: Array
    """A `fencejax.Status`."""


def contacts(cycle: Cycle) -> list[tuple[float, float]]:
    """Intervals [s] in which the fence presses, of one lane."""
    time, pressing = np.asarray(cycle.time), np.asarray(cycle.force) > _PRESSES
    edges = np.flatnonzero(np.diff(np.concatenate([[False], pressing, [False]])))
    return [(float(time[a]), float(time[b - 1])) for a, b in edges.reshape(-1, 2)]


def first_and_last(cycle: Cycle) -> tuple[int, int]:
    """Samples of the first and the last contact of one lane: points 1 and 2 of the figures.

    Raises `ValueError` where the fence never presses.
    """
    pressing = np.flatnonzero(np.asarray(cycle.force) > _PRESSES)
    if not pressing.size:
        raise ValueError(
            f"The fence must press on the parcel with more than {_PRESSES:g} [N], but N_max is "
            f"{float(np.max(cycle.force)):.3g}. Start the parcel nearer."
        )
    return int(pressing[0]), int(pressing[-1])


@eqx.filter_jit
def run(cases: Case, starts: Start, fidelity: fj.Fidelity) -> Cycle:
    """Whole sorts of all lanes, in one program."""

    def one(case: Case, start: Start) -> Cycle:
        scene = fj.scenes.whole_sort(
            front=start.front,
            offset=start.offset,
            angle=start.angle,
            fence=case.fence,
            parcel=case.parcel,
            drive=case.drive,
            duration=CYCLE_TIME,
            tip_contact=False,
        )
        result = fj.simulate(scene, fidelity=fidelity)
        history, parcel, belt = result.history, case.parcel, scene.belt
        assert history is not None
        assert history.belt is not None
        assert history.drive is not None
        assert belt is not None
        pull = history.belt
        along = parcel.mass * history.acceleration.x - pull.x
        across = parcel.mass * history.acceleration.y - pull.y
        moment = (parcel.inertia * history.acceleration.angle - pull.moment) / parcel.mean_distance
        return Cycle(
            time=history.time,
            x=history.body.x,
            y=history.body.y,
            angle=history.body.angle,
            drive_angle=history.drive.angle,
            force=history.fence_force,
            deflection=history.tip_deflection,
            belt_force=jnp.sqrt(pull.x**2 + pull.y**2),
            load=jnp.sqrt(along**2 + across**2 + moment**2),
            hold=belt.friction.scales(jnp.zeros(())).largest * parcel.mass * belt.gravity,
            peak_force=result.peak_force,
            first_contact=result.first_contact,
            tip_deflection=result.tip_deflection,
            status=result.status,
        )

    return fj.each_lane(lambda lane: one(*lane), (cases, starts))


class Stiff(NamedTuple):
    """A parcel against the rigid obstacle: time [s], force [N], each of shape (lanes, T), the
    largest force N_stiff [N], and the normal approach speed [m/s] at the corner and at the fence's
    tip, each of shape (lanes,)."""

    time: Array
    force: Array
    peak: Array
    speed: Array
    tip_speed: Array


@eqx.filter_jit
def restitutions(speed: Array, masses: Array, fidelity: fj.Fidelity) -> Array:
    """Coefficients of restitution [1] of parcels of some `masses` [kg] that hit a rigid obstacle at
    a `speed` [m/s], of shape (M,)."""

    def one(mass: Array) -> Array:
        wall = fj.scenes.rigid_wall(speed=speed, parcel=fj.Parcel(mass=mass))
        final = fj.simulate(wall, fidelity=fidelity, only=["final"]).final
        assert final is not None
        return final.y_rate / speed

    return fj.each_lane(one, masses)


@eqx.filter_jit
def run_stiff(cases: Case, fidelity: fj.Fidelity) -> Stiff:
    """N_stiff of all lanes."""

    def one(case: Case) -> Stiff:
        result = fj.simulate(case.wall(), fidelity=fidelity)
        assert result.history is not None
        return Stiff(
            result.history.time,
            result.history.fence_force,
            result.peak_force,
            case.approach_speed(case.distance),
            case.approach_speed(case.fence.reach),
        )

    return fj.each_lane(one, cases)
