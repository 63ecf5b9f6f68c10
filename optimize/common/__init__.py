"""Shared parts of the jobs: command lines, reports, encounters, starting designs."""
