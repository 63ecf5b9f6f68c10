"""The status of a simulation: each status where it belongs, and the arguments that are refused
before anything is compiled."""

import functools
import inspect
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.extreme_scenes import ORDINARY, TRUTH, USUAL, WIDE, draw, impact, stack
from runs import one_by_one

import fencejax as fj

PLAIN = fj.Fidelity.fast(modes=1, static_correction=False, geometry="small")


def status(scene, fidelity=None, **fields):
    return fj.Status(int(fj.simulate(scene, fidelity=fidelity, history=False, **fields).status))


def test_status_text_says_the_cause_and_what_to_change():
    # What a text tells the reader to change is there to be changed.
    knobs = set()
    for made in (fj.Fidelity, fj.Parcel, fj.scenes.oblique_impact, fj.scenes.whole_sort):
        knobs |= {*inspect.signature(made).parameters}
    for status in set(fj.Status) - {fj.Status.SUCCESSFUL}:
        cause, _, remedy = status.text.partition("; ")
        assert cause, status
        assert remedy, status
        assert {re.split("=", name)[0] for name in re.findall("`(.+?)`", remedy)} <= knobs, status
    assert len({status.text for status in fj.Status}) == len(fj.Status)
    assert [int(status) for status in fj.Status] == list(range(len(fj.Status)))


def test_a_deep_penetration_is_no_reason_for_another_parcel():
    # The parcel is what it is: the machine is changed, or a guess of the parcel's stiffness.
    remedy = fj.Status.DEEP_PENETRATION.text.partition("; ")[2]
    assert remedy.startswith("soften the blow")
    assert remedy.endswith("the parcel's `stiffness` if it was guessed")


LONG_STEPS = fj.Fidelity(step=5e-3, step_tolerance=None)


