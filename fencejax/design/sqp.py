"""Sequential quadratic programming for a worst case under limits, in a trust region.

At a point, the worst case and the limits are replaced by their linear parts
(`fencejax.design.sqp_model`) and the curvature of the Lagrangian by a BFGS matrix B. The step is
judged by the worst case and nu times the largest violation, nu twice the multipliers' sum. One
evaluation is one step.

A step along a curved limit leaves it, and one along curved objectives raises another: rejected, it
is made once more with the limits and objectives as far off their linear parts as they were found to
be (the second-order correction of Fletcher 1982), and only then in a smaller region.

Peak forces have kinks, where another blow becomes the largest. There the linear part holds on one
side alone, and steps would shorten to nothing at what is no optimum. As bundle methods do (Kiwiel
1985), the program also takes in what other points said, where they lie on another branch; a
rejected step is then not lost. B takes a kink for a strong curvature, which is what makes BFGS go
along it (Lewis and Overton 2013). At an optimum on a kink the conditions of Karush, Kuhn and
Tucker hold for the slopes of points on all its sides.

A point that cannot be evaluated tells no slopes. Steps keep off the plane that separates the point
from all such points nearby, which turns into the wall's own as more of them are known. So they do
where the model does not hold (`Evaluation.doubtful`); but there slopes are told, from which B and
the branches of kinks learn.

Where no step is lower, the run starts again from there, with all it knew forgotten, as long as that
lowers the worst case; only where a kink is judged do all its points count. Where that does not help
either, points all around are evaluated, and the run starts again with the slopes that they tell:
gradient sampling (Burke, Lewis and Overton 2005), which finds the branches of a kink that steps
along one of them never meet. Where even that is in vain it is done again, from farther away.
"""

import dataclasses

import numpy as np

from .first_order import Evaluate
from .lagrangian import Evaluation, Multipliers, Residual, Vector, residual
from .sqp_model import LocalModel, span

# Where a run ends, or starts again: a radius or a step [in shares] so small that it changes a force
# by less than what a simulation leaves unbalanced; so many steps that together lower the merit by
# less than the tolerance; so many one after the other to points that could not be evaluated; so
# many that each lower it by little. These counts, and how many points' slopes are kept, decide when
# a search ends, not where: what it ends with is judged by the conditions of Karush, Kuhn and
# Tucker. The points kept are several times as many as there are variables, so that those on every
# side of a kink are among them.
_SMALLEST = 1e-9
_PATIENCE = 12
_BARREN = 30
_LITTLE = 8
_MANY = 60
# The first radius of a run and of one that starts again, the largest: in shares. Without shares the
# first is in lengths of the point.
_FIRST, _AGAIN, _LARGEST = 0.35, 0.1, 0.5
_BROAD = 0.3
# Points that tell the slopes of a kink's sides are this near, and so many are sampled; branches
# from farther away than so many steps are left out.
_BESIDE = 1e-2
_SAMPLES = 8
# So often points around are evaluated in vain before a run ends, each time twice as far away.
_ROUNDS = 4
_STALE = 30.0
# The first B is lowered by this at most: along a straight line nothing says how small it is to be.
_FLATTEST = 1e-4
# A corrected step that ends this near, in its lengths, to the one before says nothing new.
_ALIKE = 1e-9
# Of what a step can lower the violation by, it has to by this share, or the penalty is raised.
_STEERED = 0.5
# Of the length of a step to a point that could not be evaluated, the next radius: the plane before
# such points already bounds the next step, and points at one distance tell a wall's direction best.
# Those within so many radii are minded.
_SHRINK = 0.85
_MINDED = 8.0


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
    """The first B as small as what was met first, where that is less (Shanno and Phua 1978).

    Too small a B grows to what is met in one update, and the region bounds the steps till then; too
    large a one falls to no less than a fifth in each.
    """
    along = float(step @ curvature @ step)
    if along <= 1e-300:
        return curvature
    return curvature * min(max(float(step @ change) / along, _FLATTEST), 1.0)


