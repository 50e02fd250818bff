"""``bathyfleet demo``: a whole mission, from start to map, on one machine and without any vehicle.

Nothing here is special to the demonstration but the sea floor, whose truth is known: the service is the real one, the
simulated vehicles run in a process of their own and speak IMC over UDP, and the mission is driven over REST.
"""

import asyncio
import contextlib
import json
import shlex
import socket
import sys
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from app.arrays import FloatArray
from app.demo.service import DemoError, check, claimed, client, get, post, serve_during
from app.evaluation.survey.baselines import Baseline, lawnmower_baselines
from app.exploration.core.constraints import Constraints
from app.mapping.compare import difference
from app.mapping.types import Grid
from app.missions.spec.budget import Budget
from app.settings import Settings
from app.storage import private
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain

READY_TIMEOUT_S = 60.0
POLL_S = 0.4
MAP_PERIOD_S = 2.0
NOISE = 0.01
START_SPACING_M = 5.0
START_M = (2.0, 2.0)
SIDE_M = 100.0
FILES = ("tif", "xyz", "csv", "png")


@dataclass(frozen=True)
class DemoOptions:
    """What can be chosen on the command line; see ``bathyfleet demo --help``."""

    vehicles: int
    steps: int | None
    minutes: float | None
    km: float | None
    speed: float
    terrain: Path | None
    seed: int
    port: int
    keep_serving: bool
    output: Path

    @property
    def budget(self) -> Budget:
        """How long the mission is."""
        return Budget(minutes=self.minutes, km_per_vehicle=self.km, steps=self.steps)


@dataclass
class _Outcome:
    mission_id: str = ""
    state: str = ""
    progress: dict[str, Any] = field(default_factory=dict)
    interrupted: bool = False


def run_demo(options: DemoOptions, console: Console | None = None) -> int:
    """Run the demonstration; returns the exit code.

    Raises
    ------
    DemoError
        When something it needs is missing, for example the port.
    """
    return asyncio.run(_Demo(options, console or Console()).run())


