"""How much of what vehicles fly was planned: ``python -m benchmarks.missions.flying [--vehicles 4 --side 200]``.

A mission of the service with its simulated vehicles, in process or, with ``--kind imc``, over IMC as fake DUNE nodes in
processes of their own. Of the tracks as they were stored is told, by vehicle and in all: ``flown_m``; ``on_plan_pct``,
the part flown along a planned leg (within 4 m and 45 degrees of its course); ``loops``, closed circles in a track;
``waiting_pct``, the part of the time spent in them; ``loops_under_way``, those until its last leg was reached, after
which a vehicle waits for the others, and ``waiting_under_way_pct``, the part of that time spent in them;
``loops_giving_way``, those of them that it flew to let another one pass;
``loops_of_legs``, those that have legs in them, where its planned way crosses itself;
``survey_minutes``, how long each vehicle surveyed by its clock, of which a mission has so many; and how many legs were
not reached. ``--slow-decisions 5`` makes each decision take that many
seconds of the vehicles' time more. Printed is one JSON object; ``--write`` puts it into a page.
"""

import asyncio
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.commands.simulated_service import served
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.flight.decisions import deciding
from app.missions.flight.decisions.decision import decide
from app.missions.operations.history import events_after
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings, SimulationSettings
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, Action
from app.storage.database import Database
from app.storage.models import WaypointRow
from app.storage.queries.missions import track_points, waypoints_between
from app.storage.upkeep.prepare import prepare_database
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import ANNOUNCE_PORTS, ORIGIN, PORT

ASIDE_M = 4.0
COURSE_RAD = np.deg2rad(45.0)
LOOP_WITHIN_M = 80.0
"""A turn of 330 degrees to one side within so many metres that ends where it began is a closed loop."""
LOOP_RAD = np.deg2rad(330.0)
CLOSED_M = 6.0
MOST_FLOWN = 0.9
"""A vehicle that flew less than this part of its legs is not at the end of the last one."""
RESAMPLED_M = 1.0
LEGS_OF_LOOP_M = 2.0 * CLOSED_M
"""A closed way in which so much of legs is flown to their ends is one that was planned: who waits is nearer to one."""
GIVING_WAY_S = (-15.0, 70.0)
"""When a vehicle flies a circle to let another one pass, from when that was seen in the log on."""
PORTS_APART = 10


@dataclass(frozen=True)
class Flight:
    """Vehicles that survey a square, whose side and longest leg are in metres, and their speeds in m/s."""

    vehicles: int = 4
    kind: str = "sim"
    side: float = 200.0
    steps: int = 60
    minutes: float | None = None
    """In place of steps."""
    leg: float = 10.0
    speed: float = 1.3
    speeds: Sequence[float] = ()
    """Of single vehicles, the first ones."""
    time_scale: float = 5.0
    planner: str = "cao"
    seed: int = 0
    slow_decisions: float = 0.0
    """How much longer each decision takes, seconds of the vehicles' time."""
    layers_m: float = 1.0
    """How much deeper each vehicle is than the last one."""


def name_of(number: int) -> str:
    """Return the name of a vehicle by its number from 0 on."""
    return f"lauv-xplore-{number + 1}"


def mission(flight: Flight) -> MissionSpec:
    """Return the mission."""
    frame, side = LocalFrame(*ORIGIN), flight.side
    corners = [(0, 0), (side, 0), (side, side), (0, side), (0, 0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(float(e), float(n)))] for e, n in corners]
    vehicles = [
        {
            "name": name_of(k),
            "kind": flight.kind,
            "depth_m": 2.0 + k * flight.layers_m,
            **({"speed_mps": flight.speeds[k]} if k < len(flight.speeds) else {}),
        }
        for k in range(flight.vehicles)
    ]
    return MissionSpec.model_validate(
        {
            "name": "flying",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": vehicles,
            "budget": {"minutes": flight.minutes} if flight.minutes else {"steps": flight.steps},
            "cell_m": max(1.0, side / 100.0),
            "speed_mps": flight.speed,
            "limits": {"max_step_m": flight.leg, "min_vertical_separation_m": 1.0, "min_altitude_m": 2.0},
            "planner": {"name": flight.planner},
            "seed": flight.seed,
        }
    )


@dataclass(frozen=True)
class Flown:
    """What is left of a mission that was flown, by vehicle."""

    state: str
    survey_s: list[float]
    tracks: dict[str, list[tuple[float, float, float, float]]]
    waypoints: Sequence[WaypointRow]
    gives_way_s: dict[str, list[float]]


