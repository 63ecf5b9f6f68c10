"""The choice of a fidelity by measurement: its promise, its refusals, its evidence."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from robustness.random_scenes import impacts, stack

import fencejax as fj
from fencejax.study import as_fine, expected_cost, ladder

FIELD = ("peak_force",)
NAMES = ("thickness", "density", "mass")
FOUR_MODES = fj.Fidelity(step=5e-4, step_tolerance=None, modes=4)
ONE_MODE = fj.Fidelity(step=5e-4, step_tolerance=None, modes=1)
DEARER = fj.Fidelity(step=1.25e-4, step_tolerance=None, modes=4)


def normal_impacts(seed, count):
    """Impacts on a fence at rest: the scenes whose programs compile the fastest."""
    rng = np.random.default_rng(seed)
    return stack([
        fj.scenes.normal_impact(
            distance=rng.uniform(0.7, 1.1),
            speed=rng.uniform(1, 3),
            parcel=fj.Parcel(mass=rng.uniform(4, 25)),
            duration=0.06,
        )
        for _ in range(count)
    ])  # fmt: skip


def walls(speeds, duration=0.05):
    return [fj.scenes.rigid_wall(speed=v, duration=duration) for v in speeds]


def scaled(scene, factors):
    def where(s):
        fence, material = s.fence, s.fence.material
        numbers = [fence.thickness, fence.flexible_length, material.youngs_modulus]
        place = s.distance if isinstance(s, fj.NormalScene) else s.start.place
        return [*numbers, material.density, material.damping_ratio, s.parcel.mass, place]

    products = [leaf * f for leaf, f in zip(where(scene), factors, strict=True)]
    return eqx.tree_at(where, scene, products)


def truth(fidelity, scenes):
    """Peak force and its elasticities, by reverse mode and without `fencejax.study.measurement`."""

    def log_peak(factors, scene):
        result = fj.simulate(scaled(scene, factors), fidelity=fidelity, only=FIELD)
        return jnp.log(result.peak_force)

    function = jax.vmap(jax.value_and_grad(log_peak), in_axes=(None, 0))
    value, slopes = jax.jit(function)([jnp.ones(())] * 7, scenes)
    return np.exp(np.asarray(value)), np.stack([np.asarray(s) for s in slopes], axis=1)


def errors(fidelity, scenes):
    value, slopes = truth(fidelity, scenes)
    exact, exact_slopes = truth(fj.Fidelity.reference(), scenes)
    off = np.linalg.norm(slopes - exact_slopes, axis=1) / np.linalg.norm(exact_slopes, axis=1)
    return np.abs(value / exact - 1), off


@functools.cache
def chosen():
    seen = []
    choice = fj.choose_fidelity(
        normal_impacts(0, 12),
        gradient_error=2e-2,
        candidates=(DEARER, FOUR_MODES, ONE_MODE),
        with_respect_to=NAMES,
        progress=seen.append,
    )
    return choice, seen


def test_promise_on_scenes_not_seen():
    choice, _ = chosen()
    value, gradient = errors(choice.fidelity, normal_impacts(1, 12))
    assert np.max(value) <= choice.value_error
    assert np.max(gradient) <= choice.gradient_error


def test_evidence():
    choice, seen = chosen()
    assert choice.reference == fj.Fidelity.reference()
    assert [trial.fidelity for trial in choice.table] == [ONE_MODE, FOUR_MODES, DEARER]
    assert 0 < choice.reference_value_error < 1e-4
    assert choice.reference_value_error < choice.reference_gradient_error < 1e-3
    assert choice.scenes == 12
    assert choice.variables == NAMES
    assert choice.reference_time > 0
    _, trial, dearer = choice.table
    assert trial.passed
    assert trial.fidelity == choice.fidelity
    assert trial.time == trial.gradient_time
    assert trial.value_time > 0
    assert 1.5 * trial.value_error < choice.value_error
    assert 1.5 * trial.gradient_error < choice.gradient_error
    assert dearer.outcome == "not tried: dearer"
    assert dearer.value_error is None
    assert [trial.fidelity for trial in seen] == [FOUR_MODES, ONE_MODE]
    text = str(choice)
    assert "* " in text
    assert "Reference: 0.025 ms, 12 modes, chord" in text
    assert all(trial.outcome in text for trial in choice.table)


def test_too_few_modes_are_refused_by_the_gradient_though_the_value_is_right():
    choice, _ = chosen()
    few, enough, _ = choice.table
    assert 1.5 * few.value_error < choice.value_error
    assert few.gradient_error > choice.gradient_error
    assert few.outcome == "gradient too far off"
    assert choice.fidelity == enough.fidelity


def test_best_is_named_where_none_does():
    coarse, finer = (fj.Fidelity(step=h, step_tolerance=None) for h in (2e-3, 1e-3))
    with pytest.raises(fj.NoFidelityError, match="1 ms, 4 modes, arc") as refused:
        fj.choose_fidelity(
            walls([1.0, 2.0, 3.0]), value_error=1e-4, gradient_error=None,
            candidates=(coarse, finer),
        )  # fmt: skip
    evidence = refused.value.evidence
    assert evidence.fidelity == finer
    assert [trial.outcome for trial in evidence.table] == ["value too far off"] * 2
    assert evidence.table[0].value_error > evidence.table[1].value_error > 1e-4


def test_no_claim_tighter_than_the_reference():
    with pytest.raises(fj.NoFidelityError, match="reference is not converged") as refused:
        fj.choose_fidelity(walls([2.0]), value_error=1e-9, gradient_error=None)
    assert refused.value.evidence.table == ()
    assert refused.value.evidence.reference_value_error > 1e-9


def test_scenes_of_several_structures():
    scenes = [*walls([1.0, 2.0]), *walls([3.0], duration=0.06)]
    choice = fj.choose_fidelity(
        scenes, value_error=1e-3, gradient_error=None, candidates=(FOUR_MODES, ONE_MODE)
    )
    assert choice.scenes == 3
    # Without a fence, modes make no difference and a step is tried once.
    assert len(choice.table) == 1
    exact = [fj.simulate(s, fidelity=choice.reference, only=FIELD).peak_force for s in scenes]
    value = [fj.simulate(s, fidelity=choice.fidelity, only=FIELD).peak_force for s in scenes]
    assert np.max(np.abs(np.array(value) / np.array(exact) - 1)) <= 1e-3


def test_ladder_is_ordered():
    rungs = ladder()
    assert len(set(rungs)) == len(rungs)
    assert all(as_fine(rung, rung) for rung in rungs)
    assert as_fine(fj.Fidelity.standard(), fj.Fidelity.fast())
    assert not as_fine(fj.Fidelity.fast(), fj.Fidelity.standard())
    assert not as_fine(DEARER.replace(integrator="kvaerno5"), DEARER)
    assert expected_cost(fj.Fidelity.fast()) < expected_cost(fj.Fidelity.standard())


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (dict(value_error=0.0), ValueError, "`value_error` must be finite and above 0"),
        (dict(gradient_error=-1.0), ValueError, "`gradient_error` must be finite and above 0"),
        (dict(margin=0.5), ValueError, "`margin` must be at least 1, but is 0.5"),
        (dict(quantities=()), ValueError, "`quantities` must hold at least one"),
        (dict(quantities=("force",)), ValueError, "`quantities` must be one of"),
        (dict(candidates=()), ValueError, "`candidates` must hold at least one"),
        (dict(candidates=("fast",)), TypeError, "must be made of `fencejax.Fidelity`"),
        (dict(with_respect_to=()), ValueError, "`with_respect_to` must hold at least one"),
        (dict(with_respect_to=("thickness",)), ValueError, "'thickness' is no floating-point"),
        (dict(with_respect_to=("drive.top_speed",)), ValueError, "'drive.top_speed' is no"),
    ],
)
def test_arguments_are_checked(arguments, kind, message):
    with pytest.raises(kind, match=message):
        fj.choose_fidelity(walls([2.0]), **arguments)


def test_scenes_are_checked():
    with pytest.raises(ValueError, match="at least one scene"):
        fj.choose_fidelity([])
    with pytest.raises(TypeError, match="but holds a float"):
        fj.choose_fidelity([1.0])
    with pytest.raises(TypeError, match="is traced"):
        jax.jit(lambda s: fj.choose_fidelity(s))(fj.scenes.rigid_wall())
    uneven = eqx.tree_at(lambda s: s.speed, fj.scenes.rigid_wall(), jnp.ones(3))
    uneven = eqx.tree_at(lambda s: s.parcel.mass, uneven, jnp.ones(2))
    with pytest.raises(ValueError, match="stacked along a leading axis"):
        fj.choose_fidelity(uneven)


@pytest.mark.bench
def test_promise_on_impacts(bench_directory):
    """The same on oblique impacts, by the default ladder: 16 are measured, 64 others checked."""
    choice = fj.choose_fidelity(impacts(3, 16, 0.1))
    (bench_directory / "choice.txt").write_text(f"{choice}\n")
    value, gradient = errors(choice.fidelity, impacts(4, 64, 0.1))
    row = [f"{np.quantile(x, q):.2e}" for x in (value, gradient) for q in (0.5, 0.95, 1.0)]
    (bench_directory / "choice_unseen.txt").write_text(" ".join(row) + "\n")
    kept = (value <= choice.value_error) & (gradient <= choice.gradient_error)
    assert np.mean(kept) >= 0.95
