"""The status of a simulation: whether its numbers can be relied on, by its running evidence, its
result and its derivatives.

What each of the constants here refuses and accepts is measured by `thresholds.py` and `runaway.py`
in `tests/robustness`, and listed in `TRUST.md` beside them.
"""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..fidelity import Fidelity
from ..model import FlexibleLink, Mechanics, force_tolerance
from ..scenes import NormalScene, Scene, consistent
from .peak import Peak
from .recorder import Record
from .resolution import LAGGING, Resolution, cutoff, modes_lag
from .result import Result
from .sample import Sample
from .slopes import SlopeEvidence, relative_error
from .status import DEEPEST, LARGEST_BEND, NUMERICAL, Status, worst

# Largest relative error of a peak force under a good status [1].
_PROMISED = 0.025
# Statuses that a finer step, more modes or less smoothing of friction may remove.
_SETTLED = NUMERICAL - {Status.LIMIT_REACHED}
# Largest second difference of a force from step to step, as a share of its peak, with which it
# counts as resolved: the peak is off by up to a fifth of that share (the most that a search finds,
# `tests/robustness/search.py`), its gradient by up to twice the share.
_ROUGHNESS = 0.12
# The same where parcel and fence have separated before the peak: a blow depends on when the one
# before it ended, and its derivative much more so.
_REBOUND_ROUGHNESS = 0.01
# Largest height of a force's peak above its samples, in tolerances of the error control. That keeps
# each contact's force within one of them of the line between two samples, also half way, where a
# parabola is furthest off; and two corners may press at a time. A higher peak is a kink of the
# force, such as where a corner comes to the tip, taken as a parabola: its derivative depends on
# where the samples happen to be.
_ABOVE_SAMPLES = 2.0
# Largest product of the first mode's angular frequency and the step. Above it a friction that
# reverses within a step excites the fence wrongly; the effect is small, but the derivative has its
# phase.
_RINGING = 1.5
# The same holds under a contact with hardly any stiffness, whose damper ties the fence to the
# corner: its relaxation time dN/dDdot over the secant stiffness N(D, 0) / D, in steps.
_DAMPER_HELD = 1e6
# Largest static deflection by the modes left out, as a share of the flexible link's length: it is
# right itself, with its slope, but not its effect on the arc's length and on other corners.
_RESIDUAL_DEFLECTION = 0.003
# Negligible second difference of a weak contact, as a share of the largest force.
_NEGLIGIBLE_ROUGHNESS = 5e-3
# Largest loss of the belt's friction by its smoothing at the peak, as a share of the peak force.
_SMOOTHED = 0.004
# Largest share of the peak force that comes from the way in which the belt let go of the parcel.
_CREEP_LOSS = 0.00105
# Largest speed of a parcel that creeps [w_s]: exp(-3^2) of the jump of friction is left there.
_CREEP_SPEED = 3.0
# Largest creep of a parcel that stuck before, as a share of the slip at the peak.
_CREEP_SHARE = 0.0082
# Largest slip by the belt's friction within a step, as a share of the slip at the peak, for a
# parcel that reversed on the belt before: the slip depends on when in the step it did so.
_STEP_SLIP = 0.015
# Largest jump of friction on the fence of which it is uncertain whether it happened, as a corner
# stuck or slid (`hold`), as a share of the peak force.
_HELD = 0.02
# Largest effect on the force of the displacement that a parcel owes to the smoothing as it let go
# of the belt, as a share of the force: by that displacement a corner meets the fence sooner or
# later than with dry friction, and than the next corner. 2.5 % of the force are promised.
_DRIFTED = 0.02
# Largest number of blows before the peak. Each multiplies the errors of the ones before, whatever
# their origin, as in billiards: no fidelity computes a force after more.
_BLOWS = 3.0
# One or two of them multiply a step's tolerance by up to 60 or 80: searches found sorts off by 5.6
# % at 2e-3, by 3.1 % at a quarter and by 1.5 % at an eighth of it, where the parcel meets the fence
# flat, turned by one blow before; and after two by 3.9 % at 5e-4, by 1.1 % at an eighth of it and
# by 0.25 % at a 64th. So they need tolerances of these values.
_ONE_BLOW, _TWO_BLOWS, _MULTIPLIED = 2.5e-4, 1e-4, 80.0
# Tip deflection of a motion out of control, in limits of the linear beam [1]. From 10 on no force
# is near that of finer steps (`tests/robustness/runaway.py`); up to here the status only says so,
# so that what longer steps have driven there is computed finer.
_RUNAWAY = 40.0
# Largest phase of the hinge's oscillation against its shaft in a step [rad] with which the moment
# of a clutch that slips is limited in time.
_SLIPPING = 1.0


