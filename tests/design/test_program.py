"""Problems whose numbers are computed again, finer, where they are in doubt."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.design import LaneProgram, Program, minimize
from fencejax.results import Status

_SIZES: list[tuple[int, int]] = []


def _read(z, lanes, fidelity):
    """Forces x (1 + z_0^2) + z_1, with errors of 1 at rung 0 and 0.1 at rung 1. Lanes above 2, 4
    and 8 are in doubt at rungs 0, 1 and 2, and evaluations below 0 fail."""
    _SIZES.append((fidelity, lanes.shape[0]))
    error = (1.0, 0.1, 0.0)[fidelity]
    force = lanes * (1 + z[0] ** 2) + z[1] + error
    status = jnp.where(lanes > (2.0, 4.0, 8.0)[fidelity], int(Status.STEP_TOO_COARSE), 0)
    status = jnp.where(lanes < 0, int(Status.LARGE_DEFLECTION), status)
    return {"force": force, "lane": lanes}, status


def _combine(z, numbers, statuses, lanes, bound):
    return numbers["force"] ** 2, bound - jnp.sum(numbers["force"]) - jnp.sum(z**3)


_PROGRAM = LaneProgram(_read, _combine, (0, 1, 2))


def _exact(z, x, bound, error):
    force = x * (1 + z[0] ** 2) + z[1] + error
    return force**2, jnp.atleast_1d(bound - jnp.sum(force) - jnp.sum(z**3))


def test_lanes_in_doubt_alone_are_computed_again():
    lanes = np.array([1.0, 3.0, 0.5, 5.0, 6.0, 2.0, 7.0, 3.5, 2.5, 2.1, 2.2, 2.3, 2.4])
    error = np.where(lanes > 4, 0.0, np.where(lanes > 2, 0.1, 1.0))
    z, bound = np.array([0.3, -0.2]), np.asarray(2.0)
    _SIZES.clear()
    found = _PROGRAM(z, lanes, bound)
    # Ten of the thirteen, then three, one by one.
    assert sorted({size for size in _SIZES if size[0]}) == [(1, 1), (2, 1)]
    np.testing.assert_array_equal(np.bincount(found.rungs), [3, 7, 3])
    assert found.status == 0
    objectives, margins = _exact(jnp.asarray(z), lanes, bound, error)
    rows = jax.jacfwd(lambda z: _exact(z, lanes, bound, error))(jnp.asarray(z))
    np.testing.assert_allclose(found.objectives, objectives, rtol=1e-14)
    np.testing.assert_allclose(found.margins, margins, rtol=1e-14)
    # The chain rule gives the derivative of the composition.
    np.testing.assert_allclose(found.objective_rows, rows[0], rtol=1e-13)
    np.testing.assert_allclose(found.margin_rows, rows[1], rtol=1e-13)


def test_finer_rungs_are_compiled_beside_the_first():
    """Before a lane is in doubt, for lanes one by one; then nothing is compiled any more."""
    z, bound = np.array([0.3, -0.2]), np.asarray(2.0)
    program = LaneProgram(_read, _combine, (0, 1, 2), ahead=True)
    assert program(z, np.array([1.0, 0.5]), bound).rungs.tolist() == [0, 0]
    for each in program._coming.values():
        each.result()
    _SIZES.clear()
    found = program(z, np.array([3.0, 5.0]), bound)
    assert found.rungs.tolist() == [1, 2]
    assert not _SIZES
    plain = LaneProgram(_read, _combine, (0, 1, 2))(z, np.array([3.0, 5.0]), bound)
    np.testing.assert_array_equal(found.objective_rows, plain.objective_rows)


def test_a_rung_is_compiled_once_however_many_lanes_are_in_doubt():
    """One program serves single lanes while they are few, and another one groups of many."""
    z, bound = np.array([0.3, -0.2]), np.asarray(2.0)
    program = LaneProgram(_read, _combine, (0, 1))
    for doubtful in (1, 7, 16, 17, 64, 65, 200, 600):
        lanes = np.where(np.arange(600) < doubtful, np.linspace(2.5, 3.5, 600), 1.0)
        found = program(z, lanes, bound)
        np.testing.assert_array_equal(found.rungs, np.arange(600) < doubtful)
        expected, _ = _exact(jnp.asarray(z), lanes, bound, np.where(lanes > 2, 0.1, 1.0))
        np.testing.assert_allclose(found.objectives, expected, rtol=1e-14)
        first, finer = (each._cache_size() for each in program._each)
        assert (first, finer) == (1, 1 + (doubtful > 16))
    # Nor is another one where all begin there.
    lanes = np.linspace(2.5, 3.5, 40)
    for few in (5, 40):
        found = program(z, lanes[:few], bound, least=np.ones(few, dtype=int))
        np.testing.assert_array_equal(found.rungs, 1)
        expected, _ = _exact(jnp.asarray(z), lanes[:few], bound, 0.1)
        np.testing.assert_allclose(found.objectives, expected, rtol=1e-14)
        assert [each._cache_size() for each in program._each] == [1, 2]


def test_several_points_are_what_each_is_alone():
    lanes = np.array([[1.0, 3.0], [5.0, 9.0], [0.5, 1.0]])
    points, bounds = np.array([[0.3, -0.2], [0.1, 0.4], [1.0, 0.0]]), np.array([1.0, 2.0, 3.0])
    for point, own, bound, many in zip(
        points, lanes, bounds, _PROGRAM.many(points, lanes, bounds), strict=True
    ):
        alone = _PROGRAM(point, own, bound)
        for one, other in zip(many, alone, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-14)


def test_physics_is_not_computed_again_and_doubt_at_the_finest_is_kept():
    found = _PROGRAM(np.zeros(2), np.array([-1.0, 9.0, 1.0]), np.asarray(1.0))
    np.testing.assert_array_equal(found.rungs, [0, 2, 0])
    assert found.statuses[Status.STEP_TOO_COARSE] == 1
    assert found.physical == Status.LARGE_DEFLECTION


def test_lanes_in_doubt_once_begin_at_the_second_rung():
    # The second of three lanes is in doubt at the start alone: its rung stays, and its error.
    lanes, least = np.array([1.0, 3.0, 0.5]), np.array([0, 1, 0])
    for _ in range(2):
        found = _PROGRAM(np.zeros(2), lanes, np.asarray(9.0), least=least)
        np.testing.assert_array_equal(found.rungs, [0, 1, 0])
        lanes = np.array([1.0, 2.0, 0.5])
        np.testing.assert_allclose(found.objectives[::2], [4.0, 2.25])
    np.testing.assert_allclose(found.objectives[1], 2.1**2)
    (many,) = _PROGRAM.many(
        np.zeros((1, 2)), lanes[None], np.array([9.0]), least=[np.array([1, 1, 1])]
    )
    np.testing.assert_array_equal(many.rungs, [1, 1, 1])


@pytest.mark.parametrize("many", [False, True])
def test_whole_problem_is_computed_again(many):
    def problem(z, least, fidelity):
        status = jnp.where((z[0] > 0.5) & (fidelity < 1), int(Status.MODES_TOO_FEW), 0)
        return z @ z + 1.0 - 0.5 * fidelity, z[0] - least, status

    program = Program(problem, fidelities=(0, 1))
    point, least = np.array([0.7, 0.0]), np.asarray(0.6)
    found = program.many(point[None], least[None])[0] if many else program(point, least)
    np.testing.assert_array_equal(found.rungs, [1])
    np.testing.assert_allclose(found.objectives, [0.99])
    assert found.status == 0
    best = minimize(program, point, data=(least,), scale=1.0)
    assert best.converged
    np.testing.assert_allclose(best.point, [0.6, 0.0], atol=1e-3)
    assert all(record.rungs == (0, 1) and not record.failed for record in best.history)


def test_ladder_settles_a_doubtful_sort():
    # Steps of 4 ms do not resolve the blow; the next rung does, and agrees with the finest.
    coarse = fj.Fidelity.coarse(step=4e-3, step_tolerance=None)
    ladder = coarse.ladder()
    assert ladder[0] == coarse
    assert [rung.step for rung in ladder[1:]] == [1.25e-4, 2.5e-5]
    assert all(rung.geometry == coarse.geometry for rung in ladder)
    first, beyond = fj.Fidelity.reference().ladder()
    assert first == fj.Fidelity.reference()
    assert (beyond.modes, beyond.step) == (2 * first.modes, first.step / 2)
    # A fence that does not bend does not at a finer rung.
    assert [rung.modes for rung in coarse.replace(modes=0).ladder()] == [0, 0, 0]

    def problem(z, fidelity):
        scene = fj.scenes.oblique_impact(parcel=fj.Parcel(mass=10 * z[0]), duration=0.05)
        result = fj.simulate(scene, fidelity=fidelity, only=("peak_force",))
        return result.peak_force, jnp.ones(1), result.status

    assert Status(int(problem(jnp.ones(1), coarse)[2])).numerical
    found = Program(problem, ladder[:2])(np.ones(1))
    assert found.status <= Status.LEFT_OVER_TIP
    np.testing.assert_array_equal(found.rungs, [1])


@pytest.mark.parametrize("step", [4e-3, 1e-3, 5e-4, 1e-4, 3e-5])
def test_no_rung_has_longer_shortest_steps_than_the_one_before(step):
    rungs = fj.Fidelity.standard(step=step).ladder()
    shortest = [rung.step / 2**rung.halvings for rung in rungs]
    assert shortest == sorted(shortest, reverse=True)
