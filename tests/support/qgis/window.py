"""A picture of QGIS's window with a running survey, for the guide: ``python -m tests.support.qgis.window PICTURE``.

QGIS's window needs a display, which Xvfb draws into memory (Debian: ``apt-get install qgis python3-qgis xvfb xauth``).
"""

import argparse
import json
import os
import signal
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from app.mapping.coordinates.georeference import LocalFrame
from benchmarks.service.boats import running_service
from tests.support.dashboard.service import Service
from tests.support.qgis import environment

FRAME = LocalFrame(41.185, -8.705)
EAST_M, NORTH_M = 240.0, 150.0
VEHICLES = ("noptilus-1", "noptilus-2", "noptilus-3")
START_S = 1_795_225_000.0
LINES_M, SOUNDINGS_M = 6.0, 3.0
DONE = 0.72
"""The share of its lines that each vehicle has come through."""
SIZE = (1400, 860)
COLOURS = 256
WAIT_S = 150


def bottom_m(east: float, north: float) -> float:
    """A canyon that winds through a slope."""
    axis = 75.0 + 30.0 * np.sin(east / 45.0)
    return float(8.0 + 0.02 * east + 9.0 * np.exp(-(((north - axis) / 20.0) ** 2)) + 0.6 * np.sin(east / 11.0))


def lines(number: int) -> list[dict[str, Any]]:
    """What a vehicle measured on the lines of its strip, to and fro."""
    strip = EAST_M / len(VEHICLES)
    count, along = int(strip / LINES_M * DONE), np.arange(4.0, NORTH_M - 3.0, SOUNDINGS_M)
    items: list[dict[str, Any]] = []
    for line in range(count):
        for north in (along if line % 2 == 0 else along[::-1]).tolist():
            east = number * strip + LINES_M * (line + 0.5) + 0.8 * np.sin(north / 9.0)
            lat, lon = FRAME.to_geographic(east, north)
            place = {"lat_deg": float(lat), "lon_deg": float(lon)}
            measured = {"depth_m": 3.0, "range_m": bottom_m(east, north) - 3.0}
            items.append({"vehicle": VEHICLES[number], "time_s": START_S + 2.0 * (1 + len(items)), **place, **measured})
    return items


def survey(service: Service) -> str:
    """Let a mission run in which the vehicles have measured most of their lines."""
    corners = [(0, 0), (EAST_M, 0), (EAST_M, NORTH_M), (0, NORTH_M), (0, 0)]
    ring = [[float(lon), float(lat)] for lat, lon in (FRAME.to_geographic(e, n) for e, n in corners)]
    mission = service.create(
        name="Canyon",
        area={"type": "Polygon", "coordinates": [ring]},
        vehicles=[{"name": name, "kind": "rest"} for name in VEHICLES],
        cell_m=1.5,
        planner={"name": "random"},
        limits={"max_step_m": 30, "max_depth_m": 22, "min_separation_m": 0},
    )
    found = [lines(number) for number in range(len(VEHICLES))]
    path = f"/missions/{mission}/measurements"
    service.post(path, {"items": [items[0] | {"time_s": START_S} for items in found]})
    service.act(mission, "start")
    for items in found:
        answer = service.post(path, {"items": items})
        if answer["accepted"] != len(items):
            raise SystemExit(f"not all soundings were accepted: {answer}")
    service.get(f"/missions/{mission}/map")
    return mission


def take(picture: Path) -> None:
    """Save a picture of the window."""
    with tempfile.TemporaryDirectory() as folder, running_service(log_level="warning", time_scale="1") as service:
        taken = Path(folder) / "taken.png"
        shown = {"url": service.url, "mission": survey(service), "picture": str(taken), "size": SIZE}
        command = ["xvfb-run", "--auto-servernum", f"--server-args=-screen 0 {SIZE[0]}x{SIZE[1]}x24", "qgis"]
        command += ["--nologo", "--noversioncheck", "--noplugins", "--profiles-path", folder]
        command += ["--code", str(Path(__file__).with_name("in_window.py"))]
        around = environment(Path(folder)) | {"BATHYFLEET_SHOWN": json.dumps(shown)}
        with subprocess.Popen(command, env=around, start_new_session=True) as process:
            try:
                if process.wait(WAIT_S):
                    raise SystemExit(f"QGIS ended with code {process.returncode}")
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)  # with its display
                raise SystemExit(f"QGIS showed nothing within {WAIT_S} s") from None
        Image.open(taken).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(picture, optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", type=Path)
    take(parser.parse_args().picture)
