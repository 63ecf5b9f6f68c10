"""The results of the job."""

import dataclasses

from fencejax.study import SweepTable


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the job found: the table, whether few enough lanes are bad, and the time it took
    [s]."""

    table: SweepTable
    succeeded: bool
    elapsed: float
