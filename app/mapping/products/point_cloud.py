"""Soundings as a point cloud for editors: LAZ, written piece by piece."""

from collections.abc import Sequence
from typing import IO

import laspy
import numpy as np
from laspy.header import GpsTimeType

from app.arrays import FloatArray
from app.mapping.coordinates.projected import ProjectedFrame

POINT_FORMAT, VERSION = 6, "1.4"
RESOLUTION_M = 0.001
BATHYMETRIC_POINT = 40
"""Class of points on the sea floor (ASPRS LAS domain profile for topo-bathymetry)."""
SCAN_ANGLE_DEG = 0.006
"""Unit of a point's angle."""
GPS_EPOCH_S, LEAP_S, OFFSET_S = 315_964_800, 18, 1_000_000_000
"""GPS time begins at this Unix time, is ahead of UTC since 2017, and is counted from this on in files."""
DEVIATION = "depth_sd"
OWN_RECORD = "bathyfleet"


class PointCloudFile:
    """A LAZ 1.4 file of depths, as elevations in metres, in a projected system.

    Parameters
    ----------
    file
        Open for reading and writing, at its beginning; left open.
    frame
        The system, and the way there from the mission's own frame.
    vehicles
        Names; a point's source id is the number of its vehicle, from 1.
    vertical_datum
        What depths are counted from, in words.
    """

    def __init__(self, file: IO[bytes], frame: ProjectedFrame, vehicles: Sequence[str], vertical_datum: str) -> None:
        self._frame, self._vehicles = frame, list(vehicles)
        header = laspy.LasHeader(point_format=POINT_FORMAT, version=VERSION)
        header.generating_software = header.system_identifier = "bathyfleet"
        header.global_encoding.gps_time_type = GpsTimeType.STANDARD
        header.scales = np.full(3, RESOLUTION_M)
        header.offsets = np.floor([*(float(of) for of in frame.from_local(0.0, 0.0)), 0.0])
        header.add_crs(frame.crs)
        header.add_extra_dim(laspy.ExtraBytesParams(DEVIATION, "float32", "standard deviation, m"))
        text = f"z: minus the depth from {vertical_datum}, metres; sources: " + "; ".join(
            f"{number} {name}" for number, name in enumerate(self._vehicles, 1)
        )
        header.vlrs.append(laspy.VLR(OWN_RECORD, 1, "datum and vehicles", text.encode()))
        self._header = header
        self._writer = laspy.open(
            file, mode="w", header=header, do_compress=True, laz_backend=laspy.LazBackend.Lazrs, closefd=False
        )

    def add(
        self,
        vehicle: str,
        time_s: FloatArray,
        east_m: FloatArray,
        north_m: FloatArray,
        depth_m: FloatArray,
        sd_m: FloatArray,
        angle_rad: FloatArray | None = None,
    ) -> None:
        """Append soundings of one vehicle, each array of shape (n,); positions are in the mission's own frame.

        Parameters
        ----------
        time_s
            Unix seconds.
        angle_rad
            From straight down in the vehicle, positive to starboard; None: not known, told as 0.
        """
        points = laspy.ScaleAwarePointRecord.zeros(len(time_s), header=self._header)
        points.x, points.y = self._frame.from_local(east_m, north_m)
        points.z = -depth_m
        points.gps_time = time_s - GPS_EPOCH_S + LEAP_S - OFFSET_S
        points.classification[:] = BATHYMETRIC_POINT
        points.return_number[:] = points.number_of_returns[:] = 1
        points.point_source_id[:] = self._vehicles.index(vehicle) + 1
        points[DEVIATION] = sd_m
        if angle_rad is not None:
            points.scan_angle = np.round(np.degrees(angle_rad) / SCAN_ANGLE_DEG)
        self._writer.write_points(points)

    def close(self) -> None:
        """Write what has to be known of all points; the file stays open."""
        self._writer.close()
