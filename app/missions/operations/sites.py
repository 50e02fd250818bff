"""Sites: places that are surveyed again and again, their model, and what changed between surveys."""

import asyncio
import uuid
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
import structlog
from pydantic import ValidationError
from shapely.geometry import Polygon
from sqlalchemy.ext.asyncio import AsyncSession

from app.arrays import FloatArray
from app.mapping.sites import SiteFusion, Survey, compare, resample
from app.mapping.types import SoundingRows
from app.mapping.water.vertical import VerticalDatum
from app.missions.clock import now
from app.missions.errors import (
    ConflictError,
    InvalidRequestError,
    MapNotReadyError,
    MissionElsewhereError,
    MissionError,
    SiteNotFoundError,
)
from app.missions.live.mission import LiveMission
from app.missions.maps.builder import make_grid
from app.missions.maps.site_maps import SiteChange, SiteFacts, SiteMap, Surveyed, moment
from app.missions.maps.survey_codec import unpack_survey
from app.missions.operations.imports.imports import Imports
from app.missions.running.final_maps import FinalMaps
from app.missions.spec.mission import MissionSpec
from app.missions.spec.site import SiteChanges, SiteSpec, in_frame
from app.missions.states import AT_SEA, ENDED
from app.missions.views.maps.sites import SiteView, SurveyView
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Database
from app.storage.models import MissionRow, SiteRow, SiteSurveyRow
from app.storage.queries import sites as site_queries

MOST_REMEMBERED_CELLS = 8_000_000
"""Of the models that are kept in memory."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class _Taken:
    """What became of a survey in its site's model."""

    share_pct: float
    median_sd_m: float | None
    changed_pct: float | None


@dataclass(frozen=True)
class _Fused:
    """A site's surveys together, of any age; ``surveys`` are those that count and ``taken`` what became of each."""

    facts: SiteFacts
    fusion: SiteFusion
    surveys: Sequence[Surveyed]
    taken: dict[str, _Taken]

    @property
    def datum_epsg(self) -> int | None:
        """Return what depths are counted from; None without any."""
        return self.surveys[-1].vertical_datum.epsg if self.surveys else None


