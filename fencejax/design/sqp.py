"""Sequential quadratic programming for a worst case under limits, in a trust region.

At each point the method linearises the worst case and the limits (`fencejax.design.sqp_model`) and
replaces the curvature of the Lagrangian by a BFGS matrix B. It judges a step by the merit function:
the worst case plus nu times the largest violation, with nu twice the sum of the multipliers. One
evaluation is one step.

Along a curved limit a step ends off the limit, and along curved objectives another objective grows.
Such a step is rejected and computed once more, with the linearisation errors that it found added to
the limits and objectives (the second-order correction of Fletcher 1982). Only if that fails, too,
does the trust region shrink.

Peak forces have kinks, where another blow becomes the largest. There a linearisation holds on one
side alone, and steps would shorten to nothing at a point that is no optimum. As in bundle methods
(Kiwiel 1985), the program therefore also contains the linearisations of other points, where they
lie on another branch, so that a rejected step still adds information. B sees a kink as a strong
curvature, which makes BFGS follow it (Lewis and Overton 2013). At an optimum on a kink the
conditions of Karush, Kuhn and Tucker hold with the slopes of points on all of its sides.

A point that cannot be evaluated has no slopes. Steps stay in front of the plane that separates the
present point from all such points nearby; with more of these points, called walls here, the plane
approaches the border of the region that can be evaluated. Points at which the model does not hold
(`Evaluation.doubtful`) count as walls, too; but they have slopes, which update B and the branches.

Where no step lowers the merit, the run restarts from its last point with a new B and without
branches, as long as that lowers the worst case; the points of all descents count only where a kink
is judged. Where a restart does not help, points all around are evaluated, and the next descent
starts with their slopes: gradient sampling (Burke, Lewis and Overton 2005). It finds branches of a
kink that steps along one of them never reach. If that fails, too, it is repeated from farther away.
"""

import dataclasses

import numpy as np

from .first_order import Evaluate
from .lagrangian import Evaluation, Multipliers, Residual, Vector, residual
from .sqp_model import LocalModel, span

# A descent ends where the radius or a step [in shares] falls below _SMALLEST, where a force changes
# by less than the imbalance that a simulation leaves; after _TRAIL steps that together lower the
# merit by less than the tolerance; after _MOST_REJECTED evaluations in a row without an accepted
# step; or after _MOST_SMALL accepted steps in a row with a small gain. These counts, and the number
# _MOST_MODELS of linearisations kept, decide when a search ends, not where: its result is judged by
# the conditions of Karush, Kuhn and Tucker. _MOST_MODELS is several times the number of variables,
# so that points on every side of a kink are among them.
_SMALLEST = 1e-9
_TRAIL = 12
_MOST_REJECTED = 30
_MOST_SMALL = 8
_MOST_MODELS = 60
# The radius of the first descent, of a restart, and the largest one, in shares. Without bounds the
# first radius is this share of the point's length.
_FIRST_RADIUS, _RESTART_RADIUS, _LARGEST_RADIUS = 0.35, 0.1, 0.5
_FIRST_UNBOUNDED = 0.3
# Points within this distance count for the sides of a kink, and so many are sampled.
_KINK_DISTANCE = 1e-2
_SAMPLES = 8
# So many rounds of sampling without gain end a run, each twice as far away as the one before.
_ROUNDS = 4
# Branches from farther away than so many step lengths are left out.
_FARTHEST_BRANCH = 30.0
# The first B is lowered to this share at most: along a straight line its size is undetermined.
_LEAST_SCALING = 1e-4
# A corrected step that ends this near the one before, in step lengths, is not evaluated.
_SAME_POINT = 1e-9
# A step has to reach this share of the largest possible decrease of the violation, or the penalty
# is raised.
_LEAST_DECREASE = 0.5
# The next radius after a point that could not be evaluated, as a share of the step's length: the
# plane in front of the walls already bounds the next step, and walls at similar distances define
# the plane's direction best. Walls within so many radii count.
_SHRINK = 0.85
_WALL_RADII = 8.0


def _bfgs(curvature, step: Vector, change: Vector):
    """Powell's damped update: B stays positive definite."""
    pressed = curvature @ step
    along = float(step @ pressed)
    if along <= 1e-300:
        return curvature
    inner = float(step @ change)
    if inner < 0.2 * along:
        share = 0.8 * along / (along - inner)
        change = share * change + (1 - share) * pressed
        inner = float(step @ change)
    return curvature - np.outer(pressed, pressed) / along + np.outer(change, change) / inner


