"""How long it takes from a sounding to the picture that holds it.

``python -m benchmarks.display.picture [--soundings 40 --sims 2]``. The real service flies a mission of simulated
vehicles, whose soundings keep it busy, of one that speaks REST and of one that speaks IMC on a UDP socket. The latter
two go where they are sent and sound in turn, once every second or so, in a cell where nothing was sounded yet. A
watcher does what the page does: it waits for the live view's message that something is new, fetches the tiles that
changed since those it has, and puts them together, with the page's pause between two fetches. Measured is the time from
the first byte sent until the cell of the sounding counts it in the picture. A REST measurement that the service does
not accept ends the run. Printed is one JSON object.
"""

import asyncio
import contextlib
import json
import math
import sys
import time
import zlib
from typing import Any

import httpx
import imcpy
import numpy as np
import websockets

from app.mapping.coordinates.georeference import LocalFrame
from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.imc.fleet import ANNOUNCE_PORTS, BRIDGE_PORT, Vehicle
from benchmarks.service.beginning import corners
from benchmarks.service.boats import Boat as RestBoat
from benchmarks.service.boats import bottom_m, move, running_service
from tests.support.dashboard.service import Service
from tests.support.missions.maps import read

ASKED_MS = 1000.0
PATIENCE_S = 30.0
PAGE_PAUSE_S = 0.3
SIDE_M = 300.0
RATE_HZ = 10
SPEED_MPS = 2.0
FRAME = LocalFrame(41.185, -8.705)
BRIDGE = ("127.0.0.1", BRIDGE_PORT)
REST = "boat-0"
SOUNDED = 1


class Sounder(Vehicle):
    """A vehicle that speaks IMC, goes where its references say, and sounds when it is asked to."""

    def __init__(self) -> None:
        super().__init__(0, 50)
        self.boat = RestBoat(self.name, 40.0, 20.0)
        self.executing = True

    def listen(self) -> None:
        while True:
            try:
                message = imcpy.Packet.deserialize(self.sock.recvfrom(65536)[0])
            except BlockingIOError:
                return
            if isinstance(message, imcpy.PlanControl):
                plan = self.messages["PlanControlState"]
                started = message.op == imcpy.PlanControl.OperationEnum.START
                plan.state, plan.plan_id = imcpy.PlanControlState.StateEnum(3 if started else 1), message.plan_id
                self.send(plan, BRIDGE)
            elif isinstance(message, imcpy.Reference):
                east, north = FRAME.to_local(math.degrees(message.lat), math.degrees(message.lon))
                self.boat.target = float(east), float(north)
                echo = imcpy.FollowRefState()
                echo.control_src, echo.reference = message.src, message
                echo.state = imcpy.FollowRefState.StateEnum(2)
                self.send(echo, BRIDGE)
            elif isinstance(message, imcpy.EntityList):
                names = imcpy.EntityList()
                names.op, names.list = imcpy.EntityList.OperationEnum.REPORT, "Altimeter=58"
                self.send(names, BRIDGE)

    async def live(self) -> None:
        """Move and report until cancelled."""
        self.messages["PlanControlState"].state = imcpy.PlanControlState.StateEnum(1)
        for tick in range(10**9):
            if tick % (2 * RATE_HZ) == 0:
                self.announce()
            self.listen()
            move(self.boat, SPEED_MPS / RATE_HZ)
            lat, lon = FRAME.to_geographic(self.boat.east_m, self.boat.north_m)
            state = self.messages["EstimatedState"]
            state.lat, state.lon, state.depth = math.radians(lat), math.radians(lon), 2.0
            often = [name for name in ("PlanControlState", "VehicleState", "Heartbeat") if tick % 5 == 0]
            for name in ("EstimatedState", *often):
                self.send(self.messages[name], BRIDGE)
            await asyncio.sleep(1 / RATE_HZ)

    def sound(self) -> None:
        """Measure the bottom here."""
        distance = self.messages["Distance"]
        distance.value = bottom_m(self.boat.east_m, self.boat.north_m) - 2.0
        self.send(distance, BRIDGE)


