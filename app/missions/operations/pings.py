"""What a mission has of swath sonars' pings."""

from app.missions.errors import PingsNotFoundError
from app.missions.live.mission import LiveMission
from app.missions.views.measurements.pings import PingPartView, PingsView


async def pings_of(live: LiveMission) -> PingsView:
    """Return which files of pings there are, and what is in none yet."""
    await live.journal.flush()
    files, waiting = await live.pings.contents()
    parts = [
        PingPartView(
            number=row.id,
            vehicle=row.vehicle,
            first_time_s=row.first_time_s,
            last_time_s=row.last_time_s,
            pings=row.pings,
            beams=row.beams,
            rejected=row.rejected,
            size_bytes=row.size,
            sha256=row.digest,
            taken_back=row.log in live.pings.taken_back,
        )
        for row in files
    ]
    parts += [
        PingPartView(
            number=None,
            vehicle=vehicle,
            first_time_s=found.first_time_s,
            last_time_s=found.last_time_s,
            pings=found.pings,
            beams=found.beams,
            rejected=found.rejected,
            size_bytes=None,
            sha256=None,
        )
        for vehicle, found in sorted(waiting.items())
    ]
    counting = [part for part in parts if not part.taken_back]
    return PingsView(
        pings=sum(part.pings for part in counting),
        beams=sum(part.beams for part in counting),
        rejected=sum(part.rejected for part in counting),
        parts=parts,
    )


async def ping_file(live: LiveMission, number: int) -> tuple[str, str, bytes]:
    """Return name, SHA-256 and content of a file of pings. Raises PingsNotFoundError, PingsUnreadableError."""
    found = await live.pings.file(number)
    if found is None:
        raise PingsNotFoundError(
            f"the mission has no file of pings {number}", f"GET /api/v1/missions/{live.id}/pings lists them"
        )
    row, content = found
    return f"{row.vehicle}-{row.id}.parquet", row.digest, content