def _scaled(curvature, step: Vector, change: Vector):
    """The first B scaled down to the curvature of the first step, where that is less (Shanno and
    Phua 1978).

    A B that is too small grows to the right curvature in one update, and the trust region bounds
    the steps until then; one that is too large falls to no less than a fifth in each update.
    """
    along = float(step @ curvature @ step)
    if along <= 1e-300:
        return curvature
    return curvature * min(max(float(step @ change) / along, _LEAST_SCALING), 1.0)


class _Trail:
    """Worst case and violation over the last steps: shows whether they still fall."""

    def __init__(self, tolerance: float):
        self._tolerance = tolerance
        self._steps: list[tuple[float, float]] = []

    def add(self, at: Evaluation, penalty: float) -> bool:
        """True where the last steps together lowered the merit by less than the tolerance."""
        self._steps.append((at.worst, at.violation))
        if len(self._steps) <= _TRAIL:
            return False
        worst, violation = self._steps[-_TRAIL - 1]
        gain = worst - at.worst + penalty * (violation - at.violation)
        return gain < self._tolerance * min(1.0, abs(at.worst))


@dataclasses.dataclass
class _Region:
    """The state of one descent besides its point, new at every restart.

    `curvature`: B. `models`: the linearisations of the points evaluated. `walls`: points that could
    not be evaluated, and `radius_before_walls`, the radius before the first of them. `reach`: how
    far away a point may be whose branches count. `fresh`: whether B is still the first one.
    `small`, `rejected`: accepted steps with a small gain, and evaluations without an accepted
    step, in a row.
    """

    curvature: np.ndarray
    radius: float
    trail: _Trail
    models: list[LocalModel]
    walls: list[Vector] = dataclasses.field(default_factory=list)
    reach: float = np.inf
    fresh: bool = True
    small: int = 0
    rejected: int = 0
    radius_before_walls: float = 0.0

    def walls_from(self, at: Vector) -> list[Vector]:
        """The steps to points nearby that could not be evaluated."""
        steps = [wall - at for wall in self.walls]
        return [step for step in steps if 0 < np.max(np.abs(step)) < _WALL_RADII * self.radius]

    def blocked(self, wall: Vector, length: float) -> None:
        """A step of some length ended at a point that could not be evaluated."""
        self.walls.append(wall)
        self.radius_before_walls = max(self.radius_before_walls, self.radius)
        self.radius = _SHRINK * length
        self.rejected += 1

    def moved(self, little: bool) -> None:
        """A step was accepted. The radius returns to its value before the walls: the steps
        themselves stay in front of the known walls."""
        self.radius, self.radius_before_walls = max(self.radius, self.radius_before_walls), 0.0
        self.reach, self.rejected = np.inf, 0
        self.small = self.small + 1 if little else 0

    def learn(self, after: LocalModel, before: LocalModel, multipliers: Multipliers) -> None:
        """Update B and the branches with an evaluation."""
        self.models = [*self.models[1 - _MOST_MODELS :], after]
        step, change = after.at - before.at, after.slope(multipliers) - before.slope(multipliers)
        if self.fresh:
            self.curvature = _scaled(self.curvature, step, change)
        self.curvature, self.fresh = _bfgs(self.curvature, step, change), False

    def resize(self, share: float, length: float, kink: bool, largest: float) -> None:
        """A new radius after a step with a share of the expected gain."""
        if share > 0.75 and length > 0.8 * self.radius:
            self.radius = min(2.0 * self.radius, largest)
        elif share < 0.1:
            # A step over a kink has added the other branch to the next program.
            self.radius = (0.8 if kink else 0.4) * min(length, self.radius)

    @property
    def exhausted(self) -> bool:
        """Whether further steps are useless."""
        many = self.small >= _MOST_SMALL or self.rejected >= _MOST_REJECTED
        return self.radius < _SMALLEST or many


