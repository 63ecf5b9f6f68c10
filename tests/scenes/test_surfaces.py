"""Still surfaces beside the border."""

import dataclasses

import jax
import numpy as np
import pytest

import fencejax as fj

FALL = fj.scenes.free_motion(
    position=(0.0, 0.25), angle=0.3, velocity=(2.0, -1.5, 0.0), surfaces=(fj.Border(),),
    surface_corners=(1, 2), duration=0.15,
)  # fmt: skip


@jax.jit
def run(scene):
    return fj.simulate(scene, history=False)


def test_a_border_among_the_surfaces_is_the_border():
    # The same equations, under another name: the same numbers but for rounding.
    other = dataclasses.replace(
        FALL, border=fj.Border(), border_corners=(1, 2), surfaces=(), surface_corners=()
    )
    first, second = run(FALL), run(other)
    assert int(first.status) == int(second.status) == fj.Status.SUCCESSFUL
    assert float(first.peak_surface_force) > 100
    assert float(second.peak_surface_force) == 0
    assert float(first.peak_border_force) == 0
    np.testing.assert_allclose(first.peak_surface_force, second.peak_border_force, rtol=1e-9)
    np.testing.assert_allclose(first.final, second.final, rtol=1e-9)
    np.testing.assert_allclose(first.deepest, second.deepest, rtol=1e-9)
    np.testing.assert_allclose(
        first.energy.border_friction_loss, second.energy.border_friction_loss, rtol=1e-9
    )


def test_a_scene_without_surfaces_holds_nothing_of_them():
    scene = fj.scenes.free_motion(duration=0.15)
    assert scene.surfaces == scene.surface_corners == ()
    plain = dataclasses.replace(scene, surface_corners=(1, 2))
    texts = [
        jax.jit(lambda s: fj.simulate(s, only=["final"]).final).lower(each).as_text()
        for each in (scene, plain)
    ]
    assert texts[0] == texts[1]


def test_what_is_no_surface_or_is_entered_at_the_start_is_refused():
    with pytest.raises(TypeError, match=r"`surfaces` must be a tuple of surfaces, but"):
        fj.scenes.passive_sort((1.0,))
    with pytest.raises(ValueError, match=r"corner 1 is 0\.05 \[m\] inside `surfaces\[0\]`"):
        fj.scenes.free_motion(position=(0.0, 0.1), surfaces=(fj.Border(),))


def test_numbers_of_a_surface_have_units():
    scene = dataclasses.replace(FALL, surfaces=(fj.Border(), fj.Border(None)))
    number = fj.scene_numbers.number(scene, "surfaces[0].friction.kinetic")
    assert number.bounds == fj.Friction.bounds["kinetic"]