class Evidence(NamedTuple):
    """The evidence for a status: the last sample, peaks, whether parcel and fence have touched, the
    depth of the contact [m], whether a corner ran over the tip, the largest unbalanced force [N],
    and the evidence on steps, modes and smoothing. Nothing here has a derivative."""

    last: Sample
    force: Peak
    tip: Peak
    border: Peak
    surface: Peak | None
    touched: Array
    deepest: Array
    over_tip: Array
    unbalance: Array
    resolution: Resolution


def evidence(record: Record) -> Evidence:
    """The part of a record that the status is decided by."""
    states = record.states
    return jax.lax.stop_gradient(
        Evidence(
            record.last,
            states["force"],
            states["tip"],
            states["border"],
            states["surface"],
            states["contact"].touched,
            *(states[name] for name in ("deepest", "over_tip", "unbalance", "resolution")),
        )
    )


def _smoothed(scene: Scene, mechanics: Mechanics, seen: Evidence, weight: Array) -> Array:
    """Whether the smoothing of the belt's friction may change the peak force by more than a share.

    At the peak the smoothing takes m_p g (mu_k eps + |mu_s - mu_k| w_s) / s off the force, with s
    the slip there. A parcel that stuck to the belt and let go before creeps meanwhile, for a time
    T. It has a head start of eps, and of w_s as far as static and kinetic friction differ. And
    smoothed friction brakes it by up to |mu_s - mu_k| m_p g more than dry friction does: a share of
    the peak force, times the share |mu_s - mu_k| g T / s of the slip, with at most 3 w_s for a
    parcel that creeps. Its displacement by that until the next blow is a part of that blow's depth,
    on which the force depends.
    """
    assert scene.belt is not None
    fidelity = mechanics.fidelity
    peak = seen.resolution.at_peak
    kinetic, jump, largest = scene.belt.friction.scales(peak.slip)
    lost = kinetic * fidelity.slip_speed + jump * fidelity.static_speed
    now = weight * lost > _SMOOTHED * seen.force.value * peak.slip
    slowed = jnp.minimum(
        jump * scene.belt.gravity * peak.creep_time, _CREEP_SPEED * fidelity.static_speed
    )
    late = jump * weight * slowed > _CREEP_LOSS * seen.force.value * peak.slip
    creep = largest * fidelity.slip_speed + jump * fidelity.static_speed
    early = (peak.creep_time > 0.25 * fidelity.step) & (creep > _CREEP_SHARE * largest * peak.slip)
    still = jnp.zeros_like(seen.deepest)
    elastic = mechanics.law.force(seen.deepest, still, mechanics.viscosity)
    drifts = elastic.by_gap * peak.drift > _DRIFTED * elastic.force
    return (seen.force.value > 0) & (now | late | early | drifts)


def _belt_slip_unresolved(scene: Scene, fidelity: Fidelity, seen: Evidence) -> Array:
    """Whether the change of slip by friction in a step h, mu g h, is too large compared with the
    slip at the peak, for a parcel that reversed on the belt before."""
    assert scene.belt is not None
    peak = seen.resolution.at_peak
    jump = scene.belt.friction.scales(peak.slip).largest * scene.belt.gravity * fidelity.step
    return (peak.belt_slip_reversed > 0) & (jump > _STEP_SLIP * peak.slip)


