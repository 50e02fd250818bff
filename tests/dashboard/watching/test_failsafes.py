"""Every failsafe of the table, brought about by what really triggers it, and what the page shows then.

One service and one page for all of them: each vehicle of the mission comes to one thing, and two more are lost.
"""

import contextlib
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import httpx
import imcpy
import pytest
from playwright.sync_api import Browser, Page, expect

from app.missions.alarm_kinds import AlarmKind
from app.missions.recovery.failsafes import TABLE
from app.missions.spec.failsafes import Failsafe, Response
from imc_bridge import BridgeSettings
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.equipment import Equipment
from simulator.floors.seafloors import generate
from simulator.vehicles.battery import BatterySpec
from tests.support.dashboard.browser import PATIENCE_MS
from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show
from tests.support.imc.afloat import Afloat, afloat
from tests.support.imc.sea import Peer
from tests.support.missions.ais import nmea, position
from tests.support.missions.specs import LAT, LON, lon_lat, rectangle
from tests.support.ports import free_ports

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.timeout(400)]

SPEED = 20.0
SIDE_M = 400.0
POSTING = {
    "critical_energy": (40.0, 200.0),
    "low_energy": (300.0, 100.0),
    "too_deep": (120.0, 200.0),
    "position_lost": (200.0, 200.0),
    "traffic": (360.0, 360.0),
    "geofence_left": (40.0, 300.0),
    "separation_lost": (120.0, 300.0),
    "its_neighbour": (200.0, 300.0),
}
"""Vehicles that post where they are, and where that is, metres from the area's corner."""
DUNES = ("leak", "no_position", "vehicle_error", "other_console")
LOST = ("link_lost", "lost_too")
EQUIPMENT = Equipment(ping_period_s=2.0, battery=BatterySpec())
BEGAN_S = 1_795_225_140.0


