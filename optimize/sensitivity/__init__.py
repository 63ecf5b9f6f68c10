"""What counts, and how much: derivatives at a point, along a line, and over whole ranges."""

from .job import main as main
