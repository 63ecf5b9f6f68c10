"""A search from several starts, as each may end in another local optimum."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import qmc

from fencejax.design import Optimum

# A design that breaks limits by no more than this share counts for how promising a search is.
_NEARLY = 0.01


def spread(start: np.ndarray, count: int, vary: Sequence[int] | None = None) -> np.ndarray:
    """`count` starts in shares, shape (count, n): the given one, then others by a Sobol' sequence
    within the inner 80 % of the bounds, in all variables or in those that `vary` names."""
    columns = list(range(start.size) if vary is None else vary)
    starts = np.tile(start, (count, 1))
    if count > 1 and columns:
        engine = qmc.Sobol(len(columns), rng=0)
        shares = engine.random_base2(int(np.ceil(np.log2(count + 1))))[1:count]
        starts[1:, columns] = 0.1 + 0.8 * shares
    return starts


def best(tried: Sequence[Optimum]) -> Optimum:
    """The lowest of the feasible ones; where there is none, the one with the smallest violation."""
    feasible = [optimum for optimum in tried if optimum.feasible]
    if feasible:
        return min(feasible, key=lambda o: o.objective)
    return min(tried, key=lambda o: (o.residual.violation, o.objective))


def lowest(tried: Optimum) -> float:
    """The lowest objective that a search met with all limits (nearly) met; infinite without one."""
    met = [r.objective for r in tried.history if not r.failed and r.violation <= _NEARLY]
    return min(met, default=np.inf)


def scouted(
    search: Callable[[np.ndarray, int], Optimum], starts: np.ndarray, budget: int
) -> tuple[list[Optimum], int]:
    """The results of short searches of `budget` evaluations, and the index of the most promising
    start: the one that met the lowest objective, or else the smallest violation."""
    tried = [search(start, budget) for start in starts]
    order = [(lowest(one), one.residual.violation, one.objective) for one in tried]
    return tried, min(range(len(tried)), key=order.__getitem__)


def summary(tried: Sequence[Optimum]) -> str:
    """The lowest forces of searches from several starts, in a sentence; nothing for one start."""
    if len(tried) < 2:
        return ""
    evaluations = max(len(one.history) for one in tried)
    ends = [lowest(one) for one in tried]
    texts = [f"{end:.1f} N" if np.isfinite(end) else "none within limits" for end in ends]
    return (
        f"After {evaluations} evaluations from each of {len(tried)} starts the lowest forces were "
        f"{', '.join(texts)}; the search went on from where it was least."
    )
