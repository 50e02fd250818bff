"""Searches whose vehicles see each other: a vehicle of the team is no obstacle, what stands beside it is one."""

import math

import pytest

from app.estimation.occupancy import Cell
from app.missions.live.mission import LiveMission
from app.missions.operations.measurements import measure
from app.missions.operations.polling import waypoint
from app.missions.operations.scans import scan, search_grid
from app.missions.search.scan_schema import Scan
from app.missions.search.state import Search
from app.missions.service import MissionService
from app.missions.soundings.measurement import Measurement
from app.missions.spec.mission import MissionSpec
from tests.support.missions.harbour import CLOCK_S, Harbour, act
from tests.support.missions.searches import search_spec
from tests.support.missions.specs import lon_lat
from tests.support.waiting import until

BEAMS = 180
REACH_M = 10.0
WIDE_M = 0.5
"""Half of what a boat is wide to a scanner."""
SHORT_M = 0.3
"""How far before its position a boat is met."""
EVERY_S = 20.0
"""Between two posts by a boat's clock: how far clocks are apart is told by when posts come, and a busy machine holds
some of them up for seconds."""


class SeeingBoat:
    """A boat that polls, is at once where it is sent, and scans what is round it, the others of its team as well."""

    def __init__(self, live: LiveMission, name: str, east_m: float, north_m: float) -> None:
        self.live, self.name = live, name
        self.place_m = (east_m, north_m)
        self._time_s = CLOCK_S
        self._step: int | None = None

    async def post(self, **changes: float) -> None:
        self._time_s += EVERY_S
        lon, lat = lon_lat(*self.place_m)
        values = {"vehicle": self.name, "time_s": self._time_s, "lat_deg": lat, "lon_deg": lon, "depth_m": 0.0}
        await measure(self.live, [Measurement.model_validate(values | changes)])

    def look(self, *others: tuple[float, float], time_s: float | None = None) -> Scan:
        """A turn of the scanner that meets the boats at some places, and nothing else."""
        ranges: list[float | None] = [None] * BEAMS
        for other in others:
            away_m, bearing = math.dist(self.place_m, other), self._bearing_deg(other)
            for k in range(BEAMS):
                off = math.radians((2.0 * k - bearing + 180.0) % 360.0 - 180.0)
                if abs(off) * away_m < WIDE_M and away_m < REACH_M:
                    ranges[k] = max(away_m - SHORT_M, 0.2)
        lon, lat = lon_lat(*self.place_m)
        values = {"vehicle": self.name, "time_s": self._time_s if time_s is None else time_s, "lat_deg": lat}
        beams = {"bearing_step_deg": 2.0, "reach_m": REACH_M, "ranges_m": ranges}
        return Scan.model_validate(values | {"lon_deg": lon} | beams)

    async def go(self) -> None:
        found = await waypoint(self.live, self.name, after_step=self._step, timeout_s=0.0)
        if found is not None:
            self._step, self.place_m = found.step, (found.east_m, found.north_m)

    def _bearing_deg(self, other: tuple[float, float]) -> float:
        return math.degrees(math.atan2(other[0] - self.place_m[0], other[1] - self.place_m[1]))


def two_boats() -> MissionSpec:
    vehicles = [{"name": name, "kind": "rest", "depth_m": 0} for name in "ab"]
    return search_spec(vehicles=vehicles, search={"obstacles": [], "simulated_obstacles": []})


def states_at(live: LiveMission, *places_m: tuple[float, float]) -> list[Cell]:
    assert live.search is not None
    states = live.search.grid.states
    return [Cell(states[int(north), int(east)]) for east, north in places_m]


@pytest.mark.slow
async def test_boats_that_see_each_other_at_the_entry_go_and_search(service: MissionService) -> None:
    live = await service.get((await service.create(two_boats())).id)
    boats = [SeeingBoat(live, "a", 12.5, 5.5), SeeingBoat(live, "b", 17.5, 5.5)]
    for boat in boats:
        await boat.post()
    await act(service, live.id, "start")

    async def have_gone_on() -> bool:
        for boat in boats:
            await boat.post()
        for boat, other in zip(boats, reversed(boats), strict=True):
            assert (await scan(live, [boat.look(other.place_m)])).accepted == 1
        for boat in boats:
            await boat.go()
        assert live.search is not None
        return live.header.step >= 8 and live.search.figures.explored_part > 0.7

    await until(have_gone_on, "they have seen most of the basin")
    assert isinstance(live.search, Search)
    assert live.search.figures.found_cells == 0
    await act(service, live.id, "abort")


async def test_a_boat_hides_what_is_behind_it_and_a_wall_beside_it_is_seen(harbour: Harbour) -> None:
    live = await harbour.service.get((await harbour.service.create(two_boats())).id)
    a, b = SeeingBoat(live, "a", 12.5, 5.5), SeeingBoat(live, "b", 17.5, 5.5)
    for boat in (a, b):
        await boat.post()
    # A post stands 4 m beside the boat, as far from the scanner.
    assert (await scan(live, [a.look((17.5, 5.5), (17.5, 9.5))])).accepted == 1
    short, behind, post = (15.5, 5.5), (20.5, 5.5), (17.3, 9.2)
    assert states_at(live, short, behind, post) == [Cell.EXPLORED, Cell.UNEXPLORED, Cell.FOUND]
    assert states_at(live, (17.2, 5.5)) != [Cell.FOUND]
    before = search_grid(live)
    live = await (await harbour.reopen()).get(live.id)
    assert search_grid(live) == before


@pytest.mark.slow
async def test_a_late_scan_knows_where_the_others_were_when_it_was_taken(service: MissionService) -> None:
    live = await service.get((await service.create(two_boats())).id)
    a, b = SeeingBoat(live, "a", 12.5, 5.5), SeeingBoat(live, "b", 17.5, 5.5)
    taken_s = CLOCK_S + 2 * EVERY_S
    for boat in (a, b):
        await boat.post()
    await act(service, live.id, "start")
    await until(lambda: all(member.report is not None for member in live.team), "both are heard")
    late = a.look(b.place_m, time_s=taken_s)
    for k in range(20):
        b.place_m = (17.5, 5.5 + 0.5 * k)
        await b.post()
        await a.post()
    assert (await scan(live, [late])).accepted == 1
    assert live.search is not None
    assert live.search.figures.found_cells == 0
    # Where it has long left something stands now.
    assert (await scan(live, [a.look((17.5, 5.5))])).accepted == 1
    assert states_at(live, (17.2, 5.5)) == [Cell.FOUND]


async def test_a_boat_that_is_less_sure_of_its_place_is_known_farther_from_it(service: MissionService) -> None:
    live = await service.get((await service.create(two_boats())).id)
    a, b = SeeingBoat(live, "a", 12.5, 5.5), SeeingBoat(live, "b", 17.5, 9.5)
    await a.post()
    await b.post()
    seen_at = (17.5, 5.5)
    assert (await scan(live, [a.look(seen_at)])).accepted == 1
    assert states_at(live, (17.2, 5.5)) == [Cell.FOUND]
    await b.post(position_sd_m=2.0)
    assert live.search is not None
    before = float(live.search.grid.evidence[5, 17])
    await a.post()
    assert (await scan(live, [a.look(seen_at)])).accepted == 1
    assert live.search.grid.evidence[5, 17] <= before
