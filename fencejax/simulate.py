"""Run a scene."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array

from . import _check, error, general, integrate, modal_step, normal
from .clock import Clock, stride_counts
from .consistency import consistent
from .drive import AbstractDrive, DriveMotion
from .fidelity import Fidelity
from .forward import by_columns
from .keep import keep, sound
from .kinematics import Body
from .link import SWING_STEPS, FlexibleLink, Vibration
from .mechanics import Mechanics
from .modal_step import Memory
from .propagation import Propagator
from .result import Result, gather
from .scenes import NormalScene, Scene
from .start import Pose
from .status import LAGGING, ROUGH, Status, worst
from .tally import Tally
from .taper import AbstractTaper


def simulate(
    scene: NormalScene | Scene,
    *,
    fidelity: Fidelity | None = None,
    history: bool = True,
    only: Sequence[str] | None = None,
    throw: bool = False,
    estimate_error: bool = False,
) -> Result:
    """Integrate a scene and gather what it did.

    **Arguments:**

    - `scene`: made by a function of `fencejax.scenes`. Every number in it may be traced.
    - `fidelity`: default `Fidelity.standard()`.
    - `history`: keep every sample (`Result.history`). Inside `jit`, what is not used is not
      computed; outside, `history=False` is lighter. Where steps are of different lengths, so are
      the times between samples; inside `jit` the last sample is then repeated to fill the room.
    - `only`: names of the fields of `Result` that are wanted; the others but `status` are `None`
      and cost nothing, also in compiling a derivative. `history` then counts only if it is named.
    - `throw`: raise on the host if the status is not among those with good numbers.
    - `estimate_error`: put an `ErrorEstimate` into `Result.error`, from two more runs of half as
      many steps (one where there is no friction): about twice the cost.

    Raises `TypeError` for arguments of the wrong kind, `ValueError` for names in `only` that are
    none of `Result`'s fields and for a fidelity that the scene or JAX's settings do not allow and,
    with `throw=True`, `RuntimeError` with the status' text.
    """
    if not isinstance(scene, (NormalScene, Scene)):
        raise TypeError(
            f"Argument `scene` must be a scene made by a function of `fencejax.scenes`, but is a "
            f"{type(scene).__name__}."
        )
    fidelity = Fidelity.standard() if fidelity is None else fidelity
    if not isinstance(fidelity, Fidelity):
        raise TypeError(
            f"Argument `fidelity` must be a `fencejax.Fidelity`, but is {fidelity!r}. Write, for "
            "example, fidelity=fj.Fidelity.fast()."
        )
    if isinstance(scene, NormalScene) and fidelity.integrator != "modal":
        raise ValueError(
            "Argument `fidelity.integrator` must be 'modal' for a scene of the normal direction "
            f"alone, but is {fidelity.integrator!r}. Write fidelity.replace(integrator=\"modal\")."
        )
    if fidelity.precision == "float64" and not jax.config.read("jax_enable_x64"):
        raise ValueError(
            "Argument `fidelity.precision` is 'float64', but JAX is set to single precision. Write "
            'jax.config.update("jax_enable_x64", True) first.'
        )
    if only is not None:
        for name in only:
            _check.choice("only", name, _FIELDS)
        only = tuple(sorted({*only, "status"}))
        history = "history" in only
    _refuse(scene, fidelity)
    result = _result(scene, fidelity, history, only)
    if estimate_error:
        estimated = error.estimate(_result, scene, fidelity, result)
        result = dataclasses.replace(result, error=estimated)
    if throw:
        raise_for(result)
    return result


# More steps than these are no longer counted exactly in single and in double precision [1].
_STEPS = {"float32": 2**24, "float64": 2**31 - 2}
# What single precision still resolves: a step's change of the motion [s], a smoothing [m/s].
_SINGLE = {"step": 1e-4, "slip_speed": 2e-4}


def _refuse(scene: NormalScene | Scene, fidelity: Fidelity) -> None:
    """Raise where the scene's numbers are of a wrong type or shape, or single precision cannot give
    what the fidelity asks for."""
    vectors = (AbstractTaper, AbstractDrive)
    for path, leaf in jax.tree_util.tree_leaves_with_path(
        scene, is_leaf=lambda part: isinstance(part, vectors)
    ):
        if isinstance(leaf, vectors):
            continue
        name = jax.tree_util.keystr(path).lstrip(".")
        shape = np.shape(leaf)
        if shape:
            raise ValueError(
                f"Argument `scene` must hold one number in each field, but `{name}` has the shape "
                f"{shape}. Write jax.vmap(lambda scene: fj.simulate(scene))(scenes) for a batch."
            )
    numbers = jax.tree.leaves(scene)
    for number in numbers:
        if jnp.result_type(number) not in (jnp.float32, jnp.float64):
            raise TypeError(
                f"Argument `scene` must hold floating-point numbers in single or double precision, "
                f"but holds {number!r} of the type {jnp.result_type(number)}. Give numbers to the "
                "constructors, which convert them."
            )
    precision = fidelity.precision or str(jnp.result_type(*numbers))
    steps = scene.duration / fidelity.step
    if steps > _STEPS[precision]:
        raise ValueError(
            f"Argument `duration` / `fidelity.step` must be at most {_STEPS[precision]} [1] in "
            f"{precision}, but is {steps:g}. Raise `step` or lower `duration`."
        )
    if precision == "float64" or isinstance(scene, NormalScene):
        return
    for name, least in _SINGLE.items():
        value = getattr(fidelity, name)
        if value < least:
            raise ValueError(
                f"Argument `fidelity.{name}` must be at least {least:g} in single precision, but "
                f"is {value:g}: smaller changes are lost in rounding. Raise it, or write "
                'fidelity.replace(precision="float64") with JAX\'s jax_enable_x64.'
            )


_FIELDS = tuple(f.name for f in dataclasses.fields(Result) if f.name != "error")


def raise_for(result: Result) -> None:
    """Raise `RuntimeError` if any lane's status is not among those with good numbers."""
    if isinstance(result.status, Tracer):
        raise TypeError("throw=True needs concrete numbers: read `status` inside a transformation.")
    outcome = Status(int(np.max(np.asarray(result.status))))
    if outcome > Status.LEFT_OVER_TIP:
        raise RuntimeError(f"{outcome.name}: {outcome.text}.")


