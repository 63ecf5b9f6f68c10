"""The cheapest fidelity that is accurate enough, measured on the user's own scenes."""

import dataclasses
import functools
import itertools
import math
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from . import _check
from .error import FIELDS
from .fidelity import Fidelity
from .scenes import NormalScene, Scene
from .simulate import simulate
from .status import Status

AnyScene = NormalScene | Scene
Selector = str | Callable[[AnyScene], Any]

# Where a scene keeps what is differentiated; the first that it has counts.
_PATHS = {
    "thickness": ("fence.thickness",),
    "rigid_length": ("fence.rigid_length",),
    "flexible_length": ("fence.flexible_length",),
    "width": ("fence.width",),
    "youngs_modulus": ("fence.material.youngs_modulus",),
    "density": ("fence.material.density",),
    "damping_ratio": ("fence.material.damping_ratio",),
    "mass": ("parcel.mass",),
    "distance": ("start.place", "distance"),
}
_BY_DEFAULT = (
    "thickness", "flexible_length", "youngs_modulus", "density", "damping_ratio", "mass",
    "distance",
)  # fmt: skip
_PASSES = "accurate enough"
_VALUE_FAILS = "value too far off"
_GRADIENT_FAILS = "gradient too far off"
_GEOMETRIES = ("small", "arc", "chord")


@dataclasses.dataclass(frozen=True)
class Trial:
    """What was measured of one candidate.

    **Fields:**

    - `fidelity`: the candidate.
    - `outcome`: what became of it, in words.
    - `passed`: whether it met both errors.
    - `value_error`: largest relative error of a quantity over the scenes [1]; `None` if not
      measured.
    - `gradient_error`: largest error of a gradient, as elasticities relative to their norm [1];
      `None` if not measured.
    - `value_time`, `gradient_time`: run time of all scenes together [s], median of several runs of
      the compiled program, for the value and for value and gradient; `None` if not measured.
    - `compile_time`: time to compile what was measured [s].
    """

    fidelity: Fidelity
    outcome: str
    passed: bool = False
    value_error: float | None = None
    gradient_error: float | None = None
    value_time: float | None = None
    gradient_time: float | None = None
    compile_time: float = 0.0

    @property
    def time(self) -> float:
        """The run time that counts [s]: with the gradient if that was measured."""
        known = self.value_time if self.gradient_time is None else self.gradient_time
        return math.inf if known is None else known


@dataclasses.dataclass(frozen=True)
class Choice:
    """A fidelity with the measurements that speak for it. `print` shows them as a table.

    **Fields:**

    - `fidelity`: the cheapest that meets both errors; in a refusal the best that was found, `None`
      if nothing was tried.
    - `table`: one `Trial` a candidate, in the order of expected cost.
    - `reference`: what the errors are measured against.
    - `reference_value_error`, `reference_gradient_error`: its own estimated errors [1], the
      difference to `companion`.
    - `value_error`, `gradient_error`: the errors asked for [1].
    - `margin`: factor on the measured errors.
    - `quantities`, `variables`: names of what was compared, and differentiated in.
    - `scenes`: how many scenes were measured.
    - `reference_time`: run time of the reference with its gradient, all scenes together [s].
    """

    fidelity: Fidelity | None
    table: tuple[Trial, ...]
    reference: Fidelity
    companion: Fidelity
    reference_value_error: float
    reference_gradient_error: float | None
    reference_time: float
    value_error: float
    gradient_error: float | None
    margin: float
    quantities: tuple[str, ...]
    variables: tuple[str, ...]
    scenes: int

    def __str__(self) -> str:
        asked = f"value {self.value_error:.3g}"
        own = f"value {self.reference_value_error:.1e}"
        if self.gradient_error is not None:
            asked += f", gradient {self.gradient_error:.3g} in {', '.join(self.variables)}"
            own += f", gradient {self.reference_gradient_error:.1e}"
        plural = "" if self.scenes == 1 else "s"
        head = f"{'':2}{'fidelity':<40}{'value':>10}{'gradient':>10}{'run [ms]':>12}  outcome"
        rows = [
            f"Errors of {', '.join(self.quantities)} over {self.scenes} scene{plural}, asked for: "
            f"{asked}; measured errors count {self.margin:g} times",
            f"Reference: {describe(self.reference)}, {1e3 * self.reference_time:.4g} ms, own "
            f"error {own}",
            head,
        ]
        for trial in self.table:
            mark = "* " if trial.fidelity == self.fidelity else "  "
            spent = "" if trial.time == math.inf else f"{1e3 * trial.time:.3g}"
            rows.append(
                f"{mark}{describe(trial.fidelity):<40}{_shown(trial.value_error):>10}"
                f"{_shown(trial.gradient_error):>10}{spent:>12}  {trial.outcome}"
            )
        return "\n".join(rows)


