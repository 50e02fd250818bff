"""Tracks of soundings that cross each other, what is posted of them, and GMT's word on them."""

import shutil
import subprocess
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from app.arrays import FloatArray
from tests.support.missions.specs import lon_lat

GMT = shutil.which("gmt")
"""Where it is installed (Debian: apt-get install gmt)."""

DEPTH_M = 12.0
"""Of the flat floor that measurements are made over."""

DEFINITION = """# Time, place and depth
#SKIP 0
#ASCII
t a N 0 1 0 %.6f
x a N 0 1 0 %.6f
y a N 0 1 0 %.6f
z a N 0 1 0 %.6f
"""


def flown(corners_m: Iterable[tuple[float, float]], *, spacing_m: float = 1.0, start_s: float = 0.0) -> FloatArray:
    """Soundings (n, 5) along straight ways between corners, one metre a second, depth zero, deviation 0.1 m."""
    corners = np.array(list(corners_m), dtype=float)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at = np.arange(0.0, along[-1] + 1e-9, spacing_m)
    east, north = (np.interp(at, along, column) for column in corners.T)
    return np.column_stack([start_s + at, east, north, np.zeros(len(at)), np.full(len(at), 0.1)])


def lawnmower(width_m: float, height_m: float, spacing_m: float) -> list[tuple[float, float]]:
    """Corners of lines from south to north and back."""
    corners: list[tuple[float, float]] = []
    for k, east in enumerate(np.arange(0.0, width_m + 1e-9, spacing_m).tolist()):
        ends = [(east, 0.0), (east, height_m)]
        corners += ends if k % 2 == 0 else ends[::-1]
    return corners


def measured(vehicle: str, way: FloatArray, depth_m: float = DEPTH_M) -> list[dict[str, Any]]:
    """Soundings straight down along a way."""
    items = []
    for time_s, east_m, north_m, *_ in way.tolist():
        lon, lat = lon_lat(east_m, north_m)
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0}
        items.append({"vehicle": vehicle, "time_s": time_s, "range_m": depth_m - 2.0} | place)
    return items


def pinged(vehicle: str, way: FloatArray, wrong_roll_deg: float = 0.0) -> list[dict[str, Any]]:
    """Pings of eleven beams over a flat floor; what the vehicle says of its roll is wrong."""
    east, north = np.gradient(way[:, 1]), np.gradient(way[:, 2])
    angles = np.arange(-50.0, 51.0, 10.0)
    ranges = (DEPTH_M - 2.0) / np.cos(np.radians(angles + wrong_roll_deg))
    beams = {"angles_deg": angles.tolist(), "ranges_m": ranges.tolist()}
    items = measured(vehicle, way)
    for item, heading in zip(items, np.degrees(np.arctan2(east, north)).tolist(), strict=True):
        del item["range_m"]
        item |= {"heading_deg": heading % 360.0, "beams": beams}
    return items


def gmt_crossings(tables: Mapping[str, FloatArray], folder: Path, *, gap_s: float, gap_m: float) -> FloatArray:
    """Return what GMT's ``x2sys_cross`` finds on tracks (n, 5), (k, 5): east, north, both times, difference.

    The difference is the later minus the earlier of one track, else the first name's minus the second's. GMT 6.4 takes
    a largest distance (``-Wd``) and does not keep to it: crossings within longer steps are left out here.
    """
    assert GMT is not None
    (folder / "track.def").write_text(DEFINITION)
    names = sorted(tables)
    for name in names:
        np.savetxt(folder / f"{name}.track", tables[name][:, :4], fmt="%.9f")
    places = np.concatenate([tables[name][:, 1:3] for name in names])
    (west, south), (east, north) = np.floor(places.min(axis=0)) - 1, np.ceil(places.max(axis=0)) + 1
    region = f"-R{west:g}/{east:g}/{south:g}/{north:g}"
    environment = {"X2SYS_HOME": str(folder), "HOME": str(folder)}

    def gmt(*words: str) -> str:
        run = subprocess.run(
            [str(GMT), *words, "--FORMAT_FLOAT_OUT=%.12g", "--FORMAT_CLOCK_OUT=hh:mm:ss.xxxxxx"],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        return run.stdout

    gmt("x2sys_init", "T", "-Dtrack", "-Etrack", "-F", "-Ndc", "-Nsc", region, f"-Wt{gap_s:g}")
    found: list[list[float]] = []
    both, same = ["", ""], False
    for text in gmt("x2sys_cross", *names, "-TT", "-Z", "-Il").splitlines():
        words = text.split()
        if text.startswith(">"):
            both = [words[1], words[3]]
            same = both[0] == both[1]
        elif not text.startswith("#"):
            times = [datetime.fromisoformat(word).replace(tzinfo=UTC).timestamp() for word in words[2:4]]
            if any(_step_m(tables[name], time_s) > gap_m for name, time_s in zip(both, times, strict=True)):
                continue
            difference = float(words[-2]) - float(words[-1])
            if same and times[0] < times[1]:
                times, difference = times[::-1], -difference
            found.append([float(words[0]), float(words[1]), *times, difference])
    return np.array(found).reshape(-1, 5)


def _step_m(table: FloatArray, time_s: float) -> float:
    """How far apart the soundings are between which a time lies."""
    after = min(max(int(np.searchsorted(table[:, 0], time_s)), 1), len(table) - 1)
    return float(np.hypot(*(table[after, 1:3] - table[after - 1, 1:3])))
