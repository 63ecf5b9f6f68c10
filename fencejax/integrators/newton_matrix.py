"""How the forces at the end of a step answer to the motion: the blocks of Newton's matrix."""

import jax.numpy as jnp
from jaxtyping import Array

from ..model import Forces, Mechanics
from . import friction_tangent
from .friction_turn import Turn

# Largest slope of friction with the motion, relative to that of the inertia over half a step.
_MOST_ALONG = 0.7
# Least share of friction that is its own where it loads the fence, and so moves under the corner.
_LEAST_OWN = 0.5


def drags(
    mechanics: Mechanics,
    forces: Forces,
    step: Array | float,
    sticking: tuple[Array, ...],
    normals: tuple[Array | None, ...],
    turns: list[Turn | None],
) -> list[Array]:
    """Slope of each contact's friction with its sliding speed [N s/m], with the weights `sticking`
    of frictions that held a corner at the step's start, the `normals` [N] that pressed it there,
    and their `turns`.

    Where friction falls so steeply that the parcel's inertia over half the step does not
    outweigh it, most of the slope is left out: the equations fold there, and an iteration with
    their own slope would be turned back at the fold instead of going on to the root beyond it.
    """
    found = []
    weights = friction_tangent.spread(mechanics, sticking)
    for meeting, weight, normal, turn in zip(
        forces.meetings, weights, normals, turns, strict=True
    ):
        what, parts, _, response = meeting
        assert response is not None
        pressed = what.normal if normal is None else what.normal + weight * normal
        drag = pressed * response.sliding
        if turn is not None:
            drag = drag + turn.slope
        inertia = jnp.maximum(0.5 * step * mechanics.lightness(parts), 1e-30)
        found.append(jnp.minimum(drag, _MOST_ALONG / inertia))
    return found


def rate_matrix(
    mechanics: Mechanics,
    forces: Forces,
    step: Array | float,
    unknown_normals: bool,
    shares: list[Array],
    drags: list[Array],
    on_belt: Array | float = 1.0,
):
    """-d(generalised force)/d(velocities) [N s/m], 3 x 3, at frozen directions and arms, where
    positions follow the velocities by `step` / 3, with the frictions' `shares` of the normal
    forces and their slopes `drags`, and where the belt's friction counts `on_belt` [1]. With
    `unknown_normals` the normal forces at the fence are held."""
    zero = jnp.zeros_like(forces.acceleration.x)
    matrix = [[zero] * 3 for _ in range(3)]
    if mechanics.belt is not None and forces.belt_slopes is not None and forces.slip is not None:
        grip, bend = (on_belt * slope for slope in forces.belt_slopes)
        x, y, turning, arm, lever = forces.slip
        slip, weights = (x, y, arm * turning), (1.0, 1.0, arm**2)
        if lever is not None:
            slip, weights = (x, y, slip[2] + lever * x), (1.0, 1.0, weights[2] + lever**2)
        for i in range(3):
            for j in range(3):
                matrix[i][j] = 2 * bend * slip[i] * slip[j]
            matrix[i][i] = matrix[i][i] + grip * weights[i]
        if lever is not None:
            matrix[0][2] = matrix[0][2] + grip * lever
            matrix[2][0] = matrix[2][0] + grip * lever
    held_at = (unknown_normals,) * len(forces.fence) + (False,) * len(forces.still)
    for meeting, held, share, drag in zip(forces.meetings, held_at, shares, drags, strict=True):
        _, parts, _, response = meeting
        assert response is not None
        press = response.gap * step / 3 + response.gap_rate
        for i in range(3):
            along = parts.normal[i] + share * parts.tangent[i]
            for j in range(3):
                change = -drag * parts.tangent[i] * parts.tangent[j]
                if not held:
                    change = change + press * along * parts.normal[j]
                matrix[i][j] = matrix[i][j] + change
    return matrix


def add_frictions(
    matrix: list[list[Array]],
    residual: list[Array],
    forces: Forces,
    rubs: tuple[Array, ...],
    scales: tuple[Array, ...],
    drags: list[Array],
    drifts: list[list[Array]],
) -> None:
    """Put friction on the fence, `rubs` [N], among the unknowns after the normal forces: it is what
    the law says, residual F + F_law, and lets corners slide by the second half of each of the
    `drifts` [m/s/N]. `scales` are those of the velocities' rows."""
    count = len(rubs)
    for k, rub in enumerate(rubs):
        for i in range(3):
            along = jnp.zeros_like(rub)
            for drag, drift, meeting in zip(drags, drifts, forces.fence, strict=False):
                along = along + drag * drift[count + k] * meeting.touch.tangent[i]
            matrix[i].append(-scales[i] * along)
        what, parts, _, response = forces.fence[k]
        assert response is not None
        residual.append(rub + what.friction)
        slope = what.normal * response.sliding
        row = [slope * t for t in parts.tangent]
        row += [slope * drift for drift in drifts[k]] if drifts else [0 * rub] * (2 * count)
        row[3 + k] = row[3 + k] + response.share
        # It pulls the fence along with the corner: a matrix that says otherwise has no root ahead.
        row[3 + count + k] = 1 + jnp.maximum(row[3 + count + k], _LEAST_OWN - 1)
        matrix.append(row)
