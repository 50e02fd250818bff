"""Ranges to moving targets as they come: judged in the order of their time, written down, and only then used.

A range counts once it is committed, like a sounding. What vehicles post may have been gathered for hours; they are
taken at their word that their clock shows Unix seconds. Others are those of
:mod:`app.missions.live.journals.vehicle_times`.
"""

from collections.abc import Sequence
from typing import Any

from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.clock import now
from app.missions.fleet.interface import Position, RangeReport
from app.missions.live.journals.journal import Journal
from app.missions.live.journals.vehicle_times import VehicleTimes
from app.missions.live.journals.write_behind import Committed, WriteBehind
from app.missions.targets.filters import Arrived, Judged, TargetFilters
from app.missions.views.measurements.soundings import ItemVerdict, Verdict
from app.missions.views.mission import Level
from app.storage.database import Database
from app.storage.models import StepRow
from app.storage.queries import target_ranges as range_queries

GATHER_S = 0.3
"""How long ranges are gathered before they are judged: those of several vehicles come in any order."""

AHEAD_S = 60.0
"""A range that is newer than its vehicle's newest report by more than this has a wrong time."""


class RangeJournal(WriteBehind[Arrived]):
    """Takes one mission's ranges in.

    Parameters
    ----------
    tracking
        The mission's filters.
    journal
        Its log, and the number of its step.
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(
        self, database: Database, mission_id: str, tracking: TargetFilters, journal: Journal, time_scale: float
    ) -> None:
        super().__init__(database, mission_id, journal.storage, GATHER_S)
        self.tracking = tracking
        self.times = VehicleTimes(time_scale, lambda: now().timestamp())
        self.last_id = 0
        """Of the stored ranges the last one that the filters know."""
        self._journal = journal
        self._time_scale = time_scale
        self._strangers: set[str] = set()

    async def load(self, session: AsyncSession, step: StepRow | None) -> None:
        """Take the filters up where they were: as the last step kept them, and what came after it."""
        if not self.tracking:
            return
        if step is not None and step.targets is not None:
            self.last_id = self.tracking.recall(step.targets)
        rows = await range_queries.ranges_after(session, self.mission_id, self.last_id)
        self.tracking.replay(
            [
                Arrived(
                    RangeReport(
                        row.vehicle,
                        row.time_s,
                        self.tracking.specs[row.target].called,
                        row.range_m,
                        Position(row.lat_deg, row.lon_deg, row.depth_m),
                        row.source,
                        row.position_sd_m,
                    ),
                    row.at_s,
                )
                for row in rows
                if row.target in self.tracking.specs
            ]
        )
        self.last_id = max([self.last_id, *(row.id for row in rows)])

    def memory(self) -> bytes | None:
        """Return the filters as a step keeps them; None where the mission has no targets."""
        return self.tracking.remember(self.last_id) if self.tracking else None

    def note(self, report: RangeReport, newest_s: float | None) -> None:
        """Take a range that a link heard; ``newest_s``: the time of its vehicle's newest report, by its clock."""
        stranger = self.tracking.stranger(report.target)
        if stranger:
            self._tell_once(report, stranger)
            return
        if not too_new(report, newest_s):
            self.times.heard(report.vehicle, report.time_s if newest_s is None else newest_s)
            self._note(Arrived(report, self.times.of(report.vehicle, report.time_s)))

    def posted(self, report: RangeReport, newest_s: float) -> Arrived:
        """Return a range that a vehicle posted with its time; ``newest_s``: of its batch, by the vehicle's clock."""
        if self._time_scale == 1.0:
            return Arrived(report, report.time_s)
        self.times.heard(report.vehicle, newest_s)
        return Arrived(report, self.times.of(report.vehicle, report.time_s))

    def not_yet(self, time_s: float) -> str:
        """Return why a time that a vehicle posted with a range cannot be; empty when it can."""
        ahead = time_s - now().timestamp()
        if self._time_scale != 1.0 or ahead <= AHEAD_S:
            return ""
        return f"time_s: {time_s:.0f} is {ahead:.0f} s ahead of this service's clock; ranges need Unix seconds"

    async def take(self, arrived: Sequence[Arrived], session: AsyncSession) -> tuple[list[ItemVerdict], Committed]:
        """Judge and store ranges in the caller's transaction; the caller holds :attr:`writing`.

        Returns
        -------
        The verdicts in the order given, and what to call once the transaction has committed.
        """
        order = sorted(range(len(arrived)), key=lambda i: arrived[i].at_s)
        identities = {i: self._identity(arrived[i].report) for i in order}
        seen = await range_queries.known_ranges(session, self.mission_id, list(identities.values()))
        fresh = []
        for i in order:
            if identities[i] not in seen:
                seen.add(identities[i])
                fresh.append(i)
        judged, known = self.tracking.judge(arrived[i] for i in fresh)
        verdicts = dict(zip(fresh, judged, strict=True))
        rows = [self._row(verdict) for verdict in judged if not self.tracking.implausible(verdict.arrived.report)]
        last_id = await range_queries.add_ranges(session, rows)

        def committed() -> None:
            self.tracking.adopt(known)
            self.last_id = max(self.last_id, last_id)

        return [_item(verdicts.get(i)) for i in range(len(arrived))], committed

    async def _store(self, noted: Sequence[Arrived], session: AsyncSession) -> Committed:
        return (await self.take(noted, session))[1]

    def _tell_once(self, report: RangeReport, stranger: str) -> None:
        if report.target in self._strangers or not self.tracking:
            return
        self._strangers.add(report.target)
        message = f"{report.vehicle} ranged to something that nobody asked about: {stranger}"
        self._journal.note_line(self._journal.line(Level.WARNING, "target", message, vehicle=report.vehicle))

    def _identity(self, report: RangeReport) -> range_queries.Identity:
        return self.tracking.name_of(report.target) or "", report.vehicle, report.time_s

    def _row(self, judged: Judged) -> dict[str, Any]:
        report = judged.arrived.report
        return {
            "mission_id": self.mission_id,
            "target": judged.target,
            "vehicle": report.vehicle,
            "time_s": report.time_s,
            "at_s": judged.arrived.at_s,
            "received_at": now(),
            "step": self._journal.step,
            "source": report.source,
            "range_m": report.range_m,
            "lat_deg": report.position.lat_deg,
            "lon_deg": report.position.lon_deg,
            "depth_m": report.position.depth_m,
            "position_sd_m": report.position_sd_m,
            "verdict": Verdict.ACCEPTED if judged.used else Verdict.REJECTED,
            "reason": judged.reason,
        }


def too_new(report: RangeReport, newest_s: float | None) -> str:
    """Return why a range's time cannot be; empty when it can."""
    if newest_s is None or report.time_s <= newest_s + AHEAD_S:
        return ""
    return f"time_s: {report.time_s - newest_s:.0f} s ahead of the newest report of {report.vehicle}"


def _item(judged: Judged | None) -> ItemVerdict:
    if judged is None:
        return ItemVerdict(index=0, verdict=Verdict.DUPLICATE, reason="this range is there already")
    return ItemVerdict(index=0, verdict=Verdict.ACCEPTED if judged.used else Verdict.REJECTED, reason=judged.reason)
