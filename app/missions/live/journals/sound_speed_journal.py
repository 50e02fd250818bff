"""Sound speeds that vehicles measure, as a mission keeps them: thinned, and a bounded number of each vehicle.

A vehicle that changes its depth measures the water, one that keeps it the same water again: the former is kept each
time it has gone through a step of depth, the latter now and then.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy.ext.asyncio import AsyncSession

from app.mapping.water.measured_casts import LEAST_DEPTH_M, is_possible
from app.missions.clock import now
from app.missions.fleet.interface import SoundSpeedReport
from app.missions.live.journals.db_retry import DatabaseRetry
from app.missions.live.journals.write_behind import Committed, WriteBehind
from app.storage.database import Database
from app.storage.queries import sound_speeds as sound_speed_queries

GATHER_S = 1.0

STEP_M = 0.1
"""Through so much water another sample is kept: five of them make a bin of a cast."""

SAME_DEPTH_S = 10.0
LEAST_S = 0.2
"""However fast a probe measures, or a vehicle claims to change its depth."""

MOST_SAMPLES = 40_000
"""Of one vehicle; of more, every second one is kept, and fewer from then on."""

MOST_SOURCES = 8
"""No vehicle has more probes."""

DEEPEST_M = 6000.0
"""No vehicle goes deeper."""

CLOCK_S = 86400.0
"""A vehicle's clock that is farther from the service's tells no time for a cast."""


@dataclass
class _Probe:
    """What was last kept of a probe: when, and at which depth."""

    time_s: float
    depth_m: float


class SoundSpeedJournal(WriteBehind[SoundSpeedReport]):
    """Keeps one mission's sound speeds.

    Parameters
    ----------
    storage
        The journal's, which waits where the database cannot be used.
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(self, database: Database, mission_id: str, storage: DatabaseRetry, time_scale: float) -> None:
        super().__init__(database, mission_id, storage, GATHER_S)
        self._time_scale = time_scale
        self._probes: dict[str, dict[str, _Probe]] = {}
        self._sparser: dict[str, float] = {}
        """By vehicle how many times fewer are kept than at first."""
        self._counts: dict[str, int] | None = None

    def note(self, report: SoundSpeedReport, *, posted: bool = False) -> None:
        """Take a sample in; it is written within a moment, where it tells more than those before.

        ``posted``: by a vehicle that may have gathered it for long.
        """
        if not is_possible(report.speed_mps) or not LEAST_DEPTH_M <= report.position.depth_m <= DEEPEST_M:
            return
        if not math.isfinite(report.time_s) or self._is_off(report.time_s, posted=posted):
            return
        probes = self._probes.setdefault(report.vehicle, {})
        last, depth_m = probes.get(report.source), report.position.depth_m
        if last is None and len(probes) >= MOST_SOURCES:
            return
        if last is not None:
            passed_s, factor = abs(report.time_s - last.time_s), self._sparser.get(report.vehicle, 1.0)
            moved = abs(depth_m - last.depth_m) >= STEP_M
            if passed_s < factor * (LEAST_S if moved else SAME_DEPTH_S):
                return
        probes[report.source] = _Probe(report.time_s, depth_m)
        self._note(report)

    def _is_off(self, time_s: float, *, posted: bool) -> bool:
        """Tell whether a vehicle's clock is too far from ours; in simulated time clocks are not compared."""
        ahead_s = time_s - now().timestamp()
        return self._time_scale == 1.0 and (ahead_s > CLOCK_S or (ahead_s < -CLOCK_S and not posted))

    async def _store(self, noted: Sequence[SoundSpeedReport], session: AsyncSession) -> Committed:
        if self._counts is None:
            self._counts = await sound_speed_queries.counts(session, self.mission_id)
        counts, full = dict(self._counts), set()
        await sound_speed_queries.add(session, [self._row(report) for report in noted])
        for report in noted:
            counts[report.vehicle] = counts.get(report.vehicle, 0) + 1
        for vehicle in {report.vehicle for report in noted}:
            while counts[vehicle] > MOST_SAMPLES:
                await sound_speed_queries.halve(session, self.mission_id, vehicle)
                counts[vehicle] -= counts[vehicle] // 2
                full.add(vehicle)

        def committed() -> None:
            self._counts = counts
            for vehicle in full:
                self._sparser[vehicle] = 2.0 * self._sparser.get(vehicle, 1.0)

        return committed

    def _row(self, report: SoundSpeedReport) -> dict[str, object]:
        place = report.position
        return {
            "mission_id": self.mission_id,
            "vehicle": report.vehicle,
            "source": report.source[:64],
            "time_s": report.time_s,
            "lat_deg": place.lat_deg,
            "lon_deg": place.lon_deg,
            "depth_m": place.depth_m,
            "speed_mps": report.speed_mps,
        }
