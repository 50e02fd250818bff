"""How long it takes from a sounding until QGIS shows it: ``python -m benchmarks.display.qgis [--soundings 20]``.

The real service flies a mission of vehicles that report five times a second. One more posts a sounding now and then, at
any moment, where nothing was sounded yet. QGIS itself, without its window, reloads its two layers once a second, as
*Refresh layer at interval* does: the density by WMS, and the soundings as features. Measured is the time from the first
byte of the sounding until a reload of QGIS shows it in its picture and among its features. Printed is one JSON object.
"""

import json
import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from PIL import Image

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import FRAME, START_S, Boat, begin, beside, create_mission, running_service
from tests.support.qgis import Qgis, installed

ASKED_S = 5.0
RELOAD_S = 1.0
PATIENCE_S = 60.0
VEHICLES = 4
"""The last one is that whose soundings are looked for."""
AROUND_M = 3.0


def view(boat: Boat) -> list[float]:
    """Return the ground around a vehicle, EPSG:3857."""
    to_mercator = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:3857")
    ends = (FRAME.to_geographic(boat.east_m + side * AROUND_M, boat.north_m + side * AROUND_M) for side in (-1.0, 1.0))
    (west, south), (east, north) = (to_mercator.transform(float(lat), float(lon)) for lat, lon in ends)
    return [west, south, east, north]


def looks(qgis: Qgis, folder: Path, extent: list[float]) -> dict[str, Callable[[], bool]]:
    """Return what tells whether QGIS shows something after a reload."""

    def drawn() -> bool:
        qgis.picture(folder / "now.png", ["density"], extent, (300, 300))
        return bool((np.asarray(Image.open(folder / "now.png").convert("RGB")) < 250).any())

    return {"wms": drawn, "features": lambda: qgis.count("soundings", extent) > 0}


def seconds_until_seen(
    post: Callable[[], None], seen: dict[str, Callable[[], bool]], wait_s: float
) -> dict[str, float]:
    """Post after a while, reload once a second, and return how long it took until each showed it."""
    due = time.monotonic() + RELOAD_S
    time.sleep(wait_s)
    began = time.monotonic()
    post()
    took: dict[str, float] = {}
    while len(took) < len(seen):
        if time.monotonic() - began > PATIENCE_S:
            raise SystemExit(f"QGIS did not show a sounding within {PATIENCE_S:g} s: it showed {took}")
        time.sleep(max(0.0, due - time.monotonic()))
        due = max(due + RELOAD_S, time.monotonic())
        for name, look in seen.items():
            if name not in took and look():
                took[name] = time.monotonic() - began
    return took


def measured(soundings: int, seed: int, folder: Path) -> dict[str, Any]:
    """Return how long soundings took."""
    rng = random.Random(seed)  # noqa: S311 - no secret
    found: dict[str, list[float]] = {"wms": [], "features": []}
    with running_service(log_level="warning", time_scale="1") as service, Qgis(folder) as qgis:
        mission = create_mission(service, VEHICLES)
        begin(service, mission, VEHICLES)
        qgis.add_map("density", f"{service.url}/wms/missions/{mission}", ["density"])
        qgis.add_features("soundings", f"{service.url}/ogc/missions/{mission}", "soundings")
        boat = Boat(f"boat-{VEHICLES - 1}", 480.0, 20.0, time_s=START_S + 1e6)
        with beside("sail", service.url, mission, str(VEHICLES - 1), "1.0"):
            while len(found["wms"]) < soundings:
                boat.time_s, boat.north_m = boat.time_s + 10.0, boat.north_m + 8.0
                seen = looks(qgis, folder, view(boat))
                if any(look() for look in seen.values()):
                    continue  # others were here
                item = boat.item(2.0, sounds=True)

                def post(item: dict[str, Any] = item) -> None:
                    answer = service.post(f"/missions/{mission}/measurements", {"items": [item]})
                    if answer["accepted"] != 1:
                        raise SystemExit(f"the sounding was not accepted: {answer}")

                for name, took_s in seconds_until_seen(post, seen, rng.random() * RELOAD_S).items():
                    found[name].append(took_s)
    return {name: f"{np.median(s):.2f} median, {np.max(s):.2f} worst" for name, s in found.items()} | {
        "slower_than_asked": sum(took_s > ASKED_S for s in found.values() for took_s in s)
    }


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD, seeds=[0])
    parser.add_argument("--soundings", type=int, default=20)
    options = parser.parse_args()
    if not installed():
        raise SystemExit("QGIS is not here: apt-get install qgis python3-qgis")
    result: dict[str, Any] = {"soundings": options.soundings, "reload_s": RELOAD_S, "asked_s": ASKED_S}
    for seed in options.seeds:
        with tempfile.TemporaryDirectory() as folder:
            result[f"seed_{seed}_s"] = measured(options.soundings, seed, Path(folder))
    json.dump(result, sys.stdout)
    print()
    write_section(options.write, LOAD, "QGIS follows a running survey", result, seeds=options.seeds)


if __name__ == "__main__":
    main()
