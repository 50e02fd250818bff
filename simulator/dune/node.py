"""One fake DUNE node: announces itself, sends telemetry, takes commands, over real UDP."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass

import imcpy
import numpy as np

from simulator.clock import SimulationClock
from simulator.dune.chatter import Chatter
from simulator.dune.entities import ANY, SIMULATION, SUPERVISORS, entity_list, equipment_of
from simulator.dune.log_book import LogBook
from simulator.dune.lost_comms import ENTITY as LOST_COMMS
from simulator.dune.lost_comms import PERIOD_S as LOST_COMMS_PERIOD_S
from simulator.dune.lost_comms import LostComms
from simulator.dune.options import DuneOptions
from simulator.dune.plan import PLAN_ENGINE, SUPERVISOR, PlanEngine
from simulator.dune.plan_database import PLAN_DATABASE, PlanDatabase
from simulator.dune.telemetry import Telemetry
from simulator.dune.transport.contacts import REFRESH_PERIOD_S, Contacts
from simulator.dune.transport.header import read_header
from simulator.dune.transport.radio import Radio
from simulator.dune.transport.rates import DEFAULT_LIMITS_HZ, Periodic, RateLimiter, RateLimiterError, parse_limits
from simulator.dune.transport.tcp import FIRST_PORT, TcpServer
from simulator.network import Address, Endpoint, UdpEndpoint
from simulator.sonars.frames import to_local_frame
from simulator.sonars.sensors import SensorKind, cast_rays
from simulator.targets import Ranging
from simulator.vehicles.navigation import SURFACE_DEPTH_M
from simulator.vehicles.vehicle import STEP_S
from simulator.world import PROBE_PERIOD_S, SimulatedVehicle

log = logging.getLogger(__name__)
PORT_TRIES = 5
"""DUNE takes the first free one of this many ports."""
TCP_PORT_TRIES = 50
"""As many nodes may share this host."""
ANNOUNCE_PERIOD_S = 10.0
LEAK_SENSOR, FAULTY = "Leak Sensor - Nose", "Motor"
STREAM_PERIOD_S = 10.0
"""Between two estimates of the current at the surface."""
STILL_WATER = (0.0, 0.0)
RESTART_S = 5.0
"""How long DUNE is away when it crashes."""
UDP_ENTITY = "UDP"
RATE_LIMITERS = "Rate Limiters"
FORWARD_RANGE_M = 30.0
RATE_TEXT = ", ".join(f"{name}:{rate:g}" for name, rate in DEFAULT_LIMITS_HZ.items())
Handler = Callable[[imcpy.Message, float], None]
_BROADCAST = 0xFFFF
_ANNOUNCE = imcpy.Announce().msg_id
_HEARTBEAT = imcpy.Heartbeat().msg_id
_PLAN_CONTROL = imcpy.PlanControl().msg_id
_ENTITY_LIST = imcpy.EntityList().msg_id
_TRANSPORTED = frozenset({_HEARTBEAT, _PLAN_CONTROL, _ENTITY_LIST})
"""Received messages that are passed on to every active system, the sender included."""


@dataclass(slots=True)
class NodeCounts:
    """What a node did with its received packets."""

    accepted: int = 0
    malformed: int = 0
    strangers: int = 0
    """Packets of systems that never announced the address they came from."""


class FakeDune:
    """One vehicle's DUNE, as a consumer sees it.

    Parameters
    ----------
    vehicle
        The vehicle on board of which it runs.
    imc_id
        Its IMC address.
    port
        First choice of the imc+udp port; the next four are tried when it is taken.
    clock
        Vehicle time.
    options
        Shared settings.
    rng
        Source of the network's faults.
    ranging
        Its acoustic modem, where there are targets to range to.
    """

    def __init__(
        self,
        vehicle: SimulatedVehicle,
        imc_id: int,
        port: int,
        clock: SimulationClock,
        options: DuneOptions,
        rng: np.random.Generator,
        ranging: Ranging | None = None,
    ) -> None:
        if not 0 < imc_id < _BROADCAST:
            raise ValueError(f"{vehicle.name}: IMC id is {imc_id:#x}; it must be 0x0001 to 0xfffe")
        self.vehicle = vehicle
        self.imc_id = imc_id
        self.counts = NodeCounts()
        self.contacts = Contacts()
        self.limiter = RateLimiter(DEFAULT_LIMITS_HZ)
        self.database = PlanDatabase()
        self.first_port = port
        self._clock = clock
        self._options = options
        self.plan, self.lost_comms = self._booted(clock.now() + options.boot_s)
        self._rng = rng
        self._ranging = ranging
        self._extra = equipment_of(vehicle) | ({} if self.lost_comms is None else SUPERVISORS)
        self._entities = SIMULATION | self._extra
        self._radio = Radio(options.radio_range_m)
        self._tcp = TcpServer(self._receive_by_tcp) if options.tcp else None
        self._log: LogBook | None = None
        self._endpoint: Endpoint | None = None
        self._announcer: Endpoint | None = None
        self._telemetry: Telemetry | None = None
        self._now_s = clock.now()
        self._announce = Periodic(ANNOUNCE_PERIOD_S, self._now_s)
        self._refresh = Periodic(REFRESH_PERIOD_S, self._now_s + REFRESH_PERIOD_S)
        self._supervise = Periodic(LOST_COMMS_PERIOD_S, self._now_s)
        self._leak: imcpy.EntityState.StateEnum | None = None
        self._chatter = Chatter(self._entities) if options.chatter else None
        self._offered = ""
        self._down_until_s: float | None = None
        self._rate_text = RATE_TEXT
        self._schedule: list[tuple[Periodic, Callable[[], None]]] = []
        self._handlers: dict[int, Handler] = {
            _HEARTBEAT: self._on_heartbeat,
            _PLAN_CONTROL: self._on_plan_control,
            _ENTITY_LIST: self._on_entity_list,
            imcpy.Reference().msg_id: self._on_reference,
            imcpy.Abort().msg_id: self._on_abort,
            imcpy.PlanDB().msg_id: self._on_plan_database,
            imcpy.SetEntityParameters().msg_id: self._on_set_parameters,
            imcpy.QueryEntityParameters().msg_id: self._on_query_parameters,
        }

    @property
    def name(self) -> str:
        """The vehicle's name."""
        return self.vehicle.name

    @property
    def address(self) -> Address:
        """Where the node listens."""
        if self._endpoint is None:
            raise RuntimeError(f"{self.name}: the node is not started")
        return self._endpoint.address

    async def start(self) -> None:
        """Take the sockets and begin to announce. Raises OSError when none of the ports is free."""
        host = self._options.bind_address
        endpoint = None
        for port in range(self.first_port, self.first_port + PORT_TRIES):
            try:
                endpoint = await UdpEndpoint.open(
                    (host, port), self.receive, faults=self._options.faults, rng=self._rng
                )
                break
            except OSError as error:
                log.warning("%s: failed to bind to port %d: %s", self.name, port, error)
        if endpoint is None:
            last = self.first_port + PORT_TRIES - 1
            raise OSError(f"{self.name}: none of the ports {self.first_port} to {last} is free on {host}")
        announcer = await UdpEndpoint.open(
            (host, 0),
            lambda data, address: None,
            faults=self._options.faults,
            rng=self._rng,
            broadcast=True,
        )
        offered = ""
        if self._tcp is not None:
            address = await self._tcp.open(host, FIRST_PORT, TCP_PORT_TRIES)
            offered = f"imc+tcp://{address[0]}:{address[1]}/"
        self.attach(endpoint, announcer, offered)

    def attach(self, endpoint: Endpoint, announcer: Endpoint, offered: str = "") -> None:
        """Use these sockets, which :meth:`start` opens: for telemetry and commands, and for announces."""
        self._endpoint, self._announcer, self._offered = endpoint, announcer, offered
        self._begin()

    def _begin(self) -> None:
        """Start again as DUNE does; every start has a uid of its own."""
        host, port = self.address
        offered = self._offered
        services = (
            f"dune://0.0.0.0/uid/{round(1000.0 * self._now_s)};dune://0.0.0.0/version/2026.01.0;"
            f"imc+info://0.0.0.0/version/{self._options.imc_version};imc+udp://{host}:{port}/"
            + (f";{offered}" if offered else "")
        )
        self._telemetry = Telemetry(self.vehicle, self.vehicle.terrain.frame, self.name, services)
        self._schedule = self._periodic_messages(self._telemetry)
        if self._options.log_dir is not None:
            self._log = LogBook(self._options.log_dir / self.name, self._now_s)
            self._report_entities()

    def fail(self, what: str) -> None:
        """Let something break: a leak ("leak"), what puts the vehicle in error ("error"), or its "navigation"."""
        if what == "error":
            self.plan.break_down(FAULTY, "motor current too high", self._now_s)
        elif what == "leak":
            self._leak = imcpy.EntityState.StateEnum.FAILURE
        elif what == "navigation" and self._telemetry is not None:
            self._telemetry.navigation_failed = True
        else:
            raise ValueError(f"cannot let {what!r} fail; it must be leak, error or navigation")

    def mend(self) -> None:
        """Repair everything."""
        self.plan.mend()
        if self._telemetry is not None:
            self._telemetry.navigation_failed = False
        if self._leak is not None:
            self._leak = imcpy.EntityState.StateEnum.NORMAL

    def crash(self, down_s: float = RESTART_S) -> None:
        """Let DUNE die, and start again ``down_s`` of vehicle time later: whatever it did or knew is forgotten.

        The vehicle floats up meanwhile, without a controller.
        """
        self._down_until_s = self._now_s + down_s
        self.vehicle.stop()
        self.contacts = Contacts()
        self.limiter = RateLimiter(DEFAULT_LIMITS_HZ)
        self._rate_text = RATE_TEXT
        self._radio.forget()
        ready_s = self._down_until_s + self._options.boot_s
        self.plan, self.lost_comms = self._booted(ready_s)

    def _booted(self, ready_s: float) -> tuple[PlanEngine, LostComms | None]:
        """Return what remembers nothing of an earlier start."""
        options, frame = self._options, self.vehicle.terrain.frame
        plan = PlanEngine(self.vehicle, self.imc_id, frame, self.send, ready_s, self.database.plans)
        return plan, LostComms(options.lost_comms_s, options.lost_comms_plan) if options.lost_comms_s > 0.0 else None

    def _start_again(self) -> None:
        self._down_until_s = None
        self._announce = Periodic(ANNOUNCE_PERIOD_S, self._now_s)
        self._refresh = Periodic(REFRESH_PERIOD_S, self._now_s + REFRESH_PERIOD_S)
        if self._log is not None:
            self._log.close()
        self._begin()

    def stop(self) -> None:
        """Release the sockets."""
        for endpoint in (self._endpoint, self._announcer):
            if endpoint is not None:
                endpoint.close()
        self._endpoint = self._announcer = None
        if self._log is not None:
            self._log.close()
        if self._tcp is not None:
            self._tcp.close()

    def send(
        self,
        message: imcpy.Message,
        entity: int,
        dst: int = _BROADCAST,
        dst_ent: int = ANY,
        src: int | None = None,
        *,
        by_radio: bool = True,
    ) -> None:
        """Send a message of this node to every active system, and note it in the log; or only that."""
        if not self._has_listeners and self._log is None:
            return
        message.timestamp = self._now_s
        message.src = self.imc_id if src is None else src
        message.src_ent = entity
        message.dst = dst
        message.dst_ent = dst_ent
        data = bytes(message.serialize())
        if self._log is not None:
            self._log.write(data)
        if by_radio:
            self._put(data, message.msg_id)

    @property
    def _has_listeners(self) -> bool:
        return bool(self.contacts.destinations or self._options.static_destinations) or (
            self._tcp is not None and self._tcp.connected
        )

    def _put(self, data: bytes, message_id: int) -> None:
        """Send a packet to every active system within reach."""
        if self._endpoint is not None:
            for imc_id, destination in self.contacts.destinations:
                if self._radio.reaches(imc_id, message_id):
                    self._endpoint.send(data, destination)
            for destination in self._options.static_destinations:
                self._endpoint.send(data, destination)
        if self._tcp is not None:
            self._tcp.send(data)

    def on_announce(self, data: bytes, sender: Address) -> None:
        """Learn a system from a packet on an announce port."""
        if self._down_until_s is not None:
            return
        message = self._decode(data)
        if isinstance(message, imcpy.Announce) and message.src != self.imc_id:
            self.contacts.announced(message.src, message.sys_name, message.services)
            self._radio.announced(message.src, message.lat, message.lon)

    def step(self, now_s: float) -> None:
        """Advance by one step of vehicle time, to ``now_s``, and send what is due."""
        self._now_s = now_s
        ping = self.vehicle.step()
        if self._down_until_s is not None:
            if now_s < self._down_until_s:
                return
            self._start_again()
        self.plan.tick(now_s)
        if self.lost_comms is not None and self._supervise.due(now_s):
            self._look_for_consoles(self.lost_comms, now_s)
        here = self.vehicle.position
        lat, lon = self.vehicle.terrain.frame.to_geodetic(here.east_m, here.north_m)
        self._radio.moved(math.radians(lat), math.radians(lon), here.depth_m, now_s)
        if self._announce.due(now_s):
            self._send_announce()
        if self._refresh.due(now_s):
            for contact, active in self.contacts.refresh(now_s):
                doing = "activating" if active else "deactivating"
                self._log_book(f"{doing} transmission to node '{contact.name}'")
        if not self._has_listeners and self._log is None:
            return
        for periodic, emit in self._schedule:
            if periodic.due(now_s):
                emit()
        if ping:
            self._send_ranges()
        if self._ranging is not None and self._telemetry is not None:
            for system, range_m in self._ranging.step(now_s, self.vehicle.true_position):
                self.send(self._telemetry.acoustic_range(system, range_m), self._entities["Acoustic Modem"])
        if self._chatter is not None:
            self._chatter.step(self.vehicle.vehicle.motion, self._send_limited)

    def _periodic_messages(self, t: Telemetry) -> list[tuple[Periodic, Callable[[], None]]]:
        ids, now_s = self._entities, self._now_s

        def limited(name: str, entity: int, build: Callable[[], imcpy.Message]) -> Callable[[], None]:
            def emit() -> None:
                # Rates are limited for radio's sake: the log takes every message.
                by_radio = self.limiter.passes(name, entity, self._now_s)
                if by_radio or self._log is not None:
                    self.send(build(), entity, by_radio=by_radio)

            return emit

        def plain(entity: int, build: Callable[[], imcpy.Message]) -> Callable[[], None]:
            return lambda: self.send(build(), entity)

        battery = self.vehicle.battery
        further: list[tuple[Periodic, Callable[[], None]]] = []
        if battery is not None:
            fuel = limited("FuelLevel", ids["Fuel"], lambda: t.fuel_level(battery))
            further.append((Periodic(1.0, now_s), fuel))
        if self.vehicle.vehicle.current != STILL_WATER:
            further.append((Periodic(STREAM_PERIOD_S, now_s), self._send_stream_velocity))
        if self.vehicle.water is not None:
            further.append((Periodic(PROBE_PERIOD_S, now_s), limited("SoundSpeed", ids["CTD"], t.sound_speed)))
        return [
            *further,
            (Periodic(STEP_S, now_s), limited("EstimatedState", ids["Navigation"], t.estimated_state)),
            (Periodic(STEP_S, now_s), limited("SimulatedState", ids["Simulation Engine"], t.simulated_state)),
            (Periodic(1.0, now_s), plain(0, imcpy.Heartbeat)),
            (Periodic(1.0 / 3.0, now_s), plain(PLAN_ENGINE, self.plan.plan_control_state)),
            (Periodic(1.0, now_s), self._send_leak),
            (Periodic(0.5, now_s), plain(SUPERVISOR, self.plan.vehicle_state)),
            (Periodic(1.0, now_s), plain(ids["GPS"], t.gps_fix)),
            (Periodic(1.0, now_s), plain(ids["Medium"], t.medium)),
            (Periodic(1.0, now_s), plain(ids["Navigation"], t.navigation_uncertainty)),
        ]

    def _send_leak(self) -> None:
        """The state of a leak sensor, once it has told of water: DUNE has all entities report every second."""
        if self._leak is not None:
            state = imcpy.EntityState()
            state.state = self._leak
            dry = self._leak == imcpy.EntityState.StateEnum.NORMAL
            state.description = "active" if dry else "leak detected"
            self._send_limited(state, self._entities[LEAK_SENSOR])

    def _send_stream_velocity(self) -> None:
        """As DUNE's navigation does, which compares where it drifted, or came up, with its position fixes."""
        if self._telemetry is not None and self.vehicle.navigation.has_fix:
            self.send(self._telemetry.stream_velocity(), self._entities["Navigation"])

    def _send_announce(self) -> None:
        if self._announcer is None or self._telemetry is None:
            return
        message = self._telemetry.announce()
        message.timestamp = self._now_s
        message.src = self.imc_id
        message.src_ent = SIMULATION["Service Announcer"]
        message.dst = 0
        message.dst_ent = ANY
        data = bytes(message.serialize())
        if self._log is not None:
            self._log.write(data)
        for host in self._options.announce_addresses:
            for port in self._options.announce_ports:
                self._announcer.send(data, (host, port))

    def _send_ranges(self) -> None:
        t = self._telemetry
        if t is None:
            return
        vehicle, now_s, passes, logged = self.vehicle, self._now_s, self.limiter.passes, self._log is not None
        if vehicle.sonar.kind is SensorKind.MULTIBEAM:
            entity = self._entities["Multibeam"]
            by_radio = passes("SonarData", entity, now_s)
            if by_radio or logged:
                self.send(t.sonar_data(vehicle.measure_swath(), vehicle.sonar.max_range_m), entity, by_radio=by_radio)
        else:
            entities = (
                [self._entities[f"DVL Beam {k}"] for k in range(4)]
                if vehicle.sonar.kind is SensorKind.DVL
                else [self._entities["Altimeter"]]
            )
            passed = [passes("Distance", entity, now_s) for entity in entities]
            if logged or any(passed):
                for entity, send, measurement in zip(entities, passed, vehicle.measure(), strict=True):
                    if send or logged:
                        self.send(t.distance(measurement), entity, by_radio=send)
        forward = self._entities["Echo Sounder"]
        if passes("Distance", forward, now_s):
            self.send(t.forward_distance(self._forward_range_m()), forward)

    def _forward_range_m(self) -> float:
        m = self.vehicle.vehicle.motion
        bow = to_local_frame(np.array([[1.0, 0.0, 0.0]]), m.heading_rad, m.pitch_rad, m.roll_rad)
        found = cast_rays(self.vehicle.terrain, m.east_m, m.north_m, m.depth_m, bow, FORWARD_RANGE_M)[0]
        return float(found) if math.isfinite(found) else FORWARD_RANGE_M

    def _send_limited(self, message: imcpy.Message, entity: int) -> None:
        if self.limiter.passes(message.msg_name, entity, self._now_s):
            self.send(message, entity)

    def receive(self, data: bytes, sender: Address) -> None:
        """Take a packet from the network."""
        if self._down_until_s is not None:
            return
        header = read_header(data)
        if header is None:
            self.counts.malformed += 1
            return
        message_id, source = header
        handler = self._handlers.get(message_id)
        if message_id == _ANNOUNCE:
            self.on_announce(data, sender)
            return
        # Commands may come between two steps of the simulation.
        now_s = max(self._now_s, self._clock.now())
        if not self._radio.reaches(source, message_id):
            return
        if self.contacts.heard(source, sender, now_s) is None:
            self.counts.strangers += 1
            return
        self._obey(data, message_id, handler, now_s)

    def _receive_by_tcp(self, data: bytes, sender: Address) -> None:
        header = read_header(data)
        if header is None:
            self.counts.malformed += 1
            return
        self._obey(data, header[0], self._handlers.get(header[0]), max(self._now_s, self._clock.now()))

    def _obey(self, data: bytes, message_id: int, handler: Handler | None, now_s: float) -> None:
        if handler is None:
            return
        message = self._decode(data)
        if message is None:
            return
        self.counts.accepted += 1
        self._now_s = now_s
        if message_id in _TRANSPORTED:
            self._put(data, message_id)
        handler(message, now_s)

    def _decode(self, data: bytes) -> imcpy.Message | None:
        try:
            return imcpy.Packet.deserialize(data)
        except (RuntimeError, ValueError) as error:
            self.counts.malformed += 1
            log.debug("%s: packet not understood: %s", self.name, error)
            return None

    def _on_plan_control(self, message: imcpy.Message, now_s: float) -> None:
        if isinstance(message, imcpy.PlanControl) and message.dst == self.imc_id:
            self.plan.on_plan_control(message, now_s)
            note = self.database.note_started(message, now_s)
            if note is not None:
                self.send(note, PLAN_DATABASE)

    def _look_for_consoles(self, supervisor: LostComms, now_s: float) -> None:
        submerged = self.vehicle.vehicle.motion.depth_m > SURFACE_DEPTH_M
        request = supervisor.tick(self.plan, submerged=submerged, now_s=now_s)
        if request is not None:
            self.send(request, self._entities[LOST_COMMS], self.imc_id)
            self.plan.on_plan_control(request, now_s)

    def _on_heartbeat(self, message: imcpy.Message, now_s: float) -> None:
        if self.lost_comms is not None:
            self.lost_comms.heard(int(message.src), now_s)

    def _on_plan_database(self, message: imcpy.Message, now_s: float) -> None:
        if not isinstance(message, imcpy.PlanDB) or message.dst != self.imc_id:
            return
        if self.lost_comms is not None:
            self.lost_comms.stored(message)
        for reply in self.database.answer(message, now_s):
            self.send(reply, PLAN_DATABASE, message.src, message.src_ent)

    def _on_reference(self, message: imcpy.Message, now_s: float) -> None:
        if isinstance(message, imcpy.Reference) and message.dst == self.imc_id:
            self.plan.on_reference(message, now_s)

    def _on_abort(self, message: imcpy.Message, now_s: float) -> None:
        if message.dst == self.imc_id:
            if self.lost_comms is not None:
                self.lost_comms.aborted()
            who = f"{self.contacts.name_of(message.src)} - 0x{message.src:04X}"
            self.plan.on_abort(f"{who} @ 0x{message.src_ent:02X}", now_s)

    def _on_entity_list(self, message: imcpy.Message, now_s: float) -> None:
        if not isinstance(message, imcpy.EntityList) or message.dst not in (self.imc_id, _BROADCAST):
            return
        if message.op == imcpy.EntityList.OperationEnum.QUERY:
            self._report_entities(int(message.src))

    def _report_entities(self, to: int = _BROADCAST) -> None:
        report = imcpy.EntityList()
        report.op = imcpy.EntityList.OperationEnum.REPORT
        report.list = entity_list(self._extra)
        self.send(report, 0, to)

    def _on_set_parameters(self, message: imcpy.Message, now_s: float) -> None:
        if not isinstance(message, imcpy.SetEntityParameters) or message.dst != self.imc_id:
            return
        if message.name != UDP_ENTITY:
            return
        for parameter in message.params:
            if parameter.name != RATE_LIMITERS:
                continue
            try:
                limits = parse_limits(parameter.value)
            except RateLimiterError as error:
                self._log_book(str(error))
                continue
            # What the new list leaves out is not limited any more.
            self.limiter = RateLimiter(limits)
            self._rate_text = parameter.value

    def _on_query_parameters(self, message: imcpy.Message, now_s: float) -> None:
        if not isinstance(message, imcpy.QueryEntityParameters) or message.dst != self.imc_id:
            return
        values = {}
        if message.name == UDP_ENTITY:
            values = {RATE_LIMITERS: self._rate_text}
        elif message.name == LOST_COMMS and self.lost_comms is not None:
            values = self.lost_comms.parameters()
        if not values:
            return
        reply = imcpy.EntityParameters()
        reply.name = message.name
        for name, value in values.items():
            parameter = imcpy.EntityParameter()
            parameter.name, parameter.value = name, value
            reply.params.append(parameter)
        self.send(reply, self._entities[message.name], message.src)

    def _log_book(self, text: str) -> None:
        log.info("%s: %s", self.name, text)
        entry = imcpy.LogBookEntry()
        entry.htime = self._now_s
        entry.context = "Transports.UDP"
        entry.text = text
        self.send(entry, self._entities[UDP_ENTITY])
