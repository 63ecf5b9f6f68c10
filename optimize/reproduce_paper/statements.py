"""The paper's statements, each with the number that decides it and the verdict."""

import dataclasses
from collections.abc import Callable

import numpy as np

from . import fences
from .case import lane
from .cycle import Cycle, contacts, first_and_last
from .maps import Maps

BELT_WIDTH = 0.7
VERDICTS = ("yes", "partly", "no")


@dataclasses.dataclass(frozen=True)
class Evidence:
    """The evidence for the statements. Cycles have one lane a fence, in the order of
    `fences.NAMES`; `stiff` is N_stiff [N] of the impact, of shape (fences,)."""

    impact: Cycle
    slide: Cycle
    stiff: np.ndarray
    maps: Maps


@dataclasses.dataclass(frozen=True)
class Finding:
    """One statement judged: `key` and `says`, the paper's statement in short; `found`, the result
    here; `verdict`, one of `VERDICTS`; `main`, the number that decides, with `unit`; `numbers`, all
    results [SI]; `remark`, the explanation where the verdict is not a plain yes."""

    key: str
    says: str
    found: str
    verdict: str
    main: float
    unit: str
    numbers: dict[str, float]
    remark: str
    contradicted: bool = False
    """Whether the model is known to contradict the statement, so that a "no" is expected."""


def pair(values, form: str, factor: float = 1.0) -> str:
    return " / ".join(format(factor * float(value), form) for value in values)


def named(name: str, values) -> dict[str, float]:
    return {f"{name}, {n}": float(v) for n, v in zip(fences.NAMES, values, strict=True)}


def verdict(holds: bool, nearly: bool = False) -> str:
    return "yes" if holds else "partly" if nearly else "no"


def _drop(evidence: Evidence) -> Finding:
    ratio = evidence.stiff / evidence.impact.peak_force
    # "Almost threefold" is a factor that rounds to 3; a larger drop exceeds the statement.
    holds = bool(np.all((ratio >= 2.5) & (ratio < 3.5)))
    return Finding(
        "drop",
        "impact near the tip: force falls almost threefold",
        f"N_stiff/N_max = {pair(ratio, '.2f')}",
        verdict(holds, bool(np.all(ratio >= 2.0))),
        float(ratio[0]),
        "1",
        named("N_stiff / N_max", ratio) | named("N_max", evidence.impact.peak_force),
        "the nearer the tip the parcel is met, the greater the drop, from 2.4 at R = 1.00 m to 3.3 "
        "at 1.10 m (3.5 if met at 2.42 m/s there), and the softer the fence, the greater; a parcel "
        "that is not turned is struck less hard at first, but turns until its other corner "
        "strikes, harder than the first",
    )


def _tip(evidence: Evidence) -> Finding:
    tip = evidence.impact.tip_deflection
    return Finding(
        "tip",
        "tip deflects by no more than about 0.08 m",
        f"{pair(tip, '.1f', 1e3)} mm",
        verdict(bool(np.all(tip < 0.085)), bool(np.all(tip < 0.1))),
        1e3 * float(tip[0]),
        "mm",
        named("tip deflection", tip),
        "the deflection follows from E and from where the parcel is met, which the paper leaves "
        "open",
    )


def static_time(cycle: Cycle) -> float:
    """Time [s] from the first contact of one lane until the belt's static friction gives way: until
    the load on the parcel exceeds mu_1s m_p g; NaN where it never does."""
    first, _ = first_and_last(cycle)
    load, time = np.asarray(cycle.load)[first:], np.asarray(cycle.time)[first:]
    over = np.flatnonzero(load > float(cycle.hold))
    if not over.size:
        return float("nan")
    at = int(over[0])
    if at == 0:
        return 0.0
    share = (float(cycle.hold) - load[at - 1]) / (load[at] - load[at - 1])
    return float(time[at - 1] + share * (time[at] - time[at - 1]) - cycle.first_contact)


