"""Second derivatives: a closed form, differences of gradients, and every way to ask for them."""

import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj

# The fewest operations that hold every part. Steps are fixed: where they follow their error, one
# step more between two points is a jump of the gradient, which is in a difference of gradients and
# not in a second derivative.
SMALL = fj.Fidelity.fast(modes=1, elements=6, geometry="small", step_tolerance=None)


def wall(logs, step=2.5e-5):
    """Logarithm of the peak force of an elastic impact on a rigid wall, over those of the
    parcel's mass, its stiffness and its speed."""
    mass, stiffness, speed = jnp.exp(logs)
    parcel = fj.Parcel(mass=10.0 * mass, stiffness=1.72e9 * stiffness, damping=0.0)
    scene = fj.scenes.rigid_wall(parcel=parcel, speed=speed)
    fidelity = fj.Fidelity.standard(step=step, step_tolerance=None)
    return jnp.log(fj.simulate(scene, fidelity=fidelity, only=("peak_force",)).peak_force)


def impact(logs):
    """Logarithm of an oblique impact's peak force over those of mass, thickness, top speed and
    the place of first contact."""
    mass, thickness, speed, place = jnp.exp(logs)
    scene = fj.scenes.oblique_impact(
        fence=fj.Fence(thickness=0.05 * thickness),
        parcel=fj.Parcel(mass=10.0 * mass),
        drive=fj.HarmonicDrive(top_speed=1.5 * speed),
        distance=place,
        duration=0.12,
    )
    return jnp.log(fj.simulate(scene, fidelity=SMALL, only=("peak_force",)).peak_force)


@pytest.fixture(scope="module")
def on_the_wall():
    return jax.jit(lambda x: (jax.grad(wall)(x), jax.hessian(wall)(x)))(jnp.zeros(3))


def test_power_law_of_an_elastic_impact(on_the_wall):
    # N = k D^4 takes up m v^2 / 2 = k D^5 / 5: the peak goes with (m v^2)^0.8 k^0.2, and its
    # logarithm is a straight line in the logarithms. The steps make an error of the order of
    # (h / T)^2, T some 6 ms: 2e-5, in the derivatives up to some ten times as much.
    gradient, hessian = on_the_wall
    np.testing.assert_allclose(gradient, [0.8, 0.2, 1.6], atol=2e-4)
    np.testing.assert_allclose(hessian, np.zeros((3, 3)), atol=2e-4)


def test_every_way_to_ask(on_the_wall):
    _, expected = on_the_wall
    x, direction = jnp.zeros(3), jnp.array([0.3, -0.5, 0.7])

    @jax.jit
    def all_of_them(x):
        slope = jax.grad(wall)
        _, along = jax.jvp(slope, (x,), (direction,))
        product = jax.grad(lambda y: jnp.dot(slope(y), direction))(x)
        return along, product, jax.jacrev(slope)(x), jax.vmap(jax.hessian(wall))(x[None])[0]

    along, product, backwards, lane = all_of_them(x)
    # The same columns, multiplied in another order: round-off of a long loop.
    np.testing.assert_allclose(along, expected @ direction, atol=1e-9)
    np.testing.assert_allclose(product, expected @ direction, atol=1e-9)
    np.testing.assert_allclose(backwards, expected, atol=1e-9)
    np.testing.assert_allclose(lane, expected, atol=1e-9)


@pytest.mark.parametrize("way", [jax.hessian, lambda f: jax.grad(lambda x: jax.grad(f)(x)[0])])
def test_reverse_mode_says_that_it_has_none(way):
    def peak(mass):
        scene = fj.scenes.rigid_wall(parcel=fj.Parcel(mass=mass[0]), speed=1.0)
        return fj.simulate(
            scene, fidelity=fj.Fidelity.fast(gradient="reverse"), only=("peak_force",)
        ).peak_force

    with pytest.raises(TypeError, match=r"gradient. must be 'forward' for second derivatives"):
        jax.eval_shape(way(peak), jnp.ones(1))


