"""The ships that were heard lately: as many as there is room for, the near ones first."""

import math
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from app.mapping.coordinates.distances import horizontal_distance_m
from app.missions.traffic.sentences import ShipParticulars, ShipPosition

MOST_SHIPS = 1000
NEAR_M = 20_000.0
"""Ships within so far of a mission give way to no others."""
TWICE_HEARD, SETTLED_S = 3, 10.0
"""A ship that was heard so often, over so long, is known; others may be made up."""
FASTEST_MPS = 60.0
"""What was farther away a moment ago is another ship under the same number."""
SCATTER_M = 500.0
"""Positions differ by so much for other reasons than a ship's way."""
JUMP_S = 60.0
"""Who was heard this long ago may be elsewhere now."""


@dataclass(slots=True)
class Ship:
    """One ship as it was heard last; ``heard_s`` by the clock that the list is given."""

    position: ShipPosition
    particulars: ShipParticulars
    heard_s: float
    first_s: float
    reports: int = 1
    distance_m: float = 0.0
    """To the nearest mission when it was heard; 0 where there is none."""

    @property
    def known(self) -> bool:
        """Whether it was heard often enough to be no ghost."""
        return self.reports >= TWICE_HEARD and self.heard_s - self.first_s >= SETTLED_S

    @property
    def hull_m(self) -> float:
        """How far its hull reaches from where its position is taken; 0: not told."""
        told = self.particulars
        ahead = max(told.to_bow_m or 0.0, told.to_stern_m or 0.0)
        return math.hypot(ahead, max(told.to_port_m or 0.0, told.to_starboard_m or 0.0))

    def place_in_the_way(self) -> tuple[int, float]:
        """Return how readily it gives way to others: the larger, the sooner."""
        return 2 * (self.distance_m > NEAR_M) + (not self.known), self.distance_m


class ShipList:
    """Ships by their MMSI.

    Parameters
    ----------
    max_age_s
        Who is silent for so long is forgotten.
    """

    def __init__(self, max_age_s: float) -> None:
        self._max_age_s = max_age_s
        self._ships: dict[int, Ship] = {}
        self._particulars: OrderedDict[int, ShipParticulars] = OrderedDict()
        """Of ships whose position is not known yet, and of those that are; the latest last."""
        self._missions: Sequence[tuple[float, float]] = ()
        self._first_to_go: list[int] = []
        self.turned_away = 0
        """How many reports there was no room for."""
        self.jumps = 0
        """How many positions were too far from where the ship had just been."""

    def __iter__(self) -> Iterator[Ship]:
        return iter(list(self._ships.values()))

    def __len__(self) -> int:
        return len(self._ships)

    def get(self, mmsi: int) -> Ship | None:
        """Return a ship, if it was heard lately."""
        return self._ships.get(mmsi)

    def watch_over(self, missions: Sequence[tuple[float, float]]) -> None:
        """Put ships near these places, latitude and longitude, before others from now on."""
        if tuple(missions) != tuple(self._missions):
            self._missions = tuple(missions)
            for ship in self._ships.values():
                ship.distance_m = self._distance_m(ship.position)
            self._first_to_go = []

    def place(self, position: ShipPosition, now_s: float) -> bool:
        """Take a position; whether it counts."""
        ship = self._ships.get(position.mmsi)
        if ship is None:
            return self._admit(position, now_s)
        silent_s = now_s - ship.heard_s
        away_m = horizontal_distance_m(ship.position.lat_lon, position.lat_lon)
        if silent_s < JUMP_S and away_m > SCATTER_M + FASTEST_MPS * silent_s:
            self.jumps += 1
            return False
        ship.position, ship.heard_s, ship.distance_m = position, now_s, self._distance_m(position)
        ship.reports += 1
        return True

    def describe(self, told: ShipParticulars) -> None:
        """Take what a ship is; what it does not tell now is as it was told before."""
        before = self._particulars.pop(told.mmsi, None)
        merged = told if before is None else _merged(before, told)
        ship = self._ships.get(told.mmsi)
        if ship is not None:
            ship.particulars = merged
        self._particulars[told.mmsi] = merged
        while len(self._particulars) > MOST_SHIPS:
            self._particulars.popitem(last=False)

    def forget_silent(self, now_s: float) -> None:
        """Leave out who was silent for long."""
        for mmsi in [m for m, ship in self._ships.items() if now_s - ship.heard_s > self._max_age_s]:
            del self._ships[mmsi]

    def _admit(self, position: ShipPosition, now_s: float) -> bool:
        told = self._particulars.get(position.mmsi) or ShipParticulars(position.mmsi, position.own)
        newcomer = Ship(position, told, now_s, now_s, distance_m=self._distance_m(position))
        if len(self._ships) >= MOST_SHIPS:
            other = self._next_to_go()
            if other is None or self._ships[other].place_in_the_way() <= newcomer.place_in_the_way():
                self.turned_away += 1
                return False
            del self._ships[other]
            self._first_to_go.pop()
        self._ships[position.mmsi] = newcomer
        return True

    def _next_to_go(self) -> int | None:
        """Return who goes next where room is needed; sorted seldom, since a flood of ships would ask often."""
        while self._first_to_go and self._first_to_go[-1] not in self._ships:
            self._first_to_go.pop()
        if not self._first_to_go:
            order = {mmsi: ship.place_in_the_way() for mmsi, ship in self._ships.items()}
            self._first_to_go = sorted(order, key=order.__getitem__)
        return self._first_to_go[-1] if self._first_to_go else None

    def _distance_m(self, position: ShipPosition) -> float:
        return min((horizontal_distance_m(position.lat_lon, one) for one in self._missions), default=0.0)


def _merged(before: ShipParticulars, now: ShipParticulars) -> ShipParticulars:
    names = [name for name in ShipParticulars.__slots__ if name not in ("mmsi", "own")]
    values = {name: getattr(now, name) or getattr(before, name) for name in names}
    # Two of the four lengths may rightly be zero.
    if now.to_bow_m is not None:
        values |= {"to_bow_m": now.to_bow_m, "to_stern_m": now.to_stern_m}
    if now.to_port_m is not None:
        values |= {"to_port_m": now.to_port_m, "to_starboard_m": now.to_starboard_m}
    return ShipParticulars(now.mmsi, now.own, **values)
