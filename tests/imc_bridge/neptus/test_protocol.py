"""What Neptus' ConvCAO panel writes is read as it was meant, and nothing else is."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from imcpy.coordinates import WGS84

from imc_bridge.neptus import Area, CellPosition, Conventions
from imc_bridge.neptus.protocol import NeptusDataError, read_map, read_session, read_step, write_actions
from imc_bridge.neptus.values import StepData

AREA = Area(41.1855, -8.7045, rows=120, cols=80, cell_m=1.5, max_depth_m=50.0)
SESSION = "Neptus_User_4711"
inside = st.tuples(st.floats(1, 118), st.floats(1, 78))


def as_the_panel_writes(
    depths: list[float], bottoms: list[float], places: list[tuple[float, float]], **changes: Any
) -> bytes:
    """A step as the panel makes it: heights cut to whole metres, the vehicle's depth subtracted twice."""
    heights = [AREA.max_depth_m - depth for depth in depths]
    altitudes = [bottom - depth for bottom, depth in zip(bottoms, depths, strict=True)]
    record = {
        "SessionID": SESSION,
        "timeStep": 3,
        "Bathymeter": [h - (d + a) for h, d, a in zip(heights, depths, altitudes, strict=True)],
        "Location": [
            [float(math.floor(row + 0.5)), float(math.floor(col + 0.5)), float(int(height))]
            for (row, col), height in zip(places, heights, strict=True)
        ],
        "MBSamples": [],
        "SampleLocations": [],
    }
    return json.dumps(record | changes).encode()


def step(content: bytes, vehicles: int = 2, **conventions: Any) -> StepData:
    return read_step(content, SESSION, vehicles, Conventions(AREA, **conventions))


@given(inside)
def test_cells_and_degrees_are_each_others_inverse(cell: Any) -> None:
    lat, lon = AREA.to_geographic(*cell)
    assert AREA.to_cells(lat, lon) == pytest.approx(cell, abs=1e-3)


def test_rows_count_north_and_columns_east_from_the_south_western_corner() -> None:
    centre = math.radians(AREA.centre_lat_deg), math.radians(AREA.centre_lon_deg)
    lat, lon = WGS84.displace(*centre, -60 * 1.5 + 10 * 1.5, -40 * 1.5 + 20 * 1.5)
    assert AREA.to_cells(math.degrees(lat), math.degrees(lon)) == pytest.approx((10, 20), abs=1e-3)
    south_west, south_east, north_east, _ = AREA.corners()
    assert south_west[0] < north_east[0]
    assert south_west[1] < south_east[1]


@given(st.lists(st.tuples(inside, st.floats(0, 20), st.floats(0.5, 20)), min_size=1, max_size=5))
def test_a_step_says_where_the_vehicles_are_and_how_deep_the_bottom(craft: Any) -> None:
    places = [place for place, _, _ in craft]
    depths = [depth for _, depth, _ in craft]
    bottoms = [depth + altitude for _, depth, altitude in craft]
    data = step(as_the_panel_writes(depths, bottoms, places), len(craft))
    assert (data.session, data.time_step) == (SESSION, 3)
    for place, (row, col), depth in zip(data.places, places, depths, strict=True):
        assert abs(place.row - row) <= 0.5 + 1e-9
        assert abs(place.col - col) <= 0.5 + 1e-9
        assert abs(place.depth_m - depth) <= 0.5 + 1e-9, "heights are cut to whole metres"
    for sounding in data.soundings:
        assert sounding.vehicle is not None
        error = sounding.bottom_depth_m - bottoms[sounding.vehicle]
        assert abs(error) <= 0.5 + 1e-9
        assert sounding.depth_sd_m is not None
        assert sounding.depth_sd_m > 0.3, "its uncertainty says so"


def test_a_corrected_panel_counts_the_depth_once() -> None:
    content = as_the_panel_writes([2.0, 4.0], [0.0, 0.0], [(10, 10), (20, 20)], Bathymeter=[38.0, 36.5])
    assert [s.bottom_depth_m for s in step(content, bathymeter="once").soundings] == [12.0, 13.5]
    assert step(content, bathymeter="off").soundings == ()


def test_beams_count_more_than_the_bathymeter_and_hold_plain_depths() -> None:
    content = as_the_panel_writes(
        [2.0, 4.0],
        [12.0, 13.0],
        [(10, 10), (20, 20)],
        MBSamples=[12.25, 12.5, 1.0, 12.0, 11.0],
        SampleLocations=[[10.5, 11.5, 2.0], [20.25, 19.0, 4.0], [12, 12, 2.0], [0, 12, 2.0], [119, 79, 2.0]],
    )
    data = step(content)
    assert [(s.row, s.col, s.vehicle_depth_m, s.bottom_depth_m) for s in data.soundings] == [
        (10.5, 11.5, 2.0, 12.25),
        (20.25, 19.0, 4.0, 12.5),
    ]
    assert data.refused == {
        "bottom not below the vehicle": 1,
        "on the border of the area, where the panel puts what lies outside": 2,
    }