async def fly(flight: Flight, folder: Path, picture: Path | None = None) -> dict[str, Any]:
    """Fly the mission; what its tracks tell, which may be drawn into a file."""
    url = f"sqlite+aiosqlite:///{folder / 'mission.db'}"
    imc = ImcSettings(port=PORT, announce_ports=ANNOUNCE_PORTS, loopback_only=True)
    await prepare_database(url, may_upgrade=True)
    service = MissionService(ServiceSettings(database_url=url, imc=imc, time_scale=flight.time_scale), Database(url))
    if flight.slow_decisions:
        slow_down(flight.slow_decisions / flight.time_scale)
    crafts = [await craft(number, flight) for number in range(flight.vehicles)] if flight.kind == "imc" else []
    await service.startup()
    begun = time.monotonic()
    try:
        flown = await _flown(flight, service)
    finally:
        await service.shutdown()
        for process in crafts:
            process.terminate()
            await process.wait()
    return _told(flight, flown, time.monotonic() - begun, picture)


def fly_in_simulated_time(flight: Flight, picture: Path | None = None) -> dict[str, Any]:
    """Fly the mission as fast as the machine allows; while a thread computes no time passes. Not over IMC."""
    begun = time.monotonic()
    flown = served(SimulationSettings(), flight.time_scale, partial(_flown, flight))
    return _told(flight, flown, time.monotonic() - begun, picture)


async def _flown(flight: Flight, service: MissionService) -> Flown:
    """Fly a mission from its start to its end."""
    identity = (await service.create(mission(flight))).id
    over_imc = flight.kind == "imc"
    while over_imc and sum(view.link == "ready" for view in await service.vehicles()) < flight.vehicles:  # noqa: ASYNC110
        await asyncio.sleep(0.1)
    await service.act(await service.get(identity), Action.START, actor="benchmark")
    gives_way_s: dict[str, list[float]] = {name_of(number): [] for number in range(flight.vehicles)}
    seen = 0
    while (view := mission_view(live := await service.get(identity))).state not in ENDED:
        await asyncio.sleep(0.5)
        for event in await events_after(live, seen):
            seen, name = event.id, str(event.data.get("vehicle"))
            if "gives_way_to" in event.data and (report := live.team.named(name).report) is not None:
                gives_way_s[name].append(report.time_s)
    surveyed_s = [member.flown.survey_s for member in live.team]
    async with live.database.reading() as session:
        tracks = await track_points(session, identity)
        waypoints = await waypoints_between(session, identity, 1, 1_000_000)
    return Flown(str(view.state), surveyed_s, tracks, waypoints, gives_way_s)


def _told(flight: Flight, mission: Flown, wall_s: float, picture: Path | None) -> dict[str, Any]:
    """Return what the tracks of a mission tell, which may be drawn into a file."""
    frame = LocalFrame(*ORIGIN)
    by_vehicle: dict[str, dict[str, Any]] = {}
    drawn: dict[str, tuple[FloatArray, FloatArray]] = {}
    for name, points in mission.tracks.items():
        lon, lat, _, seconds = np.array(points).T
        track = np.column_stack(frame.to_local(lat, lon))
        ends = np.array([[row.east_m, row.north_m] for row in mission.waypoints if row.vehicle == name]).reshape(-1, 2)
        by_vehicle[name], drawn[name] = judged(track, seconds, ends, mission.gives_way_s[name]), (track, ends)
    if picture is not None:
        draw(picture, drawn)

    def mean_of(figure: str) -> float:
        return round(float(np.mean([found[figure] for found in by_vehicle.values()])), 2)

    flown = sum(found["flown_m"] for found in by_vehicle.values())
    return {
        "state": mission.state,
        "wall_s": round(wall_s, 1),
        "survey_minutes": [round(seconds / 60.0, 1) for seconds in mission.survey_s],
        "flown_m": round(flown, 1),
        "planned_m": round(sum(found["planned_m"] for found in by_vehicle.values()), 1),
        "on_plan_pct": round(sum(f["on_plan_pct"] * f["flown_m"] for f in by_vehicle.values()) / max(flown, 1e-9), 1),
        "loops": sum(found["loops"] for found in by_vehicle.values()),
        "loops_under_way": sum(found["loops_under_way"] for found in by_vehicle.values()),
        "loops_giving_way": sum(found["loops_giving_way"] for found in by_vehicle.values()),
        "loops_of_legs": sum(found["loops_of_legs"] for found in by_vehicle.values()),
        "waiting_pct": mean_of("waiting_pct"),
        "waiting_under_way_pct": mean_of("waiting_under_way_pct"),
        "missed": sum(row.status != "reached" for row in mission.waypoints),
        "by_vehicle": by_vehicle,
    }


