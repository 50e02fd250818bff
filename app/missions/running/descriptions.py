"""Missions that are described anew before they start: they keep their id, their place in the list and their log."""

from sqlalchemy import delete, select

from app.missions.clock import now
from app.missions.errors import ConflictError
from app.missions.live.mission import LiveMission
from app.missions.running.team_changes import vehicle_row
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from app.missions.views.mission import Level
from app.storage.models import ImportRow, MissionRow, MissionVehicleRow, ReferenceRow, TideTableRow
from app.storage.queries.sites import set_site

UNBEGUN = (MissionState.DRAFT, MissionState.READY)


async def describe_anew(live: LiveMission, spec: MissionSpec, actor: str) -> None:
    """Store another description of a mission that has not started; what it took of its site goes, too.

    What is in memory is as it was: the caller takes the mission up anew. Raises ConflictError where it started, or was
    given depths, tides or soundings that belong to the description that it has.
    """
    if live.header.state not in UNBEGUN:
        raise ConflictError(
            f"the mission is {live.header.state}: what it is to do stays as it is",
            "copy it: create a new mission with the changed description",
        )
    counts = live.counts
    if counts.accepted + counts.rejected + counts.pings + counts.rejected_pings:
        raise ConflictError("soundings were taken in the mission", "copy it: create a new mission")
    state = MissionState.READY if spec.vehicles else MissionState.DRAFT
    reason = "" if spec.vehicles else "no vehicle yet"
    line = live.journal.line(Level.INFO, "state", f"described anew by {actor}", state=state, actor=actor)
    async with live.database.writing() as session:
        imports = (await session.scalars(select(ImportRow).where(ImportRow.mission_id == live.id))).all()
        given = [row.filename for row in imports if not row.summary.get("site")]
        for kind, what in ((ReferenceRow, "a reference grid"), (TideTableRow, "a tide table")):
            if await session.get(kind, live.id) is not None:
                given.append(what)
        if given:
            raise ConflictError(
                f"the mission was given {', '.join(given)}, for its area as it is",
                "delete that first, or copy the mission",
            )
        for row in imports:
            await session.delete(row)
        stored = await session.get_one(MissionRow, live.id)
        stored.name, stored.state, stored.reason = spec.name, state, reason
        stored.spec, stored.updated_at = spec.model_dump(mode="json", exclude={"steps"}), now()
        await session.execute(delete(MissionVehicleRow).where(MissionVehicleRow.mission_id == live.id))
        session.add_all(vehicle_row(live.id, vehicle, slot) for slot, vehicle in enumerate(spec.vehicles))
        await set_site(session, live.id, spec.site)
        session.add(line)
