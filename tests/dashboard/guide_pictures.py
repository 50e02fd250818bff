"""The guides' pictures of the page: ``python -m tests.dashboard.guide_pictures [NAME …]``.

Real missions of simulated vehicles over generated sea floors, in Chromium without a graphics card, into
``docs/images``. Look at each before it is committed: runs differ.
"""

import argparse
import gzip
import io
import json
import math
import socket
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, FilePayload, Page, sync_playwright

from tests.dashboard.conftest import CHROMIUM, FLAGS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, click_round, show
from tests.support.imc import log_writer
from tests.support.mapping import line_files
from tests.support.mapping.school import surveyed
from tests.support.mapping.tracks import flown, lawnmower, measured
from tests.support.missions.ais import named, nmea, position
from tests.support.missions.specs import lon_lat, rectangle
from tests.support.paths import PROJECT
from tests.support.ports import free_ports

IMAGES = PROJECT / "docs" / "images"
COLOURS = 192
WIDE, UPRIGHT, PHONE = (1440, 900), (820, 1180), (390, 844)
PATIENCE_MS = 180_000
SETTLE_MS = 3000
"""For charts and the sea floor to be drawn after what they show has come."""
WIDTH_M, HEIGHT_M = 420, 300
KM_EACH = 2.0
WHOLE_M = 3 * 1000.0 * KM_EACH
ZONE = rectangle(300, 60, 340, 100)
HOME = lon_lat(-25.0, 20.0)
HELD = ("lauv-2", "lauv-3")
PASSING = 263000001
BOATS: dict[str, tuple[tuple[float, float], dict[str, float]]] = {
    "boat-1": ((250.0, 130.0), {"position_sd_m": 80.0}),
    "boat-2": ((-40.0, 190.0), {"battery_pct": 60.0}),
}
"""Vehicles that speak REST: where they are, and what they tell once they are under way."""
BLOCKS = (
    [(520, 200), (800, 220), (790, 420), (530, 400)],
    [(560, 500), (760, 510), (750, 700), (570, 690)],
    [(900, 260), (1040, 250), (1060, 640), (920, 660)],
)
LOOK_S = 0.3
BATCH = 500
"""Soundings that are posted at once."""
TIME_SCALE = "6"
"""Faster, a busy machine's vehicles circle while they wait for decisions."""


