"""A sorter described once, with its parcels and what is asked of it, and its design problem.

May import: everything below it. What a sorter file says is read in `reading` (parts), `parcels` and
`amounts` (units); `machine` holds the parts that result, `problem` makes them a design problem, and
`solution` solves and explains it. A new limit is one row of `limits`; a new key of a sorter file is
a field of its part.

>>> print(f"{fj.sorter.amount('thickness', '45 mm', 'm'):.3f}")
0.045
"""

from .amounts import (
    amount as amount,
)
from .description import (
    ImplausibleNumberWarning as ImplausibleNumberWarning,
    Sorter as Sorter,
)
from .limits import (
    LIMIT_ROWS as LIMIT_ROWS,
    LimitRow as LimitRow,
    settled as settled,
)
from .machine import (
    SECTIONS as SECTIONS,
    Machine as Machine,
    Objective as Objective,
    scene_path as scene_path,
)
from .overrides import (
    span as span,
    value as value,
)
from .parcels import (
    Parcels as Parcels,
)
from .plausibility import (
    doubt as doubt,
)
from .problem import (
    Candidate as Candidate,
    Measured as Measured,
    SorterProblem as SorterProblem,
)
from .solution import (
    Look as Look,
    Price as Price,
    Solution as Solution,
    constant_push as constant_push,
    look as look,
    rigid as rigid,
    solve as solve,
)
