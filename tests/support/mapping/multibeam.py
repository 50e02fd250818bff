"""Small files of multibeam sonars, written by libraries that are not ours."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from GSFU.gsfu import gsf, new_name_value_parameters, new_swath_bathymetry_ping
from KMALL.kmall import kmall

from app.mapping.coordinates.georeference import LocalFrame


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
    """Fields of the ping in GSF, by the names of gsfu; in KMALL those of its information, by the names of pykmall."""
    beams: dict[str, Any] = field(default_factory=dict)
    """Fields of soundings in KMALL, (n,) each, by the names of pykmall."""


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


WATER_LINE_M = -0.75
"""Of KMALL files: the vessel's reference point lies so far below the water surface, which counts upwards."""


def write_kmall(path: Path, pings: Sequence[SonarPing], version: int = 3) -> bytes:
    """Write a KMALL file of depths by pykmall, and return what is in it."""
    file = kmall(str(path))
    file.OpenFiletoWrite()
    for number, ping in enumerate(pings):
        file.write_EMdgmMRZ(_datagram(ping, number, version))
    file.FID.close()
    return path.read_bytes()


def _datagram(ping: SonarPing, number: int, version: int) -> dict[str, Any]:
    n, sectors, information = len(ping.depth_m), 2, {0: 144, 1: 152}.get(version, 156)
    sector_bytes = 36 if version == 0 else 48
    frame = LocalFrame(ping.lat_deg, ping.lon_deg)
    heading = np.radians(ping.heading_deg)
    forward, starboard = np.asarray(ping.forward_m), np.asarray(ping.starboard_m)
    lat, lon = frame.to_geographic(
        np.sin(heading) * forward + np.cos(heading) * starboard, np.cos(heading) * forward - np.sin(heading) * starboard
    )
    beams: dict[str, Any] = defaultdict(lambda: [0] * n)
    beams |= {
        "detectionMethod": [1] * n,
        "deltaLatitude_deg": lat - ping.lat_deg,
        "deltaLongitude_deg": lon - ping.lon_deg,
        "z_reRefPoint_m": np.asarray(ping.depth_m) + WATER_LINE_M,
        "y_reRefPoint_m": starboard,
        "x_reRefPoint_m": forward,
    }
    beams |= ping.beams
    size = 20 + 4 + 12 + information + sectors * sector_bytes + 32 + n * 120 + 4
    return {
        "header": {
            "numBytesDgm": size, "dgmVersion": version, "systemID": 0, "echoSounderID": 2040, "dgtime": ping.time_s,
        },
        "partition": {"numOfDgms": 1, "dgmNum": 1},
        "cmnPart": defaultdict(int, numBytesCmnPart=12, pingCnt=number),
        "pingInfo": defaultdict(
            int,
            {
                "numBytesInfoData": information,
                "numTxSectors": sectors,
                "numBytesPerTxSector": sector_bytes,
                "headingVessel_deg": ping.heading_deg,
                "txTransducerDepth_m": 1.5,
                "z_waterLevelReRefPoint_m": WATER_LINE_M,
                "latitude_deg": ping.lat_deg,
                "longitude_deg": ping.lon_deg,
            }
            | ping.more,
        ),
        "txSectorInfo": defaultdict(lambda: [0] * sectors),
        "rxInfo": defaultdict(
            int, numBytesRxInfo=32, numSoundingsMaxMain=n, numSoundingsValidMain=n, numBytesPerSounding=120
        ),
        "sounding": beams,
    }  # fmt: skip
