"""Vehicles that are placed by hand, before what watches over how they steer."""

import asyncio
import math

import numpy as np
import pytest

from app.arrays import FloatArray
from app.missions.fleet.hub import FleetHub, VehicleKey
from app.missions.fleet.interface import LinkCapabilities, LinkState, Position, VehicleReport, WaypointOrder
from app.missions.fleet.interface import WaypointStatus as Status
from app.missions.flight.decisions.separation import steered_ahead
from app.missions.flight.legs.asides import Asides
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.giving_way import GivingWay
from app.missions.flight.legs.keeping_off import KeepingOff, KeepOutZones
from app.missions.flight.legs.next_moment import NextMoment
from app.missions.flight.legs.other_vehicles import OtherVehicles
from app.missions.flight.legs.room_aside import RoomAside
from app.missions.live.mission import LiveMission
from app.missions.task.constraints import make_constraints
from app.missions.team import Member

Place = tuple[float, float, float]


class PlacedVehicles:
    """The vehicles of a mission that are placed by hand, and what they are ordered."""

    def __init__(
        self,
        live: LiveMission,
        hub: FleetHub,
        monkeypatch: pytest.MonkeyPatch,
        others: OtherVehicles | None = None,
    ) -> None:
        self.live = live
        self.ordered: list[WaypointOrder] = []
        constraints = make_constraints(live.spec)
        self.leg_commit = leg_commit = LegCommit(live, constraints, leads=False)
        self.dispatch = dispatch = Dispatch(live, hub, leg_commit, 1.0, persistent=True)
        zones = KeepOutZones(live.spec.to_local(zone) for zone in live.spec.keep_out)
        self.asides = asides = Asides(live, leg_commit, dispatch)
        moment = NextMoment(live, 1.0)
        room = RoomAside(live, constraints, leg_commit, zones, asides, moment)
        self.others = OtherVehicles(hub, 1.0) if others is None else others
        self.giving_way = GivingWay(live, moment, room, asides, self.others, 1.0)
        self.keeping_off = KeepingOff(live, constraints, zones, asides, 1.0)
        for slot, vehicle in enumerate(live.spec.vehicles):
            member = live.team.get(vehicle.name) or live.team.join(vehicle, slot)
            member.capabilities = LinkCapabilities(simulated=True)
            member.followed = member.engaged = True

        async def order(key: VehicleKey, order: WaypointOrder) -> None:
            self.ordered.append(order)

        monkeypatch.setattr(hub, "order", order)

    def put(
        self,
        name: str,
        at: Place,
        to: Place,
        *,
        heard_s: float = 100.0,
        clock_ahead_s: float = 0.0,
        heading_rad: float | None = None,
        anew: bool = False,
    ) -> Member:
        """Let a vehicle be somewhere, and fly to somewhere: where it heads for that, or ``heading_rad`` from north.

        ``anew``: it has not been sent there yet.
        """
        member = self.live.team.members[name]
        member.link = LinkState.ENGAGED
        if heading_rad is None:
            heading_rad = math.atan2(to[0] - at[0], to[1] - at[1])
        member.report = VehicleReport(name, heard_s + clock_ahead_s, self._position(at), heading_rad=heading_rad)
        member.heard_s = heard_s
        order = member.order
        if order is None or anew:
            order = WaypointOrder(self.live.id, 1, name, self._position(to), 1.0, 3.0, 1.0)
            member.set_order(order, np.array(to[:2]))
            member.leg.began_s = asyncio.get_running_loop().time()
        member.status = Status.ACKNOWLEDGED
        return member

    def steers_m(self, name: str, to_m: FloatArray) -> FloatArray:
        """Return the way (n, 2) on which a vehicle steers for a place (2,)."""
        member = self.live.team.members[name]
        places = [np.append(member.place_m(self.live.frame), 3.0), np.append(to_m, 3.0)]
        return steered_ahead(self.live, member, places, 60.0).place_m[:, :2]

    def _position(self, place: Place) -> Position:
        lat, lon = self.live.frame.to_geographic(np.array(place[0]), np.array(place[1]))
        return Position(float(lat), float(lon), place[2])

    def where_m(self, order: WaypointOrder) -> tuple[float, float]:
        """Return where an order leads, east and north."""
        east, north = self.live.frame.to_local(order.position.lat_deg, order.position.lon_deg)
        return float(east), float(north)
