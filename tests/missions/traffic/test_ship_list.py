"""Who is on the list, and who has to go where there is no room."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.missions.traffic.sentences import ShipParticulars, ShipPosition
from app.missions.traffic.ship_list import JUMP_S, MOST_SHIPS, ShipList

HERE = (41.18, -8.70)
SPAIN = (43.4, -8.2)


def at(mmsi: int, lat_deg: float = HERE[0], lon_deg: float = HERE[1]) -> ShipPosition:
    return ShipPosition(mmsi, False, lat_deg, lon_deg, 5.0, 90.0)


def watching() -> ShipList:
    ships = ShipList(600.0)
    ships.watch_over([HERE])
    return ships


def settled(ships: ShipList, mmsi: int) -> None:
    for now_s in (0.0, 6.0, 12.0):
        assert ships.place(at(mmsi), now_s)


def test_a_ship_that_is_silent_is_forgotten() -> None:
    ships = ShipList(60.0)
    ships.place(at(1), 0.0)
    ships.place(at(2), 50.0)
    ships.forget_silent(61.0)
    assert [ship.position.mmsi for ship in ships] == [2]


def test_made_up_ships_take_no_memory_and_no_near_ship_s_place() -> None:
    ships = watching()
    settled(ships, 1)
    for number in range(5 * MOST_SHIPS):
        ships.place(at(1000 + number, *SPAIN), 12.0)
    for number in range(5 * MOST_SHIPS):
        ships.place(at(500_000 + number), 13.0)
    assert len(ships) == MOST_SHIPS
    assert ships.get(1) is not None
    assert ships.turned_away > 0


def test_near_ships_come_before_far_ones() -> None:
    ships = watching()
    for number in range(MOST_SHIPS):
        ships.place(at(1000 + number, *SPAIN), 0.0)
    assert ships.place(at(1), 1.0)
    assert not ships.place(at(2, 43.5, -8.2), 1.0), "farther than all others"
    assert len(ships) == MOST_SHIPS


def test_a_forged_place_does_not_take_a_ship_away() -> None:
    ships = watching()
    settled(ships, 1)
    assert not ships.place(at(1, *SPAIN), 13.0)
    ship = ships.get(1)
    assert ship is not None
    assert (ship.position.lat_deg, ship.position.lon_deg) == HERE
    assert ships.jumps == 1
    assert ships.place(at(1, *SPAIN), 13.0 + JUMP_S), "after a silence it may be anywhere"


def test_what_a_ship_is_may_come_before_and_after_where_it_is() -> None:
    ships = watching()
    ships.describe(ShipParticulars(1, False, name="EVA"))
    ships.place(at(1), 0.0)
    ships.describe(ShipParticulars(1, False, call_sign="CT1", to_bow_m=10.0, to_stern_m=0.0, draught_m=3.0))
    ship = ships.get(1)
    assert ship is not None
    told = ship.particulars
    assert (told.name, told.call_sign, told.to_bow_m, told.to_stern_m) == ("EVA", "CT1", 10.0, 0.0)
    assert ship.hull_m == pytest.approx(10.0)


def test_names_of_ships_that_are_nowhere_take_no_memory() -> None:
    ships = watching()
    for number in range(3 * MOST_SHIPS):
        ships.describe(ShipParticulars(number, False, name="GHOST"))
    assert len(ships) == 0
    assert len(ships._particulars) <= MOST_SHIPS


@settings(max_examples=50)
@given(
    st.lists(st.tuples(st.integers(1, 30), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(0, 900)), max_size=60)
)
def test_no_history_leaves_an_old_ship_or_more_than_there_is_room_for(
    history: list[tuple[int, float, float, float]],
) -> None:
    ships = watching()
    now_s = 0.0
    for mmsi, north, east, later_s in history:
        now_s += later_s
        ships.place(at(mmsi, HERE[0] + north, HERE[1] + east), now_s)
        ships.forget_silent(now_s)
        assert all(now_s - ship.heard_s <= 600.0 for ship in ships)
        assert len({ship.position.mmsi for ship in ships}) == len(ships) <= 30
