"""How lists tell of missions that ended and are in no memory: taking each up for that would take time."""

from collections.abc import Sequence
from contextlib import suppress

import orjson
import structlog
from pydantic import ValidationError
from sqlalchemy.exc import SQLAlchemyError

from app.missions.errors import MissionElsewhereError
from app.missions.live.mission import LiveMission
from app.missions.views.mission import MissionSummary
from app.storage.database import Database
from app.storage.queries import missions as mission_queries

log = structlog.get_logger(__name__)


class EndedMissions:
    """Summaries of missions as they were when they left memory, of this process or another one."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._summaries: dict[str, MissionSummary] = {}

    def __contains__(self, mission_id: str) -> bool:
        return mission_id in self._summaries

    def get(self, mission_id: str) -> MissionSummary | None:
        """Return how a mission was when it left memory; None where that is not known."""
        return self._summaries.get(mission_id)

    async def recall(self, mission_ids: Sequence[str]) -> None:
        """Learn how missions were that left memory in an earlier run, or in another process."""
        unknown = [one for one in mission_ids if one not in self._summaries]
        if not unknown:
            return
        async with self._database.reading() as session:
            stored = await mission_queries.summaries(session, unknown)
        for mission_id, content in stored:
            with suppress(ValidationError):  # another version wrote it: the mission is taken up
                self._summaries[mission_id] = MissionSummary.model_validate(content)

    def note(self, summary: MissionSummary) -> None:
        """Tell of a mission that leaves memory as it is now."""
        self._summaries[summary.id] = summary

    def forget(self, mission_id: str) -> None:
        """Tell nothing more of a mission: it is in memory again, or stored no more."""
        self._summaries.pop(mission_id, None)

    def clear(self) -> None:
        """Tell nothing more of any."""
        self._summaries.clear()


async def store_summary(live: LiveMission, summary: MissionSummary | None) -> None:
    """Write down how lists are to tell of a mission that leaves memory; None: it may change from now on.

    Only lists are slower where that fails: the log says so.
    """
    content = None if summary is None else orjson.loads(summary.model_dump_json(exclude={"allowed_actions"}))
    try:
        async with live.database.writing() as session:
            await mission_queries.keep_summary(session, live.id, content)
    except (SQLAlchemyError, OSError, MissionElsewhereError) as error:
        log.warning("how a mission stands is not written for lists", mission=live.id, error=str(error))