def test_against_differences_of_gradients():
    # Friction, belt, drive and a bending fence. The gradient is judged elsewhere by an independent
    # version; its central differences are off by the square of their step, 1e-8 times the third
    # derivatives, of the order of a thousand at the places between the elements, and by round-off
    # over the step, 1e-9. Where a corner begins to stick, gradients leave out the effect of its
    # friction on the first guess of its displacement (`friction_tangent.carried_over`), of the
    # second order in the step: some 2e-5 of the largest here.
    step = 1e-4
    points = jnp.concatenate([step * jnp.eye(4), -step * jnp.eye(4), jnp.zeros((1, 4))])

    def slope(x):
        found = jax.grad(impact)(x)
        return found, found

    # A Hessian and the gradient it is taken of, of all points in one program.
    hessians, slopes = jax.jit(jax.vmap(jax.jacfwd(slope, has_aux=True)))(points)
    differences = (slopes[:4] - slopes[4:8]) / (2 * step)
    hessian = hessians[8]
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-8 * np.abs(hessian).max())
    np.testing.assert_allclose(hessian, differences, atol=3e-5 * np.abs(hessian).max())


VARIABLES = "mass", "thickness", "E", "rho", "zeta", "l_s", "l_p", "top speed"


def in_eight(scene_of, x, fidelity):
    """Logarithm of a scene's peak force over the logarithms of eight numbers."""
    mass, thickness, modulus, density, damping, rigid, flexible, speed = jnp.exp(x)
    material = fj.Material(2.6e9 * modulus, 1130.0 * density, 0.035 * damping)
    scene = scene_of(
        fence=fj.Fence(0.6 * rigid, 0.6 * flexible, 0.15, 0.05 * thickness, material),
        parcel=fj.Parcel(mass=10.0 * mass),
        drive=fj.HarmonicDrive(top_speed=1.5 * speed),
    )
    return jnp.log(fj.simulate(scene, fidelity=fidelity, only=("peak_force",)).peak_force)


def seconds(work, repeats):
    """Median time [s] of some work."""
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(work())
        taken.append(time.perf_counter() - start)
    return float(np.median(taken))


@pytest.mark.bench
def test_cost_and_error_in_eight_variables(bench_directory):
    """What a Hessian costs beside a gradient, and how far it is from differences of gradients."""
    scenes = {
        "oblique impact": (lambda **p: fj.scenes.oblique_impact(duration=0.13, **p), {}),
        "oblique impact, the paper's chords": (
            lambda **p: fj.scenes.oblique_impact(duration=0.13, **p), {"geometry": "chord"},
        ),
        "whole sort": (lambda **p: fj.scenes.whole_sort(duration=1.36, **p), {}),
    }  # fmt: skip
    lines = [
        "| scene | value | gradient | Hessian | over a gradient | compiling: gradient | Hessian | "
        "from differences |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    at, step = jnp.zeros(8), 1e-4
    for name, (scene_of, knobs) in scenes.items():
        fidelity = fj.Fidelity.standard(**knobs)

        def peak(x, scene_of=scene_of, fidelity=fidelity):
            return in_eight(scene_of, x, fidelity)

        programs, compiling = [], []
        for function in (peak, jax.grad(peak), jax.hessian(peak)):
            start = time.perf_counter()
            programs.append(jax.jit(function).lower(at).compile())
            compiling.append(time.perf_counter() - start)
        value, gradient, hessian = programs
        times = [seconds(lambda each=each: each(at), 15) for each in programs]
        found = np.asarray(hessian(at))
        differences = np.stack(
            [
                (np.asarray(gradient(at + d)) - np.asarray(gradient(at - d))) / (2 * step)
                for d in step * jnp.eye(8)
            ]
        )
        error = np.abs(found - differences).max() / np.abs(found).max()
        lines.append(
            f"| {name} | {times[0] * 1e3:.2g} ms | {times[1] * 1e3:.2g} ms | "
            f"{times[2] * 1e3:.3g} ms | {times[2] / times[1]:.1f} | {compiling[1]:.1f} s | "
            f"{compiling[2]:.1f} s | {error:.1e} |"
        )
        print(lines[-1], flush=True)
        assert error < 1e-4
    (bench_directory / "second_derivatives.md").write_text("\n".join(lines) + "\n")
