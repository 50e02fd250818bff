"""A multibeam's own file (GSF, KMALL) as the pings and positions that a vehicle's log gives."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import PurePath

import numpy as np

from app.mapping.readers.file_extensions import MULTIBEAM
from app.mapping.readers.multibeam.beams import beams_of
from app.mapping.readers.multibeam.points import open_multibeam
from app.mapping.readers.multibeam.types import FilePing, MultibeamFile
from app.mapping.readers.types import ReadError
from app.missions.errors import InvalidRequestError
from imc_bridge import StateReport, SwathPing
from imc_bridge.logs import LogContent

LEAST_MOVED_M = 0.01
"""Below this nothing is said of soundings that were moved."""
SAME_TIME_S = 1e-6
"""Between pings that a file gives one time: swaths of one transmission, or two receivers."""


class MultibeamLog:
    """One multibeam's file as events in the order of the file, as ``imc_bridge.logs.VehicleLog`` gives them.

    It is read to its end before it gives the first event, so that of a damaged one nothing is taken.

    Parameters
    ----------
    near
        Tells of a latitude and longitude whether pings from there are of use.

    Raises
    ------
    InvalidRequestError
        When the file is damaged, has no vehicle's name given, or depths that cannot be taken back to the water surface.
    OSError
        When it cannot be read.
    """

    def __init__(self, path: LogContent, vehicle: str | None, near: Callable[[float, float], bool]) -> None:
        self.size_bytes = path.stat().st_size
        self.read_bytes = 0
        self.packets = 0
        self.skipped_bytes = 0
        self.cut_off = False
        self.refused: Counter[str] = Counter()
        self.faults: dict[str, int] = {}
        self.notes: list[str] = []
        self._path = path
        self._near = near
        self._opened: MultibeamFile | None = None
        self._found = 0
        if vehicle is None:
            raise InvalidRequestError(
                "vehicle",
                f"{path.name} does not tell its vehicle's name",
                "say whose it is: --vehicle NAME, by REST vehicle=NAME",
            )
        self.vehicle = vehicle
        self._check()

    @property
    def file(self) -> "MultibeamLog":
        """What has been read of the file so far."""
        return self

    def unpacked_sha256(self) -> str:
        """Return nothing: these files are as they are."""
        return ""

    def events(self) -> Iterator[StateReport | SwathPing]:
        """Yield the pings near, each after where the sonar was; the same file gives the same events every time."""
        self.refused.clear()
        self.packets = 0
        moved_m, last_s, repeated, levelled = 0.0, math.nan, 0, False
        kind = _ending(self._path.name)
        for ping in self._pings():
            self.packets = ping.number
            repeated = repeated + 1 if ping.time_s == last_s else 0
            last_s = ping.time_s
            if not self._near(ping.lat_deg, ping.lon_deg):
                self.refused["the ping is too far from the area"] += 1
                continue
            beams = beams_of(ping)
            if beams is None:
                self.refused["the ping has no sounding below the sonar that may be used"] += 1
                continue
            moved_m = max(moved_m, beams.moved_m)
            time_s = ping.time_s + repeated * SAME_TIME_S
            yield StateReport(
                self.vehicle, time_s, beams.lat_deg, beams.lon_deg, beams.depth_m, beams.heading_rad, speed_mps=0.0
            )
            yield SwathPing(
                vehicle=self.vehicle,
                time_s=time_s,
                lat_deg=beams.lat_deg,
                lon_deg=beams.lon_deg,
                depth_m=beams.depth_m,
                roll_rad=0.0,
                pitch_rad=beams.pitch_rad,
                yaw_rad=beams.heading_rad,
                angles_rad=beams.angle_rad.astype(np.float32),
                ranges_m=beams.range_m.astype(np.float32),
                source=kind.removeprefix(".").upper(),
            )
            levelled |= ping.level_m != 0.0
        self.read_bytes = self.size_bytes
        if self._opened is None:
            return
        if self._opened.incomplete:
            self.refused["the ping has no position, heading or soundings"] = self._opened.incomplete
        self.notes = self._opened.notes()
        if levelled:
            self.notes.append("the water's level was taken out of depths: they are below the water surface again")
        if moved_m >= LEAST_MOVED_M:
            self.notes.append(
                f"soundings were moved along the track by at most {moved_m:.2f} m, into one plane for each"
            )

    def _check(self) -> None:
        """Read the whole file, and look whether its depths can be taken back to the water surface."""
        unclear = InvalidRequestError(
            "file",
            "its depths are reduced for the tide, and it does not say by how much: a mission's tide would come on top",
            "give a file before that reduction, or take this one as depths to begin with: bathyfleet import",
        )
        for ping in self._pings():
            if math.isnan(ping.level_m):
                raise unclear
            values = np.stack([ping.depth_m, ping.starboard_m, ping.forward_m])
            if not np.isfinite(values[:, ping.detected & ~ping.rejected]).all():
                raise InvalidRequestError(
                    f"ping {ping.number}", "a sounding of it is no number", "copy the file again, or send a whole one"
                )
        if not self._found:
            raise InvalidRequestError("file", "it has no pings", "give a file with the sonar's soundings")
        if self._opened is not None and self._opened.reduced_unknown:
            raise unclear

    def _pings(self) -> Iterator[FilePing]:
        try:
            with self._path.open("rb") as raw:
                self._opened = open_multibeam(raw, _ending(self._path.name))
                for ping in self._opened.pings():
                    self.read_bytes, self._found = raw.tell(), ping.number
                    yield ping
        except ReadError as error:
            raise InvalidRequestError(error.field, str(error), error.remedy) from None


def is_multibeam(name: str) -> bool:
    """Tell by its name whether a file is a multibeam's."""
    return _ending(name) in MULTIBEAM


def _ending(name: str) -> str:
    return PurePath(name).suffix.lower()
