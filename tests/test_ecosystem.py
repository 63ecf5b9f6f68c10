"""Scenes, results and compiled simulations with the usual tools of JAX to save, send and distribute
them."""

import io
import json
import os
import subprocess
import sys
import textwrap

import cloudpickle
import equinox as eqx
import jax
import jax.export
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj


def peak(speed):
    scene = fj.scenes.rigid_wall(speed=speed, duration=0.03)
    return fj.simulate(scene, fidelity=fj.Fidelity.fast(), only=("peak_force",)).peak_force


@pytest.fixture(scope="module")
def compiled():
    """Value and derivative, the one program of this file, as it is exported."""
    return jax.export.export(jax.jit(jax.value_and_grad(peak)))(jnp.ones(()))


def test_an_exported_simulation_is_the_same(compiled):
    again = jax.export.deserialize(compiled.serialize())
    value, slope = again.call(jnp.asarray(1.3))
    expected, other = jax.value_and_grad(peak)(1.3)
    # What a scene works out of its numbers is traced in one and done on the host in the other: last
    # digits differ, and a derivative's by as many more as it has steps behind it.
    np.testing.assert_allclose([value, slope], [expected, other], rtol=1e-12)


@pytest.fixture(scope="module")
def kept():
    """A scene, and a result with every one of its fields."""
    scene = fj.scenes.rigid_wall(speed=1.3, duration=0.03)
    return scene, fj.simulate(scene, fidelity=fj.Fidelity.fast())


def _assert_same(found, expected):
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    jax.tree.map(np.testing.assert_array_equal, found, expected)


def test_scenes_and_results_are_pickled(kept):
    _assert_same(cloudpickle.loads(cloudpickle.dumps(kept)), kept)
    # With the function that made them, as Dask sends it.
    scene, result = kept
    fidelity = fj.Fidelity.fast()
    again = cloudpickle.loads(cloudpickle.dumps(lambda: fj.simulate(scene, fidelity=fidelity)))
    _assert_same(again(), result)


def test_scenes_and_results_are_written_as_leaves(kept):
    file = io.BytesIO()
    eqx.tree_serialise_leaves(file, kept)
    file.seek(0)
    like = jax.tree.map(jnp.zeros_like, kept)
    _assert_same(eqx.tree_deserialise_leaves(file, like), kept)


def test_two_devices(compiled):
    # The number of devices is set before JAX starts: in a process of its own.
    script = """
        import json, sys
        import jax, jax.numpy as jnp, numpy as np
        from jax.sharding import PartitionSpec
        import fencejax as fj
        jax.config.update("jax_enable_x64", True)

        @jax.vmap
        @jax.grad
        def slope(speed):
            scene = fj.scenes.rigid_wall(speed=speed, duration=0.03)
            return fj.simulate(scene, fidelity=fj.Fidelity.fast(), only="peak_force").peak_force

        speeds, expected = map(jnp.asarray, json.loads(sys.argv[1]))
        mesh, lanes = jax.sharding.Mesh(jax.devices(), ("lanes",)), PartitionSpec("lanes")
        sharded = jax.jit(
            jax.shard_map(slope, mesh=mesh, in_specs=lanes, out_specs=lanes, check_vma=False)
        )
        for found in (sharded(speeds), jax.pmap(slope)(speeds.reshape(2, 2)).reshape(4)):
            assert len(found.sharding.device_set) == 2
            # Rounding, over 150 steps.
            np.testing.assert_allclose(found, expected, rtol=1e-11)
    """
    speeds = np.linspace(0.5, 2.0, 4)
    slopes = [float(compiled.call(jnp.asarray(speed))[1]) for speed in speeds]
    flags = os.environ["XLA_FLAGS"] + " --xla_force_host_platform_device_count=2"
    subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script), json.dumps([speeds.tolist(), slopes])],
        env=os.environ | {"XLA_FLAGS": flags}, check=True,
    )  # fmt: skip
