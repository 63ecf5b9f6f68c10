"""All settings that trade speed for accuracy."""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from . import _check
from .printing import Readable, Table

if TYPE_CHECKING:
    from diffrax import AbstractSolver

# Duration from which a scene counts as long [s], and the longest stride in it [s].
_LONG, _STRIDE = 0.5, 2e-3

# The most elements, halvings of a step, and steps in a stride [1]: beyond, a program takes hours to
# make, or its counts of steps are no longer exact.
_ELEMENTS, _HALVINGS, _LONGEST = 1000, 30, 2**20

_INTEGRATORS = ("modal", "kvaerno5", "tsit5")

# Least values that single precision resolves: of a step [s], and of a smoothing [m/s], some
# thousand roundings of a belt's speed.
SINGLE_STEP, _SINGLE_SLIP = 1e-4, 2e-4


class Smoothing(NamedTuple):
    """The smoothing of dry friction's jump at rest: `slip_speed` eps [m/s], below which the force
    falls off, and `static_speed` w_s [m/s], over which the coefficient goes from static to kinetic.
    True sticking is the limit eps -> 0 with eps << w_s. Smoothed friction is largest at a creep of
    w_s ((eps / w_s) sqrt(mu_s / 2 (mu_s - mu_k)))^(1/2), and is less than mu_s there by (eps / w_s)
    sqrt(2 mu_s (mu_s - mu_k)), to the first order: 0.8 % of a normal force where static friction is
    0.5 and kinetic 0.35, in the named settings."""

    slip_speed: float
    static_speed: float

    @property
    def holds_below(self) -> float:
        """The creep [m/s] at which smoothed friction is largest where the kinetic friction is
        small. A corner that is slower sticks."""
        return math.sqrt(self.slip_speed * self.static_speed / math.sqrt(2))

    @property
    def slides_above(self) -> float:
        """The sliding speed [m/s] above which friction is kinetic: exp(-3^2) of the jump to static
        friction is left."""
        return 3 * self.static_speed


