"""How long a mission of millions of soundings takes to open.

``python -m benchmarks.service.opening [--soundings 5000000]``. A database is filled, then the real service is started
twice. The first start knows no map of the mission and makes it; the second opens the mission by the map that was
stored. Measured from the first request on: the mission, the live view's first message, and the map's tiles, as the
dashboard asks for them; meanwhile another client asks every 10 ms whether the process lives: the longest it waited is
how long anything else was held up. ``--browser``: the page, too, in Chromium. Printed is one JSON object.
"""

import asyncio
import json
import sys
import threading
import time
from pathlib import Path
from typing import Any

import httpx
import psutil
import websockets

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import SIDE_M, create_mission, running_service
from benchmarks.service.dashboard import CHROMIUM, FLAGS
from benchmarks.service.filling import fill
from tests.support.dashboard.service import Service

ORIGIN = (41.185, -8.705)
TOGETHER_S = 0.01


class Watch:
    """Asks again and again whether the process lives, and notes its memory."""

    def __init__(self, service: Service) -> None:
        self.longest_s = 0.0
        self.memory_mb = 0.0
        self._url = f"{service.url}/health/live"
        self._process = psutil.Process(service.pid)
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._ask)

    def __enter__(self) -> "Watch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def _ask(self) -> None:
        with httpx.Client(timeout=600) as client:
            while not self._done.wait(TOGETHER_S):
                began = time.perf_counter()
                client.get(self._url)
                self.longest_s = max(self.longest_s, time.perf_counter() - began)
                self.memory_mb = max(self.memory_mb, self._process.memory_info().rss / 1e6)


async def live_view(service: Service, mission: str) -> float:
    """Seconds until the live view told how the mission stands."""
    began = time.perf_counter()
    address = service.url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
    async with websockets.connect(address, max_size=None) as line:
        await line.recv()
    return time.perf_counter() - began


def get_s(service: Service, path: str) -> tuple[float, int]:
    """Seconds and bytes of an answer."""
    began = time.perf_counter()
    answer = httpx.get(f"{service.url}/api/v1{path}", timeout=600).raise_for_status()
    return time.perf_counter() - began, len(answer.content)


def open_mission(service: Service, mission: str) -> dict[str, Any]:
    """Ask for what the dashboard asks for."""
    process = psutil.Process(service.pid)
    cpu = sum(process.cpu_times()[:2])
    with Watch(service) as watch:
        first, _ = get_s(service, f"/missions/{mission}")
        live = asyncio.run(live_view(service, mission))
        tiles, size = get_s(service, f"/missions/{mission}/map/tiles")
    return {
        "mission_s": round(first, 2),
        "live_view_s": round(live, 2),
        "map_s": round(tiles, 2),
        "all_s": round(first + live + tiles, 2),
        "service_cpu_s": round(sum(process.cpu_times()[:2]) - cpu, 2),
        "longest_hold_up_ms": round(1000 * watch.longest_s),
        "memory_mb": round(watch.memory_mb),
        "map_mb": round(size / 1e6, 1),
    }


def browser_s(service: Service, mission: str) -> dict[str, float]:
    """Seconds until the page shows the mission, and the sea floor."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = chromium.new_context(viewport={"width": 1440, "height": 900}, base_url=service.url).new_page()
        page.goto(f"/#/missions/{mission}")
        while not page.evaluate("performance.getEntriesByName('sea-floor').length"):
            page.wait_for_timeout(50)
        marks = "name => performance.getEntriesByName(name)[0].startTime / 1000"
        found = {name: round(page.evaluate(marks, name), 2) for name in ("mission-shown", "sea-floor")}
        chromium.close()
    return found


def start_s(service: Service) -> float:
    """Start; seconds until requests are answered."""
    began = time.perf_counter()
    service.start()
    return round(time.perf_counter() - began, 1)


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--soundings", type=int, default=5_000_000)
    parser.add_argument("--browser", action="store_true")
    options = parser.parse_args()
    with running_service(log_level="warning") as service:
        mission = create_mission(service, 10)
        service.kill()
        fill(service.database, mission, options.soundings, SIDE_M, ORIGIN)
        result: dict[str, Any] = {"soundings": options.soundings, "cells": round(SIDE_M) ** 2}
        result["start_s"] = start_s(service)
        result["without_a_stored_map"] = open_mission(service, mission)
        wait_until_stored(service.database, mission)
        service.kill()
        result["start_again_s"] = start_s(service)
        result["with_its_stored_map"] = open_mission(service, mission)
        if options.browser:
            service.kill()
            service.start()
            result["page_s"] = browser_s(service, mission)
    print(json.dumps(result))
    write_section(
        options.write, LOAD, f"Opening a mission of {options.soundings:,} soundings".replace(",", " "), result
    )
    sys.exit(0 if result["with_its_stored_map"]["all_s"] <= 2.0 else 1)


def wait_until_stored(file: Path, mission: str) -> None:
    """Return when the map is in the database."""
    import sqlite3

    for _ in range(600):
        with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as connection:
            found = connection.execute("SELECT 1 FROM stored_maps WHERE mission_id = ?", (mission,)).fetchall()
        connection.close()
        if found:
            return
        time.sleep(0.5)
    raise SystemExit("the map was not stored")


if __name__ == "__main__":
    main()
