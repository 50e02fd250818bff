import numpy as np
import pytest
from shapely.geometry import LineString, Point

from app.mapping.coordinates.distances import METRES_PER_DEGREE
from app.missions.live.trails import TOLERANCE_M, in_order, worth_drawing
from tests.support.missions.harbour import Harbour, Rover, act, sim_spec
from tests.support.missions.specs import lon_lat


def wandering(seed: int, count: int = 400) -> np.ndarray:
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(0, 0.2, count))
    east, north = np.cumsum(np.cos(heading)), np.cumsum(np.sin(heading))
    depth = 5 + np.cumsum(rng.normal(0, 0.1, count))
    lat0 = 41.0
    return np.column_stack(
        [-8.7 + east / METRES_PER_DEGREE / np.cos(np.radians(lat0)), lat0 + north / METRES_PER_DEGREE, depth]
    )


@pytest.mark.parametrize("seed", range(5))
def test_no_place_and_no_depth_is_further_than_the_tolerance_from_what_is_drawn(seed: int) -> None:
    places = wandering(seed)
    kept = worth_drawing(places)
    assert kept[0] == 0
    assert kept[-1] == len(places) - 1
    assert len(kept) < len(places)
    metres = (places[:, :2] - places[0, :2]) * METRES_PER_DEGREE * [np.cos(np.radians(places[0, 1])), 1.0]
    line = LineString(metres[kept])
    assert max(line.distance(Point(place)) for place in metres) <= TOLERANCE_M + 1e-9
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(metres, axis=0).T))])
    profile = LineString(np.column_stack([along, places[:, 2]])[kept])
    off = [profile.distance(Point(a, d)) for a, d in zip(along, places[:, 2], strict=True)]
    assert max(off) <= TOLERANCE_M + 1e-9


def test_a_straight_way_is_two_places_and_a_dive_on_it_stays() -> None:
    straight = np.column_stack([np.full(100, -8.7), 41 + np.arange(100) * 1e-5, np.full(100, 3.0)])
    assert worth_drawing(straight).tolist() == [0, 99]
    dived = straight.copy()
    dived[50:, 2] = 9.0
    assert worth_drawing(dived).tolist() == [0, 49, 50, 99]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_the_shortest_ways_stay_as_they_are(count: int) -> None:
    assert len(worth_drawing(np.full((count, 3), 4.0))) == count


def at(time_s: float, lon: float) -> list[float]:
    return [time_s, lon, 41.0, 2.0]


def test_a_way_is_in_the_order_of_receipt_when_the_vehicles_clock_began_anew() -> None:
    heard = np.array([at(100, 1), at(200, 2), at(120, 3), at(150, 4)])
    assert in_order(heard, np.zeros((0, 4)))[:, 1].tolist() == [1, 2, 3, 4]


def test_points_of_a_log_lie_where_the_clock_puts_them() -> None:
    heard = np.array([at(100, 1), at(110, 2), at(200, 5)])
    log = np.array([at(190, 4), at(115, 3), at(90, 0), at(210, 6)])
    assert in_order(heard, log)[:, 1].tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert in_order(np.zeros((0, 4)), log)[:, 1].tolist() == [0, 3, 4, 6]


@pytest.mark.slow
async def test_a_position_that_is_corrected_is_no_way_that_was_flown_also_after_a_restart(harbour: Harbour) -> None:
    service = await harbour.reopen(time_scale=1.0)
    mission = await service.create(sim_spec(vehicles=[{"name": "a", "kind": "rest"}]))
    rover = Rover(service, mission.id, "a")
    await rover.post()
    await act(service, mission.id, "start")
    for east_m in (2.0, 5.0, 5.1, 27.0, 25.0):
        lon, lat = lon_lat(east_m, 5.0)
        await rover.post(lat_deg=lat, lon_deg=lon)
    for _ in range(2):
        assert (await service.get(mission.id)).journal.travelled_m == pytest.approx(5.0, abs=0.1)
        service = await harbour.reopen(time_scale=1.0)


@pytest.mark.slow
async def test_a_way_across_180_degrees_is_as_long_as_any_other(harbour: Harbour) -> None:
    service = await harbour.reopen(time_scale=1.0)
    west = 179.9995
    ring = [[west, -17.0], [180.0, -17.0], [180.0, -16.999], [west, -16.999], [west, -17.0]]
    mission = await service.create(
        sim_spec(vehicles=[{"name": "a", "kind": "rest"}], area={"type": "Polygon", "coordinates": [ring]})
    )
    rover = Rover(service, mission.id, "a")
    await rover.post(lat_deg=-17.0, lon_deg=179.99999)
    await act(service, mission.id, "start")
    for lon_deg in (179.99999, -179.99999):
        await rover.post(lat_deg=-17.0, lon_deg=lon_deg)
    for _ in range(2):
        assert (await service.get(mission.id)).journal.travelled_m == pytest.approx(2.1, abs=0.1)
        service = await harbour.reopen(time_scale=1.0)
