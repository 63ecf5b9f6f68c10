"""The interface of a contact law, and the peak force at a rigid wall by any law."""

import abc
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ...printing import Part

# Steps of the classical Runge-Kutta method over the time in which the parcel would cross its
# largest penetration at the speed of approach, and how many such times are covered. Without damping
# the force is largest after 1.0 to 1.6 of them, with damping earlier.
_STEPS, _TIMES = 200, 2


class NormalForce(NamedTuple):
    """Normal force [N] and its derivatives in the gap [N/m] and in the gap's rate [N s/m].

    >>> law, gap = fj.contact_laws.Kelvin(), jnp.array(0.02)
    >>> found = law.force(gap, 0.0 * gap, law.viscosity(15.0))
    >>> f"{found.force:.1f} N, {found.by_gap:.0f} N/m"
    '275.2 N, 55040 N/m'
    """

    force: Array
    by_gap: Array
    by_rate: Array


class AbstractContactLaw(Part):
    """The normal force N(D, Ddot) [N] between a corner of the parcel and the body it touches.

    D [m] is the gap, positive in contact, and Ddot [m/s] its rate. A law is a property of the
    parcel, as the taper is one of the fence: a function of two numbers that does not depend on a
    scene. The model evaluates it at every instant.

    A law gives N >= 0, N = 0 for D <= 0, and N continuous in D. Where N is also continuously
    differentiable at D = 0 the integrator keeps its order through the onset of a contact, and
    derivatives of a result are those of the equations. All its numbers are array fields, checked
    against the `bounds` of the class by `fencejax._check.fields`.

    >>> law = fj.contact_laws.Kelvin(stiffness=1.2e9)
    >>> f"{law.stored_energy(0.02):.3f} J, {law.wall_force(2.0, mass=15.0):.0f} N"
    '0.768 J, 2166 N'
    """

    @abc.abstractmethod
    def viscosity(self, mass: Array) -> Array:
        """The coefficient of the viscous part for a parcel of `mass` [kg], in the law's own unit.

        It is computed once a scene and passed to `force`: a law may depend on the mass, and a power
        of it need not be computed at every step.
        """

    @abc.abstractmethod
    def force(self, gap: Array, gap_rate: Array, viscosity: Array) -> NormalForce:
        """N at the gap D [m] and its rate [m/s], and its two slopes.

        The slopes come with the force because Newton's method needs them at every iteration.
        Derivatives of a result do not use them: they are those of the force itself, which must not
        be NaN at D = 0 and below.
        """

    @abc.abstractmethod
    def stored_energy(self, gap: Array) -> Array:
        """Energy [J] stored in the elastic part, the integral of N over D at Ddot = 0."""

    def wall_force(self, speed: ArrayLike, mass: ArrayLike) -> Array:
        """N_stiff [N], the peak force of a `mass` [kg] that meets an undeformable wall with a
        corner at `speed` [m/s], above 0: the largest N of m D'' = -N(D, D'), D(0) = 0,
        D'(0) = `speed`.

        By the classical Runge-Kutta method, the peak refined by a parabola through three samples. A
        law whose peak is known in closed form, or as a table, overrides this.
        """
        speed, mass = jnp.broadcast_arrays(jnp.asarray(speed), jnp.asarray(mass))
        step = jax.lax.stop_gradient(self._crossing_time(speed, mass)) / _STEPS
        viscosity = self.viscosity(mass)

        def slope(gap, rate):
            return rate, -self.force(gap, rate, viscosity).force / mass

        def advance(state, _):
            gap, rate = state
            slopes = [slope(gap, rate)]
            for share in (0.5, 0.5, 1.0):
                moved, slowed = slopes[-1]
                slopes.append(slope(gap + share * step * moved, rate + share * step * slowed))
            gap, rate = (
                q + step / 6 * (a + 2 * b + 2 * c + d)
                for q, a, b, c, d in zip(state, *slopes, strict=True)
            )
            return (gap, rate), self.force(gap, rate, viscosity).force

        begin = (jnp.zeros_like(speed * mass), speed + 0 * mass)
        _, forces = jax.lax.scan(advance, begin, length=_TIMES * _STEPS)
        place = jnp.clip(jnp.argmax(forces, axis=0), 1, len(forces) - 2)
        before, peak, after = (
            jnp.take_along_axis(forces, (place + k)[None], axis=0)[0] for k in (-1, 0, 1)
        )
        difference = before - 2 * peak + after
        curved = difference < 0
        rise = jnp.where(curved, (after - before) ** 2 / jnp.where(curved, difference, -1.0), 0.0)
        return peak - rise / 8

    def _crossing_time(self, speed: Array, mass: Array) -> Array:
        """D_m / v [s], D_m the largest penetration without damping: energy(D_m) = m v^2 / 2, by
        Newton's method in the logarithms, where a power law is a straight line."""
        wanted = jnp.log(0.5 * mass * speed**2)
        none = jnp.zeros_like(wanted)

        def closer(_, depth):
            energy = self.stored_energy(jnp.exp(depth))
            force = self.force(jnp.exp(depth), none, none).force
            return depth - (jnp.log(energy) - wanted) * energy / (force * jnp.exp(depth))

        return jnp.exp(jax.lax.fori_loop(0, 30, closer, none - 4.0)) / speed
