"""Several fake DUNE nodes over one sea floor, driven by one clock."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np

from simulator.clock import SimulationClock
from simulator.dune.node import FakeDune
from simulator.dune.options import DuneOptions
from simulator.dune.transport.discovery import listen_for_announces
from simulator.equipment import Equipment
from simulator.floors.terrain import Terrain
from simulator.network import Address, UdpEndpoint
from simulator.targets import Ranging, RangingNoise, Target, TargetSpec
from simulator.vehicles.battery import BatterySpec
from simulator.vehicles.vehicle import STEP_S
from simulator.water_column import STILL, SeaWater
from simulator.world import SimulatedVehicle

log = logging.getLogger(__name__)

FIRST_IMC_ID = 0x0101
FIRST_PORT = 6002
TICK_S = 0.02
"""Least wall time between two rounds of the simulation."""
MOST_BEHIND_S = 0.5
"""Wall time by which the simulation may lag before vehicle time is left out."""
EQUIPMENT = Equipment(ping_period_s=0.1, battery=BatterySpec())
"""Of vehicles of which nothing else is said."""


@dataclass(frozen=True, slots=True)
class VehicleSpec:
    """One vehicle of a fleet.

    ``start`` is (east, north, depth) in metres in the terrain's frame, ``port`` the first choice of UDP port.
    """

    name: str
    imc_id: int
    port: int
    start: tuple[float, float, float]
    heading_rad: float = 0.0


def default_specs(
    count: int,
    terrain: Terrain,
    *,
    names: Sequence[str] = (),
    ids: Sequence[int] = (),
    starts: Sequence[tuple[float, float, float]] = (),
    base_port: int = FIRST_PORT,
) -> list[VehicleSpec]:
    """Vehicles ``lauv-sim-1`` … side by side at the southern border, unless given otherwise.

    Raises
    ------
    ValueError
        When more names, ids or starts are given than vehicles, or any twice.
    """
    if count < 1:
        raise ValueError(f"vehicles is {count}; it must be at least 1")
    for what, given in (("names", names), ("ids", ids), ("starts", starts)):
        if len(given) > count:
            raise ValueError(f"{what} gives {len(given)} values for {count} vehicles")
    all_names = [*names, *(f"lauv-sim-{k + 1}" for k in range(len(names), count))]
    all_ids = [*ids, *(FIRST_IMC_ID + k for k in range(len(ids), count))]
    for what, values in (("names", all_names), ("ids", all_ids)):
        if len(set(values)) < count:
            raise ValueError(f"{what} holds a value twice: {', '.join(map(str, values))}")
    north = min(5.0, 0.5 * terrain.height_m)
    places = [
        *starts,
        *(((k + 1) * terrain.width_m / (count + 1), north, 0.0) for k in range(len(starts), count)),
    ]
    return [
        VehicleSpec(name, imc_id, base_port + k, place)
        for k, (name, imc_id, place) in enumerate(zip(all_names, all_ids, places, strict=True))
    ]


class DuneFleet:
    """Fake DUNE nodes as an async context manager: up inside, gone afterwards.

    Parameters
    ----------
    terrain
        The sea floor of all.
    specs
        The vehicles.
    speed
        Vehicle seconds per wall second.
    equipment
        Of every vehicle; None: :data:`EQUIPMENT`.
    water
        What they swim in.
    options
        Network side of the nodes.
    clock_offset_s
        How far the vehicles' clocks are ahead of this machine's.
    seed
        Of all randomness.
    targets, ranging
        What moves about in the water, and how well the vehicles' modems range to it.
    """

    def __init__(
        self,
        terrain: Terrain,
        specs: Sequence[VehicleSpec],
        equipment: Equipment | None = None,
        *,
        speed: float = 1.0,
        water: SeaWater = STILL,
        options: DuneOptions | None = None,
        clock_offset_s: float = 0.0,
        seed: int = 0,
        targets: Sequence[TargetSpec] = (),
        ranging: RangingNoise | None = None,
    ) -> None:
        self.terrain = terrain
        self.options = options or DuneOptions()
        self.clock = SimulationClock(speed, start_s=time.time() + clock_offset_s)
        self._simulated_s = self.clock.now()
        rngs = np.random.default_rng(seed).spawn(3 * len(specs))
        self.targets = [Target(spec, terrain, self._simulated_s) for spec in targets]
        self.nodes = [
            FakeDune(
                SimulatedVehicle(
                    spec.name,
                    terrain,
                    spec.start,
                    rngs[2 * k],
                    equipment or EQUIPMENT,
                    heading_rad=spec.heading_rad,
                    current=water.current_mps,
                    water=water.column,
                    start_time_s=self._simulated_s,
                ),
                spec.imc_id,
                spec.port,
                self.clock,
                self.options,
                rngs[2 * k + 1],
                Ranging(self.targets, ranging or RangingNoise(), rngs[2 * len(specs) + k], self._simulated_s)
                if targets
                else None,
            )
            for k, spec in enumerate(specs)
        ]
        self._listener: UdpEndpoint | None = None
        self._task: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Take the sockets and let time run. Raises OSError when ports are taken."""
        try:
            self._listener = await listen_for_announces(
                self.options.bind_address, self.options.announce_ports, self._on_announce
            )
            for node in self.nodes:
                await node.start()
        except OSError:
            await self.stop()
            raise
        self._task = asyncio.create_task(self._run(), name="dune-fleet")

    async def stop(self) -> None:
        """Stop time and release the sockets."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
            self._task = None
        for node in self.nodes:
            node.stop()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    async def wait(self) -> None:
        """Return when the simulation ends, which only an error brings about: it is raised."""
        if self._task is not None:
            await self._task

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.stop()

    def describe(self) -> dict[str, Any]:
        """Names, ids and addresses of the running nodes, for programs that start the simulator."""
        frame = self.terrain.frame
        vehicles = []
        for node in self.nodes:
            here = node.vehicle.true_position
            lat, lon = frame.to_geodetic(here.east_m, here.north_m)
            host, port = node.address
            vehicles.append(
                {
                    "name": node.name,
                    "imc_id": node.imc_id,
                    "host": host,
                    "port": port,
                    "lat": lat,
                    "lon": lon,
                    "depth_m": here.depth_m,
                }
            )
        return {
            "vehicles": vehicles,
            "terrain": {
                "name": self.terrain.name,
                "origin_lat": frame.lat_deg,
                "origin_lon": frame.lon_deg,
                "width_m": self.terrain.width_m,
                "height_m": self.terrain.height_m,
                "min_depth_m": self.terrain.min_depth_m,
                "max_depth_m": self.terrain.max_depth_m,
            },
            "targets": [target.name for target in self.targets],
            "speed": self.clock.speed,
            "announce_ports": list(self.options.announce_ports),
        }

    def _on_announce(self, data: bytes, sender: Address) -> None:
        for node in self.nodes:
            node.on_announce(data, sender)

    async def _run(self) -> None:
        pause_s = max(TICK_S, 0.5 * STEP_S / self.clock.speed)
        while True:
            behind_s = self.clock.now() - self._simulated_s
            most_s = MOST_BEHIND_S * self.clock.speed
            if behind_s > most_s + STEP_S:
                self.clock.give_up(behind_s - most_s)
                behind_s = most_s
            for _ in range(int(behind_s / STEP_S)):
                self._simulated_s += STEP_S
                for node in self.nodes:
                    node.step(self._simulated_s)
            await asyncio.sleep(pause_s)
