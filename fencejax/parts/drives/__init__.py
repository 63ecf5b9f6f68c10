"""Drive laws, one a file: the angle of the rigid link over time, alpha_w(t)."""

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
