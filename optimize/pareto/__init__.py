"""The front of the worst peak force against what it costs."""

from .job import main as main
