"""Missions that nobody flew are deleted; what was measured is kept."""

from sqlalchemy import delete

from app.missions.errors import ConflictError
from app.missions.live.mission import LiveMission
from app.missions.running.ownership import AT_SEA
from app.storage.models import MissionRow


def check_deletable(live: LiveMission) -> None:
    """Refuse to delete a mission that is at sea, or in which anything was decided or measured. Raises ConflictError."""
    if live.header.state in AT_SEA:
        raise ConflictError(f"the mission is {live.header.state}", "finish or abort it first")
    measured = live.journal.counts.accepted + live.journal.counts.rejected
    if live.header.step or measured:
        raise ConflictError(
            f"the mission took {live.header.step} steps and has {measured} soundings: what was measured is kept",
            "leave it in the list; only missions in which nothing was measured can be deleted",
        )


async def delete_mission(live: LiveMission) -> None:
    """Remove a mission with everything that belongs to it, from the database."""
    async with live.database.writing() as session:
        await session.execute(delete(MissionRow).where(MissionRow.id == live.id))