def unresolved(
    link: FlexibleLink | None,
    fidelity: Fidelity,
    seen: Evidence,
    unmet: Array | None,
    tolerated: Array | float = 0.0,
) -> list[tuple[Status, Array]]:
    """Whether steps do not resolve the fence's force, or the modes kept do not. With error control
    this is known from `unmet`, and from a peak that is further above its samples than allowed; with
    fixed steps from the force's second difference, of which `tolerated` [N] is negligible. The
    limit is lower for the peak of a later blow."""
    if unmet is None or fidelity.step_tolerance is None:
        coarse = seen.resolution.roughness > _ROUGHNESS * seen.force.value + tolerated
    else:
        tolerance = max(fidelity.step_tolerance, 2 * force_tolerance(seen.force.value.dtype))
        above = seen.force.value - seen.resolution.largest
        coarse = unmet | (above > _ABOVE_SAMPLES * tolerance * seen.force.value)
    again = seen.resolution.at_peak.rebound_roughness > _REBOUND_ROUGHNESS * seen.force.value
    lag = modes_lag(seen.resolution, seen.deepest, cutoff(link))
    return [(Status.STEP_TOO_COARSE, coarse | again), (Status.MODES_TOO_FEW, lag > LAGGING)]


def _peaks_at_end(seen: Evidence, fidelity: Fidelity) -> Array:
    """Whether the fence's force is largest within a step of the end, so that it is not known
    whether that is a maximum or only the end of the simulated time."""
    presses = seen.last.fence_force > 0
    return presses & (seen.force.time + fidelity.step >= seen.last.time)


def _blows_unresolved(fidelity: Fidelity, seen: Evidence) -> Array:
    """Whether the peak, or a later force that may be higher than that by more than is promised,
    comes after so many blows that the steps do not resolve it."""
    tolerance, most = fidelity.step_tolerance, _BLOWS
    if tolerance is not None and tolerance > _TWO_BLOWS:
        most = 1.0 if tolerance > _ONE_BLOW else 2.0
    highest = seen.resolution.later[(most > 1) + (most > 2)]
    highest = (1 + _MULTIPLIED * (tolerance or 0.0)) * highest
    higher = highest > (1 + _PROMISED) * seen.force.value
    return (seen.resolution.at_peak.blows >= most) | higher


def of_record(
    scene: Scene,
    mechanics: Mechanics,
    record: Record,
    done: Array | float,
    start_time: Array,
    unmet: Array | None,
) -> Array:
    """The largest status that applies, as a floating-point number. `unmet` is whether the steps
    missed more than the error control tolerates (`None` without one)."""
    seen = evidence(record)
    scene = jax.lax.stop_gradient(scene)
    parcel = scene.parcel
    side = jnp.minimum(parcel.length, parcel.breadth)
    checks = [(Status.DEEP_PENETRATION, seen.deepest > DEEPEST * side)]
    still = seen.border.value
    if seen.surface is not None:
        still = jnp.maximum(still, seen.surface.value)
    forces = jnp.maximum(seen.force.value, still)
    weight = parcel.mass * (0.0 if scene.belt is None else scene.belt.gravity)
    # In contact with the fence its force must be right next to a large weight, too.
    share = max(1e-3, 4 * force_tolerance(parcel.mass.dtype))
    allowed = share * (forces + jnp.where(seen.touched > 0, 0.0, weight))
    checks.append((Status.STEP_TOO_COARSE, seen.unbalance > allowed + 1e-9))
    if unmet is None:
        at_border = _ROUGHNESS * still + _NEGLIGIBLE_ROUGHNESS * forces
        checks.append((Status.STEP_TOO_COARSE, seen.resolution.border_roughness > at_border))
    checks += unresolved(
        mechanics.link, mechanics.fidelity, seen, unmet, _NEGLIGIBLE_ROUGHNESS * forces
    )
    checks.append((Status.LIMIT_REACHED, jnp.asarray(done) < 0.5))
    checks.append((Status.INCONSISTENT, ~consistent(scene, start_time)))
    if scene.belt is not None and scene.fence_corners:
        smoothed = _smoothed(scene, mechanics, seen, weight)
        checks.append((Status.FRICTION_SMOOTHED, smoothed))
        too_coarse = _belt_slip_unresolved(scene, mechanics.fidelity, seen)
        checks.append((Status.STEP_TOO_COARSE, too_coarse))
    if scene.fence_corners:
        checks.append((Status.STEP_TOO_COARSE, _blows_unresolved(mechanics.fidelity, seen)))
        unsure = seen.resolution.at_peak.unsure_friction > _HELD * seen.force.value
        checks.append((Status.FRICTION_SMOOTHED, unsure))
    if mechanics.link is not None and mechanics.link.frequency_squared:
        frequency = jnp.sqrt(jax.lax.stop_gradient(mechanics.link.slowest))
        rings = frequency * mechanics.fidelity.step > _RINGING
        still = jnp.zeros_like(seen.deepest)
        elastic = mechanics.law.force(seen.deepest, still, mechanics.viscosity).force
        damper = mechanics.law.force(seen.deepest, still + 1, mechanics.viscosity).by_rate
        pinned = damper * seen.deepest > _DAMPER_HELD * mechanics.fidelity.step * elastic
        reversed_ = seen.resolution.at_peak.sliding_reversed > 0
        checks.append((Status.STEP_TOO_COARSE, rings & (pinned | reversed_)))
        assert scene.fence is not None
        allowed = _RESIDUAL_DEFLECTION * scene.fence.flexible_length
        bends = seen.resolution.residual_deflection > allowed
        checks.append((Status.MODES_TOO_FEW, bends))
    if seen.last.slip is not None:
        assert mechanics.link is not None
        assert mechanics.link.hinge is not None
        fast = jax.lax.stop_gradient(mechanics.link.hinge.stuck_frequency)
        late = fast * mechanics.fidelity.step > _SLIPPING
        checks.append((Status.STEP_TOO_COARSE, late & (jnp.abs(seen.last.slip) > 0)))
    if scene.fence is not None:
        limit = LARGEST_BEND * scene.fence.flexible_length
        checks.append((Status.LARGE_DEFLECTION, seen.tip.value > limit))
        # The motion diverges: it is still finite, but its derivatives may be infinite.
        checks.append((Status.NON_FINITE, seen.tip.value > _RUNAWAY * limit))
    if scene.fence_corners:
        at_tip = seen.resolution.at_peak.over_tip > 0
        # No finer fidelity helps where the model ends a force at the tip.
        checks = [
            (code, holds & ~at_tip if code in _SETTLED else holds) for code, holds in checks
        ]
        checks.append((Status.NEVER_TOUCHED, seen.touched == 0))
        checks.append((Status.IN_CONTACT_AT_END, seen.last.fence_force > 0))
        checks.append((Status.LEFT_OVER_TIP, seen.over_tip > 0))
        checks.append((Status.PEAK_AT_END, _peaks_at_end(seen, mechanics.fidelity)))
        checks.append((Status.PEAK_AT_TIP, at_tip))
    body = seen.last.body
    finite = jnp.isfinite(sum(body) + seen.force.value + seen.tip.value)
    checks.append((Status.NON_FINITE, ~finite))
    return worst(checks, body.x)


