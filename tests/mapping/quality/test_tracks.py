"""Tracks are cut into lines where a hydrographer would, and crosslines are those that cross the others."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from app.mapping.quality.clock_sessions import set_back_s
from app.mapping.quality.crossovers import crossings
from app.mapping.quality.tracks import Lines, Tracks, crosslines, cut, dominant_rad
from tests.support.mapping.tracks import flown, lawnmower


def lines_of(*corners_m: tuple[float, float], spacing_m: float = 1.0) -> Lines:
    return cut(Tracks.of({"a": flown(corners_m, spacing_m=spacing_m)}))


def test_a_line_ends_at_a_turn() -> None:
    lines = lines_of((0, 0), (0, 50), (10, 50), (10, 0))
    assert lines.length_m == pytest.approx([50.0, 10.0, 50.0])
    assert np.degrees(lines.heading_rad) == pytest.approx([0.0, 90.0, 180.0])
    assert lines.number.tolist() == [1, 2, 3]
    assert lines.start_s.tolist() == [0.0, 50.0, 60.0]
    assert lines.end_s.tolist() == [50.0, 60.0, 110.0]


def test_a_slow_turn_ends_a_line_too() -> None:
    angle = np.radians(np.arange(0.0, 181.0, 2.0))
    arc = [(40.0 - 40.0 * np.cos(a), 40.0 * np.sin(a)) for a in angle.tolist()]
    lines = lines_of((0, -100), *arc, (80, -100))
    assert lines.length_m[[0, -1]] == pytest.approx([100.0, 100.0], abs=25.0)
    assert 4 <= len(lines) <= 9


def test_scatter_of_positions_is_no_turn() -> None:
    table = flown([(0, 0), (300, 0)])
    table[:, 1:3] += np.random.default_rng(3).normal(0.0, 0.5, (len(table), 2))
    assert len(cut(Tracks.of({"a": table}))) == 1


def test_a_line_ends_at_a_gap_and_nothing_crosses_there() -> None:
    table = flown([(0, 0), (200, 0)])
    gone = (table[:, 1] > 80) & (table[:, 1] < 120)
    tracks = Tracks.of({"a": table[~gone], "b": flown([(100, -30), (100, 30)], start_s=1e4)})
    lines = cut(tracks)
    assert lines.length_m == pytest.approx([80.0, 80.0, 60.0])
    assert len(crossings(tracks, lines)) == 0


def test_soundings_that_are_usually_far_apart_are_no_gaps() -> None:
    assert len(lines_of((0, 0), (1000, 0), spacing_m=50.0)) == 1


def test_beams_of_the_same_moment_are_one_sounding_in_their_middle() -> None:
    table = flown([(0, 0), (20, 0)])
    beams = np.concatenate([table + np.array([0, 0, side, side, 0.1]) for side in (-2.0, 2.0)])
    tracks = Tracks.of({"a": beams})
    assert len(tracks) == len(table)
    assert np.allclose(tracks.north_m, 0.0)
    assert np.allclose(tracks.sd_m, 0.2 / np.sqrt(2))


def test_nothing_and_single_soundings_make_no_line() -> None:
    assert len(cut(Tracks.of({}))) == 0
    one = cut(Tracks.of({"a": flown([(0, 0), (5, 0)])[:1], "b": np.zeros((0, 5))}))
    assert len(one) == 0
    assert dominant_rad(one) == 0.0


@given(st.floats(0, 179.9), st.floats(0.2, 0.9))
def test_the_dominant_direction_is_that_of_most_of_the_way(direction_deg: float, share: float) -> None:
    heading = np.radians([direction_deg, direction_deg + 180.0, direction_deg + 90.0])
    length = np.array([100.0, 100.0, 200.0 * share])
    none, zeros = np.zeros(3, dtype=np.int64), np.zeros(3)
    lines = Lines(none, none.astype(bool), none, none, zeros, zeros, length, heading, none, none)
    off = abs(np.degrees(dominant_rad(lines)) - direction_deg) % 180.0
    assert min(off, 180.0 - off) < 0.01


def test_crosslines_cross_main_lines_and_ways_between_lines_are_none() -> None:
    way = [*lawnmower(100, 200, 10), (110, 100), (-10, 100)]
    tracks = Tracks.of({"a": flown(way)})
    lines = cut(tracks)
    found = crosslines(lines, crossings(tracks, lines).line)
    assert lines.length_m[found] == pytest.approx([120.0], abs=1.5)


def test_a_survey_without_crosslines_has_none() -> None:
    tracks = Tracks.of({"a": flown(lawnmower(100, 200, 10)), "b": flown([(5, 0), (5, 200)])})
    lines = cut(tracks)
    assert not crosslines(lines, crossings(tracks, lines).line).any()


CORNERS = lawnmower(100, 200, 10)


@given(
    st.floats(30.0, 1500.0),
    st.lists(st.integers(50, 2000), min_size=1, max_size=3, unique=True),
    st.floats(0.3, 2.0),
)
@example(679.0, [1153], 1.0)
@example(700.0, [691, 728, 1394], 1.0)
def test_a_clock_that_is_set_back_changes_no_line(back_s: float, at: list[int], spacing_m: float) -> None:
    table = flown(CORNERS, spacing_m=spacing_m)
    cuts = sorted(k for k in at if k < len(table) - 50)
    clean = np.split(table, cuts)
    ends = cut(Tracks.of({str(k): part for k, part in enumerate(clean)}))
    for k, row in enumerate(cuts):
        table[row:, 0] -= back_s + 0.25 * k
    lines = cut(Tracks.of({"a": table}))
    assert lines.length_m == pytest.approx(ends.length_m)


@given(st.integers(0, 10**6), st.integers(2, 400))
def test_soundings_that_arrive_late_are_put_where_they_belong(seed: int, batch: int) -> None:
    table = flown(CORNERS)
    random = np.random.default_rng(seed)
    late = random.random(len(table) // batch + 1)[np.arange(len(table)) // batch] < 0.3
    shuffled = np.concatenate([table[~late], table[late]])
    on_time, mixed = cut(Tracks.of({"a": table})), cut(Tracks.of({"a": shuffled}))
    assert mixed.length_m == pytest.approx(on_time.length_m)
    assert mixed.start_s.tolist() == on_time.start_s.tolist()


def test_nothing_is_joined_that_a_vehicle_could_not_have_flown() -> None:
    table = flown([(0, 0), (3000, 0)], spacing_m=30.0)
    table[50:, 2] += 90.0
    table[:, 0] *= 0.2
    lines = cut(Tracks.of({"a": table}))
    assert lines.length_m == pytest.approx([49 * 30.0, 50 * 30.0])
    far = cut(Tracks.of({"a": flown([(0, 0), (3000, 0)], spacing_m=150.0)}))
    assert len(far) == 0


def test_by_how_much_a_clock_was_set_back_is_told() -> None:
    table = flown(CORNERS)
    assert set_back_s(*table[:, :3].T) == 0.0
    table[1153:, 0] -= 679.0
    assert set_back_s(*table[:, :3].T) == 678.0
    assert set_back_s(*np.concatenate([table[100:300], table[:100], table[300:500]])[:, :3].T) == 0.0
