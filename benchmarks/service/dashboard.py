"""What the dashboard costs: frames per second, memory, the service's work for many viewers, the first picture.

The real service runs in a process of its own, a fleet of vehicles that speak REST in another, and the page in Chromium
without a graphics card::

    python -m benchmarks.service.dashboard frames memory viewers load --write

Ten vehicles report five times a second over a map of 500 x 500 cells, after tracks of 50 000 points.
"""

import argparse
import contextlib
import json
import os
import re
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.common.report import Page, facts, make_parser, write_page
from benchmarks.service.boats import RATE_HZ, begin, beside, create_mission, lay_tracks, running_service
from tests.support.dashboard.service import Service

PAGE = Page("dashboard.md")
CHROMIUM = "/usr/bin/chromium"
# WebGL by SwiftShader, the page itself put together by the processor, as without a graphics card.
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--enable-precise-memory-info",
]

# Turns the view by its keys as often as the page draws; a frame of the page may show the same picture once more, so
# the pictures themselves are counted, with their points.
SPIN = """() => {
  const [times, points] = (window.__pictures = [[], []]);
  const context = WebGL2RenderingContext.prototype, draw = context.drawElements;
  context.drawElements = function (mode, count, ...rest) {
    if (mode === this.POINTS) { times.push(performance.now()); points.push(count); }
    return draw.call(this, mode, count, ...rest);
  };
  const canvas = document.querySelector(".space canvas");
  const key = { code: "ArrowLeft", key: "ArrowLeft", shiftKey: true, bubbles: true };
  window.__spins = true;
  const spin = () => {
    if (!window.__spins) return;
    canvas.dispatchEvent(new KeyboardEvent("keydown", key));
    requestAnimationFrame(spin);
  };
  spin();
}"""


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
        with self.page() as page:
            self.open(page)
            page.wait_for_timeout(3000)
            self._count(page, "Frames, watching, software rendering", drags=False)
            self._count(page, "Frames, panning, software rendering", drags=True)

    def space(self) -> None:
        with self.page() as page:
            # On a busy machine the first picture in space takes long.
            page.set_default_timeout(300_000)
            self.open(page)
            page.get_by_test_id("open-3d").click()
            page.get_by_test_id("toggle-points").click()
            # All of them are read, page after page.
            told = page.get_by_test_id("points-chosen")
            while int(re.sub(r"\D", "", told.inner_text().partition(".")[0]) or 0) < self.options.soundings:
                page.wait_for_timeout(500)
            # By the keyboard: a warning may lie over it.
            page.get_by_test_id("toggle-lasso").press("Enter")
            page.wait_for_timeout(3000)
            what = f"{self.options.soundings} soundings in 3-D, turned, software rendering"
            self._count(page, what, drags=True, asked=">= 10")
            page.evaluate(SPIN)
            page.wait_for_timeout(1000 * self.options.seconds)
            times, points = page.evaluate("() => { window.__spins = false; return window.__pictures; }")
            rate = 1000 * (len(times) - 1) / (times[-1] - times[0])
            drawn = (
                f"{rate:.1f} a second, of {statistics.median(points):.0f} points in the median; "
                f"load of the machine {os.getloadavg()[0]:.1f}"
            )
            self.note("Pictures of them, turned with every frame", drawn, ">= 10")
            page.wait_for_timeout(3000)
            self.note(
                "Points in the picture when it is still", str(page.evaluate("window.__pictures[1].at(-1)")), "all"
            )

    def _count(self, page: Any, what: str, *, drags: bool, asked: str = ">= 10") -> None:
        """Count the frames while nothing is done, or while what is shown is dragged to and fro."""
        page.evaluate(
            """() => { const frames = window.__frames = []; const tick = t => { frames.push(t);
            if (window.__frames === frames) requestAnimationFrame(tick); }; requestAnimationFrame(tick); }"""
        )
        end = time.monotonic() + self.options.seconds
        before = browser_cpu_s()
        if drags:
            page.mouse.move(700, 450)
            page.mouse.down()
            n = 0
            while time.monotonic() < end:
                n += 1
                page.mouse.move(700 + 120 * ((n // 20) % 2 * 2 - 1) * (n % 20) / 20, 450 + (n % 7) * 6)
                page.wait_for_timeout(30)
            page.mouse.up()
        else:
            page.wait_for_timeout(self.options.seconds * 1000)
        spent = browser_cpu_s() - before
        stamps = page.evaluate("window.__frames.splice(0)")
        gaps = [b - a for a, b in pairwise(stamps)]
        slow = sorted(gaps)[int(0.95 * len(gaps))]
        drawn = (
            f"{1000 / statistics.mean(gaps):.1f} frames per second, 95 % of the gaps below {slow:.0f} ms; "
            f"{1000 * spent / len(stamps):.0f} ms of processor time per frame; "
            f"load of the machine {os.getloadavg()[0]:.1f}"
        )
        self.note(what, drawn, asked)

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

        found: dict[int, list[float]] = {}
        # There and back again, so that a drift of the machine counts for both.
        for count in (1, 50, 50, 1):
            with beside("watch", self.service.url, self.mission, str(count)):
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
    parser = make_parser(__doc__, PAGE)
    parser.add_argument("parts", nargs="+", choices=["frames", "space", "memory", "viewers", "load"])
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--points", type=int, default=50_000, help="track points that are there before")
    parser.add_argument("--soundings", type=int, default=100_000, help="that are shown in 3-D")
    parser.add_argument("--seconds", type=float, default=20, help="of each measurement")
    parser.add_argument("--minutes", type=float, default=10, help="of the memory's measurement")
    parser.add_argument("--pace", type=float, default=6, help="how much faster vehicles live while memory is measured")
    options = parser.parse_args()
    with running_service() as service:
        mission = create_mission(service, options.vehicles)
        begin(service, mission, options.vehicles)
        lay_tracks(service, mission, options.vehicles, options.points)
        if "space" in options.parts:
            lay_tracks(service, mission, options.vehicles, options.soundings, every=1, begin_s=1e5)
        bench = Bench(options, service, mission)
        for part in options.parts:
            pace = options.pace if part == "memory" else 1.0
            with beside("sail", service.url, mission, str(options.vehicles), str(pace)):
                getattr(bench, part)()
    if options.write is not None:
        write(options, bench.lines)


def write(options: argparse.Namespace, measured: list[tuple[str, str, str]]) -> None:
    """Write the figures down, in place of earlier ones of the same measurements."""
    rows = {}
    if options.write.is_file():
        table = re.findall(r"^\| (.+?) \| (.+?) \| (.*?) \|$", options.write.read_text(), re.MULTILINE)[2:]
        rows = {what: (found, asked) for what, found, asked in table}
    rows |= {what: (found, asked) for what, found, asked in measured}
    lines = [
        "# The dashboard's costs",
        "",
        *facts(),
        f"- what runs: {options.vehicles} vehicles at {RATE_HZ:g} Hz, a map of 500 x 500 cells, {options.points} track "
        "points; Chromium without a graphics card beside the service",
        "",
        "| What | Found | Asked |",
        "| --- | --- | --- |",
        *(f"| {what} | {found} | {asked} |" for what, (found, asked) in rows.items()),
    ]
    write_page(options.write, "\n".join(lines))
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