@dataclass
class Scene:
    """The service, its vehicles and receiver, and the page on it."""

    service: Service
    page: Page
    dunes: Afloat
    ais_port: int
    console: Peer
    mission: str = ""
    lost: str = ""
    to_come: str = ""
    """Not started."""
    told: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What vehicles post of themselves, until that changes."""
    over: threading.Event = field(default_factory=threading.Event)

    def tell(self, vehicle: str, place: tuple[float, float] | None = None, **facts: Any) -> None:
        """Have a vehicle post where it is, and what else there is to tell, from now on."""
        lon, lat = lon_lat(*(place or POSTING[vehicle]))
        self.told[vehicle] = {"vehicle": vehicle, "lat_deg": lat, "lon_deg": lon, "depth_m": 6.0} | facts

    def keep_posting(self) -> None:
        """Post all that is told, once a second, until that is over."""
        began_s = time.monotonic()
        while not self.over.wait(1.0):
            time_s = BEGAN_S + SPEED * (time.monotonic() - began_s)
            items = [item | {"time_s": time_s} for item in list(self.told.values())]
            # It is killed in between.
            with contextlib.suppress(httpx.HTTPError):
                self.service.post(f"/missions/{self.mission}/measurements", {"items": items})

    def wait(self, condition: Callable[[], object], what: str) -> None:
        end = time.monotonic() + PATIENCE_MS / 1000
        while not condition():
            assert time.monotonic() < end, what
            time.sleep(0.1)


@pytest.fixture(scope="module")
def scene(built: None, browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    *announce_ports, port, ais_port, base_port = free_ports(10)[:6]
    service = Service(
        tmp_path_factory.mktemp("failsafes"),
        time_scale=str(SPEED),
        imc__enabled="true",
        imc__port=str(port),
        imc__announce_ports=str(announce_ports),
        imc__loopback_only="true",
        ais__udp_address="127.0.0.1",
        ais__udp_port=str(ais_port),
        ais__cpa_m="30",
    )
    floor = generate("slope", 0, width_m=SIDE_M, height_m=SIDE_M, origin=(LAT, LON))
    names = [*DUNES, *LOST]
    specs = default_specs(len(names), floor, names=names, base_port=base_port)
    options = DuneOptions(announce_ports=tuple(announce_ports))
    console = Peer(BridgeSettings(port=port, announce_ports=tuple(announce_ports)), 0x4001, "ccu-other")
    service.start()
    try:
        with afloat(lambda: DuneFleet(floor, specs, EQUIPMENT, speed=SPEED, options=options)) as dunes:
            context = browser.new_context(viewport={"width": 1440, "height": 900}, base_url=service.url)
            page = context.new_page()
            page.set_default_timeout(PATIENCE_MS)
            made = Scene(service, page, dunes, ais_port, console)
            _describe(made)
            posting = threading.Thread(target=made.keep_posting)
            posting.start()
            try:
                _set_off(made)
                for announce_port in announce_ports:
                    console.announce(announce_port, sys_type=imcpy.SystemType.CCU)
                yield made
            finally:
                made.over.set()
                posting.join()
            context.close()
    finally:
        console.close()
        service.kill()


def _describe(scene: Scene) -> None:
    """Create the missions."""
    service, area = scene.service, rectangle(0, 0, SIDE_M, SIDE_M)
    common: dict[str, Any] = {"area": area, "cell_m": 10.0, "step_deadline_s": 3600, "limits": {"max_step_m": 20.0}}
    kinds = dict.fromkeys(POSTING, "rest") | dict.fromkeys(DUNES, "imc")
    ways_home: dict[str, dict[str, Any]] = {
        "low_energy": {"endurance_min": 60.0, "recovery_point": lon_lat(200.0, -3000.0)}
    }
    vehicles = [{"name": name, "kind": kind} | ways_home.get(name, {}) for name, kind in kinds.items()]
    scene.mission = service.create(name="All that can fail", vehicles=vehicles, **common)
    lost = [{"name": name, "kind": "imc"} for name in LOST]
    scene.lost = service.create(name="Out of reach", vehicles=lost, **common)
    scene.to_come = service.create(name="To come", vehicles=[{"name": "no_position", "kind": "imc"}], **common)
    for name in POSTING:
        scene.tell(name)
    scene.tell("low_energy", battery_pct=100.0)


def _set_off(scene: Scene) -> None:
    """Start both once their vehicles are heard; those of the second are heard no more."""
    service = scene.service

    def ready() -> bool:
        states = {v["name"]: v["link"] for v in service.get("/vehicles")}
        return all(states.get(name) == "ready" for name in (*POSTING, *DUNES, *LOST))

    scene.wait(ready, "the vehicles are ready")
    for mission in (scene.mission, scene.lost):
        service.act(mission, "start")
    scene.wait(lambda: all(v["link"] == "engaged" for v in view(scene, scene.lost)["vehicles"]), "they follow")
    for name in LOST:
        scene.dunes.vanish(name)
    flying = {*POSTING, *DUNES}
    scene.wait(lambda: flying <= {leg["vehicle"] for leg in view(scene, scene.mission)["waypoints"]}, "all have legs")


def view(scene: Scene, mission: str) -> dict[str, Any]:
    found: dict[str, Any] = scene.service.get(f"/missions/{mission}")
    return found


def link(scene: Scene, vehicle: str) -> str:
    [state] = [v["link"] for v in view(scene, scene.mission)["vehicles"] if v["name"] == vehicle]
    return str(state)


def failsafes(scene: Scene, vehicle: str) -> set[str]:
    [active] = [v["failsafes"] for v in view(scene, scene.mission)["vehicles"] if v["name"] == vehicle]
    return {str(one["failsafe"]) for one in active}


def depth_m(scene: Scene, vehicle: str) -> float:
    [depth] = [v["depth_m"] for v in view(scene, scene.mission)["vehicles"] if v["name"] == vehicle]
    return float(depth)


def come_close(scene: Scene) -> None:
    there = POSTING["its_neighbour"]
    scene.tell("separation_lost", (there[0] - 1.0, there[1]))
    scene.tell("its_neighbour")


def a_ship_comes(scene: Scene) -> None:
    scene.tell("traffic", depth_m=0.0)
    # Told of while the vehicle is below, she comes close where it comes up; the alarm keeps these words.
    scene.wait(lambda: depth_m(scene, "traffic") == 0.0, "the vehicle is up")
    lon, lat = lon_lat(*POSTING["traffic"])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(3):
            sender.sendto(position(211000001, lat, lon) + b"\r\n", ("127.0.0.1", scene.ais_port))


def somebody_else_aborts(scene: Scene) -> None:
    abort = imcpy.Abort()

    def send(node: Any) -> None:
        abort.src, abort.dst, abort.timestamp = 0x4001, node.imc_id, 1.7e9
        scene.console.sock.sendto(imcpy.Packet.serialize(abort), node.address)

    def taken() -> bool:
        # Nothing is taken from us while it does not follow: on a busy machine it may have to be engaged anew.
        if link(scene, "other_console") == "engaged":
            scene.dunes.do("other_console", send)
        return "other_console" in failsafes(scene, "other_console")

    scene.wait(taken, "it was taken from us")


def restart(scene: Scene) -> None:
    scene.service.kill()
    scene.service.start()


def nothing(_scene: Scene) -> None:
    """It comes by itself."""


TRIGGERS: dict[Failsafe, Callable[[Scene], None]] = {
    Failsafe.LEAK: lambda scene: scene.dunes.do("leak", lambda node: node.fail("leak")),
    Failsafe.CRITICAL_ENERGY: lambda scene: scene.tell("critical_energy", battery_pct=8.0),
    Failsafe.TOO_DEEP: lambda scene: scene.tell("too_deep", depth_m=40.0),
    Failsafe.POSITION_LOST: lambda scene: scene.tell("position_lost", position_sd_m=80.0),
    Failsafe.NO_POSITION: lambda scene: scene.dunes.do("no_position", lambda node: node.fail("navigation")),
    # So much used is far more than its stated endurance in one minute of this test, and too much still in six.
    Failsafe.LOW_ENERGY: lambda scene: scene.tell("low_energy", battery_pct=25.0),
    Failsafe.LINK_LOST: nothing,
    Failsafe.TRAFFIC: a_ship_comes,
    Failsafe.GEOFENCE_LEFT: lambda scene: scene.tell("geofence_left", (-60.0, 300.0)),
    Failsafe.SEPARATION_LOST: come_close,
    Failsafe.VEHICLE_ERROR: lambda scene: scene.dunes.do("vehicle_error", lambda node: node.fail("error")),
    Failsafe.OTHER_CONSOLE: somebody_else_aborts,
    Failsafe.ALL_LINKS_LOST: nothing,
    Failsafe.SERVICE_RESTARTED: restart,
}

SHOWN: dict[Failsafe, tuple[str, str]] = {
    Failsafe.LEAK: ("Leak", "it reports: .*leak"),
    Failsafe.CRITICAL_ENERGY: ("Critical energy", "its battery is at 8 %, and it has no way home"),
    Failsafe.TOO_DEEP: ("Too deep", "it is at 40.0 m, and 30 m is the limit"),
    Failsafe.POSITION_LOST: ("Position lost", "it knows where it is to 80 m"),
    Failsafe.NO_POSITION: ("No position", r"it does not tell where it is: its position is \d+ s old"),
    Failsafe.LOW_ENERGY: ("Low energy", r"its energy lasts \d+ s for sure, and its way home takes \d+ s"),
    Failsafe.LINK_LOST: ("Link lost", "its link is lost: "),
    Failsafe.TRAFFIC: ("Traffic", "the ship MMSI 211000001 .*comes to 0 m now"),
    Failsafe.GEOFENCE_LEFT: ("Geofence left", "it is outside the area"),
    Failsafe.SEPARATION_LOST: ("Separation lost", "its_neighbour is 1.0 m away at the same depth"),
    Failsafe.VEHICLE_ERROR: ("Vehicle error", "it reports: .*motor current too high"),
    Failsafe.OTHER_CONSOLE: ("Other console", "abort"),
    Failsafe.ALL_LINKS_LOST: ("", "none of 2 vehicles is heard any more"),
    Failsafe.SERVICE_RESTARTED: ("", "the service was started anew: the mission goes on with what was committed"),
}
"""What the vehicle's card calls it, and says."""


