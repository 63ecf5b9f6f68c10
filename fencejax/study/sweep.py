"""The definition of a sweep: scenes of a family at the points of a sample, one a lane."""

import dataclasses
import hashlib
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .. import _check
from .._identity import description, edition, refused
from ..fidelity import Fidelity
from ..results import MEASURES, Ledger, Measure, Result
from ..simulate import simulate
from .sampling import Samples
from .scene_family import SceneFamily, described
from .sweep_table import IMPOSSIBLE, derivative

OUTPUTS: dict[str, str] = {
    **{name: measure.unit for name, measure in MEASURES.items()},
    "start_time": "s",
    "final.x": "m",
    "final.y": "m",
    "final.angle": "rad",
    "final.x_rate": "m/s",
    "final.y_rate": "m/s",
    "final.spin": "rad/s",
    **{f"energy.{field.name}": "J" for field in dataclasses.fields(Ledger)},
    "energy.residual": "J",
}
"""Fields of `fencejax.Result` that a sweep can keep, with their units."""

@dataclasses.dataclass(frozen=True, eq=False)
class Sweep:
    """A sweep: scenes of a family at the points of a sample.

    **Fields:**

    - `family`: of the scenes; its names are the samples' variables, in order.
    - `samples`: the points.
    - `outputs`: names of `OUTPUTS` and of `measures`; the status is always kept.
    - `gradient_of`: one of the outputs, whose exact derivatives in all variables are kept too, or
      `None`. A sweep then takes two to four times as long.
    - `fidelity`: default `Fidelity.standard()`.
    - `measures`: own measures that the outputs name.
    - `refine`: whether lanes in numerical doubt (`Status.numerical`) are computed again at the next
      rungs of `Fidelity.ladder`; the column `rung` is then the rung of each lane's numbers.

    Raises `ValueError` for unknown names, and where a variable's bound gives no scene for any
    values of the others (see `SceneFamily.check`). Single lanes without a scene are counted as
    `IMPOSSIBLE`.

    >>> samples = fj.sampling.given({"mass": [5.0, 15.0]})
    >>> sweep = fj.Sweep(fj.SceneFamily("oblique_impact", samples.names), samples)
    >>> sweep.outputs, sweep.units["mass"]
    (('peak_force', 'tip_deflection'), 'kg')
    """

    family: SceneFamily
    samples: Samples
    outputs: Sequence[str] = ("peak_force", "tip_deflection")
    gradient_of: str | None = None
    fidelity: Fidelity = dataclasses.field(default_factory=Fidelity.standard)
    measures: Sequence[Measure] = ()
    refine: bool = True

    def __post_init__(self):
        outputs = _check.several("outputs", self.outputs)
        object.__setattr__(self, "outputs", tuple(dict.fromkeys(outputs)))
        for name in self.outputs:
            _check.choice("outputs", name, tuple(self._known))
        if not self.outputs:
            raise ValueError("Argument `outputs` must name at least one output, but is empty.")
        if self.gradient_of is not None:
            _check.choice("gradient_of", self.gradient_of, tuple(self.outputs))
        if self.family.names != self.samples.names:
            raise ValueError(
                f"Argument `family` must have the names of the samples {self.samples.names}, but "
                f"has {self.family.names}."
            )
        if not isinstance(self.fidelity, Fidelity):
            raise TypeError(
                f"Argument `fidelity` must be a `fencejax.Fidelity`, but is {self.fidelity!r}."
            )
        self.family.check(self.samples.variables)

    @property
    def _known(self) -> dict[str, str]:
        """Units of all possible outputs."""
        return OUTPUTS | {measure.name: measure.unit for measure in self.measures}

    @property
    def units(self) -> dict[str, str]:
        """Units of the variables and the outputs."""
        return {
            **{v.name: v.unit for v in self.samples.variables},
            **{name: self._known[name] for name in self.outputs},
        }

    @property
    def columns(self) -> dict[str, str]:
        """The columns of each lane, with their units: the outputs, and the derivatives of one of
        them, named `d_OUTPUT_d_VARIABLE`. The status is a further column."""
        kept = {name: self._known[name] for name in self.outputs}
        if self.gradient_of is not None:
            unit = self._known[self.gradient_of]
            for v in self.samples.variables:
                kept[derivative(self.gradient_of, v.name)] = f"({unit}) / ({v.unit})"
        return kept

    @property
    def lane(self) -> "Lane":
        """The computation at each point."""
        return Lane(
            self.family,
            tuple(self.outputs),
            self.gradient_of,
            self.fidelity,
            tuple(self.measures),
            self.refine,
        )

    def describe(self) -> dict[str, Any]:
        """Everything that the results depend on, as plain numbers, names, lists and
        dictionaries."""
        samples = self.samples
        return self.lane.describe() | {
            "samples": {
                "kind": samples.kind,
                "seed": samples.seed,
                "shape": list(samples.shape),
                "variables": [dataclasses.asdict(v) for v in samples.variables],
                "values": hashlib.sha256(samples.values.tobytes()).hexdigest(),
            },
        }


@dataclasses.dataclass(frozen=True, eq=False)
class Lane:
    """The computation of a sweep at each of its points (see `Sweep` for the fields)."""

    family: SceneFamily
    outputs: tuple[str, ...]
    gradient_of: str | None
    fidelity: Fidelity
    measures: tuple[Measure, ...] = ()
    refine: bool = False

    def rungs(self) -> "tuple[Lane, ...]":
        """The same at the finer fidelities, at which lanes in doubt are computed again."""
        finer = self.fidelity.ladder()[1:] if self.refine else ()
        return tuple(dataclasses.replace(self, fidelity=each, refine=False) for each in finer)

    def describe(self) -> dict[str, Any]:
        """Everything that the results of a point depend on, as plain numbers, names and so on.

        Raises `ValueError` for a measure or a part whose identity cannot be determined.
        """
        fields = dataclasses.fields(self.fidelity)
        return {
            "fencejax": edition(),
            "precision": str(jnp.result_type(float)),
            **refused("family", lambda: described(self.family)),
            "outputs": list(self.outputs),
            "gradient_of": self.gradient_of,
            "measures": refused("measures", lambda: description(self.measures)),
            "refine": self.refine,
            "fidelity": refused(
                "fidelity",
                lambda: {f.name: description(getattr(self.fidelity, f.name)) for f in fields},
            ),
        }

    def __call__(self, values: Array) -> dict[str, Array]:
        """Outputs by name, `status` and `gradient` of one point [SI], of shape (n,). Traced."""
        fields = {name.partition(".")[0] for name in self.outputs}

        def outcome(point: Array):
            scene = self.family.scene(point)
            result = simulate(
                scene,
                fidelity=self.fidelity,
                history=False,
                only=tuple(sorted(fields)),
                measures=self.measures,
            )
            found = {name: _read(result, name) for name in self.outputs}
            main = found[self.gradient_of or self.outputs[0]]
            return main, (found, result.status, self.family.possible(scene))

        if self.gradient_of is None:
            _, (found, status, possible) = outcome(values)
        else:
            differentiated = jax.value_and_grad(outcome, has_aux=True)
            (_, (found, status, possible)), slope = differentiated(values)
            found = found | {"gradient": slope}
        found = {name: jnp.where(possible, leaf, jnp.nan) for name, leaf in found.items()}
        code = jnp.asarray(IMPOSSIBLE, status.dtype)
        return found | {"status": jnp.where(possible, status, code)}


def _read(result: Result, name: str) -> Array:
    leaf: Any = result
    for part in name.split("."):
        leaf = getattr(leaf, part)
    return leaf