class _Trail:
    """Worst case and violation over the last steps, to see that they hardly fall any more."""

    def __init__(self, tolerance: float):
        self._tolerance = tolerance
        self._steps: list[tuple[float, float]] = []

    def add(self, at: Evaluation, penalty: float) -> bool:
        """True where the last steps together lowered the merit by less than the tolerance."""
        self._steps.append((at.worst, at.violation))
        if len(self._steps) <= _PATIENCE:
            return False
        worst, violation = self._steps[-_PATIENCE - 1]
        gain = worst - at.worst + penalty * (violation - at.violation)
        return gain < self._tolerance * min(1.0, abs(at.worst))


@dataclasses.dataclass
class _Region:
    """What a run knows besides its point, and forgets when it starts again."""

    curvature: np.ndarray
    radius: float
    trail: _Trail
    seen: list[LocalModel]
    walls: list[Vector] = dataclasses.field(default_factory=list)
    reach: float = np.inf
    fresh: bool = True
    small: int = 0
    barren: int = 0
    before_walls: float = 0.0

    def walls_from(self, at: Vector) -> list[Vector]:
        """The steps to points nearby that could not be evaluated."""
        steps = [wall - at for wall in self.walls]
        return [step for step in steps if 0 < np.max(np.abs(step)) < _MINDED * self.radius]

    def blocked(self, wall: Vector, length: float) -> None:
        """A step of some length went to a point that could not be evaluated."""
        self.walls.append(wall)
        self.before_walls = max(self.before_walls, self.radius)
        self.radius = _SHRINK * length
        self.barren += 1

    def moved(self, little: bool) -> None:
        """A step was taken. What walls elsewhere took from the radius is given back: the steps
        themselves keep off the walls that are known."""
        self.radius, self.before_walls = max(self.radius, self.before_walls), 0.0
        self.reach, self.barren = np.inf, 0
        self.small = self.small + 1 if little else 0

    def learn(self, after: LocalModel, before: LocalModel, held: Multipliers) -> None:
        """Take an evaluation into B and the branches."""
        self.seen = [*self.seen[1 - _MANY :], after]
        step, change = after.at - before.at, after.slope(held) - before.slope(held)
        if self.fresh:
            self.curvature = _scaled(self.curvature, step, change)
        self.curvature, self.fresh = _bfgs(self.curvature, step, change), False

    def resize(self, share: float, length: float, kink: bool, largest: float) -> None:
        """A new radius after a step that brought a share of what was expected."""
        if share > 0.75 and length > 0.8 * self.radius:
            self.radius = min(2.0 * self.radius, largest)
        elif share < 0.1:
            # A step over a kink taught the other branch: the next one knows it.
            self.radius = (0.8 if kink else 0.4) * min(length, self.radius)

    @property
    def exhausted(self) -> bool:
        """Whether steps do not help any more."""
        return self.radius < _SMALLEST or self.small >= _LITTLE or self.barren >= _BARREN


