"""The optimiser's steps at designs for which the model does not hold, and at ones with a numerical
status."""

import jax.numpy as jnp
import numpy as np
import pytest

from fencejax.design import Evaluator, Program, Stop, minimize
from fencejax.results import Status

_SIZE = 8
_TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(_SIZE, _SIZE)))[0]
_CURVATURE = _TURN @ np.diag(np.geomspace(0.1, 30.0, _SIZE)) @ _TURN.T
_NORMAL = np.full(_SIZE, 1 / np.sqrt(_SIZE))


def _bowl(status):
    """z^T H z / 2, whose smallest, 0, is beyond the plane a . z = 1/2, where the status is bad."""

    def problem(z):
        beyond = _NORMAL @ z < 0.5
        return 0.5 * z @ _CURVATURE @ z, jnp.ones(1), jnp.where(beyond, int(status), 0)

    return problem


# On the plane it is b^2 / (2 a^T H^-1 a).
_LEAST = 0.125 / float(_NORMAL @ np.linalg.solve(_CURVATURE, _NORMAL))
_STARTS = np.random.default_rng(4).uniform(0.5, 2.0, (3, _SIZE))


def _found(status):
    return [
        minimize(_bowl(status), start, scale=1.0, bounded=False, tolerance=1e-4, budget=80)
        for start in _STARTS
    ]


def test_doubtful_points_teach_and_end_no_run():
    taught, walled = _found(Status.LARGE_DEFLECTION), _found(Status.INCONSISTENT)
    for found in (*taught, *walled):
        assert found.last.status == Status.SUCCESSFUL
        assert not found.converged
        assert found.feasible
        assert found.objective >= _LEAST
        assert any(record.failed for record in found.history)
    # Both learn the plane from where it was met; 80 evaluations bring them within some hundredths.
    for runs in (taught, walled):
        assert np.median([found.objective / _LEAST - 1 for found in runs]) < 0.1


@pytest.mark.parametrize("start", [[0.2, 2.0], [-0.25, 3.0], [0.1, -2.0]])
def test_slopes_beyond_are_learnt_from(start):
    # 50 x^2 + y^2 / 2 where |x| > 0.3 is bad: first steps, of a unit curvature, go too far in x.
    # The slopes there give the curvature at once; a wall only shortens the steps.
    def narrow(status):
        def problem(z):
            worst = 50 * z[0] ** 2 + 0.5 * z[1] ** 2
            return worst, jnp.ones(1), jnp.where(jnp.abs(z[0]) > 0.3, int(status), 0)

        return minimize(problem, start, scale=1.0, bounded=False, tolerance=1e-4)

    taught, walled = narrow(Status.LARGE_DEFLECTION), narrow(Status.INCONSISTENT)
    assert taught.converged
    assert taught.objective < 1e-4
    assert any(record.failed for record in taught.history)
    assert len(taught.history) < len(walled.history)


def test_doubtful_is_what_is_finite_and_still_follows_the_design():
    def doubtful(status, worst_status=Status.LEFT_OVER_TIP, factor=1.0):
        program = Program(lambda z: (factor * z @ z, jnp.ones(1), int(status)))
        run = Evaluator(program, False, 1.0, 1, worst_status, None)
        at = run(np.ones(2))
        assert not at.doubtful or (at.failed and not run.evaluations)
        return at.doubtful

    assert doubtful(Status.LARGE_DEFLECTION)
    assert doubtful(Status.DEEP_PENETRATION)
    assert not doubtful(Status.LEFT_OVER_TIP)
    assert not doubtful(Status.LARGE_DEFLECTION, worst_status=Status.LARGE_DEFLECTION)
    assert not doubtful(Status.LARGE_DEFLECTION, factor=np.nan)
    assert not doubtful(Status.INCONSISTENT)


def test_doubtful_start_is_a_failed_one():
    found = minimize(_bowl(Status.LARGE_DEFLECTION), np.zeros(_SIZE), bounded=False)
    assert found.stop is Stop.FAILED_START
    assert not found.feasible


@pytest.mark.parametrize("status", [s for s in Status if s.numerical])
def test_numerical_doubt_is_no_wall(status):
    # The smallest lies where the numbers are in doubt: they are used, and every record says so.
    (found, *_) = _found(status)
    assert found.converged
    assert found.objective < 1e-3
    assert not any(record.failed for record in found.history)
    assert found.history[-1].in_doubt == 1
    assert found.history[0].in_doubt == 0
