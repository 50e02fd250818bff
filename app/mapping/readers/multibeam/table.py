"""Soundings of multibeam files near a place: which are kept, which are left out, and what is said about it."""

from datetime import UTC, datetime

import numpy as np
import pyproj
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray
from app.mapping.cell_index import cell_numbers
from app.mapping.readers.georeferencing import with_margin
from app.mapping.readers.multibeam.types import FilePing, damaged
from app.mapping.readers.types import MAX_DEPTH_M, MAX_SOUNDINGS, MapExtent, Points, ReadError
from app.mapping.types import Grid, Soundings

BATCH_SOUNDINGS = 1 << 16
"""Soundings are placed together as soon as so many wait."""
REACH_M = 15_000.0
"""Farther aside no sonar sees; what lies beyond is damaged."""
NEAR_M = 180_000.0
"""Of a ping from the frame's origin; farther away the flat frame is not meant to be used."""

_AHEAD_M = 100.0
_GEOD = pyproj.Geod(ellps="WGS84")


class SwathTable:
    """Soundings of one file near a place, ping after ping.

    Of more than ``MAX_SOUNDINGS`` the mean of each cell of the mission's grid is kept, so that memory has an end
    whatever the file's length.
    """

    def __init__(self, place: MapExtent) -> None:
        self._place = place
        self._grid = with_margin(place)
        self._waiting: list[FilePing] = []
        self._waiting_soundings = 0
        self._parts: list[FloatArray] = []
        """Each (5, n): east, north, depth, its standard deviation and the detection's."""
        self._numbers: list[NDArray[np.int32]] = []
        self._kept = 0
        self._means: _CellMeans | None = None
        self._usable = self._beams = self._rejected = self._without_depth = self._pings = 0
        self._first_s, self._last_s = np.inf, -np.inf

    def add(self, ping: FilePing) -> None:
        """Take a ping. Raises ReadError when a sounding of it cannot be."""
        usable = ping.detected & ~ping.rejected
        self._pings += 1
        self._first_s, self._last_s = min(self._first_s, ping.time_s), max(self._last_s, ping.time_s)
        self._beams += len(ping)
        self._rejected += int(np.count_nonzero(ping.rejected))
        self._without_depth += int(np.count_nonzero(~ping.rejected & ~ping.detected))
        values = np.stack([ping.depth_m, ping.forward_m, ping.starboard_m])[:, usable]
        limits = np.array([[MAX_DEPTH_M], [REACH_M], [REACH_M]])
        if not (np.abs(values) <= limits).all():  # NaN is none, too
            raise damaged(
                f"ping {ping.number}", f"a sounding of it is deeper than {MAX_DEPTH_M:g} m or farther than a sonar sees"
            )
        self._usable += values.shape[1]
        if values.shape[1]:
            self._waiting.append(ping)
            self._waiting_soundings += len(ping)
        if self._waiting_soundings >= BATCH_SOUNDINGS:
            self._place_waiting()

    def points(self, notes: list[str], incomplete: int) -> Points:
        """Return the soundings, with notes about them before ``notes``.

        Parameters
        ----------
        incomplete
            Pings that were passed over.

        Raises
        ------
        ReadError
            When there is none.
        """
        self._place_waiting()
        if not self._kept:
            if self._usable:
                raise ReadError(
                    "file", "none of its depths lies near the mission's area", "send lines that cross the area"
                )
            raise ReadError(
                "file",
                f"no sounding in it can be used: of {self._beams} in {self._pings} pings {self._rejected} are rejected "
                f"in the file and {self._without_depth} have no depth; {incomplete} pings are incomplete",
                "send a file with accepted soundings",
            )
        about = self._summary(incomplete)
        if self._means is None:
            table, numbers = np.concatenate(self._parts, axis=1), np.concatenate(self._numbers)
        else:
            self._fold()
            table, numbers = self._means.table()
            about += f"; {self._kept} near the area were averaged to the map's cells of {self._grid.cell_m:g} m"
        if table[4].any():
            notes = [*notes, "the sonar's deviations are of its detections alone; they are added to what is assumed"]
        east, north, depth, sd, detection_sd = table
        return Points(
            east,
            north,
            depth,
            sd,
            detection_sd_m=detection_sd,
            crs=self._place.frame.crs,
            positive="down",
            lines=numbers,
            counted="ping",
            found=self._usable,
            notes=(about, *notes),
        )

    def _place_waiting(self) -> None:
        """Place the pings that wait, and keep those of their soundings that lie near."""
        pings, self._waiting, self._waiting_soundings = self._waiting, [], 0
        lat = np.array([ping.lat_deg for ping in pings])
        lon = np.array([ping.lon_deg for ping in pings])
        frame = self._place.frame
        away = np.full(len(pings), frame.origin_lon_deg), np.full(len(pings), frame.origin_lat_deg)
        near = np.flatnonzero(np.asarray(_GEOD.inv(*away, lon, lat)[2]) <= NEAR_M)
        pings = [pings[i] for i in near]
        if not pings:
            return
        lat, lon = lat[near], lon[near]
        forward = self._forward(lat, lon, np.array([ping.heading_deg for ping in pings]))
        ping_of = np.repeat(np.arange(len(pings)), [len(ping) for ping in pings])
        usable = np.concatenate([ping.detected & ~ping.rejected for ping in pings])
        ping_of = ping_of[usable]

        def column(name: str) -> FloatArray:
            return np.asarray(np.concatenate([getattr(ping, name) for ping in pings])[usable])

        along, across = column("forward_m"), column("starboard_m")
        east0, north0 = frame.to_local(lat, lon)
        east = east0[ping_of] + forward[0, ping_of] * along + forward[1, ping_of] * across
        north = north0[ping_of] + forward[1, ping_of] * along - forward[0, ping_of] * across
        inside = self._inside(east, north)
        if inside.any():
            table = np.stack([east, north, *map(column, ("depth_m", "sd_m", "detection_sd_m"))])[:, inside]
            numbers = np.array([ping.number for ping in pings], np.int32)
            self._keep(table, numbers[ping_of[inside]])

    def _forward(self, lat: FloatArray, lon: FloatArray, heading: FloatArray) -> FloatArray:
        """Return where forward points in the frame, east and north for each metre, (2, n)."""
        ahead_lon, ahead_lat, _ = _GEOD.fwd(lon, lat, heading, np.full(len(lat), _AHEAD_M))
        here = np.array(self._place.frame.to_local(lat, lon))
        return np.asarray((np.array(self._place.frame.to_local(ahead_lat, ahead_lon)) - here) / _AHEAD_M)

    def _inside(self, east: FloatArray, north: FloatArray) -> BoolArray:
        grid, margin_m = self._place.grid, self._place.margin_m
        wide, high = grid.cols * grid.cell_m, grid.rows * grid.cell_m
        across = (east >= grid.west_m - margin_m) & (east <= grid.west_m + wide + margin_m)
        return np.asarray(across & (north >= grid.south_m - margin_m) & (north <= grid.south_m + high + margin_m))

    def _keep(self, table: FloatArray, numbers: NDArray[np.int32]) -> None:
        self._parts.append(table)
        self._numbers.append(numbers)
        self._kept += table.shape[1]
        if self._kept > MAX_SOUNDINGS:
            self._means = self._means or _CellMeans(self._grid)
            if sum(len(part) for part in self._numbers) >= 4 * BATCH_SOUNDINGS:
                self._fold()

    def _fold(self) -> None:
        if self._means is not None and self._parts:
            self._means.add(np.concatenate(self._parts, axis=1), np.concatenate(self._numbers))
        self._parts, self._numbers = [], []

    def _summary(self, incomplete: int) -> str:
        begin, end = (
            datetime.fromtimestamp(time, UTC).isoformat(timespec="seconds") for time in (self._first_s, self._last_s)
        )
        told = f"{self._pings} pings from {begin} to {end}"
        told += f"; {self._rejected} of {self._beams} soundings are rejected in the file and left out"
        if self._without_depth:
            told += f", {self._without_depth} have no depth"
        if incomplete:
            told += f"; {incomplete} pings are incomplete and left out"
        return told


