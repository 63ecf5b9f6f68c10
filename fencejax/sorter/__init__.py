"""The description of a sorter with its parcels, limits and objective, and its design problem.

May import: everything below it. `reading` (parts), `parcels` and `amounts` (units) read a sorter
file; `machine` has the resulting parts, `problem` defines the design problem, and `solution` solves
and explains it. A new limit is one row of `limits`; a new key of a sorter file is a field of its
part.

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
    scene_path as scene_path,
)
from .objective import (
    Objective as Objective,
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
