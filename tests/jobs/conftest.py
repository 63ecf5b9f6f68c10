"""Fixtures for tests of jobs and notebooks."""

import matplotlib
import pytest


@pytest.fixture
def lenient():
    """A reader's session: JAX's default promotion, figures drawn off screen."""
    import jax

    strict = {
        name: getattr(jax.config, name)
        for name in ("jax_numpy_dtype_promotion", "jax_numpy_rank_promotion")
    }
    backend = matplotlib.get_backend()
    jax.config.update("jax_numpy_dtype_promotion", "standard")
    jax.config.update("jax_numpy_rank_promotion", "allow")
    matplotlib.use("Agg")
    yield
    for name, value in strict.items():
        jax.config.update(name, value)
    matplotlib.use(backend)
