"""A short search for errors of the steps; `search.py` beside this file searches longer."""

import json

import numpy as np
import pytest
from robustness import truths
from robustness.extreme_scenes import ORDINARY
from robustness.offline_fuzz import PROMISE
from robustness.search import RECORD, as_kept, errors, gradient_off, judged_again, run, search
from robustness.searched_scenes import KINDS

import fencejax as fj

COARSE = fj.Fidelity.coarse(longest_stride=1)
# A share of the largest force that each step may miss, far above that of `coarse`.
LOOSE = COARSE.replace(step_tolerance=1e-2)
LANES = 32


def test_error_found_is_in_proportion_to_the_tolerance():
    # Over twenty-four generations of 128 it comes to two or three times the tolerance
    # (`search.json`); a step's defect counts once before the peak and once in its place.
    truth = truths.fixed(LOOSE, 1.25e-5)
    found = search(LOOSE, truth, "realistic", "value", LANES, 3, seed=7)
    assert found.good > 0.4
    assert found.course[-1] < 4e-2, found.worst
    # What is kept of it, in text, has that very error.
    kept = json.loads(json.dumps(as_kept(found)))["worst"]
    again = {name: np.full(LANES, value) for name, value in kept.items()}
    errors_again = errors(LOOSE, truth, again, "value").errors
    assert np.all(errors_again == found.course[-1])


def test_the_belt_catches_a_parcel_before_the_fence_does():
    """The belt's static friction is 1,800 times the kinetic, and the parcel slips by 0.155 mm/s as
    the scene begins. It comes to rest on the belt within microseconds. A first step that passed
    over that kept it sliding, and gave 60 % of the peak force."""
    numbers = ORDINARY | {
        "thickness": 5.45e-3, "reach": 0.542, "flexible": 0.0777, "width": 0.116,
        "modulus": 1.46e7, "density": 2240.0, "damping_ratio": 1.96, "mass": 109.0,
        "length": 0.124, "aspect": 0.262, "across": 0.472, "along": 0.233, "stiffness": 2.9e11,
        "damping": 6.5e4, "belt": 3.07, "ride": 3.07, "belt_kinetic": 1.1e-3, "belt_static": 1.97,
        "kinetic": 0.906, "static": 0.024, "top_speed": 0.951, "place": 0.0976, "angle": 0.0256,
        "approach": 1.55e-4,
    }  # fmt: skip
    x = {name: np.full(LANES, value) for name, value in numbers.items()}
    _, peak, _, _ = run(LOOSE, "impact", "value", x)
    _, true, _, _ = run(truths.fixed(LOOSE, 1.25e-5), "impact", "value", x)
    # The share that each step may miss, once before the peak and once in its place.
    assert peak[0] == pytest.approx(true[0], rel=2e-2)


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