@functools.lru_cache(maxsize=256)
def _program(structure, fidelity: Fidelity, history: bool, only: tuple[str, ...] | None):
    """The map from a scene's numbers to its result, for scenes of one structure: as it is, and
    compiled. Kept, so that what was traced and compiled once serves again."""

    def outcome(numbers):
        given = jnp.result_type(*numbers)
        precision = given if fidelity.precision is None else jnp.dtype(fidelity.precision)
        numbers = [number.astype(precision) for number in numbers]
        scene = jax.tree.unflatten(structure, numbers)
        if isinstance(scene, NormalScene):
            result = normal.run(scene, fidelity, history)
        else:
            result = _run(scene, fidelity, history)
        result = jax.tree.map(lambda leaf: leaf.astype(given), result)
        if only is not None:
            dropped = {name: None for name in _FIELDS if name not in only}
            result = dataclasses.replace(result, **dropped)
        return _sound(scene, result)

    run = by_columns(outcome, _derived) if fidelity.gradient == "forward" else outcome
    options = None
    if fidelity.integrator != "modal":
        # Their programs are ten times as large: as one kernel they take many minutes to optimise.
        options = {"xla_backend_optimization_level": 0}
    return run, jax.jit(run, compiler_options=options)


# Not a number where there was no contact.
_MAY_BE_NAN = ("first_contact", "last_contact", "leave_x", "leave_y", "status")
# Of a whole result, what shows that derivatives were lost on the way.
_TELLING = ("final", "tip_deflection")