@dataclasses.dataclass
class Sequence:
    """A run: what it is asked for, the penalty of the program, nu, the conditions as last seen,
    whether on a kink, and where, and what the points of all its descents told, by which kinks are
    judged."""

    bounded: bool
    tolerance: float
    feasibility: float
    penalty: float
    nu: float = 0.0
    left: Residual | None = None
    on_kink: bool = False
    judged: Evaluation | None = None
    told: list[LocalModel] = dataclasses.field(default_factory=list)

    def run(
        self, evaluate: Evaluate, at: Evaluation, held: Multipliers, latest: list[Multipliers]
    ) -> tuple[Evaluation, Multipliers, str]:
        """Step until the conditions of Karush, Kuhn and Tucker hold within the tolerance.

        Gives the last point, its multipliers and the outcome: `"optimal"`, `"spent"` where nothing
        more is evaluated, `"stalled"` where no step is lower, `"infeasible"` where the limits'
        violation cannot be lowered. `latest` holds the multipliers at hand; `left` is what is left
        of the conditions at the last point.
        """
        self.nu = self.penalty
        size = 1.0 if self.bounded else max(1.0, float(np.linalg.norm(at.point)))
        first, again = (_FIRST, _AGAIN) if self.bounded else (_BROAD * size, 0.25 * _BROAD * size)
        best, near, rounds = np.inf, [], 0
        random = np.random.default_rng(0)
        while True:
            at, held, end = self._descend(evaluate, at, held, latest, first, near)
            if self.judged is not at:
                balanced = self._optimal(at, held, LocalModel.of(at))
                if balanced is not None:
                    return at, balanced, "optimal"
            merit = self._merit(at)
            # Of the worst case as it is, which may be a small part of the one at the start.
            lower = merit <= best - self.tolerance * min(1.0, abs(best))
            rounds = 0 if lower else rounds + 1
            if end != "stalled" or rounds > _ROUNDS:
                return at, held, end
            near = self._around(evaluate, at, random, 2.0 ** (rounds - 1)) if rounds else []
            best, first = min(best, merit), again

    def _around(
        self, evaluate: Evaluate, at: Evaluation, random: np.random.Generator, far: float
    ) -> list[LocalModel]:
        """What points all around tell, `far` times half as far away as those that count for a
        kink's sides."""
        found = []
        for side in random.uniform(-1, 1, (_SAMPLES, at.point.size)):
            trial = evaluate(self._moved(at.point, 0.5 * _BESIDE * far * side))
            if trial is None:
                break
            if not trial.failed:
                found.append(LocalModel.of(trial))
        self.told = [*self.told, *found][-_MANY:]
        return found

    def _descend(
        self, evaluate: Evaluate, at: Evaluation, held: Multipliers, latest, radius: float,
        near: list[LocalModel],
    ) -> tuple[Evaluation, Multipliers, str]:
        """Step until there is a reason to stop."""
        largest = _LARGEST if self.bounded else 1e3
        model, tried, promised = LocalModel.of(at), None, 0.0
        region = _Region(np.eye(at.point.size), radius, _Trail(self.tolerance), [*near, model])
        while not region.exhausted:
            whole = model.with_branches(region.seen, min(region.reach, 2 * region.radius))
            if tried is not None:
                whole = whole.bent_by(*model.bend_to(tried))
            walls = region.walls_from(model.at)
            solved = self._solved(whole, region, walls)
            if solved is None:
                if region.fresh:
                    return at, held, "stalled"
                region.curvature, region.fresh = np.eye(at.point.size), True
                continue
            step, rows = solved
            new = whole.gathered(rows)
            if self._too_weak(whole, step, new, region, walls):
                continue
            held = latest[0] = new
            # Multipliers that fall let steps along curved limits be longer.
            needed = 2 * float(np.sum(new.margins)) + 0.1
            self.nu = min(max(needed, 0.5 * (self.nu + needed)), self.penalty)
            balanced = self._optimal(at, held, model)
            if balanced is not None:
                return at, balanced, "optimal"
            length, far = float(np.max(np.abs(step))), whole.farthest(rows)
            merit = self._merit(at)
            gain = merit - whole.after(step, region.curvature, self.nu)
            if tried is not None:
                gain = promised
            none = gain <= 1e-14 * max(1.0, abs(merit)) or length < _SMALLEST
            if far > _STALE * length or (none and whole.widest > 0):
                # What was said far away forbids what is allowed here.
                region.reach = 0.3 * (far or whole.widest)
                region.radius = min(region.radius, region.reach)
                continue
            if none:
                stuck = at.violation > self.feasibility and self.penalty >= 1e5
                return at, held, "infeasible" if stuck else "stalled"
            point = self._moved(model.at, step)
            if tried is not None and np.max(np.abs(point - tried.at)) < _ALIKE * length:
                region.resize(0.0, length, False, largest)
                tried = None
                continue
            trial = evaluate(point)
            if trial is None:
                return at, held, "spent"
            if trial.failed:
                tried = None
                if trial.doubtful:
                    region.learn(LocalModel.of(trial), model, held)
                region.blocked(model.at + step, length)
                continue
            after = LocalModel.of(trial)
            region.learn(after, model, held)
            self.told = [*self.told[1 - _MANY :], after]
            reached = merit - self._merit(trial)
            kink = not after.smooth_to(model, held)
            region.barren += 1
            if reached <= 1e-4 * gain and tried is None and not kink:
                tried, promised = after, gain
                continue
            length = float(np.max(np.abs(after.at - model.at)))
            region.resize(reached / gain, length, kink, largest)
            tried = None
            if reached > 1e-4 * gain:
                at, model = trial, after
                region.moved(reached < 1e-2 * self.tolerance * max(1.0, merit))
            if region.trail.add(at, self.nu):
                break
        return at, held, "stalled"

    def _solved(self, whole: LocalModel, region: _Region, walls: list[Vector]):
        """The step of the program, and the multipliers of its rows."""
        within = span(whole.at, region.radius, self.bounded)
        solved = whole.step(region.curvature, self.penalty, within, walls)
        if solved is None:
            return None
        # The program is solved to a share of the region: a step that is short beside it is told
        # exactly by a region of its own size.
        short = 10 * float(np.max(np.abs(solved[0])))
        if _SMALLEST < short < 0.5 * region.radius:
            within = span(whole.at, short, self.bounded)
            again = whole.step(region.curvature, self.penalty, within, walls)
            return solved if again is None else (again[0], solved[1])
        return solved

    def _moved(self, at: Vector, step: Vector) -> Vector:
        """The point after a step, on a bound where the rest is less than any step."""
        if not self.bounded:
            return at + step
        moved = np.clip(at + step, 0.0, 1.0)
        bound = np.round(moved)
        return np.where(np.abs(moved - bound) < _SMALLEST, bound, moved)

    def _merit(self, at: Evaluation) -> float:
        return at.worst + self.nu * at.violation if not at.failed else np.inf

    def _too_weak(
        self, whole: LocalModel, step: Vector, held: Multipliers, region: _Region, walls
    ) -> bool:
        """Raise the penalty where it does not outweigh the multipliers; true where the step has to
        be made again with the higher one.

        Where the multipliers are at the penalty's cap, limits stay broken. That may be all that a
        step within the region can do: the step is judged by what a far higher penalty would have it
        do (Byrd, Nocedal and Waltz 2008).
        """
        total = float(np.sum(held.margins))
        left, now = whole.violation(step), whole.violation(0 * step)
        if total < 0.99 * self.penalty or left <= self.feasibility:
            self.penalty = min(max(self.penalty, 1.5 * total), 1e6)
            return False
        if self.penalty >= 1e5:
            return False
        within = span(whole.at, region.radius, self.bounded)
        eager = whole.step(region.curvature, 1e3 * self.penalty, within, walls)
        if eager is None or now - left >= _STEERED * (now - whole.violation(eager[0])):
            return False
        self.penalty *= 10
        return True

    def _optimal(self, at: Evaluation, held: Multipliers, model: LocalModel) -> Multipliers | None:
        """The multipliers with which the conditions hold, at the point or on the sides of its
        kink; `None` where they do not."""
        self.left, self.judged, self.on_kink = residual(at, held, self.bounded), at, False
        beside = model.with_branches(self.told, _BESIDE)
        if max(self.left[:2]) > self.tolerance and beside.widest > 0:
            rows = beside.balanced(self.bounded, self.tolerance)
            left = beside.residual(rows, at.violation, self.bounded)
            if max(left[:2]) < max(self.left[:2]):
                self.left, self.on_kink, held = left, True, beside.gathered(rows)
        within = max(self.left[:2]) <= self.tolerance and at.violation <= self.feasibility
        return held if within else None
