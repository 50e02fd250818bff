"""Holidays by their definition, against a search of every window."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.mapping.swath.holidays import LET_BE, holidays, missed, open_ground, side_of
from app.mapping.types import Grid

CELLS = arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9)))


def windows(empty: np.ndarray, height: int, width: int) -> np.ndarray:
    """Mark every window of empty cells, one after the other."""
    found = np.zeros_like(empty)
    for i in range(empty.shape[0] - height + 1):
        for j in range(empty.shape[1] - width + 1):
            if empty[i : i + height, j : j + width].all():
                found[i : i + height, j : j + width] = True
    return found


@given(CELLS, st.integers(1, 4))
def test_a_holiday_is_made_of_empty_squares(ensonified: np.ndarray, side: int) -> None:
    area = np.ones_like(ensonified)
    assert np.array_equal(missed(ensonified, area, side), windows(~ensonified, side, side))
    in_a_row = windows(~ensonified, 1, side) | windows(~ensonified, side, 1)
    assert np.array_equal(missed(ensonified, area, side, in_a_row=True), in_a_row)


@given(CELLS, st.data())
def test_nothing_outside_of_the_area_is_missed(ensonified: np.ndarray, data: st.DataObject) -> None:
    area = data.draw(arrays(np.bool_, ensonified.shape))
    assert not missed(ensonified, area, 1)[~area].any()
    assert not open_ground(ensonified, area, 3)[~area | ensonified].any()


def test_pieces_are_told_with_place_and_size() -> None:
    ensonified = np.ones((20, 30), dtype=bool)
    ensonified[2:5, 4:10] = False
    ensonified[12:15, 20:23] = False
    ensonified[8, 8] = False
    grid = Grid(100.0, 200.0, 0.5, 20, 30)
    first, second = holidays(ensonified, np.ones_like(ensonified), grid, 3)
    assert (first.area_m2, second.area_m2) == (18 * 0.25, 9 * 0.25)
    assert (first.west_m, first.south_m, first.width_m, first.height_m) == (102.0, 201.0, 3.0, 1.5)
    assert (second.east_m, second.north_m) == (100.0 + 21.5 * 0.5, 200.0 + 13.5 * 0.5)


def test_strips_along_the_border_are_still_open() -> None:
    ensonified = np.ones((20, 20), dtype=bool)
    ensonified[:, :2] = False
    ensonified[:, 19] = False
    area = np.ones_like(ensonified)
    assert not missed(ensonified, area, 3).any()
    left = open_ground(ensonified, area, 3)
    assert left[:, :2].all(), "two cells wide"
    assert left[:, 19].all(), "one cell wide, and a twentieth of the area"
    ensonified, area = (np.pad(cells, ((0, 0), (0, 400)), constant_values=True) for cells in (ensonified, area))
    area[:, 20:] = True
    assert not open_ground(ensonified, area, 3)[:, 2:].any(), "one cell is not worth a line in a large area"


@given(arrays(np.bool_, (12, 40)), st.integers(1, 4))
def test_what_is_let_be_is_a_small_part_of_the_area_and_made_of_small_pieces(ensonified: np.ndarray, side: int) -> None:
    area = np.ones_like(ensonified)
    left = open_ground(ensonified, area, side)
    let_be = ~ensonified & ~left
    assert let_be.sum() <= LET_BE * area.sum()
    assert not missed(ensonified | left, area, side).any()


def test_the_side_follows_the_coarsest_resolution() -> None:
    assert side_of(1.0, 1.0) == 3
    assert side_of(1.0, 0.4) == 7
    assert side_of(0.1, 1.0) == 1
