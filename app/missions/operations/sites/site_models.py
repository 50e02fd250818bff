"""What the surveys of a site found together, and what changed between two of them."""

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import structlog
from sqlalchemy.ext.asyncio import AsyncSession

from app.mapping.sites import SiteFusion, Survey, compare, resample
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
from app.missions.maps.site_maps import SiteChange, SiteFacts, SiteMap, SiteSurvey, moment
from app.missions.maps.survey_codec import unpack_survey
from app.missions.running.final_maps import FinalMaps
from app.missions.spec.site import SiteSpec
from app.missions.states import ENDED
from app.missions.views.maps.sites import SurveyView
from app.storage.database import Database
from app.storage.models import SiteRow, SiteSurveyRow
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
    surveys: Sequence[SiteSurvey]
    taken: dict[str, _Taken]

    @property
    def datum_epsg(self) -> int | None:
        """Return what depths are counted from; None without any."""
        return self.surveys[-1].vertical_datum.epsg if self.surveys else None


class SiteModels:
    """The models of all sites: made of their surveys when somebody asks, and remembered until one of these changes.

    Parameters
    ----------
    database
        Where surveys are stored; several processes may use them.
    get
        Returns a mission that this process may have. Raises MissionElsewhereError.
    maps
        Makes what is missing of missions' surveys.
    makes
        Tells whether this process has missions of its own, whose surveys it makes; else it only reads.
    """

    def __init__(
        self,
        database: Database,
        get: Callable[[str], Awaitable[LiveMission]],
        maps: FinalMaps,
        makes: Callable[[], bool],
    ) -> None:
        self._database = database
        self._get = get
        self._maps = maps
        self._makes = makes
        self._fused: OrderedDict[tuple[Any, ...], _Fused] = OrderedDict()
        # One model at a time takes its memory.
        self._fusing = asyncio.Lock()

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
        found = await self.newest(site_id)
        if found is None:
            raise MapNotReadyError(
                "no survey of the site has ended yet", "finish a mission of the site in which something was measured"
            )
        return found

    async def newest(self, site_id: str) -> SiteMap | None:
        """Return what is known of a site now; None before its first survey. Raises SiteNotFoundError."""
        _, rows = await self._complete(site_id)
        fused = await self._together(site_id, rows)
        if not fused.surveys:
            return None
        model = await asyncio.to_thread(fused.fusion.model, now().timestamp())
        return SiteMap(fused.facts, model, fused.surveys)

    async def changes(
        self, site_id: str, earlier: str | None = None, later: str | None = None, confidence: float = 0.95
    ) -> SiteChange:
        """Return what changed between the surveys of two missions.

        By default these are the newest survey that can be compared and the one before it with which it can.

        Raises
        ------
        SiteNotFoundError, MapNotReadyError, InvalidRequestError, ConflictError
            Where there are no two surveys; where a mission is not of the site; where depths have different datums.
        """
        missions, rows = await self._complete(site_id)
        rows = [row for row in rows if row.summary["cells"]]
        known = {row.mission_id for row in rows}
        for field, mission in (("from", earlier), ("to", later)):
            if mission is not None and mission not in known:
                if mission in {one.id for one in missions}:
                    raise MapNotReadyError(
                        f"{field}: mission {mission} has found no depth yet", "wait until it has ended"
                    )
                raise InvalidRequestError(field, f"{mission!r} is no mission of the site", "see the site's surveys")
        first, second = _comparable(rows, earlier, later)
        pair = (_surveyed(first), _surveyed(second))
        # Two that were asked for leave nothing out, nor does what came after the one that was.
        passed = [] if earlier and later else rows[rows.index(first) : rows.index(second) if later else None]
        notes = [_left_out(row) for row in passed if not _same_datum(row, first)]
        async with self._database.reading() as session:
            spec = SiteSpec.model_validate((await stored_site(session, site_id)).spec)
            contents = await site_queries.contents(session, [one.mission_id for one in pair])

        def compute() -> SiteChange:
            facts = _facts(site_id, spec)
            before, after = (_placed(contents[one.mission_id][1], facts) for one in pair)
            return SiteChange(facts, compare(before, after, confidence), before, after, pair, tuple(notes))

        async with self._fusing:
            return await asyncio.to_thread(compute)

    async def _complete(self, site_id: str) -> tuple[list[site_queries.SiteMission], list[SiteSurveyRow]]:
        """Return a site's missions and its surveys by their time; missing ones are made where that is ours."""
        async with self._database.reading() as session:
            await stored_site(session, site_id)
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
            site = await stored_site(session, site_id)
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


async def stored_site(session: AsyncSession, site_id: str) -> SiteRow:
    """Return a site's row. Raises SiteNotFoundError."""
    row = await session.get(SiteRow, site_id)
    if row is None:
        raise SiteNotFoundError(f"there is no site {site_id!r}", "GET /api/v1/sites lists all")
    return row


def _facts(site_id: str, spec: SiteSpec) -> SiteFacts:
    grid, inside = make_grid(spec.local_area(), spec.cell_m)
    return SiteFacts(site_id, spec.name, spec.area, spec.frame(), grid, inside)


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


def _same_datum(one: SiteSurveyRow, other: SiteSurveyRow) -> bool:
    return bool(one.summary["datum_epsg"] == other.summary["datum_epsg"])


def _left_out(row: SiteSurveyRow) -> str:
    """Return in words that a survey is not compared, and why."""
    return f"{row.mission_name} is left out: its depths are below {row.summary['vertical_datum']}"


def _pairs(
    rows: Sequence[SiteSurveyRow], earlier: str | None, later: str | None
) -> Iterator[tuple[SiteSurveyRow, SiteSurveyRow]]:
    """Yield what may be compared where datums allow it, the newest first; of two that are given these alone."""
    for place in reversed(range(len(rows))):
        if later in (None, rows[place].mission_id):
            before = rows if earlier is not None and later is not None else rows[:place]
            for first in reversed(before):
                if earlier in (None, first.mission_id):
                    yield first, rows[place]


def _comparable(
    rows: Sequence[SiteSurveyRow], earlier: str | None, later: str | None
) -> tuple[SiteSurveyRow, SiteSurveyRow]:
    """Return the newest two surveys whose depths are below one datum, with those that are given.

    Raises MapNotReadyError, InvalidRequestError, ConflictError.
    """
    if earlier is not None and earlier == (later or rows[-1].mission_id):
        raise InvalidRequestError("to", "it is the same survey as from", "give another mission")
    pairs = list(_pairs(rows, earlier, later))
    if not pairs:
        raise MapNotReadyError("the site has no two surveys to compare", "finish another mission of the site")
    for pair in pairs:
        if _same_datum(*pair):
            return pair
    asked = {row.mission_id: row for pair in pairs for row in pair}.values()
    below = "; ".join(f"{row.mission_name} below {row.summary['vertical_datum']}" for row in asked)
    raise ConflictError(
        f"no two of these surveys have depths below one datum: {below}",
        "correct two of them to one datum, with a water level or a tide table: PUT /api/v1/missions/{id}/tide",
    )


def _surveyed(row: SiteSurveyRow) -> SiteSurvey:
    datum = VerticalDatum(row.summary["datum_epsg"], row.summary["vertical_datum"])
    return SiteSurvey(row.mission_id, row.mission_name, row.last_time_s, datum)


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
