"""The results of the job."""

import dataclasses

from .cycle import Cycle, Stiff
from .maps import Maps
from .open_numbers import Variant
from .sensitivity import Sensitivities
from .statements import Finding


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the job. Cycles, `stiff` and maps have a lane a fence; `rigid` is the impact
    and the slide, one lane each, by an undeformable fence; `elapsed` [s] by part of the job."""

    impact: Cycle
    slide: Cycle
    rigid: Cycle
    stiff: Stiff
    maps: Maps
    sensitivities: Sensitivities
    findings: list[Finding]
    coarse: list[Finding]
    variants: list[tuple[Variant, list[Finding]]]
    elapsed: dict[str, float]

    @property
    def agrees(self) -> bool:
        """Whether the model contradicts only those statements of the paper that it is known to."""
        return all(f.verdict != "no" or f.contradicted for f in self.findings)