@dataclasses.dataclass(frozen=True, repr=False)
class Fidelity(Readable):
    """The settings of accuracy and cost of a simulation. All fields are static: they change the
    program.

    **Fields:**

    - `modes`: bending modes kept; 0 makes the fence rigid; `None` keeps all of them. Whether they
      are enough is judged by the same limit at every setting (`Status.MODES_TOO_FEW`).
    - `static_correction`: whether the static compliance of the modes left out is kept, as one
      massless mode under each contact, with its deflection, slope and damping.
    - `elements`: finite elements on the flexible link (20 in the paper), at most 1000.
    - `geometry`: `"chord"`, the paper's (2.14)-(2.17) with the element chords turned by their
      angles; `"arc"`, the same to the third order in the slope; or `"small"`, a small deflection
      normal to the straight line.
    - `load`: `"consistent"`, the contact force on the beam by virtual work, or `"shared"`, the
      paper's (2.8), linearly on the two nodes beside it (the modes left out by virtual work).
    - `step_tolerance`: the tolerance of the error control, in which the named settings differ. It
      bounds the distance of a contact force inside a step, normal or friction, from the line that
      the step is built on, relative to the largest normal force so far. A step above it is repeated
      with a shorter length, and steps become longer where the distance is small, each lane by
      itself. In single precision it is at least 4e-3, the accuracy to which forces are balanced.
      `None`: no control, fixed steps of `step`, as in `reference`.
    - `halvings`: how often a step may be halved for that, at most 30. Where the shortest steps are
      still above the tolerance, the status is `STEP_TOO_COARSE`.
    - `gradient_tolerance`: the largest estimated error of the peak force's gradient, relative to
      its norm (`Result.gradient_error`). Above it the status is `STEP_TOO_COARSE`, where a gradient
      is computed.
    - `step` [s]: the integrator's step where forces change smoothly, and the distance of samples in
      a contact (of a general integrator: of all samples).
    - `longest_stride`: how many such steps may be taken in one, a power of two, where no contact is
      about to begin or end and the forces change smoothly; 1: no longer steps. `None`: up to 2 ms
      under error control, and in scenes with contacts that last half a second and more, such as
      whole sorts; else 1.
    - `stride_tolerance`: the largest distance of the forces at the end of a longer step from their
      linear extrapolation, relative to their size. It affects derivatives more than values.
    - `iterations`: the largest number of Newton iterations in a step; one or two are usual, more
      where friction reverses.
    - `slip_speed`, `static_speed` [m/s]: the smoothing of dry friction, eps and w_s. Static
      friction falls to kinetic over w_s, as that of real pairs does, over 1 mm/s and more; the
      named settings have the same but for `reference`, which has a fifth of it. The largest
      smoothed friction is less than static friction by an amount that goes with eps / w_s, which
      is 1/50 in the named settings: 0.8 % of the normal force for friction of 0.5 and 0.35
      (`Smoothing`). The change of a sliding speed within the shortest step
      should be less than w_s, or a step may pass over the static friction where a corner comes to
      rest: the named settings allow 24 m/s^2, `coarse` 12. In single precision eps is at least
      2e-4 and w_s at least 1e-3, so that eps / w_s is 1/5: then the largest friction is 8 % of the
      normal force less than static friction.
    - `tip_fade` [m]: length beyond the fence's ends over which the contact force ends or, with
      `tip_contact` in the scene, on either side of where it passes from the corner to the tip.
    - `integrator`: `"modal"`, this package's own (exact in the beam, implicit in contact and
      friction), or a general one as an independent check: any solver of diffrax, such as
      `diffrax.Kvaerno5()`, or `"kvaerno5"` and `"tsit5"` for short. Explicit ones need steps below
      4e-8 s where all modes are kept.
    - `tolerance`: relative tolerance of a general integrator with adaptive steps; one without takes
      steps of `step`.
    - `precision`: `"float32"` or `"float64"` for the computation, whatever the precision of the
      scene's numbers and the results; by default the scene's own. Double precision requires JAX's
      `jax_enable_x64`.
    - `gradient`: `"forward"`, all derivatives in one batch of tangents (also with `jax.grad`), best
      below some 30 variables; or `"reverse"`, by checkpoints, for `jax.grad` in very many
      variables.

    The errors of peak forces and gradients under a good status, in random scenes and under a
    search, are in `tests/robustness/TRUST.md`; the cost of each named setting, and its errors in
    ordinary impacts, in `tests/peers/SPEED.md`. `choose_fidelity` measures both on your own scenes.

    >>> fj.Fidelity.coarse(step=2.5e-4)
    Fidelity.coarse(step=0.00025)
    >>> fj.Fidelity.standard().modes, fj.Fidelity.standard().step_tolerance
    (4, 0.0005)
    """

    modes: int | None = 4
    static_correction: bool = True
    elements: int = 20
    geometry: str = "arc"
    load: str = "consistent"
    step_tolerance: float | None = 5e-4
    halvings: int = 4
    gradient_tolerance: float = 0.1
    step: float = 5e-4
    longest_stride: int | None = None
    stride_tolerance: float = 1e-3
    iterations: int = 20
    slip_speed: float = 1.5e-5
    static_speed: float = 7.5e-4
    tip_fade: float = 5e-3
    integrator: "str | AbstractSolver" = "modal"
    tolerance: float = 1e-7
    precision: str | None = None
    gradient: str = "forward"

    def __post_init__(self):
        _check.count(
            "elements", self.elements, least=1, most=_ELEMENTS,
            remedy="The modes are those of a dense matrix with two rows an element.",
        )  # fmt: skip
        if self.modes is not None:
            _check.count("modes", self.modes)
            if self.modes > 2 * self.elements:
                raise ValueError(
                    f"Argument `modes` must be at most 2 `elements` = {2 * self.elements}, but is "
                    f"{self.modes}. Raise `elements`, or write `modes=None` for all of them."
                )
        _check.flag("static_correction", self.static_correction)
        _check.count("iterations", self.iterations, least=1)
        _check.count("halvings", self.halvings, most=_HALVINGS)
        if self.step_tolerance is not None:
            _check.number("step_tolerance", self.step_tolerance, above=0.0)
        if self.longest_stride is not None:
            _check.count("longest_stride", self.longest_stride, least=1, most=_LONGEST)
            if self.longest_stride & (self.longest_stride - 1):
                raise ValueError(
                    "Argument `longest_stride` must be a power of two, but is "
                    f"{self.longest_stride}."
                )
        positive = (
            "gradient_tolerance", "step", "stride_tolerance", "slip_speed", "static_speed",
            "tip_fade", "tolerance",
        )  # fmt: skip
        for name in positive:
            _check.number(name, getattr(self, name), above=0.0)
        _check.choice("geometry", self.geometry, ("small", "arc", "chord"))
        _check.choice("load", self.load, ("consistent", "shared"))
        if isinstance(self.integrator, str):
            _check.choice("integrator", self.integrator, _INTEGRATORS)
        else:
            from diffrax import AbstractSolver

            if not isinstance(self.integrator, AbstractSolver):
                raise TypeError(
                    f"Argument `integrator` must be one of {', '.join(_INTEGRATORS)} or a solver "
                    f"of diffrax, but is {self.integrator!r}. Write, for example, "
                    "integrator=diffrax.Kvaerno5()."
                )
        if self.precision is not None:
            _check.choice("precision", self.precision, ("float32", "float64"))
        _check.choice("gradient", self.gradient, ("forward", "reverse"))

    def _printed(self) -> Table:
        """The named setting with the fewest differences, with these: the call that makes this
        fidelity."""

        def others(rung: str) -> tuple[tuple[str, str], ...]:
            usual = vars(getattr(Fidelity, rung)())
            return tuple((k, repr(v)) for k, v in vars(self).items() if v != usual[k])

        rung = min(("standard", "fast", "coarse", "reference"), key=lambda name: len(others(name)))
        return Table(f"Fidelity.{rung}", others(rung), inline=True)

    @property
    def mode_count(self) -> int:
        """Number of modes kept."""
        return 2 * self.elements if self.modes is None else self.modes

    @property
    def residual(self) -> bool:
        """Whether modes are left out whose static compliance is kept."""
        return self.static_correction and 0 < self.mode_count < 2 * self.elements

    def single(self) -> "Fidelity":
        """The same with a smoothing of friction that single precision resolves."""
        return self.replace(
            slip_speed=max(self.slip_speed, _SINGLE_SLIP),
            static_speed=max(self.static_speed, 5 * _SINGLE_SLIP),
        )

    def settled(self, duration: float) -> "Fidelity":
        """The same with a `longest_stride` for a scene with contacts of this duration [s]. For 0,
        where nothing can touch, it is without error control, which is one of contact forces."""
        if self.integrator != "modal":
            return self.replace(longest_stride=1, step_tolerance=None)
        if duration == 0:
            return self.replace(step_tolerance=None, longest_stride=self.longest_stride or 1)
        if self.longest_stride is not None:
            return self
        longest = 1
        allowed = duration >= _LONG or self.step_tolerance is not None
        while allowed and 2 * longest * self.step <= _STRIDE * (1 + 1e-9):
            longest *= 2
        return self.replace(longest_stride=longest)

    @property
    def smoothing(self) -> Smoothing:
        """The smoothing of dry friction."""
        return Smoothing(self.slip_speed, self.static_speed)

    def replace(self, **changes) -> "Fidelity":
        """The same with some settings changed."""
        return dataclasses.replace(self, **changes)

    def ladder(self, scene: Any = None) -> "tuple[Fidelity, ...]":
        """This fidelity and two finer ones, for numbers with a numerical status
        (`Status.numerical`) of a scene or a batch of scenes; without a scene, for JAX's default
        precision.

        The second has at least eight modes, a fifth of the tolerance, half the step and a quarter
        of a millisecond at most, and half of the friction's smoothing. The third has the modes and
        the smoothing of `reference`, a fiftieth of the tolerance and steps of a tenth of a
        millisecond at most. Where those are a quarter of this one's or less, `halvings` is one
        less: with steps that are short compared with the smoothing of friction, the test of whether
        friction is resolved would fail. Where this one has no error control, the second has steps
        of an eighth of a millisecond at most, and the third those of `reference`. Both keep this
        one's geometry, so that the same model is refined: the paper's chords are within 5e-4 of the
        arc, and their derivatives cost ten times as much. They also keep its longest stride, over
        which no contact begins or ends: a whole sort would have 60,000 short steps otherwise, most
        of them without any contact. In single precision the ladder ends before a fidelity that this
        does not resolve.

        A fidelity with the step of `reference` or a shorter one has one finer rung: twice the
        modes, half the step and half of the smoothing.
        """
        last = Fidelity.reference()

        def with_modes(least: int) -> int | None:
            """At least so many modes, or all that the elements have; none for a rigid fence."""
            if not self.modes:
                return self.modes
            return max(self.modes, min(least, 2 * self.elements))

        numbers = jax.tree.leaves(scene) or [float]
        single = (self.precision or str(jnp.result_type(*numbers))) == "float32"

        if self.step <= last.step:
            beyond = self.replace(
                modes=with_modes(2 * self.mode_count),
                step=self.step / 2,
                slip_speed=self.slip_speed / 2,
                static_speed=self.static_speed / 2,
            )
            return (self,) if single else (self, beyond)

        tolerance = self.step_tolerance
        follows = tolerance is not None
        finer = self.replace(
            modes=with_modes(8),
            step=min(self.step / 2, 2.5e-4 if follows else 1.25e-4),
            step_tolerance=tolerance / 5 if follows else None,
            slip_speed=self.slip_speed / 2,
            static_speed=self.static_speed / 2,
        )
        step = min(finer.step, 1e-4 if follows else last.step)
        finest = self.replace(
            modes=with_modes(last.mode_count),
            step=step,
            halvings=max(self.halvings - 1, 0) if 4 * step <= self.step else self.halvings,
            step_tolerance=tolerance / 50 if follows else None,
            slip_speed=min(finer.slip_speed, last.slip_speed),
            static_speed=min(finer.static_speed, last.static_speed),
        )
        if single:
            return (self, finer) if finer.step >= SINGLE_STEP else (self,)
        return self, finer, finest

    @classmethod
    def coarse(cls, **changes) -> "Fidelity":
        """A tolerance of 0.5 %, steps of 1 ms at most, three modes: for sweeps."""
        # Half of the promised error of a gradient, as the error may be nearly twice the estimate.
        settings = dict(
            modes=3, step=1e-3, step_tolerance=5e-3, gradient_tolerance=0.25,
            stride_tolerance=5e-3,
        )  # fmt: skip
        return cls(**{**settings, **changes})

    @classmethod
    def fast(cls, **changes) -> "Fidelity":
        """A tolerance of 0.1 %, steps of 0.5 ms at most, four modes: for searches. Its worst
        gradients are those of parcels whose friction reverses near the peak.
        """
        settings = dict(step_tolerance=1e-3, gradient_tolerance=0.2, stride_tolerance=5e-3)
        return cls(**{**settings, **changes})

    @classmethod
    def standard(cls, **changes) -> "Fidelity":
        """The default: a tolerance of 0.05 %, steps of 0.5 ms at most, four modes, static friction
        smoothed over 0.75 mm/s. Wider ranges than those of ordinary impacts give worse cases: use
        `choose_fidelity`.
        """
        return cls(**changes)

    @classmethod
    def reference(cls, **changes) -> "Fidelity":
        """Twelve modes, the paper's chords, fixed steps of 25 us, static friction smoothed over
        0.15 mm/s; for double precision, and some ten times the cost of `standard`. It shares no
        error control with the settings that are measured against it.
        """
        settings = dict(
            modes=12, geometry="chord", step=2.5e-5, step_tolerance=None, longest_stride=1,
            slip_speed=3e-6, static_speed=1.5e-4,
        )
        return cls(**{**settings, **changes})