@dataclass
class Guide:
    """A service, its missions by what they are for, and a browser."""

    service: Service
    browser: Browser
    ais_port: int
    missions: dict[str, str] = field(default_factory=dict)

    def page(self, size: tuple[int, int], theme: str) -> Page:
        """A new window with the page as a watch-keeper has set it."""
        context = self.browser.new_context(
            viewport={"width": size[0], "height": size[1]}, base_url=self.service.url, reduced_motion="reduce"
        )
        context.add_init_script(f"localStorage.setItem('bathyfleet.theme', {json.dumps(json.dumps(theme))})")
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        return page

    def wait(self, mission: str, enough: Callable[[dict[str, Any]], bool]) -> None:
        """Wait until a mission is as it should be."""
        while not enough(self.service.get(f"/missions/{mission}")):
            time.sleep(LOOK_S)

    def tell_of_ships(self) -> None:
        """Send what an AIS receiver and the own ship's GPS and compass say."""
        (own_lon, own_lat), (lon, lat) = lon_lat(-30.0, 150.0), lon_lat(60.0, -28.0)
        north, west = ((int(abs(deg)), 60.0 * (abs(deg) % 1.0)) for deg in (own_lat, own_lon))
        fix = f"{north[0]:02d}{north[1]:07.4f},N,{west[0]:03d}{west[1]:07.4f},W"
        words = [nmea(f"GPGGA,092750,{fix},1,8,1.0,2.0,M,55.2,M,,"), nmea("HEHDT,75.0,T")]
        words += [*named(PASSING, "ESTRELA"), *[position(PASSING, lat, lon, knots=1.0, course_deg=95.0)] * 3]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for line in words:
                sender.sendto(line + b"\r\n", ("127.0.0.1", self.ais_port))

    def survey(self, share: float) -> str:
        """The survey of three vehicles, once so much of its length is flown."""
        if "survey" not in self.missions:
            vehicles = [
                {"name": name, "kind": "sim", "sensor": "dvl", "endurance_min": 90}
                for name in ("lauv-1", "lauv-2", "lauv-3")
            ]
            made = self.service.create(
                name="Canyon off the mole",
                area=rectangle(0, 0, WIDTH_M, HEIGHT_M),
                keep_out=[ZONE],
                vehicles=vehicles,
                planner={"name": "cao"},
                budget={"km_per_vehicle": KM_EACH},
                steps=None,
                accuracy_m=0.25,
                limits={"max_depth_m": 20, "min_altitude_m": 1.5},
                recovery={"point": HOME},
            )
            self.missions["survey"] = made
            self.service.act(made, "start")
        mission = self.missions["survey"]
        self.wait(mission, lambda one: one["state"] != "running" or one["progress"]["distance_m"] > share * WHOLE_M)
        return mission

    def tell_of_boats(self, mission: str, *, under_way: bool = True) -> None:
        """Post where the vehicles are that speak REST: in the area at first, then what raises alarms."""
        items = []
        for name, (place, facts) in BOATS.items():
            lon, lat = lon_lat(*(place if under_way else (60.0, place[1])))
            items.append({"vehicle": name, "lat_deg": lat, "lon_deg": lon, "depth_m": 0.0, "time_s": time.time()})
            items[-1] |= facts if under_way else {}
        self.service.post(f"/missions/{mission}/measurements", {"items": items})

    def alarmed(self) -> str:
        """Where one vehicle does not know where it is, and one left the area."""
        if "alarmed" not in self.missions:
            made = self.service.create(
                name="Roads, west",
                area=rectangle(0, 0, WIDTH_M, 240),
                vehicles=[
                    *({"name": f"scout-{n}", "kind": "sim", "sensor": "dvl"} for n in (1, 2)),
                    *({"name": name, "kind": "rest"} for name in BOATS),
                ],
                planner={"name": "lawnmower"},
                steps=400,
                limits={"max_depth_m": 20, "min_altitude_m": 1.5},
            )
            self.missions["alarmed"] = made
            self.tell_of_boats(made, under_way=False)
            self.service.act(made, "start")
        mission = self.missions["alarmed"]

        def both(_one: dict[str, Any]) -> bool:
            self.tell_of_boats(mission)
            return len(self.service.get("/alarms")) > 1

        self.wait(mission, both)
        return mission

    def flown(self) -> str:
        """The same survey at its end."""
        mission = self.survey(0.0)
        self.wait(mission, lambda one: one["state"] == "finished")
        return mission

    def multibeams(self) -> str:
        """Full coverage by two vehicles, once most of it is done."""
        if "multibeams" not in self.missions:
            made = self.service.create(
                name="Full coverage",
                area=rectangle(0, 0, 240, 160),
                vehicles=[{"name": f"wide-{n}", "kind": "sim", "sensor": "multibeam"} for n in (1, 2)],
                planner={"name": "swath"},
                budget={"minutes": 60},
                steps=None,
                limits={"max_depth_m": 20},
            )
            self.missions["multibeams"] = made
            self.service.act(made, "start")
        mission = self.missions["multibeams"]
        self.wait(mission, lambda one: one["state"] != "running" or (one["progress"]["ensonified_pct"] or 0) > 60)
        return mission


def payload(name: str, content: bytes) -> FilePayload:
    return FilePayload(name=name, mimeType="application/octet-stream", buffer=content)


def dashboard(guide: Guide, page: Page) -> None:
    """A survey under way."""
    show(page, guide.survey(0.55))
    by_id(page, "range-low").wait_for()


def watch(guide: Guide, page: Page) -> None:
    """Orders from the map, and what needs a person."""
    show(page, guide.survey(0.6))
    for name in HELD:
        by_id(page, f"hold-{name}").click()
    by_id(page, "attention-more").click()
    page.mouse.click(640, 420, button="right")


def watch_done(guide: Guide, page: Page) -> None:
    page.keyboard.press("Escape")
    for name in HELD:
        by_id(page, f"resume-{name}").click()


def ships(guide: Guide, page: Page) -> None:
    """The own ship, a ship that passes, and the circle of a vehicle that waits."""
    mission = guide.survey(0.3)
    show(page, mission)
    by_id(page, "range-low").wait_for()
    by_id(page, f"hold-{HELD[0]}").click()
    guide.wait(mission, lambda one: any(v["waiting_circle"] and v["withdrawn"] for v in one["vehicles"]))
    guide.tell_of_ships()


def ships_done(guide: Guide, page: Page) -> None:
    by_id(page, f"resume-{HELD[0]}").click()


def phone(guide: Guide, page: Page) -> None:
    """The watch on a phone at night."""
    show(page, guide.survey(0.5))


