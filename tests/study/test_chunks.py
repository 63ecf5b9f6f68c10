"""Many lanes through one program, a chunk at a time."""

import numpy as np
import pytest

from fencejax.study import in_chunks


@pytest.mark.parametrize(("lanes", "workers"), [(7, 1), (7, 3), (6, 2), (2, 2)])
def test_every_lane_comes_back_once_in_its_place(lanes, workers):
    sizes, reported = [], []

    def program(given):
        sizes.append(given["a"].shape)
        return given["a"] * 2.0, {"sum": given["a"] + given["b"].sum(axis=1)}

    given = {"a": np.arange(float(lanes)), "b": np.ones((lanes, 2))}
    doubled, rest = in_chunks(
        program, given, 3, workers=workers, progress=lambda *counts: reported.append(counts)
    )
    np.testing.assert_array_equal(doubled, 2 * given["a"])
    np.testing.assert_array_equal(rest["sum"], given["a"] + 2)
    # One shape, so one program; progress ends at the whole.
    chunks = -(-lanes // 3)
    assert sizes == [(3,)] * chunks
    assert reported == [(min(3 * (k + 1), lanes), lanes) for k in range(chunks)]
