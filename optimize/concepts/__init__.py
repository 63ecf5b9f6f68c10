"""Which concept of softening wins: each one's front of force over parcels an hour."""

from .job import main as main
