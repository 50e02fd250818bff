"""Sites as they are kept, and which missions are theirs."""

import asyncio
import uuid

import numpy as np
import shapely
from pydantic import ValidationError
from shapely.geometry import Polygon
from sqlalchemy.ext.asyncio import AsyncSession

from app.arrays import FloatArray
from app.mapping.types import SoundingRows
from app.missions.clock import now
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.maps.site_maps import SiteMap, moment
from app.missions.operations.imports.imports import Imports
from app.missions.operations.sites.site_models import SiteModels, stored_site
from app.missions.running.final_maps import FinalMaps
from app.missions.spec.base import FieldError
from app.missions.spec.mission import MissionSpec
from app.missions.spec.site import SiteChanges, SiteSpec, in_frame
from app.missions.states import AT_SEA, ENDED
from app.missions.views.maps.sites import SiteView
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Database
from app.storage.models import MissionRow, SiteRow
from app.storage.queries import sites as site_queries


class Sites:
    """All sites.

    Parameters
    ----------
    database
        Where they are stored; several processes may use them.
    models
        What is known of them.
    maps
        Makes the surveys of missions that ended.
    imports
        Lets a mission begin with a site's depths.
    """

    def __init__(self, database: Database, models: SiteModels, maps: FinalMaps, imports: Imports) -> None:
        self._database = database
        self._models = models
        self._maps = maps
        self._imports = imports

    # Sites

    async def create(self, spec: SiteSpec) -> SiteView:
        """Store a new site."""
        created = now()
        row = SiteRow(
            id=str(uuid.uuid4()),
            name=spec.name,
            spec=spec.model_dump(mode="json"),
            created_at=created,
            updated_at=created,
        )
        async with self._database.writing() as session:
            session.add(row)
        return _view(row, (0, 0, None))

    async def all(self) -> list[SiteView]:
        """Return every site, newest first."""
        async with self._database.reading() as session:
            rows = await site_queries.all_sites(session)
            numbers = await site_queries.numbers(session)
        return [_view(row, numbers.get(row.id, (0, 0, None))) for row in rows]

    async def view(self, site_id: str) -> SiteView:
        """Return a site. Raises SiteNotFoundError."""
        async with self._database.reading() as session:
            row = await stored_site(session, site_id)
            numbers = await site_queries.numbers(session)
        return _view(row, numbers.get(site_id, (0, 0, None)))

    async def change(self, site_id: str, changes: SiteChanges) -> SiteView:
        """Change what is given of a site. Raises SiteNotFoundError, InvalidRequestError."""
        async with self._database.writing() as session:
            row = await stored_site(session, site_id)
            given = changes.model_dump(mode="json", exclude_none=True)
            try:
                spec = await asyncio.to_thread(SiteSpec.model_validate, row.spec | given)
            except ValidationError as error:
                raise _field_problem(error, next(iter(given), "area")) from None
            if changes.area is not None:
                await _check_missions(session, site_id, spec)
            row.name, row.spec, row.updated_at = spec.name, spec.model_dump(mode="json"), now()
        return await self.view(site_id)

    async def delete(self, site_id: str) -> None:
        """Remove a site that has neither missions nor surveys. Raises SiteNotFoundError, ConflictError."""
        async with self._database.writing() as session:
            row = await stored_site(session, site_id)
            missions, surveys, _ = (await site_queries.numbers(session)).get(site_id, (0, 0, None))
            if missions or surveys:
                raise ConflictError(
                    f"the site has {missions} missions and {surveys} surveys: what was measured is kept",
                    "take its missions out first: PUT /api/v1/missions/{id}/site",
                )
            await session.delete(row)

    # Missions of a site

    async def check(self, spec: MissionSpec) -> None:
        """Refuse a mission of a site that is not there or elsewhere. Raises InvalidRequestError."""
        if spec.site is not None:
            await self._check_place(spec, spec.site)

    async def _check_place(self, spec: MissionSpec, site_id: str) -> None:
        async with self._database.reading() as session:
            row = await session.get(SiteRow, site_id)
        if row is None:
            raise InvalidRequestError("site", f"there is no site {site_id!r}", "GET /api/v1/sites lists them")
        site = await asyncio.to_thread(SiteSpec.model_validate, row.spec)
        if not _meet(site, spec):
            raise InvalidRequestError(
                "area", f"it lies outside of the site {row.name!r}", "give an area of the site, or another site"
            )

    async def join(self, live: LiveMission, site_id: str | None, actor: str) -> None:
        """Put a mission into a site, or into none; what it found goes with it.

        Raises
        ------
        InvalidRequestError, ConflictError
            When there is no such site or it lies elsewhere; when vehicles are at sea.
        """
        if live.header.state in AT_SEA:
            raise ConflictError(
                f"the mission is {live.header.state}", "put it into a site before it starts or when it ended"
            )
        if live.spec.search is not None:
            raise ConflictError("the mission is a search: only surveys find depths", "put surveys into sites")
        if site_id is not None:
            await self._check_place(live.spec, site_id)
        await to_the_end(self._join(live, site_id))
        words = "taken out of its site" if site_id is None else f"put into site {site_id}"
        await live.journal.log(Level.INFO, "site", f"{words} by {actor}", actor=actor)
        if live.header.state not in ENDED:
            await self.begin(live)
        self._maps.survey(live)

    async def _join(self, live: LiveMission, site_id: str | None) -> None:
        async with live.correcting, live.journal.writing:
            async with live.database.writing() as session:
                if site_id is not None and not await site_queries.hold(session, site_id):
                    raise InvalidRequestError("site", f"there is no site {site_id!r}", "GET /api/v1/sites lists them")
                await site_queries.set_site(session, live.id, site_id)
                mission = await session.get_one(MissionRow, live.id)
                mission.spec = mission.spec | {"site": site_id}
            live.spec = live.spec.model_copy(update={"site": site_id})

    async def begin(self, live: LiveMission) -> None:
        """Let a mission that did not start yet begin with what its site knows now, in place of what it knew before."""
        spec = live.spec
        site = await self._models.newest(spec.site) if spec.site is not None and spec.site_prior else None
        rows = np.zeros((0, 4)) if site is None else await live.in_background(_prior, site, live)
        if site is None or not len(rows):
            await self._imports.begin_with(live, None)
            return
        newest = site.surveys[-1]
        notes = [f"standard deviations as of {moment(site.model.at_s):%Y-%m-%d}, grown with the age of surveys"]
        own = live.facts.vertical_datum
        if site.datum.epsg != own.epsg:
            notes.append(
                f"the site's depths are below another datum ({site.datum.statement}) than the mission's "
                f"({own.statement}), and differ by that: correct the mission to one datum by its tide"
            )
        described = {
            "site": site.facts.id,
            "source": f"site {site.facts.name}, {len(site.surveys)} surveys, newest {newest.name}",
            "notes": notes,
        }
        await self._imports.begin_with(live, rows, described)
        for note in notes[1:]:
            await live.journal.log(Level.WARNING, "site", note)


