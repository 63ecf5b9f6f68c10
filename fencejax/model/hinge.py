"""The fence whose hinge angle is a state, on a flexible shaft or driven by a torque: its modes with
the hinge free to turn.

With theta [rad] the hinge's angle ahead of the motor and eta [m] the clamped-root modes,

    J theta'' + m_0 p.eta'' + c_t theta' + k_t theta = Q_theta - J alpha_w'',
    m_0 (eta_i'' + p_i theta'' + c_i eta_i' + omega_i^2 eta_i) = Q_i - m_0 p_i alpha_w'',

J [kg m^2] the inertia of hub and straight fence about the hinge and p_i [m] what its swing does to
mode i; a force N at sigma gives Q_theta = -N sigma and Q_i = -N phi_i(sigma). The modes of both
take the place of the clamped ones, theta = sum a_j xi_j, eta_i = sum b_ij xi_j, and advance as
exactly as these, whatever the stiffness: the bent line is that of the clamped modes, turned by
theta. Damping couples them unless c_t / k_t is the lag beta of the material: with the excess
kappa = c_t - beta k_t,

    xi_j'' + (beta Omega_j^2 + kappa a_j^2 / m_0) xi_j' + Omega_j^2 xi_j
        = (1 / m_0) (sum b_ij Q_i + a_j Q_theta - kappa a_j (theta' - a_j xi_j')),

and the last term, linear over a step as all loads are, is found in closed form at its end.

On a torque drive theta is the hinge's own angle and alpha_w = 0: T(t) takes the place of -J
alpha_w'', J holds the drive's inertia, k_t and c_t are the drive's spring and damping. k_t may be
0, and one Omega_j with it. As c_t theta' may then be large for a mode without other damping, all of
kappa a_j theta' is in the last term, including a_j xi_j'.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..parts import AbstractTorqueDrive, Shaft
from .beam import BeamTables
from .mode_shapes import Blocks
from .propagation import Propagator
from .vibration import Vibration, blocks, dot, flat


class ClampedLink(NamedTuple):
    """The fence clamped at its root: omega_i^2 [1/s^2] and p_i [m] of its modes, (m,) each; m_0
    [kg]; its inertia J [kg m^2] about the hinge, with the hub's; its lag c_i / omega_i^2 [s]."""

    eigenvalues: Array
    swing: Array
    mass_scale: Array
    inertia: Array
    lag: Array


class ClutchState(NamedTuple):
    """A clutch at an instant: the moment L = k_t s + c_t s' [N m] that its slip s [rad] takes off
    the shaft's spring and damper, and the rate s' [rad/s]."""

    relief: Array
    rate: Array


class Clutch(eqx.Module):
    """The shaft's clutch: the moment T_c [N m] at which it slips, k_t [N m/rad] and c_t [N m s/rad]
    of the shaft."""

    limit: Array
    stiffness: Array
    damping: Array

    def __init__(self, shaft: Shaft):
        assert shaft.slip_torque is not None
        self.limit = shaft.slip_torque
        self.stiffness, self.damping = shaft.stiffness, shaft.damping

    @property
    def lag(self) -> Array:
        """c_t / k_t [s]: s + lag s' = L / k_t."""
        return self.damping / self.stiffness

    def slip(self, state: ClutchState) -> Array:
        """s [rad]."""
        return state.relief / self.stiffness - self.lag * state.rate

    def moment(self, twist: Array, rate: Array) -> Array:
        """-k_t theta - c_t theta' [N m]: the shaft's moment T less L."""
        return -self.stiffness * twist - self.damping * rate

    def stored(self, twist: Array, state: ClutchState) -> Array:
        """k_t (theta - s)^2 / 2 less k_t theta^2 / 2 [J], which the modes hold."""
        slip = self.slip(state)
        return self.stiffness * slip * (0.5 * slip - twist)

    def loss(self, twist: Array, rate: Array, state: ClutchState) -> Array:
        """c_t (theta' - s')^2 - T s' less c_t theta'^2 [W], which the modes dissipate."""
        spring = self.stiffness * (twist - self.slip(state))
        return state.rate * (spring - self.damping * rate)


