"""Where each fidelity is right, where it warns and where it refuses."""

from .job import main as main
