"""A short search for errors of the steps; `search.py` beside this file searches longer."""

import json

import numpy as np
from robustness import truths
from robustness.offline_fuzz import PROMISE
from robustness.search import RECORD, as_kept, errors, gradient_off, judged_again, search
from robustness.searched_scenes import KINDS

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
    # What is kept of it, in text, has that very error.
    kept = json.loads(json.dumps(as_kept(found)))["worst"]
    again = {name: np.full(32, value) for name, value in kept.items()}
    errors_again = errors(fidelity, truth, again, "value").errors
    assert np.all(errors_again == found.course[-1])


def test_the_worst_design_on_record_keeps_its_promise():
    key = "normal impact | realistic | value | coarse"
    status, error = judged_again(key, json.loads(RECORD.read_text())[key])
    assert status <= fj.Status.LEFT_OVER_TIP
    assert 0 <= error <= PROMISE["coarse"][0]


def test_secants_of_the_truth_judge_a_gradient():
    """For a smooth course they confirm a right gradient, to the promise of a value over the change,
    and refute one by steps as long as the blow."""
    kind = KINDS["normal impact"]
    x = kind.numbers(np.full((1, kind.count("realistic")), 0.5), "realistic")
    truth = truths.fixed(COARSE, 1.25e-5)
    assert gradient_off(COARSE, truth, x, "normal impact") < 0.01
    too_coarse = COARSE.replace(step=8e-3, step_tolerance=None)
    assert gradient_off(too_coarse, truth, x, "normal impact") > 0.03
