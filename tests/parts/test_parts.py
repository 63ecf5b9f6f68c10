"""Parts that a scene does not have cost nothing: neither state nor operations."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.integrators import modal_step, time_loop as integrate
from fencejax.simulate import prepared

STANDARD = fj.Fidelity.standard(step_tolerance=None)


def setup(scene, fidelity):
    """What the integrator starts from, by shapes alone."""
    return jax.eval_shape(lambda: prepared(scene, fidelity))


def primitives(jaxpr):
    """Names of all operations, those of inner programs included."""
    for equation in jaxpr.eqns:
        yield equation.primitive.name
        for value in equation.params.values():
            for inner in value if isinstance(value, (tuple, list)) else (value,):
                inner = getattr(inner, "jaxpr", inner)
                if hasattr(inner, "eqns"):
                    yield from primitives(inner)


@functools.cache
def cost(name):
    """Scalars carried from step to step, and the operations of one step."""
    scene, fidelity = PARTS[name]()
    mechanics, clock, memory = setup(scene, fidelity)
    index = jax.ShapeDtypeStruct((), jnp.zeros(()).dtype)
    program = jax.make_jaxpr(modal_step.step)(mechanics, clock, memory, index, index)
    state = sum(leaf.size for leaf in jax.tree.leaves(memory))
    return state, list(primitives(program.jaxpr)), memory


def sort(count, **changes):
    corners = tuple(range(1, count + 1))
    return fj.scenes.whole_sort(
        fence_corners=corners, border_corners=corners, duration=0.1, **changes
    )


STILL = (2.0, 0.0, 0.0)
PARTS = {
    "sort, 4 + 4 corners": lambda: (sort(4), STANDARD),
    "sort, 2 + 2 corners": lambda: (sort(2), STANDARD),
    "sort, 1 + 1 corner": lambda: (sort(1), STANDARD),
    "oblique impact": lambda: (fj.scenes.oblique_impact(), STANDARD),
    "without fence friction": lambda: (
        fj.scenes.oblique_impact(fence_friction=None), STANDARD
    ),
    "without belt": lambda: (
        fj.scenes.oblique_impact(fence_friction=None, belt=None, velocity=STILL), STANDARD
    ),
    "without static correction": lambda: (
        fj.scenes.oblique_impact(fence_friction=None, belt=None, velocity=STILL),
        STANDARD.replace(static_correction=False),
    ),
    "one mode": lambda: (
        fj.scenes.oblique_impact(fence_friction=None, belt=None, velocity=STILL),
        STANDARD.replace(static_correction=False, modes=1),
    ),
    "small deflection": lambda: (
        fj.scenes.oblique_impact(fence_friction=None, belt=None, velocity=STILL),
        STANDARD.replace(static_correction=False, modes=1, geometry="small"),
    ),
    "rigid fence": lambda: (
        fj.scenes.oblique_impact(fence_friction=None, belt=None, velocity=STILL),
        STANDARD.replace(modes=0, geometry="small"),
    ),
    "free motion": lambda: (fj.scenes.free_motion(), STANDARD),
    "free motion without belt": lambda: (fj.scenes.free_motion(belt=None), STANDARD),
    "free motion beside a fence": lambda: (fj.scenes.free_motion(fence=fj.Fence()), STANDARD),
    "border without friction": lambda: (sort(2, border=fj.Border(friction=None)), STANDARD),
    "no border": lambda: (sort(2, border=None), STANDARD),
    "no contact at the tip": lambda: (sort(2, tip_contact=False), STANDARD),
}
ORDER = list(PARTS)[:12]
PARTS["oblique impact, under control"] = lambda: (
    fj.scenes.oblique_impact(), fj.Fidelity.standard()
)


@pytest.mark.parametrize(("more", "less"), list(zip(ORDER[:-1], ORDER[1:], strict=True)))
def test_each_part_left_out_saves_operations(more, less):
    assert len(cost(less)[1]) < len(cost(more)[1])
    assert cost(less)[0] <= cost(more)[0]


@pytest.mark.parametrize(
    ("more", "less"),
    [
        ("sort, 2 + 2 corners", "border without friction"),
        ("border without friction", "no border"),
        ("no border", "oblique impact"),
        ("sort, 2 + 2 corners", "no contact at the tip"),
        ("free motion beside a fence", "free motion"),
    ],
)
def test_other_parts_left_out(more, less):
    assert len(cost(less)[1]) < len(cost(more)[1])


MODES = fj.Fidelity.standard().modes


def test_size_of_the_state():
    # The parcel: position and velocity 6, acceleration now and before 6. The fence: amplitude,
    # rate and force of each mode. A corner at it: its place, sliding speed, force now and before,
    # whether it has left over the tip, and of the modes left out the lagged rate, force and rate;
    # where the tip may carry the contact, the share and the place of the fence's load, now, before
    # and foreseen. Friction of corners: the acceleration by what holds, 3, a weight each, and its
    # way beside the step's cubic, 3.
    assert cost("free motion")[0] == cost("free motion without belt")[0] == 12
    assert cost("free motion beside a fence")[0] == 12 + 3 * MODES
    assert cost("oblique impact")[0] == 12 + 3 * MODES + 8 + 7
    # Error control: steps taken and to come 2, what it judges by 4; of each contact its force, gap,
    # rate and share at the step's end, and how its foot drifts, 5; its friction and its sliding
    # speed, 2.
    assert cost("oblique impact, under control")[0] == cost("oblique impact")[0] + 6 + 7
    assert cost("without fence friction")[0] == 12 + 3 * MODES + 8
    assert cost("without static correction")[0] == 12 + 3 * MODES + 5
    assert cost("one mode")[0] == 12 + 3 + 5
    assert cost("rigid fence")[0] == 12 + 5
    # The border keeps but its friction's weights and normal forces.
    assert cost("sort, 4 + 4 corners")[0] == 12 + 3 * MODES + 4 * 14 + 6 + 8 + 4
    assert cost("no border")[0] == 12 + 3 * MODES + 2 * 14 + 6 + 2
    assert cost("sort, 2 + 2 corners")[0] == cost("no border")[0] + 2 + 2
    assert cost("no contact at the tip")[0] == 12 + 3 * MODES + 2 * 8 + 6 + 4 + 2


def test_operations_of_absent_parts_are_absent():
    for name in ("free motion", "free motion without belt"):
        operations = cost(name)[1]
        # No drive to take the cosine of, no corner to turn, no table of shapes to look up.
        assert not {"cos", "sin", "gather", "floor"} & set(operations)
        assert cost(name)[2].fence is None
    # Friction is the only one to take a reciprocal root or, of the coefficient, an exponential.
    for name in ("without belt", "free motion without belt"):
        assert not {"rsqrt", "exp"} & set(cost(name)[1])
    assert {"rsqrt", "exp"} <= set(cost("free motion")[1])
    assert cost("rigid fence")[2].fence.vibration == ((), ())


@functools.cache
def lowered(name, history):
    scene = {"wall": fj.scenes.rigid_wall, "free": fj.scenes.free_motion}[name]()
    run = lambda s: fj.simulate(s, fidelity=STANDARD, history=history)  # noqa: E731
    text = jax.jit(run).lower(scene).as_text()
    return text.count("stablehlo.")


def test_only_what_is_asked_for():
    # Fields that are not named are None and leave the compiled derivative; the rest is the same.
    scene = fj.scenes.rigid_wall()
    whole = fj.simulate(scene, history=False)
    part = fj.simulate(scene, only=["peak_force", "impulse"])
    assert part.energy is None
    assert part.history is None
    # Two programs: the compiler may sum in another order, over some hundred steps.
    assert float(part.peak_force) == pytest.approx(float(whole.peak_force), rel=1e-13)
    assert float(part.impulse) == pytest.approx(float(whole.impulse), rel=1e-13)
    assert int(part.status) == int(whole.status)
    assert "peak_force  3294 N" in str(part)
    assert fj.simulate(scene, only=["history"]).history is not None
    with pytest.raises(ValueError, match="`only` must be one of .* but is 'force'"):
        fj.simulate(scene, only=["force"])


def test_whole_programs():
    # The rigid wall is the smallest of all; a history that is not asked for is not in the program.
    assert lowered("wall", False) < lowered("free", False)
    assert lowered("wall", False) < lowered("wall", True)
    assert lowered("free", False) < lowered("free", True)
    result = fj.simulate(fj.scenes.rigid_wall(), history=False)
    assert result.history is None


def near(scene, other, duration_fidelity, rtol):
    first, second = (
        fj.simulate(s, fidelity=duration_fidelity, history=False) for s in (scene, other)
    )
    assert float(first.peak_force) > 10
    for name in ("peak_force", "impulse", "tip_deflection", "peak_torque", "furthest_y"):
        np.testing.assert_allclose(getattr(first, name), getattr(second, name), rtol=rtol)
    np.testing.assert_allclose(first.final, second.final, rtol=rtol, atol=1e-9)


COARSE = fj.Fidelity.fast(modes=1, static_correction=False, geometry="small")


def test_no_friction_is_zero_friction():
    # The same equations; Newton's method stops elsewhere by round-off at most.
    zero = fj.Friction(0.0, 0.0)
    impact = functools.partial(fj.scenes.oblique_impact, duration=0.06, belt=None, velocity=STILL)
    near(impact(fence_friction=None), impact(fence_friction=zero), COARSE, 1e-9)


def test_a_border_out_of_reach_changes_nothing():
    sorting = functools.partial(fj.scenes.whole_sort, offset=0.2, front=0.8, duration=0.5)
    near(sorting(border=None), sorting(), COARSE, 1e-9)


def test_steps_are_counted():
    assert integrate.count_steps(0.25, 2.5e-4) == 1000
    assert integrate.count_steps(0.25, 2.6e-4) == 962
    assert integrate.count_steps(1e-6, 1e-3) == 1


def test_one_program_serves_every_design_of_a_shape(caplog):
    fidelity = fj.Fidelity(modes=1, static_correction=False, geometry="small")
    scenes = [
        fj.scenes.normal_impact(
            fence=fj.Fence(thickness=t), distance=d, parcel=fj.Parcel(mass=m), duration=0.02
        )
        for t, d, m in ((0.04, 1.0, 5.0), (0.06, 0.9, 20.0), (0.05, 0.8, 1.0))
    ]

    def compiled(scene):
        """Peak force [N], and what was compiled for it."""
        caplog.clear()
        with jax.log_compiles():
            force = fj.simulate(scene, fidelity=fidelity, only=["peak_force"]).peak_force
        texts = [record.getMessage() for record in caplog.records]
        return float(force), [text for text in texts if text.startswith("Compiling")]

    (one, first), (two, second), (three, third) = (compiled(scene) for scene in scenes)
    assert len({one, two, three}) == 3
    assert first
    assert second == third == []
