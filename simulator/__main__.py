"""``python -m simulator``: start fake vehicles against any consumer of IMC over UDP."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.dune.fleet import EQUIPMENT
from simulator.dune.lost_comms import TIMEOUT_S
from simulator.dune.options import DEFAULT_ANNOUNCE_PORTS
from simulator.equipment import Equipment
from simulator.floors import seafloors
from simulator.floors.terrain_files import load_terrain
from simulator.network import NetworkFaults
from simulator.sonars.sensors import SensorKind, SonarNoise
from simulator.sonars.swath import SwathSonar
from simulator.targets import RangingNoise, TargetSpec
from simulator.vehicles.battery import BatterySpec
from simulator.water_column import SeaWater, WaterColumn

NEW_BATTERY = BatterySpec()

app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def main(
    vehicles: Annotated[int, typer.Option(help="How many vehicles.", min=1)] = 2,
    terrain: Annotated[
        Path | None, typer.Option(help="Sea floor from a file: .npz, .asc, GeoTIFF, .xyz or .csv.")
    ] = None,
    family: Annotated[
        str, typer.Option(help=f"Generated sea floor: {', '.join(sorted(seafloors.FAMILIES))}.")
    ] = "harbour",
    size: Annotated[float, typer.Option(help="Side of the generated sea floor, metres.")] = 100.0,
    seed: Annotated[int, typer.Option(help="Seed of the sea floor and of all randomness.", min=0)] = 0,
    origin: Annotated[
        str | None,
        typer.Option(help="LAT,LON of the sea floor's south-west corner; the file's, else Leixões harbour."),
    ] = None,
    speed: Annotated[float, typer.Option(help="Vehicle seconds per wall second.")] = 1.0,
    sensor: Annotated[SensorKind, typer.Option(help="Sonar on board.")] = SensorKind.SINGLE,
    swath: Annotated[
        str | None, typer.Option(help="DEGREES,BEAMS,HZ,METRES of a multibeam: aperture, beams, pings a second, range.")
    ] = None,
    noise: Annotated[float, typer.Option(help="Relative standard deviation of ranges.")] = 0.005,
    outliers: Annotated[float, typer.Option(help="Share of false returns, 0 to 1.")] = 0.0,
    dropouts: Annotated[float, typer.Option(help="Share of missing returns, 0 to 1.")] = 0.0,
    drift: Annotated[
        float, typer.Option(help="Growth of the position's variance under water, m2/s (DUNE reports 0.02).")
    ] = 0.0,
    current: Annotated[str, typer.Option(help="EAST,NORTH velocity of the water, m/s.")] = "0,0",
    sound_speed: Annotated[
        str,
        typer.Option(help="DEPTH:SPEED,... of sound (metres, m/s, linear between); vehicles then have a probe for it."),
    ] = "",
    endurance: Annotated[
        float, typer.Option(help="Minutes that a full battery lasts at --nominal-speed.")
    ] = NEW_BATTERY.endurance_min,
    nominal_speed: Annotated[
        float, typer.Option(help="Speed through the water that --endurance is given for, m/s.")
    ] = NEW_BATTERY.nominal_mps,
    battery: Annotated[float, typer.Option(help="Level at the start, per cent.")] = NEW_BATTERY.level_pct,
    battery_confidence: Annotated[
        float, typer.Option(help="How sure vehicles say that they are of that level, per cent.")
    ] = NEW_BATTERY.confidence_pct,
    consumption_factor: Annotated[
        float, typer.Option(help="How much is really consumed: 1.3 is 30 per cent more than --endurance says.")
    ] = NEW_BATTERY.consumption_factor,
    start: Annotated[
        list[str] | None,
        typer.Option(help="EAST,NORTH[,DEPTH] of a vehicle in metres from the corner; once per vehicle."),
    ] = None,
    names: Annotated[str, typer.Option(help="Comma-separated names; lauv-sim-1 ... by default.")] = "",
    ids: Annotated[str, typer.Option(help="Comma-separated IMC ids; 0x0101 ... by default.")] = "",
    base_port: Annotated[int, typer.Option(help="imc+udp port of the first vehicle.", min=1, max=65000)] = 6002,
    bind: Annotated[str, typer.Option(help="Address to listen on and to announce.")] = "127.0.0.1",
    announce_address: Annotated[
        list[str] | None,
        typer.Option(help="Where announces go, repeatable: 127.0.0.1, 224.0.75.69 or a broadcast address."),
    ] = None,
    announce_ports: Annotated[
        str, typer.Option(help="Announce ports; one of them is taken to listen on.")
    ] = "30100-30104",
    chatter: Annotated[bool, typer.Option(help="Also send servo and attitude messages at full rate.")] = False,
    loss: Annotated[float, typer.Option(help="Share of packets lost, 0 to 1.")] = 0.0,
    delay: Annotated[float, typer.Option(help="Delay of every packet, wall seconds.")] = 0.0,
    jitter: Annotated[float, typer.Option(help="Additional random delay up to this, wall seconds.")] = 0.0,
    duplicate: Annotated[float, typer.Option(help="Share of packets that arrive twice, 0 to 1.")] = 0.0,
    reorder: Annotated[float, typer.Option(help="Share of packets that arrive late, 0 to 1.")] = 0.0,
    radio_range: Annotated[
        float, typer.Option(help="Metres at which radio ends, and at the surface; 0: it does not end.", min=0.0)
    ] = 0.0,
    lost_comms: Annotated[
        float,
        typer.Option(
            help="Seconds without a console until a vehicle starts the plan stored as lostcomms; 0: never.", min=0.0
        ),
    ] = TIMEOUT_S,
    log_dir: Annotated[
        Path | None, typer.Option(help="Folder in which every vehicle keeps its log (Data.lsf), as DUNE does on board.")
    ] = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME:EAST,NORTH,DEPTH[,HEADING,SPEED] of a target with a transponder (metres, degrees, m/s), which "
            "the vehicles range to; repeatable."
        ),
    ] = None,
    range_noise: Annotated[
        float, typer.Option(help="Relative standard deviation of ranges to targets.", min=0.0)
    ] = 0.01,
    range_period: Annotated[
        float, typer.Option(help="Seconds between two ranges of a vehicle to a target.", min=0.1)
    ] = 2.0,
    hearing: Annotated[
        float, typer.Option(help="Metres at which targets are no longer heard; 0: they are heard everywhere.", min=0.0)
    ] = 0.0,
    json_ready: Annotated[
        bool, typer.Option(help="Print one JSON line with names, ids and ports when all vehicles are up.")
    ] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Log what happens to stderr.")] = False,
) -> None:
    """Start fake vehicles that announce themselves and speak IMC over UDP as DUNE does.

    They run until interrupted (Ctrl-C) or terminated.
    """
    logging.basicConfig(
        stream=sys.stderr,
        level=logging.INFO if verbose else logging.WARNING,
        format="%(levelname)s %(message)s",
    )
    try:
        floor = load_terrain(terrain) if terrain else seafloors.generate(family, seed, width_m=size, height_m=size)
        if origin is not None:
            lat, lon = _numbers("origin", origin, 2)
            floor = floor.placed_at(lat, lon)
        equipment = Equipment(
            sensor=sensor,
            noise=SonarNoise(noise, outliers, dropouts),
            ping_period_s=EQUIPMENT.ping_period_s,
            swath=SwathSonar() if swath is None else _swath(swath),
            drift_m2ps=drift,
            battery=BatterySpec(endurance, nominal_speed, battery, consumption_factor, battery_confidence),
        )
        specs = default_specs(
            vehicles,
            floor,
            names=[name.strip() for name in names.split(",") if name.strip()],
            ids=[_imc_id(text) for text in ids.split(",") if text.strip()],
            starts=[_start(text) for text in start or []],
            base_port=base_port,
        )
        east, north = _numbers("current", current, 2)
        fleet = DuneFleet(
            floor,
            specs,
            equipment,
            speed=speed,
            water=SeaWater(
                (east, north), WaterColumn.of([_entry(text) for text in sound_speed.split(",") if text.strip()])
            ),
            options=DuneOptions(
                bind_address=bind,
                announce_addresses=tuple(announce_address or ["127.0.0.1"]),
                announce_ports=_ports(announce_ports),
                faults=NetworkFaults(loss=loss, delay_s=delay, jitter_s=jitter, duplicate=duplicate, reorder=reorder),
                chatter=chatter,
                radio_range_m=radio_range,
                lost_comms_s=lost_comms,
                log_dir=log_dir,
            ),
            seed=seed,
            targets=[_target(text) for text in target or []],
            ranging=RangingNoise(relative_sd=range_noise, period_s=range_period, hearing_m=hearing or math.inf),
        )
        asyncio.run(_run(fleet, json_ready))
    except (ValueError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from error


def _start(text: str) -> tuple[float, float, float]:
    east, north, *depth = _numbers("start", text, 2, 3)
    return east, north, depth[0] if depth else 0.0


def _entry(text: str) -> tuple[float, float]:
    depth, colon, speed = text.partition(":")
    if not colon:
        raise ValueError(f"--sound-speed has {text!r}; each entry must be DEPTH:SPEED, metres and metres per second")
    (depth_m,), (speed_mps,) = _numbers("sound-speed", depth, 1), _numbers("sound-speed", speed, 1)
    return depth_m, speed_mps


def _swath(text: str) -> SwathSonar:
    aperture_deg, beams, rate_hz, range_m = _numbers("swath", text, 4)
    return SwathSonar(aperture_deg, int(beams), rate_hz, range_m)


def _target(text: str) -> TargetSpec:
    name, colon, rest = text.partition(":")
    if not (name and colon):
        raise ValueError(
            f"--target is {text!r}; it must be NAME:EAST,NORTH,DEPTH or NAME:EAST,NORTH,DEPTH,HEADING,SPEED"
        )
    east, north, depth, *course = _numbers("target", rest, 3, 5)
    if not course:
        return TargetSpec(name, (east, north, depth), speed_mps=0.0)
    return TargetSpec(name, (east, north, depth), math.radians(course[0]), course[1])


async def _run(fleet: DuneFleet, json_ready: bool) -> None:
    loop = asyncio.get_running_loop()
    stopped = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopped.set)
    async with fleet:
        if json_ready:
            typer.echo(json.dumps(fleet.describe()))
            sys.stdout.flush()
        else:
            _greet(fleet)
        waiting = {
            asyncio.create_task(stopped.wait(), name="stop"),
            asyncio.create_task(fleet.wait(), name="fleet"),
        }
        done, pending = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        for task in pending:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
        for task in done:
            task.result()
    for node in fleet.nodes:
        for time_s, place in node.vehicle.collisions:
            typer.echo(
                f"{node.name} hit the bottom at {place.east_m:.1f} m east, {place.north_m:.1f} m north, "
                f"{place.depth_m:.1f} m depth (vehicle time {time_s:.0f})",
                err=True,
            )


def _greet(fleet: DuneFleet) -> None:
    typer.echo(
        f"sea floor: {fleet.terrain.name}, {fleet.terrain.width_m:g} x {fleet.terrain.height_m:g} m, "
        f"{fleet.terrain.min_depth_m:.1f} to {fleet.terrain.max_depth_m:.1f} m deep"
    )
    for node in fleet.nodes:
        host, port = node.address
        typer.echo(f"{node.name}: IMC id 0x{node.imc_id:04x}, imc+udp://{host}:{port}/")
    typer.echo("Ctrl-C stops.")


def _numbers(option: str, text: str, *counts: int) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts:
        wanted = " or ".join(map(str, counts))
        raise ValueError(f"--{option} is {text!r}; it must be {wanted} numbers joined by commas")
    return values


def _imc_id(text: str) -> int:
    try:
        return int(text.strip(), 0)
    except ValueError as error:
        raise ValueError(f"--ids holds {text!r}; an IMC id is a number such as 0x0101 or 257") from error


def _ports(text: str) -> tuple[int, ...]:
    first, _, last = text.partition("-")
    try:
        ports = tuple(range(int(first), int(last or first) + 1))
    except ValueError:
        ports = ()
    if not ports or ports[0] < 1 or ports[-1] > 65535:
        shown = f"{DEFAULT_ANNOUNCE_PORTS[0]}-{DEFAULT_ANNOUNCE_PORTS[-1]}"
        raise ValueError(f"--announce-ports is {text!r}; it must be a range of ports such as {shown}")
    return ports


if __name__ == "__main__":
    app()
