"""What has to go on as long as a mission is flown, beside its decisions: failsafes, ways home, keeping apart."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import structlog

from app.missions.alarm_kinds import AlarmKind
from app.missions.live.mission import LiveMission

BEGIN_ANEW_S = 1.0
STEADY_S = 30.0
"""A watch that failed counts as going on when it has not failed for so long."""

log = structlog.get_logger(__name__)


class Watches:
    """Runs watches over a mission that is flown. One that fails begins anew, and is an alarm until it goes on."""

    def __init__(self, live: LiveMission) -> None:
        self._live = live
        self._failing: set[str] = set()

    async def keep(self, name: str, watch: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Run a watch until it ends by itself; ``name``: what it does, as operators read it."""
        while True:
            going = asyncio.create_task(watch(), name=f"{name}, {self._live.id}")
            try:
                if name in self._failing and not (await asyncio.wait([going], timeout=STEADY_S))[0]:
                    await self._goes_on(name)
                await going
                return
            except Exception as error:
                log.exception("a watch over a mission failed and begins anew", watch=name, mission=self._live.id)
                await self._failed(name, error)
            finally:
                going.cancel()
                await asyncio.gather(going, return_exceptions=True)
            await asyncio.sleep(BEGIN_ANEW_S)

    async def _failed(self, name: str, error: Exception) -> None:
        if name not in self._failing:
            self._failing.add(name)
            words = f"{name}: it failed and begins anew: {error or type(error).__name__}"
            await self._live.journal.alarm(AlarmKind.WATCH_FAILED, words, watch=name)

    async def _goes_on(self, name: str) -> None:
        self._failing.discard(name)
        if not self._failing:
            await self._live.journal.end([AlarmKind.WATCH_FAILED], f"{name}: it goes on")
