"""Sends vehicles the legs that are committed for them, each vehicle on its own time."""

import asyncio
import math
from collections.abc import Iterable

import numpy as np
import structlog

from app.arrays import FloatArray
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import VehicleRefusedError, WaypointOrder, WaypointReport, WaypointStatus
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.stragglers import late_at_s, leg_allowed_s, missed, tell_of
from app.missions.flight.legs.unflown import UnflownLegs
from app.missions.live.mission import LiveMission
from app.missions.task.way import way_m
from app.missions.team import Member
from app.missions.views.mission import Level

HOLD_AFTER_S = 1.0
"""How long a vehicle that has no leg flies straight on, by its clock, before it is sent to circle somewhere."""

MOST_REFUSALS = 5
"""How often a vehicle may refuse the same leg before the next one is tried."""

log = structlog.get_logger(__name__)


class Dispatch:
    """Makes legs ahead orders, sends them, and judges those that take too long.

    Parameters
    ----------
    live, hub
    leg_commit
        Makes a leg an order.
    time_scale
        How much faster than the wall clock the vehicles live.
    persistent
        Whether a vehicle that refuses its leg is sent it again; else the leg is over for it.
    """

    def __init__(
        self, live: LiveMission, hub: FleetHub, leg_commit: LegCommit, time_scale: float, *, persistent: bool
    ) -> None:
        self._persistent = persistent
        self._live = live
        self._hub = hub
        self._leg_commit = leg_commit
        self._time_scale = time_scale
        self._idle_since_s: dict[str, float] = {}
        """Since when vehicles have had nothing to fly, the event loop's time; inf once they hold."""
        self.unflown = UnflownLegs()
        """Legs that vehicles did not fly, until the planner is told."""
        self._refusals: dict[str, int] = {}
        """How often vehicles refused the order that they have."""

    async def keep(self) -> None:
        """Keep every vehicle flying its own legs until cancelled."""
        loop = asyncio.get_running_loop()
        looked_s = loop.time()
        while True:
            await self.begin()
            now_s = loop.time()
            for member in self._live.team:
                if member.ordered and not member.busy:
                    member.leg.began_s = now_s  # it is out of reach
                elif member.left_alone:
                    member.leg.stand_still(now_s - looked_s)
            looked_s = now_s
            under_way = {m.name: late_at_s(m, self._time_scale) for m in self._live.team if m.busy and not m.left_alone}
            late = await self.settle_late()
            holds_s = await self._hold_idle()
            if late or (self._waiting and not self._live.flight.halted):
                continue
            self._live.changed.clear()
            try:
                async with asyncio.timeout_at(min([*under_way.values(), *holds_s], default=None)):
                    await self._live.changed.wait()
            except TimeoutError:
                continue

    async def settle_late(self, of: Iterable[Member] | None = None) -> list[Member]:
        """End the legs that take too long, of some vehicles or of all; returns their vehicles."""
        now_s = asyncio.get_running_loop().time()
        asked = self._live.team if of is None else of
        flying = [member for member in asked if member.busy and not member.left_alone]
        late = [member for member in flying if late_at_s(member, self._time_scale) <= now_s]
        # All at once: while a line of the log is written, others may be sent on to their next legs.
        numbers = [self._settle_missed(member, missed(member.leg.allowed_s)) for member in late]
        for member, number in zip(late, numbers, strict=True):
            message = f"{member.name} did not get to the end of its leg {number}: it goes on with the next"
            await tell_of(self._live, [member], message, number)
        return late

    async def give_up_leg(self, member: Member, why: str) -> None:
        """End the leg that a vehicle flies and cannot end; it goes on with the next."""
        number = self._settle_missed(member, why)
        await tell_of(self._live, [member], f"{member.name} gives its leg {number} up: {why}", number)

    @property
    def _waiting(self) -> bool:
        return any(member.ahead and not member.ordered for member in self._live.team)

    async def _hold_idle(self) -> list[float]:
        """Send vehicles that have flown all their legs to circles; when the next are due, the event loop's time."""
        now_s, due_s = asyncio.get_running_loop().time(), []
        for member in self._live.team:
            flies = member.capabilities.circles_m > 0.0 or member.capabilities.simulated
            idle = flies and member.plannable and member.legs and not member.ordered and not member.ahead
            if not idle or self._live.flight.halted:
                self._idle_since_s.pop(member.name, None)
                continue
            hold_s = self._idle_since_s.setdefault(member.name, now_s) + HOLD_AFTER_S / self._time_scale
            if now_s < hold_s < math.inf:
                due_s.append(hold_s)
            elif hold_s <= now_s:
                self._idle_since_s[member.name] = math.inf
                await self.hold(member)
        return due_s

    async def hold(self, member: Member) -> None:
        """Send a vehicle to where it may circle, inside the area, clear of zones and of the others, if there is room.

        That is no leg: what the vehicle tells of it is of no interest.
        """
        order = self._leg_commit.holding(member)
        if order is not None:
            await self.stay(member, order)

    async def stay(self, member: Member, order: WaypointOrder) -> None:
        """Send a vehicle where it is to stay; that is no leg."""
        if member.capabilities.stays_put:
            return  # it is told when it asks
        try:
            await self._hub.order(member.key, order)
        except VehicleRefusedError as error:
            log.info("a vehicle would not hold", vehicle=member.name, error=str(error))
            return
        east, north = self._live.frame.to_local(order.position.lat_deg, order.position.lon_deg)
        member.wait_at(np.array([float(east), float(north)]))
        self._live.publish_summary()

    async def begin(self) -> None:
        """Send every vehicle that flies nothing its next leg, unless something bars that from where it is now."""
        beginning = []
        for member in self._live.team:
            if self._live.flight.halted or member.ordered or not member.ahead:
                continue
            barred = self._leg_commit.barred(member)
            if barred:
                await self.drop_ahead(member, f"from where it is {barred}")
                continue
            self._leg_commit.begin_next(member)
            member.leg.begin(asyncio.get_running_loop().time(), leg_allowed_s(self._live, member))
            self._refusals.pop(member.name, None)
            if member.engaged:
                beginning.append(self.send(member))
        await asyncio.gather(*beginning)

    async def send(self, member: Member) -> None:
        """Send a vehicle its order; one that refuses is asked to follow anew, and then sent it again."""
        if member.order is None or self._live.flight.halted:
            return
        try:
            await self._hub.order(member.key, member.order)
        except VehicleRefusedError as error:
            member.disengage()
            before = self._refusals.get(member.name, 0)
            self._refusals[member.name] = before + 1
            if not before:
                await self._live.journal.log(Level.WARNING, "vehicle", str(error), vehicle=member.name)
            if not self._persistent or (before + 1 >= MOST_REFUSALS and member.ahead):
                self.settle(member, WaypointStatus.REFUSED, str(error))

    def has_refused(self, member: Member) -> bool:
        """Whether a vehicle refused the order that it has."""
        return member.name in self._refusals

    async def send_anew(self, member: Member) -> None:
        """Send a vehicle its order as if it had never refused it."""
        self._refusals.pop(member.name, None)
        await self.send(member)

    def settle(self, member: Member, status: WaypointStatus, reason: str) -> None:
        """End a vehicle's leg."""
        if member.order is not None:
            report = WaypointReport(member.name, member.order.mission_id, member.order.step, status, reason)
            self._live.receive(report)

    def give_up_legs(self, member: Member, reason: str) -> list[FloatArray]:
        """End the leg that a vehicle flies, and those after it; returns where they were to end, each (2,)."""
        ends = [member.target_m] if member.ordered and member.target_m is not None else []
        if member.ordered:
            with member.counting_no_misses():
                self.settle(member, WaypointStatus.MISSED, reason)
        return self._note_given_up(member, [*ends, *self._spare(member, ends, reason)])

    def leave_line(self, member: Member, reason: str) -> None:
        """End the legs of a vehicle that surveys no more, and note where it left its line."""
        flown = member.legs > 0
        ends_m = self.give_up_legs(member, reason)
        if self._persistent and flown and member.report is not None:
            self.unflown.add_left_line(member.name, member.place_m(self._live.frame), ends_m)
        elif self._persistent and ends_m:
            # Since a restart it was not heard.
            self.unflown.add_left_line(member.name, ends_m[0], ends_m)

    def spare_after(self, member: Member, keep: int, reason: str) -> list[FloatArray]:
        """Take the legs back that a vehicle has not begun, but for the first ``keep``; as by :meth:`give_up_legs`."""
        begin = [member.target_m] if member.ordered and member.target_m is not None else []
        before = [leg.target_m for leg in member.ahead[:keep]][-1:] or begin
        return self._note_given_up(member, self._spare(member, before, reason, keep=keep))

    def _spare(self, member: Member, flown_to_m: list[FloatArray], reason: str, *, keep: int = 0) -> list[FloatArray]:
        """Take the legs back that a vehicle has not begun; returns where they were to end, each (2,).

        ``flown_to_m``: where the leg before them ends, if it has begun one; without one they begin where it is.
        ``keep``: how many of them stay.
        """
        legs = member.ahead[keep:]
        del member.ahead[keep:]
        ends_m = [leg.target_m for leg in legs]
        for leg in legs:
            name, mission, shown = member.name, self._live.id, f"given up: {reason}"
            report = WaypointReport(name, mission, leg.number, WaypointStatus.MISSED, shown, begun=False)
            self._live.journal.waypoint(report)
        if not flown_to_m and member.report is not None:
            flown_to_m = [member.place_m(self._live.frame)]
        if legs and not legs[0].homeward:
            member.committed.spare(len(legs), way_m([*flown_to_m, *ends_m], self._live.spec))
        return ends_m

    def _note_given_up(self, member: Member, ends_m: list[FloatArray]) -> list[FloatArray]:
        if member.asked is not None:
            self.unflown.add_of_order(member.name, ends_m)
        return ends_m

    async def drop_ahead(self, member: Member, reason: str) -> None:
        """Give up the legs that a vehicle has not begun."""
        ends_m = self._spare(member, [], reason)
        if self._persistent and member.asked is None and member.withdrawal is None:
            self.unflown.add_barred(member.name, ends_m)
        self._note_given_up(member, ends_m)
        await self._live.journal.log(
            Level.WARNING,
            "vehicle",
            f"{member.name} does not fly its next leg: {reason}; it gets another one",
            vehicle=member.name,
        )
        self._live.changed.set()

    def _settle_missed(self, member: Member, why: str) -> int:
        """End a vehicle's leg as missed and return its number."""
        number = member.order.step if member.order is not None else member.legs
        if member.target_m is not None:
            self._note_given_up(member, [member.target_m])
        self.settle(member, WaypointStatus.MISSED, why)
        return number
