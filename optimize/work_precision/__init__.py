"""Speed against accuracy: what every fidelity costs and how wrong it is, value and gradient."""

from .job import main as main
