"""Keeps a mission's vehicles following: who does not is asked, and asked again, for as long as the mission runs."""

import asyncio
import re
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial

import structlog

from app.missions.alarm_kinds import AlarmKind
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import LinkState, VehicleInfo, VehicleRefusedError
from app.missions.live.mission import LiveMission
from app.missions.live.watchers.vehicles import near_report
from app.missions.spec.failsafes import Response
from app.missions.team import OUT_OF_REACH, Member
from app.missions.views.mission import Level

PERIOD_S = 2.0
"""How often is looked who does not follow, and the shortest wait after a refusal (of the vehicles' clock)."""
LONGEST_WAIT_S = 60.0
"""Waits double from one refusal to the next up to this; any change of the vehicle's link begins them anew."""

log = structlog.get_logger(__name__)


@dataclass(slots=True)
class _Refused:
    """When and how a vehicle refused last."""

    at_s: float
    wait_s: float
    link: LinkState


class Engagement:
    """Asks every vehicle that does not follow us to do so, each on its own and without ever giving up.

    Nothing that a link answers is the last word: radio comes back, a busy machine catches up, a fault is cleared.
    Whether a vehicle that someone took away may be asked at all is the link's to say, by refusing.

    Parameters
    ----------
    live, hub
    time_scale
        How much faster than the wall clock the vehicles live.
    send
        Sends a vehicle that came back to where it was under way to.
    """

    def __init__(
        self, live: LiveMission, hub: FleetHub, time_scale: float, send: Callable[[Member], Awaitable[None]]
    ) -> None:
        self._live = live
        self._hub = hub
        self._time_scale = time_scale
        self._send = send
        self._asking: dict[str, asyncio.Task[None]] = {}
        self._refused: dict[str, _Refused] = {}
        standing = live.journal.alarms.standing([AlarmKind.VEHICLE_LOST])
        self._lost = {vehicle for _, vehicle in standing if vehicle is not None}
        self._advised: set[str] = set()
        self._machine_advised = False

    async def keep(self) -> None:
        """Engage every vehicle that should follow and does not, until cancelled."""
        try:
            while True:
                await self._look()
                await asyncio.sleep(PERIOD_S / self._time_scale)
        finally:
            for task in self._asking.values():
                task.cancel()
            await asyncio.gather(*self._asking.values(), return_exceptions=True)

    async def _look(self) -> None:
        for member in self._live.team:
            info = self._hub.info(member.key)
            member.note_link(info.state)
            if member.withdrawal is None or not member.withdrawal.over:
                await self._tell_of_loss(member, info)
            await self._advise(member, info)
            if member.report is None:
                member.report = near_report(self._live.frame, info.report)
            if member.engaged and member.unsent and member.busy:
                # It was out of reach when its waypoint was to be sent.
                await self._send(member)
            is_out = member.withdrawal is not None and member.withdrawal.over
            if info.goes_home:
                # To engage it ends that: then it is led home from here.
                self._live.withdraw(member, Response.RETURN, "it heard nobody and went home by itself")
            if not member.engaged and not is_out and member.name not in self._asking and self._due(member):
                task = asyncio.create_task(self._ask(member))
                self._asking[member.name] = task
                task.add_done_callback(partial(self._done, member.name))

    async def _tell_of_loss(self, member: Member, info: VehicleInfo) -> None:
        """Write down when a vehicle that followed gets lost, and when it is back."""
        lost = member.followed and info.state is LinkState.LOST
        if lost == (member.name in self._lost) or (not lost and info.state in OUT_OF_REACH):
            return
        journal = self._live.journal
        if lost:
            self._lost.add(member.name)
            words = f"{member.name} is lost: {info.reason or 'silent'}"
            await journal.alarm(AlarmKind.VEHICLE_LOST, words, vehicle=member.name)
        else:
            self._lost.discard(member.name)
            await journal.end([AlarmKind.VEHICLE_LOST], f"{member.name} is heard again", vehicle=member.name)

    async def _advise(self, member: Member, info: VehicleInfo) -> None:
        if info.advice and member.name not in self._advised:
            self._advised.add(member.name)
            message = f"{member.name}: {info.advice}"
            await self._live.journal.log(Level.WARNING, "vehicle", message, vehicle=member.name)
        if info.machine_advice and not self._machine_advised:
            self._machine_advised = True
            await self._live.journal.log(Level.WARNING, "service", info.machine_advice)

    def _done(self, name: str, _task: asyncio.Task[None]) -> None:
        self._asking.pop(name, None)

    def _due(self, member: Member) -> bool:
        refused = self._refused.get(member.name)
        if refused is None or member.link is not refused.link:
            return True
        return asyncio.get_running_loop().time() - refused.at_s >= refused.wait_s / self._time_scale

    async def _ask(self, member: Member) -> None:
        live = self._live
        if live.flight.halted:
            return
        was_lost = self._hub.info(member.key).state is LinkState.LOST
        try:
            await self._hub.engage(member.key)
        except VehicleRefusedError as error:
            await self._note(member, error)
            if not was_lost and self._hub.info(member.key).state is LinkState.LOST:
                # It fell silent while it was asked, and may follow what it heard.
                member.followed = True
            return
        except Exception:
            log.exception("a vehicle could not be engaged, trying again", vehicle=member.name)
            return
        if live.team.get(member.name) is not member:
            # Taken out while it was asked: its stop may have come before it followed.
            if self._hub.claimed_by(member.key) in (None, live.id):
                await self._hub.stop(member.key)
            return
        self._refused.pop(member.name, None)
        info = self._hub.info(member.key)
        member.follow(info.state)
        member.report = near_report(live.frame, info.report) or member.report
        kinds = [AlarmKind.VEHICLE_REFUSES, AlarmKind.VEHICLE_RESTARTED]
        await live.journal.end(kinds, f"{member.name} follows", vehicle=member.name)
        live.changed.set()
        if member.ordered:
            await self._send(member)

    async def _note(self, member: Member, error: VehicleRefusedError) -> None:
        """Remember a refusal; each new reason is told once."""
        live = self._live
        if live.team.get(member.name) is not member:
            return
        link = self._hub.info(member.key).state
        if link is LinkState.UNKNOWN and member.heard_s is not None:
            last = datetime.fromtimestamp(member.heard_s, UTC)
            reason = f"not heard since the service was started, last at {last:%Y-%m-%d %H:%M:%S} UTC"
            error = VehicleRefusedError(member.name, reason, error.remedy)
        before = self._refused.get(member.name)
        wait_s = min(2.0 * before.wait_s, LONGEST_WAIT_S) if before is not None and before.link is link else PERIOD_S
        self._refused[member.name] = _Refused(asyncio.get_running_loop().time(), wait_s, link)
        told, member.refusal = member.refusal, str(error)
        if _without_figures(member.refusal) != _without_figures(told):
            if member.followed:
                await live.journal.alarm(AlarmKind.VEHICLE_REFUSES, str(error), vehicle=member.name)
            else:
                await live.journal.log(Level.WARNING, "vehicle", str(error), vehicle=member.name)


def _without_figures(reason: str) -> str:
    """Seconds of a silence that goes on are no news."""
    return re.sub(r"\d+(\.\d+)?", "", reason)
