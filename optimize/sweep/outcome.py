"""The results of the job."""

import dataclasses

from fencejax.study import SweepTable


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the job: the table, whether few enough lanes are bad, and the time [s]."""

    table: SweepTable
    succeeded: bool
    elapsed: float
