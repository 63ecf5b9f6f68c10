"""Sweeps: scenes over a grid, a Latin hypercube or a Sobol sequence of any of their numbers."""

from .job import main as main
