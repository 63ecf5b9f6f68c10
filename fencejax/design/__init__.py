"""Constrained optimisation: design variables, objectives, limits, risk, and the optimisers.

May import: `results` and what is below it. Nothing here runs a simulation: a problem is a function
that its caller writes. A new objective or limit is one row of `objectives`, or a `Quantity` with a
measure of its own, as those of `drivability`, `fatigue`, `shock` and `sorting` are.

>>> fj.minimize(lambda z: (z**2, z - 0.5, jnp.zeros(1, int)), [0.9]).point.round(4)
array([0.5])
"""

from . import (
    drivability as drivability,
    fatigue as fatigue,
    objectives as objectives,
    quadratic_program as quadratic_program,
    risk as risk,
    shock as shock,
    sorting as sorting,
)
from .evaluator import (
    Evaluator as Evaluator,
    Record as Record,
)
from .first_order import (
    FirstOrder as FirstOrder,
)
from .journal import (
    Journal as Journal,
)
from .lagrangian import (
    Evaluation as Evaluation,
    Multipliers as Multipliers,
    augmented as augmented,
    onto_simplex as onto_simplex,
)
from .multistart import (
    minimize_many as minimize_many,
)
from .objectives import (
    LIMITS as LIMITS,
    OBJECTIVES as OBJECTIVES,
    Limit as Limit,
    Quantity as Quantity,
    fields as fields,
    measures as measures,
)
from .optimizer import (
    minimize as minimize,
)
from .optimum import (
    Optimum as Optimum,
    Stop as Stop,
    shadow_prices as shadow_prices,
)
from .prices import (
    ShadowPrices as ShadowPrices,
    conflict as conflict,
)
from .program import (
    LaneProgram as LaneProgram,
    Numbers as Numbers,
    Program as Program,
)
from .relaxation import (
    RELAXED as RELAXED,
    Bounded as Bounded,
    Relaxation as Relaxation,
    relaxations as relaxations,
)
from .ring_down import (
    RING_AMPLITUDE as RING_AMPLITUDE,
    ring_amplitude as ring_amplitude,
)
from .risk import quantile as quantile
from .spline_motion import (
    extremes as extremes,
)
from .sqp import (
    Sequence as Sequence,
)
from .sqp_model import (
    before as before,
)
from .variables import (
    VARIABLES as VARIABLES,
    DesignSpace as DesignSpace,
    DesignVariable as DesignVariable,
    variable as variable,
)
from .verification import (
    Verification as Verification,
    verify as verify,
)
