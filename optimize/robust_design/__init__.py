"""The fence for parcels as they come."""

from .job import main as main
