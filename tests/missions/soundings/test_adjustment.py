"""Adjustments of tracks as they are stored and applied, and fixes that show as jumps at the surface."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.missions.operations.corrections.adjustment import jumps
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


def test_a_jump_at_the_surface_is_a_fix_and_a_way_is_none() -> None:
    time_s = np.arange(0.0, 60.0, 5.0)
    east = 1.5 * time_s
    depth = np.where(time_s >= 30.0, 0.1, 5.0)
    track = np.column_stack([time_s, east, 0.0 * east, depth])
    assert jumps(track) == []
    track[time_s >= 40.0, 2] -= 40.0
    ((at_s, off_east, off_north),) = jumps(track)
    assert at_s == 35.0
    np.testing.assert_allclose((off_east, off_north), (0.0, 40.0), atol=1e-9)
    track[:, 3] = 5.0
    assert jumps(track) == []  # under water it is no fix
