"""The measures of a scene, and their reliability: samples, running sums and peaks, the result, its
status and its errors.

May import: `model` and what is below it. Nothing here knows how a scene is advanced.

>>> result = fj.simulate(fj.scenes.rigid_wall())
>>> sorted(fj.results.MEASURES)[:3]
['contact_time', 'deepest', 'defect']
"""

from . import (
    accumulators as accumulators,
    belt_catch as belt_catch,
    diagnostics as diagnostics,
    error as error,
    hold as hold,
    peak_kink as peak_kink,
    rivals as rivals,
)
from .accumulators import (
    Accumulator as Accumulator,
    Course as Course,
    Step as Step,
    Trace as Trace,
)
from .error import (
    GradientEstimate as GradientEstimate,
    coarser as coarser,
    estimate_gradient_error as estimate_gradient_error,
)
from .error_estimate import ErrorEstimate as ErrorEstimate
from .gradient import (
    Gradient as Gradient,
)
from .interpolation import interpolate as interpolate
from .ledger import Ledger as Ledger
from .measures import ESTIMATED as ESTIMATED, MEASURES as MEASURES, Measure as Measure
from .peak import Peak as Peak, Span as Span
from .recorder import (
    Kept as Kept,
    NormalRecorder as NormalRecorder,
    SceneRecorder as SceneRecorder,
    running as running,
    traced as traced,
)
from .refinement import (
    Refined as Refined,
    climb as climb,
    refined as refined,
)
from .result import Result as Result, gather as gather
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
from .slopes import SlopeEvidence as SlopeEvidence
from .status import (
    DEEPEST as DEEPEST,
    LARGEST_BEND as LARGEST_BEND,
    NUMERICAL as NUMERICAL,
    Status as Status,
    counted as counted,
    worst as worst,
)
from .validity import (
    good as good,
    holds as holds,
)
