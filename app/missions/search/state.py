"""What a running search knows: the occupancy of the site from every accepted scan."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from app.arrays import FloatArray
from app.estimation.occupancy import Cell, OccupancyGrid
from app.exploration.site_search import SearchTask
from app.exploration.site_search.criteria import in_contact
from app.exploration.site_search.ground import SiteGround
from app.exploration.site_search.scene import HOME_STEPS
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.clock import now
from app.missions.fleet.interface import ScanReport
from app.missions.search.site import Site, site_of
from app.missions.spec.mission import MissionSpec
from app.missions.spec.search import SearchSpec

DOUBT_CELLS = 1.0
"""An echo so close in front of a known obstacle comes from that."""
SPARE_PART = 0.5
"""Part of the arrival radius that legs keep beside the safety distance: so far from its waypoint a vehicle may be."""
NEAR_M = 1e-3
"""A position this little outside of the site comes from rounding."""


@dataclass(frozen=True)
class Figures:
    """How far a search has come; parts of the cells that the known obstacles leave open."""

    explored_part: float
    explored_goal_part: float
    found_cells: int


class Search:
    """A search as the mission keeps it in memory: one grid that every scan is added to.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(self, spec: MissionSpec, search: SearchSpec, frame: LocalFrame, time_scale: float) -> None:
        self.spec = search
        self.site: Site = site_of(spec, search)
        self.version = 0
        """Scans that the grid was made of."""
        self.began_at: datetime | None = None
        """When its first step was committed."""
        self._frame = frame
        self.spare_m = SPARE_PART * spec.arrival_radius_m
        """What legs are to keep beside the safety distance."""
        self._step_m = spec.limits.max_step_m
        self._speed_mps = spec.speed_mps
        self._time_scale = time_scale
        self._grid = self.site.grid
        self._figures: Figures | None = None
        self._ground: SiteGround | None = None
        self._ways: SiteGround | None = None

    @property
    def grid(self) -> OccupancyGrid:
        """The grid as known now."""
        return self._grid

    def see(self, scans: Sequence[ScanReport]) -> None:
        """Add scans to the grid."""
        for scan in scans:
            place = self.place_m(scan)
            if place is None:
                continue
            bearings = np.radians(scan.first_bearing_deg + scan.bearing_step_deg * np.arange(len(scan.ranges_m)))
            # As they are stored: a restart makes the same grid of them.
            ranges = np.array(scan.ranges_m, dtype=np.float32).astype(np.float64)
            passing = np.zeros(len(ranges), dtype=np.bool_)
            passing[list(scan.mates)] = True
            doubt_m = DOUBT_CELLS * self._grid.cell_m
            self._grid = self._grid.seen_from(place, bearings, ranges, scan.reach_m, passing=passing, doubt_m=doubt_m)
            self.version += 1
        if scans:
            self._figures = self._ground = self._ways = None

    def refusal(self, scan: ScanReport) -> str:
        """Return why a scan cannot be used; empty when it can."""
        numbers = (scan.time_s, scan.first_bearing_deg, scan.bearing_step_deg, scan.reach_m)
        if not all(math.isfinite(n) for n in numbers):
            return f"time, bearings and reach are {numbers}: they must be numbers"
        if any(r < 0 for r in scan.ranges_m):
            return f"a range of {min(scan.ranges_m):g} m: ranges are 0 or more"
        if len(scan.ranges_m) * abs(scan.bearing_step_deg) > 360.0 + 1e-6:
            return (
                f"{len(scan.ranges_m)} beams of {scan.bearing_step_deg:g} degrees are more than once round: "
                "send every turn as a scan of its own"
            )
        place = self.place_m(scan)
        if place is None:
            return f"{scan.position.lat_deg}, {scan.position.lon_deg} is not near the site"
        row, col = self._grid.cell_of(place)
        rows, cols = self._grid.blueprint.shape
        if not (0 <= row < rows and 0 <= col < cols):
            return f"{place[0]:.1f} m east, {place[1]:.1f} m north is outside of the site"
        return ""

    def place_m(self, scan: ScanReport) -> FloatArray | None:
        """Return where a scan was taken, (2,); None when that is not near the site."""
        try:
            east, north = self._frame.to_local(scan.position.lat_deg, scan.position.lon_deg)
        except ValueError:
            return None
        place = np.array([float(east), float(north)])
        return np.where(np.abs(place) < NEAR_M, np.abs(place), place) if np.isfinite(place).all() else None

    def knows(self, en_m: FloatArray) -> bool:
        """Return whether the cell at a place (2,) was looked at."""
        row, col = (int(x) for x in self._grid.cell_of(en_m))
        rows, cols = self._grid.evidence.shape
        return 0 <= row < rows and 0 <= col < cols and bool(np.isfinite(self._grid.evidence[row, col]))

    def task(self, left_m: float, *, spare_m: float = 0.0) -> SearchTask:
        """Return the task as planners see it.

        Parameters
        ----------
        left_m
            How far each vehicle can still travel.
        spare_m
            What legs are to keep beside the safety distance.
        """
        spec = self.spec
        return SearchTask(
            grid=self._grid,
            scanner=self.site.scanner,
            goal_m=self.site.goal_m,
            goal_radius_m=spec.goal_radius_m,
            entry_m=self.site.entry_m,
            transmitter_m=self.site.transmitter_m,
            com_range_m=spec.transmitter_range_m,
            safety_m=spec.safety_m,
            step_m=self._step_m,
            left_m=left_m,
            window_m=spec.window_s * self._speed_mps,
            spare_m=spare_m,
        )

    def clear(self, origin_m: FloatArray, end_m: FloatArray) -> bool:
        """Return whether a straight leg between places (2,) keeps the safety distance from every hazard known now."""
        if self._ground is None:
            self._ground = SiteGround.for_legs(self.task(0.0))
        return bool(self._ground.clear(origin_m, end_m[None])[0])

    def way_m(
        self, here_m: FloatArray, end_m: FloatArray, off_m: Sequence[FloatArray] = (), apart_m: float = 0.0
    ) -> FloatArray | None:
        """Return the corners (n, 2) of a way to a place (2,), every leg of it clear; None: no such way is known now.

        Parameters
        ----------
        off_m, apart_m
            Places (2,) to go round, and how far from them.
        """
        if not len(off_m):
            return self._way_m(lambda ground: ground.way(here_m, end_m))
        ways = (SiteGround.of(self._task_of_ways(np.array(off_m), apart_m, spare_m)) for spare_m in (self.spare_m, 0.0))
        return next((way for ground in ways if (way := ground.way(here_m, end_m)) is not None), None)

    def _way_m(self, found: Callable[[SiteGround], FloatArray | None]) -> FloatArray | None:
        """Return a way that keeps what is spared beside the safety distance, or where none does one that does not."""
        way_m = found(self._seen_ground)
        return found(SiteGround.of(self.task(0.0))) if way_m is None and self.spare_m > 0.0 else way_m

    def way_towards_m(self, here_m: FloatArray, end_m: FloatArray) -> FloatArray | None:
        """Return the corners (n, 2) of a way to a place (2,), or as near to it as ways lead by what is known now.

        Every leg of it is clear. None: nothing nearer than where it begins is known to be free.
        """
        whole = self.way_m(here_m, end_m)
        return self._way_m(lambda ground: ground.way_towards(here_m, end_m)) if whole is None else whole

    def gets_away(self, en_m: FloatArray) -> bool:
        """Return whether a vehicle at a place (2,) gets a step away from there, by ways that are known now."""
        grounds = (self._seen_ground, SiteGround.of(self.task(0.0)))
        return any(ground.reaches_m(en_m) >= self._step_m for ground in grounds)

    @property
    def may_see_more(self) -> bool:
        """Whether there are cells that nobody has looked at."""
        return bool((self._grid.states == Cell.UNEXPLORED).any())

    def may_be_open(self, en_m: FloatArray) -> bool:
        """Return whether a place (2,) is on the site and keeps the safety distance from what is known to stand there.

        Nobody need have looked there yet.
        """
        return self._seen_ground.may_be_open(en_m)

    def _task_of_ways(self, off_m: FloatArray, apart_m: float, spare_m: float) -> SearchTask:
        return replace(self.task(0.0, spare_m=spare_m), standing_m=off_m, apart_m=apart_m)

    @property
    def _seen_ground(self) -> SiteGround:
        if self._ways is None:
            self._ways = SiteGround.of(self.task(0.0, spare_m=self.spare_m))
        return self._ways

    @property
    def figures(self) -> Figures:
        """How much of the site, and of its goal area, was explored."""
        if self._figures is None:
            task = self.task(0.0)
            found = int(np.count_nonzero(task.states == Cell.FOUND))
            self._figures = Figures(task.explored_part, task.explored_goal_part, found)
        return self._figures

    def contact(self, en_m: FloatArray) -> bool:
        """Return whether a place (2,) is within the transmitter's range."""
        return bool(in_contact(en_m, self.task(0.0)) >= 0.5)

    def left_s(self, at: datetime | None = None) -> float:
        """Return how much of the time window is left, seconds of vehicle time; all of it before the first step.

        ``at``: when it ended, if it did; from then on no time runs.
        """
        if self.began_at is None:
            return self.spec.window_s
        return self.spec.window_s - ((at or now()) - self.began_at).total_seconds() * self._time_scale

    def way_to_entry_m(self, en_m: FloatArray) -> float:
        """Return the straight distance from a place (2,) to the entry."""
        return float(np.hypot(*(en_m - self.site.entry_m)))

    def home_radius_m(self, vehicles: int) -> float:
        """Return within which distance of the entry each vehicle of a team counts as being back."""
        return HOME_STEPS * self._step_m * max(vehicles, 1)
