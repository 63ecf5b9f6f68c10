"""Fence, material and the drive's free-form motion designed together."""

from .job import main as main