def of_normal_record(
    scene: NormalScene,
    link: FlexibleLink | None,
    fidelity: Fidelity,
    record: Record,
    unmet: Array | None,
) -> Array:
    """The largest status that applies to a scene of the normal direction, as a floating-point
    number; `unmet` as in `of_record`."""
    seen = evidence(record)
    scene = jax.lax.stop_gradient(scene)
    side = jnp.minimum(scene.parcel.length, scene.parcel.breadth)
    checks = [
        (Status.NEVER_TOUCHED, seen.force.value <= 0),
        (Status.IN_CONTACT_AT_END, seen.last.fence_force > 0),
        (Status.PEAK_AT_END, _peaks_at_end(seen, fidelity)),
        (Status.DEEP_PENETRATION, seen.deepest > DEEPEST * side),
        (Status.STEP_TOO_COARSE, seen.unbalance > 1e-3 * seen.force.value + 1e-9),
        (Status.INCONSISTENT, ~consistent(scene)),
        (Status.NON_FINITE, ~jnp.isfinite(seen.last.body.y + seen.force.value)),
        *unresolved(link, fidelity, seen, unmet),
    ]
    if scene.fence is not None:
        limit = LARGEST_BEND * scene.fence.flexible_length
        checks.append((Status.LARGE_DEFLECTION, seen.tip.value > limit))
    return worst(checks, seen.last.body.y)


# --- Of a result ----------------------------------------------------------------------------------

# NaN where there was no contact.
_MAY_BE_NAN = (
    "first_contact", "last_contact", "leave_x", "leave_y", "status", "gradient_error"
)  # fmt: skip
# The parts of a whole result that show whether derivatives became non-finite on the way.
_TELLING = ("final", "tip_deflection")