class _CellMeans:
    """Mean of the soundings in each cell; of their variances, too, as far as they are stated."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        cells = grid.rows * grid.cols
        self._count = np.zeros(cells, np.int64)
        self._stated = np.zeros(cells, np.int64)
        self._sums = np.zeros((5, cells))
        """East, north, depth, its variance and the detection's."""
        self._number = np.zeros(cells, np.int32)

    def add(self, table: FloatArray, numbers: NDArray[np.int32]) -> None:
        """Add soundings (5, n) of some pings."""
        cells = cell_numbers(self._grid, Soundings(*table[:4]))
        inside = cells >= 0
        table, cells = table[:, inside], cells[inside]
        stated = table[3] > 0.0
        # In place: of many cells few are met at a time.
        for row, values in ((0, table[0]), (1, table[1]), (2, table[2]), (4, table[4] ** 2)):
            np.add.at(self._sums[row], cells, values)
        np.add.at(self._count, cells, 1)
        np.add.at(self._sums[3], cells[stated], table[3, stated] ** 2)
        np.add.at(self._stated, cells[stated], 1)
        self._number[cells] = numbers[inside]

    def table(self) -> tuple[FloatArray, NDArray[np.int32]]:
        """Return the means, (5, cells with any), and for each cell the number of one of its pings."""
        full = np.flatnonzero(self._count)
        means = self._sums[:, full]
        means[[0, 1, 2, 4]] /= self._count[full]
        with np.errstate(invalid="ignore"):
            means[3] /= self._stated[full]
        means[3:] = np.sqrt(means[3:])
        return means, self._number[full]