async def craft(number: int, flight: Flight) -> asyncio.subprocess.Process:
    """Start a fake DUNE in a process of its own."""
    start = f"{flight.side * (number + 1) / (flight.vehicles + 1.0):.1f},5.0"
    return await asyncio.create_subprocess_exec(
        *(
            sys.executable,
            "-m",
            "simulator",
            "--vehicles",
            "1",
            "--names",
            name_of(number),
            "--ids",
            f"{0x1E + number}",
        ),
        *("--family", "smooth", "--size", f"{flight.side:g}", "--origin", ",".join(map(str, ORIGIN))),
        *("--base-port", f"{32220 + PORTS_APART * number}", "--speed", f"{flight.time_scale:g}", "--start", start),
        *("--announce-ports", f"{ANNOUNCE_PORTS[0]}-{ANNOUNCE_PORTS[-1]}"),
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
    )


def slow_down(seconds: float) -> None:
    """Make every decision take so much longer."""

    def slow(*arguments: Any, **named: Any) -> Any:
        time.sleep(seconds)
        return decide(*arguments, **named)

    setattr(deciding, "decide", slow)  # noqa: B010 - it is not the module's to export


def judged(track: FloatArray, seconds: FloatArray, ends: FloatArray, gives_way_s: Sequence[float]) -> dict[str, Any]:
    """Return what a track (n, 2), flown at times (n,), has in common with its legs, whose ends are (k, 2).

    ``gives_way_s`` are the times at which its vehicle began to let others pass.
    """
    pieces = np.hypot(*np.diff(track, axis=0).T)
    flown = float(pieces.sum())
    if len(ends) == 0 or flown == 0.0:
        nothing = {
            "planned_m": 0.0,
            "on_plan_pct": 0.0,
            "loops": 0,
            "loops_under_way": 0,
            "loops_giving_way": 0,
            "loops_of_legs": 0,
            "waiting_pct": 0.0,
            "waiting_under_way_pct": 0.0,
            "hours": 0.0,
        }
        return {"flown_m": flown, **nothing}
    corners = np.vstack([track[:1], ends])
    legs = np.diff(corners, axis=0)
    legs_m = np.hypot(*legs.T)
    along = np.concatenate([[0.0], np.cumsum(pieces)])
    places_m = np.arange(0.0, flown, RESAMPLED_M)
    path = np.column_stack([np.interp(places_m, along, column) for column in track.T])
    times = np.interp(places_m, along, seconds)
    step = np.diff(path, axis=0)
    course = np.arctan2(*step.T)
    on_plan = np.zeros(len(step), dtype=bool)
    for a, leg, length in zip(corners, legs, legs_m, strict=False):
        if length < 0.1:
            continue
        unit = leg / length
        offset = path[:-1] - a
        inside = (offset @ unit > -ASIDE_M) & (offset @ unit < length + ASIDE_M)
        aside = np.abs(offset @ np.array([-unit[1], unit[0]])) <= ASIDE_M
        turned = np.abs((course - np.arctan2(*unit) + np.pi) % (2 * np.pi) - np.pi)
        on_plan |= inside & aside & (turned <= COURSE_RAD)
    turns = (np.diff(course) + np.pi) % (2 * np.pi) - np.pi
    turned = np.concatenate([[0.0], np.cumsum(turns)])
    window = int(LOOP_WITHIN_M / RESAMPLED_M)
    at_end = (np.hypot(*(path - ends[-1]).T) <= CLOSED_M) & (places_m >= MOST_FLOWN * float(legs_m.sum()))
    end_m = int(np.argmax(at_end)) if at_end.any() else len(path)
    passed = ends_passed(path, ends)
    circling, loops, under_way, giving_way, of_legs, k = np.zeros(len(step), dtype=bool), 0, 0, 0, 0, 0
    while k < len(turned):
        ahead = np.abs(turned[k : k + window] - turned[k])
        back = np.hypot(*(path[k : k + len(ahead)] - path[k]).T) <= CLOSED_M
        closed = (ahead >= LOOP_RAD) & back
        if closed.any():
            end = k + int(np.argmax(closed))
            circling[k:end] = True
            under_way += end <= end_m
            begins_s, ends_s = times[k], times[min(end, len(times) - 1)]
            lets_pass = any(at + GIVING_WAY_S[0] <= ends_s and begins_s <= at + GIVING_WAY_S[1] for at in gives_way_s)
            giving_way += end <= end_m and lets_pass
            on_legs_m = way_m(np.vstack([path[k], ends[passed[k] : passed[end]]]))
            of_legs += end <= end_m and not lets_pass and on_legs_m >= LEGS_OF_LOOP_M
            loops, k = loops + 1, end
        k += 1
    spent, before = np.diff(times), np.arange(len(step)) < end_m
    return {
        "flown_m": round(flown, 1),
        "planned_m": round(float(legs_m.sum()), 1),
        "on_plan_pct": round(100.0 * float(on_plan.mean()), 1),
        "loops": loops,
        "loops_under_way": under_way,
        "loops_giving_way": giving_way,
        "loops_of_legs": of_legs,
        "waiting_pct": pct_of(spent, circling),
        "waiting_under_way_pct": pct_of(spent[before], circling[before]),
        "hours": round(float(spent.sum()) / 3600.0, 3),
    }


