"""What a short search for errors of the steps finds. `search.py` beside this file goes on."""

from robustness import truths
from robustness.search import search

import fencejax as fj

COARSE = fj.Fidelity.coarse(longest_stride=1)


def test_error_found_is_in_proportion_to_the_tolerance():
    # Over twenty-four generations of 128 it comes to two or three times the tolerance
    # (`search.json`); a step's defect counts once before the peak and once in its place.
    fidelity = COARSE.replace(step_tolerance=1e-2)
    truth = truths.fixed(fidelity, 1.25e-5)
    found = search(fidelity, truth, "realistic", "value", 32, 3, seed=7)
    assert found.good > 0.4
    assert found.course[-1] < 4e-2, found.worst
