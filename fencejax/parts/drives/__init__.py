"""Drive laws, one a file: the angle of the rigid link over time, alpha_w(t)."""

from collections.abc import Mapping

from .abstract import (
    CYCLE_TIME as CYCLE_TIME,
    AbstractDrive as AbstractDrive,
    DriveMotion as DriveMotion,
)
from .constant_speed import ConstantSpeedDrive as ConstantSpeedDrive
from .harmonic import HarmonicDrive as HarmonicDrive
from .held import HeldDrive as HeldDrive
from .s_curve import SCurveDrive as SCurveDrive
from .spline import SplineDrive as SplineDrive
from .trapezoid import TrapezoidDrive as TrapezoidDrive

DRIVES: Mapping[str, type[AbstractDrive]] = {
    "harmonic": HarmonicDrive,
    "held": HeldDrive,
    "constant_speed": ConstantSpeedDrive,
    "trapezoid": TrapezoidDrive,
    "s_curve": SCurveDrive,
    "spline": SplineDrive,
}
"""The laws by name."""
