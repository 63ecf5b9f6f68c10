"""The table of measures: where a row appears, a measure of your own, and the meaning of the
measures."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fencejax as fj
from fencejax.results import ESTIMATED, MEASURES, Measure, accumulators
from fencejax.study import OUTPUTS


def test_every_measure_is_in_results_sweeps_and_objectives():
    result = fj.simulate(fj.scenes.rigid_wall(duration=0.02), history=False)
    assert set(result.measures) == set(MEASURES)
    assert {name: OUTPUTS[name] for name in MEASURES} == {n: m.unit for n, m in MEASURES.items()}
    named = {field for quantity in fj.OBJECTIVES.values() for field in quantity.fields}
    assert set(MEASURES) <= named
    assert set(ESTIMATED) == {n for n, m in MEASURES.items() if m.error_factor}
    printed = str(result)
    for measure in MEASURES.values():
        assert measure.label in printed


# The largest acceleration of the parcel [m/s^2]: a row as a user writes it.
ACCELERATION = Measure(
    "peak_acceleration", "m/s^2", "largest acceleration of C_s", "at least 0",
    accumulators.peak_of(
        "acceleration", lambda s: jnp.sqrt(s.acceleration.x**2 + s.acceleration.y**2 + 1e-30)
    ),
    lambda state: state.value, label="acceleration", shown_unit="m/s^2",
)  # fmt: skip


def test_a_measure_of_ones_own():
    scene = fj.scenes.rigid_wall()

    def measured(speed):
        struck = fj.scenes.rigid_wall(speed=speed)
        return fj.simulate(struck, measures=[ACCELERATION], history=False)

    result = measured(2.426)
    # m a = N at every instant of a blow against the wall.
    force = float(result.peak_force)
    assert float(result.peak_acceleration) == pytest.approx(force / 15.0, rel=1e-9)
    slopes = jax.jit(jax.jacrev(lambda v: {
        name: getattr(measured(v), name) for name in ("peak_force", "peak_acceleration")
    }))(2.426)  # fmt: skip
    by_force, by_own = slopes["peak_force"], slopes["peak_acceleration"]
    assert float(by_own) == pytest.approx(float(by_force) / 15.0, rel=1e-9)
    assert "acceleration" in str(result)
    with pytest.raises(ValueError, match="names of their own"):
        fj.simulate(scene, measures=[MEASURES["peak_force"]])
    with pytest.raises(AttributeError, match="has no field `peak_acceleration`"):
        _ = fj.simulate(scene, history=False).peak_acceleration


def largest(name, accumulator=None, factor=1.0):
    """A measure by its name."""
    if accumulator is None:
        accumulator = accumulators.peak_of(f"own {name}", lambda s: s.fence_force)
    return Measure(name, "N", "", "at least 0", accumulator, lambda state: factor * state.value)


TAKEN = [
    *MEASURES, *(field.name for field in dataclasses.fields(fj.Result)), "_private",
    *(name for name in dir(fj.Result) if not name.startswith("_")),
]  # fmt: skip


@pytest.mark.parametrize("name", dict.fromkeys(TAKEN))
def test_measures_are_refused_a_name_that_a_result_has(name):
    text = f"names of their own, but holds '{name}'.*Name it otherwise"
    with pytest.raises(ValueError, match=text) as refused:
        fj.simulate(fj.scenes.rigid_wall(), measures=[largest(name)], only=name)
    assert "\n" not in str(refused.value)


def test_what_is_no_measure_is_refused():
    with pytest.raises(TypeError, match="`measures` must hold `fencejax.Measure`s, but holds 'up'"):
        fj.simulate(fj.scenes.rigid_wall(), measures=["up"])


def test_two_measures_of_one_name_are_refused():
    with pytest.raises(ValueError, match="names of their own, but holds 'push', twice"):
        fj.simulate(fj.scenes.rigid_wall(), measures=[largest("push"), largest("push")])
    quantities = [fj.objectives.of_measure(largest("push", factor=f)) for f in (1.0, 2.0)]
    with pytest.raises(ValueError, match="two that are not the same are named 'push'"):
        fj.objectives.measures(quantities)
    assert len(fj.objectives.measures([quantities[0]] * 2)) == 1


def of_speed(name):
    return accumulators.peak_of(name, lambda s: jnp.abs(s.body.y_rate))


def spin_trace(name):
    return accumulators.Trace(name, lambda s: s.body.spin)


@pytest.mark.parametrize(
    ("own", "others"),
    [
        # Those of the status, of a measure, of a gradient's error, and another of your own.
        *((of_speed(name), ()) for name in ("force", "impulse", "slopes", "rivals", "work")),
        (of_speed("own"), [largest("other", of_speed("own"))]),
        (
            accumulators.Accumulator(
                "outer", lambda nothing, body: nothing.time, lambda state, step: state,
                needs=(of_speed("force"),),
            ), (),
        ),
        (spin_trace("own"), [largest("other", spin_trace("own"))]),
    ],
)  # fmt: skip
def test_two_accumulators_of_one_name_are_refused(own, others):
    scene = fj.scenes.rigid_wall(duration=0.02)
    with pytest.raises(ValueError, match="of different names, but two .* are named"):
        fj.simulate(scene, measures=[largest("own", own), *others])


def test_one_accumulator_serves_several_measures():
    own = of_speed("own")
    measures = [
        largest("push", accumulators.FORCE), largest("speed", own), largest("double", own, 2.0)
    ]  # fmt: skip
    result = fj.simulate(fj.scenes.rigid_wall(duration=0.02), measures=measures, history=False)
    assert float(result.push) == float(result.peak_force)
    assert float(result.double) == 2 * float(result.speed) > 0


@functools.cache
def end_of_force(mass):
    """When the force of the wall ends [s]: b m^0.4 Ddot + k D^2 = 0, by SciPy."""
    stiffness, viscosity = 1.72e9, 3.3e5 * mass**0.4

    def derivative(_, y):
        bracket = viscosity * y[1] + stiffness * y[0] ** 2
        return [y[1], -max(0.0, y[0] ** 2 * bracket) / mass]

    def ended(_, y):
        return viscosity * y[1] + stiffness * y[0] ** 2

    ended.terminal, ended.direction = True, -1
    found = solve_ivp(
        derivative, (0, 0.1), (0.0, 2.426), rtol=1e-11, atol=1e-13, max_step=1e-4, events=ended,
        method="LSODA",
    )  # fmt: skip
    return float(found.t_events[0][0])


def test_contact_ends_with_the_force():
    def lasted(mass):
        scene = fj.scenes.rigid_wall(parcel=fj.Parcel(mass=mass))
        result = fj.simulate(scene, history=False)
        return result.contact_time, result.last_contact

    (time, last), slope = lasted(15.0), jax.jit(jax.grad(lambda m: lasted(m)[0]))(15.0)
    assert float(time) == pytest.approx(float(last), abs=1e-12)
    # A parabola through three samples, continued by less than a step h, is off by h^3 N''' / N',
    # some 1e-7 s here; the step itself, of the second order, by more.
    assert float(time) == pytest.approx(end_of_force(15.0), abs=1e-5)
    exact = (end_of_force(15.3) - end_of_force(14.7)) / 0.6
    assert float(slope) == pytest.approx(exact, rel=0.02)


@functools.cache
def four_corners(offset, angle):
    """A whole sort with four corners that ends in the air, and its samples' times and forces."""
    scene = fj.scenes.whole_sort(
        offset=offset, angle=angle, fence_corners=(1, 2, 3, 4), duration=0.75, tip_contact=False
    )
    plain = fj.Fidelity.coarse(
        longest_stride=1, modes=1, static_correction=False, geometry="small"
    )
    wanted = ("first_contact", "last_contact", "leave_x", "leave_y", "history")
    result = fj.simulate(scene, fidelity=plain, only=wanted)
    return result, np.asarray(result.history.time), np.asarray(result.history.fence_force)


