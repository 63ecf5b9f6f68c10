"""Parameters from recordings: nonlinear least squares with derivatives through the simulation."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from . import _check, scene_numbers
from .design import DesignVariable
from .fidelity import Fidelity
from .instant import Instant
from .recording import SIGNALS, Recording
from .scene_numbers import AnyScene
from .simulate import simulate
from .status import Status

OFFSET = "time_offset"
"""Name of the time [s] that the scene's clock is ahead of the recording's: where a recording's
time is t, the scene has been going on for t + time_offset."""

_PARAMETERS = (
    DesignVariable("youngs_modulus", 0.2e9, 50e9, "Pa"),
    DesignVariable("density", 300.0, 9000.0, "kg/m^3"),
    DesignVariable("damping_ratio", 1e-3, 0.6, "1"),
    DesignVariable("stiffness", 1e7, 1e12, "N/m^4"),
    DesignVariable("damping", 3e3, 3e7, "N s kg^-0.4 m^-3"),
    DesignVariable("fence_kinetic_friction", 0.01, 1.5, "1"),
    DesignVariable("fence_static_friction", 0.01, 1.5, "1"),
    DesignVariable("belt_kinetic_friction", 0.01, 1.5, "1"),
    DesignVariable("belt_static_friction", 0.01, 1.5, "1"),
    DesignVariable(OFFSET, -0.02, 0.02, "s", "linear"),
)
PARAMETERS: Mapping[str, DesignVariable] = {p.name: p for p in _PARAMETERS}
"""Parameters with default bounds: what is hard to measure in any other way."""

# Above this, directions in parameter space are hardly told apart (Belsley, Kuh and Welsch 1980).
_ILL_CONDITIONED = 30.0
_PASSES = 5
_SUSPICIOUS = 100.0


class Experiment(NamedTuple):
    """A scene as it was set up, and what was recorded of it."""

    scene: AnyScene
    recording: Recording


@dataclasses.dataclass(frozen=True, eq=False)
class Fit:
    """Parameters found, n of them, and how well they are known.

    **Fields:**

    - `parameters`: with their bounds; `start`, `values`: before and after [SI], (n,).
    - `standard_errors`: of ln p [1] where the scaling is logarithmic, which is the relative error
      of p, and else of p [SI]; (n,). Infinite where the recordings do not tell.
    - `low`, `high`: the interval of `confidence` [SI], (n,) each.
    - `correlation`: of the estimates [1], (n, n).
    - `condition`: of the Jacobian with columns of length one [1], without those that are 0;
      `weakest`: by how much [1] each ln p (or p by its range) moves along the direction that is
      told worst, the largest being 1.
    - `noise`: standard deviation of the residuals by signal [the signal's unit];
      `autocorrelation` of the residuals from one row to the next, by signal [1].
    - `fitted`: signals of the model at the recordings' times, one array (signals, K) an experiment.
    - `misfit`: root of the sum of weighted squares by degrees of freedom [1]: 1 where the
      residuals are as large as the noise.
    - `converged`, `evaluations`, `stop`: of the descent; `costs`: half the weighted sum of squares
      reached from each start.
    - `warnings`: what speaks against taking the numbers as they are.
    """

    parameters: tuple[DesignVariable, ...]
    start: np.ndarray
    values: np.ndarray
    standard_errors: np.ndarray
    low: np.ndarray
    high: np.ndarray
    confidence: float
    correlation: np.ndarray
    condition: float
    weakest: np.ndarray
    noise: dict[str, float]
    autocorrelation: dict[str, float]
    fitted: list[np.ndarray]
    misfit: float
    converged: bool
    evaluations: int
    stop: str
    costs: list[float]
    warnings: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    def __str__(self) -> str:
        rows = [f"{'parameter':<24}{'start':>12}{'found':>12}{'std. error':>12}   interval"]
        for k, p in enumerate(self.parameters):
            relative = p.scaling == "logarithmic"
            error = self.standard_errors[k]
            shown = f"{100 * error:.2f} %" if relative else f"{error:.2e}"
            rows.append(
                f"{p.name.replace('_', ' '):<24}{self.start[k]:>12.4g}{self.values[k]:>12.4g}"
                f"{shown:>12}   {self.low[k]:.4g} ... {self.high[k]:.4g} {p.unit}"
            )
        return "\n".join(rows)


def interpolate(time: Array, knots: Array, values: Array) -> Array:
    """A signal at other times, by cubics between its samples; constant before and after them.

    The slope at a knot is that of the parabola through it and its neighbours (a knot at an end has
    the chord's), so that the error is of the third order in any spacing; two knots at the same time
    are a jump. Differentiable in all three.

    **Arguments:** `time` (K,), `knots` [the same unit] (T,) in rising order, `values` (T,).
    """
    span = jnp.diff(knots)
    apart = span > 0
    safe = jnp.where(apart, span, 1.0)
    chord = jnp.where(apart, jnp.diff(values) / safe, 0.0)
    before, after = safe[:-1], safe[1:]
    inner = (after * chord[:-1] + before * chord[1:]) / (before + after)
    # Beside a jump the parabola would reach over it.
    inner = jnp.where(apart[:-1], jnp.where(apart[1:], inner, chord[:-1]), chord[1:])
    slope = jnp.concatenate([chord[:1], inner, chord[-1:]])
    place = jnp.clip(
        jnp.searchsorted(knots, jax.lax.stop_gradient(time), side="right") - 1, 0, span.size - 1
    )
    inside = jnp.clip(time, knots[0], knots[-1])
    width = safe[place]
    s = (inside - knots[place]) / width
    a, b = values[place], values[place + 1]
    rise, fall = slope[place] * width, slope[place + 1] * width
    return a + s * (rise + s * (3 * (b - a) - 2 * rise - fall + s * (2 * (a - b) + rise + fall)))


def _signal(history: Instant, name: str) -> Array:
    if name == "force":
        return history.fence_force
    if name == "tip_deflection":
        return history.tip_deflection
    return getattr(history.body, name)


@functools.lru_cache(maxsize=64)
def _program(structure, chosen: tuple[str, ...], signals: tuple[str, ...], fidelity: Fidelity):
    """Signals at given times with their derivatives in the parameters and in the offset."""

    def model(parameters, offset, leaves, time):
        scene = scene_numbers.replace(jax.tree.unflatten(structure, leaves), chosen, parameters)
        result = simulate(scene, fidelity=fidelity, only=("history",))
        history = result.history
        assert history is not None
        shown = [interpolate(time + offset, history.time, _signal(history, s)) for s in signals]
        return jnp.stack(shown), result.status

    def run(parameters, offset, leaves, time):
        def twice(p, o):
            values, status = model(p, o, leaves, time)
            return values, (values, status)

        slopes, (values, status) = jax.jacfwd(twice, argnums=(0, 1), has_aux=True)(
            list(parameters), offset
        )
        return values, jnp.stack([*slopes[0], slopes[1]], axis=-1), status

    return jax.jit(run)


class _Problem:
    """Weighted residuals and their derivatives in the shares u of the parameters' ranges."""

    def __init__(self, experiments, parameters, fidelity):
        self.experiments = experiments
        self.parameters = parameters
        self.chosen = tuple(p.name for p in parameters if not p.name.startswith(OFFSET))
        self.offsets = [k for k, p in enumerate(parameters) if p.name.startswith(OFFSET)]
        self.evaluations = 0
        self.programs = []
        for scene, recording in experiments:
            structure = jax.tree.structure(scene)
            program = _program(structure, self.chosen, recording.names, fidelity)
            self.programs.append((program, jax.tree.leaves(scene), jnp.asarray(recording.time)))
        self._at: np.ndarray | None = None
        self._found: list[tuple[np.ndarray, np.ndarray, int]] = []

    def values(self, shares) -> np.ndarray:
        """Parameters [SI] at shares of their ranges."""
        pairs = zip(self.parameters, shares, strict=True)
        return np.array([float(p.value(float(u))) for p, u in pairs])

    def stretch(self, values) -> np.ndarray:
        """dp/du [SI]."""
        return np.array([
            p.upper - p.lower if p.scaling == "linear" else v * np.log(p.upper / p.lower)
            for p, v in zip(self.parameters, values, strict=True)
        ])  # fmt: skip

    def models(self, shares):
        """Values (signals, K), derivatives in u (signals, K, n) and status of every experiment."""
        shares = np.asarray(shares, dtype=float)
        if self._at is not None and np.array_equal(shares, self._at):
            return self._found
        values = self.values(shares)
        stretch = self.stretch(values)
        plain = [k for k in range(len(values)) if k not in self.offsets]
        found = []
        for index, (program, leaves, time) in enumerate(self.programs):
            own = None
            if self.offsets:
                own = self.offsets[index if len(self.offsets) > 1 else 0]
            offset = 0.0 if own is None else values[own]
            given = tuple(jnp.asarray(values[k]) for k in plain)
            modelled, columns, status = jax.device_get(
                program(given, jnp.asarray(offset), leaves, time)
            )
            slopes = np.zeros((*modelled.shape, len(values)))
            slopes[..., plain] = columns[..., :-1]
            if own is not None:
                slopes[..., own] = columns[..., -1]
            found.append((modelled, slopes * stretch, int(status)))
        self.evaluations += 1
        self._at, self._found = shares.copy(), found
        return found

    def stacked(self, shares, noise: Mapping[str, float]):
        """Residuals (N,) and Jacobian (N, n), in units of the noise."""
        residuals, rows = [], []
        for (modelled, slopes, _), (_, recording) in zip(
            self.models(shares), self.experiments, strict=True
        ):
            weight = np.array([1 / noise[name] for name in recording.names])[:, None]
            residuals.append((weight * (modelled - recording.values)).ravel())
            rows.append((weight[..., None] * slopes).reshape(-1, slopes.shape[-1]))
        return np.concatenate(residuals), np.concatenate(rows)


def _named(given: Sequence[str | DesignVariable], experiments) -> tuple[DesignVariable, ...]:
    """Parameters with bounds; an offset of its own for every experiment."""
    if isinstance(given, (str, DesignVariable)) or not given:
        raise ValueError(
            "Argument `parameters` must be a sequence of at least one name or DesignVariable, but "
            f'is {given!r}. Write, for example, ["youngs_modulus", "damping_ratio"].'
        )
    chosen: list[DesignVariable] = []
    for parameter in given:
        if isinstance(parameter, str):
            if parameter not in PARAMETERS:
                raise ValueError(
                    f"Argument `parameters` must give bounds for {parameter!r}, which has no "
                    f"default ones. Write DesignVariable({parameter!r}, lower, upper, unit)."
                )
            parameter = PARAMETERS[parameter]
        if parameter.name == OFFSET and len(experiments) > 1:
            chosen += [
                dataclasses.replace(parameter, name=f"{OFFSET}[{k}]")
                for k in range(len(experiments))
            ]
        else:
            chosen.append(parameter)
    physical = [p for p in chosen if not p.name.startswith(OFFSET)]
    if not physical:
        raise ValueError(
            f"Argument `parameters` must name a number of the scene, but holds {OFFSET!r} alone."
        )
    for scene, _ in experiments:
        scene_numbers.together(scene, [p.name for p in physical])
        for p in physical:
            scene_numbers.check(scene, p.name, p.lower)
            scene_numbers.check(scene, p.name, p.upper)
    return tuple(chosen)


def _begin(parameters, scene: AnyScene) -> np.ndarray:
    """Shares at which the search starts: the first scene's own numbers."""
    shares = []
    for p in parameters:
        value = 0.0
        if not p.name.startswith(OFFSET):
            value = float(scene_numbers.read(scene, [p.name])[0])
        if not p.lower <= value <= p.upper:
            raise ValueError(
                f"Argument `{p.name}` of the scene must be within the bounds {p.lower:g} ... "
                f"{p.upper:g} [{p.unit}], since the search starts there, but is {value:g}. Widen "
                "the bounds, or change the scene."
            )
        shares.append(float(p.share(value)))
    return np.clip(np.array(shares), 1e-6, 1 - 1e-6)


def _check_times(experiments, parameters, fidelity: Fidelity) -> None:
    latest = max([p.upper for p in parameters if p.name.startswith(OFFSET)], default=0.0)
    for scene, recording in experiments:
        time = np.asarray(recording.time)
        last, span = float(time[-1]), float(time[-1] - time[0])
        if last + latest > scene.duration * (1 + 1e-9):
            milliseconds = last > 20 * scene.duration
            remedy = (
                "Are these milliseconds? Write `time [ms]` in the header."
                if milliseconds
                else f"Give the scene duration={last + latest:g}, or cut the recording."
            )
            raise ValueError(
                f"{recording.source}: times must end within the scene, {scene.duration:g} s less "
                f"the largest time_offset {latest:g} s, but end at {last:g} s. {remedy}"
            )
        if span < 10 * fidelity.step:
            raise ValueError(
                f"{recording.source}: times must span at least ten steps of {fidelity.step:g} s, "
                f"but span {span:g} s. Are they in seconds?"
            )


def _check_sizes(problem: _Problem, shares) -> None:
    """Refuse a recording that is larger or smaller than the model by orders of magnitude."""
    for (modelled, _, status), (_, recording) in zip(
        problem.models(shares), problem.experiments, strict=True
    ):
        if not np.all(np.isfinite(modelled)):
            raise ValueError(
                f"{recording.source}: the scene must run at the start of the search, but ends with "
                f"{Status(status).name}: {Status(status).text}."
            )
        for name, of_model, of_record in zip(
            recording.names, modelled, recording.values, strict=True
        ):
            # Of a position only the change counts.
            shift = name in ("x", "y", "angle")
            size, own = (
                float(np.ptp(a) if shift else np.max(np.abs(a))) for a in (of_record, of_model)
            )
            if own == 0 or not 1 / _SUSPICIOUS < size / own < _SUSPICIOUS:
                raise ValueError(
                    f"{recording.source}, signal `{name}`: must be of the model's size, {own:.3g} "
                    f"{SIGNALS[name]} at the start of the search, but is {size:.3g}. Name its "
                    f"unit in the header, for example `{name} "
                    f"[{'kN' if name == 'force' else 'mm'}]`, or start from better numbers."
                )


def _scales(experiments, noise: Mapping[str, float] | None) -> dict[str, float]:
    """The noise as given, or the largest value of every signal to begin with."""
    largest: dict[str, float] = {}
    for _, recording in experiments:
        for name, column in recording.signals.items():
            size = float(np.max(np.abs(np.asarray(column))))
            largest[name] = max(largest.get(name, 0.0), size)
    if noise is None:
        return {name: size if size > 0 else 1.0 for name, size in largest.items()}
    for name in largest:
        if name not in noise:
            raise ValueError(
                f"Argument `noise` must hold every signal {list(largest)}, but lacks {name!r}."
            )
    return {
        name: _check.number(f"noise[{name!r}]", noise[name], above=0, unit=SIGNALS[name])
        for name in largest
    }


def _spread(problem: _Problem, shares, count: int) -> dict[str, float]:
    """Standard deviation of the residuals by signal; parameters are spread over the signals."""
    sums: dict[str, float] = {}
    rows: dict[str, int] = {}
    for (modelled, _, _), (_, recording) in zip(
        problem.models(shares), problem.experiments, strict=True
    ):
        for name, a, b in zip(recording.names, modelled, recording.values, strict=True):
            sums[name] = sums.get(name, 0.0) + float(np.sum((a - b) ** 2))
            rows[name] = rows.get(name, 0) + a.size
    share = 1 - count / sum(rows.values())
    return {name: float(np.sqrt(sums[name] / (rows[name] * share))) for name in sums}


def fit(
    experiments: Experiment | Sequence[Experiment],
    parameters: Sequence[str | DesignVariable],
    *,
    fidelity: Fidelity | None = None,
    noise: Mapping[str, float] | None = None,
    starts: int = 1,
    confidence: float = 0.95,
    seed: int = 0,
    most: int = 100,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Find parameters p such that scenes do what was recorded of them:

    minimise 1/2 sum_j ((s_j(p) - y_j) / sigma_j)^2 within bounds,

    with y_j the recorded numbers, s_j(p) the simulated signals at the same times, and sigma_j the
    noise of the signal. The search is a trust-region Gauss-Newton method (`scipy.optimize.
    least_squares`, Branch, Coleman and Li 1999) with derivatives through the simulation, in
    u = ln(p / a) / ln(b / a) of the bounds a, b (or linear in p, see `DesignVariable`).

    The covariance of the estimates is that of the linearised problem,
    C = s^2 (J^T J)^-1 with s^2 = sum of weighted squares / (N - n): right for independent noise of
    constant size, a model that is true, and errors small enough for straight lines. Standard errors
    do not hold what the model or the fidelity leave out: see `Fit.warnings`.

    **Arguments:**

    - `experiments`: one or more; the scenes hold the numbers that are known, and the search starts
      from those of the first one. Parameters are common to all, but each recording has a
      `time_offset` of its own if that is asked for.
    - `parameters`: names of `PARAMETERS`, or any number of the scenes (`fencejax.scene_numbers`) as
      a `DesignVariable` with its bounds.
    - `noise`: sigma by signal [the signal's unit]. By default it is estimated from the residuals,
      repeatedly until it no longer changes: the likeliest weights of several signals.
    - `starts`: the first is at the scene's own numbers, others are spread over the bounds; the best
      is kept.
    - `confidence`: of the intervals [1]. `seed`: of the starts. `most`: evaluations in a search.
    - `progress`: called with the evaluation's number and half the weighted sum of squares.

    Raises `ValueError` where names, bounds, times or sizes cannot be; a recording whose times or
    values are off by orders of magnitude is taken to be in other units.
    """
    if isinstance(experiments, Experiment):
        experiments = [experiments]
    experiments = tuple(experiments)
    if not experiments:
        raise ValueError("Argument `experiments` must hold at least one, but is empty.")
    fidelity = Fidelity.standard() if fidelity is None else fidelity
    _check.count("starts", starts, least=1)
    _check.count("most", most, least=1)
    if not 0 < _check.number("confidence", confidence) < 1:
        raise ValueError(f"Argument `confidence` must be within 0 and 1, but is {confidence:g}.")
    chosen = _named(parameters, experiments)
    rows = sum(recording.values.size for _, recording in experiments)
    if rows <= len(chosen):
        raise ValueError(
            f"Argument `experiments` must hold more recorded numbers than the {len(chosen)} "
            f"parameters, but holds {rows}."
        )
    _check_times(experiments, chosen, fidelity)
    begin = _begin(chosen, experiments[0].scene)
    problem = _Problem(experiments, chosen, fidelity)
    _check_sizes(problem, begin)
    first = _scales(experiments, noise)
    found = [
        _search(problem, at, first, noise is None, most, progress)
        for at in _starts(begin, starts, seed)
    ]
    # Each search has weights of its own: compared by what they make of the first ones.
    compared = [0.5 * float(np.sum(problem.stacked(x, first)[0] ** 2)) for x, *_ in found]
    shares, weights, converged, stop = found[int(np.argmin(compared))]
    return _judged(
        problem, begin, shares, weights, converged, stop, compared, confidence
    )


def _starts(begin: np.ndarray, count: int, seed: int) -> list[np.ndarray]:
    if count == 1:
        return [begin]
    from scipy.stats import qmc

    engine = qmc.LatinHypercube(begin.size, rng=np.random.default_rng(seed))
    return [begin, *(0.1 + 0.8 * engine.random(count - 1))]


def _jacobian_of(problem: _Problem):
    return lambda x, noise: problem.stacked(x, noise)[1]


def _search(problem: _Problem, begin, weights, estimated: bool, most: int, progress):
    """One search: the shares, the weights used last, whether it converged, and why it stopped."""
    from scipy.optimize import least_squares

    shares = np.asarray(begin, dtype=float)
    converged, stop = False, ""
    for _ in range(_PASSES):
        current = dict(weights)

        def residuals(x, current):
            value = problem.stacked(x, current)[0]
            if progress is not None:
                progress(problem.evaluations, 0.5 * float(value @ value))
            return value

        jacobian: Any = _jacobian_of(problem)
        solution = least_squares(
            residuals,
            shares,
            jac=jacobian,
            args=(current,),
            bounds=(0.0, 1.0),
            x_scale="jac",
            ftol=1e-10,
            xtol=1e-9,
            gtol=1e-10,
            max_nfev=most,
        )
        shares = solution.x
        converged, stop = bool(solution.status > 0), str(solution.message)
        if not estimated:
            break
        spread = _spread(problem, shares, shares.size)
        # Residuals of rounding alone are not weights.
        new = {name: max(spread[name], 1e-9 * weights[name]) for name in weights}
        ratios = [np.log(new[name] / current[name]) for name in new]
        weights = new
        # A common factor moves nothing.
        if np.ptp(ratios) < 0.02:
            break
    return shares, weights, converged, stop


def _judged(
    problem: _Problem, begin, shares, weights, converged, stop, costs, confidence: float
) -> Fit:
    from scipy import stats

    parameters = problem.parameters
    residual, jacobian = problem.stacked(shares, weights)
    freedom = residual.size - shares.size
    misfit = float(np.sqrt(residual @ residual / freedom))
    # From shares of the range to ln p, or to p.
    spans = np.array([
        p.upper - p.lower if p.scaling == "linear" else np.log(p.upper / p.lower)
        for p in parameters
    ])  # fmt: skip
    logarithmic = np.array([p.scaling == "logarithmic" for p in parameters])
    lengths = np.linalg.norm(jacobian, axis=0)
    seen = lengths > 0
    error = np.full(shares.size, np.inf)
    correlation = np.eye(shares.size)
    condition, weakest = np.inf, (~seen).astype(float)
    if np.any(seen):
        _, sizes, turned = np.linalg.svd(jacobian[:, seen] / lengths[seen], full_matrices=False)
        condition = float(sizes[0] / sizes[-1]) if sizes[-1] > 0 else np.inf
        # Directions that nothing is known of, to rounding.
        told = sizes > 1e-10 * sizes[0]
        inverse = np.where(told, 1 / np.where(told, sizes, 1.0), 0.0)
        spread = (turned.T * inverse**2) @ turned
        deviation = np.sqrt(np.diag(spread))
        both = np.outer(deviation, deviation)
        correlation[np.ix_(seen, seen)] = spread / np.where(both > 0, both, 1.0)
        untold = np.any(np.abs(turned[~told]) > 1e-3, axis=0)
        error[seen] = np.where(untold, np.inf, misfit * deviation / lengths[seen])
        weakest = np.zeros(shares.size)
        weakest[seen] = turned[-1] / lengths[seen]
        weakest = weakest * np.where(logarithmic, spans, 1.0)
        weakest = weakest / weakest[np.argmax(np.abs(weakest))]

    values = problem.values(shares)
    standard = error * spans
    half = float(stats.t.ppf(0.5 + 0.5 * confidence, freedom)) * standard
    with np.errstate(over="ignore"):
        low = np.where(logarithmic, values * np.exp(-half), values - half)
        high = np.where(logarithmic, values * np.exp(half), values + half)
    models = problem.models(shares)
    noise = _spread(problem, shares, shares.size)
    lagged = _autocorrelation(problem, models)
    return Fit(
        parameters=parameters,
        start=problem.values(begin),
        values=values,
        standard_errors=standard,
        low=low,
        high=high,
        confidence=confidence,
        correlation=correlation,
        condition=condition,
        weakest=weakest,
        noise=noise,
        autocorrelation={name: value for name, (value, _) in lagged.items()},
        fitted=[modelled for modelled, _, _ in models],
        misfit=misfit,
        converged=converged,
        evaluations=problem.evaluations,
        stop=stop,
        costs=costs,
        warnings=tuple(
            _warnings(problem, shares, standard, condition, weakest, lagged, models, costs)
        ),
    )


def _autocorrelation(problem: _Problem, models) -> dict[str, tuple[float, float]]:
    """Of residuals from one row to the next, by signal, and what noise alone would stay below."""
    above: dict[str, float] = {}
    below: dict[str, float] = {}
    rows: dict[str, int] = {}
    for (modelled, _, _), (_, recording) in zip(models, problem.experiments, strict=True):
        for name, row in zip(recording.names, modelled - recording.values, strict=True):
            above[name] = above.get(name, 0.0) + float(row[1:] @ row[:-1])
            below[name] = below.get(name, 0.0) + float(row @ row)
            rows[name] = rows.get(name, 0) + row.size
    return {
        name: (above[name] / below[name] if below[name] > 0 else 0.0, 3 / np.sqrt(rows[name]))
        for name in above
    }


def _warnings(problem, shares, standard, condition, weakest, lagged, models, costs):
    parameters = problem.parameters
    if condition > _ILL_CONDITIONED:
        combined = ", ".join(
            f"{p.name} {w:+.2f}"
            for p, w in zip(parameters, weakest, strict=True)
            if abs(w) > 0.1
        )
        yield (
            f"hardly told apart (condition {condition:.3g}): along {combined} the fit is almost "
            "as good. Hold one of these, or record more signals or other impacts"
        )
    for p, u, error in zip(parameters, shares, standard, strict=True):
        if not np.isfinite(error):
            yield f"{p.name} is not told by the recordings at all"
        elif p.scaling == "logarithmic" and error > 0.5:
            yield f"{p.name} is known to a factor of {np.exp(error):.2g} only"
        if u < 1e-3 or u > 1 - 1e-3:
            end, bound = ("lower", p.lower) if u < 0.5 else ("upper", p.upper)
            yield f"{p.name} is at its {end} bound {bound:g} {p.unit}: its errors do not hold"
    for name, (value, limit) in lagged.items():
        if abs(value) > limit:
            yield (
                f"residuals of {name} follow one another (autocorrelation {value:+.2f}, noise "
                f"stays within {limit:.2f}): the model leaves something out, and the standard "
                "errors are too small"
            )
    for (_, _, status), (_, recording) in zip(models, problem.experiments, strict=True):
        if status >= Status.LEFT_OVER_TIP:
            yield f"{recording.source}: {Status(status).text}"
    if len(costs) > 1:
        reached = int(np.sum(np.array(costs) < 1.01 * min(costs)))
        if costs[0] > 1.01 * min(costs):
            yield "the scene's own numbers led to a worse minimum than another start"
        elif reached == 1:
            yield f"none of the other {len(costs) - 1} starts came to the same minimum"