class Page:
    """The picture as the page has it: told by the live view what is new, kept up by changed tiles."""

    def __init__(self, service: Service, mission: str, client: httpx.AsyncClient) -> None:
        self._address = service.url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
        self._tiles = f"/api/v1/missions/{mission}/map/tiles"
        self._client = client
        self._wanted = asyncio.Event()
        self.changed = asyncio.Condition()
        self.tag = ""
        self.layers: dict[str, np.ndarray] = {}
        self.cell_m = 1.0
        self.fetched = self.whole = 0

    async def follow(self) -> None:
        """Do so until cancelled."""
        async with websockets.connect(self._address, max_size=None) as line, asyncio.TaskGroup() as group:
            group.create_task(self._fetch())
            async for text in line:
                if json.loads(text)["type"] in ("map", "snapshot"):
                    self._wanted.set()

    async def _fetch(self) -> None:
        while True:
            await self._wanted.wait()
            self._wanted.clear()
            answer = await self._client.get(self._tiles, params={"since": self.tag})
            if answer.status_code == 200:
                self._put_together(zlib.compress(answer.content))  # as it travelled: the client has inflated it
                async with self.changed:
                    self.changed.notify_all()
            await asyncio.sleep(PAGE_PAUSE_S)

    def _put_together(self, content: bytes) -> None:
        header, tiles = read(content)
        if header["base"] is None:
            self.layers = {name: np.zeros((header["rows"], header["cols"]), int) for name in header["layers"]}
            self.whole += 1
        elif header["base"] != self.tag:
            raise SystemExit(f"tiles since {header['base']} came where {self.tag} was asked for")
        side, across = header["tile"], -(-header["cols"] // header["tile"])
        for number, layers in tiles.items():
            row, col = number // across * side, number % across * side
            for name, cells in layers.items():
                self.layers[name][row : row + cells.shape[0], col : col + cells.shape[1]] = cells
        self.tag, self.cell_m, self.fetched = header["tag"], header["cell_m"], self.fetched + 1

    def counted(self, east_m: float, north_m: float) -> int:
        """How many soundings the picture counts in the cell of a place and its eight neighbours."""
        if not self.layers:
            return 0
        row, col = int(north_m / self.cell_m), int(east_m / self.cell_m)
        around = slice(max(row - 1, 0), row + 2), slice(max(col - 1, 0), col + 2)
        count, flags = self.layers["count"][around], self.layers["flags"][around]
        return int(count[(flags > 0) & (flags & SOUNDED > 0)].sum())


async def orders(client: httpx.AsyncClient, mission: str, boat: RestBoat) -> None:
    """Let a vehicle that speaks REST go where it is sent, until cancelled."""
    while True:
        answer = await client.get(
            f"/api/v1/missions/{mission}/vehicles/{boat.name}/waypoint",
            params={"after_step": max(boat.step, 0), "timeout_s": 20},
        )
        if answer.status_code == 200:
            found = answer.json()
            boat.step, boat.target = found["step"], (found["east_m"], found["north_m"])
        else:
            await asyncio.sleep(0.5)


async def sail(client: httpx.AsyncClient, mission: str, boat: RestBoat) -> None:
    """Move a vehicle that speaks REST, and report where it is twice a second, until cancelled."""
    for tick in range(10**9):
        move(boat, SPEED_MPS / RATE_HZ)
        boat.time_s = time.time()
        if tick % (RATE_HZ // 2) == 0:
            await client.post(f"/api/v1/missions/{mission}/measurements", json={"items": [item_of(boat, sounds=False)]})
        await asyncio.sleep(1 / RATE_HZ)


def item_of(boat: RestBoat, *, sounds: bool) -> dict[str, Any]:
    """What it posts."""
    lat, lon = FRAME.to_geographic(boat.east_m, boat.north_m)
    item = {"vehicle": boat.name, "time_s": time.time(), "lat_deg": float(lat), "lon_deg": float(lon), "depth_m": 2.0}
    return item | ({"range_m": bottom_m(boat.east_m, boat.north_m) - 2.0} if sounds else {})


async def measure(service: Service, mission: str, number: int, sounder: Sounder) -> dict[str, Any]:
    """Sound in turn by REST and IMC; how long until each was in the picture, ms."""
    found: dict[str, list[float]] = {"answer_ms": [], "rest_ms": [], "imc_ms": []}
    rng = np.random.default_rng(0)
    boat = RestBoat(REST, 20.0, 20.0)
    async with httpx.AsyncClient(base_url=service.url, timeout=60.0) as client:
        page = Page(service, mission, client)
        tasks = [
            asyncio.create_task(work)
            for work in (page.follow(), sounder.live(), orders(client, mission, boat), sail(client, mission, boat))
        ]
        try:
            await first_of(client, mission)
            for turn in range(number):
                by_rest = turn % 2 == 0
                vehicle = boat if by_rest else sounder.boat
                while page.counted(vehicle.east_m, vehicle.north_m) > 0:  # somebody sounded here
                    await asyncio.sleep(0.05)
                    for task in tasks:
                        if task.done():
                            task.result()
                place, began = (vehicle.east_m, vehicle.north_m), time.perf_counter()
                if by_rest:
                    answer = await client.post(
                        f"/api/v1/missions/{mission}/measurements", json={"items": [item_of(boat, sounds=True)]}
                    )
                    if answer.raise_for_status().json()["accepted"] != 1:
                        raise SystemExit(f"the sounding was not accepted: {answer.text}")
                    found["answer_ms"].append(1e3 * (time.perf_counter() - began))
                else:
                    sounder.sound()
                try:
                    async with asyncio.timeout(PATIENCE_S), page.changed:
                        await page.changed.wait_for(lambda place=place: page.counted(*place) > 0)  # type: ignore[misc]
                except TimeoutError:
                    raise SystemExit(f"the sounding of {vehicle.name} did not come into the picture") from None
                found["rest_ms" if by_rest else "imc_ms"].append(1e3 * (time.perf_counter() - began))
                await asyncio.sleep(rng.uniform(1.0, 2.0))
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
    return found | {"fetches": page.fetched, "of_the_whole_map": page.whole}


async def first_of(client: httpx.AsyncClient, mission: str) -> None:
    """Wait until the mission has a map."""
    for _ in range(600):
        if (await client.get(f"/api/v1/missions/{mission}/map/tiles")).status_code == 200:
            return
        await asyncio.sleep(0.2)
    raise SystemExit("the mission has no map")


def begin(service: Service, sims: int, sounder: Sounder) -> str:
    """Start a mission of simulated vehicles and the two that are asked to sound."""
    team: list[dict[str, Any]] = [{"name": f"sim-{i}", "kind": "sim", "sensor": "dvl"} for i in range(sims)]
    team += [{"name": REST, "kind": "rest"}, {"name": sounder.name, "kind": "imc"}]
    mission = service.create(
        area=corners(SIDE_M),
        vehicles=team,
        steps=2000,
        cell_m=1.0,
        planner={"name": "random"},
        limits={"max_step_m": 40, "max_depth_m": 8, "min_separation_m": 0},
    )

    async def until_ready() -> None:
        async with httpx.AsyncClient(base_url=service.url, timeout=60.0) as client:
            living = asyncio.create_task(sounder.live())
            boat = RestBoat(REST, 20.0, 20.0)
            for _ in range(300):
                await client.post(
                    f"/api/v1/missions/{mission}/measurements", json={"items": [item_of(boat, sounds=True)]}
                )
                known = {view["name"]: view["link"] for view in (await client.get("/api/v1/vehicles")).json()}
                if known.get(sounder.name) == "ready":
                    break
                await asyncio.sleep(0.2)
            else:
                raise SystemExit(f"{sounder.name} was not found over IMC")
            answer = await client.post(f"/api/v1/missions/{mission}/start")
            answer.raise_for_status()
            living.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await living

    asyncio.run(until_ready())
    return mission


def main() -> int:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--soundings", type=int, default=40)
    parser.add_argument("--sims", type=int, default=2)
    options = parser.parse_args()
    sounder = Sounder()
    settings = {
        "time_scale": "1",
        "log_level": "warning",
        "imc__enabled": "true",
        "imc__loopback_only": "true",
        "imc__port": str(BRIDGE_PORT),
        "imc__announce_ports": json.dumps(ANNOUNCE_PORTS),
    }
    with running_service(**settings) as service:
        mission = begin(service, options.sims, sounder)
        found = asyncio.run(measure(service, mission, options.soundings, sounder))
        service.act(mission, "abort")
    result: dict[str, Any] = {"sims": options.sims, "soundings": options.soundings}
    slowest = max(*found["rest_ms"], *found["imc_ms"])
    for name, values in found.items():
        if isinstance(values, list):
            shown = (
                f"{np.median(values):.0f} median, {np.quantile(values, 0.95):.0f} for 95 %, {max(values):.0f} longest"
            )
            result[name] = shown
        else:
            result[name] = values
    print(json.dumps(result))
    write_section(options.write, LOAD, "From a sounding to the picture", result)
    return 0 if slowest <= ASKED_MS else 1


if __name__ == "__main__":
    sys.exit(main())
