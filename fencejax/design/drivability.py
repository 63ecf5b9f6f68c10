"""What the fence's motion asks of its motor: torque, power, energy, and the line of torque over
speed.

The motor gives, at the hinge,

    T = eta^-+1 T_f + J i^2 alpha'',

with T_f the moment at the fence's hinge, alpha the drive's angle, J i^2 the rotor's inertia seen
through the gear and eta the gear's efficiency, which takes from what drives the fence
(T_f alpha' > 0) and from what the fence gives back. All follow the time loop step by step:
integrals by the trapezoidal rule, peaks refined between samples, signs changing where the line
through two samples does.
"""

import dataclasses
import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..parts import Motor
from ..results import Accumulator, Measure, Sample, Step, accumulators
from .objectives import PEAK_TORQUE, Quantity, of_measure


@dataclasses.dataclass(frozen=True)
class _Behind:
    """A motor's plain numbers: part of the program, as a sorter's motor is no variable of its
    design."""

    inertia: float = 0.0
    efficiency: float = 1.0

    def torque(self, sample: Sample) -> Array:
        """T [N m]."""
        torque = sample.torque
        if sample.drive is None:
            return torque
        if self.efficiency != 1:
            drives = torque * sample.drive.speed > 0
            torque = torque * jnp.where(drives, 1 / self.efficiency, self.efficiency)
        return torque + self.inertia * sample.drive.acceleration if self.inertia else torque

    def power(self, sample: Sample) -> Array:
        """T alpha' [W]."""
        speed = jnp.zeros_like(sample.torque) if sample.drive is None else sample.drive.speed
        return self.torque(sample) * speed

    def jumps(self, step: Step) -> Array:
        """Whether the gear's losses change their side within a step."""
        if self.efficiency == 1 or step.now.drive is None or step.before.drive is None:
            return jnp.asarray(False)
        return (step.before.drive.speed > 0) != (step.now.drive.speed > 0)


def _behind(motor: Motor | None) -> _Behind:
    if motor is None:
        return _Behind()
    efficiency = 1.0 if motor.efficiency is None else float(motor.efficiency)
    return _Behind(float(motor.reflected_inertia), efficiency)


def _peak(name: str, signal, behind: _Behind) -> Accumulator:
    """The largest size of a signal. Across a jump of the gear's losses no parabola is laid."""
    plain = accumulators.peak_of(name, lambda sample: jnp.abs(signal(sample)))
    if behind.efficiency == 1:
        return plain

    def start(nothing, body):
        return plain.start(nothing, body), nothing.time

    def update(state, step):
        peak, jumped = state
        jumps = behind.jumps(step)
        refined = plain.update(peak, step)
        value, new = peak.value, jnp.abs(signal(step.now))
        higher = new > value
        rough = refined._replace(
            value=jnp.where(higher, new, value),
            time=jnp.where(higher, step.now.time, peak.time),
        )
        across = jumps | (jumped > 0)
        chosen = jax.tree.map(lambda a, b: jnp.where(across, a, b), rough, refined)
        return chosen, jnp.where(jumps, 1.0, 0.0).astype(jumped.dtype)

    return Accumulator(name, start, update)


def _value(behind: _Behind):
    return lambda state: (state if behind.efficiency == 1 else state[0]).value


def _key(behind: _Behind) -> str:
    """What tells the states of different motors apart."""
    return f"{behind.inertia!r}, {behind.efficiency!r}"


@functools.lru_cache
def _torque(behind: _Behind) -> Quantity:
    if behind == _Behind():
        return PEAK_TORQUE
    measure = Measure(
        "motor_torque", "N m", "largest torque that the motor gives, at the hinge, either way",
        "at least 0", _peak(f"motor torque {_key(behind)}", behind.torque, behind),
        _value(behind),
    )  # fmt: skip
    return of_measure(measure, needs=("drive",))


