"""Scans that vehicles, or computers aboard of them, post: judged one by one, stored together."""

import asyncio
from collections.abc import Sequence

from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.interface import Position, ScanReport
from app.missions.live.mission import LiveMission
from app.missions.search.progress import grid_view
from app.missions.search.scan_schema import Scan
from app.missions.search.state import Search
from app.missions.states import MissionState
from app.missions.views.measurements.soundings import BatchVerdict, ItemVerdict, Verdict, batch_verdict
from app.missions.views.search import SearchGridView

MAX_SCANS = 1000
SCANS_AT_ONCE = 20
"""At most so many scans are stored in one transaction."""


async def scan(live: LiveMission, items: Sequence[Scan]) -> BatchVerdict:
    """Take in scans; what is counted accepted is stored for good and in the grid when this returns.

    A scan is known by its vehicle and time: sent again once it was accepted, it is a duplicate.

    Raises
    ------
    ConflictError
        When the mission is no search, or a draft.
    InvalidRequestError
        When there are too many.
    """
    search_of(live)
    if live.header.state is MissionState.DRAFT:
        raise ConflictError("the mission is a draft and takes no scans yet", "add a vehicle to it first")
    if len(items) > MAX_SCANS:
        raise InvalidRequestError("items", f"{len(items)} scans are too many", f"send at most {MAX_SCANS} at once")
    refused = {i: reason for i, item in enumerate(items) if (reason := _stranger(live, item.vehicle))}
    answers = [ItemVerdict(index=i, verdict=Verdict.REJECTED, reason=reason) for i, reason in refused.items()]
    taken = [i for i in range(len(items)) if i not in refused]
    # Some at a time: adding them to the grid is computing, and nobody else gets his turn meanwhile.
    for first in range(0, len(taken), SCANS_AT_ONCE):
        group = taken[first : first + SCANS_AT_ONCE]
        async with live.journal.writing, live.database.writing() as session:
            verdicts, committed = await live.journal.take_scans([report_of_posted(items[i]) for i in group], session)
        committed()
        answers += [verdict.model_copy(update={"index": i}) for i, verdict in zip(group, verdicts, strict=True)]
        await asyncio.sleep(0)
    return batch_verdict(sorted(answers, key=lambda answer: answer.index))


def search_of(live: LiveMission) -> Search:
    """Return a mission's search. Raises ConflictError when it is none."""
    if live.search is None:
        raise ConflictError("the mission is of kind survey", "create a mission of kind search")
    return live.search


def search_grid(live: LiveMission, after: int | None = None) -> SearchGridView | None:
    """Return a search's site as known now; None when nothing is newer than ``after``. Raises ConflictError."""
    search = search_of(live)
    return None if after is not None and search.version <= after else grid_view(search, live.id, live.frame)


def _stranger(live: LiveMission, vehicle: str) -> str:
    member = live.team.get(vehicle)
    if member is None:
        return f"vehicle: {vehicle!r} takes no part in this mission"
    if member.capabilities.scans:
        return f"vehicle: {vehicle!r} scans by itself"
    return ""


def report_of_posted(item: Scan) -> ScanReport:
    """Return a posted scan as every link tells of one."""
    return ScanReport(
        vehicle=item.vehicle,
        time_s=item.time_s,
        position=Position(item.lat_deg, item.lon_deg, item.depth_m),
        first_bearing_deg=item.first_bearing_deg,
        bearing_step_deg=item.bearing_step_deg,
        reach_m=item.reach_m,
        ranges_m=tuple(float("inf") if r is None else r for r in item.ranges_m),
        source="rest",
    )
