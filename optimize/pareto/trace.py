"""The front, point by point: the least worst peak force with the other quantity's limit stepped.

The epsilon-constraint method (Haimes, Lasdon and Wismer, 1971): for each bound of the other
quantity minimise the peak force. Each point starts from its neighbour's design and multipliers,
and further bounds fill the widest gaps of the front. One compiled program serves all points.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

import fencejax as fj
from fencejax.design import (
    Journal,
    Multipliers,
    Optimum,
    Record,
    Stop,
    Verification,
    minimize,
    minimize_many,
    verify,
)

from ..common.starts import best, spread
from .problem import FORCE, OTHER, Measured, Tradeoff


@dataclasses.dataclass(frozen=True)
class Point:
    """A point of the front: the bound, the optimum for it, and the measured numbers at the
    optimiser's fidelity and, optionally, at a finer one."""

    bound: float
    optimum: Optimum
    values: np.ndarray
    found: Measured
    verified: Verification | None
    finer: Measured | None

    @property
    def force(self) -> float:
        """The worst peak force [N]."""
        return self.found.force

    @property
    def other(self) -> float:
        """The other quantity."""
        return self.found.other

    @property
    def sound(self) -> bool:
        """Whether it is feasible, its search ended (at the conditions of Karush, Kuhn and Tucker,
        or without finding a lower point), and the finer fidelity does not contradict it."""
        confirmed = self.verified is None or self.verified.confirmed
        ended = self.optimum.stop in (Stop.OPTIMAL, Stop.STAGNATED)
        return self.optimum.feasible and ended and confirmed


