"""Adjustments of tracks as they are stored and applied."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.missions.soundings.adjustment import TrackAdjustment

NODES = np.array([[100.0, 0.0, 0.0], [120.0, 2.0, -1.0], [120.0, 0.0, 0.0], [140.0, 1.0, 1.0]])
"""A dive that ends at 120 s, where another one begins."""


@given(st.lists(st.tuples(st.floats(0, 1e10), st.floats(-50, 50), st.floats(-50, 50)), max_size=20))
def test_what_is_stored_comes_back(rows: list[tuple[float, float, float]]) -> None:
    adjustment = TrackAdjustment({"rover": np.array(rows, dtype=float).reshape(-1, 3)}, {"applied": True})
    again = TrackAdjustment.unpack(adjustment.pack())
    np.testing.assert_array_equal(again.nodes["rover"], adjustment.nodes["rover"])
    assert again.found == adjustment.found


def test_offsets_are_linear_within_a_dive_and_nothing_beyond() -> None:
    adjustment = TrackAdjustment({"rover": NODES})
    found = adjustment.offsets("rover", np.array([99.0, 110.0, 130.0, 141.0]))
    np.testing.assert_allclose(found, [[0.0, 0.0], [1.0, -0.5], [0.5, 0.5], [0.0, 0.0]])
    assert not adjustment.offsets("scout", np.array([110.0])).any()
