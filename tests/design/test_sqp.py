"""Quadratic programming and SQP: steps, several starts at once, journals, checks."""

import json

import jax.numpy as jnp
import numpy as np
import optax
import pytest

from fencejax.design import (
    Journal,
    Multipliers,
    Program,
    Stop,
    minimize,
    minimize_many,
    quadratic_program as quadratic,
    verify,
)


def _circle(z, least):
    # min x^2 + y^2, x + y >= 2 c: (c, c), multiplier 2 c.
    return z @ z, jnp.atleast_1d(z[0] + z[1] - 2 * least), 0


@pytest.fixture(scope="module")
def circle():
    return Program(_circle)


def test_quadratic_program_meets_its_conditions():
    rng = np.random.default_rng(0)
    for _ in range(20):
        size, count = 6, 15
        rows = rng.normal(size=(count, size))
        least = rows @ rng.normal(size=size) - rng.uniform(0, 1, count)
        root = rng.normal(size=(size, 3))
        hessian, slope = root @ root.T + 1e-3 * np.eye(size), rng.normal(size=size)
        found = quadratic.solve(hessian, slope, rows, least)
        assert found.solved
        slack = rows @ found.point - least
        # The program is solved to 1e-7 of its largest number, here of order 10.
        scale = 1e-6 * max(1.0, float(np.max(np.abs(hessian))))
        np.testing.assert_allclose(
            hessian @ found.point + slope, rows.T @ found.multipliers, atol=10 * scale
        )
        assert slack.min() > -scale
        assert found.multipliers.min() >= 0
        assert np.max(found.multipliers * slack) < 10 * scale