def alarms(guide: Guide, page: Page) -> None:
    """Alarms of a running mission: on the map, on the cards, in the log."""
    mission = guide.alarmed()
    show(page, mission)
    by_id(page, "alarms").wait_for()
    by_id(page, "toggle-log").click()
    guide.tell_of_boats(mission)


def tablet(guide: Guide, page: Page) -> None:
    """The same watch on a tablet that stands upright."""
    mission = guide.alarmed()
    show(page, mission)
    by_id(page, "alarms").wait_for()
    guide.tell_of_boats(mission)


def harbour(guide: Guide, page: Page) -> None:
    """Going to a harbour by its name, while a vehicle waits for a person."""
    show(page, guide.survey(0.1))
    by_id(page, "range-low").wait_for()
    by_id(page, f"hold-{HELD[0]}").dispatch_event("click")
    by_id(page, "attention").wait_for()
    by_id(page, "go-to").click()
    by_id(page, "go-to-position").fill("leix")
    by_id(page, "harbour-0").wait_for()


def harbour_done(_guide: Guide, page: Page) -> None:
    by_id(page, f"resume-{HELD[0]}").dispatch_event("click")


def planning(guide: Guide, page: Page) -> None:
    """The plan before the start."""
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Anchorage, north")
    by_id(page, "planner-lawnmower").click()
    by_id(page, "field-recovery").fill("41.1850 -8.7052")
    by_id(page, "draw-polygon").click()
    click_round(page, [(520, 300), (980, 330), (940, 640), (540, 600)])
    page.wait_for_selector('[data-testid="planned"][data-plan="new"]')
    by_id(page, "planned-whole").scroll_into_view_if_needed()


def blocks(guide: Guide, page: Page) -> None:
    """Several areas that are flown one after the other."""
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Roads")
    by_id(page, "planner-lawnmower").click()
    by_id(page, "field-length").select_option("spacing_m")
    by_id(page, "field-spacing_m").fill("12")
    for number, corners in enumerate(BLOCKS, start=1):
        if number > 1:
            by_id(page, "another-block").click()
        by_id(page, "draw-polygon").click()
        page.wait_for_selector('[data-testid="drawing"][data-ready="true"]')
        click_round(page, corners)
    for number, name in enumerate(("Mole", "Anchorage", "Fairway"), start=1):
        by_id(page, f"block-name-{number}").fill(name)
    page.wait_for_selector('[data-testid="planned"][data-plan="new"]')
    by_id(page, "in-blocks").evaluate("table => table.scrollIntoView()")


def checklist(guide: Guide, page: Page) -> None:
    """The checklist before the start."""
    service = guide.service
    vehicles = [{"name": f"second-{n}", "kind": "sim", "sensor": "dvl", "endurance_min": 60} for n in (1, 2)]
    show(page, service.create(name="Anchorage", vehicles=vehicles, recovery={"point": HOME}))
    by_id(page, "start").click()
    page.wait_for_selector('[data-testid="preflight"][data-ready]')


def space(guide: Guide, page: Page) -> None:
    """Soundings in space, some of them chosen with the lasso."""
    show(page, guide.flown())
    by_id(page, "open-3d").click()
    by_id(page, "toggle-points").click()
    page.wait_for_timeout(SETTLE_MS)
    box = by_id(page, "lasso").bounding_box()
    assert box is not None
    x, y = box["x"] + 0.45 * box["width"], box["y"] + 0.4 * box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    for right, down in ((150, -20), (190, 60), (60, 90), (-20, 40), (0, 0)):
        page.mouse.move(x + right, y + down)
    page.mouse.up()


def beams(guide: Guide, page: Page) -> None:
    """Beams of a multibeam in space, a school of fish chosen with the lasso."""
    mission = guide.service.create(
        name="Fish",
        vehicles=[{"name": "rover", "kind": "rest", "sensor": "multibeam"}],
        area=rectangle(0, 0, 60, 60),
        cell_m=2.0,
    )
    guide.service.post(f"/missions/{mission}/measurements", {"items": surveyed("rover", time.time() - 300.0)})
    guide.service.get(f"/missions/{mission}/map")
    show(page, mission)
    by_id(page, "open-3d").click()
    by_id(page, "toggle-points").click()
    page.wait_for_timeout(SETTLE_MS)
    box = by_id(page, "lasso").bounding_box()
    assert box is not None
    corners = [(0.28, 0.28), (0.48, 0.28), (0.48, 0.40), (0.28, 0.40), (0.28, 0.28)]
    for number, (across, down) in enumerate(corners):
        page.mouse.move(box["x"] + across * box["width"], box["y"] + down * box["height"])
        if number == 0:
            page.mouse.down()
    page.mouse.up()