class Sites:
    """All sites.

    Parameters
    ----------
    database
        Where they are stored; several processes may use them.
    get
        Returns a mission that this process may have. Raises MissionElsewhereError.
    maps
        Makes what is missing of missions' surveys.
    imports
        Lets a mission begin with a site's depths.
    makes
        Tells whether this process has missions of its own, whose surveys it makes; else it only reads.
    """

    def __init__(
        self,
        database: Database,
        get: Callable[[str], Awaitable[LiveMission]],
        maps: FinalMaps,
        imports: Imports,
        makes: Callable[[], bool],
    ) -> None:
        self._database = database
        self._get = get
        self._maps = maps
        self._imports = imports
        self._makes = makes
        self._fused: OrderedDict[tuple[Any, ...], _Fused] = OrderedDict()
        # One model at a time takes its memory.
        self._fusing = asyncio.Lock()

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
            row = await _row(session, site_id)
            numbers = await site_queries.numbers(session)
        return _view(row, numbers.get(site_id, (0, 0, None)))

    async def change(self, site_id: str, changes: SiteChanges) -> SiteView:
        """Change what is given of a site. Raises SiteNotFoundError, InvalidRequestError."""
        async with self._database.writing() as session:
            row = await _row(session, site_id)
            given = changes.model_dump(mode="json", exclude_none=True)
            try:
                spec = await asyncio.to_thread(SiteSpec.model_validate, row.spec | given)
            except ValidationError as error:
                first = error.errors(include_url=False)[0]
                field = ".".join(str(part) for part in first["loc"]) or next(iter(given), "area")
                words = first["msg"].removeprefix("Value error, ")
                raise InvalidRequestError(field, words, "change the area or the cell, or both together") from None
            row.name, row.spec, row.updated_at = spec.name, spec.model_dump(mode="json"), now()
        return await self.view(site_id)

    async def delete(self, site_id: str) -> None:
        """Remove a site that has neither missions nor surveys. Raises SiteNotFoundError, ConflictError."""
        async with self._database.writing() as session:
            row = await _row(session, site_id)
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
        site = await self._map(spec.site) if spec.site is not None and spec.site_prior else None
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

    # What is known of a site

    async def surveys(self, site_id: str) -> list[SurveyView]:
        """Return the missions of a site and what each found, oldest first. Raises SiteNotFoundError."""
        missions, rows = await self._complete(site_id)
        fused = await self._together(site_id, rows)
        states = {mission.id: mission.state for mission in missions}
        found = [_survey_view(row, states.get(row.mission_id), fused) for row in rows]
        there = {row.mission_id for row in rows}
        return found + [_awaited(mission) for mission in missions if mission.id not in there]

    async def map(self, site_id: str) -> SiteMap:
        """Return what is known of a site now. Raises SiteNotFoundError, MapNotReadyError."""
        found = await self._map(site_id)
        if found is None:
            raise MapNotReadyError(
                "no survey of the site has ended yet", "finish a mission of the site in which something was measured"
            )
        return found

    async def _map(self, site_id: str) -> SiteMap | None:
        _, rows = await self._complete(site_id)
        fused = await self._together(site_id, rows)
        if not fused.surveys:
            return None
        model = await asyncio.to_thread(fused.fusion.model, now().timestamp())
        return SiteMap(fused.facts, model, fused.surveys)

    async def changes(
        self, site_id: str, earlier: str | None = None, later: str | None = None, confidence: float = 0.95
    ) -> SiteChange:
        """Return what changed between the surveys of two missions; by default the newest and the one before it.

        Raises
        ------
        SiteNotFoundError, MapNotReadyError, InvalidRequestError, ConflictError
            Where there are no two surveys; where a mission is not of the site; where depths have different datums.
        """
        missions, rows = await self._complete(site_id)
        rows = [row for row in rows if row.summary["cells"]]
        known = {row.mission_id: row for row in rows}
        for field, mission in (("from", earlier), ("to", later)):
            if mission is not None and mission not in known:
                if mission in {one.id for one in missions}:
                    raise MapNotReadyError(
                        f"{field}: mission {mission} has found no depth yet", "wait until it has ended"
                    )
                raise InvalidRequestError(field, f"{mission!r} is no mission of the site", "see the site's surveys")
        second = known[later] if later is not None else next((row for row in reversed(rows)), None)
        if earlier is None and second is not None:
            place = rows.index(second)
            first = rows[place - 1] if place else None
        else:
            first = known.get(earlier or "")
        if first is None or second is None:
            raise MapNotReadyError("the site has no two surveys to compare", "finish another mission of the site")
        if first.mission_id == second.mission_id:
            raise InvalidRequestError("to", "it is the same survey as from", "give another mission")
        pair = (_surveyed(first), _surveyed(second))
        if pair[0].vertical_datum.epsg != pair[1].vertical_datum.epsg:
            raise ConflictError(
                f"depths of one are below {pair[0].vertical_datum.statement}, of the other below "
                f"{pair[1].vertical_datum.statement}",
                "correct both to one datum: PUT /api/v1/missions/{id}/tide",
            )
        async with self._database.reading() as session:
            spec = SiteSpec.model_validate((await _row(session, site_id)).spec)
            contents = await site_queries.contents(session, [one.mission_id for one in pair])

        def compute() -> SiteChange:
            facts = _facts(site_id, spec)
            before, after = (_placed(contents[one.mission_id][1], facts) for one in pair)
            return SiteChange(facts, compare(before, after, confidence), before, after, pair)

        async with self._fusing:
            return await asyncio.to_thread(compute)

    async def _complete(self, site_id: str) -> tuple[list[site_queries.SiteMission], list[SiteSurveyRow]]:
        """Return a site's missions and its surveys by their time; missing ones are made where that is ours."""
        async with self._database.reading() as session:
            await _row(session, site_id)
            missions = await site_queries.missions_of(session, site_id)
            behind = [
                one.id for one in missions if one.state in ENDED and not await site_queries.is_current(session, one.id)
            ]
        for mission_id in behind if self._makes() else ():
            try:
                self._maps.survey(await self._get(mission_id))
            except MissionElsewhereError:
                # Its process makes the survey; until then an older one counts, or none.
                continue
            except MissionError as error:
                log.warning("a mission of the site cannot be taken up", mission=mission_id, error=str(error))
                continue
            await self._maps.surveyed(mission_id)
        async with self._database.reading() as session:
            return missions, list(await site_queries.surveys_of(session, site_id))

    async def _together(self, site_id: str, rows: Sequence[SiteSurveyRow]) -> _Fused:
        """Return the surveys that count, fused."""
        counting = _counting(rows)
        async with self._database.reading() as session:
            site = await _row(session, site_id)
        key = (site_id, str(site.spec), *((row.mission_id, row.digest, row.last_time_s) for row in counting))
        async with self._fusing:
            if key in self._fused:
                self._fused.move_to_end(key)
                return self._fused[key]
            spec = await asyncio.to_thread(SiteSpec.model_validate, site.spec)
            facts = await asyncio.to_thread(_facts, site_id, spec)
            fusion, taken = SiteFusion(facts.grid, spec.yearly_change_m), {}
            surveys = []
            for row in counting:
                async with self._database.reading() as session:
                    stored = await site_queries.contents(session, [row.mission_id])
                if row.mission_id in stored and stored[row.mission_id][1]:
                    try:
                        taken[row.mission_id] = await asyncio.to_thread(_take, fusion, facts, stored[row.mission_id][1])
                    except ValueError as error:
                        log.error("a survey of a site is left out", mission=row.mission_id, reason=str(error))
                        continue
                    surveys.append(_surveyed(row))
            fused = _Fused(facts, fusion, surveys, taken)
            self._remember(key, fused)
            return fused

    def _remember(self, key: tuple[Any, ...], fused: _Fused) -> None:
        for known in [known for known in self._fused if known[0] == key[0]]:
            del self._fused[known]
        self._fused[key] = fused
        while len(self._fused) > 1 and sum(_cells(one) for one in self._fused.values()) > MOST_REMEMBERED_CELLS:
            self._fused.popitem(last=False)


