"""How long a mission of millions of soundings takes to open.

``python -m benchmarks.service.opening [--soundings 5000000]``. A database is filled, then the real service is started
twice. The first start knows no map of the mission and makes it; the second opens the mission by the map that was
stored. Measured from the first request on: the mission, the live view's first message, and the map's tiles, as the
dashboard asks for them; meanwhile another client asks every 10 ms whether the process lives: the longest it waited is
how long anything else was held up. ``--browser``: the page, too, in Chromium. ``--keep FOLDER`` leaves the filled
database there, for the next run. ``--before TREE`` compares with the program of another work tree: both make the map
in turn, of one database. Printed is one JSON object.
"""

import argparse
import asyncio
import contextlib
import json
import sqlite3
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import psutil
import websockets

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import SIDE_M, create_mission
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
    answer = httpx.get(f"{service.url}/api/v1{path}", timeout=3600).raise_for_status()
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


@contextlib.contextmanager
def filled(options: argparse.Namespace) -> Iterator[tuple[Path, str]]:
    """Yield the folder of a database that holds so many soundings of one mission, and the mission's id."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        known = folder / f"mission-of-{options.soundings}"
        if not known.exists():
            service = Service(folder, log_level="warning")
            service.start()
            try:
                mission = create_mission(service, 10)
            finally:
                service.kill()
            fill(service.database, mission, options.soundings, SIDE_M, ORIGIN)
            known.write_text(mission)
        yield folder, known.read_text()


def forget_map(file: Path) -> None:
    """Take the stored map away."""
    with sqlite3.connect(file) as connection:
        connection.execute("DELETE FROM stored_maps")
    connection.close()


def compare(options: argparse.Namespace, folder: Path, mission: str) -> dict[str, Any]:
    """Let another tree's service and this one's make the map in turn: what else runs here changes meanwhile."""
    other = f"import sys; sys.path.insert(0, {str(options.before.resolve())!r})"
    trees = {name: Service(folder, text, log_level="warning") for name, text in (("before", other), ("now", ""))}
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in trees}
    for _ in range(options.rounds):
        for name, service in trees.items():
            forget_map(service.database)
            try:
                service.start()
                found[name].append(open_mission(service, mission))
            finally:
                service.kill()
    shown: dict[str, Any] = {
        name: {key: [one[key] for one in rounds] for key in rounds[0]} for name, rounds in found.items()
    }
    for key in ("service_cpu_s", "memory_mb"):
        now, before = (statistics.median(shown[name][key]) for name in ("now", "before"))
        shown[f"{key}_now_to_before"] = round(now / before, 3)
    return shown


def measure(options: argparse.Namespace, folder: Path, mission: str) -> dict[str, Any]:
    """Open the mission without its map, and with it."""
    service = Service(folder, log_level="warning")
    forget_map(service.database)
    result: dict[str, Any] = {"soundings": options.soundings, "cells": round(SIDE_M) ** 2}
    try:
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
    finally:
        service.kill()
    return result


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--soundings", type=int, default=5_000_000)
    parser.add_argument("--browser", action="store_true")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where the filled database is, or is left")
    parser.add_argument("--before", type=Path, metavar="TREE", help="compare with the program in another work tree")
    parser.add_argument("--rounds", type=int, default=1, help="of a comparison")
    options = parser.parse_args()
    number = f"{options.soundings:,}".replace(",", " ")
    title = f"Opening a mission of {number} soundings"
    hidden = {options.before: "BEFORE", options.keep: "FOLDER"}
    with filled(options) as (folder, mission):
        if options.before:
            result, good = compare(options, folder, mission), True
            title += ", before and now"
        else:
            result = measure(options, folder, mission)
            good = result["with_its_stored_map"]["all_s"] <= 2.0
    print(json.dumps(result))
    write_section(options.write, LOAD, title, result, hidden=hidden)
    sys.exit(0 if good else 1)


def wait_until_stored(file: Path, mission: str) -> None:
    """Return when the map is in the database."""
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
