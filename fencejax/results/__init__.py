"""What is measured of a scene, and whether it can be relied on: samples, running sums and peaks,
the result, its status and its errors.

May import: `model` and what is below it. Nothing here knows how a scene is advanced.
"""

from . import (
    accumulators as accumulators,
    diagnostics as diagnostics,
    error as error,
)
from .accumulators import (
    Tally as Tally,
)
from .diagnostics import (
    unresolved as unresolved,
)
from .error import (
    GradientEstimate as GradientEstimate,
    estimate_gradient_error as estimate_gradient_error,
)
from .error_estimate import (
    FIELDS as FIELDS,
    UNITS as UNITS,
    ErrorEstimate as ErrorEstimate,
)
from .result import (
    Ledger as Ledger,
    Result as Result,
    gather as gather,
)
from .sample import (
    Energy as Energy,
    Power as Power,
    Sample as Sample,
    bent as bent,
    carried as carried,
    damping_power as damping_power,
    describe as describe,
    strain_energy as strain_energy,
)
from .status import (
    NUMERICAL as NUMERICAL,
    Status as Status,
    worst as worst,
)
from .validity import (
    good as good,
    holds as holds,
)