class NoFidelityError(RuntimeError):
    """No candidate meets the errors asked for. `evidence` is the `Choice` with all that was
    measured; its `fidelity` is the best that was found."""

    evidence: Choice

    def __init__(self, message: str, evidence: Choice):
        super().__init__(f"{message}\n{evidence}")
        self.evidence = evidence


def describe(fidelity: Fidelity) -> str:
    """A fidelity's main knobs in one line."""
    modes = "all modes" if fidelity.modes is None else f"{fidelity.modes} modes"
    parts = [f"{1e3 * fidelity.step:g} ms", modes, fidelity.geometry]
    parts.append(f"eps {fidelity.slip_speed:g} m/s")
    if fidelity.integrator != "modal":
        parts[0] = f"{fidelity.integrator} {fidelity.tolerance:g}"
    return ", ".join(parts)


def _shown(error: float | None) -> str:
    return "" if error is None else f"{error:.2e}"


def ladder() -> tuple[Fidelity, ...]:
    """The candidates that are tried if none are named: steps of 1 ms to 62.5 us, each with more or
    fewer modes, cheaper and dearer geometry, and friction smoothed more and less."""
    rungs = (
        # step [s], modes, geometry, slip_speed [m/s]
        (1e-3, 0, "small", 2e-2),
        (1e-3, 2, "small", 2e-2),
        (1e-3, 4, "arc", 2e-2),
        (5e-4, 2, "small", 2e-2),
        (5e-4, 3, "arc", 2e-2),
        (5e-4, 4, "arc", 5e-3),
        (2.5e-4, 3, "arc", 2e-2),
        (2.5e-4, 4, "arc", 5e-3),
        (2.5e-4, 6, "chord", 2e-3),
        (1.25e-4, 6, "arc", 2e-3),
        (1.25e-4, 8, "chord", 1e-3),
        (6.25e-5, 8, "chord", 1e-3),
    )
    return tuple(
        Fidelity(modes=modes, geometry=geometry, step=step, slip_speed=slip, static_speed=5 * slip)
        for step, modes, geometry, slip in rungs
    )


def expected_cost(fidelity: Fidelity) -> float:
    """Work a second of simulated time, in steps of one mode; orders what is tried first."""
    geometry = {"small": 1.0, "arc": 1.1, "chord": 1.3}[fidelity.geometry]
    general = {"modal": 1.0, "tsit5": 100.0, "kvaerno5": 300.0}[fidelity.integrator]
    return general * geometry * (1 + 0.05 * fidelity.mode_count) / fidelity.step


def as_fine(one: Fidelity, other: Fidelity) -> bool:
    """Whether `one` is at least as fine as `other` in every knob."""

    def key(f):
        finer_above = (f.mode_count, f.elements, f.iterations, _GEOMETRIES.index(f.geometry))
        finer_below = (f.step, f.slip_speed, f.static_speed, f.tip_fade, f.tolerance)
        precise = getattr(f, "precision", None) != "float32"
        return (*finer_above, f.static_correction, precise, *(-x for x in finer_below))

    same = (one.integrator, one.load) == (other.integrator, other.load)
    return same and all(a >= b for a, b in zip(key(one), key(other), strict=True))


class _Group(NamedTuple):
    """Scenes of one structure, stacked; how many; how their variables are found in one of them."""

    scenes: AnyScene
    lanes: int
    selectors: tuple[Callable[[AnyScene], Any], ...]


class _Measured(NamedTuple):
    """Quantities of shape (scenes, q), elasticities (scenes, q, n) or `None`, the worst status,
    run time [s], compile time [s]."""

    values: np.ndarray
    slopes: np.ndarray | None
    status: Status
    time: float
    compile_time: float


def _follow(scene: Any, path: str) -> Any:
    return functools.reduce(lambda part, name: getattr(part, name, None), path.split("."), scene)


