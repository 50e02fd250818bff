"""What the dashboard costs: frames per second, memory, the service's work for many viewers, the first picture.

The real service runs in a process of its own, a fleet of vehicles that speak REST in another, and the page in Chromium
without a graphics card::

    python benchmarks/dashboard.py frames memory viewers load --write

Ten vehicles report five times a second over a map of 500 x 500 cells, after tracks of 50 000 points.
"""

import argparse
import asyncio
import contextlib
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from app.mapping.georeference import LocalFrame  # noqa: E402
from tests.support.dashboard.service import Service  # noqa: E402

RESULTS = ROOT / "docs" / "results" / "dashboard.md"
CHROMIUM = "/usr/bin/chromium"
# WebGL by SwiftShader, the page itself put together by the processor, as without a graphics card.
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--enable-precise-memory-info",
]
FRAME = LocalFrame(41.185, -8.705)
SIDE_M = 500.0
RATE_HZ = 5.0
START_S = 1_795_000_000.0


@dataclass
class Boat:
    """A vehicle that goes where it is sent and posts where it is."""

    name: str
    east_m: float
    north_m: float
    step: int = -1
    target: tuple[float, float] | None = None
    time_s: float = START_S

    def item(self, depth_m: float, *, sounds: bool) -> dict[str, Any]:
        lat, lon = FRAME.to_geographic(self.east_m, self.north_m)
        item = {"vehicle": self.name, "time_s": self.time_s, "lat_deg": float(lat), "lon_deg": float(lon)}
        item |= {"depth_m": depth_m, "battery_pct": 80.0, "speed_mps": 2.0, "heading_deg": 45.0}
        return item | ({"range_m": bottom_m(self.east_m, self.north_m) - depth_m} if sounds else {})


def bottom_m(east_m: float, north_m: float) -> float:
    ridge = 6.0 * abs((east_m + north_m) % 200 - 100) / 100
    return 10.0 + 8.0 * north_m / SIDE_M + ridge


def create_mission(service: Service, vehicles: int, cell_m: float = 1.0) -> str:
    corners = [(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M), (0, 0)]
    ring = [[float(lon), float(lat)] for lat, lon in (FRAME.to_geographic(e, n) for e, n in corners)]
    names = [{"name": f"boat-{i}", "kind": "rest"} for i in range(vehicles)]
    return service.create(
        name="Load",
        area={"type": "Polygon", "coordinates": [ring]},
        vehicles=names,
        cell_m=cell_m,
        steps=100_000,
        step_deadline_s=60,
        planner={"name": "random"},
        limits={"max_step_m": 30, "max_depth_m": 10, "min_separation_m": 0},
    )


def begin(service: Service, mission: str, vehicles: int) -> None:
    """Let the vehicles be heard and start: from then on their ways are kept."""
    here = [Boat(f"boat-{v}", v * SIDE_M / vehicles, 0.0).item(2.0, sounds=True) for v in range(vehicles)]
    service.post(f"/missions/{mission}/measurements", {"items": here})
    service.act(mission, "start")


def lay_tracks(service: Service, mission: str, vehicles: int, points: int) -> None:
    """Post what the vehicles did before: lines to and fro, a sounding at every tenth place."""
    per_vehicle = points // vehicles
    strip = SIDE_M / vehicles
    for v in range(vehicles):
        boat = Boat(f"boat-{v}", 0, 0)
        items = []
        for i in range(per_vehicle):
            line, along = divmod(i * 1.25, SIDE_M)
            boat.north_m = along if line % 2 == 0 else SIDE_M - along
            boat.east_m = v * strip + (line * 4.0 + 1.0) % strip
            boat.time_s = START_S + 1 + i
            items.append(boat.item(2.0, sounds=i % 10 == 0))
        for first in range(0, len(items), 5000):
            service.post(f"/missions/{mission}/measurements", {"items": items[first : first + 5000]})
    ways = service.get(f"/missions/{mission}/tracks.geojson")["features"]
    kept = sum(len(way["geometry"]["coordinates"]) for way in ways)
    if kept < 0.95 * points:
        raise SystemExit(f"only {kept} of {points} track points were kept")


async def sail(url: str, mission: str, vehicles: int, pace: float) -> None:
    """Let the vehicles go where they are sent until this process is ended."""
    boats = [Boat(f"boat-{i}", 5.0 + i * SIDE_M / vehicles, 5.0, time_s=START_S + 1e6) for i in range(vehicles)]
    async with httpx.AsyncClient(base_url=f"{url}/api/v1/missions/{mission}", timeout=30, verify=False) as client:  # noqa: S501

        async def follow(boat: Boat) -> None:
            while True:
                answer = await client.get(
                    f"/vehicles/{boat.name}/waypoint", params={"after_step": max(boat.step, 0), "timeout_s": 20}
                )
                if answer.status_code == 200:
                    found = answer.json()
                    boat.step, boat.target = found["step"], (found["east_m"], found["north_m"])
                else:
                    await asyncio.sleep(0.5)

        async def report() -> None:
            ticks = 0
            while True:
                began = time.monotonic()
                for boat in boats:
                    boat.time_s += pace / RATE_HZ
                    move(boat, 2.0 * pace / RATE_HZ)
                items = [boat.item(3.0, sounds=ticks % 5 == 0) for boat in boats]
                await client.post("/measurements", json={"items": items})
                ticks += 1
                await asyncio.sleep(max(0.0, 1 / RATE_HZ - (time.monotonic() - began)))

        await asyncio.gather(report(), *(follow(boat) for boat in boats))


