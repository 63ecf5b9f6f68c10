"""The result of a simulation."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Array

from ..printing import known, numbers
from ..scenes import Body, NormalScene, Scene
from .accumulators import Trace
from .by_name import AbstractByName
from .error_estimate import ErrorEstimate
from .ledger import Ledger, ledger
from .measures import MEASURES, Measure
from .recorder import Record, Saved
from .sample import Sample
from .status import Status, counted


class Result(AbstractByName):
    """The outcome of a scene. Times are since its start [s]; the drive's clock then is at
    `start_time`. Numbers of parts that the scene does not have are 0, or `None` in the history;
    fields that were not asked for (`simulate(only=...)`) are `None`.

    Every measure is a field: `result.peak_force`.

    >>> result = fj.simulate(fj.scenes.rigid_wall())
    >>> print(f"{result.peak_force:.0f} N after {1e3 * result.peak_time:.1f} ms")
    3294 N after 17.4 ms
    """

    measures: dict[str, Array]
    """The measures that were asked for, by name."""
    final: Body
    """The parcel's motion at the end."""
    energy: Ledger
    """The energy ledger [J]."""
    start_time: Array
    """The drive's clock at the start [s]."""
    status: Array
    """A `Status`, as an integer (one a lane)."""
    history: Sample | None
    """Every sample, if asked for: each field with the time as its first axis. `history.at(times)`
    gives it at times of your own."""
    error: ErrorEstimate | None = None
    """Estimated errors of the measures, if asked for."""
    rung: Any = None
    """The rung of `Fidelity.ladder` at which the numbers were computed (one a lane; 0: the fidelity
    asked for), where refinement was asked for."""
    gradient_error: Array | None = None
    """Estimated error of the peak force's gradient [1], relative to its norm, by the steps or by
    another maximum that is about as high (`fencejax.results.slopes`). It exists where derivatives
    are computed (`has_aux=True` returns it with them), is infinite where none are, and `None` where
    there is no estimate."""

    _table = "measures"
    _known = MEASURES

    def _rows(self):
        named = {name: self.measures[name] for name in self._names}
        named |= {"start_time": self.start_time, "status": self.status}
        named = {name: leaf for name, leaf in named.items() if leaf is not None}
        if not known(*named.values()):
            return None
        whole = self.energy is not None and self.final is not None
        if not whole or not MEASURES.keys() <= self.measures.keys() or not self.status.size:
            rows = [(name, self._partial(name, leaf)) for name, leaf in named.items()]
            if self.energy is not None:
                rows.append(("energy.residual", numbers(self.energy.residual, "J")))
        elif self.status.ndim:
            rows = [("", self._summary())]
        else:
            rows = [("status", Status(int(self.status)).text)]
            if self.rung:
                finer = f"{self.rung} rungs finer than asked for, as it was in doubt"
                rows.append(("computed", finer))
            rows += [row for name in self._names if (row := self._row(name))]
            rows.append(("energy residual", f"{self.energy.residual:.2e} J"))
        return rows if self.error is None else [*rows, ("errors", f"estimated:\n{self.error}")]

    def _partial(self, name: str, leaf) -> str:
        """The text of a number of a partial result."""
        if name == "status" and not leaf.ndim:
            return Status(int(leaf)).text
        measure = MEASURES.get(name)
        return numbers(leaf, "1" if measure is None else measure.unit)

    @property
    def _names(self) -> list[str]:
        """The measures in the order of their table: a compiled function returns a dictionary
        sorted."""
        known = [name for name in MEASURES if name in self.measures]
        return [*known, *(name for name in self.measures if name not in MEASURES)]

    def _summary(self) -> str:
        """A line on a batch."""
        names = ", ".join(f"{name} {number}" for name, number in counted(self.status).items())
        force = np.asarray(self.measures["peak_force"])
        return (
            f"Result of {force.shape} lanes: {names}; peak force "
            f"{force.min():.4g} ... {force.max():.4g} N"
        )

    def _shown(self, name: str) -> str:
        measure = MEASURES.get(name)
        if measure is None:
            return f"{self.measures[name]:.6g}"
        number = measure.scale * self.measures[name]
        return f"{number:.{measure.digits}f} {measure.shown_unit or measure.unit}"

    def _row(self, name: str) -> tuple[str, str] | None:
        """Label and text of a measure's row; `None` for a measure without label or without
        contact."""
        measure = MEASURES.get(name)
        if measure is None:
            return name, self._shown(name)
        untouched = measure.accumulator.name == "contact" and np.isnan(self.first_contact)
        if not measure.label or untouched:
            return None
        note = measure.note.format_map(_Shown(self))
        return measure.label, f"{self._shown(name)}  {note}"


class _Shown(dict):
    """The measures of a result as text, by name."""

    def __init__(self, result: Result):
        self._result = result

    def __missing__(self, name: str) -> str:
        return self._result._shown(name)


def _if(wanted: bool, value: Any) -> Any:
    """The value if `wanted`, else `None`."""
    return value if wanted else None


def gather(
    record: Record,
    measures: Mapping[str, Measure],
    wanted: Mapping[str, bool],
    saved: Saved | None,
    start_time: Array,
    status: Array,
    scene: NormalScene | Scene,
) -> Result:
    """The result of a scene from a record and the values saved at every sample: the `measures`, and
    those of `final`, `energy` and `start_time` that are `wanted`."""
    states = record.states

    def read(measure: Measure) -> Array:
        source = measure.accumulator
        if isinstance(source, Trace):
            assert saved is not None
            found = saved.courses[source.name]
        else:
            found = states[source.name]
        return measure.read(found, scene) if measure.of_scene else measure.read(found)

    energy = None
    if wanted["energy"]:
        energy = ledger(states["origin"], record.last.energy, states["work"])
    return Result(
        measures={name: read(measure) for name, measure in measures.items()},
        final=_if(wanted["final"], record.last.body),
        energy=_if(wanted["energy"], energy),
        start_time=_if(wanted["start_time"], start_time),
        status=status,
        history=None if saved is None else saved.history,
    )
