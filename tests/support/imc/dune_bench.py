"""A console beside a fake DUNE node, in simulated time, and the messages that consoles send."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import imcpy
import numpy as np

from simulator.clock import SimulationClock
from simulator.dune.node import FakeDune
from simulator.dune.options import DuneOptions
from simulator.equipment import Equipment
from simulator.floors import seafloors
from simulator.floors.terrain import Terrain
from simulator.sonars.swath import SwathSonar
from simulator.vehicles.battery import BatterySpec
from simulator.vehicles.vehicle import STEP_S
from simulator.world import SimulatedVehicle

CONSOLE_ID = 0x3F01
VEHICLE_ID = 0x0101
CONSOLE = ("127.0.0.1", 6101)
HOME = ("127.0.0.1", 6002)
REQUEST = imcpy.PlanControl.TypeEnum.REQUEST


def announce(imc_id: int = CONSOLE_ID, address: tuple[str, int] = CONSOLE, name: str = "ccu-cao") -> imcpy.Message:
    message = imcpy.Announce()
    message.sys_name = name
    message.services = f"imc+udp://{address[0]}:{address[1]}/"
    message.src = imc_id
    return message


def start_request(
    request_id: int = 100,
    plan_id: str = "cao",
    control_src: int = CONSOLE_ID,
    timeout: int = 30,
    data: imcpy.Message | None = None,
) -> imcpy.Message:
    follow = imcpy.FollowReference()
    follow.control_src, follow.control_ent = control_src, 0xFF
    follow.timeout, follow.loiter_radius = timeout, 7.5
    item = imcpy.PlanManeuver()
    item.maneuver_id = "follow"
    item.data = data if data is not None else follow
    plan = imcpy.PlanSpecification()
    plan.plan_id, plan.start_man_id = plan_id, "follow"
    plan.maneuvers.append(item)
    message = imcpy.PlanControl()
    message.type, message.op = REQUEST, imcpy.PlanControl.OperationEnum.START
    message.request_id, message.plan_id = request_id, plan_id
    message.arg = plan
    return message


def stop_request(request_id: int = 101) -> imcpy.Message:
    message = imcpy.PlanControl()
    message.type, message.op = REQUEST, imcpy.PlanControl.OperationEnum.STOP
    message.request_id = request_id
    return message


def reference(
    lat_deg: float,
    lon_deg: float,
    depth: float = 3.0,
    *,
    flags: int = 0x27,
    speed: float = 1.2,
    radius: float = 0.0,
    units: imcpy.Message = imcpy.ZUnits.DEPTH,
) -> imcpy.Message:
    message = imcpy.Reference()
    message.flags = flags
    message.lat, message.lon = math.radians(lat_deg), math.radians(lon_deg)
    message.speed = imcpy.DesiredSpeed()
    message.speed.value = speed
    message.z = imcpy.DesiredZ()
    message.z.value, message.z.z_units = depth, units
    message.radius = radius
    return message


def done() -> imcpy.Message:
    message = imcpy.Reference()
    message.flags = 0x80
    return message


def rate_limiters(text: str) -> imcpy.Message:
    message = imcpy.SetEntityParameters()
    message.name = "UDP"
    parameter = imcpy.EntityParameter()
    parameter.name, parameter.value = "Rate Limiters", text
    message.params.append(parameter)
    return message


@dataclass
class Wire:
    """An endpoint in memory that keeps what a node sends."""

    address: tuple[str, int]
    sent: list[Any] = field(default_factory=list)

    def send(self, data: bytes, to: tuple[str, int]) -> None:
        self.sent.append((imcpy.Packet.deserialize(data), to))

    def close(self) -> None:
        pass


class Bench:
    """A node with a console beside it; time passes only when told to."""

    def __init__(
        self,
        terrain: Terrain | None = None,
        sensor: str = "single",
        start: tuple[float, float, float] = (50.0, 20.0, 0.0),
        imc_id: int = VEHICLE_ID,
        battery: BatterySpec | None = None,
        current: tuple[float, float] = (0.0, 0.0),
        swath: SwathSonar | None = None,
        **options: Any,
    ) -> None:
        self.wall_s = 0.0
        self.clock = SimulationClock(start_s=1_000_000.0, monotonic=lambda: self.wall_s)
        terrain = terrain or seafloors.generate("flat", 3, width_m=200, height_m=200)
        self.vehicle = SimulatedVehicle(
            "lauv-sim-1",
            terrain,
            start,
            np.random.default_rng(0),
            Equipment(sensor=sensor, ping_period_s=0.1, battery=battery, swath=swath or SwathSonar()),
            start_time_s=self.clock.now(),
            current=current,
        )
        self.node = FakeDune(
            self.vehicle, imc_id, HOME[1], self.clock, DuneOptions(**options), np.random.default_rng(0)
        )
        self.wire, self.announced = Wire(HOME), Wire(("127.0.0.1", 40000))
        self.node.attach(self.wire, self.announced)
        self._steps = 0

    @property
    def now_s(self) -> Any:
        return self.wall_s

    def run(self, seconds: float, every_second: Callable[..., Any] | None = None) -> None:
        """Let time pass; ``every_second`` is called at each full second."""
        for _ in range(round(seconds / STEP_S)):
            self._steps += 1
            self.wall_s = self._steps * STEP_S
            self.node.step(self.clock.start_s + self.wall_s)
            if every_second is not None and self._steps % round(1 / STEP_S) == 0:
                every_second()

    def say(
        self,
        message: imcpy.Message,
        *,
        src: int = CONSOLE_ID,
        dst: int | None = None,
        address: tuple[str, int] = CONSOLE,
    ) -> None:
        message.src, message.src_ent = src, 0
        message.dst = self.node.imc_id if dst is None else dst
        message.timestamp = self.clock.now()
        self.node.receive(message.serialize(), address)

    def introduce(self, imc_id: int = CONSOLE_ID, address: tuple[str, int] = CONSOLE) -> None:
        self.node.on_announce(announce(imc_id, address).serialize(), ("127.0.0.1", 55555))
        self.say(imcpy.Heartbeat(), src=imc_id, address=address)

    def beat(self) -> None:
        self.say(imcpy.Heartbeat())

    def ready(self) -> "Bench":
        """Introduce the console and wait until the vehicle is in service and talks."""
        self.introduce()
        self.run(6.0, self.beat)
        self.wire.sent.clear()
        return self

    def follow(self, east: float, north: float, depth: float = 3.0, **kwargs: Any) -> None:
        lat, lon = self.vehicle.terrain.frame.to_geodetic(east, north)
        self.say(reference(lat, lon, depth, **kwargs))

    def all(self, kind: type[Any]) -> list[imcpy.Message]:
        return [m for m, _ in self.wire.sent if isinstance(m, kind) and m.src == self.node.imc_id]

    def last(self, kind: type[Any]) -> imcpy.Message:
        return self.all(kind)[-1]

    def states(self) -> tuple[int, int]:
        """op_mode and plan state now."""
        return (int(self.node.plan.op_mode), int(self.node.plan.plan_state))