def move(boat: Boat, metres: float) -> None:
    if boat.target is None:
        return
    east, north = boat.target[0] - boat.east_m, boat.target[1] - boat.north_m
    left = (east**2 + north**2) ** 0.5
    share = min(1.0, metres / left) if left > 0 else 1.0
    boat.east_m += east * share
    boat.north_m += north * share


async def watch(url: str, mission: str, viewers: int) -> None:
    """Look at a mission as so many pages do: the live socket, and what changed in the map."""
    import websockets

    async def view(client: httpx.AsyncClient) -> None:
        tag, wanted = "", asyncio.Event()

        async def fetch() -> None:
            nonlocal tag
            while True:
                await wanted.wait()
                wanted.clear()
                answer = await client.get("/map/tiles", params={"since": tag})
                if answer.status_code == 200:
                    # The header is near the front; the rest is what a page would draw.
                    tag = re.search(rb'"tag": "([^"]+)"', answer.content)[1].decode()  # type: ignore[index]
                await asyncio.sleep(0.7)

        address = url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
        fetching = asyncio.create_task(fetch())
        async with websockets.connect(address, max_size=None) as socket:
            async for message in socket:
                if '"type":"map"' in message[:40] or '"type":"snapshot"' in message[:40]:  # type: ignore[operator]
                    wanted.set()
        fetching.cancel()

    async with httpx.AsyncClient(base_url=f"{url}/api/v1/missions/{mission}", timeout=60, verify=False) as client:  # noqa: S501
        await asyncio.gather(*(view(client) for _ in range(viewers)))


