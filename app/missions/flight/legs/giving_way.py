"""Has vehicles give way: of two that are about to pass too close to each other one waits, or goes aside.

Legs are decided so that vehicles stay apart, by when each should be where, or by their depths. Currents, waits and
people change when they are where, and over a shoal bottom vehicles travel less deep than planned. So once more what
counts is where they are, and where they will be in a moment.
"""

import asyncio
import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np
import structlog

from app.missions.fleet.hub import called
from app.missions.flight.legs.asides import Asides, Because
from app.missions.flight.legs.next_moment import CLOSING_M, Imminent, NextMoment, around_m, is_out, moved, nearest_m
from app.missions.flight.legs.other_vehicles import LedVehicles, OtherVehicle, OtherVehicles
from app.missions.flight.legs.room_aside import Apart, RoomAside
from app.missions.flight.observation.waiting import until_next_look
from app.missions.live.mission import LiveMission
from app.missions.team import Member

CLEAR = 1.2
"""A vehicle goes on when it will stay this many times the least separation away."""

PATIENCE_S = 60.0
"""How long it gives way at the most, seconds of its time."""

log = structlog.get_logger(__name__)


class GivingWay:
    """Looks at the vehicles of one running mission, and has one of two give way that would meet.

    Of two missions' vehicles the mission with the lesser id looks at both, and may lead both. Vehicles that no mission
    leads are given way to.

    Parameters
    ----------
    others
        What else there is to meet.
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(
        self,
        live: LiveMission,
        moment: NextMoment,
        room: RoomAside,
        asides: Asides,
        others: OtherVehicles,
        time_scale: float,
    ) -> None:
        self._live = live
        self._moment = moment
        self._asides = asides
        self._others = others
        self._time_scale = time_scale
        self.led = LedVehicles(live, moment, room)

    async def keep(self) -> None:
        """Keep vehicles apart from each other and from other missions', until cancelled."""
        with self._others.flown(self.led):
            while True:
                if not self._live.flight.halted and self._live.spec.limits.min_separation_m > 0.0:
                    await self.look()
                await until_next_look(self._time_scale)

    async def look(self) -> None:
        """Look once which vehicles are about to meet, and let one of them wait."""
        own, about = self._may_meet()
        near = [self._moment.as_led(member) for member in own]
        near += [vehicle.imminent(self._live.frame) for vehicle in about]
        await self._let_go_on(near)
        settled: set[int] = set()
        for one, other in self._meeting(near):
            if not settled & {id(one), id(other)}:
                settled |= {id(one), id(other)}
                await self._keep_apart(one, other, near)

    def _may_meet(self) -> tuple[list[Member], list[OtherVehicle]]:
        """Return the vehicles that are so near another one that they may meet it in a moment: own ones, and others."""
        own = [member for member in self._live.team if is_out(member)]
        about = self._others.about(self._live) if own else []
        if len(own) + len(about) < 2:
            return [], []
        frame, limits = self._live.frame, self._live.spec.limits
        elsewhere = frame.to_local([it.lat_deg for it in about], [it.lon_deg for it in about])
        here_m = np.vstack([[member.place_m(frame) for member in own], np.column_stack(elsewhere)])
        reach_m = np.array([self._moment.reach_m(member) for member in own] + [it.reach_m for it in about])
        apart_m = np.hypot(*(here_m[:, None] - here_m[None]).T)
        near = apart_m < CLEAR * limits.min_separation_m + reach_m[:, None] + reach_m[None]
        np.fill_diagonal(near, val=False)
        meets = near[:, : len(own)].any(axis=1)
        meets[: len(own)] |= near[: len(own)].any(axis=1)
        return (
            [member for member, it_does in zip(own, meets, strict=False) if it_does],
            [vehicle for vehicle, it_does in zip(about, meets[len(own) :], strict=True) if it_does],
        )

    def _meeting(self, near: list[Imminent]) -> Iterator[tuple[Imminent, Imminent]]:
        """Yield pairs that are about to pass too close to each other, and are this mission's to keep apart."""
        for one, other in combinations(near, 2):
            if self._looks_after(one, other) and not _decided_together(one, other):
                # Ways home are not planned apart, and what is known of the current is not exact.
                least_m = self._apart(one, other).enough_m if one.homeward and other.homeward else self._least_m(other)
                if self._too_close(one, other, least_m):
                    yield one, other

    def _looks_after(self, one: Imminent, other: Imminent) -> bool:
        """Whether it is this mission that has one of two vehicles give way; the first of them is always its own."""
        if one.live is not self._live:
            return False
        if other.live is None or other.live is self._live or other.live.spec.limits.min_separation_m <= 0.0:
            return True
        return self._live.id < other.live.id

    def _least_m(self, other: Imminent) -> float:
        """Return how far from another vehicle this mission's are to be: as far as the more careful mission wants it."""
        return max(live.spec.limits.min_separation_m for live in (self._live, other.live or self._live))

    def _apart(self, one: Imminent, other: Imminent) -> Apart:
        """Return how far two vehicles are to be from each other where there is room."""
        limits = [live.spec.limits for live in (one.live, other.live) if live is not None]
        enough_m = CLEAR * max(limit.min_separation_m for limit in limits)
        return Apart(enough_m, max(limit.min_vertical_separation_m for limit in limits))

    def _too_close(self, one: Imminent, other: Imminent, least_m: float) -> bool:
        """Whether two will be closer than that in a moment, and closer than they are now."""
        now_m = math.dist(one.here_m, other.here_m) - around_m(0.0, (one, other))
        return nearest_m(one, other, self._apart(one, other).vertical_m) < min(least_m, now_m - CLOSING_M)

    async def _keep_apart(self, one: Imminent, other: Imminent, near: list[Imminent]) -> None:
        """Have one of two give way, where that keeps it farthest from everybody."""
        apart, best = self._apart(one, other), None
        for led, member, it in self._who_may_give_way(one, other):
            place = led.room.best(
                it, member, self._others_than(it, near, led), apart, None if best is None else best[0]
            )
            if place is not None:
                best = *place, led, member
                if best[0].is_enough(apart.enough_m):
                    break
        if best is not None:
            _, place_m, led, member = best
            passes = other if member is one.member else one
            await led.room.give_way(member, place_m, _words(passes, led.live))

    def _who_may_give_way(self, one: Imminent, other: Imminent) -> Iterator[tuple[LedVehicles, Member, Imminent]]:
        """Yield who only waits, else rather who surveys than who goes home, the last by name, first.

        Each with where it will be in the frame of the mission that leads it.
        """
        may: list[tuple[LedVehicles, Member]] = []
        for it in (one, other):
            led = self._led(it.live)
            if it.member is not None and led is not None and led.room.may_give_way(it.member):
                may.append((led, it.member))
        may.sort(key=lambda who: (who[0].room.only_waits(who[1]), who[1].withdrawal is None, who[1].name), reverse=True)
        for led, member in may:
            yield led, member, led.moment.as_led(member)

    def _led(self, live: LiveMission | None) -> LedVehicles | None:
        """Return what a mission leads its vehicles by; None where nobody does."""
        if live is self._live:
            return self.led
        return None if live is None else self._others.led(live)

    def _others_than(self, it: Imminent, near: list[Imminent], led: LedVehicles) -> list[Imminent]:
        """Return where all but one vehicle will be, in the frame of the mission that leads this one."""
        others = [that for that in near if that.member is None or that.member is not it.member]
        if led.live is self._live:
            return others
        return [moved(that, self._live.frame, led.live.frame) for that in others]

    async def _let_go_on(self, near: list[Imminent]) -> None:
        """Send vehicles on that would stay clear of the others now, or have waited long."""
        now_s = asyncio.get_running_loop().time()
        for name, giving in self._asides.of(Because.VEHICLE).items():
            member = self._live.team.get(name)
            if member is None or not member.controllable:
                continue
            at = next((k for k, that in enumerate(near) if that.member is member), None)
            if at is None:
                await self._asides.lead_on(member)
                continue
            waited_s = now_s - giving.since_s
            on = self._moment.going_on(member)
            others = [that for that in near if that.member is not member and not _decided_together(on, that)]
            clear = not any(self._too_close(on, that, self._apart(on, that).enough_m) for that in others)
            if clear or waited_s * self._time_scale >= PATIENCE_S:
                near[at] = on
                await self._asides.lead_on(member)


def _decided_together(one: Imminent, other: Imminent) -> bool:
    """Whether two search on: their legs are of one step, decided to be apart, and each waits for the other's."""
    return one.live is other.live and one.searches and other.searches


def _words(passes: Imminent, live: LiveMission) -> str:
    """Return what a mission's people are told of the vehicle that is given way to."""
    if passes.live is live:
        return passes.name
    if passes.live is None:
        return f"{passes.name}, which no mission leads"
    return f"{passes.name} of mission {called(passes.live.spec.name, passes.live.id)}"