def _selector(scene: AnyScene, given: Selector) -> Callable[[AnyScene], Any] | None:
    """How `given` is found in scenes like this one; `None` if it is not there."""
    if isinstance(given, str):
        for path in _PATHS.get(given, (given,)):
            if eqx.is_inexact_array(_follow(scene, path)):
                return functools.partial(_follow, path=path)
        return None
    return given if eqx.is_inexact_array(given(scene)) else None


def _selectors(scene: AnyScene, given: Sequence[Selector] | None):
    if given is None:
        found = [_selector(scene, name) for name in _BY_DEFAULT]
        if isinstance(scene, NormalScene):
            found.append(_selector(scene, "speed"))
        return tuple(selector for selector in found if selector is not None)
    chosen = []
    for element in given:
        selector = _selector(scene, element)
        if selector is None:
            raise ValueError(
                f"Argument `with_respect_to` must name numbers of every scene, by one of "
                f"{list(_PATHS)}, a path like 'drive.top_speed' or a function of the scene, but "
                f"{element!r} is no floating-point number of a {type(scene).__name__}."
            )
        chosen.append(selector)
    return tuple(chosen)


def _groups(given: Any, with_respect_to: Sequence[Selector] | None) -> list[_Group]:
    scenes = [given] if isinstance(given, (Scene, NormalScene)) else list(given)
    if not scenes:
        raise ValueError("Argument `scene_or_scenes` must hold at least one scene, but is empty.")
    sorted_out: dict[Any, list[AnyScene]] = {}
    for scene in scenes:
        if not isinstance(scene, (Scene, NormalScene)):
            raise TypeError(
                "Argument `scene_or_scenes` must be a scene or a sequence of scenes, but holds a "
                f"{type(scene).__name__}."
            )
        leaves, structure = jax.tree.flatten(scene)
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            raise TypeError(
                "Argument `scene_or_scenes` must hold concrete numbers, but is traced: measure "
                "outside of a transformation."
            )
        if scene.parcel.mass.ndim == 0:
            scene = jax.tree.map(lambda leaf: leaf[None], scene)
        leaves = jax.tree.leaves(scene)
        if any(leaf.shape[:1] != leaves[0].shape[:1] for leaf in leaves):
            raise ValueError(
                "Argument `scene_or_scenes` must hold single scenes or scenes stacked along a "
                f"leading axis of all their numbers, but has shapes "
                f"{sorted({leaf.shape for leaf in leaves})}."
            )
        kind = (structure, tuple((leaf.shape[1:], leaf.dtype) for leaf in leaves))
        sorted_out.setdefault(kind, []).append(scene)
    groups = []
    for alike in sorted_out.values():
        stacked = jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *alike)
        one = jax.tree.map(lambda leaf: leaf[0], stacked)
        count = stacked.parcel.mass.shape[0]
        groups.append(_Group(stacked, count, _selectors(one, with_respect_to)))
    return groups


def _program(group: _Group, fidelity: Fidelity, quantities: tuple[str, ...], slopes: bool):
    """Scenes -> quantities, elasticities' numerators, statuses."""

    def run(scales, scene):
        if scales:
            leaves = [select(scene) for select in group.selectors]
            scaled = [leaf * scale for leaf, scale in zip(leaves, scales, strict=True)]
            scene = eqx.tree_at(lambda s: [f(s) for f in group.selectors], scene, scaled)
        result = simulate(scene, fidelity=fidelity, only=quantities)
        values = jnp.stack([getattr(result, name) for name in quantities])
        return values, (values, result.status)

    def one(scene):
        if not slopes:
            values, (_, status) = run((), scene)
            return values, None, status
        ones = [jnp.ones_like(select(scene)) for select in group.selectors]
        rows, (values, status) = jax.jacfwd(run, has_aux=True)(ones, scene)
        return values, jnp.concatenate([r.reshape(len(quantities), -1) for r in rows], 1), status

    return jax.jit(jax.vmap(one))


