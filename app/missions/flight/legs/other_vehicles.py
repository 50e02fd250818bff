"""Vehicles that a mission does not lead, and may meet: those of other missions, and whoever else is heard."""

import asyncio
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np

from app.arrays import FloatArray
from app.exploration.motion.timeline import Timeline
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.hub import FleetHub, VehicleKey
from app.missions.fleet.interface import VehicleInfo, VehicleReport
from app.missions.flight.legs.next_moment import WAITING_S, Imminent, NextMoment, is_out
from app.missions.flight.legs.room_aside import RoomAside
from app.missions.flight.observation.waiting import LEAST_LOOK_S, LOOK_S
from app.missions.live.mission import LiveMission
from app.missions.spec.vehicle import VehicleKind
from app.missions.team import Member

UNHEARD_S = 60.0
"""Nobody knows where a vehicle is that nobody here leads and that was not heard for so long, seconds of its time."""

STANDS_MPS = 0.2
"""Who is slower than this gets out of nobody's way: to wait for it does not help."""

TURNS_WITHIN_S = 5.0
"""How a vehicle turns is seen from two reports that lie no farther apart than this."""

PIECE_S = 2.0
"""So long are the straight pieces of its foreseen way."""

FAR_DEG = 0.5
"""Nobody so far away is met in a moment, degrees of latitude."""


@dataclass(frozen=True)
class LedVehicles:
    """What a running mission leads its vehicles by."""

    live: LiveMission
    moment: NextMoment
    room: RoomAside


@dataclass(frozen=True)
class OtherVehicle:
    """A vehicle that another mission leads, or nobody here: where it is, and how far it may be from there in a moment.

    ``imminent`` returns where it will be in the next moment, in a mission's frame.
    """

    lat_deg: float
    lon_deg: float
    reach_m: float
    imminent: Callable[[LocalFrame], Imminent]


@dataclass(frozen=True)
class _Unled:
    """A vehicle that no mission leads, as it was heard last, and how fast it turns, clockwise."""

    report: VehicleReport
    heading_rad: float
    speed_mps: float
    heard_s: float
    """On the event loop's clock, seconds of the vehicles' time."""
    age_s: float
    turn_rad_s: float

    @property
    def seen(self) -> OtherVehicle:
        """What missions have to know."""
        place = self.report.position
        return OtherVehicle(place.lat_deg, place.lon_deg, (WAITING_S + self.age_s) * self.speed_mps, self._imminent)

    def _imminent(self, frame: LocalFrame) -> Imminent:
        """Return where it will be if it goes on turning as it does."""
        place = self.report.position
        east, north = map(float, frame.to_local(place.lat_deg, place.lon_deg))
        time_s: FloatArray = np.arange(0.0, WAITING_S + self.age_s + PIECE_S, PIECE_S)
        course_rad = self.heading_rad + self.turn_rad_s * (time_s[:-1] + 0.5 * PIECE_S)
        pieces_m = self.speed_mps * PIECE_S * np.column_stack([np.sin(course_rad), np.cos(course_rad)])
        way_m = np.array([east, north]) + np.vstack([np.zeros(2), np.cumsum(pieces_m, axis=0)])
        motion = Timeline(time_s - self.age_s, np.column_stack([way_m, np.full(len(time_s), place.depth_m)]))
        return Imminent(self.report.vehicle, motion, place.depth_m, place.depth_m)