def _static(evidence: Evidence) -> Finding:
    times = np.array([static_time(lane(evidence.impact, i)) for i in range(len(fences.NAMES))])
    return Finding(
        "static",
        "belt friction static for about 0.003 s of the impact",
        f"{pair(times, '.1f', 1e3)} ms",
        verdict(
            bool(np.all((times > 0.002) & (times < 0.004))),
            bool(np.all((times > 0.001) & (times < 0.006))),
        ),
        1e3 * float(times[0]),
        "ms",
        named("static friction", times),
        "it ends when force and moment on the parcel exceed what mu_1s m_p g holds; a corner that "
        "meets the fence off the centre of gravity loads the belt by a moment as well",
    )


def _steps(values: np.ndarray, sound: np.ndarray, axis: int) -> float:
    """Share of the steps along `axis`, between sound lanes, in which `values` rise [1]."""
    rise = np.diff(np.where(sound, values, np.nan), axis=axis)
    return float(np.mean(rise[np.isfinite(rise)] > 0))


def _ends(values: np.ndarray, sound: np.ndarray, axis: int) -> float:
    """Smallest ratio of the last to the first sound value along `axis` [1]."""
    rows = np.moveaxis(np.where(sound, values, np.nan), axis, -1).reshape(-1, values.shape[axis])
    kept = [row[np.isfinite(row)] for row in rows]
    return float(min(row[-1] / row[0] for row in kept if row.size > 1))


def largest_dip(values: np.ndarray, sound: np.ndarray, axis: int) -> float:
    """Largest share [1] by which sound values along `axis` fall below one before them."""
    rows = np.moveaxis(np.where(sound, values, np.nan), axis, -1).reshape(-1, values.shape[axis])
    kept = [row[np.isfinite(row)] for row in rows]
    return max(float(np.max(1 - row / np.maximum.accumulate(row))) for row in kept if row.size)


def _grows(evidence: Evidence, axis: int, key: str, says: str, remark: str) -> Finding:
    maps = evidence.maps
    # Away from the joint, about which there is another statement.
    away = maps.distances >= fences.JOINT + 0.2 * fences.FLEXIBLE - 1e-9
    sound = maps.sound[..., away]
    read = {"force": maps.ratio[..., away], "tip": maps.tip[..., away]}
    steps = {name: _steps(values, sound, axis) for name, values in read.items()}
    ends = {name: _ends(values, sound, axis) for name, values in read.items()}
    dip = largest_dip(maps.ratio, maps.sound, axis)
    holds = min(ends.values()) > 1 and min(steps.values()) >= 0.8 and dip <= 0.05
    return Finding(
        key,
        says,
        f"rises in {100 * steps['force']:.0f} % (force), {100 * steps['tip']:.0f} % (tip) of "
        f"steps; dips of {100 * dip:.0f} % at most",
        verdict(holds, float(np.mean(list(steps.values()))) > 0.5),
        100 * steps["force"],
        "%",
        {f"rising steps, {k}": v for k, v in steps.items()}
        | {f"smallest growth end to end, {k}": v for k, v in ends.items()}
        | {"largest dip, force, joint included": dip},
        remark,
    )


def _grows_with_mass(evidence: Evidence) -> Finding:
    return _grows(
        evidence,
        1,
        "mass",
        "effect grows with m_p (Figs. 9, 10)",
        "over the whole range of mass it grows at every R; dips lie where the first hump of the "
        "force gives way to the second, the fence's rebound, as the largest, the deepest of them "
        "near the joint, below R = 0.6 m",
    )


def _grows_with_distance(evidence: Evidence) -> Finding:
    return _grows(
        evidence,
        2,
        "R",
        "effect grows with R (Figs. 9, 10)",
        "over the whole range of R it grows at every mass; small dips lie where the first hump of "
        "the force gives way to the second, the fence's rebound, as the largest",
    )


