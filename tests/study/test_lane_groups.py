"""Lanes in groups, in the order of their contact times."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.study import contact_length, in_groups


def impact(mass=15.0, distance=1.0, **fence):
    parcel = fj.Parcel(mass=mass)
    return fj.scenes.oblique_impact(fence=fj.Fence(**fence), distance=distance, parcel=parcel)


def test_length_is_half_a_period_of_the_mass_on_the_fence():
    # pi sqrt(m c), c = x^3 / (3 E I): with the mass to the power 1/2, with the arm to 3/2, with the
    # thickness to -3/2, with the modulus to -1/2.
    length = float(contact_length(impact()))
    assert float(contact_length(impact(mass=60.0))) == pytest.approx(2 * length)
    nearer = 0.45 + (1.0 - 0.45) / 4
    assert float(contact_length(impact(distance=nearer))) == pytest.approx(length / 8)
    assert float(contact_length(impact(thickness=4 * 0.045))) == pytest.approx(length / 8)
    # On the rigid link there is the contact alone.
    assert float(contact_length(impact(distance=0.4))) == 0.0


def test_no_length_where_the_place_is_not_among_the_numbers():
    assert contact_length(fj.scenes.whole_sort()) is None
    assert contact_length(fj.scenes.rigid_wall()) is None


def groups_of(count, scene):
    """What each lane's group holds, by a function that gives every lane the masses of its group."""
    masses = jnp.asarray(np.random.default_rng(0).permutation(16) + 1.0)

    def together(lanes):
        return jnp.broadcast_to(jnp.sort(lanes), (lanes.size, lanes.size)), 2 * lanes

    run = jax.jit(lambda m, n: in_groups(together, m, 4, n, scene))
    found, doubled = run(masses, np.int32(count))
    return np.asarray(masses), np.asarray(found), np.asarray(doubled)


def test_neighbours_in_length_share_a_group_and_lanes_keep_their_places():
    masses, found, doubled = groups_of(16, lambda mass: impact(mass))
    np.testing.assert_array_equal(doubled, 2 * masses)
    for mass, group in zip(masses, found, strict=True):
        first = 4 * np.floor((mass - 1) / 4) + 1
        np.testing.assert_array_equal(group, first + np.arange(4))


def test_lanes_that_fill_up_come_last_and_groups_of_them_alone_are_not_computed():
    masses, _, doubled = groups_of(6, lambda mass: impact(mass))
    np.testing.assert_array_equal(doubled[:6], 2 * masses[:6])
    # Six lanes are two groups of four: the last two groups are left as they were.
    assert np.sum(doubled == 0) == 8


def test_without_a_length_the_order_stays():
    masses, found, _ = groups_of(16, lambda mass: fj.scenes.whole_sort(parcel=fj.Parcel(mass=mass)))
    np.testing.assert_array_equal(found[:4], np.tile(np.sort(masses[:4]), (4, 1)))


def peaks(scenes):
    fidelity = fj.Fidelity.coarse(modes=1, elements=4)
    found = fj.simulate_many(scenes, fidelity=fidelity, only="peak_force", refine=False)
    return found.peak_force


def test_a_lane_does_not_depend_on_the_others_of_its_batch():
    # More than go one after another.
    speeds = jnp.linspace(0.5, 3.0, 24)

    def forces(speeds):
        scenes = jax.vmap(lambda v: fj.scenes.normal_impact(speed=v, duration=0.03))(speeds)
        return peaks(scenes)

    # The same program for both; hard blows beside a lane take other iterations than soft ones.
    slow = forces(speeds)
    hard = forces(speeds.at[12:].multiply(3.0))
    np.testing.assert_array_equal(slow[:12], hard[:12])


def test_many_lanes_go_in_groups_and_are_as_few_are():
    masses = jnp.linspace(5.0, 20.0, 70)

    def forces(masses):
        scenes = jax.vmap(
            lambda m: fj.scenes.normal_impact(
                fence=fj.Fence(), parcel=fj.Parcel(mass=m), duration=0.03
            )
        )(masses)
        return peaks(scenes)

    # Programs compiled apart differ by rounding alone.
    np.testing.assert_allclose(forces(masses)[:8], forces(masses[:8]), rtol=1e-11)