DONE = {Response.SURFACE: re.compile("Surfacing|Stopped"), Response.RETURN: re.compile("Returning home|No contact")}
"""What the vehicle does then, in its card's words; one that is silent cannot be sent."""


@pytest.mark.parametrize("failsafe", TABLE)
def test_the_page_shows_what_the_table_promises(scene: Scene, failsafe: Failsafe) -> None:
    page, name = scene.page, failsafe.value
    of_lost = failsafe in (Failsafe.LINK_LOST, Failsafe.ALL_LINKS_LOST)
    show(page, scene.lost if of_lost else scene.mission)
    TRIGGERS[failsafe](scene)
    called, words = SHOWN[failsafe]
    is_alarm = name in map(str, AlarmKind)
    if called:
        line = by_id(page, f"failsafe-{name}-{name}")
        expect(line).to_contain_text(called)
        expect(line).to_contain_text(re.compile(words))
        if TABLE[failsafe].response in DONE:
            expect(by_id(page, f"state-{name}")).to_contain_text(DONE[TABLE[failsafe].response])
    if is_alarm:
        expect_alarm(page, words)
    by_id(page, "toggle-log").click()
    lines = by_id(page, "log").locator("li.alarm" if is_alarm else "li.warning")
    expect(lines.filter(has_text=re.compile(words)).first).to_be_visible()
    by_id(page, "toggle-log").click()