@dataclasses.dataclass
class Sequence:
    """A run.

    `bounded`, `tolerance`, `feasibility`: as in `minimize`. `penalty`: of the quadratic program.
    `nu`: of the merit function. `left`, `on_kink`: the last residual, whether it counts the slopes
    on the sides of a kink, and `judged`, the evaluation it is of. `models`: linearisations of all
    descents, with which kinks are judged.
    """

    bounded: bool
    tolerance: float
    feasibility: float
    penalty: float
    nu: float = 0.0
    left: Residual | None = None
    on_kink: bool = False
    judged: Evaluation | None = None
    models: list[LocalModel] = dataclasses.field(default_factory=list)

    def run(
        self, evaluate: Evaluate, at: Evaluation, multipliers: Multipliers,
        latest: list[Multipliers],
    ) -> tuple[Evaluation, Multipliers, str]:
        """Step until the conditions of Karush, Kuhn and Tucker hold within the tolerance.

        Returns the last point, its multipliers and the outcome: `"optimal"`, `"spent"` where
        `evaluate` returns `None`, `"stalled"` where no step lowers the merit, `"infeasible"` where
        the violation of the limits cannot be lowered. The one entry of `latest` is kept at the
        present multipliers; `left` is the residual at the last point.
        """
        self.nu = self.penalty
        size = 1.0 if self.bounded else max(1.0, float(np.linalg.norm(at.point)))
        first, again = _FIRST_RADIUS, _RESTART_RADIUS
        if not self.bounded:
            first, again = _FIRST_UNBOUNDED * size, 0.25 * _FIRST_UNBOUNDED * size
        best, sampled, rounds = np.inf, [], 0
        random = np.random.default_rng(0)
        while True:
            at, multipliers, end = self._descend(evaluate, at, multipliers, latest, first, sampled)
            if self.judged is not at:
                balanced = self._optimal(at, multipliers, LocalModel.of(at))
                if balanced is not None:
                    return at, balanced, "optimal"
            merit = self._merit(at)
            # Relative to the present worst case, which may be far below the one at the start.
            lower = merit <= best - self.tolerance * min(1.0, abs(best))
            rounds = 0 if lower else rounds + 1
            if end != "stalled" or rounds > _ROUNDS:
                return at, multipliers, end
            sampled = self._sampled(evaluate, at, random, 2.0 ** (rounds - 1)) if rounds else []
            best, first = min(best, merit), again

    def _sampled(
        self, evaluate: Evaluate, at: Evaluation, random: np.random.Generator, far: float
    ) -> list[LocalModel]:
        """Linearisations at sampled points all around, within `far` times half the distance
        at which points count for the sides of a kink."""
        found = []
        for side in random.uniform(-1, 1, (_SAMPLES, at.point.size)):
            trial = evaluate(self._moved(at.point, 0.5 * _KINK_DISTANCE * far * side))
            if trial is None:
                break
            if not trial.failed:
                found.append(LocalModel.of(trial))
        self.models = [*self.models, *found][-_MOST_MODELS:]
        return found

    def _descend(
        self, evaluate: Evaluate, at: Evaluation, multipliers: Multipliers, latest, radius: float,
        sampled: list[LocalModel],
    ) -> tuple[Evaluation, Multipliers, str]:
        """One descent: steps until one of the reasons to stop."""
        largest = _LARGEST_RADIUS if self.bounded else 1e3
        model, rejected, expected_gain = LocalModel.of(at), None, 0.0
        region = _Region(np.eye(at.point.size), radius, _Trail(self.tolerance), [*sampled, model])
        while not region.exhausted:
            whole = model.with_branches(region.models, min(region.reach, 2 * region.radius))
            if rejected is not None:
                whole = whole.shifted(*model.linear_errors(rejected))
            walls = region.walls_from(model.at)
            solved = self._solved(whole, region, walls)
            if solved is None:
                if region.fresh:
                    return at, multipliers, "stalled"
                region.curvature, region.fresh = np.eye(at.point.size), True
                continue
            step, rows = solved
            new = whole.gathered(rows)
            if self._too_weak(whole, step, new, region, walls):
                continue
            multipliers = latest[0] = new
            # Where multipliers fall, a smaller nu allows longer steps along curved limits.
            needed = 2 * float(np.sum(new.margins)) + 0.1
            self.nu = min(max(needed, 0.5 * (self.nu + needed)), self.penalty)
            balanced = self._optimal(at, multipliers, model)
            if balanced is not None:
                return at, balanced, "optimal"
            length, far = float(np.max(np.abs(step))), whole.farthest(rows)
            merit = self._merit(at)
            gain = merit - whole.after(step, region.curvature, self.nu)
            if rejected is not None:
                gain = expected_gain
            no_gain = gain <= 1e-14 * max(1.0, abs(merit)) or length < _SMALLEST
            if far > _FARTHEST_BRANCH * length or (no_gain and whole.widest > 0):
                # Branches of far points exclude steps that are feasible here: leave them out.
                region.reach = 0.3 * (far or whole.widest)
                region.radius = min(region.radius, region.reach)
                continue
            if no_gain:
                stuck = at.violation > self.feasibility and self.penalty >= 1e5
                return at, multipliers, "infeasible" if stuck else "stalled"
            point = self._moved(model.at, step)
            if (
                rejected is not None
                and np.max(np.abs(point - rejected.at)) < _SAME_POINT * length
            ):
                region.resize(0.0, length, False, largest)
                rejected = None
                continue
            trial = evaluate(point)
            if trial is None:
                return at, multipliers, "spent"
            if trial.failed:
                rejected = None
                if trial.doubtful:
                    region.learn(LocalModel.of(trial), model, multipliers)
                region.blocked(model.at + step, length)
                continue
            after = LocalModel.of(trial)
            region.learn(after, model, multipliers)
            self.models = [*self.models[1 - _MOST_MODELS :], after]
            reached = merit - self._merit(trial)
            kink = not after.smooth_to(model, multipliers)
            region.rejected += 1
            if reached <= 1e-4 * gain and rejected is None and not kink:
                rejected, expected_gain = after, gain
                continue
            length = float(np.max(np.abs(after.at - model.at)))
            region.resize(reached / gain, length, kink, largest)
            rejected = None
            if reached > 1e-4 * gain:
                at, model = trial, after
                region.moved(reached < 1e-2 * self.tolerance * max(1.0, merit))
            if region.trail.add(at, self.nu):
                break
        return at, multipliers, "stalled"

    def _solved(self, whole: LocalModel, region: _Region, walls: list[Vector]):
        """The step that solves the program, and the multipliers of its rows."""
        within = span(whole.at, region.radius, self.bounded)
        solved = whole.step(region.curvature, self.penalty, within, walls)
        if solved is None:
            return None
        # The program is solved to an accuracy relative to the region: a short step is exact only
        # in a region of its own size.
        short = 10 * float(np.max(np.abs(solved[0])))
        if _SMALLEST < short < 0.5 * region.radius:
            within = span(whole.at, short, self.bounded)
            again = whole.step(region.curvature, self.penalty, within, walls)
            return solved if again is None else (again[0], solved[1])
        return solved

    def _moved(self, at: Vector, step: Vector) -> Vector:
        """The point after a step, put on a bound where it is nearer than the smallest step."""
        if not self.bounded:
            return at + step
        moved = np.clip(at + step, 0.0, 1.0)
        bound = np.round(moved)
        return np.where(np.abs(moved - bound) < _SMALLEST, bound, moved)

    def _merit(self, at: Evaluation) -> float:
        return at.worst + self.nu * at.violation if not at.failed else np.inf

    def _too_weak(
        self, whole: LocalModel, step: Vector, multipliers: Multipliers, region: _Region, walls
    ) -> bool:
        """Raise the penalty where it does not outweigh the multipliers; true where the step has to
        be computed again with the higher penalty.

        Where the multipliers' sum equals the penalty, the step leaves limits broken. No step within
        the region may do better: the step is compared with that of a far higher penalty (Byrd,
        Nocedal and Waltz 2008).
        """
        total = float(np.sum(multipliers.margins))
        left, now = whole.violation(step), whole.violation(0 * step)
        if total < 0.99 * self.penalty or left <= self.feasibility:
            self.penalty = min(max(self.penalty, 1.5 * total), 1e6)
            return False
        if self.penalty >= 1e5:
            return False
        within = span(whole.at, region.radius, self.bounded)
        eager = whole.step(region.curvature, 1e3 * self.penalty, within, walls)
        if eager is None or now - left >= _LEAST_DECREASE * (now - whole.violation(eager[0])):
            return False
        self.penalty *= 10
        return True

    def _optimal(
        self, at: Evaluation, multipliers: Multipliers, model: LocalModel
    ) -> Multipliers | None:
        """The multipliers with which the conditions hold, at the point or on the sides of its
        kink; `None` where they do not."""
        self.left, self.judged, self.on_kink = residual(at, multipliers, self.bounded), at, False
        beside = model.with_branches(self.models, _KINK_DISTANCE)
        if max(self.left[:2]) > self.tolerance and beside.widest > 0:
            rows = beside.balanced(self.bounded, self.tolerance)
            left = beside.residual(rows, at.violation, self.bounded)
            if max(left[:2]) < max(self.left[:2]):
                self.left, self.on_kink, multipliers = left, True, beside.gathered(rows)
        within = max(self.left[:2]) <= self.tolerance and at.violation <= self.feasibility
        return multipliers if within else None
