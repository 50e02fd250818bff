"""Counts the seconds that a mission has run, and notices a wall clock that is set meanwhile."""

import asyncio

from app.missions.clock import now
from app.missions.live.mission import LiveMission
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.queries import missions as mission_queries

PERIOD_S = 5.0
"""How often the seconds are stored: so many are lost at most when the machine fails."""
CLOCK_SET_S = 2.0
"""A wall clock that gained or lost more than this between two looks was set."""


async def keep_time(live: LiveMission) -> None:
    """Store how long the mission has been flown and tell when this machine's clock was set, until cancelled."""
    loop = asyncio.get_running_loop()
    ahead_s = now().timestamp() - loop.time()
    while True:
        await asyncio.sleep(PERIOD_S)
        await to_the_end(save_elapsed(live))
        before_s, ahead_s = ahead_s, now().timestamp() - loop.time()
        await _tell_of_clock(live, ahead_s - before_s)


async def save_elapsed(live: LiveMission) -> None:
    """Store the seconds since the last time; those that cannot be stored count the next time."""
    if not live.running:
        return
    seconds = live.flight.unstored_s
    try:
        async with live.database.writing() as session:
            await mission_queries.add_elapsed(session, live.id, seconds, now())
            await mission_queries.keep_flown(session, live.id, {m.name: m.flown.remember() for m in live.team})
    except Exception as error:
        live.journal.storage.note(error)
        return
    live.count_elapsed(seconds)


async def _tell_of_clock(live: LiveMission, by_s: float) -> None:
    """Say that the wall clock was set; nothing that moves vehicles depends on it."""
    if abs(by_s) < CLOCK_SET_S:
        return
    message = (
        f"this machine's clock was set {'forward' if by_s > 0 else 'back'} by {abs(by_s):.0f} s: times in the log, "
        "and the water level that a tide table gives for now, follow it. See that it is right"
    )
    await live.journal.log(Level.WARNING, "clock", message, seconds=round(by_s))
