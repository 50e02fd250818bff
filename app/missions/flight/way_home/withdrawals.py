"""Leads vehicles that survey no more: home, up, or to a stop."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import structlog

from app.missions.alarm_kinds import AlarmKind
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import WaypointStatus
from app.missions.flight.decisions.separation import passes_above
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.observation.waiting import until_next_look
from app.missions.flight.way_home.past_berths import way_past_berths
from app.missions.live.mission import LiveMission
from app.missions.live.vehicle_reports import phase_of
from app.missions.live.watchers.vehicles import energy_left_pct
from app.missions.recovery.berths import home_of, is_home, point_of, room_of_m
from app.missions.recovery.failsafes import LINK_LOST_S
from app.missions.recovery.way_home import passed_over
from app.missions.spec.failsafes import Failsafe, Response
from app.missions.team import Member, Withdrawal
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.queries import missions as mission_queries

PATIENCE_S = 0.5
"""How long vehicles wait for the disk."""

RISING_S = 120.0
"""How long a vehicle that is home is waited for to come up, seconds of the vehicles' time."""

PASSING_S = 60.0
"""How long a vehicle waits below for others to pass, seconds of the vehicles' time: less than it has in reserve."""

DEEP_M = 1.0
"""Who is not deeper is at the surface."""


log = structlog.get_logger(__name__)


