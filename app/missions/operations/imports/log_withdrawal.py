"""Taking back a vehicle's own log: what it brought stays stored, and counts no more."""

from app.missions.clock import now
from app.missions.live.mission import LiveMission
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.models import EventRow
from app.storage.queries import logs as log_queries
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import stored_maps

TAKEN_BACK = "taken_back"
"""What a line's data name the number of the log by that it tells is taken back."""


async def take_back_log(live: LiveMission, number: int, actor: str) -> None:
    """Take the soundings, pings and track of a log out of everything; one that was taken back already stays so.

    The map is made anew of what is left when it is next asked for.
    """
    await live.journal.flush()
    async with live.journal.writing:
        line = await to_the_end(_store(live, number, actor))
        # What comes again from here on takes the place of what was taken back.
        live.pings.taken_back |= {number}
    if line is None:
        return
    live.journal.tell(line)
    await live.trails.read_again()
    await live.notice_imports()
    live.changed.set()


async def _store(live: LiveMission, number: int, actor: str) -> EventRow | None:
    async with live.database.writing() as session:
        # Whoever writes some of it waits, and sees then that it is not wanted.
        await sounding_queries.answers_to(session, live.id, ())
        row = await log_queries.numbered(session, live.id, number)
        if row is None or row.taken_back_at is not None:
            return None
        found = await log_queries.take_back(session, row, now(), actor)
        also = f" and {found.pings} pings" if found.pings else ""
        words = f"{found.soundings} soundings{also} from {row.file}, the log of {row.vehicle}, taken back by {actor}"
        if doubles := await log_queries.with_doubles(session, row):
            words += f". What {', '.join(doubles)} had of them, too, is gone with them: take back and send again"
        if live.gate.corrections.adjustment is not None:
            words += ". Tracks stay adjusted as they were with them: adjust them again"
        data = {
            TAKEN_BACK: number,
            "file": row.file,
            "vehicle": row.vehicle,
            "actor": actor,
            "withdrawn": found.soundings,
        }
        line = live.journal.line(Level.INFO, "import", words, **data, withdrawn_pings=found.pings)
        session.add(line)
        await session.flush()
        await stored_maps.forget(session, live.id)
    return line