def expect_alarm(page: Page, words: str) -> None:
    more = by_id(page, "attention-more")
    if more.is_visible() and more.get_attribute("aria-expanded") == "false":
        more.click()
    alarm = by_id(page, "alarms").locator("li.alarm").filter(has_text=re.compile(words))
    expect(alarm.first).to_contain_text("What to do:")


def test_the_checklist_warns_of_what_the_doctor_found_of_its_vehicles(scene: Scene) -> None:
    page = scene.page
    (vehicle,) = [one for one in scene.service.get("/doctor")["vehicles"] if one["name"] == "no_position"]
    (finding,) = [one for one in vehicle["findings"] if one["cause"] == "no_way_home"]
    show(page, scene.to_come)
    by_id(page, "start").click()
    check = by_id(page, "check-doctor.no_position.no_way_home")
    expect(check).to_have_attribute("data-status", "warning")
    expect(check).to_contain_text(finding["text"])
    expect(check).to_contain_text(finding["remedy"])
    by_id(page, "preflight-close").click()


def test_the_place_of_the_own_ship_is_taken_as_it_is_now(scene: Scene) -> None:
    page = scene.page

    def tell() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for words in ("GPGGA,092750,4111.1000,N,00842.2000,W,1,8,1.0,2.0,M,55.2,M,,", "HEHDT,60.0,T"):
                sender.sendto(nmea(words) + b"\r\n", ("127.0.0.1", scene.ais_port))

    show(page, scene.mission)
    by_id(page, "go-to").click()
    by_id(page, "own-ship-go-to").click()
    expect(by_id(page, "own-ship-fault-go-to")).to_contain_text("The own ship is not heard")
    tell()
    scene.wait(lambda: scene.service.get("/traffic")["own_ship"], "she is heard")

    def is_marked() -> bool:
        # The page hears of her a moment after the service.
        by_id(page, "own-ship-go-to").click()
        return page.get_by_role("button", name="Unmark").is_visible()

    scene.wait(is_marked, "her place is marked")
    tell()
    # To where it was last, although nothing was heard of it since.
    expect(by_id(page, "from-here-geofence_left")).to_have_text(re.compile(r"^\d+ m, \d{3}°$"))
    expect(by_id(page, "own-ship-fault-go-to")).to_have_count(0)
    by_id(page, "go-to").click()
    by_id(page, "new-mission").click()
    tell()
    by_id(page, "own-ship-recovery").click()
    expect(by_id(page, "field-recovery")).to_have_value("41.185000, -8.703333")