def _finite(fields: Mapping[str, Any]) -> Array:
    """Whether all numbers of a result's fields are finite that have to be."""
    finite = jnp.asarray(True)
    for leaf in jax.tree.leaves({f: v for f, v in fields.items() if f not in _MAY_BE_NAN}):
        finite = finite & jnp.all(jnp.isfinite(leaf))
    return finite


# Share of the energy turned over that a ledger may gain.
_GAIN = 0.05


def _gained(scene: NormalScene | Scene, result: Result) -> Array:
    """Whether the energy ledger ends with more than the work done accounts for: a residual above
    5 % of what was turned over, the parcel's kinetic energy at the end and the sizes of the
    ledger's terms together."""
    parcel, final = scene.parcel, result.final
    held = 0.5 * parcel.mass * (final.x_rate**2 + final.y_rate**2)
    held = held + 0.5 * parcel.inertia * final.spin**2
    turned = held + sum(jnp.abs(term) for term in jax.tree.leaves(result.energy))
    return result.energy.residual > _GAIN * turned


def _sound(scene: NormalScene | Scene, result: Result) -> Result:
    """The same with the status `ENERGY_GAINED` where the ledger is wanted and says so, and
    `NON_FINITE` where a number is not finite, and then without derivatives: a lane whose value is
    taken out of a sum is out of the sum's gradient too."""
    status = jax.lax.stop_gradient(result.status)
    if result.energy is not None and result.final is not None:
        gain = _gained(*jax.lax.stop_gradient((scene, result)))
        status = jnp.where(gain, jnp.maximum(status, float(Status.ENERGY_GAINED)), status)
    finite = jax.lax.stop_gradient(_finite(vars(result)))
    status = jnp.where(finite, status, float(Status.NON_FINITE))
    lost = status >= Status.NON_FINITE
    result = jax.tree.map(
        lambda leaf: jnp.where(lost, jax.lax.stop_gradient(leaf), leaf), result
    )
    return eqx.tree_at(lambda r: r.status, result, status)


def _derived(result: Result, columns: Result) -> tuple[Result, Result]:
    """The same with the status `NON_FINITE` and derivatives of 0 where a derivative is not finite,
    as of a state that runs away and is finite still.

    A motion whose derivative is lost ends without one. So in a whole result the end and the tip
    tell: looking at all of it would cost the derivatives that nobody reads.
    """
    whole = columns.final is not None
    finite = _finite({f: c for f, c in vars(columns).items() if not whole or f in _TELLING})
    status = jnp.where(finite, result.status, float(Status.NON_FINITE))
    columns = jax.tree.map(lambda leaf: jnp.where(finite, leaf, jnp.zeros_like(leaf)), columns)
    return eqx.tree_at(lambda r: r.status, result, status), columns


def _result(scene, fidelity: Fidelity, history: bool, only) -> Result:
    numbers, structure = jax.tree.flatten(scene)
    plain, compiled = _program(structure, fidelity, history, only)
    # Within a transformation the numbers are traced already: one layer less to go through.
    traced = any(isinstance(number, Tracer) for number in numbers)
    result = (plain if traced else compiled)(numbers)
    result = eqx.tree_at(lambda r: r.status, result, result.status.astype(jnp.int32))
    samples = result.history
    if not traced and samples is not None and samples.time.ndim == 1:
        # Longer strides leave room at the end, filled with the last sample.
        taken = 1 + int(np.searchsorted(samples.time, samples.time[-1]))
        if taken < samples.time.size:
            samples = jax.tree.map(lambda leaf: leaf[:taken], samples)
            result = dataclasses.replace(result, history=samples)
    return result


