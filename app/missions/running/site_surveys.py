"""What a mission that ended found of its site: of its own soundings alone, made anew when they change."""

import hashlib
from typing import Any

import numpy as np

from app.mapping.sites import Survey, survey_of
from app.missions.clock import now
from app.missions.live.mission import LiveMission
from app.missions.maps.survey_codec import pack_survey
from app.missions.states import ENDED
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.queries import pings as ping_queries
from app.storage.queries import sites as site_queries
from app.storage.queries import soundings as sounding_queries


def belongs_to_a_site(live: LiveMission) -> bool:
    """Tell whether a site keeps what the mission found, now that it has ended."""
    return live.spec.site is not None and live.header.state in ENDED


async def is_kept(live: LiveMission) -> bool:
    """Tell whether the stored survey is of everything that the mission has measured."""
    async with live.database.reading() as session:
        return await site_queries.is_current(session, live.id)


async def keep_survey(live: LiveMission) -> None:
    """Store what the mission found, of everything that was accepted so far; nothing where that changes meanwhile."""
    await live.journal.flush()
    await live.notice_imports()
    if not _is_mapped(live):
        await live.map.build()
    made_of = _made_of(live)
    own = await live.map.make(live.builder.own_map)
    period = await _period(live)
    if own is None or period is None:
        survey, content = None, b""
    else:
        survey = survey_of(own, period[1], live.facts.common_sd_m)
        content = await live.in_background(pack_survey, survey, live.frame)
    async with live.journal.writing:
        if live.map.is_missing or live.builder.arrivals.at_rest or made_of != _made_of(live):
            return  # Something else is the case by now.
        await to_the_end(_store(live, survey, content, period or (0.0, 0.0)))


def _is_mapped(live: LiveMission) -> bool:
    """Tell whether the newest map is a product of all soundings, and these are in memory."""
    built = live.builder.newest
    return built is not None and built.thorough and not live.map.is_missing and not live.builder.arrivals.at_rest


def _made_of(live: LiveMission) -> tuple[int, int, int]:
    """Return what changes with every sounding and ping that comes, and with every one that is changed."""
    arrivals = live.builder.arrivals
    return arrivals.replaced, arrivals.came, live.builder.swath.beams


async def _period(live: LiveMission) -> tuple[float, float] | None:
    """Return when the mission measured, Unix seconds, never after it ended: clocks may be wrong, or simulated."""
    async with live.database.reading() as session:
        extent = await sounding_queries.extent(session, live.id, "accepted")
        pinged = await ping_queries.period(session, live.id, without=live.pings.taken_back)
    ends = [] if extent is None else [extent.first_time_s, extent.last_time_s]
    ends += [] if pinged is None else [*pinged]
    ended_s = live.header.updated_at.timestamp()
    return (min(*ends, ended_s), min(max(ends), ended_s)) if ends else None


async def _store(live: LiveMission, survey: Survey | None, content: bytes, period: tuple[float, float]) -> None:
    async with live.database.writing() as session:
        site = live.spec.site
        if site is None or not await site_queries.hold(session, site):
            return
        values: dict[str, Any] = {
            "mission_id": live.id,
            "site_id": site,
            "mission_name": live.spec.name,
            "made_at": now(),
            "first_time_s": period[0],
            "last_time_s": period[1],
            "summary": _summary(live, survey),
            "digest": hashlib.sha256(content).hexdigest(),
            "content": content,
        }
        # Soundings that another process imported since are in the log, and not in the survey.
        marks = (await site_queries.marks(session, live.id))._replace(last_import=live.stored_soundings.imports_noticed)
        if survey is None and not (marks.last_sounding or marks.last_block):
            return
        await site_queries.keep_survey(session, values | marks._asdict())


def _summary(live: LiveMission, survey: Survey | None) -> dict[str, Any]:
    datum = live.facts.vertical_datum
    found: dict[str, Any] = {
        "cells": 0,
        "cell_m": live.spec.cell_m,
        "soundings": live.counts.accepted,
        "beams": live.counts.beams,
        "datum_epsg": datum.epsg,
        "vertical_datum": datum.statement,
    }
    if survey is None or not survey.known.any():
        return found
    depth, sd = survey.depth_m[survey.known], np.sqrt(survey.variance_m2[survey.known])
    return found | {
        "cells": len(depth),
        "min_depth_m": float(depth.min()),
        "max_depth_m": float(depth.max()),
        "median_sd_m": float(np.median(sd)),
    }