def pct_of(spent_s: FloatArray, in_it: BoolArray) -> float:
    """Return the part of times (n,) that is in some of them, per cent."""
    return round(100.0 * float(spent_s[in_it].sum() / max(spent_s.sum(), 1e-9)), 2)


def way_m(ends: FloatArray) -> float:
    """Return how long the way is from the first of some places (k, 2) over the others to the last."""
    return float(np.hypot(*np.diff(ends, axis=0).T).sum())


def ends_passed(path: FloatArray, ends: FloatArray) -> list[int]:
    """Return how many of the ends of legs (k, 2) were passed, one after the other, at each place of a path (n, 2)."""
    passed, count = 0, []
    for place in path:
        while passed < len(ends) and np.hypot(*(ends[passed] - place)) <= CLOSED_M:
            passed += 1
        count.append(passed)
    return count


def draw(file: Path, drawn: dict[str, tuple[FloatArray, FloatArray]]) -> None:
    """Draw tracks (n, 2) over the ends (k, 2) of legs."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 9), layout="constrained")
    axes = figure.subplots()
    for k, (track, ends) in enumerate(drawn.values()):
        axes.plot(*ends.T, "-", color=f"C{k}", linewidth=0.5)
        axes.plot(*ends.T, ".", color=f"C{k}", markersize=4)
        axes.plot(*track.T, color=f"C{k}", linewidth=1.5, alpha=0.6)
    axes.set_aspect("equal")
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly and print."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--vehicles", type=int, default=Flight.vehicles)
    parser.add_argument("--kind", choices=["sim", "imc"], default=Flight.kind)
    parser.add_argument("--side", type=float, default=Flight.side, help="of the square, metres")
    parser.add_argument("--steps", type=int, default=Flight.steps)
    parser.add_argument("--minutes", type=float, help="in place of steps")
    parser.add_argument("--leg", type=float, default=Flight.leg, help="longest leg, metres")
    parser.add_argument("--speed", type=float, default=Flight.speed, help="of the vehicles, m/s")
    parser.add_argument("--speeds", type=float, nargs="*", default=Flight.speeds, help="of each vehicle, m/s")
    parser.add_argument("--time-scale", type=float, default=Flight.time_scale)
    parser.add_argument("--planner", default=Flight.planner)
    parser.add_argument("--seed", type=int, default=Flight.seed)
    parser.add_argument("--slow-decisions", type=float, default=0.0, help="seconds of the vehicles' time")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw the tracks into this file")
    options = parser.parse_args(arguments)
    flight = Flight(**{key: value for key, value in vars(options).items() if key in Flight.__dataclass_fields__})
    with tempfile.TemporaryDirectory(prefix="bathyfleet-flying-") as folder:
        found = asyncio.run(fly(flight, Path(folder), options.picture))
    print(json.dumps(found, indent=1))
    figures = {key: value for key, value in found.items() if key != "by_vehicle"}
    length = f"{options.minutes:g} min in" if options.minutes else f"{options.steps}"
    title = f"{options.planner}, {options.vehicles} vehicles ({options.kind}), {options.side:g} m, {length} legs of "
    title += f"{options.leg:g} m"
    if options.speeds:
        title += f", {' and '.join(f'{speed:g}' for speed in options.speeds)} m/s"
        figures["flown_m_by_vehicle"] = [vehicle["flown_m"] for vehicle in found["by_vehicle"].values()]
    if options.slow_decisions:
        title += f", decisions of {options.slow_decisions:g} s"
    figures["load_of_the_machine"] = round(os.getloadavg()[1], 1)
    write_section(options.write, FLIGHT, title, figures, seeds=[options.seed])


if __name__ == "__main__":
    main()