def _joint(evidence: Evidence) -> Finding:
    maps = evidence.maps
    two, one = np.where(maps.sound, maps.ratio, np.nan)
    seen = np.isfinite(two).any(axis=0) & np.isfinite(one).any(axis=0)
    seen &= maps.distances <= 1.08 + 1e-9
    places = maps.distances[seen]
    loss = np.nanmean((1 - two / one)[:, seen], axis=0)
    worst = int(np.argmax(loss))
    middle = float(np.interp(fences.JOINT + fences.FLEXIBLE / 2, places, loss))
    near = abs(places[worst] - fences.JOINT) <= fences.FLEXIBLE / 4
    fades = loss[-1] < 0.5 * loss[worst]
    only = middle <= 0.5 * loss[worst]
    return Finding(
        "joint",
        "two-link fence loses some effect near the joint, and only there",
        f"{100 * loss[worst]:.0f} % less at R = {places[worst]:.2f} m, "
        f"{100 * loss[-1]:.0f} % at {places[-1]:.2f} m",
        verdict(bool(near and fades and only), bool(near and fades)),
        100 * float(loss[worst]),
        "%",
        {
            "largest loss against the one-link fence": float(loss[worst]),
            "largest loss at R": float(places[worst]),
            "loss in the middle of the flexible link": middle,
            "loss at the outermost R": float(loss[-1]),
        },
        "the loss of N_stiff/N_max against the one-link fence is largest just beyond the joint and "
        "nearly gone at the tip, but it fades over the whole flexible link instead of ending near "
        "the joint: the one-link fence bends from the hinge on, so that its lever is the longer "
        "one at every R",
    )


def _apart(cycle: Cycle) -> float:
    """Largest distance [m] between the two paths while both fences are in contact."""
    last = min(first_and_last(lane(cycle, i))[1] for i in range(len(fences.NAMES)))
    x, y = np.asarray(cycle.x)[:, : last + 1], np.asarray(cycle.y)[:, : last + 1]
    return float(np.max(np.hypot(x[0] - x[1], y[0] - y[1])))


def _difference(values) -> float:
    return float(np.ptp(values) / np.mean(values))


def _alike(cycle: Cycle, key: str, says: str, remark: str) -> Finding:
    force, apart = _difference(cycle.peak_force), _apart(cycle)
    tip = float(np.ptp(cycle.tip_deflection))
    return Finding(
        key,
        says,
        f"N_max {100 * force:.1f} %, tip {1e3 * tip:.1f} mm, paths {1e3 * apart:.0f} mm apart",
        verdict(force < 0.1 and tip < 0.008 and apart < 0.05, force < 0.2),
        100 * force,
        "%",
        {
            "difference of N_max": force,
            "difference of the tip deflection": tip,
            "largest distance of the paths": apart,
        }
        | named("N_max", cycle.peak_force),
        remark,
    )


def _alike_impact(evidence: Evidence) -> Finding:
    return _alike(
        evidence.impact,
        "alike, impact",
        "both fences nearly alike in the impact",
        "the two-link fence is the stiffer one except at the tip: nearly alike holds for impacts "
        "near it, and at R = 1.00 m the forces already differ by 16 %; a parcel that is not turned "
        "strikes again with its other corner, and that blow differs much more between the two",
    )


def _alike_slide(evidence: Evidence) -> Finding:
    return _alike(
        evidence.slide,
        "alike, slide",
        "both fences nearly alike in the slide",
        "the forces come near a difference of 10 % where the one-link fence, the softer one, "
        "yields most: a softer material, a parcel that is taken along later",
    )


def _pushes(cycle: Cycle) -> int:
    """Number of contacts of one lane in which the force gets above 1 % of N_max."""
    time, force = np.asarray(cycle.time), np.asarray(cycle.force)
    peaks = [np.max(force[(time >= a) & (time <= b)]) for a, b in contacts(cycle)]
    return sum(peak > 0.01 * np.max(force) for peak in peaks)