def test_quadratic_program_in_closed_form():
    # The nearest point to (2, 0) in the triangle x, y >= 0, x + y <= 1 is (1, 0); the multipliers
    # of y >= 0 and x + y <= 1 are both 1.
    rows = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
    found = quadratic.solve(np.eye(2), -np.array([2.0, 0.0]), rows, np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(found.point, [1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(found.multipliers, [0.0, 1.0, 1.0], atol=1e-5)


def test_contradicting_constraints_are_not_solved():
    rows, least = np.array([[1.0], [-1.0]]), np.array([1.0, 1.0])
    assert not quadratic.solve(np.eye(1), np.zeros(1), rows, least).solved


def _problems():
    def banana(z):
        return 100 * (z[1] - z[0] ** 2) ** 2 + (1 - z[0]) ** 2, jnp.atleast_1d(1.5 - z @ z), 0

    def three(z):
        x, y = z
        rows = [x**2 + y**4, (2 - x) ** 2 + (2 - y) ** 2, 2 * jnp.exp(y - x)]
        return jnp.stack(rows), jnp.zeros(0), 0

    def walled(z):
        return -jnp.log(z[0]) + 10 * z[0], jnp.ones(1), jnp.where(z[0] < 0.05, 6, 0)

    # Objective at the optimum: the disc's from its conditions (see test_optimizer), Charalambous
    # and Conn's CB2, 1 + ln 10.
    return [
        (banana, [-1.0, 1.0], 0.0086156507), (three, [1.0, -0.1], 1.9522245),
        (walled, [0.2], 1 + np.log(10)),
    ]  # fmt: skip


@pytest.mark.parametrize("index", range(3))
def test_steps_find_known_optima(index):
    problem, start, least = _problems()[index]
    settings = dict(scale=1.0, bounded=False, tolerance=1e-5, feasibility=1e-6, budget=300)
    found = minimize(problem, start, **settings)
    assert found.converged
    assert found.objective == pytest.approx(least, abs=2e-5)


def test_steps_say_that_there_is_no_feasible_design():
    def impossible(z):
        return z @ z, jnp.stack([z[0] - 1, -z[0] - 1]), 0

    found = minimize(impossible, [3.0, 1.0], scale=1.0, bounded=False)
    assert found.stop is Stop.INFEASIBLE
    assert found.residual.violation == pytest.approx(1.0, abs=1e-6)


def test_steps_leave_a_bound_of_the_shares():
    def problem(share):
        return jnp.sum((share - 0.3) ** 2), jnp.zeros(0), 0

    found = minimize(problem, [1.0, 0.0], scale=1.0, tolerance=1e-6)
    assert found.converged
    np.testing.assert_allclose(found.point, 0.3, atol=1e-6)


def test_one_program_serves_every_bound(circle):
    before = circle._each[0]._cache_size()
    for least in (0.5, 1.0, 2.0):
        data = (np.asarray(least),)
        found = minimize(circle, [3.0, 0.0], data=data, scale=1.0, bounded=False, tolerance=1e-6)
        np.testing.assert_allclose(found.point, [least, least], atol=1e-5)
        np.testing.assert_allclose(found.multipliers, [2 * least], rtol=1e-4)
    assert circle._each[0]._cache_size() <= before + 1


@pytest.mark.parametrize("method", ["sqp", optax.sgd(0.05)], ids=["sqp", "sgd"])
def test_optimum_with_its_multipliers_is_seen_at_once(circle, method):
    data = (np.asarray(1.0),)
    settings = dict(data=data, scale=1.0, bounded=False, method=method)
    cold = minimize(circle, [3.0, 0.0], tolerance=1e-4, budget=400, **settings)
    assert cold.converged
    multipliers = Multipliers(cold.weights, cold.multipliers)
    warm = minimize(circle, cold.point, multipliers=multipliers, tolerance=1e-3, **settings)
    assert warm.converged
    assert len(warm.history) == 1
    with pytest.raises(ValueError, match="`multipliers` must have the shapes"):
        minimize(circle, [1.0, 1.0], data=data, multipliers=Multipliers(np.ones(2), np.ones(1)))


@pytest.mark.parametrize("method", ["sqp", optax.sgd(0.02)], ids=["sqp", "sgd"])
def test_runs_side_by_side_do_what_they_do_alone(circle, method):
    starts = np.array([[3.0, 0.0], [-1.0, 2.0], [0.5, 0.4], [4.0, 4.0], [0.0, 0.1]])
    data = [(np.asarray(least),) for least in (0.5, 1.0, 2.0, 0.7, 0.1)]
    settings = dict(scale=1.0, bounded=False, tolerance=1e-6, method=method, budget=60)
    seen = []
    many = minimize_many(
        circle, starts, data=data, width=3, progress=lambda run, r: seen.append(run), **settings
    )
    for start, own, together in zip(starts, data, many, strict=True):
        alone = minimize(circle, start, data=own, **settings)
        assert len(together.history) == len(alone.history)
        np.testing.assert_allclose(together.point, alone.point, atol=1e-10)
    assert sorted(set(seen)) == list(range(5))


def test_failure_of_one_run_is_not_swallowed(circle):
    with pytest.raises(ValueError, match="`multipliers`"):
        minimize_many(
            circle, np.ones((2, 2)), data=[(np.asarray(0.1),)] * 2,
            multipliers=[None, Multipliers(np.ones(3), np.ones(1))],
        )  # fmt: skip
    with pytest.raises(ValueError, match="one entry for each of the 2 starts"):
        minimize_many(circle, np.ones((2, 2)), data=[(np.asarray(0.1),)])
    with pytest.raises(ValueError, match=r"shape \(runs, variables\)"):
        minimize_many(circle, np.ones(2))


def test_journal_resumes_where_it_was_cut_off(circle, tmp_path):
    path, data = tmp_path / "j.jsonl", (np.asarray(1.0),)
    run = dict(data=data, scale=1.0, bounded=False, tolerance=1e-8)
    whole = minimize(circle, [3.0, 0.0], journal=Journal(path, "a"), **run)
    lines = path.read_text().splitlines(keepends=True)
    assert len(lines) == 1 + len(whole.history)
    # Killed in the middle of a line.
    path.write_text("".join(lines[:4]) + lines[4][:25])
    journal = Journal(path, "a")
    assert len(journal) == 3
    again = minimize(circle, [3.0, 0.0], journal=journal, **run)
    assert [r.recalled for r in again.history] == [True] * 3 + [False] * (len(again.history) - 3)
    np.testing.assert_array_equal(again.point, whole.point)
    assert len(Journal(path, "a")) == len(whole.history)
    # Another datum is another problem: nothing is recalled.
    other = Journal(path, "a")
    minimize(circle, [3.0, 0.0], journal=other, budget=2, **{**run, "data": (np.asarray(0.9),)})
    assert other.recalled == 0


def test_journals_of_other_problems_are_refused(circle, tmp_path):
    path = tmp_path / "j.jsonl"
    Journal(path, "a")
    with pytest.raises(ValueError, match="written with other settings"):
        Journal(path, "b")
    path.write_text(json.dumps({"something": "else"}) + "\n")
    with pytest.raises(ValueError, match="journal of evaluations"):
        Journal(path, "a")


def test_verification_states_the_error(circle):
    data = (np.asarray(1.0),)
    found = minimize(circle, [3.0, 0.0], data=data, scale=1.0, bounded=False, tolerance=1e-6)

    def finer(z, least):
        force, margins, status = _circle(z, least)
        return 1.01 * force, margins - 0.02, status

    check = verify(finer, found, data=data, agreement=0.02, feasibility=0.05)
    assert check.confirmed
    assert check.error == pytest.approx(1 / 1.01 - 1, rel=1e-9)
    assert check.margin_error == pytest.approx(0.02, rel=1e-6)
    assert not verify(finer, found, data=data, agreement=0.005, feasibility=0.05).confirmed
    assert not verify(finer, found, data=data, agreement=0.02, feasibility=0.01).confirmed
    bad = verify(lambda z, least: (1.0, jnp.ones(1), 6), found, data=data, agreement=10.0)
    assert bad.status == 6
    assert not bad.confirmed


@pytest.mark.parametrize("kink", [True, False])
def test_an_optimum_on_a_kink_says_so(kink):
    """There every single point leaves a slope of 1; the two sides together leave none."""

    def problem(z):
        across = jnp.abs(z[0] - 0.4) if kink else (z[0] - 0.4) ** 2
        return 1 + across + (z[1] - 0.5) ** 2, jnp.ones(1), 0

    found = minimize(problem, [0.9, 0.2], tolerance=1e-4)
    assert found.converged
    assert found.on_kink == kink
    assert ("kink" in found.ended) == kink
    assert max(found.residual[:2]) <= 1e-4
    np.testing.assert_allclose(found.point, [0.4, 0.5], atol=1e-3)