def profile(guide: Guide, page: Page) -> None:
    """The bottom along a line."""
    show(page, guide.flown())
    by_id(page, "measure").click()
    page.mouse.click(470, 330)
    page.mouse.click(930, 520)
    by_id(page, "measured-profile").click()
    by_id(page, "profile-chart").wait_for()


def charts(guide: Guide, page: Page) -> None:
    """How a mission went."""
    show(page, guide.flown())
    by_id(page, "toggle-charts").click()
    by_id(page, "charts").locator("canvas").first.wait_for()


def dashboard_replay(guide: Guide, page: Page) -> None:
    """A mission as it was some steps before its end."""
    show(page, guide.flown())
    last = int(by_id(page, "slider").get_attribute("max") or 0)
    by_id(page, "slider").fill(str(round(0.4 * last)))
    by_id(page, "replayed-at").wait_for()


def swath(guide: Guide, page: Page) -> None:
    """Full coverage with multibeams: density and holidays."""
    show(page, guide.multibeams())
    by_id(page, "layer").select_option(label="Density")


def lines(_guide: Guide, page: Page) -> None:
    """A client's line plan, read from its file."""
    plan = {f"L{100 + k}": [lon_lat(30.0 * k, 0.0), lon_lat(30.0 * k + 40.0, HEIGHT_M)] for k in range(13)}
    plan |= {f"X{k + 1}": [lon_lat(-10.0, north_m), lon_lat(430.0, north_m)] for k, north_m in enumerate((80.0, 220.0))}
    page.goto("/")
    by_id(page, "new-mission").click()
    by_id(page, "field-name").fill("Fairway, line plan 7")
    by_id(page, "planner-lawnmower").click()
    by_id(page, "lines-file").set_input_files(payload("plan-7.geojson", line_files.geojson(plan)))
    by_id(page, "lines-given").wait_for()
    page.wait_for_selector('[data-testid="planned"][data-plan="new"]')
    by_id(page, "lines-given").scroll_into_view_if_needed()


def corrections(guide: Guide, page: Page) -> None:
    """Casts of a day, and how a sonar is mounted."""
    service = guide.service
    mission = guide.multibeams()
    service.act(mission, "pause")
    now_s = time.time()
    casts = []
    for cast, before_h, speeds_mps in (("morning", 5.0, (1512.0, 1506.0)), ("noon", 0.5, (1511.0, 1507.0))):
        profile = [[0.0, speeds_mps[0]], [30.0, speeds_mps[1]]]
        taken = datetime.fromtimestamp(now_s - 3600.0 * before_h, UTC).isoformat()
        casts.append({"name": cast, "time": taken, "position": HOME, "profile": profile, "source": f"{cast}.asvp"})
    service.post(f"/missions/{mission}/sound-speed/casts", {"assumed_mps": 1500.0, "casts": casts})
    show(page, mission)
    by_id(page, "toggle-corrections").click()
    mounting = by_id(page, "mounting-wide-1")
    mounting.locator("summary").click()
    for name, value in (("roll_deg", "-0.8"), ("pitch_deg", "1.2"), ("down", "0.25"), ("source", "patch test")):
        mounting.get_by_test_id(f"mounting-{name}").fill(value)
    mounting.get_by_test_id("mounting-set").scroll_into_view_if_needed()


def imports(guide: Guide, page: Page) -> None:
    """A vehicle's own log after the dive, and depths that a mission began with."""
    east_m, north_m = -200.0, -20.0
    mission = guide.service.create(
        name="After the dive",
        area=rectangle(east_m, north_m, 60, 180),
        cell_m=2,
        vehicles=[{"name": "rover", "kind": "rest"}],
    )
    rng = np.random.default_rng(0)
    rows = ["lon,lat,depth"]
    for east, north in rng.uniform((east_m, north_m), (60, 180), (900, 2)).tolist():
        lon, lat = lon_lat(east, north)
        rows.append(f"{lon:.7f},{lat:.7f},{12.0 + 2.0 * math.sin(north / 20.0) + 0.01 * east:.2f}")
    log = gzip.compress(b"".join(log_writer.survey(560)))
    show(page, mission)
    by_id(page, "toggle-imports").click()
    by_id(page, "imports").locator("summary").first.click()
    by_id(page, "prior-sd").fill("0.4")
    by_id(page, "prior-source").fill("chart of 1998")
    by_id(page, "prior-file").set_input_files(payload("chart-1998.csv", "\n".join(rows).encode()))
    page.wait_for_selector('[data-testid="priors"] > li')
    by_id(page, "imports").locator("summary").first.click()
    by_id(page, "log-file").set_input_files(payload("Data.lsf.gz", log))
    page.wait_for_selector('[data-testid="logs"] > [data-state="done"]')


