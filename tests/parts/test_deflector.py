"""A rigid passive deflector: against the rigid wall, and against an integration by SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

import fencejax as fj

TILT, MASS, SPEED = 0.4, 15.0, 2.426
STIFFNESS, VISCOSITY = 1.72e9, 3.3e5 * MASS**0.4
FIDELITY = fj.Fidelity(step=1e-4, step_tolerance=None, longest_stride=1)


def flight(angle, velocity, turn, friction, corner, spin=0.0):
    """A parcel at 1 mm from the deflector, that touches with one corner, without a belt."""
    parcel = fj.Parcel()
    x, y = (float(q) for q in parcel.corner(corner))
    arm = (np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y)
    place = (
        0.6 * np.cos(TILT) - 1e-3 * np.sin(TILT) - arm[0],
        0.6 * np.sin(TILT) + 1e-3 * np.cos(TILT) - arm[1],
    )
    return fj.scenes.free_motion(
        position=place, angle=turn, velocity=(*velocity, spin), parcel=parcel, belt=None,
        surfaces=(fj.surfaces.Deflector(angle, friction=friction),), surface_corners=(corner,),
        duration=0.06,
    )  # fmt: skip


@jax.jit
def peak(scene):
    """Slopes of the peak force, and the result."""

    def run(scene):
        result = fj.simulate(scene, fidelity=FIDELITY, history=False)
        return result.peak_surface_force, result

    return jax.grad(run, has_aux=True)(scene)


def test_a_blow_along_the_normal_is_that_of_the_rigid_wall():
    # C_s on the normal through the corner, no friction: one coordinate, so N_stiff and the same
    # restitution, and the parcel leaves without a spin. The peak goes with the normal speed, whose
    # derivative in the wall's angle is 0 where the velocity is along the normal.
    direction = np.array([np.sin(TILT), -np.cos(TILT)])
    turn = TILT - np.pi / 2 - np.arctan2(-0.15, 0.2)
    scene = flight(TILT, SPEED * direction, turn, None, 1)
    slopes, result = peak(scene)
    assert int(result.status) == fj.Status.SUCCESSFUL
    wall = fj.scenes.rigid_wall(speed=SPEED, duration=0.06)
    wall = fj.simulate(wall, fidelity=FIDELITY, history=False)
    # Both by the second-order scheme, the deflector touched within a step: the square of a step
    # over the 10 ms in which the force rises and falls.
    np.testing.assert_allclose(result.peak_surface_force, wall.peak_force, rtol=1e-4)
    leaves = np.array([result.final.x_rate, result.final.y_rate]) @ -direction
    np.testing.assert_allclose(leaves, wall.final.y_rate, rtol=1e-4)
    assert abs(float(result.final.spin)) < 1e-8
    # The wall gives no momentum along itself.
    along = float(result.final.x_rate) * np.cos(TILT) + float(result.final.y_rate) * np.sin(TILT)
    assert abs(along) < 1e-8
    assert abs(float(slopes.surfaces[0].angle)) < 1e-2 * float(result.peak_surface_force)


def test_an_oblique_blow_with_friction():
    # Newton-Euler of a free rectangle, one corner at the wall; friction smoothed as here. SciPy's
    # LSODA to 1e-10; the slope in the angle by central differences of it.
    mu, slip = 0.35, FIDELITY.slip_speed
    velocity, turn, spin = (2.0, -0.4), 0.1, 1.5
    friction = fj.Friction(mu, mu)
    scene = flight(TILT, velocity, turn, friction, 1, spin)
    inertia, start = MASS * (0.4**2 + 0.3**2) / 12, scene.start.motion
    corner = (0.2, -0.15)

    def struck(tilt):
        normal = np.array([-np.sin(tilt), np.cos(tilt)])
        tangent = np.array([np.cos(tilt), np.sin(tilt)])

        def forces(state):
            x, y, phi, vx, vy, w = state
            c, s = np.cos(phi), np.sin(phi)
            r = np.array([c * corner[0] - s * corner[1], s * corner[0] + c * corner[1]])
            rate = np.array([vx - w * r[1], vy + w * r[0]])
            gap, gap_rate = -(np.array([x, y]) + r) @ normal, -rate @ normal
            depth = max(gap, 0.0)
            force = max(0.0, depth**2 * (VISCOSITY * gap_rate + STIFFNESS * depth**2))
            slide = rate @ tangent
            total = force * (normal - mu * slide / np.hypot(slide, slip) * tangent)
            return force, total, r[0] * total[1] - r[1] * total[0]

        def field(_, state):
            _, total, moment = forces(state)
            return np.concatenate([state[3:], total / MASS, [moment / inertia]])

        times = np.linspace(0, 0.06, 60001)
        found = solve_ivp(field, (0, 0.06), [float(q) for q in start], method="LSODA",
                          t_eval=times, rtol=1e-10, atol=1e-12, max_step=1e-4)  # fmt: skip
        normals = np.array([forces(state)[0] for state in found.y.T])
        k = int(np.argmax(normals))
        before, now, after = normals[k - 1 : k + 2]
        return now - (after - before) ** 2 / (8 * (before - 2 * now + after)), found.y[:, -1]

    highest, end = struck(TILT)
    slopes, result = peak(scene)
    assert int(result.status) == fj.Status.SUCCESSFUL
    assert highest > 300
    # The scheme is of the second order: (1e-4 / 1e-2)^2 of the values, ten times that of slopes.
    np.testing.assert_allclose(result.peak_surface_force, highest, rtol=1e-4)
    np.testing.assert_allclose(result.final, end, rtol=3e-4, atol=3e-4)
    slope = (struck(TILT + 1e-4)[0] - struck(TILT - 1e-4)[0]) / 2e-4
    np.testing.assert_allclose(slopes.surfaces[0].angle, slope, rtol=1e-3)
    # Nothing but friction and the contact took energy, and the ledger holds both.
    assert float(result.energy.border_friction_loss) > 0
    assert float(result.energy.contact_loss) > 0
    assert abs(float(result.energy.residual)) < 1e-3 * float(result.energy.contact_loss)


def test_the_force_ends_at_the_ends_of_the_wall():
    wall = fj.surfaces.Deflector(TILT, length=0.5, hinge_x=0.1)
    along = np.array([-0.01, 0.0, 0.25, 0.5, 0.52])
    x, y = 0.1 + along * np.cos(TILT), along * np.sin(TILT)
    point = jax.vmap(wall.at)(jnp.asarray(x), jnp.asarray(y))
    np.testing.assert_allclose(point.gap, 0.0, atol=1e-16)
    np.testing.assert_allclose(point.place, along, atol=1e-15)
    np.testing.assert_allclose(point.beyond, [0.01, 0.0, -0.25, 0.0, 0.02], atol=1e-15)