@contextlib.contextmanager
def beside(*arguments: str) -> Iterator[None]:
    """Run a part of this file in a process of its own."""
    with subprocess.Popen([sys.executable, __file__, *arguments], stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.kill()


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def browser_cpu_s() -> float:
    """Processor time of all the browser's processes."""
    total = 0.0
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            if folder.name.isdigit() and b"--type=" in (folder / "cmdline").read_bytes():
                total += cpu_s(int(folder.name))
    return total


@dataclass
class Bench:
    options: argparse.Namespace
    service: Service
    mission: str
    lines: list[tuple[str, str, str]] = field(default_factory=list)

    def note(self, what: str, found: str, asked: str) -> None:
        self.lines.append((what, found, asked))
        print(f"{what}: {found} (asked: {asked})", flush=True)

    @contextlib.contextmanager
    def page(self) -> Iterator[Any]:
        from playwright.sync_api import sync_playwright

        with sync_playwright() as playwright:
            chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            context = chromium.new_context(viewport={"width": 1440, "height": 900}, base_url=self.service.url)
            yield context.new_page()
            chromium.close()

    def open(self, page: Any) -> None:
        page.goto(f"/#/missions/{self.mission}")
        # Not wait_for_function: the page's policy forbids what that does.
        while not page.evaluate("performance.getEntriesByName('sea-floor').length"):
            page.wait_for_timeout(100)

    def frames(self) -> None:
        seconds = self.options.seconds
        with self.page() as page:
            self.open(page)
            page.wait_for_timeout(3000)
            for how in ("watching", "panning"):
                page.evaluate(
                    """() => { const frames = window.__frames = []; const tick = t => { frames.push(t);
                    if (window.__frames === frames) requestAnimationFrame(tick); }; requestAnimationFrame(tick); }"""
                )
                end = time.monotonic() + seconds
                before = browser_cpu_s()
                if how == "panning":
                    page.mouse.move(700, 450)
                    page.mouse.down()
                    n = 0
                    while time.monotonic() < end:
                        n += 1
                        page.mouse.move(700 + 120 * ((n // 20) % 2 * 2 - 1) * (n % 20) / 20, 450 + (n % 7) * 6)
                        page.wait_for_timeout(30)
                    page.mouse.up()
                else:
                    page.wait_for_timeout(seconds * 1000)
                spent = browser_cpu_s() - before
                stamps = page.evaluate("window.__frames.splice(0)")
                gaps = [b - a for a, b in pairwise(stamps)]
                fps = 1000 / statistics.mean(gaps)
                slow = sorted(gaps)[int(0.95 * len(gaps))]
                per_frame = 1000 * spent / len(stamps)
                drawn = (
                    f"{fps:.1f} frames per second, 95 % of the gaps below {slow:.0f} ms; "
                    f"{per_frame:.0f} ms of processor time per frame; load of the machine {os.getloadavg()[0]:.1f}"
                )
                self.note(f"Frames, {how}, software rendering", drawn, ">= 10")

    def memory(self) -> None:
        minutes = self.options.minutes
        with self.page() as page:
            self.open(page)
            session = page.context.new_cdp_session(page)
            used = []
            for _ in range(max(4, round(minutes * 2))):
                page.wait_for_timeout(int(minutes * 60_000 / max(4, round(minutes * 2))))
                session.send("HeapProfiler.collectGarbage")
                used.append(page.evaluate("performance.memory.usedJSHeapSize") / 2**20)
                print(f"  {used[-1]:.1f} MiB", flush=True)
        half = len(used) // 2
        growth = statistics.mean(used[half:]) - statistics.mean(used[1:half] or used[:1])
        said = (
            f"{used[0]:.1f} MiB after the first part, {used[-1]:.1f} MiB at the end; halves differ by {growth:+.1f} MiB"
        )
        self.note(f"Memory of the page over {minutes:g} min at {self.options.pace:g}x", said, "flat")

    def viewers(self) -> None:
        seconds = self.options.seconds
        pid = self.service.pid

        def load() -> float:
            time.sleep(4)
            begin, clock = cpu_s(pid), time.monotonic()
            time.sleep(seconds)
            return 100 * (cpu_s(pid) - begin) / (time.monotonic() - clock)

        found = {}
        # There and back again, so that a drift of the machine counts for both.
        for count in (1, 50, 50, 1):
            with beside("--watch", self.service.url, self.mission, str(count)):
                found.setdefault(count, []).append(load())
        one, fifty = statistics.mean(found[1]), statistics.mean(found[50])
        said = f"{one:.1f} % of a core with 1, {fifty:.1f} % with 50: {100 * (fifty - one) / one:+.0f} %"
        self.note("Service's CPU with 50 viewers", said, "< +20 %")

    def load(self) -> None:
        times, sizes, pictures = [], [], []
        for _ in range(3):
            with self.page() as page:
                session = page.context.new_cdp_session(page)
                session.send("Network.enable")
                total = [0.0]
                session.on("Network.loadingFinished", lambda e, total=total: total.append(e["encodedDataLength"]))
                self.open(page)
                marks = "name => performance.getEntriesByName(name)[0].startTime"
                times.append(page.evaluate(marks, "mission-shown"))
                pictures.append(page.evaluate(marks, "sea-floor"))
                sizes.append(sum(total) / 1e6)
        self.note("Initial download", f"{min(sizes):.2f} MB, the map of 250 000 cells included", "<= 1.5 MB")
        self.note(
            "First useful picture (mission, vehicles, area)", f"{statistics.median(times) / 1000:.2f} s", "<= 1 s"
        )
        self.note("Sea floor drawn", f"{statistics.median(pictures) / 1000:.2f} s", "")


def main() -> None:
    if sys.argv[1:2] == ["--sail"]:
        asyncio.run(sail(sys.argv[2], sys.argv[3], int(sys.argv[4]), float(sys.argv[5])))
    if sys.argv[1:2] == ["--watch"]:
        asyncio.run(watch(sys.argv[2], sys.argv[3], int(sys.argv[4])))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="+", choices=["frames", "memory", "viewers", "load"])
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--points", type=int, default=50_000, help="track points that are there before")
    parser.add_argument("--seconds", type=float, default=20, help="of each measurement")
    parser.add_argument("--minutes", type=float, default=10, help="of the memory's measurement")
    parser.add_argument("--pace", type=float, default=6, help="how much faster vehicles live while memory is measured")
    parser.add_argument("--write", action="store_true", help=f"write {RESULTS.relative_to(ROOT)}")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        service = Service(Path(folder))
        service.start()
        try:
            mission = create_mission(service, options.vehicles)
            begin(service, mission, options.vehicles)
            lay_tracks(service, mission, options.vehicles, options.points)
            bench = Bench(options, service, mission)
            for part in options.parts:
                pace = options.pace if part == "memory" else 1.0
                with beside("--sail", service.url, mission, str(options.vehicles), str(pace)):
                    getattr(bench, part)()
        finally:
            service.kill()
    if options.write:
        write(options, bench.lines)


def write(options: argparse.Namespace, lines: list[tuple[str, str, str]]) -> None:
    """Write the figures down, in place of earlier ones of the same measurements."""
    rows = {}
    if RESULTS.is_file():
        table = re.findall(r"^\| (.+?) \| (.+?) \| (.*?) \|$", RESULTS.read_text(), re.MULTILINE)[2:]
        rows = {what: (found, asked) for what, found, asked in table}
    rows |= {what: (found, asked) for what, found, asked in lines}
    text = (
        "# The dashboard's costs\n\n"
        f"{options.vehicles} vehicles at {RATE_HZ:g} Hz, a map of 500 x 500 cells, {options.points} track points; "
        f"Chromium without a graphics card beside the service on {os.cpu_count()} cores. Made by "
        "`python benchmarks/dashboard.py frames memory viewers load --write`.\n\n"
        "| What | Found | Asked |\n| --- | --- | --- |\n"
    )
    text += "".join(f"| {what} | {found} | {asked} |\n" for what, (found, asked) in rows.items())
    RESULTS.write_text(text)
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