@pytest.mark.parametrize(
    ("make", "fidelity", "expected"),
    [
        # The contact lasts 8 ms: a step of 5 ms sees it once or twice.
        (lambda: fj.scenes.rigid_wall(), LONG_STEPS, "STEP_TOO_COARSE"),
        (lambda: fj.scenes.rigid_wall(), fj.Fidelity(step=5e-4), "SUCCESSFUL"),
        (
            lambda: fj.scenes.rigid_wall(parcel=fj.Parcel(1e12, stiffness=0.0)), None,
            "DEEP_PENETRATION",
        ),
        # A limp fence, struck by what is over long before it can bend.
        (
            lambda: fj.scenes.normal_impact(
                fence=fj.Fence(
                    0.1, 1.0, 0.132, 1.5e-3, fj.Material(6e6, 1000.0, 1.0), fj.Uniform()
                ),
                parcel=fj.Parcel(0.05, stiffness=1e11, damping=0.0), speed=3.0, distance=0.9,
                duration=5e-3,
            ),
            fj.Fidelity(step=2e-5, step_tolerance=None), "MODES_TOO_FEW",
        ),
        # Everything slower than friction is smoothed over.
        (
            lambda: fj.scenes.oblique_impact(
                belt=fj.Belt(0.02), velocity=(0.02, 0.0, 0.0), drive=fj.HarmonicDrive(0.02),
                drive_angle=0.002, duration=0.6,
            ),
            PLAIN, "FRICTION_SMOOTHED",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_each_status_where_it_belongs(make, fidelity, expected):
    assert status(make(), fidelity) == fj.Status[expected]


def limp(thickness):
    fence = fj.Fence(thickness=thickness, taper=fj.Uniform())
    return fj.scenes.normal_impact(fence=fence, duration=0.1)


def soft(stiffness):
    parcel = fj.Parcel(stiffness=stiffness, damping=0.0)
    return fj.scenes.rigid_wall(parcel=parcel, duration=0.3)


def slow(slip_speed):
    """An impact on a belt of 0.2 m/s, and how far its friction is smoothed."""
    scene = fj.scenes.oblique_impact(belt=fj.Belt(0.2), velocity=(0.2, 0.0, 0.0), duration=0.1)
    return scene, PLAIN.replace(slip_speed=slip_speed, static_speed=5 * slip_speed)


@pytest.mark.parametrize(
    ("expected", "before", "after"),
    [
        ("NEVER_TOUCHED", (fj.scenes.rigid_wall(speed=-1.0), None), None),
        (
            "IN_CONTACT_AT_END", (fj.scenes.rigid_wall(duration=2.5e-2), None),
            (fj.scenes.rigid_wall(duration=5e-2), None),
        ),
        (
            "PEAK_AT_END", (fj.scenes.rigid_wall(duration=1e-2), None),
            (fj.scenes.rigid_wall(duration=2.5e-2), None),
        ),
        ("LARGE_DEFLECTION", (limp(0.004), PLAIN), (limp(0.045), PLAIN)),
        (
            "DEEP_PENETRATION", (soft(1e3), None), (soft(1e9), None),
        ),
        ("FRICTION_SMOOTHED", slow(5e-2), slow(1e-3)),
    ],
)
def test_what_a_status_says_to_do_helps(expected, before, after):
    # `tip_contact` is tried in tests/model/test_tip.py, shorter steps and more modes above.
    assert status(*before).name == expected
    if after is not None:
        assert status(*after) <= fj.Status.LEFT_OVER_TIP


def wall(mass, center):
    return fj.scenes.rigid_wall(parcel=fj.Parcel(mass=mass, center_x=center))


def normal(distance):
    return fj.scenes.normal_impact(distance=distance, duration=0.01)


def oblique(distance, angle, thickness):
    return fj.scenes.oblique_impact(
        fence=fj.Fence(thickness=thickness), distance=distance, drive_angle=angle, duration=0.01
    )


def driven(acceleration):
    return fj.scenes.oblique_impact(
        drive=fj.TrapezoidDrive(acceleration=acceleration), duration=0.01
    )


def sorted_at(offset):
    return fj.scenes.whole_sort(offset=offset, duration=0.01)


@functools.cache
def traced(make):
    """The status where the numbers are traced, and pass what the constructors check."""
    @jax.jit
    def run(*numbers):
        return fj.simulate(make(*numbers), fidelity=PLAIN, only=("peak_force",)).status

    return run


@pytest.mark.parametrize(
    ("make", "numbers"),
    [
        (wall, (-1.0, 0.0)),
        (wall, (1e40, 0.0)),
        (wall, (15.0, 1.0)),
        (normal, (1.3,)),
        (oblique, (1.3, 0.3, 0.045)),
        (oblique, (1.0, 1.0, 0.045)),
        (oblique, (1.0, -1.0, 0.045)),
        (oblique, (1.0, 0.3, -1.0)),
        (driven, (1.0,)),
        (sorted_at, (-1.0,)),
    ],
)
def test_traced_numbers_out_of_bounds_are_said(make, numbers):
    assert int(traced(make)(*numbers)) >= fj.Status.INCONSISTENT


def test_the_same_numbers_within_bounds_are_no_cause():
    assert int(traced(wall)(15.0, 0.0)) < fj.Status.INCONSISTENT
    assert int(traced(oblique)(1.0, 0.3, 0.045)) < fj.Status.INCONSISTENT


def test_heavy_parcels_are_refused_or_right():
    # Once 0 N with a good status: the force was lost beside the weight.
    for mass in (1e100, 1e300):
        with pytest.raises(ValueError, match=r"`mass` must be 1e-11 \.\.\. 1e\+13 \[kg\] in size"):
            fj.Parcel(mass=mass)
    for mass in (1e9, 1e12):
        result = fj.simulate(
            fj.scenes.oblique_impact(parcel=fj.Parcel(mass), duration=0.02), fidelity=PLAIN,
            history=False,
        )
        assert int(result.status) > fj.Status.LEFT_OVER_TIP


# Random scenes, by draw and lane, whose numbers are off: what is said of them with fixed steps of
# 0.5 ms, and by how much the force is off at least.
OFF = [
    # A contact that is all damper holds the corner of 350 kg to a fence of 1.9 kHz, all but
    # undamped.
    (WIDE, [14, 6], 25, fj.Status.STEP_TOO_COARSE, 0.03),
    # 10 g come to rest on a grippy belt at the end of a step, and are pushed back from there.
    (WIDE, [13, 13], 85, fj.Status.STEP_TOO_COARSE, 0.08),
    # The slip on the belt reverses without ever being zero, at 1.1 w_s for 4 ms.
    (USUAL, [13, 25], 34, fj.Status.FRICTION_SMOOTHED, 0.008),
]


@functools.cache
def outcomes(name):
    """Status and peak force of impacts at a fidelity: a heavy parcel that bends the fence far, one
    that sticks to the belt until the fence pushes it off, and those of `OFF`."""
    fixed = fj.Fidelity(
        step=5e-4, step_tolerance=None, slip_speed=5e-5, static_speed=2.5e-3
    )
    # Friction sharper than a slip on the belt that reverses without ever being zero, and steps
    # short enough for it.
    truth = TRUTH.replace(step=2.5e-5, slip_speed=5e-6, static_speed=2.5e-4)
    known = {"truth": truth, "fixed": fixed}
    fidelity = known.get(name) or getattr(fj.Fidelity, name)()
    rows = [
        ORDINARY | {"mass": 75.0, "stiffness": 1e6},
        ORDINARY | {
            "mass": 2.0, "belt_kinetic": 0.31, "belt_static": 0.77, "stiffness": 1.6e8,
            "damping": 1.6e4, "kinetic": 0.06, "static": 0.32, "angle": 0.02, "top_speed": 0.6,
        },
    ]
    for ranges, seed, lane, *_ in OFF:
        rows.append({k: v[lane] for k, v in draw(seed, 128, ranges).items()})

    @jax.jit
    @one_by_one
    def run(x):
        result = fj.simulate(impact(x, 0.1), fidelity=fidelity, only=("peak_force",))
        return result.status, result.peak_force

    return np.array(jax.device_get(run(stack(rows))))


def test_modes_left_out_that_bend_the_fence_are_right():
    # Two modes: the rest takes 0.2 % of the link's length in deflection, and turns the fence.
    names = "coarse", "fast", "truth"
    (_, coarse), (fast, fine), (_, true) = (outcomes(name)[:, 0] for name in names)
    assert abs(coarse / true - 1) < 0.005
    assert fast <= fj.Status.LEFT_OVER_TIP
    assert abs(fine / true - 1) < 0.001


def test_a_parcel_that_lets_go_of_the_belt_is_said():
    (given, too_coarse), (_, true) = (outcomes(n)[:, 1] for n in ("fixed", "truth"))
    assert given == fj.Status.FRICTION_SMOOTHED
    assert abs(too_coarse / true - 1) > 0.004


@pytest.mark.parametrize("row", range(len(OFF)))
def test_what_a_step_misses_is_said(row):
    *_, expected, least = OFF[row]
    (given, force), (true_status, true) = (outcomes(n)[:, 2 + row] for n in ("fixed", "truth"))
    assert true_status <= fj.Status.LEFT_OVER_TIP
    assert given == expected
    assert abs(force / true - 1) > least
    # Steps that follow their error say so, too, or keep the promise.
    given, followed = outcomes("fast")[:, 2 + row]
    assert given == expected or abs(followed / true - 1) < 0.025


def test_general_integrators_end_on_what_is_not_a_number():
    # 500,000 steps of no length would take minutes.
    scene = fj.scenes.oblique_impact(duration=1e-3)
    scene = eqx.tree_at(lambda s: s.fence.thickness, scene, jnp.asarray(np.nan))
    fidelity = PLAIN.replace(integrator="tsit5", elements=2)
    assert status(scene, fidelity) == fj.Status.NON_FINITE


def test_throw_names_the_outcome():
    scene = eqx.tree_at(lambda s: s.speed, fj.scenes.rigid_wall(), jnp.asarray(np.nan))
    with pytest.raises(RuntimeError, match="NON_FINITE: the state is not finite"):
        fj.simulate(scene, throw=True)


def test_good_masks_value_and_gradient():
    speeds = jnp.array([1.0, jnp.nan, -1.0])

    def total(scale):
        def one(v):
            result = fj.simulate(fj.scenes.rigid_wall(speed=v + scale - 1), only=("peak_force",))
            return fj.good(result, {"force": result.peak_force})["force"], fj.holds(result)

        forces, true_status = jax.vmap(one)(speeds)
        return jnp.sum(forces), true_status

    for differentiate in (jax.jacfwd, jax.grad):
        slope, true_status = differentiate(total, has_aux=True)(1.0)
        assert true_status.tolist() == [True, False, True]
        alone = jax.grad(
            lambda v: fj.simulate(fj.scenes.rigid_wall(speed=v), only=("peak_force",)).peak_force
        )(1.0)
        np.testing.assert_allclose(slope, alone, rtol=1e-9)


# --- Before anything is compiled ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("build", "error", "text"),
    [
        (lambda: fj.Parcel(mass=10**400), ValueError, "`mass` must be finite .*inf"),
        (lambda: fj.Parcel(mass=10**40), ValueError, "`mass` must be 1e-11"),
        (lambda: fj.Parcel(mass=1e-20), ValueError, "`mass` must be 1e-11"),
        (lambda: fj.Parcel(stiffness=1e30), ValueError, "`stiffness` must be 0 ... 1e.21"),
        (lambda: fj.Fence(thickness=jnp.float16(0.04)), TypeError, "single or double precision"),
        (lambda: fj.Fence(thickness=jnp.bfloat16(0.04)), TypeError, "single or double precision"),
        (lambda: fj.ProfileTaper(["a", 1.0]), TypeError, "`ratios`"),
        (lambda: fj.ProfileTaper([True, 1.0]), TypeError, "`ratios`"),
        (lambda: fj.HarmonicDrive(top_speed=1e15), ValueError, "`top_speed` must be 0 ... 1e.12"),
        (lambda: fj.SplineDrive([200.0]), ValueError, "`control_angles` must be at most 100"),
        (
            lambda: fj.scenes.oblique_impact(drive_angle=-0.1), ValueError,
            "`drive_angle` must be at least .* begins there",
        ),
        (
            lambda: fj.scenes.oblique_impact(drive=fj.HeldDrive(0.3), drive_angle=0.2),
            ValueError, "`drive_angle` must be at least 0.3",
        ),
        (
            lambda: fj.scenes.oblique_impact(parcel_angle=1.0), ValueError,
            "corner 2 is .* beyond it. Change `parcel_angle`",
        ),
        (
            lambda: fj.scenes.oblique_impact(parcel=fj.Parcel(center_x=0.2, center_y=-0.15)),
            ValueError, "`parcel_angle` must be given",
        ),
        (
            lambda: fj.scenes.whole_sort(drive=fj.HeldDrive(0.3), front=1.0), ValueError,
            "must be clear of the fence at the start, but corner 1",
        ),
        (lambda: fj.scenes.whole_sort(duration=-1.0), ValueError, "`duration`"),
        (lambda: fj.scenes.whole_sort(front=1e15), ValueError, "`front`"),
    ],
)
def test_refused_by_the_constructors(build, error, text):
    with pytest.raises(error, match=text):
        build()


def test_numbers_that_are_all_but_nought_pass():
    parcel = fj.Parcel(center_x=1e-300, damping=1e-300)
    assert (float(parcel.center_x), float(parcel.damping)) == (1e-300, 1e-300)
    scene = fj.scenes.oblique_impact(velocity=(2.0, -1e-300, 0.0))
    assert [float(part) for part in scene.start.velocity] == [2.0, -1e-300, 0.0]


class Hasty(fj.HarmonicDrive):
    """A drive whose speed is not that of its angle."""

    def motion(self, time):
        motion = super().motion(time)
        return motion._replace(speed=1.1 * motion.speed)


@pytest.mark.parametrize("build", [fj.scenes.oblique_impact, fj.scenes.whole_sort])
def test_drives_move_by_their_own_angle(build):
    with pytest.raises(ValueError, match="`drive` must move by its own angle, but its speed"):
        build(drive=Hasty())


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        (lambda s: jnp.ones(3), ValueError, r"`parcel.mass` has the shape \(3,\).*vmap"),
        (lambda s: jnp.asarray(1), TypeError, "floating-point numbers .* int64"),
        (lambda s: jnp.asarray(1j), TypeError, "floating-point numbers .* complex"),
    ],
)
def test_scenes_changed_by_hand(change, error, text):
    scene = fj.scenes.rigid_wall()
    scene = eqx.tree_at(lambda s: s.parcel.mass, scene, change(scene))
    with pytest.raises(error, match=text):
        fj.simulate(scene)


def test_too_many_steps():
    scene = fj.scenes.rigid_wall(duration=1e6)
    with pytest.raises(ValueError, match="`duration` / `fidelity.step` must be at most"):
        fj.simulate(scene, fidelity=fj.Fidelity(step=1e-7))
