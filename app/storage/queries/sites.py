"""Queries on sites, their missions and what these found."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from sqlalchemy import delete, func, select, update
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import defer

from app.storage.models import MissionRow, SiteMissionRow, SiteRow, SiteSurveyRow
from app.storage.queries import events as event_queries
from app.storage.queries import pings as ping_queries
from app.storage.queries import stored_maps


class Marks(NamedTuple):
    """The newest of everything that a mission's survey is made of."""

    last_sounding: int
    last_import: int
    last_block: int


class SiteMission(NamedTuple):
    """A mission of a site as it is stored, whoever has it."""

    id: str
    name: str
    state: str


async def all_sites(session: AsyncSession) -> Sequence[SiteRow]:
    """Return every site, newest first."""
    return (await session.scalars(select(SiteRow).order_by(SiteRow.created_at.desc(), SiteRow.id))).all()


async def numbers(session: AsyncSession) -> dict[str, tuple[int, int, float | None]]:
    """Return by site how many missions and how many surveys it has, and when its newest survey ended."""
    missions = select(SiteMissionRow.site_id, func.count()).group_by(SiteMissionRow.site_id)
    surveys = select(SiteSurveyRow.site_id, func.count(), func.max(SiteSurveyRow.last_time_s))
    found = {site: (count, 0, None) for site, count in await session.execute(missions)}
    result: dict[str, tuple[int, int, float | None]] = dict(found)
    for site, count, last_s in await session.execute(surveys.group_by(SiteSurveyRow.site_id)):
        result[site] = (result.get(site, (0, 0, None))[0], count, last_s)
    return result


async def hold(session: AsyncSession, site_id: str) -> bool:
    """Tell whether there is such a site, which is not removed until the transaction ends."""
    query = select(SiteRow.id).where(SiteRow.id == site_id).with_for_update(key_share=True)
    return await session.scalar(query) is not None


async def missions_of(session: AsyncSession, site_id: str) -> list[SiteMission]:
    """Return a site's missions, oldest first."""
    query = (
        select(MissionRow.id, MissionRow.name, MissionRow.state)
        .join(SiteMissionRow, SiteMissionRow.mission_id == MissionRow.id)
        .where(SiteMissionRow.site_id == site_id)
        .order_by(MissionRow.created_at, MissionRow.id)
    )
    return [SiteMission(*row) for row in await session.execute(query)]


async def set_site(session: AsyncSession, mission_id: str, site_id: str | None) -> None:
    """Put a mission into a site, out of any other one; None: into none."""
    await session.execute(delete(SiteMissionRow).where(SiteMissionRow.mission_id == mission_id))
    if site_id is None:
        await session.execute(delete(SiteSurveyRow).where(SiteSurveyRow.mission_id == mission_id))
        return
    session.add(SiteMissionRow(mission_id=mission_id, site_id=site_id))
    await session.execute(update(SiteSurveyRow).where(SiteSurveyRow.mission_id == mission_id).values(site_id=site_id))


async def surveys_of(session: AsyncSession, site_id: str) -> Sequence[SiteSurveyRow]:
    """Return a site's surveys by their time, without their content."""
    query = select(SiteSurveyRow).where(SiteSurveyRow.site_id == site_id).options(defer(SiteSurveyRow.content))
    return (await session.scalars(query.order_by(SiteSurveyRow.last_time_s, SiteSurveyRow.mission_id))).all()


async def contents(session: AsyncSession, mission_ids: Sequence[str]) -> dict[str, tuple[str, bytes]]:
    """Return the surveys of missions as they are stored, each with its digest, by mission."""
    query = select(SiteSurveyRow.mission_id, SiteSurveyRow.digest, SiteSurveyRow.content)
    rows = await session.execute(query.where(SiteSurveyRow.mission_id.in_(mission_ids)))
    return {mission: (digest, content) for mission, digest, content in rows}


async def marks(session: AsyncSession, mission_id: str) -> Marks:
    """Return the newest of what a mission has measured."""
    return Marks(
        await stored_maps.newest_sounding(session, mission_id),
        await event_queries.last_event_id(session, mission_id, kind="import"),
        await ping_queries.newest_block(session, mission_id),
    )


async def is_current(session: AsyncSession, mission_id: str) -> bool:
    """Tell whether a mission's survey is stored, and of everything that it has measured; one of nothing need not be."""
    columns = (SiteSurveyRow.last_sounding, SiteSurveyRow.last_import, SiteSurveyRow.last_block)
    row = (await session.execute(select(*columns).where(SiteSurveyRow.mission_id == mission_id))).first()
    newest = await marks(session, mission_id)
    return not (newest.last_sounding or newest.last_block) if row is None else Marks(*row) == newest


async def keep_survey(session: AsyncSession, values: dict[str, Any]) -> None:
    """Store a mission's survey in place of its older one."""
    await session.merge(SiteSurveyRow(**values))


async def forget_survey(session: AsyncSession, mission_id: str) -> None:
    """Drop a mission's survey: what it was made of changes in the same transaction, or it has nothing any more."""
    await session.execute(delete(SiteSurveyRow).where(SiteSurveyRow.mission_id == mission_id))