def _median_time(program, scenes) -> float:
    """Median run time [s] of three to fifteen runs, half a second of them at most."""
    times: list[float] = []
    while len(times) < 3 or (len(times) < 15 and sum(times) < 0.5):
        begin = time.perf_counter()
        jax.block_until_ready(program(scenes))
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def _measure(group, fidelity, quantities, slopes, timed=True) -> _Measured:
    begin = time.perf_counter()
    program = _program(group, fidelity, quantities, slopes).lower(group.scenes).compile()
    compile_time = time.perf_counter() - begin
    begin = time.perf_counter()
    values, rows, status = jax.device_get(program(group.scenes))
    spent = time.perf_counter() - begin
    if rows is not None:
        # p dq/dp / q; 0 where neither the quantity nor its derivative is anything but 0.
        nothing = (values == 0)[..., None] & (rows == 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            rows = np.where(nothing, 0.0, rows / values[..., None])
    spent = _median_time(program, group.scenes) if timed else spent
    return _Measured(values, rows, Status(int(np.max(status))), spent, compile_time)


def _value_error(measured: _Measured, truth: _Measured) -> float:
    """Largest |q - q_ref| / |q_ref| [1]."""
    a, b = measured.values, truth.values
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(same, 0.0, np.abs(a - b) / np.abs(b))
    return float(np.max(np.where(np.isnan(error), np.inf, error)))


def _gradient_error(measured: _Measured, truth: _Measured) -> float:
    """Largest |e - e_ref| / |e_ref| [1], e the elasticities of a quantity in a scene."""
    assert measured.slopes is not None
    assert truth.slopes is not None
    unknown = np.isnan(measured.slopes) & np.isnan(truth.slopes)
    off = np.linalg.norm(np.where(unknown, 0.0, measured.slopes - truth.slopes), axis=-1)
    size = np.linalg.norm(np.where(unknown, 0.0, truth.slopes), axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(off == 0, 0.0, off / size)
    return float(np.max(np.where(np.isnan(error), np.inf, error)))


class _Judge:
    """Measures candidates against the reference."""

    def __init__(self, groups, quantities, reference, bounds, margin):
        self.groups, self.quantities = groups, quantities
        self.value_bound, self.gradient_bound = bounds
        self.margin = margin
        slopes = self.gradient_bound is not None
        self.reference = reference
        self.companion = reference.replace(
            step=2 * reference.step,
            modes=max(1, 3 * reference.mode_count // 4),
            slip_speed=2 * reference.slip_speed,
            static_speed=2 * reference.static_speed,
            tolerance=10 * reference.tolerance,
        )
        self.truth = [_measure(g, reference, quantities, slopes, timed=False) for g in groups]
        worst = max(truth.status for truth in self.truth)
        if worst >= Status.STEP_TOO_COARSE:
            raise ValueError(
                f"Argument `scene_or_scenes` must hold scenes that the reference can solve, but "
                f"one ends as {worst.name}: {worst.text}."
            )
        second = [_measure(g, self.companion, quantities, slopes, timed=False) for g in groups]
        pairs = list(zip(second, self.truth, strict=True))
        self.own_value = max(_value_error(*pair) for pair in pairs)
        self.own_gradient = max(_gradient_error(*pair) for pair in pairs) if slopes else None
        self.time = sum(truth.time for truth in self.truth)

    def meets(self, error: float, own: float, bound: float) -> bool:
        return self.margin * error + own <= bound

    @property
    def supported(self) -> bool:
        """Whether the reference is good enough for the errors asked for."""
        fine = self.own_value < self.value_bound
        if self.gradient_bound is None or self.own_gradient is None:
            return fine
        return fine and self.own_gradient < self.gradient_bound

    def _over_groups(self, fidelity, slopes):
        runs = [_measure(g, fidelity, self.quantities, slopes) for g in self.groups]
        return runs, sum(r.time for r in runs), sum(r.compile_time for r in runs)

    def trial(self, fidelity: Fidelity) -> Trial:
        """The value first; the gradient, dearer to compile, only if the value is right."""
        runs, spent, compiling = self._over_groups(fidelity, False)
        pairs = list(zip(runs, self.truth, strict=True))
        worst = max(run.status for run in runs)
        value = max(_value_error(*pair) for pair in pairs)
        trial = Trial(
            fidelity, "", value_error=value, value_time=spent, compile_time=compiling
        )
        if not self.meets(value, self.own_value, self.value_bound):
            return dataclasses.replace(trial, outcome=_VALUE_FAILS)
        if worst >= Status.STEP_TOO_COARSE:
            return dataclasses.replace(trial, outcome=f"{worst.name}: {worst.text}")
        if self.gradient_bound is None or self.own_gradient is None:
            return dataclasses.replace(trial, outcome=_PASSES, passed=True)
        runs, spent, compiling = self._over_groups(fidelity, True)
        pairs = list(zip(runs, self.truth, strict=True))
        gradient = max(_gradient_error(*pair) for pair in pairs)
        passed = self.meets(gradient, self.own_gradient, self.gradient_bound)
        return dataclasses.replace(
            trial,
            outcome=_PASSES if passed else _GRADIENT_FAILS,
            passed=passed,
            gradient_error=gradient,
            gradient_time=spent,
            compile_time=trial.compile_time + compiling,
        )

    def distance(self, trial: Trial) -> tuple[float, float]:
        """How far a trial is from the bounds: the best of those that fail is the least."""
        value = math.inf if trial.value_error is None else trial.value_error / self.value_bound
        if self.gradient_bound is None:
            return value, 0.0
        unknown = trial.gradient_error is None
        gradient = math.inf if unknown else trial.gradient_error / self.gradient_bound
        return max(value, gradient), value


def _different(candidates: Iterable[Fidelity], groups: list[_Group]) -> list[Fidelity]:
    """Candidates that differ in what the scenes hold, cheapest first."""
    scenes = [group.scenes for group in groups]
    fence = any(scene.fence is not None for scene in scenes)
    full = any(isinstance(scene, Scene) for scene in scenes)
    seen, kept = set(), []
    for candidate in sorted(dict.fromkeys(candidates), key=expected_cost):
        same = {}
        if not full:
            same |= dict(geometry="small", slip_speed=1.0, static_speed=1.0)
        if not fence:
            same |= dict(geometry="small", modes=0, elements=1, static_correction=True)
        key = candidate.replace(**same)
        if key not in seen:
            seen.add(key)
            kept.append(candidate)
    return kept


def choose_fidelity(
    scene_or_scenes: AnyScene | Sequence[AnyScene],
    *,
    value_error: float = 1e-2,
    gradient_error: float | None = 5e-2,
    quantities: Sequence[str] = ("peak_force",),
    candidates: Sequence[Fidelity] | None = None,
    with_respect_to: Sequence[Selector] | None = None,
    reference: Fidelity | None = None,
    margin: float = 1.5,
    progress: Callable[[Trial], None] | None = None,
) -> Choice:
    """Measure fidelities on the given scenes and return the cheapest that is accurate enough.

    With q a quantity in a scene, p_i its variables and e_i = (p_i / q) dq/dp_i the elasticities,
    the errors against a converged reference are

    |q - q_ref| / |q_ref| and |e - e_ref| / |e_ref|,

    the largest over quantities and scenes. A candidate is accepted if `margin` times its error
    plus the reference's own is at most what is asked for, for both. The reference's own error is
    its difference to a run with twice its step, three quarters of its modes and friction smoothed
    over twice the speed.

    Candidates are tried by step, the longest first. Of those with the same step the finest comes
    first: where it fails, so do the others, and one compilation has settled them all. Values come
    before gradients, which take longer to compile. Of those that pass, the one with the least
    measured run time is chosen.

    **Arguments:**

    - `scene_or_scenes`: a scene, scenes stacked along a leading axis, or a sequence of these;
      scenes of one structure run as one batch, and times are sums over the batches.
    - `value_error`, `gradient_error`: largest errors allowed [1]; `gradient_error=None` judges by
      the value alone.
    - `quantities`: names of fields of `Result`.
    - `candidates`: default `fencejax.choice.ladder()`.
    - `with_respect_to`: names (`"thickness"`, `"youngs_modulus"`, ...), paths
      (`"drive.top_speed"`) or functions from a scene to one of its arrays. By default thickness,
      flexible length, modulus, density, damping ratio, mass, distance and (normal scenes) speed,
      as far as the scene has them.
    - `reference`: default `Fidelity.reference()`.
    - `margin`: factor on the measured errors, at least 1, that leaves room for scenes near the
      measured ones.
    - `progress`: called with every `Trial` as it is measured.

    Raises `NoFidelityError`, with the evidence, where no candidate is accurate enough or the
    reference is not; `ValueError` and `TypeError` for arguments out of bounds or of the wrong
    kind, and `ValueError` where the reference cannot solve a scene.
    """
    bounds = (
        _check.number("value_error", value_error, above=0.0),
        None
        if gradient_error is None
        else _check.number("gradient_error", gradient_error, above=0.0),
    )
    if _check.number("margin", margin) < 1:
        raise ValueError(f"Argument `margin` must be at least 1, but is {margin:g}.")
    names = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    if not names:
        raise ValueError("Argument `quantities` must hold at least one name, but is empty.")
    for name in names:
        _check.choice("quantities", name, FIELDS)
    if isinstance(with_respect_to, str):
        with_respect_to = (with_respect_to,)
    if with_respect_to is not None and not with_respect_to and gradient_error is not None:
        raise ValueError(
            "Argument `with_respect_to` must hold at least one variable, but is empty. Write "
            "gradient_error=None to judge by the value alone."
        )
    reference = Fidelity.reference() if reference is None else reference
    candidates = ladder() if candidates is None else tuple(candidates)
    for element in (reference, *candidates):
        if not isinstance(element, Fidelity):
            raise TypeError(
                "Arguments `candidates` and `reference` must be made of `fencejax.Fidelity`, but "
                f"hold {element!r}."
            )
    if not candidates:
        raise ValueError("Argument `candidates` must hold at least one fidelity, but is empty.")
    groups = _groups(scene_or_scenes, with_respect_to)
    if with_respect_to is None:
        everywhere = [_selectors(_one(group), None) for group in groups]
        variables = tuple(
            name
            for name in (*_BY_DEFAULT, "speed")
            if any(_path_name(selector) in (name, *_PATHS.get(name, ())) for selector in
                   itertools.chain(*everywhere))
        )
    else:
        variables = tuple(
            given if isinstance(given, str) else getattr(given, "__name__", repr(given))
            for given in with_respect_to
        )
    judge = _Judge(groups, names, reference, bounds, margin)
    remaining = _different(candidates, groups)
    order = {candidate: i for i, candidate in enumerate(remaining)}
    trials: dict[Fidelity, Trial] = {}

    def evidence(fidelity):
        return Choice(
            fidelity=fidelity,
            table=tuple(trials[candidate] for candidate in sorted(trials, key=order.__getitem__)),
            reference=reference,
            companion=judge.companion,
            reference_value_error=judge.own_value,
            reference_gradient_error=judge.own_gradient,
            reference_time=judge.time,
            value_error=bounds[0],
            gradient_error=bounds[1],
            margin=float(margin),
            quantities=names,
            variables=variables,
            scenes=sum(group.lanes for group in groups),
        )

    if not judge.supported:
        raise NoFidelityError(
            "The reference is not converged well enough on these scenes to tell errors as small "
            "as those asked for. Ask for larger ones, or give a finer `reference`.",
            evidence(None),
        )
    return _search(judge, remaining, trials, evidence, progress)


def _one(group: _Group) -> AnyScene:
    return jax.tree.map(lambda leaf: leaf[0], group.scenes)


def _path_name(selector) -> str:
    return selector.keywords["path"]


def _search(judge, remaining, trials, evidence, progress) -> Choice:
    def attempt(candidate):
        trials[candidate] = trial = judge.trial(candidate)
        remaining.remove(candidate)
        if progress is not None:
            progress(trial)
        return trial

    def drop(candidates, why):
        for candidate in candidates:
            trials[candidate] = Trial(candidate, why)
            remaining.remove(candidate)

    def attempt_and_settle(candidate):
        """A candidate that is no finer than one too far off is not tried: were it nearer, it would
        be by luck. A step that Newton's method could not solve says nothing about the others."""
        trial = attempt(candidate)
        if trial.outcome in (_VALUE_FAILS, _GRADIENT_FAILS):
            coarser = [c for c in remaining if as_fine(candidate, c)]
            drop(coarser, f"not tried: no finer than {describe(candidate)}")
        return trial

    while remaining:
        alike = [c for c in remaining if c.step == remaining[0].step]
        # The finest: the one that settles the most others, of several the dearest.
        finest = max(reversed(alike), key=lambda one: sum(as_fine(one, c) for c in alike))
        passed = [trial for trial in [attempt_and_settle(finest)] if trial.passed]
        while passed and (cheaper := [c for c in alike if c in remaining]):
            trial = attempt_and_settle(cheaper[0])
            if trial.passed:
                passed.append(trial)
                break
        if passed:
            drop(list(remaining), "not tried: dearer")
            return evidence(min(passed, key=lambda trial: trial.time).fidelity)
    best = min(trials.values(), key=judge.distance)
    raise NoFidelityError(
        f"No candidate is accurate enough on these scenes. The best found is "
        f"{describe(best.fidelity)}: {best.outcome}. Ask for larger errors, or give finer "
        "`candidates`.",
        evidence(best.fidelity),
    )