class Hinge(eqx.Module):
    """The modes of a fence on a shaft or a torque drive: `turn` a_j [rad/m], (m + 1,), and
    `clamped` b_ij [1], (m, m + 1), of unit amplitude, with the `eigenvalues` Omega_j^2 [1/s^2];
    kappa / m_0, the shaft's damping in `excess` of the material's [1/s m^2]; its `stiffness` k_t
    [N m/rad]; the clamped `link`; the clutch, if there is one; and whether the hinge is `driven` by
    a torque."""

    turn: Array
    clamped: Array
    eigenvalues: Array
    excess: Array
    stiffness: Array
    link: ClampedLink
    clutch: Clutch | None
    driven: bool = eqx.field(static=True)

    def __init__(self, mount: Shaft | AbstractTorqueDrive, link: ClampedLink):
        self.link, self.stiffness = link, mount.stiffness
        self.driven = isinstance(mount, AbstractTorqueDrive)
        self.excess = (mount.damping - link.lag * mount.stiffness) / link.mass_scale
        self.clutch = None
        if isinstance(mount, AbstractTorqueDrive):
            self.turn, self.clamped, self.eigenvalues = _free(mount.stiffness, link)
            return
        self.clutch = None if mount.slip_torque is None else Clutch(mount)
        self.turn, self.clamped, self.eigenvalues = _sprung(mount.stiffness, link)

    @property
    def damping(self) -> Array:
        """kappa a_j^2 / m_0 [1/s], (m + 1,): the part that acts on each mode by its own rate."""
        return jnp.zeros_like(self.turn) if self.driven else self.excess * self.turn**2

    @property
    def driving(self) -> Array:
        """a_j / m_0 [1/(kg m)]: the modal forces by a unit torque on the hinge."""
        return self.turn / self.link.mass_scale

    def clamped_loads(self, table: Array) -> Array:
        """A `table` (n, m) over the clamped modes' shares of a load for those of these modes,
        (n, m + 1): the shares are sigma a_j + sum_i b_ij phi_i(sigma), and by the modes'
        orthogonality phi_i(sigma) = sum_j (p_i a_j + b_ij) of them."""
        return table @ (self.link.swing[:, None] * self.turn[None] + self.clamped)

    def mixed(self, tables: BeamTables, rate: Array, length: Array) -> BeamTables:
        """The tables of the clamped modes for these: `eigenvalues` in units of `rate` [1/s^2], and
        the hub's and the fence's inertia in `swing_tip`, in units of the `length` [m]; those of the
        arc and of the modes left out stay."""
        inertia = self.link.inertia * self.turn / (self.link.mass_scale * length)
        return tables._replace(
            eigenvalues=self.eigenvalues / rate,
            deflection=tables.deflection @ self.clamped,
            slope=tables.slope @ self.clamped,
            swing_root=tables.swing_root @ self.clamped,
            swing_tip=tables.swing_tip @ self.clamped + inertia,
            moment=tables.moment @ self.clamped,
        )

    @property
    def stuck_frequency(self) -> Array:
        """sqrt(k_t / J_0) [rad/s] of the hinge against the shaft's spring, J_0 the part of the
        inertia that does not move with the clamped modes: how fast the moment answers."""
        link = self.link
        alone = link.inertia - link.mass_scale * jnp.sum(link.swing**2)
        return jnp.sqrt(self.stiffness / alone)

    def first_clamped(self, values: Blocks, count: int) -> list[Array]:
        """Amplitudes [m] of the first clamped modes, or their rates [m/s], from those of these
        modes."""
        every = flat(values)
        return [jnp.sum(self.clamped[i] * every) for i in range(count)]

    def twist(self, state: Vibration) -> tuple[Array, Array]:
        """theta [rad] and its rate [rad/s]."""
        turn = blocks(self.turn)
        return dot(turn, state.amplitude), dot(turn, state.rate)

    def _split(self, values: Array, like: Blocks) -> Blocks:
        return (values,) if jnp.ndim(like[0]) else blocks(values)

    def coupling(self, rate: Blocks) -> Blocks:
        """-kappa a_j (theta' - a_j xi_j') / m_0 [m/s^2]: the modal forces by the shaft's damping
        and the rates [m/s] of the other modes."""
        turn, own = (self._split(part, rate) for part in (self.turn, self.damping))
        turning = self.excess * dot(turn, rate)
        return tuple(d * v - a * turning for a, d, v in zip(turn, own, rate, strict=True))

    def coupled(self, maps: tuple[Propagator, ...], state: Vibration) -> Vibration:
        """A step's end with the `coupling` there, of the `state` that comes without it:

            xi_j' + V_j kappa a_j (theta' - a_j xi_j') / m_0 = xi_j0',

        V the maps' `v_end`. With E_j = 1 - V_j kappa a_j^2 / m_0, which is above 0 as V_j times the
        whole damping of a mode is below 1,

            theta' (1 + sum kappa V_j a_j^2 / (m_0 E_j)) = sum a_j xi_j0' / E_j.
        """
        turn, own = (self._split(part, state.rate) for part in (self.turn, self.damping))
        left = [1 - m.v_end * d for m, d in zip(maps, own, strict=True)]
        gain = [m.v_end * a / e for m, a, e in zip(maps, turn, left, strict=True)]
        slowed = [v / e for v, e in zip(state.rate, left, strict=True)]
        turning = self.excess * dot(turn, slowed) / (1 + self.excess * dot(turn, gain))
        rate = tuple(v - turning * g for v, g in zip(slowed, gain, strict=True))
        moved = zip(state.amplitude, maps, self.coupling(rate), strict=True)
        return Vibration(tuple(q + m.q_end * f for q, m, f in moved), rate)


