"""The fence for one's own machine: described by a sorter file, designed for each material."""

from .job import main as main
