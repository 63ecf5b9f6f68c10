"""Advancing a scene in time: the package's own step and its loop, and diffrax's general solvers
as a reference.

May import: `model` and what is below it. Nothing here knows what is measured.

>>> fj.Fidelity(integrator="tsit5").integrator
'tsit5'
"""

from . import (
    corner_way as corner_way,
    diffrax_reference as diffrax_reference,
    friction_turn as friction_turn,
    modal_step as modal_step,
    normal_direction as normal_direction,
    sliding_corner as sliding_corner,
    step_defect as step_defect,
    time_loop as time_loop,
)
from .newton import (
    eliminate as eliminate,
    solve as solve,
)
from .step_memory import (
    Memory as Memory,
)
from .step_size import (
    Clock as Clock,
    StepSize as StepSize,
    next_step_size as next_step_size,
    stride_counts as stride_counts,
    units as units,
)
