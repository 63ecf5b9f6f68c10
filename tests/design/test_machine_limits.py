"""Limited quantities of a sort, values and slopes, against NumPy from its history."""

import functools
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import rainflow
from scipy import stats

import fencejax as fj
from fencejax.design import drivability, fatigue, objectives, shock, sorting
from fencejax.results import Measure

QUANTITIES = (
    fatigue.FATIGUE_STRESS, sorting.CROSSING_TIME, sorting.TIP_SHARE, shock.PEAK_LOAD,
    shock.VELOCITY_CHANGE, shock.damage_boundary(), shock.damage_chance(0.3),
    sorting.tipping(None, 0.1), drivability.MOTOR_TORQUE, drivability.RMS_TORQUE,
    drivability.PEAK_POWER, drivability.DRIVE_WORK, drivability.NET_WORK, drivability.SPEED_TORQUE,
)  # fmt: skip
AT_SHAFT = (drivability.MOTOR_TORQUE, drivability.RMS_TORQUE, drivability.SPEED_TORQUE)
# Those at the motor's own shaft have the names of those at the hinge.
NAMED = [*(q.name for q in QUANTITIES), *(f"shaft_{q.name}" for q in AT_SHAFT)]
OWN = Measure("stresses", "Pa", "", "either way", fatigue.STRESS, lambda course: course.signal)
# The fence's thickness, the drive's top speed and the parcel's mass, on which the motion depends;
# the motor's gear ratio, rotor's inertia, efficiency, no-load speed and torque; the material's
# exponent; the parcel's height, critical acceleration and critical velocity change.
MOVING = 3
POINT = np.array([0.03, 3.0, 6.0, 40.0, 1e-3, 0.9, 9.0, 900.0, 12.0, 0.5, 6.0, 1.0])


def scene(point, at_shaft=False):
    """A sort that is soon over, in which the parcel leaves over the tip."""
    thickness, speed, mass, gear, inertia, efficiency, no_load, torque, slope, *own = point
    motor = fj.Motor(
        torque, no_load_speed=no_load, rotor_inertia=inertia, gear_ratio=gear,
        efficiency=efficiency, at_shaft=at_shaft,
    )  # fmt: skip
    height, load, change = own
    return fj.scenes.whole_sort(
        front=0.95, offset=0.01, fence_corners=(1,), border=None, fence_friction=None,
        belt=fj.Belt(width=0.3), drive=fj.HarmonicDrive(speed, 0.5), duration=0.5, motor=motor,
        fence=fj.Fence(thickness=thickness, material=fj.Material(fatigue_exponent=slope)),
        parcel=fj.Parcel(
            mass, height=height, critical_load=load, critical_velocity_change=change
        ),
    )  # fmt: skip


# Each step is a sample of the history.
FIXED = fj.Fidelity.fast(step_tolerance=None)


def _once(quantities, at_shaft):
    """Quantities of one motor in one run, as a problem reads them."""

    def values(point):
        made = scene(point, at_shaft)
        result = fj.simulate(
            made, fidelity=FIXED, history=False, only=objectives.fields(quantities),
            measures=objectives.measures(quantities),
        )  # fmt: skip
        return jnp.stack([quantity(result, made) for quantity in quantities])

    return values


@functools.cache
def ours():
    """Values and slopes, of shape (m,) and (m, n), by the names of `NAMED`."""

    def both(point):
        one, other = _once(QUANTITIES, False)(point), _once(AT_SHAFT, True)(point)
        values = jnp.concatenate([one, other])
        return values, values

    slopes, values = jax.jit(jax.jacfwd(both, has_aux=True))(jnp.asarray(POINT))
    return dict(zip(NAMED, zip(np.asarray(values), np.asarray(slopes), strict=True), strict=True))


@jax.jit
def _recorded(point):
    result = fj.simulate(
        scene(point), fidelity=FIXED, only=("history", "stresses"), measures=[OWN]
    )
    return result.history, result.stresses


def inner(time, values):
    """The largest, at the vertex of the parabola through three samples."""
    i = int(np.argmax(values))
    a, b, c = np.polyfit(time[i - 1 : i + 2] - time[i], values[i - 1 : i + 2], 2)
    return c - b * b / (4 * a)


def where_positive(time, level, signal):
    """The integral of a signal while a level is above 0, both straight between samples: with the
    moments at which the level is 0 among the samples."""
    turns = np.flatnonzero((level[:-1] > 0) != (level[1:] > 0))
    share = level[turns] / (level[turns] - level[turns + 1])
    zeros = time[turns] + share * (time[turns + 1] - time[turns])
    fine = np.sort(np.concatenate([time, zeros]))
    values = np.interp(fine, time, signal)
    inside = np.interp(0.5 * (fine[1:] + fine[:-1]), time, level) > 0
    return np.sum(inside * np.diff(fine) * 0.5 * (values[1:] + values[:-1]))