class _Demo:
    def __init__(self, options: DemoOptions, console: Console) -> None:
        self._options = options
        self._console = console
        self._terrain = _sea_floor(options)
        private.make_folder(options.output)
        self._folder = options.output
        ports = free_udp_ports(2 * options.vehicles + 2)
        self._console_port = ports[0]
        self._announce_ports = ports[1 : options.vehicles + 2]
        self._vehicle_ports = ports[options.vehicles + 2 :]
        self._outcome = _Outcome()

    async def run(self) -> int:
        options, console = self._options, self._console
        settings = self._settings()
        with claimed(settings, self._folder / "mission.db"):
            self._log_to_file()
            self._write_config(settings)
            console.print(
                f"Sea floor: {self._terrain.name}, {self._terrain.width_m:g} x {self._terrain.height_m:g} m, "
                f"{self._terrain.min_depth_m:.1f} to {self._terrain.max_depth_m:.1f} m deep"
            )
            async with self._simulator():
                done = await serve_during(settings, self._fly, keep_serving=options.keep_serving, console=console)
        self._outcome.interrupted = not done
        if self._outcome.interrupted:
            self._say_how_to_go_on()
            return 130
        return 0 if self._outcome.state == "finished" else 1

    def _settings(self) -> Settings:
        from app.missions.settings import ImcSettings

        return Settings(
            port=self._options.port,
            database_url=f"sqlite+aiosqlite:///{self._folder / 'mission.db'}",
            time_scale=self._options.speed,
            output_dir=self._folder,
            imc=ImcSettings(port=self._console_port, announce_ports=tuple(self._announce_ports), loopback_only=True),
        )

    def _write_config(self, settings: Settings) -> None:
        """Leave a settings file with which ``bathyfleet serve`` goes on with the very same mission and vehicles."""
        ports = ", ".join(str(port) for port in self._announce_ports)
        private.write(
            self._config,
            f"port = {settings.port}\n"
            f"database_url = {json.dumps(settings.database_url)}\n"
            f"time_scale = {settings.time_scale}\n\n"
            f"[imc]\nport = {self._console_port}\nannounce_ports = [{ports}]\nloopback_only = true\n",
        )

    @property
    def _config(self) -> Path:
        return self._folder / "bathyfleet.toml"

    def _log_to_file(self) -> None:
        from app.api import logs

        logs.configure("info", "json", private.open_new(self._folder / "service.log"))

    def _simulator_command(self) -> list[str]:
        options = self._options
        floor = (
            ["--terrain", str(options.terrain)]
            if options.terrain is not None
            else ["--family", "harbour", "--size", f"{SIDE_M:g}"]
        )
        starts = [
            item for start in self._starts_m() for item in ("--start", ",".join(f"{value:g}" for value in start[:2]))
        ]
        return [
            *(sys.executable, "-m", "simulator", "--vehicles", str(options.vehicles), *floor),
            *("--seed", str(options.seed), "--speed", f"{options.speed:g}", "--noise", f"{NOISE:g}", *starts),
            *("--base-port", str(self._vehicle_ports[0])),
            *("--announce-ports", f"{self._announce_ports[0]}-{self._announce_ports[-1]}", "--json-ready"),
        ]

    def _starts_m(self) -> FloatArray:
        """Return where the vehicles are launched, (n, 3): side by side in the south-western corner."""
        n = self._options.vehicles
        spacing = min(START_SPACING_M, (self._terrain.width_m - 2 * START_M[0]) / max(n - 1, 1))
        return np.array([[START_M[0] + i * spacing, START_M[1], 0.0] for i in range(n)])

    @contextlib.asynccontextmanager
    async def _simulator(self) -> AsyncIterator[None]:
        """Run the vehicles in a process of their own."""
        log = private.open_new(self._folder / "vehicles.log", "wb")
        process = await asyncio.create_subprocess_exec(
            *self._simulator_command(),
            stdout=asyncio.subprocess.PIPE,
            stderr=log,
            # Ctrl-C in the terminal must not reach the vehicles before the service has stopped them.
            start_new_session=True,
        )
        try:
            if process.stdout is None:
                raise DemoError("the vehicles' output cannot be read")
            line = await asyncio.wait_for(process.stdout.readline(), READY_TIMEOUT_S)
            if not line:
                raise DemoError(f"the simulated vehicles did not start; see {log.name}")
            self._vehicles = [vehicle["name"] for vehicle in json.loads(line)["vehicles"]]
            yield
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            await process.wait()
            log.close()

    async def _fly(self, url: str) -> None:
        console = self._console
        async with client(url) as api:
            mission = await post(api, "/missions", self._mission())
            self._outcome.mission_id = mission["id"]
            console.print(f"Dashboard: [bold]{url}/#/missions/{mission['id']}[/]", soft_wrap=True)
            await self._await_vehicles(api)
            await self._await_compiling(api)
            await post(api, f"/missions/{mission['id']}/start")
            await self._watch(api, mission["id"])
            if self._outcome.state != "finished":
                reason = (await get(api, f"/missions/{mission['id']}"))["reason"]
                raise DemoError(f"the mission is {self._outcome.state}: {reason}")
            await self._report(api, mission["id"])

    def _mission(self) -> dict[str, Any]:
        terrain, options = self._terrain, self._options
        width, height = terrain.width_m, terrain.height_m
        ring = [
            terrain.frame.to_geodetic(*corner)[::-1] for corner in ((0, 0), (width, 0), (width, height), (0, height))
        ]
        return {
            "name": f"Demo over {terrain.name}",
            "area": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]},
            "vehicles": [{"name": name, "kind": "imc"} for name in self._vehicles],
            "budget": options.budget.model_dump(),
            "seed": options.seed,
            "sounding_noise": NOISE,
            "limits": {
                # As an operator with a chart of the least depth would choose it.
                "min_depth_m": round(float(np.clip(terrain.min_depth_m / 4, 0.5, 2.0)), 1),
                "min_vertical_separation_m": 0.5,
            },
        }

    async def _await_vehicles(self, api: httpx.AsyncClient) -> None:
        deadline = time.monotonic() + READY_TIMEOUT_S
        with self._console.status("Waiting for the vehicles' announces …"):
            while True:
                vehicles = {v["name"]: v for v in await get(api, "/vehicles")}
                waiting = [n for n in self._vehicles if vehicles.get(n, {}).get("link") not in ("ready", "engaged")]
                if not waiting:
                    return
                if time.monotonic() > deadline:
                    reasons = "; ".join(f"{n}: {vehicles.get(n, {}).get('reason', 'not heard')}" for n in waiting)
                    raise DemoError(f"not every vehicle became ready: {reasons}; see vehicles.log and service.log")
                await asyncio.sleep(POLL_S)

    async def _await_compiling(self, api: httpx.AsyncClient) -> None:
        """Wait for what is compiled once on each machine: vehicles would circle for slow decisions."""
        with self._console.status("Compiling, once on a new machine …"):
            while (await get(api, "/health"))["compiling"]:  # noqa: ASYNC110
                await asyncio.sleep(POLL_S)

    async def _watch(self, api: httpx.AsyncClient, mission_id: str) -> None:
        """Show the mission's progress until it has ended."""
        bar = Progress(
            TextColumn("{task.fields[length]}"),
            BarColumn(bar_width=None),
            TextColumn("coverage {task.fields[coverage]:5.1f} %"),
            TextColumn("map RMSE {task.fields[rmse]}"),
            TimeElapsedColumn(),
            _Eta(),
            console=self._console,
        )
        rmse, mapped_at = "   –   ", -MAP_PERIOD_S
        with bar:
            task = bar.add_task("", total=1.0, length="", coverage=0.0, rmse=rmse, eta=None)
            while True:
                mission = await get(api, f"/missions/{mission_id}")
                progress = mission["progress"]
                self._outcome.progress, self._outcome.state = progress, mission["state"]
                if progress["step"] > 1 and time.monotonic() - mapped_at > MAP_PERIOD_S:
                    mapped_at = time.monotonic()
                    error = await self._rmse(api, mission_id)
                    rmse = rmse if error is None else f"{error:5.3f} m"
                share, length = _how_far(progress, running=mission["state"] == "running")
                shown = {"coverage": progress["coverage_pct"], "rmse": rmse, "eta": progress["eta_s"]}
                bar.update(task, completed=share, length=length, **shown)
                if mission["state"] in ("finished", "failed", "aborted"):
                    return
                await asyncio.sleep(POLL_S)

    async def _rmse(self, api: httpx.AsyncClient, mission_id: str) -> float | None:
        answer = await api.get(f"/missions/{mission_id}/map")
        if answer.status_code != httpx.codes.OK:
            return None
        grid, depth = _grid_of(answer.json())
        return difference(depth, self._truth(grid)).rmse_m

    def _truth(self, grid: Grid) -> FloatArray:
        centres = grid.centres_m
        return self._terrain.depth_at(centres[:, 0], centres[:, 1]).reshape(grid.rows, grid.cols)

    async def _report(self, api: httpx.AsyncClient, mission_id: str) -> None:
        """Save the products and show how the map compares with what lawnmowers would have made."""
        console = self._console
        for extension in FILES:
            answer = await api.get(f"/missions/{mission_id}/map.{extension}")
            check(answer)
            private.write(self._folder / f"map.{extension}", answer.content)
        view = (await api.get(f"/missions/{mission_id}/map")).json()
        grid, depth = _grid_of(view)
        ours = difference(depth, self._truth(grid))
        mission = await get(api, f"/missions/{mission_id}")
        progress = mission["progress"]
        with console.status("Flying the lawnmowers for comparison …"):
            baselines = await asyncio.to_thread(
                lawnmower_baselines,
                self._terrain,
                Constraints(area=_rectangle(self._terrain), max_step_m=mission["spec"]["limits"]["max_step_m"]),
                self._starts_m() + np.array([0.0, 0.0, 2.0]),
                progress["distance_m"] / self._options.vehicles,
                progress["soundings"],
                grid,
                relative_noise=NOISE,
                seed=self._options.seed,
            )
        table = Table(title="Map against the true sea floor", title_justify="left")
        for heading in ("survey", "map RMSE", "ours / its", "soundings", "travelled"):
            table.add_column(heading, justify="left" if heading == "survey" else "right")
        table.add_row(
            f"bathyfleet, {self._options.vehicles} vehicles",
            f"{ours.rmse_m:.3f} m",
            "",
            str(progress["soundings"]),
            f"{progress['distance_m']:.0f} m",
            style="bold",
        )
        for name, baseline in (
            ("lawnmower, same travelled distance", baselines.same_distance),
            ("lawnmower, same number of soundings", baselines.same_soundings),
        ):
            table.add_row(name, *_cells(baseline, ours.rmse_m))
        console.print(table)
        private.write(
            self._folder / "result.json",
            json.dumps(
                {
                    "terrain": self._terrain.name,
                    "options": {k: str(v) if isinstance(v, Path) else v for k, v in vars(self._options).items()},
                    "rmse_m": ours.rmse_m,
                    "soundings": progress["soundings"],
                    "distance_m": progress["distance_m"],
                    "lawnmower_same_distance_rmse_m": baselines.same_distance.rmse_m,
                    "lawnmower_same_soundings_rmse_m": baselines.same_soundings.rmse_m,
                },
                indent=2,
            ),
        )
        names = ", ".join(f"map.{extension}" for extension in FILES)
        console.print(f"Files in [bold]{self._folder}[/]: {names}, result.json")

    def _say_how_to_go_on(self) -> None:
        command = shlex.join(["python", *self._simulator_command()[1:-1]])
        self._console.print(
            "\nStopped: the vehicles were told to stop, everything measured so far is kept in "
            f"[bold]{self._folder / 'mission.db'}[/].\nTo go on with this mission, in two terminals:\n"
        )
        # Not wrapped: these lines are meant to be copied.
        self._console.print(f"  {command}", soft_wrap=True, markup=False, highlight=False)
        self._console.print(
            f"  BATHYFLEET_CONFIG={shlex.quote(str(self._config))} bathyfleet serve",
            soft_wrap=True,
            markup=False,
            highlight=False,
        )