class Withdrawals:
    """Brings the vehicles of one running mission to where their withdrawals lead, and no vehicle back."""

    def __init__(
        self,
        live: LiveMission,
        hub: FleetHub,
        leg_commit: LegCommit,
        dispatch: Dispatch,
        energy_range: EnergyRange,
        time_scale: float,
    ) -> None:
        self._live = live
        self._hub = hub
        self._leg_commit = leg_commit
        self._dispatch = dispatch
        self._range = energy_range
        self._time_scale = time_scale
        self._stranded: set[str] = set()
        self._lay: dict[str, frozenset[str]] = {}
        """Who lay at rest when each vehicle was led home: its way leads past those."""
        self._held: set[str] = set()
        """Vehicles that were told to wait where they are since they can be reached."""
        self._ending: set[str] = set()
        """Vehicles that are just being stopped where they were to go."""
        self._below_since_s: dict[str, float] = {}
        """Since when others of the team have passed above vehicles on their way home, the event loop's time."""
        self._rising_since_s: dict[str, float] = {}
        """Since when vehicles have been sent up at home, the event loop's time."""
        for member in live.team:
            if member.withdrawal is not None:
                member.withdrawal.led = False

    async def keep(self) -> None:
        """Lead every vehicle that was called home or aside, until cancelled."""
        while True:
            await self.look()
            await self._dispatch.settle_late([m for m in self._live.team if m.withdrawal is not None])
            await until_next_look(self._time_scale)

    async def look(self) -> None:
        """Lead each of them once."""
        for member in self._live.team:
            if member.withdrawal is not None and not member.withdrawal.over and not self._live.flight.halted:
                try:
                    await self._lead(member, member.withdrawal)
                except Exception:
                    # Whatever keeps one from being led now keeps nobody else, and is tried again.
                    log.exception("a vehicle could not be led", vehicle=member.name)

    async def finished(self, leaves_off: Callable[[], bool]) -> bool:
        """Wait until every vehicle that was called home is there, or is out of reach for long.

        False as soon as ``leaves_off`` holds.
        """
        silent_since_s: dict[str, float] = {}
        while True:
            if leaves_off():
                return False
            now_s = asyncio.get_running_loop().time()
            away = [m for m in self._live.team if m.withdrawal is not None and not self._is_done(m)]
            silent_since_s = {m.name: silent_since_s.get(m.name, now_s) for m in away if not m.controllable}
            lost = [m for m in away if now_s - silent_since_s.get(m.name, now_s) >= LINK_LOST_S / self._time_scale]
            if len(lost) == len(away):
                for member in lost:
                    words = f"{member.name} did not come home: it cannot be reached"
                    await self._live.journal.alarm(AlarmKind.NOT_COME_HOME, words, vehicle=member.name)
                return not leaves_off()
            await until_next_look(self._time_scale)

    def _is_done(self, member: Member) -> bool:
        withdrawal = member.withdrawal
        if member.name in self._ending:
            return False
        return withdrawal is None or withdrawal.over or withdrawal.response is Response.HOLD

    async def _lead(self, member: Member, withdrawal: Withdrawal) -> None:
        if not withdrawal.led:
            await self._begin(member, withdrawal)
        if withdrawal.response is Response.STOP:
            await self._end(member, withdrawal, f"{member.name} is stopped")
        elif withdrawal.response is Response.HOLD:
            await self._hold(member)
        elif withdrawal.response is Response.RETURN and (why := self._barred(member)):
            self._dispatch.give_up_legs(member, why)
            await self._go_home(member, withdrawal)
        elif not member.controllable or await self._waits_below(member, withdrawal) or member.ordered:
            return
        elif member.ahead:
            await self._dispatch.begin()
        elif withdrawal.response is Response.SURFACE:
            await self._surface(member, withdrawal)
        else:
            await self._go_home(member, withdrawal)

    async def _waits_below(self, member: Member, withdrawal: Withdrawal) -> bool:
        """Whether a vehicle on its way home stays below for others to pass where it would come up now."""
        rises = member.ordered and member.order is not None and member.order.position.depth_m <= DEEP_M
        will_rise = not member.ordered and bool(member.ahead) and member.ahead[0].position.depth_m <= DEEP_M
        others = ""
        if any(one.failsafe is Failsafe.TRAFFIC and one.response is not Response.WARN for one in member.failsafes):
            others = "ships"
        elif withdrawal.below or rises or will_rise:
            others = self._passes_above(member)
        if not others or withdrawal.response is not Response.RETURN or self._at_surface(member):
            withdrawal.below = False
            return False
        if withdrawal.below:
            return True
        if not rises and not will_rise:
            return False
        withdrawal.below = True
        order = self._leg_commit.waiting_below(member)
        if rises:
            self._dispatch.settle(member, WaypointStatus.MISSED, f"{others} would be in its way")
        if order is not None:
            await self._dispatch.stay(member, order)
        words = f"{member.name} waits below for {others} to pass"
        await self._live.journal.log(Level.INFO, "recovery", words, vehicle=member.name)
        return True

    def _barred(self, member: Member) -> str:
        """Return why a vehicle gets another way home than the one it flies; '' where it may go on."""
        search = self._live.search
        if search is not None and member.controllable and member.ordered and member.target_m is not None:
            here_m = member.place_m(self._live.frame)
            away_m = math.dist(here_m, member.target_m)
            if away_m > self._live.spec.arrival_radius_m and not search.clear(here_m, member.target_m):
                return "something was seen on its way home"
        other = self._lies_on_its_way(member)
        return f"{other} lies on its way home" if other else ""

    def _lies_on_its_way(self, member: Member) -> str:
        """Return who came to lie on a vehicle's way home since it was led there; '' where nobody did."""
        limits, known = self._live.spec.limits, self._lay.get(member.name, frozenset())
        if not member.controllable or not member.ordered or member.order is None or member.target_m is None:
            return ""
        way_m = np.array([member.target_m, *(leg.target_m for leg in member.ahead)])
        depths_m = [member.order.position.depth_m, *(leg.position.depth_m for leg in member.ahead)]
        least_m, above_m = limits.min_separation_m, limits.min_vertical_separation_m
        here_m = member.place_m(self._live.frame)
        for other in self._live.team.at_rest:
            place_m = other.place_m(self._live.frame)
            if other.name not in known and passed_over(here_m, way_m, depths_m, place_m, least_m, above_m):
                return other.name
        return ""

    def _passes_above(self, member: Member) -> str:
        """Return which vehicle passes where this one would come up; '' where none does, or it has waited for long."""
        other = passes_above(member, self._live, self._live.spec)
        if not other:
            self._below_since_s.pop(member.name, None)
            return ""
        now_s = asyncio.get_running_loop().time()
        waited_s = (now_s - self._below_since_s.setdefault(member.name, now_s)) * self._time_scale
        return other if waited_s < PASSING_S else ""

    async def _begin(self, member: Member, withdrawal: Withdrawal) -> None:
        """Write a withdrawal down and give up the vehicle's legs."""
        withdrawal.led = True
        await self._keep(member, withdrawal)
        if withdrawal.told:
            self._dispatch.give_up_legs(member, withdrawal.why)
        else:
            self._dispatch.leave_line(member, withdrawal.why)
        does = {
            Response.HOLD: "holds",
            Response.RETURN: "goes home",
            Response.SURFACE: "comes up where it is",
            Response.STOP: "is stopped",
        }
        self._held.discard(member.name)
        if withdrawal.told:
            return
        withdrawal.told = True
        words = f"{member.name} {does[withdrawal.response]}: {withdrawal.why}"
        facts = {"response": withdrawal.response, "energy_left_pct": energy_left_pct(member)}
        await self._live.journal.log(Level.INFO, "recovery", words, vehicle=member.name, **facts)

    async def _hold(self, member: Member) -> None:
        """Have a vehicle wait near where it is: once, and again when it was away since, or was stopped."""
        if not member.controllable:
            self._held.discard(member.name)
        elif member.name not in self._held:
            self._held.add(member.name)
            await self._dispatch.hold(member)

    async def _surface(self, member: Member, withdrawal: Withdrawal) -> None:
        if self._at_surface(member) or member.name in self._stranded:
            await self._end(member, withdrawal, f"{member.name} is at the surface")
            return
        self._stranded.add(member.name)
        self._leg_commit.lead_home(member, [(member.place_m(self._live.frame), 0.0)])
        await self._dispatch.begin()

    async def _go_home(self, member: Member, withdrawal: Withdrawal) -> None:
        """Send a vehicle home from where it is, at its depth, and up there."""
        spec = self._live.spec
        recovery = spec.recovery_of(member.spec)
        home_m = home_of(member.spec, member.slot, spec, self._live.team.specs)
        here_m = member.place_m(self._live.frame)
        if recovery is None or home_m is None:
            await self._end(member, withdrawal, f"{member.name} has no recovery point and stops where it is")
            return
        away_m = float(np.hypot(*(home_m - here_m)))
        point_m = point_of(recovery, spec)
        from_point_m = float(np.hypot(*(point_m - here_m)))
        room_m, search = room_of_m(member.spec, spec), self._live.search
        near = is_home(here_m, home_m, point_m, room_m, recovery.radius_m)
        if search is not None and away_m > room_m:
            near = near and search.clear(here_m, home_m)  # not while something stands between
        if near and (self._at_surface(member) or self._waited_to_rise(member)):
            facts = {"from_point_m": round(from_point_m, 1), "energy_left_pct": energy_left_pct(member)}
            await self._end(member, withdrawal, f"{member.name} is home, {away_m:.0f} m from its place", **facts)
            return
        if near and member.name in self._rising_since_s:
            return
        way = way_past_berths(member, here_m, home_m, self._live, self._range)
        if way is None:
            off = "zones" if self._live.search is None else "what stands there, or nobody has looked at"
            words = f"no way leads home that keeps clear of {off}: it comes up where it is"
            await self._live.journal.alarm(AlarmKind.NO_WAY_HOME, f"{member.name}: {words}", vehicle=member.name)
            self._live.withdraw(member, Response.SURFACE, words)  # it may have been stopped meanwhile
            return
        self._lay[member.name] = frozenset(other.name for other in self._live.team.at_rest)
        # In a search it ends where it leads, which may be beside that place.
        end_m = home_m if search is None else way[-1][0]
        self._leg_commit.lead_home(member, [*way, (end_m, 0.0)])
        await self._dispatch.begin()

    def _waited_to_rise(self, member: Member) -> bool:
        """Whether a vehicle was sent up at home, and had time for that."""
        sent_up = member.order is not None and member.order.position.depth_m <= DEEP_M
        if member.status is not WaypointStatus.REACHED or not sent_up:
            return False
        now_s = asyncio.get_running_loop().time()
        return now_s - self._rising_since_s.setdefault(member.name, now_s) >= RISING_S / self._time_scale

    def _at_surface(self, member: Member) -> bool:
        return member.report is not None and member.report.position.depth_m <= DEEP_M

    async def _end(self, member: Member, withdrawal: Withdrawal, words: str, **facts: Any) -> None:
        """Stop a vehicle that is where it was to go."""
        self._ending.add(member.name)
        withdrawal.over = True
        member.disengage()
        member.drop_legs()
        self._rising_since_s.pop(member.name, None)
        self._stranded.discard(member.name)
        member.flown.phase = phase_of(withdrawal)
        self._live.publish_summary()  # who waits for a waypoint is told to stop
        try:
            stop = await self._hub.stop(member.key)
            await self._keep(member, withdrawal)
            said, facts = f"{words}; {stop.detail}", {"vehicle": member.name} | facts
            if stop.acknowledged:
                await self._live.journal.log(Level.INFO, "recovery", said, **facts)
            else:
                await self._live.journal.alarm(AlarmKind.STOP_NOT_ACKNOWLEDGED, said, event="recovery", **facts)
        finally:
            self._ending.discard(member.name)
        self._live.changed.set()
        self._live.publish_summary()

    async def _keep(self, member: Member, withdrawal: Withdrawal) -> None:
        """Write a withdrawal down; a vehicle waits for that no longer than a moment."""
        written = asyncio.ensure_future(
            self._live.journal.storage.done(lambda: to_the_end(self._store(member.name, withdrawal)))
        )
        await asyncio.wait([written], timeout=PATIENCE_S)

    async def _store(self, name: str, withdrawal: Withdrawal) -> None:
        async with self._live.database.writing() as session:
            await mission_queries.keep_withdrawal(session, self._live.id, name, withdrawal.remember())
