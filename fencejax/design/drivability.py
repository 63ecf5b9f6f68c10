"""What the fence's motion demands of its motor: torque, power, energy, and the use of its
torque-speed line.

The motor gives, at the hinge,

    T = T_f / eta + J i^2 alpha''   while the motor drives the fence, T_f alpha' > 0,
    T = eta T_f + J i^2 alpha''     while the fence returns power,

with T_f the moment at the fence's hinge, alpha the drive's angle, J i^2 the rotor's inertia
reflected to the hinge and eta the gear's efficiency. At the motor's shaft the
torque is T / i and the speed i alpha'. All quantities are computed step by step in the time loop:
integrals by the trapezoidal rule, peaks refined between samples, and a sign changes where the
straight line through two samples crosses 0.

The motor is part of the scene, `whole_sort(motor=...)`, and its numbers are differentiable like all
others. Without a motor, or without one of its numbers, there is no inertia, no loss or no gear. For
a torque drive T_f is its torque, and its own inertia replaces that of the rotor. Torques are those
at the hinge, or at the shaft where the motor's own numbers are (`Motor.at_shaft`).
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..parts import Motor
from ..results import Accumulator, Measure, Sample, Step, accumulators
from .objectives import Quantity, of_measure


def _motor(step: Step) -> Motor | None:
    return getattr(step.scene, "motor", None)


def _hinge_torque(sample: Sample, motor: Motor | None) -> Array:
    """T [N m]."""
    torque = sample.torque
    if sample.drive is None or motor is None:
        return torque
    if motor.efficiency is not None:
        drives = torque * sample.drive.speed > 0
        torque = torque * jnp.where(drives, 1 / motor.efficiency, motor.efficiency)
    if motor.rotor_inertia is not None and sample.drive.torque is None:
        torque = torque + motor.reflected_inertia * sample.drive.acceleration
    return torque


def _torque(sample: Sample, motor: Motor | None) -> Array:
    """T, or T / i where the motor's numbers are at its shaft [N m]."""
    torque = _hinge_torque(sample, motor)
    return torque if motor is None else torque / motor.reduction


def _power(sample: Sample, motor: Motor | None) -> Array:
    """T alpha' [W]."""
    speed = jnp.zeros_like(sample.torque) if sample.drive is None else sample.drive.speed
    return _hinge_torque(sample, motor) * speed


def _voltage(sample: Sample, motor: Motor | None) -> Array:
    """T / T_s + alpha' / omega_0 [1], both at the hinge or both at the shaft; 0 without a line."""
    line = None if motor is None else motor.line
    if motor is None or line is None or sample.drive is None:
        return jnp.zeros_like(sample.torque)
    stall, no_load = line
    return _torque(sample, motor) / stall + motor.reduction * sample.drive.speed / no_load


def _jumps(step: Step) -> Array:
    """Whether the direction of the gear's losses changes within a step."""
    motor = _motor(step)
    lossless = motor is None or motor.efficiency is None
    if lossless or step.now.drive is None or step.before.drive is None:
        return jnp.asarray(False)
    return (step.before.drive.speed > 0) != (step.now.drive.speed > 0)


def _peak(name: str, signal) -> Accumulator:
    """The largest magnitude of a signal of the motor. Across a jump of the gear's losses the peak
    is not refined by a parabola."""

    def of(motor: Motor | None) -> Accumulator:
        return accumulators.peak_of(name, lambda sample: jnp.abs(signal(sample, motor)))

    def start(nothing, body):
        return of(None).start(nothing, body), nothing.time

    def update(state, step):
        peak, jumped = state
        motor, jumps = _motor(step), _jumps(step)
        refined = of(motor).update(peak, step)
        value, new = peak.value, jnp.abs(signal(step.now, motor))
        higher = new > value
        unrefined = refined._replace(
            value=jnp.where(higher, new, value),
            time=jnp.where(higher, step.now.time, peak.time),
        )
        across = jumps | (jumped > 0)
        chosen = jax.tree.map(lambda a, b: jnp.where(across, a, b), unrefined, refined)
        return chosen, jnp.where(jumps, 1.0, 0.0).astype(jumped.dtype)

    return Accumulator(name, start, update)


def _quantity(name: str, unit: str, meaning: str, sign: str, accumulator, read) -> Quantity:
    return of_measure(Measure(name, unit, meaning, sign, accumulator, read), needs=("drive",))


MOTOR_TORQUE = _quantity(
    "motor_torque", "N m", "largest torque that the motor gives, either way", "at least 0",
    _peak("motor torque", _torque), lambda state: state[0].value,
)  # fmt: skip
"""The largest |T| [N m]; equal to `PEAK_TORQUE` for a motor without inertia and a gear without
losses."""


def _add_square(state, step):
    total, time = state
    before, now = (_torque(sample, _motor(step)) for sample in (step.before, step.now))
    return total + step.integral(before**2, now**2), time + step.span.length


def _root(state):
    total, time = state
    mean = total / jnp.where(time > 0, time, 1.0)
    some = mean > 0
    return jnp.where(some, jnp.sqrt(jnp.where(some, mean, 1.0)), 0.0)


RMS_TORQUE = _quantity(
    "rms_torque", "N m", "root of the mean square over the scene of the motor's torque",
    "at least 0",
    Accumulator("rms torque", lambda nothing, body: (nothing.time, nothing.time), _add_square),
    _root,
)  # fmt: skip
"""sqrt(mean over the scene of T^2) [N m], which heats the motor; meant for a scene as long as the
period from parcel to parcel."""
PEAK_POWER = _quantity(
    "peak_power", "W", "largest power that the motor gives to the fence or takes from it",
    "at least 0", _peak("motor power", _power), lambda state: state[0].value,
)  # fmt: skip
"""The largest |T alpha'| [W]."""


def _work(name: str, meaning: str, sign: str, given: bool) -> Quantity:
    """The work that the motor does; unless `given`, less the work that it takes back."""

    def update(state, step):
        motor = _motor(step)
        pair = _power(step.before, motor), _power(step.now, motor)
        if not given:
            return state + step.integral(*pair)
        return state + step.span.length * accumulators.mean_where(pair, pair)

    running = Accumulator(name, lambda nothing, body: nothing.time, update)
    return _quantity(name, "J", meaning, sign, running, lambda state: state)


DRIVE_WORK = _work(
    "drive_work", "work that the motor does in a scene, none of it recovered where the fence gives "
    "back", "at least 0", True,
)  # fmt: skip
"""The integral of max(T alpha', 0) [J]: energy a cycle without recuperation."""
NET_WORK = _work(
    "net_work", "work that the motor does in a scene, less what the fence gives back", "either way",
    False,
)  # fmt: skip
"""The integral of T alpha' [J]: energy a cycle with full recuperation."""
SPEED_TORQUE = _quantity(
    "speed_torque", "1", "how much of its line of torque over speed the motor uses, at most",
    "at least 0", _peak("line of torque over speed", _voltage), lambda state: state[0].value,
)  # fmt: skip
"""The largest |T / T_s + alpha' / omega_0| [1], at most 1 where the motor can follow the motion; 0
for a motor whose line is not known.

This is the voltage of a motor with T = T_s (1 - omega / omega_0) over its largest voltage: while it
drives, |T| stays below the torque available at that speed; while it brakes, more is available."""