@functools.lru_cache
def _rms(behind: _Behind) -> Quantity:
    def start(nothing, body):
        return nothing.time, nothing.time

    def update(state, step):
        total, time = state
        before, now = (behind.torque(sample) for sample in (step.before, step.now))
        return total + step.integral(before**2, now**2), time + step.span.length

    def read(state):
        total, time = state
        some = total > 0
        return jnp.where(some, jnp.sqrt(jnp.where(some, total, 1.0) / time), 0.0)

    measure = Measure(
        "rms_torque", "N m", "root mean square of the motor's torque, at the hinge, over the scene",
        "at least 0", Accumulator(f"squared torque {_key(behind)}", start, update), read,
    )  # fmt: skip
    return of_measure(measure, needs=("drive",))


@functools.lru_cache
def _power(behind: _Behind) -> Quantity:
    measure = Measure(
        "peak_power", "W", "largest power that the motor gives to the fence or takes from it",
        "at least 0", _peak(f"motor power {_key(behind)}", behind.power, behind), _value(behind),
    )  # fmt: skip
    return of_measure(measure, needs=("drive",))


@functools.lru_cache
def _work(behind: _Behind, given: bool) -> Quantity:
    """What the motor gives, or, where not `given`, what it gives less what it takes back."""

    def update(state, step):
        pair = behind.power(step.before), behind.power(step.now)
        if not given:
            return state + step.integral(*pair)
        return state + step.span.length * accumulators.mean_where(pair, pair)

    name = "drive_work" if given else "net_work"
    meaning = "work that the motor does in a scene, none of it recovered where the fence gives back"
    if not given:
        meaning = "work that the motor does in a scene, less what the fence gives back"
    measure = Measure(
        name, "J", meaning, "at least 0" if given else "either way",
        Accumulator(f"{name} {_key(behind)}", lambda nothing, body: nothing.time, update),
        lambda state: state,
    )  # fmt: skip
    return of_measure(measure, needs=("drive",))


@functools.lru_cache
def _line(behind: _Behind, stall: float, no_load: float) -> Quantity:
    def share(sample: Sample) -> Array:
        if sample.drive is None:
            return jnp.zeros_like(sample.time)
        return behind.torque(sample) / stall + sample.drive.speed / no_load

    name = f"line {_key(behind)}, {stall!r}, {no_load!r}"
    measure = Measure(
        "speed_torque", "1", "how much of its line of torque over speed the motor uses, at most",
        "at least 0", _peak(name, share, behind), _value(behind),
    )  # fmt: skip
    return of_measure(measure, needs=("drive",))


SPEED_TORQUE = _line(_Behind(), 1.0, 1.0)
"""`speed_torque` of a line from 1 N m to 1 rad/s."""


def motor_torque(motor: Motor | None = None) -> Quantity:
    """The largest |T| [N m]; `PEAK_TORQUE` for a motor of no inertia behind a gear of no losses."""
    return _torque(_behind(motor))


def rms_torque(motor: Motor | None = None) -> Quantity:
    """sqrt(mean over the scene of T^2) [N m], which heats the motor: of a scene as long as the
    period from parcel to parcel."""
    return _rms(_behind(motor))


def peak_power(motor: Motor | None = None) -> Quantity:
    """The largest |T alpha'| [W]."""
    return _power(_behind(motor))


def drive_work(motor: Motor | None = None) -> Quantity:
    """The integral of max(T alpha', 0) [J]: energy a cycle without recuperation."""
    return _work(_behind(motor), True)


def net_work(motor: Motor | None = None) -> Quantity:
    """The integral of T alpha' [J]: energy a cycle, all that comes back used again."""
    return _work(_behind(motor), False)


def speed_torque(motor: Motor) -> Quantity:
    """The largest |T / T_s + alpha' / omega_0| [1], at most 1 where the motor can do it.

    That is the voltage of a motor with T = T_s (1 - omega / omega_0), over the largest one: while
    it drives, |T| stays below what it has at that speed; while it brakes, it has more.

    Raises `ValueError` for a motor without that line.
    """
    stall = motor.torque if motor.stall_torque is None else motor.stall_torque
    if motor.no_load_speed is None or stall is None:
        raise ValueError(
            "Argument `motor` must have a line of torque over speed, but has no `no_load_speed`. "
            "Write fj.Motor(torque=400.0, no_load_speed=8.0)."
        )
    return _line(_behind(motor), float(stall), float(motor.no_load_speed))
