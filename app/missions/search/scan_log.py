"""Scans as they come: judged, written down, and only then added to the grid."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.clock import now
from app.missions.fleet.interface import Position, ScanReport
from app.missions.search.mates import Mates
from app.missions.search.state import Search
from app.missions.views.measurements.soundings import ItemVerdict, Verdict
from app.storage.models import ScanRow
from app.storage.queries import scans as scan_queries


async def take(
    search: Search,
    mates: Mates,
    mission_id: str,
    seen: Callable[[], None],
    reports: Sequence[ScanReport],
    step: int,
    session: AsyncSession,
) -> tuple[list[ItemVerdict], Callable[[], None]]:
    """Store scans in the caller's transaction; ``seen`` is called when they are in the grid.

    ``mates`` tells which beams ended on a vehicle of the team. A scan that was refused may be sent again as it should
    have been: what is accepted takes the place of what was not.

    Returns
    -------
    The verdicts in the order of the reports, and what to call once the transaction has committed.
    """
    known = await scan_queries.known_scans(session, mission_id, [_identity(r) for r in reports if _storable(r)])
    refused_before = [scan for scan, verdict in known.items() if verdict != Verdict.ACCEPTED]
    verdicts: list[ItemVerdict] = []
    rows: dict[scan_queries.Identity, dict[str, Any]] = {}
    fresh = []
    received = now()
    for index, told in enumerate(reports):
        report, scan = told, _identity(told)
        if known.get(scan) == Verdict.ACCEPTED:
            verdicts.append(ItemVerdict(index=index, verdict=Verdict.DUPLICATE, reason="already stored"))
            continue
        reason = search.refusal(report)
        verdict = Verdict.REJECTED if reason else Verdict.ACCEPTED
        verdicts.append(ItemVerdict(index=index, verdict=verdict, reason=reason))
        if not _storable(report):
            continue
        known[scan] = verdict
        place_m = None if reason else search.place_m(report)
        if place_m is not None:
            report = replace(report, mates=mates.beams_on(report, place_m))
            fresh.append(report)
        # The last to be judged is stored last: a restart adds them to the grid in this order.
        rows.pop(scan, None)
        rows[scan] = _row(mission_id, report, step, received, verdict, reason)
    await scan_queries.remove_scans(session, mission_id, [scan for scan in refused_before if scan in rows])
    await scan_queries.add_scans(session, list(rows.values()))

    def committed() -> None:
        search.see(fresh)
        seen()

    return verdicts, committed


def _row(
    mission_id: str, report: ScanReport, step: int, received_at: datetime, verdict: Verdict, reason: str
) -> dict[str, Any]:
    return {
        "mission_id": mission_id,
        "vehicle": report.vehicle,
        "time_s": report.time_s,
        "received_at": received_at,
        "step": step,
        "source": report.source,
        "lat_deg": report.position.lat_deg,
        "lon_deg": report.position.lon_deg,
        "depth_m": report.position.depth_m,
        "first_bearing_deg": report.first_bearing_deg,
        "bearing_step_deg": report.bearing_step_deg,
        "reach_m": report.reach_m,
        "ranges": scan_queries.pack_ranges(report.ranges_m, report.mates),
        "verdict": verdict,
        "reason": reason,
    }


def report_of(row: ScanRow) -> ScanReport:
    """Return a stored scan as it was taken in."""
    ranges_m, mates = scan_queries.unpack_ranges(row.ranges)
    return ScanReport(
        vehicle=row.vehicle,
        time_s=row.time_s,
        position=Position(row.lat_deg, row.lon_deg, row.depth_m),
        first_bearing_deg=row.first_bearing_deg,
        bearing_step_deg=row.bearing_step_deg,
        reach_m=row.reach_m,
        ranges_m=ranges_m,
        source=row.source,
        mates=mates,
    )


def _identity(report: ScanReport) -> scan_queries.Identity:
    return report.vehicle, report.time_s


def _storable(report: ScanReport) -> bool:
    place = report.position
    values = (report.time_s, place.lat_deg, place.lon_deg, place.depth_m, report.first_bearing_deg)
    return all(math.isfinite(v) for v in (*values, report.bearing_step_deg, report.reach_m))
