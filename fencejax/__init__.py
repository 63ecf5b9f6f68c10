"""Differentiable simulation and design of flexible sorting fences, in JAX."""

from . import (
    identify as identify,
    objectives as objectives,
    plot as plot,
    recording as recording,
    risk as risk,
    sampling as sampling,
    scene_numbers as scene_numbers,
    scenes as scenes,
    sensitivity as sensitivity,
    severity as severity,
)
from .belt import Belt as Belt, Border as Border
from .choice import (
    Choice as Choice,
    NoFidelityError as NoFidelityError,
    Trial as Trial,
    choose_fidelity as choose_fidelity,
)
from .compiler import tune_compiler as tune_compiler
from .design import DesignSpace as DesignSpace, DesignVariable as DesignVariable
from .drive import (
    AbstractDrive as AbstractDrive,
    ConstantSpeedDrive as ConstantSpeedDrive,
    HarmonicDrive as HarmonicDrive,
    HeldDrive as HeldDrive,
    SCurveDrive as SCurveDrive,
    SplineDrive as SplineDrive,
    TrapezoidDrive as TrapezoidDrive,
)
from .error import (
    ErrorEstimate as ErrorEstimate,
    GradientEstimate as GradientEstimate,
    estimate_gradient_error as estimate_gradient_error,
)
from .fence import Fence as Fence
from .fidelity import Fidelity as Fidelity
from .friction import Friction as Friction
from .journal import Journal as Journal
from .material import Material as Material
from .multistart import minimize_many as minimize_many
from .objectives import (
    LIMITS as LIMITS,
    OBJECTIVES as OBJECTIVES,
    Limit as Limit,
    Quantity as Quantity,
)
from .optimizer import (
    Optimum as Optimum,
    Program as Program,
    Record as Record,
    Stop as Stop,
    minimize as minimize,
)
from .parcel import Parcel as Parcel
from .response import Response as Response
from .result import Ledger as Ledger, Result as Result
from .scene_family import SceneFamily as SceneFamily
from .scenes import NormalScene as NormalScene, Scene as Scene
from .simulate import simulate as simulate
from .status import Status as Status, good as good, holds as holds
from .sweep import Sweep as Sweep
from .sweep_run import run_sweep as run_sweep
from .sweep_table import SweepTable as SweepTable
from .taper import (
    AbstractTaper as AbstractTaper,
    ConstantStrength as ConstantStrength,
    PowerTaper as PowerTaper,
    ProfileTaper as ProfileTaper,
    SteppedTaper as SteppedTaper,
    Uniform as Uniform,
)
from .verification import Verification as Verification, verify as verify
