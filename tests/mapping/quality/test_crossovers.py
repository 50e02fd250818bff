"""Crossings are those that comparing every two segments finds, and those that GMT finds."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import LineString, Point

from app.arrays import FloatArray
from app.mapping.quality import crossovers
from app.mapping.quality.crossovers import AWAY_M, Crossings, crossings
from app.mapping.quality.tracks import GAP_M, GAP_S, Tracks, cut
from tests.support.mapping.tracks import GMT, flown, gmt_crossings, lawnmower

REFERENCE = Path(__file__).parent / "gmt_crossings.json"


def found(tables: dict[str, FloatArray]) -> Crossings:
    tracks = Tracks.of(tables)
    return crossings(tracks, cut(tracks))


def stretches(tracks: Tracks) -> list[int]:
    """The way's stretches, each within ``AWAY_M`` of its begin."""
    numbers, begin = [0], 0
    for i in range(1, len(tracks)):
        other = tracks.vehicle[i] != tracks.vehicle[begin]
        away = np.hypot(tracks.east_m[i] - tracks.east_m[begin], tracks.north_m[i] - tracks.north_m[begin]) > AWAY_M
        numbers.append(numbers[-1] + (2 if other else 1 if away else 0))
        begin = i if other or away else begin
    return numbers


def one_by_one(tables: dict[str, FloatArray]) -> list[tuple[float, ...]]:
    """Place and difference of all crossings, by comparing every segment with every other one."""
    tracks = Tracks.of(tables)
    lines, stretch = cut(tracks), stretches(tracks)
    segments = np.flatnonzero(lines.joined).tolist()
    places = np.column_stack([tracks.east_m, tracks.north_m])
    result = []
    for k, i in enumerate(segments):
        for j in segments[k + 1 :]:
            one, other = LineString(places[i : i + 2]), LineString(places[j : j + 2])
            if stretch[j] - stretch[i] < 2 or not one.intersects(other):
                continue
            at = one.intersection(other)
            assert isinstance(at, Point)
            depths = [
                np.interp(line.project(at), [0.0, line.length], tracks.depth_m[s : s + 2])
                for s, line in ((i, one), (j, other))
            ]
            same = tracks.vehicle[i] == tracks.vehicle[j]
            difference = depths[1] - depths[0] if same else depths[0] - depths[1]
            result.append((at.x, at.y, float(difference)))
    return sorted(result)


@given(st.integers(0, 2**32 - 1), st.integers(2, 60), st.integers(2, 60))
def test_crossings_are_those_of_every_two_segments(seed: int, first: int, second: int) -> None:
    rng = np.random.default_rng(seed)
    tables = {}
    for name, count in (("a", first), ("b", second)):
        at = np.cumsum(rng.normal(0.0, 8.0, (count, 2)), axis=0)
        tables[name] = np.column_stack([np.arange(count), at, rng.uniform(5, 20, count), np.full(count, 0.1)])
    ours = found(tables)
    expected = one_by_one(tables)
    assert len(ours) == len(expected)
    rows = sorted(zip(ours.east_m.tolist(), ours.north_m.tolist(), ours.difference_m.tolist(), strict=True))
    assert np.allclose(np.array(rows).reshape(-1, 3), np.array(expected).reshape(-1, 3), atol=1e-6)


@pytest.mark.parametrize("piece", [1, 3, 1000])
def test_how_segments_are_grouped_changes_nothing(piece: int, monkeypatch: pytest.MonkeyPatch) -> None:
    tables = {"a": flown([*lawnmower(60, 60, 7.3), (55.1, 30.2), (-5.1, 29.9)])}
    expected = np.sort(found(tables).east_m)
    monkeypatch.setattr(crossovers, "PIECE", piece)
    assert np.allclose(np.sort(found(tables).east_m), expected)
    assert len(expected) > 5


def test_ways_that_share_a_sounding_cross_once() -> None:
    east, north = flown([(-10, 0), (10, 0)]), flown([(0, -10), (0, 10)], start_s=100.0)
    east[:, 3], north[:, 3] = 10.0 + 0.1 * east[:, 1], 11.0
    cross = found({"b": east, "a": north})
    assert len(cross) == 1
    assert (cross.east_m[0], cross.north_m[0]) == pytest.approx((0.0, 0.0))
    assert cross.difference_m == pytest.approx([1.0]), "the first by name minus the second"
    assert cross.time_s[0].tolist() == pytest.approx([110.0, 10.0])
    assert np.degrees(cross.angle_rad) == pytest.approx([90.0])
    assert cross.predicted_sd_m == pytest.approx([0.1 * np.sqrt(2)])


def test_of_one_vehicle_the_later_minus_the_earlier_is_told() -> None:
    table = flown([(0, 0), (50, 0), (50, 20), (25, 20), (25, -20)])
    table[:, 3] = 10.0 + 0.01 * table[:, 0]
    cross = found({"a": table})
    assert len(cross) == 1
    assert cross.time_s[0].tolist() == pytest.approx([115.0, 25.0])
    assert cross.difference_m == pytest.approx([0.9])


def test_a_loop_on_a_line_is_a_crossing_and_scatter_is_none() -> None:
    angle = np.radians(np.arange(0.0, 360.0, 15.0))
    loop = [(50.0 + 4.0 * np.sin(a), 4.0 - 4.0 * np.cos(a)) for a in angle.tolist()]
    table = flown([(0, 0.1), *loop, (100, -0.1)], spacing_m=0.7)
    assert len(found({"a": table})) == 1
    straight = flown([(0, 0), (500, 0)], spacing_m=0.5)
    straight[:, 1:3] += np.random.default_rng(3).normal(0.0, 0.08, (len(straight), 2))
    assert len(found({"a": straight})) == 0


def test_a_vehicle_that_stands_still_crosses_nothing() -> None:
    table = flown([(0, 0), (2000, 0)])
    table[:, 1:3] = np.random.default_rng(5).normal(0.0, 0.08, (len(table), 2))
    assert len(found({"a": table})) == 0


def test_no_more_are_looked_for_than_memory_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crossovers, "MOST", 20)
    tables = {"a": flown(lawnmower(100, 100, 5)), "b": flown([(y, x) for x, y in lawnmower(97, 97, 5.1)])}
    assert len(found(tables)) == 20


def gmt_tables() -> dict[str, FloatArray]:
    recorded = json.loads(REFERENCE.read_text())
    return {name: np.array(rows) for name, rows in recorded["tracks"].items()}


def agrees(ours: Crossings, gmt: FloatArray) -> None:
    assert len(ours) == len(gmt)
    rows = np.column_stack([ours.east_m, ours.north_m, ours.time_s, ours.difference_m])
    rows, gmt = rows[np.lexsort(rows[:, 1::-1].T.round(3))], gmt[np.lexsort(gmt[:, 1::-1].T.round(3))]
    assert np.allclose(rows, gmt, atol=1e-4)
    assert ours.difference_m.mean() == pytest.approx(gmt[:, 4].mean(), abs=1e-6)
    assert ours.difference_m.std() == pytest.approx(gmt[:, 4].std(), abs=1e-6)


def test_crossings_are_what_gmt_was_recorded_to_find() -> None:
    agrees(found(gmt_tables()), np.array(json.loads(REFERENCE.read_text())["crossings"]))


@pytest.mark.skipif(GMT is None, reason="GMT is not installed")
def test_crossings_are_what_gmt_finds(tmp_path: Path) -> None:
    tables = gmt_tables()
    agrees(found(tables), gmt_crossings(tables, tmp_path, gap_s=GAP_S, gap_m=GAP_M))