def _field_problem(error: ValidationError, otherwise: str) -> InvalidRequestError:
    """Return what is wrong with a site that is to be changed; of one field ``otherwise``."""
    first = error.errors(include_url=False)[0]
    reason = first.get("ctx", {}).get("error")
    if isinstance(reason, FieldError):
        words, _, advice = str(reason).rpartition(": ")
        return InvalidRequestError(reason.field, words, advice)
    field = ".".join(str(part) for part in first["loc"]) or otherwise
    words = first["msg"].removeprefix("Value error, ")
    return InvalidRequestError(field, words, "change the area or the cell, or both together")


async def _check_missions(session: AsyncSession, site_id: str, site: SiteSpec) -> None:
    """Refuse an area that has no ground in common with a mission of the site. Raises InvalidRequestError."""
    for mission in await site_queries.missions_of(session, site_id):
        row = await session.get_one(MissionRow, mission.id)
        if not _meet(site, MissionSpec.model_validate(row.spec)):
            raise InvalidRequestError(
                "area",
                f"mission {mission.name!r} ({mission.id}) of the site lies outside of it",
                "give an area that has ground in common with each, or take the mission out first: "
                "PUT /api/v1/missions/{id}/site",
            )


def _meet(site: SiteSpec, spec: MissionSpec) -> bool:
    """Tell whether a mission's area and a site's have ground in common."""
    try:
        area = in_frame(spec.area, site.frame())
    except ValueError:
        return False
    return Polygon(area).intersection(Polygon(site.local_area())).area > 0.0


def _prior(site: SiteMap, live: LiveMission) -> SoundingRows:
    """Return what a site knows in or near a mission's area as soundings in the mission's frame, (n, 4)."""
    model = site.model
    row, col = np.nonzero(model.known)
    east, north = model.grid.east_m[col], model.grid.north_m[row]
    try:
        at = live.frame.to_local(*site.facts.frame.to_geographic(east, north))
    except ValueError:
        return np.zeros((0, 4))
    zone = Polygon(live.area).buffer(live.margin_m)
    shapely.prepare(zone)
    near = shapely.contains_xy(zone, *at)
    rows: FloatArray = np.column_stack([*at, model.depth_m[row, col], model.sd_m[row, col]])[near]
    return rows


def _view(row: SiteRow, numbers: tuple[int, int, float | None]) -> SiteView:
    missions, surveys, last_s = numbers
    return SiteView(
        **row.spec,
        id=row.id,
        created_at=row.created_at,
        updated_at=row.updated_at,
        missions=missions,
        surveys=surveys,
        last_survey_at=None if last_s is None else moment(last_s),
    )
