"""The blocks of Newton's matrix: derivatives of the forces at the end of a step in the motion."""

import jax.numpy as jnp
from jaxtyping import Array

from ..model import Forces, Mechanics
from . import friction_tangent
from .friction_turn import Turn

# Largest slope of friction with the motion, relative to that of the inertia over half a step.
_MOST_SLOPE = 0.7
# Friction that loads the fence moves it under the corner, and so changes itself: least derivative
# [1] of its residual in itself that the matrix has.
_LEAST_OWN = 0.5


def friction_slopes(
    mechanics: Mechanics,
    forces: Forces,
    step: Array | float,
    sticking: tuple[Array, ...],
    normals: tuple[Array | None, ...],
    turns: list[Turn | None],
) -> list[Array]:
    """Slope of each contact's friction with its sliding speed [N s/m].

    `sticking` are the weights of the contacts that stuck at the step's start, `normals` [N] their
    normal forces there, and `turns` what reversals of friction within the step add.

    Where friction falls so steeply that the parcel's inertia over half the step does not outweigh
    it, most of the slope is left out: the step's equations fold there, and an iteration with the
    exact slope would turn back at the fold instead of going on to the root beyond it.
    """
    found = []
    weights = friction_tangent.by_contact(mechanics, sticking)
    for meeting, weight, normal, turn in zip(
        forces.meetings, weights, normals, turns, strict=True
    ):
        what, parts, _, response = meeting
        assert response is not None
        pressed = what.normal if normal is None else what.normal + weight * normal
        slope = pressed * response.sliding
        if turn is not None:
            slope = slope + turn.slope
        inertia = jnp.maximum(0.5 * step * mechanics.lightness(parts), 1e-30)
        found.append(jnp.minimum(slope, _MOST_SLOPE / inertia))
    return found


def rate_matrix(
    mechanics: Mechanics,
    forces: Forces,
    step: Array | float,
    unknown_normals: bool,
    shares: list[Array],
    friction_slopes: list[Array],
    on_belt: Array | float = 1.0,
):
    """-d(generalised force)/d(velocities) [N s/m], 3 x 3, at fixed directions and arms.

    Positions follow the velocities by `step` / 3. `shares` are the frictions as shares of the
    normal forces, `friction_slopes` their slopes with the sliding speeds; the belt's friction is
    weighted by `on_belt` [1]. With `unknown_normals` the normal forces at the fence are unknowns of
    their own, and constant here.
    """
    zero = jnp.zeros_like(forces.acceleration.x)
    matrix = [[zero] * 3 for _ in range(3)]
    if mechanics.belt is not None and forces.belt_slopes is not None and forces.slip is not None:
        grip, grip_slope = (on_belt * slope for slope in forces.belt_slopes)
        x, y, turning, arm, lever = forces.slip
        slip, weights = (x, y, arm * turning), (1.0, 1.0, arm**2)
        if lever is not None:
            slip, weights = (x, y, slip[2] + lever * x), (1.0, 1.0, weights[2] + lever**2)
        for i in range(3):
            for j in range(3):
                matrix[i][j] = 2 * grip_slope * slip[i] * slip[j]
            matrix[i][i] = matrix[i][i] + grip * weights[i]
        if lever is not None:
            matrix[0][2] = matrix[0][2] + grip * lever
            matrix[2][0] = matrix[2][0] + grip * lever
    fixed_normals = (unknown_normals,) * len(forces.fence) + (False,) * len(forces.still)
    for meeting, fixed, share, slope in zip(
        forces.meetings, fixed_normals, shares, friction_slopes, strict=True
    ):
        _, parts, _, response = meeting
        assert response is not None
        stiffness = response.gap * step / 3 + response.gap_rate
        for i in range(3):
            along = parts.normal[i] + share * parts.tangent[i]
            for j in range(3):
                change = -slope * parts.tangent[i] * parts.tangent[j]
                if not fixed:
                    change = change + stiffness * along * parts.normal[j]
                matrix[i][j] = matrix[i][j] + change
    return matrix


def add_frictions(
    matrix: list[list[Array]],
    residual: list[Array],
    forces: Forces,
    frictions: tuple[Array, ...],
    scales: tuple[Array, ...],
    friction_slopes: list[Array],
    drifts: list[list[Array]],
) -> None:
    """Put the friction at the fence, `frictions` [N], among the unknowns after the normal forces.

    Its residual is F + F_law. It lets corners slide by the second half of each of the `drifts`
    [m/s/N]. `scales` are those of the velocities' rows.
    """
    count = len(frictions)
    for k, friction in enumerate(frictions):
        for i in range(3):
            along = jnp.zeros_like(friction)
            for friction_slope, drift, meeting in zip(
                friction_slopes, drifts, forces.fence, strict=False
            ):
                along = along + friction_slope * drift[count + k] * meeting.touch.tangent[i]
            matrix[i].append(-scales[i] * along)
        what, parts, _, response = forces.fence[k]
        assert response is not None
        residual.append(friction + what.friction)
        slope = what.normal * response.sliding
        row = [slope * t for t in parts.tangent]
        row += [slope * drift for drift in drifts[k]] if drifts else [0 * friction] * (2 * count)
        row[3 + k] = row[3 + k] + response.share
        # Friction moves the fence along with the corner: with a smaller diagonal entry Newton's
        # method would step away from the root.
        row[3 + count + k] = 1 + jnp.maximum(row[3 + count + k], _LEAST_OWN - 1)
        matrix.append(row)
