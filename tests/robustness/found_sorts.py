"""Sorts that a search found wrong under a good status, by what happens in them.

Each has its kind (`searched_scenes.KINDS`), its numbers and, where a test asks for the value, its
peak force by sixteen modes and steps that follow their error to a 256th of the tolerance of
`standard`; fixed steps of 10 us give the same to 0.1 %.
"""

import json
from pathlib import Path

from robustness.peaks import over_speeds

FOUND = json.loads(Path(__file__).with_suffix(".json").read_text())


def course(name, low, high, count, fidelity=None):
    """The course over belt speeds (`peaks.over_speeds`) of the sort of that name."""
    found = FOUND[name]
    return over_speeds(found["numbers"], low, high, count, fidelity, found["kind"])
