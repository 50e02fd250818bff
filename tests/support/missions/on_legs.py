"""Vehicles of a mission in memory that are somewhere and have legs, without anybody who flies them."""

from collections.abc import Sequence

import numpy as np

from app.missions.fleet.interface import LinkState, Position, VehicleReport, WaypointOrder, WaypointStatus
from app.missions.live.mission import LiveMission
from app.missions.team import CommittedLeg, CommittedWay, Member

Place = tuple[float, float]
"""East and north in the mission's frame, metres."""


def position(live: LiveMission, place_m: Place) -> Position:
    """Return a place 2 m below the surface."""
    lat, lon = live.frame.to_geographic(np.array(place_m[0]), np.array(place_m[1]))
    return Position(float(lat), float(lon), 2.0)


def put_on_legs(live: LiveMission, name: str, here_m: Place, ends_m: Sequence[Place] = ()) -> Member:
    """Let a vehicle be somewhere, follow, and fly the first of some legs; the others it has ahead."""
    spec = next(vehicle for vehicle in live.spec.vehicles if vehicle.name == name)
    member = live.team.get(name) or live.team.join(spec, len(live.team.members))
    member.engaged, member.link = True, LinkState.ENGAGED
    member.report = VehicleReport(name, 0.0, position(live, here_m))
    legs = [CommittedLeg(n, position(live, end_m), np.array(end_m)) for n, end_m in enumerate(ends_m, 1)]
    way_m = float(np.hypot(*np.diff([here_m, *ends_m], axis=0).T).sum())
    member.committed = CommittedWay(len(legs), way_m)
    member.ahead[:] = legs[1:]
    if legs:
        order = WaypointOrder(live.id, 1, name, legs[0].position, 1.0, 3.0, 1.0)
        member.set_order(order, legs[0].target_m)
        member.status = WaypointStatus.ACKNOWLEDGED
    return member