def prepared(scene: Scene, fidelity: Fidelity) -> tuple[Mechanics, Clock, Memory]:
    """What the integrator begins with: the parts made ready, the clock, and the state at the
    start."""
    touching = scene.fence_corners or scene.border_corners
    fidelity = fidelity.settled(scene.duration if touching else 0.0)
    good = sound(scene)
    steps = integrate.count_steps(scene.duration, fidelity.step)
    step = scene.duration / steps
    mechanics = keep(good, lambda s: Mechanics(s, fidelity), scene)
    begin = scene.start.time(scene.drive)
    zero = jnp.zeros_like(scene.parcel.mass)
    time = zero if begin is None else begin + zero
    link = mechanics.link
    maps = vibration = pose = drive = None
    if link is not None:
        assert scene.drive is not None
        lengths = [zero + step * count for count in stride_counts(fidelity)[1:]]
        if begin is not None:
            lengths.append(jnp.maximum(time / SWING_STEPS, 1e-9))
        maps = link.propagators(lengths)
        vibration = link.rest()
        if begin is not None:
            of_swing = Propagator(*(values[-1] for values in maps))
            maps = Propagator(*(values[:-1] for values in maps))
            vibration = keep(good, FlexibleLink.swung, link, scene.drive, lengths[-1], of_swing)
        drive = scene.drive.motion(time)
        distance = scene.start.distance()
        if distance is not None:
            pose = keep(good, _pose, link, drive, vibration, distance)
    body = scene.start.body(scene.parcel, scene.belt, pose)
    # Every number as wide as the widest: lanes of a batch may differ in any of them.
    wide = zero + time + sum(body)
    body = Body(*(q + 0 * wide for q in body))
    clock = keep(good, lambda *given: Clock(given[0], fidelity, given[1], step, given[2]),
                 link, time, maps)
    return mechanics, clock, modal_step.at_rest(mechanics, body, vibration, drive)


def _pose(
    link: FlexibleLink, drive: DriveMotion, vibration: Vibration, distance: Array
) -> Pose:
    """The fence's point at an arc coordinate [m], in fixed axes."""
    point = link.point(link.shape(distance), vibration)
    cosine, sine = jnp.cos(drive.angle), jnp.sin(drive.angle)
    normal_rate = (point.y_rate + drive.speed * point.x) * jnp.cos(point.slope)
    normal_rate = normal_rate - (point.x_rate - drive.speed * point.y) * jnp.sin(point.slope)
    return Pose(
        cosine * point.x - sine * point.y,
        sine * point.x + cosine * point.y,
        point.slope,
        normal_rate,
        drive,
    )


def _run(scene: Scene, fidelity: Fidelity, history: bool) -> Result:
    steps = integrate.count_steps(scene.duration, fidelity.step)
    mechanics, clock, memory = prepared(scene, fidelity)
    done: Array | float = 1.0
    if fidelity.integrator == "modal":
        tally, samples = integrate.modal(mechanics, clock, memory, steps, history)
    else:
        vibration = None if memory.fence is None else memory.fence.vibration
        tally, samples, done = general.run(mechanics, clock, memory.body, vibration, steps)
    return gather(
        tally, samples if history else None, clock.start,
        _status(scene, mechanics, tally, done, clock.start),
    )


# A brush of the border, or of the fence: what of it may be rough, in shares of the largest force.
_UNFELT = 5e-3
# Share of the peak force that the belt's friction may lose to its smoothing at the peak.
_SMOOTHED = 0.004
# Share of it that a parcel may owe to how friction let go of it before.
_CREPT = 0.0012
# Share of the slip at the peak that may be the creep of a parcel that stuck before.
_CREEP = 0.0125
# Tip deflection that only a motion out of control has, in limits of the linear beam [1].
_LOST = 40.0