def sites(guide: Guide, page: Page) -> None:
    """What changed at a place between two surveys."""
    service = guide.service
    area = rectangle(0, 0, 160, 100)
    site = service.post("/sites", {"name": "Dredged berth", "area": area, "cell_m": 2.0})["id"]
    for number, (name, dredged_m) in enumerate((("Before dredging", 0.0), ("After dredging", 1.8))):
        mission = service.create(
            name=name, area=area, cell_m=2.0, site=site, vehicles=[{"name": "boat", "kind": "rest"}]
        )
        way = flown(lawnmower(156, 96, 4.0), spacing_m=2.0, start_s=1_790_000_000.0 + 2_600_000.0 * number)
        items = measured("boat", way + np.array([0.0, 2.0, 2.0, 0.0, 0.0]))
        for item, (_, east, north, *_) in zip(items, way.tolist(), strict=True):
            inside = 1.0 / (1.0 + math.exp((math.hypot((east - 95.0) / 1.6, north - 50.0) - 26.0) / 2.0))
            item["range_m"] += 0.02 * east + math.sin(north / 14.0) + dredged_m * inside
        for first in range(0, len(items), BATCH):
            service.post(f"/missions/{mission}/measurements", {"items": items[first : first + BATCH]})
        service.act(mission, "abort")
        while not service.get(f"/sites/{site}/surveys")[number]["surveyed"]:
            time.sleep(LOOK_S)
    page.goto("/")
    by_id(page, "open-sites").click()
    by_id(page, "changes-picture").scroll_into_view_if_needed()


SCENES: dict[str, tuple[Callable[[Guide, Page], None], tuple[int, int], str]] = {
    # Before there is any mission.
    "planning": (planning, WIDE, "light"),
    "blocks": (blocks, WIDE, "light"),
    "lines": (lines, WIDE, "light"),
    "checklist": (checklist, WIDE, "dark"),
    "dashboard": (dashboard, WIDE, "light"),
    "phone": (phone, PHONE, "night"),
    "watch": (watch, WIDE, "light"),
    "ships": (ships, WIDE, "light"),
    "harbour": (harbour, PHONE, "light"),
    "swath": (swath, WIDE, "light"),
    "corrections": (corrections, WIDE, "light"),
    "imports": (imports, WIDE, "light"),
    "sites": (sites, WIDE, "light"),
    "space": (space, WIDE, "dark"),
    "beams": (beams, WIDE, "light"),
    "profile": (profile, WIDE, "light"),
    "alarms": (alarms, WIDE, "light"),
    "tablet": (tablet, UPRIGHT, "dark"),
    "charts": (charts, WIDE, "light"),
    "dashboard-replay": (dashboard_replay, WIDE, "light"),
}
AFTERWARDS = {"watch": watch_done, "ships": ships_done, "harbour": harbour_done}


def keep(picture: bytes, path: Path) -> None:
    """Write a picture with few colours: a tenth of the bytes, and nobody sees it."""
    Image.open(io.BytesIO(picture)).convert("RGB").quantize(COLOURS).save(path, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*SCENES, []], metavar="NAME", help=", ".join(SCENES))
    parser.add_argument("--out", type=Path, default=IMAGES)
    options = parser.parse_args()
    [ais_port] = free_ports(1)
    settings = {"simulation__family": "canyon", "time_scale": TIME_SCALE}
    settings |= {"ais__udp_address": "127.0.0.1", "ais__udp_port": str(ais_port), "ais__cpa_m": "10"}
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        service = Service(Path(folder), **settings)
        service.start()
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        guide = Guide(service, browser, ais_port)
        try:
            for name in options.names or SCENES:
                scene, size, theme = SCENES[name]
                page = guide.page(size, theme)
                scene(guide, page)
                page.wait_for_timeout(SETTLE_MS)
                keep(page.screenshot(animations="disabled"), options.out / f"{name}.png")
                if name in AFTERWARDS:
                    AFTERWARDS[name](guide, page)
                page.context.close()
        finally:
            browser.close()
            service.kill()


if __name__ == "__main__":
    main()