def _fields(result: Result) -> dict[str, Any]:
    """The measures and the other numbers of a result, by name."""
    rest = {name: value for name, value in vars(result).items() if name != "measures"}
    return {**result.measures, **rest}


def _finite(fields: Mapping[str, Any]) -> Array:
    """Whether all numbers of a result that must be finite are."""
    alike: dict[Any, Array] = {}
    for leaf in jax.tree.leaves({f: v for f, v in fields.items() if f not in _MAY_BE_NAN}):
        # 0 where finite and NaN elsewhere: so one test is enough for all leaves of a shape.
        zeros, kind = 0.0 * leaf, (leaf.shape, leaf.dtype)
        alike[kind] = alike[kind] + zeros if kind in alike else zeros
    finite = [jnp.all(jnp.isfinite(zeros)) for zeros in alike.values()]
    return functools.reduce(jnp.logical_and, finite, jnp.asarray(True))


# Largest residual of the energy ledger, as a share of the energy exchanged: a force goes with the
# root of the energy behind it, and 2.5 % of it are promised.
_UNBALANCED = 2 * _PROMISED


def _unbalanced(scene: NormalScene | Scene, result: Result) -> Array:
    """Whether the energy ledger does not close: a residual above 5 % of the energy exchanged, which
    is the parcel's kinetic energy at the end and the sizes of the ledger's terms together."""
    parcel, final = scene.parcel, result.final
    kinetic = 0.5 * parcel.mass * (final.x_rate**2 + final.y_rate**2)
    kinetic = kinetic + 0.5 * parcel.inertia * final.spin**2
    exchanged = kinetic + sum(jnp.abs(term) for term in jax.tree.leaves(result.energy))
    return jnp.abs(result.energy.residual) > _UNBALANCED * exchanged


def of_result(scene: NormalScene | Scene, result: Result) -> Result:
    """The result with the status `ENERGY_UNBALANCED` where the ledger is asked for and does not
    close, and `NON_FINITE` where a number is not finite, and then without derivatives: a lane whose
    value is taken out of a sum is out of the sum's gradient too."""
    status = jax.lax.stop_gradient(result.status)
    if result.energy is not None and result.final is not None:
        open_ = _unbalanced(*jax.lax.stop_gradient((scene, result)))
        status = jnp.where(open_, jnp.maximum(status, float(Status.ENERGY_UNBALANCED)), status)
    finite = jax.lax.stop_gradient(_finite(_fields(result)))
    status = jnp.where(finite, status, float(Status.NON_FINITE))
    lost = status >= Status.NON_FINITE
    result = jax.tree.map(
        lambda leaf: jnp.where(lost, jax.lax.stop_gradient(leaf), leaf), result
    )
    return eqx.tree_at(lambda r: r.status, result, status)


Outcome = tuple[Result, SlopeEvidence | None]


def of_derivatives(
    outcome: Outcome, columns: Outcome, at: Array, tolerance: float
) -> tuple[Outcome, Outcome]:
    """The result with the status that its derivatives in numbers of the values `at` ask for:
    `STEP_TOO_COARSE` where those of the peak force may be off by more than the `tolerance` [1], by
    the steps or as another maximum is about as high; and `NON_FINITE`, with derivatives of 0, where
    one is not finite, as those of a diverging state that is still finite.

    Non-finite derivatives of the motion last until its end. So in a whole result the end and the
    tip show them; a test of all fields would compute derivatives that are not read.
    """
    (result, slopes), (of_result, of_slopes) = outcome, columns
    status = result.status
    # The summed sizes have no second derivatives.
    if slopes is not None and of_slopes is not None and of_slopes.force.shape == at.shape:
        error = relative_error(of_slopes, slopes, at)
        result = eqx.tree_at(lambda r: r.gradient_error, result, error)
        doubt = (status <= Status.LEFT_OVER_TIP) & (error > tolerance)
        status = jnp.where(doubt, float(Status.STEP_TOO_COARSE), status)
    whole = of_result.final is not None
    finite = _finite({f: c for f, c in _fields(of_result).items() if not whole or f in _TELLING})
    status = jnp.where(finite, status, float(Status.NON_FINITE))
    columns = jax.tree.map(lambda leaf: jnp.where(finite, leaf, jnp.zeros_like(leaf)), columns)
    return (eqx.tree_at(lambda r: r.status, result, status), slopes), columns
