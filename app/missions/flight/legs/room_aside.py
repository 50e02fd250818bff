"""Where a vehicle that gives way has most room, and how it is led there."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import shapely

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.missions.flight.decisions.separation import ways_aside
from app.missions.flight.legs.asides import Asides, Because
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.keeping_off import KeepOutZones
from app.missions.flight.legs.next_moment import CLOSING_M, WAITING_S, Imminent, NextMoment, nearest_m
from app.missions.live.mission import LiveMission
from app.missions.recovery.berths import home_of
from app.missions.recovery.way_home import homeward_ground
from app.missions.safety.room import CIRCLE_M
from app.missions.team import Member
from app.missions.views.mission import Level


@dataclass(frozen=True, order=True)
class Room:
    """How far a vehicle that gives way stays from all others, where more counts; the first counts most."""

    soon_m: float
    """In the next moment."""
    later_m: float
    """As long as it may wait: who passes later gives way, or is given way to, then."""
    always_m: float
    """As long, if it circled there from now on."""

    def is_enough(self, enough_m: float) -> bool:
        """Whether no other place can be better."""
        return self.always_m >= enough_m


class Apart(NamedTuple):
    """How far vehicles are to be from each other."""

    enough_m: float
    """Sideways, where there is room."""
    vertical_m: float
    """Or above each other."""


class RoomAside:
    """Has vehicles of one running mission give way."""

    def __init__(
        self,
        live: LiveMission,
        constraints: Constraints,
        leg_commit: LegCommit,
        zones: KeepOutZones,
        asides: Asides,
        moment: NextMoment,
    ) -> None:
        self._live = live
        self._constraints = constraints
        self._leg_commit = leg_commit
        self._zones = zones
        self._asides = asides
        self._moment = moment

    def may_give_way(self, member: Member) -> bool:
        """Whether a vehicle can be led aside now."""
        if self._live.flight.halted:
            return False
        return self._asides.may_lead(member, Because.VEHICLE) or self._asides.may_stand_elsewhere(member)

    def only_waits(self, member: Member) -> bool:
        """Whether it loses nothing by it."""
        return self._asides.may_stand_elsewhere(member)

    def best(
        self, it: Imminent, member: Member, others: Sequence[Imminent], apart: Apart, best: Room | None
    ) -> tuple[Room, FloatArray] | None:
        """Return where a vehicle has most room, and the place (2,); None where it has no more than the best so far.

        Parameters
        ----------
        it, others
            Where it, and all that it may meet, will be: in this mission's frame.
        """
        found: tuple[Room, FloatArray] | None = None
        going_on_m = min(nearest_m(it, that, apart.vertical_m) for that in others)
        for place_m in filter(partial(self._asides.is_clear, member), self._places(member)):
            waiting = self._moment.waiting(member, place_m, it.least_m, it.most_m)
            room = self._room(waiting, place_m, others, apart, going_on_m, best)
            if room is not None:
                found, best = (room, place_m), room
                if room.is_enough(apart.enough_m):
                    break
        return found

    async def give_way(self, member: Member, place_m: FloatArray, other: str) -> None:
        """Lead a vehicle to a place (2,) until another one has passed, whose name is told."""
        if self.only_waits(member):
            led = await self._asides.stand(member, place_m)
        else:
            led = await self._asides.lead(member, place_m, Because.VEHICLE)
        if led:
            words = f"{member.name} gives way to {other}"
            await self._live.journal.log(Level.INFO, "safety", words, vehicle=member.name, gives_way_to=other)

    def _room(
        self,
        waiting: Imminent,
        place_m: FloatArray,
        others: Sequence[Imminent],
        apart: Apart,
        going_on_m: float,
        best: Room | None,
    ) -> Room | None:
        """Return what room a vehicle has at a place (2,) and on the way there.

        None where that is not more than the best, or hardly more than it has where it goes on, or zones are near.
        """
        # It circles where it waits.
        if self._zones.entered_by(waiting.motion.place_m[:, :2]) or self._zones.near(place_m, waiting.around_m):
            return None
        enough_m, vertical_m = apart
        soon_m = min(nearest_m(waiting, that, vertical_m) for that in others)
        if soon_m <= going_on_m + CLOSING_M or (best is not None and min(soon_m, enough_m) < best.soon_m):
            return None
        later_m = min(nearest_m(waiting, that, vertical_m, WAITING_S) for that in others)
        circling = replace(waiting, waits_from_s=0.0)
        always_m = min(nearest_m(circling, that, vertical_m, WAITING_S) for that in others)
        room = Room(*(min(room_m, enough_m) for room_m in (soon_m, later_m, always_m)))
        return room if best is None or room > best else None

    def _places(self, member: Member) -> Iterator[FloatArray]:
        """Yield where a vehicle may wait, each (2,): where it is, else wherever its limits allow."""
        if member.order is None or member.target_m is None:
            return
        here_m = member.place_m(self._live.frame)
        depth_m = member.order.position.depth_m
        constraints, live = self._constraints, self._live
        home_m = home_of(member.spec, member.slot, live.spec, live.team.specs)
        if member.withdrawal is not None and home_m is not None:
            constraints = homeward_ground(constraints, home_m)
        here, target = np.append(here_m, depth_m), np.append(member.target_m, depth_m)
        aside = ways_aside(here, target, constraints, self._leg_commit.bottom, or_nearer=True)
        places_m = [here_m, *aside[:, :2]]
        if self._asides.may_stand_elsewhere(member):
            # For long, maybe: rather where its circles stay inside, but first of all apart from others.
            places_m.sort(key=lambda place_m: not self._has_room(place_m))
        yield from places_m

    def _has_room(self, place_m: FloatArray) -> bool:
        """Whether a vehicle may circle at a place (2,) for long: inside the area, and clear of zones."""
        area, place = shapely.Polygon(self._constraints.area), shapely.Point(place_m)
        inside = area.contains(place) and area.exterior.distance(place) >= CIRCLE_M
        return inside and not self._zones.near(place_m, CIRCLE_M)