SORTS = pytest.mark.parametrize(("offset", "angle"), [(0.1, 0.2), (0.3, 0.0)])


@SORTS
def test_first_contact_is_where_a_force_begins(offset, angle):
    # With four corners the gap of one that lies behind the fence's line may be positive long before
    # anything touches.
    result, time, force = four_corners(offset, angle)
    first = np.flatnonzero(force > 0)[0]
    assert time[first - 1] <= float(result.first_contact) <= time[first]
    # There the gap of the corner that presses is closed, to 5 % of its change between samples.
    pressing = [c for c in result.history.fence if float(c.normal[first]) > 0]
    gaps = [np.asarray(c.gap)[first - 1 : first + 1] for c in pressing]
    left = [
        np.interp(float(result.first_contact), time[first - 1 : first + 1], gap) / np.ptp(gap)
        for gap in gaps
    ]
    assert np.min(np.abs(left)) < 0.05


@SORTS
def test_a_parcel_leaves_where_the_force_ends(offset, angle):
    result, time, force = four_corners(offset, angle)
    body, last = result.history.body, float(result.last_contact)
    end = np.flatnonzero(force > 0)[-1]
    step = time[end + 1] - time[end]
    # The force's line through its last two samples ends where its parabola does, but for 5 % of the
    # step; the gaps close up to many steps later.
    fall = (force[end - 1] - force[end]) / (time[end] - time[end - 1])
    assert last == pytest.approx(time[end] + force[end] / fall, abs=0.05 * step)
    assert any(float(c.gap[end + 3]) > 0 for c in result.history.fence)
    places = {"leave_x": np.asarray(body.x), "leave_y": np.asarray(body.y)}
    moved = np.hypot(*(np.diff(place[end : end + 2]) for place in places.values()))[0]
    for name, place in places.items():
        # Between samples C_s moves by v h, about 1 mm; its line is off by a h^2 / 8, less than 1 %
        # of that. At the step's end it would be off by more than half of v h in one direction.
        wanted = np.interp(last, time, place)
        assert float(getattr(result, name)) == pytest.approx(wanted, abs=0.01 * moved)
    off = np.hypot(*(np.interp(last, time, p) - p[end + 1] for p in places.values()))
    assert off > 0.5 * moved


def test_deflection_has_one_sign():
    result = fj.simulate(fj.scenes.oblique_impact(duration=0.12))
    history = np.asarray(result.history.tip_deflection)
    # A parabola through three samples of a bend of 65 mm that lasts 0.1 s: 1e-3 is ample.
    assert history.max() == pytest.approx(float(result.tip_deflection), rel=1e-3)
    assert -history.min() < history.max()
