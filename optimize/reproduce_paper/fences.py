"""The two fences that the paper compares."""

import fencejax as fj

FENCES = {"two-link": fj.Fence, "one-link": fj.Fence.one_link}
"""How each fence is made, by the name that tables and figures give it; `material` is the only
number that the paper leaves open."""

NAMES = tuple(FENCES)
JOINT = 0.45
"""Arc coordinate [m] of the joint of the two-link fence, R = l_s."""
FLEXIBLE = 0.75
"""Length [m] of the flexible link of the two-link fence, l_p."""
REACH = 1.2
"""Arc coordinate [m] of the tip of both fences, R_z = l_s + l_p."""
