"""Whether the numbers of a simulation can be relied on: what its running sums, its result and its
derivatives say.

What each of the constants here refuses and lets pass is measured by `thresholds.py`, `runaway.py`
in `tests/robustness`, and told in `TRUST.md` beside them.
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

# How far off a peak force may be under a good status [1].
_PROMISED = 0.025
# What a finer step, more modes or less smoothing of friction settles.
_SETTLED = NUMERICAL - {Status.LIMIT_REACHED}
# A force whose second difference from step to step is a larger share of its peak than this is not
# resolved: the peak is off by up to a fifth of that share (the most that a search finds,
# `tests/robustness/search.py`), its gradient by up to twice of it.
_ROUGHNESS = 0.12
# The same where parcel and fence had parted before the peak: a blow depends on when the one before
# it ended, and its derivative far more so.
_REBOUND_ROUGHNESS = 0.01
# How far above its samples a force may peak, in tolerances of the error control: that has each
# contact's force within one of them of the line between two samples, half way too, where a parabola
# is furthest off; and two corners may press at a time. A peak beyond that is a kink of the force,
# such as where a corner comes to the tip, seen as a parabola: its derivative follows how the
# samples happen to lie.
_ABOVE_SAMPLES = 2.0
# The first mode's angular frequency times the step: above it a friction that turns round within a
# step rings the fence as it would not in time, by little, but the derivative counts its phase.
_RINGING = 1.5
# So it does under a contact that is all damper, which holds the fence to the corner: its time of
# relaxation dN/dDdot over the secant stiffness N(D, 0) / D, in steps.
_DAMPER_HELD = 1e6
# What the modes left out may bend the fence statically, as a share of the flexible link's length:
# their deflection and slope are right, not what these do to the arc's length and to other corners.
_RESIDUAL_DEFLECTION = 0.003
# A brush of the border, or of the fence: what of it may be rough, in shares of the largest force.
_NEGLIGIBLE_ROUGHNESS = 5e-3
# Share of the peak force that the belt's friction may lose to its smoothing at the peak.
_SMOOTHED = 0.004
# Share of it that a parcel may owe to how friction let go of it before.
_CREEP_LOSS = 0.00105
# A parcel that creeps is slower than so many w_s: exp(-3^2) of the jump of friction is left there.
_CREEP_SPEED = 3.0
# Share of the slip at the peak that may be the creep of a parcel that stuck before.
_CREEP_SHARE = 0.0082
# Share of the slip at the peak that the belt's friction may add within a step, of a parcel that
# turned round on it before: when in the step it did so counts.
_STEP_SLIP = 0.015
# Share of the peak force that friction on the fence may have jumped by before, or not, within the
# edge of holding a corner (`hold`).
_HELD = 0.02
# Share of the force that the depth of the contact may be worth by which a parcel drifted before, as
# it let go of the belt within the smoothing: by so much a corner meets the fence sooner or later
# than dry friction has it, and than the next corner. 2.5 % of the force are promised.
_DRIFTED = 0.02
# Blows before the peak. Each multiplies what the ones before are off by, of whatever origin, as a
# billiard does: no fidelity tells a force after so many.
_BLOWS = 3.0
# One or two of them multiply a step's tolerance by up to 60 or 80: searches found sorts off by
# 5.6 % at 2e-3, by 3.1 % at a quarter and by 1.5 % at an eighth of it, where the parcel meets the
# fence flat, as one blow before has turned it; and by 3.9 % at 5e-4, by 1.1 % at an eighth of it
# and by 0.25 % at a 64th after two. So they ask for tolerances of these.
_ONE_BLOW, _TWO_BLOWS, _MULTIPLIED = 2.5e-4, 1e-4, 80.0
# Tip deflection that only a motion out of control has, in limits of the linear beam [1]. From 10 on
# no force has to do with that of finer steps (`tests/robustness/runaway.py`); up to here it is only
# said, so that what longer steps have driven there is computed finer.
_RUNAWAY = 40.0
# Turn of the hinge's oscillation against its shaft within a step [rad], above which a clutch that
# slips holds its moment too late.
_SLIPPING = 1.0


class Evidence(NamedTuple):
    """What a status is judged by: the last sample, peaks, whether parcel and fence have touched,
    the depth of the contact [m], whether a corner ran over the tip, the largest force left
    unbalanced [N], and whether steps, modes and smoothing resolve the motion. Nothing of it has a
    derivative."""

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
    """What of a record tells the status."""
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
    """Whether the smoothing of the belt's friction may move the peak force by more than a share.

    At the peak it takes m_p g (mu_k eps + |mu_s - mu_k| w_s) / s of the force, with s the slip
    there. A parcel that stuck to the belt and let go before creeps meanwhile, for a time T: it has
    a head start of eps, and of w_s as far as static and kinetic friction differ; and it is held by
    up to |mu_s - mu_k| m_p g, as it is not by dry friction: a share of the peak force, times the
    share |mu_s - mu_k| g T / s of the slip, of which a parcel that creeps is no more than 3 w_s
    behind. What it drifts by until the next blow is a part of that one's depth, on which the
    force depends.
    """
    assert scene.belt is not None
    fidelity = mechanics.fidelity
    peak = seen.resolution.at_peak
    kinetic, jump, largest = scene.belt.friction.scales(peak.slip)
    lost = kinetic * fidelity.slip_speed + jump * fidelity.static_speed
    now = weight * lost > _SMOOTHED * seen.force.value * peak.slip
    held = jnp.minimum(
        jump * scene.belt.gravity * peak.creep_time, _CREEP_SPEED * fidelity.static_speed
    )
    late = jump * weight * held > _CREEP_LOSS * seen.force.value * peak.slip
    creep = largest * fidelity.slip_speed + jump * fidelity.static_speed
    early = (peak.creep_time > 0.25 * fidelity.step) & (creep > _CREEP_SHARE * largest * peak.slip)
    still = jnp.zeros_like(seen.deepest)
    elastic = mechanics.law.force(seen.deepest, still, mechanics.viscosity)
    drifts = elastic.by_gap * peak.drift > _DRIFTED * elastic.force
    return (seen.force.value > 0) & (now | late | early | drifts)


def _belt_slip_unresolved(scene: Scene, fidelity: Fidelity, seen: Evidence) -> Array:
    """Whether it is too much beside the slip at the peak what friction adds in a step's length h,
    mu g h, of a parcel that turned round on the belt before."""
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
    """Whether steps do not resolve the fence's force, or the modes kept do not. Steps under error
    control say so themselves, by `unmet`, and by a peak that is further above its samples than
    they allow; of fixed ones the force's second difference tells, of which `tolerated` [N] do not
    matter. A peak of a later blow asks for more."""
    if unmet is None or fidelity.step_tolerance is None:
        rough = seen.resolution.roughness > _ROUGHNESS * seen.force.value + tolerated
    else:
        tolerance = max(fidelity.step_tolerance, 2 * force_tolerance(seen.force.value.dtype))
        above = seen.force.value - seen.resolution.largest
        rough = unmet | (above > _ABOVE_SAMPLES * tolerance * seen.force.value)
    again = seen.resolution.at_peak.rebound_roughness > _REBOUND_ROUGHNESS * seen.force.value
    lag = modes_lag(seen.resolution, seen.deepest, cutoff(link))
    return [(Status.STEP_TOO_COARSE, rough | again), (Status.MODES_TOO_FEW, lag > LAGGING)]


def _peaks_at_end(seen: Evidence, fidelity: Fidelity) -> Array:
    """Whether the fence's force is largest within a step of the end, so that steps do not tell
    whether that is a maximum or where the time cuts it off."""
    presses = seen.last.fence_force > 0
    return presses & (seen.force.time + fidelity.step >= seen.last.time)


def _blows_unresolved(fidelity: Fidelity, seen: Evidence) -> Array:
    """Whether the peak, or a force that may be higher than that by more than is promised, comes
    after so many blows that steps do not tell how large it is."""
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
    # Where the fence is touched its force must be right beside a large weight, too.
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
        # It runs away: finite still, but its derivatives may be so no more.
        checks.append((Status.NON_FINITE, seen.tip.value > _RUNAWAY * limit))
    if scene.fence_corners:
        at_tip = seen.resolution.at_peak.over_tip > 0
        # No fidelity settles a force that the model ends at the tip.
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

# Not a number where there was no contact.
_MAY_BE_NAN = (
    "first_contact", "last_contact", "leave_x", "leave_y", "status", "gradient_error"
)  # fmt: skip
# Of a whole result, what shows that derivatives were lost on the way.
_TELLING = ("final", "tip_deflection")


def _fields(result: Result) -> dict[str, Any]:
    """The measures and the other numbers of a result, by name."""
    rest = {name: value for name, value in vars(result).items() if name != "measures"}
    return {**result.measures, **rest}


def _finite(fields: Mapping[str, Any]) -> Array:
    """Whether all numbers of a result's fields are finite that have to be."""
    alike: dict[Any, Array] = {}
    for leaf in jax.tree.leaves({f: v for f, v in fields.items() if f not in _MAY_BE_NAN}):
        # 0 where it is finite and not a number elsewhere: so one look is enough for all of a shape.
        zeros, kind = 0.0 * leaf, (leaf.shape, leaf.dtype)
        alike[kind] = alike[kind] + zeros if kind in alike else zeros
    finite = [jnp.all(jnp.isfinite(zeros)) for zeros in alike.values()]
    return functools.reduce(jnp.logical_and, finite, jnp.asarray(True))