def amplitude(time, stress, exponent):
    """sigma_eq by the package `rainflow`, vertices by NumPy."""
    fine = stress.copy()
    for i in range(1, stress.size - 1):
        if (stress[i] - stress[i - 1]) * (stress[i + 1] - stress[i]) <= 0:
            a, b, c = np.polyfit(time[i - 1 : i + 2] - time[i], stress[i - 1 : i + 2], 2)
            fine[i] = c - b * b / (4 * a) if a != 0 else stress[i]
    worst = 0.0
    for side in (fine, -fine):
        order = np.append(np.roll(side, -np.argmax(side)), np.max(side))
        total = sum(
            count * (max(mean + span / 2, 0) * span / 2) ** (exponent / 2)
            for span, mean, count, *_ in rainflow.extract_cycles(order)
        )
        worst = max(worst, total ** (1 / exponent))
    return worst


@functools.cache
def moved(point):
    """History and stresses of one run: of the numbers on which they depend alone."""
    history, stresses = jax.tree.map(
        np.asarray, _recorded(jnp.asarray([*point, *POINT[MOVING:]]))
    )
    taken = 1 + int(np.searchsorted(history.time, history.time[-1]))
    return jax.tree.map(lambda x: x[:taken], (history, stresses))


@functools.cache
def read(point):
    """The same by NumPy, from the history of one run."""
    history, stresses = moved(point[:MOVING])
    time, force, mass = history.time, history.fence_force, point[2]
    gear, inertia, efficiency, no_load, stall, exponent, height, critical, change = point[MOVING:]
    whole = lambda t, signal: np.trapezoid(signal, t)  # noqa: E731
    found = {}
    found["fatigue_stress"] = max(amplitude(time, column, exponent) for column in stresses.T)
    over = np.argmax(history.body.y >= 0.3)
    found["crossing_time"] = np.interp(
        0.3, history.body.y[over - 1 : over + 1], time[over - 1 : over + 1]
    )
    beyond = history.fence[0].place - 1.2
    found["tip_share"] = where_positive(time, beyond, force) / whole(time, force)
    peak = inner(time, force)
    found["peak_load"] = peak / (mass * 9.81)
    top = int(np.argmax(force))
    above = force > 0.1 * force[top]
    first = top - np.argmin(above[top::-1])
    last = top + np.argmin(above[top:]) if not np.all(above[top:]) else time.size - 1
    blow = slice(first, last + 1)
    impulse = where_positive(time[blow], force[blow] - 0.1 * force[top], force[blow])
    found["velocity_change"] = impulse / mass
    ratios = found["peak_load"] / critical, found["velocity_change"] / change
    found["damage"] = min(ratios)
    found["share_damaged"] = np.prod(stats.norm.cdf(np.log(ratios) / 0.3))
    found["tipping"] = peak * abs(0.5 * height - 0.1) / (0.5 * 0.3 * mass * 9.81)
    speed, load = history.drive.speed, history.torque
    lasting = lambda torque: np.sqrt(whole(time, torque**2) / 0.5)  # noqa: E731
    torque = np.where(load * speed > 0, load / efficiency, load * efficiency)
    torque = torque + inertia * gear**2 * history.drive.acceleration
    found["motor_torque"] = inner(time, np.abs(torque))
    found["rms_torque"] = lasting(torque)
    found["peak_power"] = inner(time, np.abs(torque * speed))
    found["drive_work"] = where_positive(time, torque * speed, torque * speed)
    found["net_work"] = whole(time, torque * speed)
    found["speed_torque"] = inner(time, np.abs(torque / stall + speed / no_load))
    found["shaft_motor_torque"] = found["motor_torque"] / gear
    found["shaft_rms_torque"] = found["rms_torque"] / gear
    found["shaft_speed_torque"] = inner(
        time, np.abs(torque / gear / stall + gear * speed / no_load)
    )
    return SimpleNamespace(values=found, history=history)


@pytest.mark.parametrize("name", NAMED)
def test_values_and_slopes_are_those_of_the_history(name):
    value, slope = ours()[name]
    there = read(tuple(POINT))
    assert there.values[name] != 0
    assert value == pytest.approx(there.values[name], rel=1e-9)
    ones = np.eye(POINT.size) * 1e-5 * POINT
    for i, one in enumerate(ones):
        ends = [read(tuple(POINT + sign * one)).values[name] for sign in (1, -1)]
        expected = (ends[0] - ends[1]) / 2e-5
        # As elasticities, by central differences of 1e-5. The steps' lengths, which the loop
        # chooses by the motion, are not differentiated.
        assert slope[i] * POINT[i] == pytest.approx(expected, rel=2e-3, abs=1e-3 * abs(value))


def test_what_is_asked_for_is_what_there_is():
    # The machine: most of its limits are read of a sort in which they mean something.
    history = read(tuple(POINT)).history
    assert np.max(history.fence[0].place) > 1.2
    assert 0.01 < ours()["tip_share"][0] < 0.9
    assert ours()["crossing_time"][0] < 0.5
    assert ours()["net_work"][0] < ours()["drive_work"][0]
