"""Whether vehicles are where they may be: an entry into a keep-out zone is an alarm, and so is leaving the area."""

from dataclasses import dataclass
from typing import Any

import shapely
from shapely.geometry import Point, Polygon

from app.arrays import FloatArray
from app.missions.alarm_kinds import AlarmKind

OUTSIDE_ALARM_M = 20.0
"""Vehicles that wait circle across the border; farther outside than this they have gone astray."""
OUTSIDE_OVER_M = 10.0
CLEAR_M = 1.0
"""An entry is over this far outside of the zone: a vehicle at its very border enters it once."""


@dataclass
class _Breach:
    words: str
    began_s: float
    farthest_m: float = 0.0


@dataclass(frozen=True)
class Crossing:
    """A vehicle that went where it must not be, or came back: a line for the log."""

    alarm: AlarmKind
    begins: bool
    """False: it came back."""
    ends: bool
    """It is nowhere any more that raised this alarm."""
    message: str
    data: dict[str, Any]


class Boundaries:
    """Holds the vehicles' reported places against a mission's keep-out zones and area.

    Parameters
    ----------
    area : (n, 2)
        East and north of its corners.
    zones
        The keep-out zones as drawn, each (n, 2), without a margin.
    """

    def __init__(self, area: FloatArray, zones: list[FloatArray]) -> None:
        self._area = Polygon(area)
        self._zones = [Polygon(zone) for zone in zones]
        shapely.prepare([self._area, *self._zones])
        self._been_inside: set[str] = set()
        """Vehicles that were inside of the area since they were put to sea, or led out of it."""
        self._coming_in: set[str] = set()
        self._breaches: dict[str, dict[int, _Breach]] = {}
        self._recalled: set[tuple[AlarmKind, str | None]] = set()

    def recall(self, alarms: set[tuple[AlarmKind, str | None]]) -> None:
        """Take up alarms of an earlier process that are not over, each with its vehicle."""
        self._recalled |= alarms

    def judge(
        self, vehicle: str, en_m: tuple[float, float], depth_m: float, at_s: float, *, may_leave: bool = False
    ) -> list[Crossing]:
        """Return what there is to tell of a vehicle at a place; ``at_s`` in seconds of any one clock.

        ``may_leave``: its way home leads out of the area.
        """
        place = Point(en_m)
        crossings, zones_left = [], True
        for number, zone in enumerate(self._zones, 1):
            inside_m = -_signed_distance_m(zone, place)
            zones_left = zones_left and inside_m < -CLEAR_M
            crossings += self._follow(
                vehicle,
                number,
                f"in keep-out zone {number}",
                inside_m,
                inside_m > 0,
                inside_m < -CLEAR_M,
                depth_m,
                at_s,
            )
        outside_m = _signed_distance_m(self._area, place)
        if outside_m <= 0:
            self._been_inside.add(vehicle)
        elif may_leave:
            self._been_inside.discard(vehicle)
        coming_in = vehicle not in self._been_inside and not may_leave
        self._coming_in = self._coming_in | {vehicle} if coming_in else self._coming_in - {vehicle}
        # One that comes from outside for the first time, or from home again, is on its way in.
        astray = vehicle in self._been_inside and not may_leave and outside_m > OUTSIDE_ALARM_M
        crossings += self._follow(
            vehicle, 0, "outside the area", outside_m, astray, outside_m <= OUTSIDE_OVER_M, depth_m, at_s
        )
        # What is raised anew ends as that does.
        self._recalled -= {(crossing.alarm, vehicle) for crossing in crossings if crossing.begins}
        if zones_left:
            crossings += self._end_recalled(AlarmKind.ZONE_ENTERED, vehicle, "is in no keep-out zone any more")
        if outside_m <= OUTSIDE_OVER_M:
            crossings += self._end_recalled(AlarmKind.AREA_LEFT, vehicle, "is no longer outside the area")
        return crossings

    def _end_recalled(self, alarm: AlarmKind, vehicle: str, words: str) -> list[Crossing]:
        if (alarm, vehicle) not in self._recalled:
            return []
        self._recalled.discard((alarm, vehicle))
        return [Crossing(alarm, False, True, f"{vehicle} {words}", {"vehicle": vehicle, "zone": None, "begins": False})]

    def breach(self, vehicle: str) -> str:
        """Return where a vehicle is that it must not be; empty when all is well."""
        return ", ".join(breach.words for breach in self._breaches.get(vehicle, {}).values())

    def comes_in(self, vehicle: str) -> bool:
        """Whether a vehicle is outside of the area and was not inside since it was put to sea, or led out of it."""
        return vehicle in self._coming_in

    def forget(self, vehicle: str) -> None:
        """A vehicle left the mission: where it goes is no matter of the mission any more."""
        self._breaches.pop(vehicle, None)
        self._been_inside.discard(vehicle)
        self._coming_in.discard(vehicle)

    def _follow(
        self, vehicle: str, key: int, words: str, by_m: float, began: bool, over: bool, depth_m: float, at_s: float
    ) -> list[Crossing]:
        known = self._breaches.setdefault(vehicle, {})
        breach = known.get(key)
        data = {"vehicle": vehicle, "zone": key or None}
        alarm = AlarmKind.ZONE_ENTERED if key else AlarmKind.AREA_LEFT
        if breach is None:
            if not began:
                return []
            known[key] = _Breach(words, at_s, by_m)
            message = f"{vehicle} is {words}, at {depth_m:.1f} m depth: abort it if it goes on"
            return [Crossing(alarm, True, False, message, data | {"begins": True})]
        breach.farthest_m = max(breach.farthest_m, by_m)
        if not over:
            return []
        del known[key]
        message = (
            f"{vehicle} is no longer {words}: it was for {max(at_s - breach.began_s, 0.0):.0f} s, "
            f"by up to {breach.farthest_m:.1f} m"
        )
        elsewhere = any(bool(other) == bool(key) for other in known)
        facts = data | {"begins": False, "farthest_m": round(breach.farthest_m, 2)}
        return [Crossing(alarm, False, not elsewhere, message, facts)]


def _signed_distance_m(polygon: Polygon, place: Point) -> float:
    """Return how far a place lies outside of a polygon, negative inside."""
    distance = float(shapely.distance(polygon.exterior, place))
    return -distance if polygon.contains(place) else distance
