"""What a mission has stored of soundings."""

from collections.abc import Sequence

from app.missions.live.mission import LiveMission
from app.storage.models import SoundingRow
from app.storage.queries import soundings as sounding_queries

MOST = 10_000_000


async def soundings_of(live: LiveMission) -> Sequence[SoundingRow]:
    """Return every sounding, rejected ones included, in the order they came."""
    await live.journal.flush()
    async with live.database.reading() as session:
        return await sounding_queries.soundings_after(session, live.id, 0, MOST)