class OtherVehicles:
    """Knows of every vehicle about that a mission may have to give way to; one for all missions of a service.

    Simulated vehicles are alone with their mission's.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(self, hub: FleetHub, time_scale: float) -> None:
        self._hub = hub
        self._time_scale = time_scale
        self._led: dict[str, LedVehicles] = {}
        self._unled: dict[VehicleKey, _Unled] = {}
        self._looked_s = -math.inf

    @contextmanager
    def flown(self, led: LedVehicles) -> Iterator[None]:
        """Have the others know of a mission's vehicles as long as this lasts."""
        self._led[led.live.id] = led
        try:
            yield
        finally:
            del self._led[led.live.id]

    def led(self, live: LiveMission) -> LedVehicles | None:
        """Return what another mission leads its vehicles by; None while it leads none, or keeps none apart.

        Who keeps none apart would send nobody on that was led aside.
        """
        return None if live.flight.halted or live.spec.limits.min_separation_m <= 0.0 else self._led.get(live.id)

    def about(self, live: LiveMission) -> list[OtherVehicle]:
        """Return the vehicles about that a mission does not lead."""
        if all(member.capabilities.simulated for member in live.team):
            return []
        others = [
            _led_elsewhere(member, led, member.report)
            for led in self._led.values()
            if led.live is not live and not led.live.flight.halted
            for member in led.live.team
            if member.report is not None and is_out(member) and not member.capabilities.simulated
        ]
        self._look()
        leading = {live.id, *(led.live.id for led in self._led.values() if not led.live.flight.halted)}
        # One of this name that another link hears of is the same vehicle.
        names = {member.name for member in live.team}
        others += [
            unled.seen
            for key, unled in self._unled.items()
            if self._hub.claimed_by(key) not in leading and key[1] not in names
        ]
        origin = live.frame.origin_lat_deg, live.frame.origin_lon_deg
        return [vehicle for vehicle in others if _is_near(vehicle, *origin)]

    def _look(self) -> None:
        """See who is heard and moves."""
        now_s = asyncio.get_running_loop().time()
        if now_s - self._looked_s < max(0.9 * LOOK_S / self._time_scale, LEAST_LOOK_S):
            return
        self._looked_s, before = now_s, self._unled
        self._unled = {}
        for info, _ in self._hub.vehicles():
            key = (VehicleKind(info.kind), info.name)
            vehicle = self._moving(info, now_s, before.get(key))
            if vehicle is not None and not self._hub.capabilities(key[0]).simulated:
                self._unled[key] = vehicle

    def _moving(self, info: VehicleInfo, now_s: float, before: _Unled | None) -> _Unled | None:
        """Return a vehicle that was heard a moment ago and moves; None for any other."""
        report, report_age_s = info.report, info.report_age_s
        if report_age_s is None or report is None or report.speed_mps is None or report.heading_rad is None:
            return None
        age_s = report_age_s * self._time_scale
        if report.speed_mps < STANDS_MPS or age_s > UNHEARD_S:
            return None
        heard_s = now_s * self._time_scale - age_s
        turn_rad_s = 0.0 if before is None else _turn_rad_s(before, report, heard_s)
        return _Unled(report, report.heading_rad, report.speed_mps, heard_s, age_s, turn_rad_s)


def _led_elsewhere(member: Member, led: LedVehicles, report: VehicleReport) -> OtherVehicle:
    place = report.position
    reach_m = led.moment.reach_m(member) + led.live.spec.limits.min_separation_m
    return OtherVehicle(place.lat_deg, place.lon_deg, reach_m, partial(led.moment.as_led, member))


def _is_near(vehicle: OtherVehicle, lat_deg: float, lon_deg: float) -> bool:
    """Whether a vehicle is so near a place that its way there can be told in metres."""
    apart_deg = abs((vehicle.lon_deg - lon_deg + 180.0) % 360.0 - 180.0) * math.cos(math.radians(lat_deg))
    return abs(vehicle.lat_deg - lat_deg) < FAR_DEG and apart_deg < FAR_DEG


def _turn_rad_s(before: _Unled, report: VehicleReport, heard_s: float) -> float:
    """Return how fast a vehicle turns; as before where no newer report came."""
    if report == before.report or report.heading_rad is None:
        return before.turn_rad_s
    passed_s = heard_s - before.heard_s
    turned_rad = math.remainder(report.heading_rad - before.heading_rad, 2 * math.pi)
    return turned_rad / passed_s if 0.0 < passed_s <= TURNS_WITHIN_S else 0.0