class Tracer:
    """Traces the front of a trade-off; every evaluation goes through the journal."""

    def __init__(
        self,
        tradeoff: Tradeoff,
        journal: Journal | None,
        say: Callable[..., None],
        keep: Callable[[list[Point]], None],
    ):
        self.tradeoff, self.config, self.journal = tradeoff, tradeoff.config, journal
        self.say, self.keep = say, keep
        self.points: list[Point] = []
        self.evaluations = 0
        self.unit, self.scale = 1.0, 1.0
        self.start: Measured
        self.ends: tuple[Optimum, Optimum]

    def run(self) -> list[Point]:
        """The points, by falling bound."""
        self.start = self.tradeoff.measure(self.config.fidelity, self.tradeoff.start)
        self.unit, self.scale = self.start.other, self.start.force
        first, least = self.ends = self._ends()
        high, low = self._other(first), self._other(least)
        self._add(high, first)
        if high - low <= 1e-3 * abs(high) or not (first.feasible and least.feasible):
            return self.points
        # A little above the least value of the other quantity, so that the force can vary.
        low = low + 0.02 * (high - low)
        if self.config.together:
            self._together(_spaced(high, low, self.config.points)[1:], (first, least))
        else:
            for bound in _spaced(high, low, max(3, self.config.points // 2))[1:]:
                self._solve(bound, self.points[-1].optimum)
            while len(self.points) < self.config.points:
                self._fill()
        return self.points

    def _ends(self) -> tuple[Optimum, Optimum]:
        """The optima of least force, from several starts, and of the least other quantity."""
        starts = spread(self.tradeoff.start, self.config.starts)
        self.say(f"least force, {len(starts)} starts; compiling (minutes, the first time) ...")
        if len(starts) == 1:
            tried = [self._minimize(starts[0], FORCE, self.tradeoff.loose, None)]
        else:
            tried = self._many(starts, [self.tradeoff.loose] * len(starts))
        least = best(tried)
        self.say(f"least {self.tradeoff.quantity.name.replace('_', ' ')}")
        return least, self._minimize(least.point, OTHER, self.tradeoff.loose, None)

    def _data(self, minimised: float, bound: float):
        numbers = (np.asarray(x, dtype=float) for x in (minimised, bound, self.unit))
        return self.tradeoff.encounters, *numbers

    @property
    def _settings(self) -> dict[str, Any]:
        config = self.config
        return dict(
            tolerance=config.tolerance,
            feasibility=config.feasibility,
            budget=config.budget,
        )

    def _line(self, record: Record) -> None:
        self.evaluations += 1
        if record.failed:
            self.say(f"  {record.evaluation:3d}  failed: {fj.Status(record.status).text}")

    def _minimize(self, start, minimised, bound, multipliers) -> Optimum:
        return minimize(
            self.tradeoff.program,
            start,
            data=self._data(minimised, bound),
            multipliers=multipliers,
            scale=self.scale if minimised == FORCE else self.unit,
            journal=self.journal,
            progress=self._line,
            **self._settings,
        )

    def _many(self, starts, bounds) -> list[Optimum]:
        return minimize_many(
            self.tradeoff.program,
            starts,
            data=[self._data(FORCE, bound) for bound in bounds],
            width=self.config.width,
            scale=self.scale,
            journal=self.journal,
            progress=lambda run, record: self._line(record),
            **self._settings,
        )

    def _other(self, optimum: Optimum) -> float:
        return self.tradeoff.measure(self.config.fidelity, optimum.point).other

    def _solve(self, bound: float, near: Optimum) -> None:
        multipliers = Multipliers(near.weights, near.multipliers)
        self._add(bound, self._minimize(near.point, FORCE, bound, multipliers))

    def _together(self, bounds, ends) -> None:
        first, least = (o.point for o in ends)
        shares = np.linspace(0, 1, len(bounds) + 1)[1:, None]
        starts = (1 - shares) * first + shares * least
        for bound, optimum in zip(bounds, self._many(starts, bounds), strict=True):
            self._add(bound, optimum)

    def _fill(self) -> None:
        """One more point, in the widest gap of the front; forces are compared as logarithms."""
        self.points.sort(key=lambda p: -p.bound)
        force = np.log([p.force for p in self.points])
        bound = np.array([p.bound for p in self.points])
        spans = [max(np.ptp(x), 1e-12) for x in (force, bound)]
        wide = np.hypot(np.diff(force) / spans[0], np.diff(bound) / spans[1])
        at = int(np.argmax(wide))
        # The design of the tighter bound is feasible for the new one, too.
        self._solve(0.5 * (bound[at] + bound[at + 1]), self.points[at + 1].optimum)

    def _add(self, bound: float, optimum: Optimum) -> None:
        tradeoff, config = self.tradeoff, self.config
        # At the rungs of the search, which computes lanes once in doubt finer from then on.
        found = tradeoff.measure(config.fidelity, optimum.point, optimum.last.rungs)
        finer, verified = None, None
        if config.verify != "none":
            finer = tradeoff.measure(config.verify, optimum.point)
            own = finer
            # The measured bound: a difference between the fidelities is no violation.
            data = self._data(FORCE, max(bound, finer.other))
            verified = verify(
                lambda z, encounters, *data: tradeoff.judged(own, *data),
                optimum,
                data=data,
                agreement=config.agreement,
                feasibility=config.feasibility,
            )
        values = np.asarray(tradeoff.space.from_shares(optimum.point))
        self.points.append(Point(bound, optimum, values, found, verified, finer))
        self.say(self._point_line(self.points[-1]))
        self.keep(self.points)

    def _point_line(self, point: Point) -> str:
        quantity = self.tradeoff.quantity
        text = (
            f"{len(self.points):3d}  {quantity.name.replace('_', ' ')} {point.other:9.5g} "
            f"{quantity.unit}  peak force {point.force:8.2f} N  "
            f"({len(point.optimum.history)} evaluations, {point.optimum.stop.name.lower()}"
        )
        if not point.optimum.feasible:
            text += f", violation {point.optimum.residual.violation:.1e}"
        if point.verified is not None:
            text += f", error {100 * point.verified.error:+.2f} %"
            text += "" if point.verified.confirmed else f", {point.verified.text}"
        return text + ")"


def _spaced(high: float, low: float, count: int) -> np.ndarray:
    """Falling bounds, evenly spaced; by ratio where they span more than a factor of five."""
    if low > 0 and high / low > 5:
        return np.geomspace(high, low, count)
    return np.linspace(high, low, count)
