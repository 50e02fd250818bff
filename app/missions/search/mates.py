"""Where a search's vehicles are while one of them scans: its scanner meets the others, and they are no obstacles."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.interface import ScanReport, VehicleReport
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member, Team

HULL_M = 2.0
"""How far from where a vehicle says it is an echo of its hull may lie, whichever way that lies."""
SURE = 2.0
"""Standard deviations by which positions may be off beside that."""
ABOUT_S = 2.0
"""How well it is known when a scan was taken, by the clocks of two vehicles."""
OFTEN_S = 0.5
"""Places are kept no more often than that."""
MOST_KEPT = 1200


@dataclass(frozen=True, slots=True)
class _Heard:
    """Where a vehicle was by its own clock; ``place_m`` (2,) east and north."""

    time_s: float
    place_m: FloatArray
    sd_m: float


class Mates:
    """Where the vehicles of a team were lately, and which beams of a scan ended on one of them.

    Parameters
    ----------
    team
        The mission's.
    report_of
        What its link heard of a vehicle last: before the start a mission is not told of it.
    """

    def __init__(
        self,
        team: Team,
        report_of: Callable[[Member], VehicleReport | None],
        spec: MissionSpec,
        frame: LocalFrame,
    ) -> None:
        self._team = team
        self._report_of = report_of
        self._spec = spec
        self._frame = frame
        self._heard: dict[str, deque[_Heard]] = {}

    def note(self, vehicle: str) -> None:
        """Keep where a vehicle says it is now."""
        member = self._team.get(vehicle)
        if member is None or member.report is None:
            return
        now = self._told(member.report)[0]
        kept = self._heard.setdefault(vehicle, deque(maxlen=MOST_KEPT))
        if kept and now.time_s < kept[-1].time_s:
            kept.clear()  # its clock was set
        if kept and now.time_s - kept[-1].time_s < OFTEN_S:
            return
        kept.append(now)

    def beams_on(self, scan: ScanReport, place_m: FloatArray) -> tuple[int, ...]:
        """Return which beams of a scan taken at a place (2,) ended on another vehicle of the team.

        Those that end within a hull and both positions' deviations of where it was at about the scan's time.
        """
        ranges = np.array(scan.ranges_m)
        echoes = np.flatnonzero(ranges <= scan.reach_m)
        bearings = np.radians(scan.first_bearing_deg + scan.bearing_step_deg * echoes)
        ends = place_m + ranges[echoes, None] * np.column_stack([np.sin(bearings), np.cos(bearings)])
        points, own = shapely.points(ends), self._team.get(scan.vehicle)
        own_sd_m = 0.0 if own is None or own.report is None else own.report.position_sd_m or 0.0
        met = np.zeros(len(echoes), dtype=np.bool_)
        for mate in self._team:
            kept = list(self._heard.get(mate.name, ())) or self._told(mate.report or self._report_of(mate))
            if mate.name != scan.vehicle and kept:
                way_m, sd_m = self._way(mate, kept, scan.time_s, own)
                met |= shapely.distance(points, way_m) <= HULL_M + SURE * np.hypot(own_sd_m, sd_m)
        return tuple(echoes[met].tolist())

    def _way(
        self, mate: Member, kept: list[_Heard], time_s: float, own: Member | None
    ) -> tuple[shapely.LineString, float]:
        """Return where another vehicle was about a time by a vehicle's own clock, and how uncertain that is.

        Where its places of then are not known, it is taken to be where it is now.
        """
        # Each clock has its own error; both are held against the service's.
        if own is not None and own.clock_ahead_s is not None and mate.clock_ahead_s is not None:
            time_s += mate.clock_ahead_s - own.clock_ahead_s
        times = [heard.time_s for heard in kept]
        first = max(bisect_right(times, time_s - ABOUT_S) - 1, 0)
        last = min(bisect_left(times, time_s + ABOUT_S), len(kept) - 1)
        then = kept[-1:] if time_s < times[0] - ABOUT_S else kept[first : last + 1]
        corners = [heard.place_m for heard in then]
        if last == len(kept) - 1 and mate.target_m is not None:
            # What it has gone since it was heard last.
            ahead = mate.target_m - corners[-1]
            gone_m = self._spec.speed_of(mate.spec) * max(time_s + ABOUT_S - times[-1], 0.0)
            corners.append(corners[-1] + ahead * min(1.0, gone_m / max(float(np.hypot(*ahead)), 1e-9)))
        return shapely.LineString([*corners, corners[-1]]), max(heard.sd_m for heard in then)

    def _told(self, report: VehicleReport | None) -> list[_Heard]:
        """Return where a report puts its vehicle; nothing where that is not near the mission."""
        if report is None:
            return []
        try:
            east, north = self._frame.to_local(report.position.lat_deg, report.position.lon_deg)
        except ValueError:
            return []
        return [_Heard(report.time_s, np.array([float(east), float(north)]), report.position_sd_m or 0.0)]
