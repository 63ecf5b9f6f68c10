"""The two fences that the paper compares."""

import fencejax as fj

FENCES = {"two-link": fj.Fence, "one-link": fj.Fence.one_link}
"""The functions that make the fences, by their names in tables and figures; `material` is the only
argument that the paper leaves open."""

NAMES = tuple(FENCES)
JOINT = 0.45
"""Arc coordinate [m] of the joint of the two-link fence, R = l_s."""
FLEXIBLE = 0.75
"""Length [m] of the flexible link of the two-link fence, l_p."""
REACH = 1.2
"""Arc coordinate [m] of the tip of both fences, R_z = l_s + l_p."""