def _cells(fused: _Fused) -> int:
    return fused.facts.grid.rows * fused.facts.grid.cols


async def _row(session: AsyncSession, site_id: str) -> SiteRow:
    row = await session.get(SiteRow, site_id)
    if row is None:
        raise SiteNotFoundError(f"there is no site {site_id!r}", "GET /api/v1/sites lists all")
    return row


def _facts(site_id: str, spec: SiteSpec) -> SiteFacts:
    grid, inside = make_grid(spec.local_area(), spec.cell_m)
    return SiteFacts(site_id, spec.name, spec.frame(), grid, inside)


def _placed(content: bytes, facts: SiteFacts) -> Survey:
    """Return a stored survey on the site's grid, within its area."""
    survey, frame = unpack_survey(content)
    found = resample(survey, frame, facts.grid, facts.frame)
    inside = facts.inside
    return Survey(
        found.grid,
        np.where(inside, found.depth_m, np.nan),
        np.where(inside, found.sd_m, np.nan),
        found.sounded & inside,
        found.time_s,
        found.shared_sd_m,
        found.correlation_length_m,
    )


def _take(fusion: SiteFusion, facts: SiteFacts, content: bytes) -> _Taken:
    survey = _placed(content, facts)
    changed = fusion.add(survey)
    known = survey.known
    return _Taken(
        share_pct=round(100.0 * float(known[facts.inside].mean()), 2),
        median_sd_m=round(float(np.median(np.sqrt(survey.variance_m2[known]))), 3) if known.any() else None,
        changed_pct=round(100.0 * changed, 2) if np.isfinite(changed) else None,
    )


def _counting(rows: Sequence[SiteSurveyRow]) -> list[SiteSurveyRow]:
    """Return the surveys that count: those whose depths are below the datum of the newest."""
    found = [row for row in rows if row.summary["cells"]]
    return [row for row in found if row.summary["datum_epsg"] == found[-1].summary["datum_epsg"]]


def _surveyed(row: SiteSurveyRow) -> Surveyed:
    datum = VerticalDatum(row.summary["datum_epsg"], row.summary["vertical_datum"])
    return Surveyed(row.mission_id, row.mission_name, row.last_time_s, datum)


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


def _survey_view(row: SiteSurveyRow, state: str | None, fused: _Fused) -> SurveyView:
    taken = fused.taken.get(row.mission_id)
    summary = row.summary
    left_out = ""
    if taken is None:
        left_out = "it found no depth"
        if summary["cells"]:
            left_out = "its depths are below another datum than those of the newest survey"
        if summary["cells"] and summary["datum_epsg"] == fused.datum_epsg:
            left_out = "what is stored of it cannot be read"
    return SurveyView(
        mission_id=row.mission_id,
        name=row.mission_name,
        state=state,
        surveyed=True,
        left_out=left_out,
        began_at=moment(row.first_time_s),
        ended_at=moment(row.last_time_s),
        soundings=summary["soundings"],
        beams=summary["beams"],
        share_pct=0.0 if taken is None else taken.share_pct,
        median_sd_m=summary.get("median_sd_m") if taken is None else taken.median_sd_m,
        min_depth_m=summary.get("min_depth_m"),
        max_depth_m=summary.get("max_depth_m"),
        changed_pct=None if taken is None else taken.changed_pct,
        vertical_datum=summary["vertical_datum"],
    )


def _awaited(mission: site_queries.SiteMission) -> SurveyView:
    return SurveyView(
        mission_id=mission.id,
        name=mission.name,
        state=mission.state,
        surveyed=False,
        left_out="it has found no depth yet" if mission.state in ENDED else "it has not ended",
        began_at=None,
        ended_at=None,
        soundings=0,
        beams=0,
        share_pct=0.0,
        median_sd_m=None,
        min_depth_m=None,
        max_depth_m=None,
        changed_pct=None,
        vertical_datum="",
    )
