"""Problems with known optima that others wrote: Hock and Schittkowski's, and min-max ones.

They are those of `sif2jax` (CUTEst's, in JAX): every problem of Hock and Schittkowski (1981) with
inequalities and no equality, and every min-max problem of at most `LARGEST` variables, which are
all but COSHFUN. A min-max problem stands there as

    min over x, t of  t,   c_i(x, t) >= 0,   each c_i = +- (t - F_i(x)),

some with the other sign, under which t has no lower bound: it is taken with the sign that has one.
"""

import dataclasses
import re
from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

LARGEST = 60
"""Variables of a problem at most: dense methods are compared."""
MIN_MAX = (
    "CB2", "CB3", "CHACONN1", "CHACONN2", "DEMYMALO", "ELATTAR", "GIGOMEZ1", "GIGOMEZ2",
    "GIGOMEZ3", "GOFFIN", "HAIFAS", "MADSEN", "MAKELA1", "MAKELA2", "MAKELA3", "MAKELA4",
    "MINMAXBD", "MINMAXRB", "OET1", "OET2", "OET3", "OET4", "OET5", "OET6", "OET7", "POLAK1",
    "POLAK2", "POLAK3", "POLAK4", "POLAK5", "POLAK6",
)  # fmt: skip
"""The names of the min-max problems."""
# sif2jax 0.0.8 gives constraints of the kind c <= 0 as they are in CUTEst, and does not say which
# these are: -1 where Hock and Schittkowski have it so. Of c within bounds it leaves out the upper.
SIGNS = {
    "HS64": [-1], "HS76": [-1, -1, 1], "HS76I": [-1, -1, 1], "HS93": [1, -1],
    "HS101": [-1] * 5, "HS102": [-1] * 5, "HS103": [-1] * 5, "HS104": [-1] * 4 + [1],
    "HS108": [-1] * 9 + [1, 1, 1, -1],
}  # fmt: skip
"""What the limits of some problems are multiplied by."""
UPPER = {"HS83": [92.0, 20.0, 5.0]}
"""Upper bounds of the limits of others."""
OPTIMA = {
    "CB2": 1.952224493871, "CB3": 2.0, "CHACONN1": 1.952224493871, "GIGOMEZ2": 1.952224493871,
    "HAIFAS": -0.45, "HS21MOD": -95.96, "HS34": -0.834032445248, "HS35MOD": 0.25,
    "HS76": -4.681818181818, "HS76I": -4.681818181818, "HS86": -32.34867896573,
    "HS88": 1.362656814895, "HS89": 1.362656814895, "HS90": 1.362656814895,
    "HS91": 1.362656814895, "HS92": 1.362656814895, "HS105": 1136.307303574,
    "HS106": 7049.24802053, "HS116": 97.5875095582, "HS268": 0.0, "MADSEN": 0.616432435561,
    "MAKELA1": -1.414213562373, "MINMAXBD": 115.706439521, "OET1": 0.5382431192,
    "OET2": 0.087159633878, "OET3": 0.00450505289236, "OET4": 0.00429543069375,
    "OET5": 0.0026500866342, "OET6": 0.00206973697711, "OET7": 4.44557e-5,
    "POLAK3": 5.9330033487,
}  # fmt: skip
"""Least values where none is published with the problem, or another one's, or too few digits: the
lowest that any of the methods compared has found without breaking a limit, of OET7 in more
evaluations than are compared."""
_HOCK = re.compile(r"HS\d+(MOD|I|NEW)?")


@dataclasses.dataclass(frozen=True)
class Numbers:
    """Objectives F (k,) and limits c >= 0 (m,) at a point, with their slopes."""

    objectives: np.ndarray
    limits: np.ndarray
    objective_rows: np.ndarray
    limit_rows: np.ndarray


@dataclasses.dataclass(frozen=True)
class Known:
    """min over x of max_i F_i(x), c(x) >= 0, lower <= x <= upper.

    `top` [F] is t at the start of a min-max problem, which other methods have as one more variable,
    and `None` of any other problem. `published` is the optimum that is published with it, if any.
    """

    name: str
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    top: float | None
    published: float | None
    numbers: Callable[[np.ndarray], Numbers]

    @property
    def group(self) -> str:
        """What it is counted among."""
        return "Hock-Schittkowski" if self.top is None else "min-max"


def optimum(known: Known) -> float:
    """The known least value."""
    found = OPTIMA.get(known.name, known.published)
    assert found is not None, known.name
    return found


def problems() -> Iterator[Known]:
    """All of them, in the order of their names' groups."""
    import sif2jax

    # Some stand in two of its lists.
    for problem in {problem.name: problem for problem in sif2jax.problems}.values():
        if _HOCK.fullmatch(problem.name):
            if hasattr(problem, "constraint") and _unequal(problem):
                yield _plain(problem)
        elif problem.name in MIN_MAX:
            yield _min_max(problem)


def _unequal(problem) -> bool:
    """Whether it has inequalities and no equality."""
    equal, unequal = jax.eval_shape(problem.constraint, problem.y0)
    return equal is None and unequal is not None


def _parts(problem):
    """Start and bounds as vectors, the objective and the limits as functions of vectors."""
    start, shaped = ravel_pytree(problem.y0)
    start = np.asarray(start, dtype=float)
    lower, upper = np.full(start.size, -np.inf), np.full(start.size, np.inf)
    if problem.bounds is not None:
        # A bound may be one number for all.
        lower, upper = (
            np.broadcast_to(np.asarray(ravel_pytree(b)[0], dtype=float), start.shape)
            for b in problem.bounds
        )

    def value(x):
        return jnp.asarray(problem.objective(shaped(x), problem.args), dtype=float).reshape(())

    def limits(x):
        found = ravel_pytree(problem.constraint(shaped(x))[1])[0]
        if problem.name in UPPER:
            return jnp.concatenate([found, jnp.asarray(UPPER[problem.name]) - found])
        return found * jnp.asarray(SIGNS.get(problem.name, 1.0), dtype=float)

    published = problem.expected_objective_value
    published = None if published is None else float(published)
    return np.clip(start, lower, upper), lower, upper, value, limits, published


def _compiled(both: Callable) -> Callable[[np.ndarray], Numbers]:
    """Values and slopes of (objectives, limits) in one program."""

    @jax.jit
    def program(x):
        return both(x), jax.jacfwd(both)(x)

    def numbers(x: np.ndarray) -> Numbers:
        (objectives, limits), (rows, limit_rows) = jax.device_get(program(x))
        return Numbers(objectives, limits, rows, limit_rows)

    return numbers


def _plain(problem) -> Known:
    start, lower, upper, value, limits, published = _parts(problem)

    def both(x):
        with jax.numpy_dtype_promotion("standard"):
            return value(x)[None], limits(x)

    return Known(problem.name, start, lower, upper, None, published, _compiled(both))


def _min_max(problem) -> Known:
    """The problem without its t."""
    start, lower, upper, value, limits, published = _parts(problem)
    (place,) = np.flatnonzero(np.asarray(jax.grad(value)(start)))
    sign = np.asarray(jax.jacfwd(limits)(start))[:, place]
    top = np.flatnonzero(sign)
    rest = np.flatnonzero(sign == 0)

    def both(x):
        with jax.numpy_dtype_promotion("standard"):
            found = limits(jnp.insert(x, place, 0.0))
            return -found[top] / sign[top], found[rest]

    def without(x):
        return np.delete(x, place)

    return Known(
        problem.name, without(start), without(lower), without(upper), float(start[place]),
        published, _compiled(both),
    )  # fmt: skip