def _how_far(progress: dict[str, Any], *, running: bool) -> tuple[float, str]:
    """Return the share of a mission that was flown, and the same in the unit of its length."""
    budget = progress["budget"]
    for unit, left, words in (("minutes", "minutes_left", "min"), ("km_per_vehicle", "km_left_per_vehicle", "km")):
        if unit in budget and progress[left] is not None:
            whole = budget[unit]
            done = max(whole - progress[left], 0.0)
            return done / whole, f"{done:.3g}/{whole:g} {words}"
    done = max(progress["step"] - running, 0)
    return done / progress["steps"], f"step {done}/{progress['steps']}"


class _Eta(ProgressColumn):
    def render(self, task: Task) -> Text:
        eta = task.fields.get("eta")
        return Text("ETA   –  " if eta is None else f"ETA {eta:4.0f} s", style="progress.remaining")


def _sea_floor(options: DemoOptions) -> Terrain:
    if options.terrain is not None:
        return load_terrain(options.terrain)
    return generate("harbour", options.seed, width_m=SIDE_M, height_m=SIDE_M)


def free_udp_ports(count: int) -> list[int]:
    """Return ``count`` consecutive UDP ports that are free on loopback now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        first = probe.getsockname()[1]
    for base in range(min(first, 60_000), 61_000, count):
        with contextlib.ExitStack() as stack, contextlib.suppress(OSError):
            for port in range(base, base + count):
                stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)).bind(("127.0.0.1", port))
            return list(range(base, base + count))
    raise DemoError(f"no {count} consecutive free UDP ports on loopback; close programs that use them")


def _rectangle(terrain: Terrain) -> FloatArray:
    width, height = terrain.width_m, terrain.height_m
    return np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])


def _grid_of(view: dict[str, Any]) -> tuple[Grid, FloatArray]:
    grid = Grid(view["west_m"], view["south_m"], view["cell_m"], view["rows"], view["cols"])
    return grid, np.array(view["depth_m"], dtype=float)


def _cells(baseline: Baseline, ours_m: float) -> Sequence[str]:
    return (
        f"{baseline.rmse_m:.3f} m",
        f"{ours_m / baseline.rmse_m:.2f}",
        str(baseline.samples),
        f"{baseline.distance_m:.0f} m",
    )
