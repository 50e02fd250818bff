"""Waits for what the vehicles of a running mission tell."""

import asyncio
from collections.abc import Callable

from app.missions.live.mission import LiveMission
from app.missions.views.mission import Level


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
        live, team = self._live, self._live.team
        if patient_s is not None:
            deadline_s = asyncio.get_running_loop().time() + patient_s
            if await self.until(lambda: bool(team.present) and all(m.present for m in team), deadline_s):
                return
        if team.present:
            return
        absent = [member.name for member in team]
        message = (
            "no vehicle can be sent anywhere; waiting for one" if absent else "every vehicle left; add one to go on"
        )
        await live.journal.log(Level.ALARM, "waiting", message, vehicles=absent)
        await self.until(lambda: bool(team.present), None)
