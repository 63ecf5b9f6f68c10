"""The cheapest fidelity that is accurate enough, measured on the user's own scenes."""

import dataclasses
import math
from collections.abc import Callable, Sequence

from .. import _check
from ..fidelity import Fidelity
from ..printing import Readable, Table, of_lines
from ..results import ESTIMATED
from ..scenes import AnyScene
from .candidates import as_fine, describe, distinct, ladder
from .scene_groups import Selector, grouped, names
from .trial import GRADIENT_FAILS, VALUE_FAILS, Judge, Trial


@dataclasses.dataclass(frozen=True, repr=False)
class Choice(Readable):
    """A fidelity with the measurements that support it. `print` shows them as a table.

    **Fields:**

    - `fidelity`: the cheapest that meets both errors; in a `NoFidelityError` the best one found,
      `None` if none was tried.
    - `table`: one `Trial` a candidate, in the order of expected cost.
    - `reference`: the fidelity against which the errors are measured.
    - `reference_value_error`, `reference_gradient_error`: its own estimated errors [1], the
      difference to `companion`.
    - `value_error`, `gradient_error`: the errors asked for [1].
    - `margin`: factor on the measured errors.
    - `quantities`, `variables`: names of the compared quantities and of the variables of their
      derivatives.
    - `scenes`: the number of scenes measured.
    - `reference_time`: run time of the reference with its gradient, all scenes together [s].

    >>> choice = fj.choose_fidelity(fj.scenes.rigid_wall(), gradient_error=None)
    >>> choice.fidelity.step, choice.quantities
    (0.001, ('peak_force',))
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

    def _printed(self) -> Table:
        return of_lines("Choice", str(self))


class NoFidelityError(RuntimeError):
    """No candidate meets the errors asked for. `evidence` is the `Choice` with all that was
    measured; its `fidelity` is the best that was found.

    >>> try:
    ...     fj.choose_fidelity(fj.scenes.rigid_wall(), value_error=1e-9, gradient_error=None)
    ... except fj.NoFidelityError as error:
    ...     print(f"own error of the reference: {error.evidence.reference_value_error:.0e}")
    own error of the reference: 5e-07
    """

    evidence: Choice

    def __init__(self, message: str, evidence: Choice):
        super().__init__(f"{message}\n{evidence}")
        self.evidence = evidence


def _shown(error: float | None) -> str:
    return "" if error is None else f"{error:.2e}"


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

    the largest over quantities and scenes. A candidate is accepted if, for both, `margin` times its
    error plus the reference's own error is at most the error asked for. The reference's own error
    is its difference from a run with twice its step, three quarters of its modes and friction
    smoothed over twice the speed.

    Candidates are tried by step, the longest first, and among those with the same step the finest
    first: where it fails, the others fail, too, and one compilation decides about all of them.
    Values come before gradients, which take longer to compile. Of the candidates that pass, the
    one with the shortest measured run time is chosen.

    **Arguments:**

    - `scene_or_scenes`: a scene, scenes stacked along a leading axis, or a sequence of these;
      scenes of one structure run as one batch (`fencejax.each_lane`), and times are sums over the
      batches.
    - `value_error`, `gradient_error`: largest errors allowed [1]; `gradient_error=None` judges by
      the value alone.
    - `quantities`: names of fields of `Result`.
    - `candidates`: default `fencejax.study.ladder()`.
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

    >>> choice = fj.choose_fidelity(fj.scenes.rigid_wall(), gradient_error=None)
    >>> choice.table[0].outcome, choice.table[1].outcome
    ('accurate enough', 'not tried: dearer')
    """
    value_error = _check.number("value_error", value_error, above=0.0)
    if gradient_error is not None:
        gradient_error = _check.number("gradient_error", gradient_error, above=0.0)
    if _check.number("margin", margin) < 1:
        raise ValueError(f"Argument `margin` must be at least 1, but is {margin:g}.")
    quantities = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    if not quantities:
        raise ValueError("Argument `quantities` must hold at least one name, but is empty.")
    for name in quantities:
        _check.choice("quantities", name, ESTIMATED)
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
    groups = grouped(scene_or_scenes, with_respect_to)
    judge = Judge(groups, quantities, reference, value_error, gradient_error, float(margin))
    remaining = distinct(candidates, [group.scenes for group in groups])
    return _Search(judge, remaining, names(groups, with_respect_to), progress).run()


