"""The paper recomputed: every numerical result, for both of its fences."""

from .job import main as main
