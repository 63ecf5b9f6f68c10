"""Drive laws, one a file: the rigid link's angle over time, alpha_w(t), or the torque on it."""

from collections.abc import Mapping

from .abstract import (
    CYCLE_TIME as CYCLE_TIME,
    AbstractDrive as AbstractDrive,
    DriveMotion as DriveMotion,
)
from .constant_speed import ConstantSpeedDrive as ConstantSpeedDrive
from .harmonic import HarmonicDrive as HarmonicDrive
from .held import HeldDrive as HeldDrive
from .pneumatic import PneumaticDrive as PneumaticDrive
from .s_curve import SCurveDrive as SCurveDrive
from .spline import SplineDrive as SplineDrive
from .torque import AbstractTorqueDrive as AbstractTorqueDrive, TorqueDrive as TorqueDrive
from .trapezoid import TrapezoidDrive as TrapezoidDrive

DRIVES: Mapping[str, type[AbstractDrive]] = {
    "harmonic": HarmonicDrive,
    "held": HeldDrive,
    "constant_speed": ConstantSpeedDrive,
    "trapezoid": TrapezoidDrive,
    "s_curve": SCurveDrive,
    "spline": SplineDrive,
    "torque": TorqueDrive,
    "pneumatic": PneumaticDrive,
}
"""The laws by name."""
