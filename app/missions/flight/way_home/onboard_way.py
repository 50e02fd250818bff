"""Keeps a way home on board of vehicles that can take it by themselves, for when nobody here is alive any more."""

import asyncio

import numpy as np
import structlog

from app.arrays import FloatArray
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import Position, VehicleRefusedError
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.observation.waiting import LEAST_LOOK_S
from app.missions.live.mission import LiveMission
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member
from app.missions.views.mission import Level

PERIOD_S = 5.0
"""How often is looked whether a way has changed, by the vehicles' clock: it costs the radio."""

CHANGED_M = 5.0
"""A way whose corners moved less is the same."""

log = structlog.get_logger(__name__)


class OnboardWays:
    """Keeps the ways home of one running mission's vehicles on board, and takes them away with its end."""

    def __init__(self, live: LiveMission, hub: FleetHub, energy_range: EnergyRange, time_scale: float) -> None:
        self._time_scale = time_scale
        self._range = energy_range
        self._live = live
        self._hub = hub
        self._kept: dict[str, FloatArray] = {}
        self._told: set[str] = set()

    async def keep(self) -> None:
        """Keep a way home on board of every vehicle that can, as it is now, until cancelled."""
        while True:
            able = [member for member in self._live.team if member.capabilities.keeps_way_home and member.controllable]
            await asyncio.gather(*(self._renew(member) for member in able))
            await asyncio.sleep(max(PERIOD_S / self._time_scale, LEAST_LOOK_S))

    async def drop(self) -> None:
        """Take all ways away again, where the mission has ended and its vehicles can be reached."""
        # An earlier run of the service may have stored some.
        able = [m for m in self._live.team if m.capabilities.keeps_way_home and m.way_home.corners_m is not None]
        self._kept.clear()
        await asyncio.gather(*(self._drop(member) for member in able))

    async def _renew(self, member: Member) -> None:
        way_m = member.way_home.left_alone_m
        if member.withdrawal is not None and member.withdrawal.over and self._kept.pop(member.name, None) is not None:
            await self._drop(member)
        if way_m is None or (member.withdrawal is not None and member.withdrawal.over):
            return
        kept = self._kept.get(member.name)
        if kept is not None and kept.shape == way_m.shape and float(np.abs(kept - way_m).max()) < CHANGED_M:
            return
        spec = self._live.spec
        places = positions(spec, way_m, self._range.depths_m(member, member.place_m(self._live.frame), way_m))
        try:
            layer = self._range.layer(member)
            await self._hub.keep_way_home(member.key, places, spec.speed_of(member.spec), layer)
        except VehicleRefusedError as error:
            if member.name not in self._told:
                self._told.add(member.name)
                words = f"{member.name} would not come home by itself: {error}"
                await self._live.journal.log(Level.WARNING, "recovery", words, vehicle=member.name)
            return
        self._kept[member.name] = way_m
        self._told.discard(member.name)

    async def _drop(self, member: Member) -> None:
        try:
            await self._hub.drop_way_home(member.key)
        except VehicleRefusedError as error:
            log.warning("a way home stays on board", vehicle=member.name, error=str(error))


def positions(spec: MissionSpec, way_m: FloatArray, depths_m: list[float]) -> list[Position]:
    """Return a way's corners, (n, 2), as places: at these depths as far as home, and there at the surface.

    No part of the way leads along the surface, where those wait that are home.
    """
    lats, lons = spec.frame().to_geographic(*np.vstack([way_m, way_m[-1:]]).T)
    depths = [*depths_m, 0.0]
    return [Position(float(lat), float(lon), d) for lat, lon, d in zip(lats, lons, depths, strict=True)]
