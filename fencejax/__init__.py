"""Differentiable simulation and design of flexible sorting fences, in JAX.

`simulate(scenes.oblique_impact())` runs a scene. The user's functions and classes are here, and in
these modules: `fj.scenes` (`fencejax.scenes`), `fj.plot` (`fencejax.plot`), `fj.materials`
(`fencejax.parts.materials`), `fj.contact_laws` (`fencejax.parts.contact_laws`), `fj.friction_laws`
(`fencejax.parts.friction_laws`), `fj.surfaces` (`fencejax.parts.surfaces`), `fj.scene_numbers`
(`fencejax.scenes.numbers`), `fj.objectives` (`fencejax.design.objectives`), `fj.risk`
(`fencejax.design.risk`), `fj.shock` (`fencejax.design.shock`), `fj.sampling`
(`fencejax.study.sampling`), `fj.sensitivity` (`fencejax.study.sensitivity`), `fj.recording`
(`fencejax.study.recording`) and `fj.identify` (`fencejax.study.identify`). To extend the package,
see its rooms `parts`, `scenes`, `model`, `integrators`, `results`, `design`, `plot`, `study` and
`sorter`, each with a page on its contents.

Examples take `import fencejax as fj`, `import jax, jax.numpy as jnp`, `import numpy as np` and
double precision for granted (`jax.config.update("jax_enable_x64", True)`).

>>> result = fj.simulate(fj.scenes.oblique_impact())
>>> print(f"{result.peak_force:.0f} N, {1e3 * result.tip_deflection:.0f} mm")
1116 N, 65 mm
"""

import importlib as _importlib
from importlib import metadata as _metadata
from typing import TYPE_CHECKING as _TYPE_CHECKING

from . import (
    integrators as integrators,
    model as model,
    parts as parts,
    results as results,
    scenes as scenes,
)
from ._kept_programs import cache_programs as cache_programs
from ._xla import tune_compiler as tune_compiler
from .fidelity import Fidelity as Fidelity
from .lanes import each_lane as each_lane
from .parts import (
    AbstractDrive as AbstractDrive,
    AbstractTaper as AbstractTaper,
    AbstractTorqueDrive as AbstractTorqueDrive,
    Belt as Belt,
    Border as Border,
    ConstantSpeedDrive as ConstantSpeedDrive,
    ConstantStrength as ConstantStrength,
    Fence as Fence,
    Friction as Friction,
    HarmonicDrive as HarmonicDrive,
    HeldDrive as HeldDrive,
    Material as Material,
    Motor as Motor,
    Pad as Pad,
    Parcel as Parcel,
    PneumaticDrive as PneumaticDrive,
    PowerTaper as PowerTaper,
    ProfileTaper as ProfileTaper,
    RestShape as RestShape,
    SCurveDrive as SCurveDrive,
    SecondOrderLoads as SecondOrderLoads,
    Shaft as Shaft,
    Shear as Shear,
    SplineDrive as SplineDrive,
    SteppedTaper as SteppedTaper,
    TorqueDrive as TorqueDrive,
    TrapezoidDrive as TrapezoidDrive,
    Uniform as Uniform,
    contact_laws as contact_laws,
    friction_laws as friction_laws,
    materials as materials,
    surfaces as surfaces,
)
from .results import (
    ErrorEstimate as ErrorEstimate,
    Gradient as Gradient,
    GradientEstimate as GradientEstimate,
    Ledger as Ledger,
    Measure as Measure,
    Result as Result,
    Status as Status,
    estimate_gradient_error as estimate_gradient_error,
    good as good,
    holds as holds,
)
from .scenes import NormalScene as NormalScene, Scene as Scene
from .simulate import simulate as simulate