def _smoothed(scene: Scene, fidelity: Fidelity, tally: Tally, weight: Array) -> Array:
    """Whether the smoothing of the belt's friction may move the peak force by more than a share.

    At the peak it takes m_p g (mu_k eps + |mu_s - mu_k| w_s) / s of the force, with s the slip
    there. A parcel that stuck to the belt and let go before creeps meanwhile, for a time T: it has
    a head start of eps, and of w_s as far as static and kinetic friction differ; and it is held by
    up to |mu_s - mu_k| m_p g, as it is not by dry friction: a share of the peak force, times the
    share |mu_s - mu_k| g T / s of the slip.
    """
    assert scene.belt is not None
    friction, peak = scene.belt.friction, tally.at_peak
    jump = jnp.abs(friction.static - friction.kinetic)
    lost = friction.kinetic * fidelity.slip_speed + jump * fidelity.static_speed
    now = weight * lost > _SMOOTHED * tally.force.value * peak.slip
    held = jump * scene.belt.gravity * peak.crept
    late = jump * weight * held > _CREPT * tally.force.value * peak.slip
    largest = jnp.maximum(friction.static, friction.kinetic)
    creep = largest * fidelity.slip_speed + jump * fidelity.static_speed
    early = (peak.crept > 0.25 * fidelity.step) & (creep > _CREEP * largest * peak.slip)
    return (tally.force.value > 0) & (now | late | early)


def _status(
    scene: Scene, mechanics: Mechanics, tally: Tally, done: Array | float, start_time: Array
) -> Array:
    """The largest status that applies, as a floating-point number."""
    tally = jax.lax.stop_gradient(tally)
    scene = jax.lax.stop_gradient(scene)
    parcel = scene.parcel
    side = jnp.minimum(parcel.length, parcel.breadth)
    checks = [(Status.DEEP_PENETRATION, tally.deepest > side / 2)]
    forces = jnp.maximum(tally.force.value, tally.border.value)
    weight = parcel.mass * (0.0 if scene.belt is None else scene.belt.gravity)
    # Where the fence is touched its force must be right beside a large weight, too.
    share = max(1e-3, 4 * modal_step.tolerance(parcel.mass.dtype))
    allowed = share * (forces + jnp.where(tally.stay.touched > 0, 0.0, weight))
    checks.append((Status.STEP_TOO_COARSE, tally.defect > allowed + 1e-9))
    for peak, rough in ((tally.force, tally.rough), (tally.border, tally.rough_border)):
        felt = ROUGH * peak.value + _UNFELT * forces
        checks.append((Status.STEP_TOO_COARSE, rough > felt))
    checks.append((Status.LIMIT_REACHED, jnp.asarray(done) < 0.5))
    checks.append((Status.INCONSISTENT, ~consistent(scene, start_time)))
    if scene.belt is not None and scene.fence_corners:
        lost = _smoothed(scene, mechanics.fidelity, tally, weight)
        checks.append((Status.FRICTION_SMOOTHED, lost))
    if mechanics.link is not None and mechanics.link.frequency_squared:
        highest = jax.lax.stop_gradient(mechanics.link.eigenvalues[-1])
        checks.append((Status.MODES_TOO_FEW, tally.hurry > LAGGING * highest * tally.deepest))
    if scene.fence is not None:
        limit = scene.fence.flexible_length / 4
        checks.append((Status.LARGE_DEFLECTION, tally.tip.value > limit))
        # It runs away: finite still, but its derivatives may be so no more.
        checks.append((Status.NON_FINITE, tally.tip.value > _LOST * limit))
    if scene.fence_corners:
        checks.append((Status.NEVER_TOUCHED, tally.stay.touched == 0))
        checks.append((Status.IN_CONTACT_AT_END, tally.last.fence_force > 0))
        checks.append((Status.LEFT_OVER_TIP, tally.over_tip > 0))
        checks.append((Status.PEAK_AT_TIP, tally.at_peak.cut > 0))
    body = tally.last.body
    finite = jnp.isfinite(sum(body) + tally.force.value + tally.tip.value)
    checks.append((Status.NON_FINITE, ~finite))
    return worst(checks, body.x)