def _smooth(evidence: Evidence) -> Finding:
    pieces = [_pushes(lane(evidence.slide, i)) for i in range(len(fences.NAMES))]
    share = evidence.slide.peak_force / evidence.impact.peak_force
    return Finding(
        "smooth",
        "Delta s = 0: smooth, without an impact",
        f"{pieces[0]} / {pieces[1]} contact{'s' if max(pieces) > 1 else ''}, N_max "
        f"{pair(evidence.slide.peak_force, '.0f')} N",
        verdict(max(pieces) == 1 and bool(np.all(share < 0.4)), bool(np.all(share < 0.6))),
        float(evidence.slide.peak_force[0]),
        "N",
        named("N_max", evidence.slide.peak_force) | named("contacts", pieces),
        "where the contact breaks off, the parcel has a little way to catch up with the fence, and "
        "strikes it",
    )


def _outside(cycle: Cycle, key: str, says: str, remark: str) -> Finding:
    leave = []
    for index in range(len(fences.NAMES)):
        one = lane(cycle, index)
        leave.append(float(one.y[first_and_last(one)[1]]))
    beyond = np.array(leave) > BELT_WIDTH
    return Finding(
        key,
        says,
        f"y = {pair(leave, '.2f')} m",
        verdict(bool(np.all(beyond)), bool(np.any(beyond)) or min(leave) > BELT_WIDTH - 0.05),
        leave[0],
        "m",
        named("y of C_s at the last contact", leave)
        | named("y of C_s at the end of the cycle", np.asarray(cycle.y)[:, -1]),
        remark,
    )


def _outside_impact(evidence: Evidence) -> Finding:
    return _outside(
        evidence.impact,
        "ends, impact",
        "contact ends outside the belt (y > 0.7 m), impact",
        "a smaller parcel, or one met sooner or nearer to the hinge, is thrown off while its "
        "centre of gravity is still over the belt; it coasts over the edge by itself",
    )


def _outside_slide(evidence: Evidence) -> Finding:
    return _outside(
        evidence.slide,
        "ends, slide",
        "contact ends outside the belt (y > 0.7 m), slide",
        "where the parcel is let go follows from where the drive's law turns back",
    )


def ringing(cycle: Cycle) -> float:
    """Amplitude [m] of the tip's vibration in the last 0.08 s of the cycle, about two periods of
    the first mode, less the slow part that follows the drive (a straight line)."""
    time = np.asarray(cycle.time)
    late = time >= time[-1] - 0.08
    time, tip = time[late] - time[-1], np.asarray(cycle.deflection)[late]
    left = tip - np.polyval(np.polyfit(time, tip, 1), time)
    return float(np.ptp(left) / 2)


def _home(evidence: Evidence) -> Finding:
    left = np.array([ringing(lane(evidence.impact, i)) for i in range(len(fences.NAMES))])
    share = left / evidence.impact.tip_deflection
    return Finding(
        "ringing",
        "ringing is gone before the fence is home",
        f"{pair(share, '.2f', 100)} % of the deflection left",
        verdict(bool(np.all(share < 0.01)), bool(np.all(share < 0.05))),
        100 * float(share[0]),
        "%",
        named("vibration left", left) | named("share of the deflection", share),
        "the vibration decays by e in 1 / (zeta omega_1), 0.12 s at zeta = 0.05: with less damping "
        "more of it is left; a drive that jerks late on the way home excites it again",
    )


STATEMENTS: tuple[Callable[[Evidence], Finding], ...] = (
    _drop, _tip, _static, _grows_with_mass, _grows_with_distance, _joint, _alike_impact,
    _alike_slide, _smooth, _outside_impact, _outside_slide, _home,
)  # fmt: skip


def judge(evidence: Evidence) -> list[Finding]:
    """Every statement, in the paper's order."""
    return [statement(evidence) for statement in STATEMENTS]
