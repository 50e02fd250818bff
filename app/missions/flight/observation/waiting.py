"""Waits for what the vehicles of a running mission tell."""

import asyncio
from collections.abc import Callable

from app.missions.alarm_kinds import AlarmKind
from app.missions.live.mission import LiveMission

LOOK_S = 1.0
"""How often is looked how each vehicle is, seconds of the vehicles' time."""

LEAST_LOOK_S = 0.1
"""No more often by the wall clock, however fast vehicles live."""


class Waiting:
    """Waits on behalf of one running mission."""

    def __init__(self, live: LiveMission) -> None:
        self._live = live

    async def until(self, condition: Callable[[], bool], deadline_s: float | None) -> bool:
        """Wait until ``condition`` holds; False when the event loop's time reached the deadline first."""
        changed = self._live.changed
        try:
            async with asyncio.timeout_at(deadline_s):
                while not condition():
                    changed.clear()
                    await changed.wait()
        except TimeoutError:
            return condition()
        return True

    async def for_team(self, patient_s: float | None = None) -> None:
        """Wait until a vehicle can be planned for; where ``patient_s`` is given so long, first, for all of them."""
        team = self._live.team
        if patient_s is not None:
            deadline_s = asyncio.get_running_loop().time() + patient_s
            if await self.until(lambda: self._nobody_surveys or self._all_controllable, deadline_s):
                return await self._note_over()
        if not team.plannable and not self._nobody_surveys:
            await self._for_anybody()
        return await self._note_over()

    async def for_batteries(self, left: str) -> None:
        """Wait until one that is home for another battery is resumed, or nobody is waited for any more.

        ``left``: how much of the mission is left, as words after others.
        """
        live, team = self._live, self._live.team

        def home() -> bool:
            return all(member.withdrawal is not None and member.withdrawal.over for member in team)

        await self.until(lambda: not live.awaits_batteries or home(), None)
        if live.awaits_batteries:
            if not live.journal.alarms.standing([AlarmKind.NO_VEHICLE]):
                message = f"every vehicle is home{left}: resume who has another battery, or finish the mission"
                await live.journal.alarm(AlarmKind.NO_VEHICLE, message, vehicles=[member.name for member in team])
            await self.until(lambda: not live.awaits_batteries, None)
        await self._note_over()

    async def _for_anybody(self) -> None:
        live, team = self._live, self._live.team
        absent = [member.name for member in team]
        message = (
            "no vehicle can be sent anywhere; waiting for one" if absent else "every vehicle left; add one to go on"
        )
        if not live.journal.alarms.standing([AlarmKind.NO_VEHICLE]):
            await live.journal.alarm(AlarmKind.NO_VEHICLE, message, vehicles=absent)
        await self.until(lambda: bool(team.plannable) or self._nobody_surveys, None)

    async def _note_over(self) -> None:
        """End the alarm that nobody can be sent, whoever raised it: the mission may have been paused meanwhile."""
        alarms = self._live.journal.alarms
        if alarms.standing([AlarmKind.NO_VEHICLE]):
            await self._live.journal.end([AlarmKind.NO_VEHICLE], "a vehicle can be sent again")

    @property
    def _all_controllable(self) -> bool:
        team = self._live.team
        return bool(team.plannable) and all(member.controllable for member in team.surveying)

    @property
    def _nobody_surveys(self) -> bool:
        """Whether there are vehicles, and all of them are on their way home or out of action."""
        team = self._live.team
        return bool(list(team)) and not team.surveying


async def until_next_look(time_scale: float) -> None:
    """Wait until it is time to look at every vehicle again."""
    await asyncio.sleep(max(LOOK_S / time_scale, LEAST_LOOK_S))
