"""Leads vehicles aside from their legs for a while, and on again."""

import asyncio
import math
from dataclasses import dataclass
from enum import StrEnum

from app.arrays import FloatArray
from app.missions.fleet.interface import WaypointOrder, WaypointStatus
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.live.mission import LiveMission
from app.missions.spec.vehicle import Guidance
from app.missions.task.way import STILL_M
from app.missions.team import Member

HORIZON_S = 20.0
"""How far ahead vehicles' ways are looked at, seconds of their time."""
MOST_ASIDES = 3
"""So often a vehicle lets others pass without losing time for its leg: one that stays in its way never passes."""


class Because(StrEnum):
    """Why a vehicle is led aside."""

    VEHICLE = "another vehicle is about to pass"
    ZONE = "it would turn into a keep-out zone"


@dataclass
class Aside:
    """A vehicle that is led aside."""

    because: Because
    order: WaypointOrder
    """What it goes on with."""
    since_s: float
    """The event loop's time."""


class Asides:
    """The vehicles of one running mission that are led aside: each for one reason at a time."""

    def __init__(self, live: LiveMission, leg_commit: LegCommit, dispatch: Dispatch) -> None:
        self._live = live
        self._leg_commit = leg_commit
        self._dispatch = dispatch
        self._led: dict[str, Aside] = {}

    def of(self, because: Because) -> dict[str, Aside]:
        """Return who is led aside for a reason, by name; those who were led elsewhere since are forgotten."""
        self._led = {name: aside for name, aside in self._led.items() if self._lasts(name, aside)}
        return {name: aside for name, aside in self._led.items() if aside.because is because}

    def may_lead(self, member: Member, because: Because) -> bool:
        """Whether a vehicle that has a leg can be led aside by orders that it gets at once."""
        led = self._now(member.name)
        return _follows(member) and member.busy and (led is None or led.because is because)

    def may_stand_elsewhere(self, member: Member) -> bool:
        """Whether a vehicle has flown what it was given and only waits, for others or for its next leg."""
        waits = member.order is not None and member.status is WaypointStatus.REACHED and not member.ahead
        wanted = member.withdrawal is not None or member.asked is not None or member.pursuing is not None
        return _follows(member) and waits and not wanted and not member.surfacing

    def is_clear(self, member: Member, place_m: FloatArray) -> bool:
        """Whether a vehicle may go aside to a place (2,): in a search not close to what stands or nobody looked at."""
        search, here_m = self._live.search, member.place_m(self._live.frame)
        return search is None or math.dist(here_m, place_m) < STILL_M or search.clear(here_m, place_m)

    async def stand(self, member: Member, place_m: FloatArray) -> bool:
        """Send a vehicle that only waits to another place (2,), and have it wait there; whether it takes this order.

        No for one that was sent elsewhere already since it has flown its leg.
        """
        order = self._leg_commit.waiting_at(member, place_m)
        if order is None:
            return False
        begins = member.waits_m is None
        await self._dispatch.stay(member, order)
        return begins and member.waits_m is not None

    async def lead(self, member: Member, place_m: FloatArray, because: Because) -> bool:
        """Lead a vehicle to a place (2,) where it stays; whether it flew its leg until now, and takes this order."""
        order = self._leg_commit.waiting_at(member, place_m)
        if order is None or member.order is None:
            return False
        begins = self._now(member.name) is None
        if begins:
            self._led[member.name] = Aside(because, member.order, asyncio.get_running_loop().time())
        await self._dispatch.stay(member, order)
        if member.waits_m is None:
            self._led.pop(member.name, None)  # it refused
        elif begins and because is Because.VEHICLE:
            member.step_aside(MOST_ASIDES)
        return begins and member.waits_m is not None

    async def lead_on(self, member: Member) -> None:
        """Have a vehicle go on with its leg."""
        aside = self._now(member.name)
        if aside is None:
            return
        del self._led[member.name]
        if aside.because is not Because.VEHICLE or member.lets_pass:
            member.leg.stand_still(asyncio.get_running_loop().time() - aside.since_s)
        member.go_on()
        await self._dispatch.send(member)
        self._live.changed.set()  # its time for the leg goes on

    async def give_up(self, member: Member, why: str) -> None:
        """End the leg of a vehicle that being led aside does not help."""
        self._led.pop(member.name, None)
        await self._dispatch.give_up_leg(member, why)

    def _now(self, name: str) -> Aside | None:
        """Return what a vehicle is led aside from now: it may have got another order while others were looked at."""
        aside = self._led.get(name)
        return aside if aside is not None and self._lasts(name, aside) else None

    def _lasts(self, name: str, aside: Aside) -> bool:
        member = self._live.team.get(name)
        return member is not None and member.ordered and member.order is aside.order and member.waits_m is not None


def _follows(member: Member) -> bool:
    """Whether a vehicle can be led by orders that it gets at once."""
    waits = member.capabilities.circles_m > 0.0 or member.capabilities.simulated
    # Orders by sound, and plans, take longer than there is.
    return waits and member.spec.guidance is Guidance.FOLLOW and member.controllable


def depth_now_m(member: Member) -> float:
    """Return how deep a vehicle is, as far as it told."""
    return 0.0 if member.report is None else member.report.position.depth_m
