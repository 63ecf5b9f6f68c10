"""Further statements of the paper, judged at the default numbers only."""

import dataclasses

import numpy as np

from .cycle import Cycle, Stiff
from .maps import Maps
from .statements import Finding, named, pair, verdict

MASSES = (1.0, 15.0, 30.0)
"""Masses [kg] at which the restitution is computed."""
_MASS, _PLACE, _FALL = 15.0, 0.8, 2.426


@dataclasses.dataclass(frozen=True)
class FurtherEvidence:
    """The evidence for these statements: cycles and `stiff` have one lane a fence; `restitution`
    [1] is that of `MASSES` at a rigid obstacle."""

    impact: Cycle
    slide: Cycle
    stiff: Stiff
    maps: Maps
    restitution: np.ndarray


def _forces(maps: Maps) -> np.ndarray:
    """N_max [N] of the paper's parcel over R, (fences, R); NaN where it is not sound."""
    force = np.where(maps.sound, maps.force, np.nan)
    return np.array([
        [np.interp(_MASS, maps.masses, force[k, :, j]) for j in range(maps.distances.size)]
        for k in range(force.shape[0])
    ])  # fmt: skip


def _free_end(evidence: FurtherEvidence) -> Finding:
    force, places = _forces(evidence.maps), evidence.maps.distances
    found = np.isfinite(force).all(axis=0)
    force, places = force[:, found], places[found]
    worst = places[np.argmax(force, axis=1)]
    outermost = force[:, -1] / np.max(force, axis=1)
    return Finding(
        "free end",
        "the greatest danger is the impact against the free end",
        f"N_max is largest at R = {pair(worst, '.2f')} m; at {places[-1]:.2f} m it is "
        f"{pair(outermost, '.0f', 100)} % of that",
        verdict(bool(np.all(worst >= places[-1] - 0.1)), bool(np.all(outermost > 0.9))),
        float(worst[0]),
        "m",
        named("place of the largest N_max", worst)
        | named("largest N_max", np.max(force, axis=1))
        | named("N_max at the outermost R", force[:, -1]),
        "the parcel is met faster there, but the fence gives way more than in proportion: the "
        "force is largest where the fence is stiffest, near the joint or the hinge",
        contradicted=True,
    )


def _rigid_third(evidence: FurtherEvidence) -> Finding:
    maps = evidence.maps
    force = [np.interp(_PLACE, maps.distances, row) for row in _forces(maps)]
    more = force[0] / force[1] - 1
    return Finding(
        "rigid third",
        "a fence whose first third is rigid has similar effects",
        f"N_max at R = {_PLACE:g} m: {pair(force, '.0f')} N",
        verdict(abs(more) < 0.1, abs(more) < 0.2),
        100 * float(more),
        "%",
        named(f"N_max at R = {_PLACE:g} m", force),
        "similar near the tip alone: towards the joint the rigid third is missing as a lever",
        contradicted=True,
    )


def _paths(evidence: FurtherEvidence) -> Finding:
    cycles = {"impact": evidence.impact, "slide": evidence.slide}
    apart = {
        name: float(np.max(np.hypot(*(np.diff(q, axis=0)[0] for q in (cycle.x, cycle.y)))))
        for name, cycle in cycles.items()
    }
    worst = max(apart.values())
    return Finding(
        "paths",
        "the parcel's paths by both fences coincide along all their lengths",
        ", ".join(f"{name} {1e3 * value:.0f} mm apart" for name, value in apart.items()),
        verdict(worst < 0.02, worst < 0.05),
        1e3 * worst,
        "mm",
        {f"largest distance of the paths, {name}": value for name, value in apart.items()},
        "they coincide while the fence presses, and part afterwards: what differs in the speed at "
        "which the parcel leaves adds up as it coasts",
        contradicted=True,
    )


def _restitution(evidence: FurtherEvidence) -> Finding:
    found = evidence.restitution
    spread = float(np.ptp(found) / np.mean(found))
    return Finding(
        "restitution",
        "the restitution does not depend on the parcel's mass",
        f"{found[1]:.3f}, {100 * spread:.1f} % between {MASSES[0]:g} and {MASSES[-1]:g} kg",
        verdict(spread < 0.005, spread < 0.05),
        float(found[1]),
        "1",
        {f"restitution, {mass:g} kg": float(e) for mass, e in zip(MASSES, found, strict=True)},
        "against a rigid obstacle it follows from b_p v^0.2 / k_p^0.6 alone",
    )


def _fall(evidence: FurtherEvidence) -> Finding:
    at_corner, at_tip = float(evidence.stiff.speed[0]), float(evidence.stiff.tip_speed[0])
    off = [abs(speed / _FALL - 1) for speed in (at_corner, at_tip)]
    return Finding(
        "fall",
        "the normal speed is that of a fall from 0.3 m (2.43 m/s)",
        f"{at_corner:.2f} m/s at the corner, {at_tip:.2f} m/s at the tip",
        verdict(off[0] < 0.02, off[1] < 0.02),
        at_corner,
        "m/s",
        {"normal speed at the corner": at_corner, "normal speed at the tip": at_tip},
        "it is the speed of the fence's tip, which a corner met short of it does not have",
    )


def judge_further(evidence: FurtherEvidence) -> list[Finding]:
    """Judge all of these statements."""
    rows = _free_end, _rigid_third, _paths, _restitution, _fall
    return [row(evidence) for row in rows]
