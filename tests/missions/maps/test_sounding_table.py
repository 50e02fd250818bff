"""Soundings in memory."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.types import Soundings
from app.missions.maps.sounding_table import SoundingTable


@given(st.lists(st.integers(0, 40), max_size=12), st.integers(0, 50))
def test_rows_are_those_that_came_in_their_order(sizes: list[int], room: int) -> None:
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=(size, 4)) for size in sizes]
    table = SoundingTable(room)
    for part in parts:
        table.extend(part)
    expected = np.concatenate([np.zeros((0, 4)), *parts])
    np.testing.assert_array_equal(table.rows, expected)
    assert len(table) == len(expected)


def test_rows_that_were_read_stay_as_they_were_while_more_come() -> None:
    table = SoundingTable()
    table.extend(np.ones((3, 4)))
    before = table.rows
    for number in range(2000):
        table.extend(np.full((1, 4), float(number)))
    np.testing.assert_array_equal(before, np.ones((3, 4)))


def test_rows_given_are_never_written_to() -> None:
    given_rows = np.arange(8.0).reshape(2, 4)
    table = SoundingTable.of(given_rows)
    table.extend(np.zeros((5, 4)))
    np.testing.assert_array_equal(given_rows, np.arange(8.0).reshape(2, 4))
    np.testing.assert_array_equal(table.rows[:2], given_rows)


def test_a_map_uses_the_columns_where_they_lie() -> None:
    table = SoundingTable(100)
    table.extend(np.random.default_rng(0).normal(size=(60, 4)))
    soundings = Soundings.of_rows(table.rows)
    assert all(np.shares_memory(column, table.rows) for column in (soundings.east_m, soundings.sd_m))
