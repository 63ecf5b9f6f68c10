"""The gate on program size distinguishes growth from noise, and counts the operations of inner
programs."""

import gate
import jax
import jax.numpy as jnp
import pytest
from loop_trips import loop_trips

KNOWN = {
    "impact: value": {"operations": 1000, "calls": 0, gate.TIME: 2.0},
    "impact: gradient": {"operations": 2000, "calls": 0, gate.TIME: 4.0},
    gate.ALL: {gate.TIME: 6.0},
}


def judged(error=0.0, **changed):
    """What has grown where the gradient's numbers are others than on record."""
    programs = {**KNOWN, "impact: gradient": {**KNOWN["impact: gradient"], **changed}}
    found = gate.Measured(programs, dict.fromkeys(programs, error))
    return gate.grown(found, KNOWN), gate.slow(found, KNOWN)


def test_what_grows_by_more_than_is_allowed_is_told():
    assert judged() == ([], [])
    assert judged(operations=2300) == ([], [])
    (growth,), again = judged(operations=2301)
    expected = "impact: gradient: operations grew from 2,000 to 2,301 (+15%, allowed +15%)"
    assert (growth.text, again) == (expected, [])
    assert judged(operations=1) == ([], [])
    # A call where there was none is a kernel of its own, whatever its share.
    assert judged(calls=1)[0][0].text == "impact: gradient: calls grew from 0 to 1"
    assert judged(kernels=1)[0][0].text == "impact: gradient: kernels is not on record"


def timed(total, error):
    """What is grown, and what is to be measured again, where all times sum up to a total."""
    programs = {**KNOWN, gate.ALL: {gate.TIME: total}}
    found = gate.Measured(programs, dict.fromkeys(programs, error))
    return [row.program for row in gate.grown(found, KNOWN)], gate.slow(found, KNOWN)


def test_the_sum_of_times_is_allowed_three_standard_errors_more_and_measured_again():
    assert timed(6.0 * 1.3, error=0.0) == ([gate.ALL], list(KNOWN))
    assert timed(6.0 * 1.3, error=0.051) == ([], [])
    # One program's time scatters too much to be judged by itself.
    assert judged(**{gate.TIME: 40.0}) == ([], [])
    # Nothing of it for what is counted.
    assert len(judged(error=0.051, operations=2301)[0]) == 1


def test_with_other_versions_what_xla_makes_is_not_judged():
    changed = {**KNOWN["impact: gradient"], "operations": 2301, "instructions": 9}
    found = gate.Measured({"impact: gradient": changed}, {"impact: gradient": 0.0})
    assert [row.key for row in gate.grown(found, KNOWN)] == ["operations", "instructions"]
    assert [row.key for row in gate.grown(found, KNOWN, ("operations",))] == ["operations"]


def test_the_sum_of_all_times_has_a_smaller_error():
    counted = {f"{k}: value": {} for k in range(4)}
    found = gate.gathered(counted, {name: [3.0, 1.0, 2.0] for name in counted}, 0.1)
    assert found.programs[gate.ALL] == {gate.TIME: 8.0}
    # Four medians of 2 with independent errors of 10 %.
    assert found.errors[gate.ALL] == pytest.approx(0.05)


def test_operations_of_inner_programs_count():
    def body(_, y):
        return jax.lax.cond(y > 0, jnp.sin, lambda z: z * z + 1, y)

    program = jax.make_jaxpr(lambda x: jax.lax.fori_loop(0, 3, jax.jit(body), x))(1.0)
    names = [equation.primitive.name for equation in gate.equations(program.jaxpr)]
    assert {"scan", "cond", "sin", "mul"} <= set(names)
    assert (names.count("sin"), names.count("mul")) == (1, 1)


def test_trips_of_loops_within_loops_are_counted():
    def inner(y):
        return jax.lax.while_loop(lambda z: z < 100, lambda z: 10 * z, y + 1)

    def once(y):
        return jax.lax.cond(y < 3, jax.jit(inner), lambda z: z, y)

    def trips(x):
        rows = jax.lax.scan(lambda y, row: (once(y), row), x, jnp.zeros(4))
        return jax.lax.while_loop(lambda y: y < 1e6, lambda y: y * 10, rows[0]), rows[1]

    # 2 -> 300 by two trips, in the first of four; then four times by ten.
    assert loop_trips(trips, 2.0) == [4 + 4, 2]
    assert loop_trips(jnp.sin, 1.0) == []


def test_more_trips_are_growth_on_any_version():
    known = {"impact: value": {"steps": 100, "evaluations": 300}}
    found = gate.Measured({"impact: value": {"steps": 100, "evaluations": 346}}, {})
    assert [row.key for row in gate.grown(found, known, gate._OF_ANY_VERSION)] == ["evaluations"]


def test_the_record_has_every_program_and_its_gradient():
    known = gate.recorded()["programs"]
    assert set(known) == {*gate.functions(list(gate.PROGRAMS)), gate.ALL}
    # Forward differentiation of a product takes two products and a sum for each of eight columns,
    # beside the product: 25 operations for one at most.
    ratios = [of["flops" + gate.OVER] for name, of in known.items() if name.endswith("gradient")]
    assert max(ratios) < 1 + 3 * 8