# Share of the energy turned over by which a ledger may fail to close: a force goes with the root of
# the energy behind it, and 2.5 % of it are promised.
_UNBALANCED = 2 * _PROMISED


def _unbalanced(scene: NormalScene | Scene, result: Result) -> Array:
    """Whether the energy ledger ends with more than the work done accounts for, or with less: a
    residual above 5 % of what was turned over, the parcel's kinetic energy at the end and the sizes
    of the ledger's terms together."""
    parcel, final = scene.parcel, result.final
    held = 0.5 * parcel.mass * (final.x_rate**2 + final.y_rate**2)
    held = held + 0.5 * parcel.inertia * final.spin**2
    turned = held + sum(jnp.abs(term) for term in jax.tree.leaves(result.energy))
    return jnp.abs(result.energy.residual) > _UNBALANCED * turned


def of_result(scene: NormalScene | Scene, result: Result) -> Result:
    """The same with the status `ENERGY_UNBALANCED` where the ledger is wanted and says so, and
    `NON_FINITE` where a number is not finite, and then without derivatives: a lane whose value is
    taken out of a sum is out of the sum's gradient too."""
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
    """The same with what the derivatives in numbers of the values `at` say of the status:
    `STEP_TOO_COARSE` where those of the peak force may be off by more than the `tolerance` [1], by
    the steps or as another maximum is about as high; and `NON_FINITE`, with derivatives of 0, where
    one is not finite, as of a state that runs away and is finite still.

    A motion whose derivative is lost ends without one. So in a whole result the end and the tip
    tell: looking at all of it would cost the derivatives that nobody reads.
    """
    (result, slopes), (of_result, of_slopes) = outcome, columns
    status = result.status
    # Sizes that are summed have no second derivatives.
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