class _Search:
    """Tries candidates, cheapest first, until one is accurate enough."""

    def __init__(
        self,
        judge: Judge,
        candidates: list[Fidelity],
        variables: tuple[str, ...],
        progress: Callable[[Trial], None] | None,
    ):
        self.judge, self.candidates, self.variables = judge, candidates, variables
        self.progress = progress
        self.remaining = list(candidates)
        self.trials: dict[Fidelity, Trial] = {}

    def evidence(self, fidelity: Fidelity | None) -> Choice:
        """All that was measured up to now."""
        judge = self.judge
        return Choice(
            fidelity=fidelity,
            table=tuple(self.trials[c] for c in self.candidates if c in self.trials),
            reference=judge.reference,
            companion=judge.companion,
            reference_value_error=judge.own_value,
            reference_gradient_error=judge.own_gradient,
            reference_time=judge.time,
            value_error=judge.value_bound,
            gradient_error=judge.gradient_bound,
            margin=judge.margin,
            quantities=judge.quantities,
            variables=self.variables,
            scenes=sum(group.lanes for group in judge.groups),
        )

    def drop(self, candidates: Sequence[Fidelity], why: str) -> None:
        """Enter candidates into the table without trying them."""
        for candidate in candidates:
            self.trials[candidate] = Trial(candidate, why)
            self.remaining.remove(candidate)

    def attempt(self, candidate: Fidelity) -> Trial:
        """Try a candidate. Where it is too inaccurate, no coarser one is tried afterwards: it could
        be more accurate only by chance. A step that Newton's method could not solve excludes no
        other candidate."""
        self.trials[candidate] = trial = self.judge.trial(candidate)
        self.remaining.remove(candidate)
        if self.progress is not None:
            self.progress(trial)
        if trial.outcome in (VALUE_FAILS, GRADIENT_FAILS):
            coarser = [c for c in self.remaining if as_fine(candidate, c)]
            self.drop(coarser, f"not tried: no finer than {describe(candidate)}")
        return trial

    def run(self) -> Choice:
        """Try the candidates in groups of equal step control, the cheapest group first."""
        if not self.judge.supported:
            raise NoFidelityError(
                "The reference is not converged well enough on these scenes to tell errors as "
                "small as those asked for. Ask for larger ones, or give a finer `reference`.",
                self.evidence(None),
            )
        while self.remaining:
            first = self.remaining[0]
            steps = first.step, first.step_tolerance
            alike = [c for c in self.remaining if (c.step, c.step_tolerance) == steps]
            # The finest: the one that decides about the most others, of several the most costly.
            finest = max(reversed(alike), key=lambda one: sum(as_fine(one, c) for c in alike))
            passed = [trial for trial in [self.attempt(finest)] if trial.passed]
            while passed and (cheaper := [c for c in alike if c in self.remaining]):
                trial = self.attempt(cheaper[0])
                if trial.passed:
                    passed.append(trial)
                    break
            if passed:
                self.drop(list(self.remaining), "not tried: dearer")
                return self.evidence(min(passed, key=lambda trial: trial.time).fidelity)
        best = min(self.trials.values(), key=self.judge.distance)
        raise NoFidelityError(
            f"No candidate is accurate enough on these scenes. The best found is "
            f"{describe(best.fidelity)}: {best.outcome}. Ask for larger errors, or give finer "
            "`candidates`.",
            self.evidence(best.fidelity),
        )