def test_an_altitude_that_the_vehicle_does_not_know_is_no_sounding() -> None:
    content = as_the_panel_writes([3.0], [2.0], [(10, 10)])
    data = step(content, 1)
    assert data.soundings == ()
    assert data.refused == {"bottom not below the vehicle": 1}


def test_answers_are_one_line_with_heights_for_depths() -> None:
    places = [CellPosition(10.25, 20.5, 1.5), CellPosition(0, 80, 3.0)]
    line = write_actions(SESSION, 7, places, AREA, pairs=False)
    assert line.count(b"\n") == 1
    assert json.loads(line) == {
        "SessionID": SESSION,
        "timeStep": 7,
        "Location": [[10.25, 20.5, 48.5], [0, 80, 47.0]],
    }


def test_a_panel_of_2013_gets_whole_cells_because_it_can_read_nothing_else() -> None:
    record = {"SessionID": SESSION, "timeStep": 1, "Bathymeter": [17.5, 18.0], "Location": [[10, 11], [12, 13]]}
    data = step(json.dumps(record).encode())
    assert data.pairs
    assert data.soundings == (), "it sends what its own map says, which is no measurement"
    assert b"." not in write_actions(SESSION, 1, [CellPosition(10.4, 11.6, 2.0)], AREA, pairs=True)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"SessionID": "Neptus_User_1"}, "SessionID: 'Neptus_User_1' must be 'Neptus_User_4711'"),
        ({"timeStep": 0}, "timeStep: 0 must be a whole number"),
        ({"timeStep": 1.5}, "timeStep: 1.5"),
        ({"timeStep": True}, "timeStep: True"),
        ({"Location": [[10, 10, 48]]}, "Location: 1 entries: it must have one entry for each of 2"),
        ({"Location": [[10, 10, 48], [10, 10]]}, r"Location\[1\]: 2 values: it must be a list of 3"),
        ({"Location": [[10, 10, 48], [121, 10, 48]]}, r"Location\[1\]: row 121, column 10 lies outside"),
        ({"Location": [[10, 10, 48], [10, 10, 60]]}, r"Location\[1\]: height 60"),
        ({"Location": [[10, 10, 48], ["x", 10, 48]]}, r"Location\[1\]: 'x' must be a finite number"),
        ({"Location": "here"}, "Location: 'here'"),
        ({"Location": None}, "Location: None"),
        ({"Bathymeter": [1.0]}, "Bathymeter: 1 values"),
        ({"MBSamples": [1.0]}, "SampleLocations: 0 entries"),
        ({"MBSamples": {"a": 1}}, "MBSamples"),
        ({"MBSamples": [[1]], "SampleLocations": [[1, 2, 3]]}, "MBSamples"),
    ],
)
def test_a_step_that_cannot_be_is_refused_with_field_value_and_what_would_be_right(
    changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(NeptusDataError, match=words):
        step(as_the_panel_writes([2.0, 4.0], [12.0, 13.0], [(10, 10), (20, 20)], **changes))


@given(
    st.binary(max_size=400)
    | st.recursive(st.none() | st.floats() | st.text(), st.lists).map(json.dumps).map(str.encode)
)
def test_whatever_is_uploaded_is_read_or_refused_never_worse(content: bytes) -> None:
    for read in (lambda: step(content), lambda: read_session(content, SESSION), lambda: read_map(content)):
        try:
            read()
        except NeptusDataError:
            continue


def test_numbers_beyond_all_measure_are_refused() -> None:
    content = as_the_panel_writes([2.0, 4.0], [12.0, 13.0], [(10, 10), (20, 20)])
    for evil in (b"NaN", b"1e999", b"-Infinity"):
        with pytest.raises(NeptusDataError):
            step(content.replace(b"[10.0, 10.0,", b"[" + evil + b", 10.0,"))


@pytest.mark.parametrize("count", ["0", "21", "-1", "two", "", 1.5, True, None, "1e1"])
def test_a_session_needs_a_sensible_number_of_vehicles(count: int) -> None:
    with pytest.raises(NeptusDataError, match="AUVs"):
        read_session(json.dumps({"SessionID": SESSION, "AUVs": count}).encode(), SESSION)


def test_a_session_says_how_many_vehicles_it_has() -> None:
    record = {"DateTime": "21/11/2026 10:00:00", "SessionID": SESSION, "DemoMode": "1", "AUVs": "2"}
    assert read_session(json.dumps(record).encode(), SESSION) == 2


def test_a_sparse_map_gives_its_known_cells() -> None:
    assert read_map(b"2 3 0.5 0 0\n\n-1 -1 19.5 \n16 -1 -1 \n") == [(0, 2, 19.5), (1, 0, 16.0)]


@pytest.mark.parametrize(
    "content",
    [b"", b"two 3\n", b"2 3 0.5\n\n1 2 3\n", b"2 2\n1 2\n3 x\n", b"9999 9999\n", b"1 1\nnan\n", b"0 0\n", b"\xff\xfe"],
)
def test_a_sparse_map_that_is_none_is_refused(content: bytes) -> None:
    with pytest.raises(NeptusDataError):
        read_map(content)


def of(
    depths: list[float], bottoms: list[float], places: list[tuple[float, float]], samples: list[list[float]]
) -> bytes:
    """A step with samples of row, column, depth of the vehicle, depth."""
    return as_the_panel_writes(
        depths,
        bottoms,
        places,
        MBSamples=[sample[3] for sample in samples],
        SampleLocations=[sample[:3] for sample in samples],
    )


def test_a_sample_that_disagrees_with_the_nearest_bathymeter_is_refused_with_both_figures() -> None:
    content = of(
        [2.0, 4.0], [12.0, 20.0], [(20, 20), (80, 20)], [[21, 20, 2.0, 29.7], [21, 20, 2.0, 12.1], [79, 20, 4.0, 19.9]]
    )
    data = step(content)
    assert [(s.vehicle, s.bottom_depth_m) for s in data.soundings] == [(0, 12.1), (1, 19.9)]
    assert data.refused == {"other than the Bathymeter of the nearest vehicle (29.7 m, where it has 12.0 m)": 1}


def test_a_sample_far_from_every_bathymeter_cannot_be_judged() -> None:
    content = of([2.0], [12.0], [(20, 20)], [[100, 60, 2.0, 12.0], [20, 21, 2.0, 12.0]])
    data = step(content, 1)
    assert len(data.soundings) == 1
    assert data.refused == {"more than 60 m from where a vehicle knows the bottom": 1}


def test_far_from_the_vehicle_a_range_ahead_passes_for_no_depth() -> None:
    content = of([2.0], [12.0], [(20, 20)], [[20, 56, 2.0, 20.0], [20, 56, 2.0, 17.0], [20, 20, 2.0, 12.0]])
    assert [s.bottom_depth_m for s in step(content, 1).soundings] == [17.0, 12.0]


def test_a_slope_is_allowed_for_where_a_sample_is_away_from_the_vehicle() -> None:
    content = of([2.0], [12.0], [(20, 20)], [[20, 40, 2.0, 17.0], [20, 22, 2.0, 17.0]])
    assert [s.col for s in step(content, 1).soundings] == [40]


def test_the_bottom_where_the_vehicles_came_from_counts_too() -> None:
    before = step(of([2.0], [19.0], [(20, 50)], []), 1)
    steep = of([2.0], [12.0], [(20, 40)], [[20, 50, 2.0, 19.2], [20, 40, 2.0, 12.0]])
    assert len(read_step(steep, SESSION, 1, Conventions(AREA)).soundings) == 1
    assert len(read_step(steep, SESSION, 1, Conventions(AREA), before).soundings) == 2


def test_a_vehicle_without_a_sample_that_counts_has_its_bathymeter() -> None:
    data = step(of([2.0, 4.0], [12.0, 13.0], [(20, 20), (80, 20)], [[80, 21, 4.0, 13.1]]))
    assert [(s.vehicle, s.source) for s in data.soundings] == [(1, "neptus DVL"), (0, "neptus bathymeter")]


def test_samples_can_be_left_out_and_then_the_bathymeter_counts() -> None:
    data = step(of([2.0], [12.0], [(20, 20)], [[20, 21, 2.0, 12.0]]), 1, samples="off")
    assert [s.source for s in data.soundings] == ["neptus bathymeter"]


def test_samples_belong_to_the_vehicle_that_was_there_also_where_both_are_at_the_surface() -> None:
    track = [[10 + k, 20.0, 0.0, 12.0] for k in range(10)]
    other = [[60.0, 20 + k, 0.0, 12.0] for k in range(10)]
    mixed = [sample for pair in zip(track, other, strict=True) for sample in pair]
    data = step(of([0.0, 0.0], [12.0, 12.0], [(19, 20), (60, 29)], mixed))
    assert [s.vehicle for s in data.soundings] == [0, 1] * 10


def test_samples_belong_to_the_layer_in_which_they_were_taken() -> None:
    mixed = [[20 + k % 2, 20.0, depth, 12.0] for k in range(6) for depth in (1.52, 3.04)]
    data = step(of([1.5, 3.0], [12.0, 12.0], [(20, 20), (21, 20)], mixed))
    assert [s.vehicle for s in data.soundings] == [0, 1] * 6


def test_the_newest_sample_says_how_deep_a_vehicle_is() -> None:
    data = step(of([2.2], [12.0], [(20, 20)], [[20, 20, 2.2, 12.0]]), 1)
    assert data.places[0].depth_m == 2.2
    assert data.bottoms[0] is not None
    assert data.bottoms[0].depth_m == pytest.approx(12.0), "not half a metre off"


@pytest.mark.slow
def test_of_more_samples_than_are_taken_the_oldest_are_left_out() -> None:
    samples = [[20, 20, 2.0, 12.0]] * 50_000 + [[20, 21, 2.0, 12.0]]
    data = step(of([2.0], [12.0], [(20, 20)], samples), 1)
    assert len(data.soundings) == 50_000
    assert data.soundings[-1].col == 21
    assert data.refused == {"beyond the newest 50000": 1}
