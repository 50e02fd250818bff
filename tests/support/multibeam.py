"""Small files of multibeam sonars, written by libraries that are not ours."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from GSFU.gsfu import gsf, new_name_value_parameters, new_swath_bathymetry_ping

from app.mapping.georeference import LocalFrame


@dataclass
class SonarPing:
    """A ping; arrays are (n,) in metres, depth below the water surface."""

    lat_deg: float
    lon_deg: float
    heading_deg: float
    forward_m: Any
    starboard_m: Any
    depth_m: Any
    time_s: float = 1_700_000_000.0
    error_95_m: Any = None
    flags: Any = None
    more: dict[str, Any] = field(default_factory=dict)
    """Fields of the ping in GSF, by the names of gsfu."""


def line(
    frame: LocalFrame, pings: int = 12, beams: int = 21, heading_deg: float = 60.0, **more: Any
) -> list[SonarPing]:
    """A line through the origin: depth is 20 m at the origin, 0.1 m more for each metre to the east, 0.2 to the north.

    Pings are 2 m apart, beams reach 20 m to each side and lie up to 3 m ahead.
    """
    heading = np.radians(heading_deg)
    ahead = np.array([np.sin(heading), np.cos(heading)])
    starboard, forward = np.linspace(-20.0, 20.0, beams), np.linspace(0.0, 3.0, beams)
    made = []
    for number in range(pings):
        middle = 2.0 * (number - pings / 2) * ahead
        lat, lon = frame.to_geographic(*middle)
        east = middle[0] + ahead[0] * forward + ahead[1] * starboard
        north = middle[1] + ahead[1] * forward - ahead[0] * starboard
        ping = SonarPing(float(lat), float(lon), heading_deg, forward, starboard, floor(east, north))
        ping.time_s += 0.5 * number
        for name, value in more.items():
            setattr(ping, name, value)
        made.append(ping)
    return made


def floor(east_m: Any, north_m: Any) -> Any:
    """Depth of the plane that :func:`line` surveys."""
    return 20.0 + 0.1 * np.asarray(east_m) + 0.2 * np.asarray(north_m)


def write_gsf(
    path: Path, pings: Sequence[SonarPing], parameters: dict[str, str] | None = None, version: str = "GSF-v03.09"
) -> bytes:
    """Write a GSF file by gsfu, and return what is in it."""
    file = gsf(str(path))
    file.write_header({"Version": version})
    if parameters is not None:
        record = new_name_value_parameters()
        record.update(ParamTime=pings[0].time_s, Parameters=parameters)
        file.write_processing_parameters(record)
    for ping in pings:
        record = new_swath_bathymetry_ping()
        record.update(
            PingTime=ping.time_s,
            Longitude_deg=ping.lon_deg,
            Latitude_deg=ping.lat_deg,
            Heading_deg=ping.heading_deg,
            NumberBeams=len(ping.depth_m),
        )
        record.update(ping.more)
        record["Beams"] = {
            "Depth_m": ping.depth_m,
            "AcrossTrack_m": ping.starboard_m,
            "AlongTrack_m": ping.forward_m,
        }
        if ping.error_95_m is not None:
            record["Beams"]["VerticalError_m"] = ping.error_95_m
        if ping.flags is not None:
            record["Beams"]["BeamFlags"] = ping.flags
        file.write_swath_bathymetry_ping(record)
    file.closeFile()
    return path.read_bytes()