if _TYPE_CHECKING:
    from . import (
        design as design,
        plot as plot,
        sorter as sorter,
        study as study,
    )
    from .design import (
        LIMITS as LIMITS,
        OBJECTIVES as OBJECTIVES,
        DesignSpace as DesignSpace,
        DesignVariable as DesignVariable,
        Journal as Journal,
        LaneProgram as LaneProgram,
        Limit as Limit,
        Optimum as Optimum,
        Program as Program,
        Quantity as Quantity,
        Record as Record,
        Stop as Stop,
        Verification as Verification,
        minimize as minimize,
        minimize_many as minimize_many,
        objectives as objectives,
        risk as risk,
        shock as shock,
        verify as verify,
    )
    from .sorter import Sorter as Sorter
    from .study import (
        Choice as Choice,
        Curvature as Curvature,
        NoFidelityError as NoFidelityError,
        Reliability as Reliability,
        Response as Response,
        SceneFamily as SceneFamily,
        Sweep as Sweep,
        SweepTable as SweepTable,
        Trial as Trial,
        choose_fidelity as choose_fidelity,
        curvature as curvature,
        failure_probability as failure_probability,
        identify as identify,
        recording as recording,
        run_sweep as run_sweep,
        sampling as sampling,
        sensitivity as sensitivity,
        simulate_many as simulate_many,
    )

# Rooms that many programs never enter, and what is here of each: imported where it is first asked
# for, as half of the package's files are theirs.
_LATER = {
    "plot": (),
    "design": (
        "LIMITS", "OBJECTIVES", "DesignSpace", "DesignVariable", "Journal", "LaneProgram", "Limit",
        "Optimum", "Program", "Quantity", "Record", "Stop", "Verification", "minimize",
        "minimize_many", "objectives", "risk", "shock", "verify",
    ),
    "sorter": ("Sorter",),
    "study": (
        "Choice", "Curvature", "NoFidelityError", "Reliability", "Response", "SceneFamily", "Sweep",
        "SweepTable", "Trial", "choose_fidelity", "curvature", "failure_probability", "identify",
        "recording", "run_sweep", "sampling", "sensitivity", "simulate_many",
    ),
}  # fmt: skip

scene_numbers = scenes.numbers
__version__ = _metadata.version("fencejax")

__all__ = [
    "AbstractDrive",
    "AbstractTaper",
    "AbstractTorqueDrive",
    "Belt",
    "Border",
    "Choice",
    "Curvature",
    "ConstantSpeedDrive",
    "ConstantStrength",
    "DesignSpace",
    "DesignVariable",
    "ErrorEstimate",
    "Fence",
    "Fidelity",
    "Friction",
    "Gradient",
    "GradientEstimate",
    "HarmonicDrive",
    "HeldDrive",
    "Journal",
    "LIMITS",
    "LaneProgram",
    "Ledger",
    "Limit",
    "Material",
    "Measure",
    "Motor",
    "NoFidelityError",
    "NormalScene",
    "OBJECTIVES",
    "Optimum",
    "Pad",
    "Parcel",
    "PneumaticDrive",
    "PowerTaper",
    "ProfileTaper",
    "Program",
    "Quantity",
    "Record",
    "Reliability",
    "Response",
    "RestShape",
    "Result",
    "SCurveDrive",
    "Scene",
    "SceneFamily",
    "SecondOrderLoads",
    "Shaft",
    "Shear",
    "Sorter",
    "SplineDrive",
    "Status",
    "SteppedTaper",
    "Stop",
    "Sweep",
    "SweepTable",
    "TorqueDrive",
    "TrapezoidDrive",
    "Trial",
    "Uniform",
    "Verification",
    "cache_programs",
    "choose_fidelity",
    "curvature",
    "contact_laws",
    "design",
    "each_lane",
    "estimate_gradient_error",
    "failure_probability",
    "friction_laws",
    "good",
    "holds",
    "identify",
    "integrators",
    "materials",
    "minimize",
    "minimize_many",
    "model",
    "objectives",
    "parts",
    "plot",
    "recording",
    "results",
    "risk",
    "run_sweep",
    "sampling",
    "scene_numbers",
    "scenes",
    "sensitivity",
    "shock",
    "simulate",
    "simulate_many",
    "sorter",
    "study",
    "surfaces",
    "tune_compiler",
    "verify",
]


def __dir__():
    return [*__all__, "__version__"]


def __getattr__(name: str):
    for room, names in _LATER.items():
        if name == room or name in names:
            found = _importlib.import_module(f".{room}", __name__)
            found = found if name == room else getattr(found, name)
            globals()[name] = found
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