def _sprung(stiffness: Array, link: ClampedLink) -> tuple[Array, Array, Array]:
    """`turn`, `clamped` and eigenvalues of the modes with a spring in the hinge, slowest first."""
    # A = K^-1/2 M K^-1/2, whose eigenvalues are 1 / Omega^2: for a stiff shaft the large ones,
    # of the slow modes, are those of the clamped fence to round-off.
    precision = link.eigenvalues.dtype
    root_mass = jnp.sqrt(link.mass_scale)
    turn_scale = 1 / jnp.sqrt(stiffness)
    scale = 1 / jnp.sqrt(link.eigenvalues)
    mixed = root_mass * turn_scale * link.swing * scale
    matrix = jnp.block([
        [(link.inertia / stiffness)[None, None], mixed[None]],
        [mixed[:, None], jnp.diag(scale**2)],
    ])  # fmt: skip
    # In the widest precision that there is, as all eigen-solves here.
    values, vectors = jnp.linalg.eigh(matrix.astype(float))
    values, vectors = values[::-1].astype(precision), vectors[:, ::-1].astype(precision)
    # Mass-normalised by m_0.
    frequency = 1 / jnp.sqrt(values)
    turn = root_mass * turn_scale * vectors[0] * frequency
    return turn, scale[:, None] * vectors[1:] * frequency[None], frequency**2


def _free(stiffness: Array, link: ClampedLink) -> tuple[Array, Array, Array]:
    """The same for a hinge that is free, or nearly so: by L^-1 M L^-T with L L^T = K + s M, whose
    eigenvalues are 1 / (Omega^2 + s). With s = omega_1^2 no Omega is lost beside another."""
    precision = link.eigenvalues.dtype
    modes = link.eigenvalues.size
    # In units of m_0, and of theta sqrt(J / m_0): a mass matrix of ones on the diagonal.
    scale = jnp.sqrt(link.mass_scale / link.inertia)
    mixed, spring = scale * link.swing, stiffness / link.inertia
    mass = jnp.block([[jnp.ones((1, 1), precision), mixed[None]],
                      [mixed[:, None], jnp.eye(modes, dtype=precision)]])  # fmt: skip
    squares = jnp.concatenate([spring[None], link.eigenvalues])
    mass, squares = mass.astype(float), squares.astype(float)
    shift = squares[1] if modes else squares[0] + 1
    lower = jnp.linalg.cholesky(jnp.diag(squares) + shift * mass)
    half = jax.scipy.linalg.solve_triangular(lower, mass, lower=True)
    matrix = jax.scipy.linalg.solve_triangular(lower, half.T, lower=True)
    values, vectors = jnp.linalg.eigh(0.5 * (matrix + matrix.T))
    shapes = jax.scipy.linalg.solve_triangular(lower.T, vectors[:, ::-1], lower=False)
    shapes = shapes / jnp.sqrt(values[::-1])[None]
    # Rayleigh's quotients are at least 0, and exact where the hinge is free.
    eigenvalues = jnp.sum(squares[:, None] * shapes**2, axis=0)
    shapes, eigenvalues = shapes.astype(precision), eigenvalues.astype(precision)
    return scale * shapes[0], shapes[1:], eigenvalues
