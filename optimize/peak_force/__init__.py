"""The fence that hurts the parcel least: the smallest peak force over the worst of the impacts."""

from .job import main as main
