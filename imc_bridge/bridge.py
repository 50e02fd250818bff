"""The console: sockets, nodes and followers put together behind one small class."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator

import imcpy

from imc_bridge.acoustics import SoundPath
from imc_bridge.codec import BROADCAST_ID, Decoder, Header, Message, encode
from imc_bridge.consoles import Board
from imc_bridge.control import Control, Phase
from imc_bridge.discovery import Announcement, own_announce, read_announce
from imc_bridge.events import (
    BridgeEvent,
    EventCallback,
    Guidance,
    LinkChange,
    NodeState,
    NodeView,
    RefusedError,
    Sounding,
    StopResult,
    Waypoint,
)
from imc_bridge.follow import Follower
from imc_bridge.legs import LegFollower
from imc_bridge.nodes import Node
from imc_bridge.rates import RateRequest
from imc_bridge.roster import Roster
from imc_bridge.seabed import Seabed
from imc_bridge.settings import BridgeSettings
from imc_bridge.soundings import offer_distance
from imc_bridge.transport import Address, Transport
from imc_bridge.vehicle_clock import Tick

log = logging.getLogger(__name__)

WANTED = (
    "Abort",
    "Distance",
    "EntityList",
    "EntityParameters",
    "EstimatedState",
    "FollowRefState",
    "FuelLevel",
    "Heartbeat",
    "NavigationUncertainty",
    "PlanControl",
    "PlanControlState",
    "TransmissionStatus",
    "VehicleMedium",
    "VehicleState",
)
SIMULATED_STATE = int(imcpy.SimulatedState().msg_id)
TICK_S = 0.2
MIN_TICK_WALL_S = 0.02
ENTITY_QUERY_S = 2.0
ANNOUNCE_AGAIN_S = 1.0
LINK_HISTORY = 32
"""Changes of a link that are kept, with their times and reasons."""
STOP_ESCALATION = 0.5
"""Share of a stop's patience after which Abort is sent too."""
CLOSE_TIMEOUT_WALL_S = 3.0
HELD_UP_WALL_S = 0.4
"""A tick that is later than this shows that we were held up ourselves."""
WORTH_TELLING_WALL_S = 2.0
MAX_PLAUSIBLE_VEHICLE_TIME_S = 4e9


def entity_query() -> Message:
    """The question for the names of a node's entities."""
    query = imcpy.EntityList()
    query.op = imcpy.EntityList.OperationEnum.QUERY
    return query


class Bridge:
    """A console on the IMC network that can make vehicles follow waypoints.

    Parameters
    ----------
    settings
    commanding
        False for a listener that announces itself and sends heartbeats but never commands a vehicle.
    clock
        Seconds of the wall clock that never step back; a replay gives the recording's.
    wall_clock
        Unix seconds, for our messages' times and by which the vehicles' clocks are judged.

    Examples
    --------
    >>> bridge = Bridge(BridgeSettings(loopback_only=True))          # doctest: +SKIP
    >>> await bridge.start(print)                                    # doctest: +SKIP
    >>> await bridge.engage("lauv-xplore-1")                         # doctest: +SKIP
    >>> bridge.goto("lauv-xplore-1", Waypoint("m1", 0, 41.1852, -8.7062, 3.0))   # doctest: +SKIP
    """

    def __init__(
        self,
        settings: BridgeSettings,
        *,
        commanding: bool = True,
        clock: Callable[[], float] = time.monotonic,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        self.settings = settings
        self.decoder = Decoder(WANTED)
        self.announces = Decoder(("Announce",))
        self.transport = Transport(settings, self.on_packet, self.on_announce)
        self.handler_errors: Counter[str] = Counter()
        self.double = ""
        """Who else announces our own id, empty when nobody does."""
        self._commanding = commanding
        self._clock = clock
        self._wall_clock = wall_clock
        self._on_event: EventCallback = lambda _event: None
        self._roster = Roster(settings)
        self._seabed = Seabed()
        self.board = Board(settings.name)
        """What other consoles are shown."""
        self._followers: dict[int, Control] = {}
        self._guidance: dict[int, Guidance] = {}
        self._rates: dict[int, RateRequest] = {}
        self._links: dict[int, deque[LinkChange]] = {}
        self._state_reported: dict[int, float] = {}
        self._entities_asked: dict[int, float] = {}
        self._task: asyncio.Task[None] | None = None
        self._started_at: float | None = None
        self._turn = asyncio.Event()
        self._announce_due = 0.0
        self._announced_at = float("-inf")
        self._heartbeat_due = 0.0
        self._tick_wall_s = max(TICK_S / settings.time_scale, MIN_TICK_WALL_S)
        # Replies to an earlier run's requests must not be taken for replies to ours.
        self._request_ids = itertools.count(int(time.time() * 10.0))

    # Life

    def listen(self, on_event: EventCallback) -> None:
        """Send events to ``on_event`` without opening sockets, as a replay does."""
        self._on_event = on_event

    async def start(self, on_event: EventCallback) -> None:
        """Bind the ports, announce and listen; events go to ``on_event`` from the event loop's thread.

        Raises
        ------
        imc_bridge.transport.PortInUseError
            When a port belongs to another program.
        ValueError
            When a configured interface is absent.
        """
        if self._task is not None:
            raise RuntimeError("this bridge has been started already")
        self._on_event = on_event
        self.transport.open()
        self._started_at = self._clock()
        if self.settings.position_deg is None:
            # The first vehicle heard tells where we are and is answered at once; see own_announce.
            self._announce_due = self._now() + self.settings.announce_period_s
        self._task = asyncio.create_task(self._run(), name="imc-bridge")

    @property
    def listening_s(self) -> float:
        """For how long it has been started, seconds of the wall clock."""
        return 0.0 if self._started_at is None else self._clock() - self._started_at

    async def close(self) -> None:
        """Stop every engaged vehicle, restore rates, release the ports; safe to repeat."""
        if self._task is None:
            return
        busy = [
            node.name for node, follower in self._controlled() if follower.engaged or follower.phase is Phase.STOPPING
        ]
        await asyncio.gather(*(self.stop(name, timeout_s=CLOSE_TIMEOUT_WALL_S) for name in busy))
        for rates in self._rates.values():
            rates.restore_now()
        self._task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self._task
        self._task = None
        await self.transport.close_streams()
        self.transport.close()

    async def __aenter__(self) -> Bridge:
        await self.start(self._on_event)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    # What the user asks

    def nodes(self) -> tuple[NodeView, ...]:
        """Every node heard of, by id."""
        now = self._now()
        return tuple(self._view(node, now) for node in self._roster)

    async def engage(self, vehicle: str, guidance: Guidance = Guidance.FOLLOW, gateway: str = "") -> None:
        """Make the vehicle ours: with references it then holds its place at the surface, with legs it floats.

        Parameters
        ----------
        vehicle
        guidance
        gateway
            Name of the node with the modem, for guidance ``acoustic``.

        Raises
        ------
        RefusedError
            When the vehicle is unknown, silent, busy with another console's plan, or refuses.
        """
        if not self._commanding:
            raise RefusedError(vehicle, "this bridge only listens", "Use one that may command")
        node = self._roster.named(vehicle)
        if node is None:
            known = ", ".join(n.name for n in self._roster if n.is_vehicle) or "none"
            raise RefusedError(vehicle, f"never heard of (known: {known})", "Switch it on; see `bathyfleet doctor`")
        self._guide(node, guidance)
        follower = self._follower(node)
        if guidance is Guidance.ACOUSTIC:
            self._attach_sound(node, follower, gateway)
        if not follower.engaged and follower.engage(self._now()):
            self._rate_request(node).begin()
        while follower.engaged and follower.phase is not Phase.FOLLOWING:
            await self._turn.wait()
        if not follower.engaged:
            refusal = follower.refusal
            reason = refusal.reason if refusal else "stopped while it was being engaged"
            raise RefusedError(vehicle, reason, refusal.remedy if refusal else "Engage it again")

    def intervention(self, vehicle: str) -> str:
        """Return why a vehicle left us of its own or another console's will, until :meth:`stop` is called; else ''."""
        node = self._roster.named(vehicle)
        return self._follower(node).intervention if node is not None and self._commanding else ""

    def goto(self, vehicle: str, waypoint: Waypoint) -> None:
        """Replace the vehicle's waypoint; what becomes of it is told by events.

        Raises
        ------
        RefusedError
            When the vehicle is not engaged.
        """
        node = self._roster.named(vehicle)
        follower = self._followers.get(node.imc_id) if node is not None else None
        if follower is None or not follower.engaged:
            refusal = follower.refusal if follower is not None else None
            raise RefusedError(
                vehicle,
                f"not engaged: {refusal.reason}" if refusal else "not engaged",
                refusal.remedy if refusal else "Engage it first",
            )
        follower.order(waypoint, self._now())

    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopResult:
        """Make the vehicle stop following; wait at most ``timeout_s`` (wall clock) for its acknowledgement.

        A plan of another console is left alone. Half-way through the patience Abort is sent as well. When nothing is
        acknowledged the references have ceased all the same, which ends the plan on board within seconds, and STOP
        goes on being sent whenever the vehicle shows up in our plan.
        """
        node = self._roster.named(vehicle)
        if node is None:
            return StopResult(vehicle, False, "never heard of")
        if not self._commanding:
            return StopResult(vehicle, False, "this bridge only listens")
        follower = self._follower(node)
        follower.begin_stop(self._now())
        begun = self._clock()
        while follower.phase is Phase.STOPPING:
            waited = self._clock() - begun
            if waited >= timeout_s:
                follower.give_up_stop(self._now())
                reason = node.status(self._now()).reason
                return StopResult(
                    vehicle,
                    False,
                    f"no acknowledgement within {timeout_s:g} s{f' ({reason})' if reason else ''}; "
                    f"{follower.unheard_stop}",
                )
            if waited >= STOP_ESCALATION * timeout_s:
                follower.escalate_stop()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._turn.wait(), timeout_s - waited)
        if follower.engaged:
            return StopResult(vehicle, False, "engaged again while it was being stopped")
        self._rate_request(node).restore()
        self._check_link(node, self._now())
        return StopResult(vehicle, True, follower.stop_detail or "stopped")

    # Time

    def wall_time_s(self) -> float:
        """Unix seconds of this machine."""
        return self._wall_clock()

    def _now(self) -> float:
        """Seconds of the vehicles' clock rate: every period and timeout is measured in these."""
        return self._clock() * self.settings.time_scale

    async def _run(self) -> None:
        last = self._clock()
        while True:
            last, held_up = self._clock(), self._clock() - last - self._tick_wall_s
            if held_up > HELD_UP_WALL_S:
                self._excuse(held_up * self.settings.time_scale)
            self.pass_time()
            turn, self._turn = self._turn, asyncio.Event()
            turn.set()
            await asyncio.sleep(self._tick_wall_s)

    def _excuse(self, seconds: float) -> None:
        """Blame nobody for a silence that is ours: this process, or its machine, was busy with something else."""
        now = self._now()
        if seconds > WORTH_TELLING_WALL_S * self.settings.time_scale:
            log.warning("The IMC bridge was held up for %.1f s", seconds / self.settings.time_scale)
        for node in self._roster:
            node.excuse(seconds, now)
        for follower in self._followers.values():
            follower.excuse(seconds, now)

    def pass_time(self) -> None:
        """Do whatever is due by now; runs by itself in a started bridge, a replay calls it after every packet."""
        try:
            self._tick(self._now())
        except Exception as error:
            self._note_error(error)

    def _tick(self, now: float) -> None:
        if now >= self._announce_due:
            self._announce(now)
        if now >= self._heartbeat_due:
            self._heartbeat_due = now + self.settings.heartbeat_period_s
            for node in self._roster:
                if self._talks_to(node):
                    self._beat(node)
        for node in self._roster:
            if node.is_vehicle and self._talks_to(node):
                self._tick_vehicle(node, now)
        for message in self.board.due(now):
            for node in self._roster:
                if self._is_other_console(node):
                    self._send(node, message)
        self._roster.pass_time(now)
        for node in self._roster:
            self._check_link(node, now)

    def _beat(self, node: Node) -> None:
        if node.heard_at is not None or not node.addresses:
            self._send(node, imcpy.Heartbeat())
            return
        # Which of its addresses leads to it from here shows only once it answers.
        packet = self._encoded(imcpy.Heartbeat(), node.imc_id)
        for address in node.addresses:
            self.transport.send(packet, address)

    def _tick_vehicle(self, node: Node, now: float) -> None:
        if node.entities is None and node.heard_at is not None:
            asked = self._entities_asked.get(node.imc_id, float("-inf"))
            if now - asked >= ENTITY_QUERY_S:
                self._entities_asked[node.imc_id] = now
                self._send(node, entity_query())
        follower = self._followers.get(node.imc_id)
        if follower is not None:
            follower.tick(now)
        rates = self._rates.get(node.imc_id)
        if rates is not None and rates.restoring:
            rates.tick(now)
        elif rates is not None and rates.pending and follower is not None and follower.engaged:
            rates.observed(node.rates.rates_hz(now).get("EstimatedState", 0.0))
            rates.tick(now)

    def _announce(self, now: float) -> None:
        self._announce_due = now + self.settings.announce_period_s
        self._announced_at = now
        self.transport.look_for_interfaces()
        position = self.position_rad()
        self.transport.announce(
            lambda addresses: encode(
                own_announce(self.settings, addresses, position),
                src=self.settings.imc_id,
                dst=0,
                dst_ent=0,
                time_s=self._wall_clock(),
            )
        )

    def _encoded(self, message: Message, dst: int) -> bytes:
        return encode(message, src=self.settings.imc_id, dst=dst, time_s=self._wall_clock())

    def position_rad(self) -> tuple[float, float]:
        """The place that we announce as ours."""
        if self.settings.position_deg is not None:
            lat, lon = self.settings.position_deg
            return math.radians(lat), math.radians(lon)
        for node in self._roster:
            if node.announcement is not None and node.announcement.is_vehicle:
                place = node.announcement.lat_rad, node.announcement.lon_rad
                if place != (0.0, 0.0):
                    return place
        return 0.0, 0.0

    # Packets

    def on_announce(self, packet: bytes, address: Address) -> None:
        """Take a packet of the announce socket; also the way to replay a recording."""
        try:
            self._take_announce(packet, address)
        except Exception as error:
            self._note_error(error)

    def _take_announce(self, packet: bytes, address: Address) -> None:
        header = self.announces.header(packet, address[0])
        if header is None or not self.announces.wants(header):
            return
        message = self.announces.message(packet)
        if message is None:
            return
        announcement = read_announce(message)
        if announcement.imc_id == self.settings.imc_id:
            self._look_for_double(announcement, address)
            return
        now = self._now()
        arrival = self._roster.announced(announcement, address[0], now)
        if arrival is None:
            return
        node = arrival.node
        if announcement.is_vehicle:
            # Its guard learns the bottom from the first sounding on.
            self._follower(node)
        for stale in arrival.stale:
            self.transport.streams.drop(stale)
        if node.address is not None and node.address in announcement.streams:
            self.transport.streams.want(node.address)
        if arrival.rebooted:
            self._reboot(node, now)
        if (arrival.first or arrival.rebooted) and now - self._announced_at > ANNOUNCE_AGAIN_S:
            # So that a newcomer need not wait for our next announce.
            self._announce(now)
        self._check_link(node, now)

    def _look_for_double(self, announcement: Announcement, address: Address) -> None:
        """Our own announces come back to us; those of another system under our id are trouble."""
        ours = (*self.transport.own_addresses(), address[0])
        if announcement.name == self.settings.name and any(
            host in ours and port == self.settings.port for host, port in announcement.addresses
        ):
            return
        self.double = f"{announcement.name!r} at {address[0]}"

    def _reboot(self, node: Node, now: float) -> None:
        self._entities_asked.pop(node.imc_id, None)
        follower = self._followers.get(node.imc_id)
        if follower is not None:
            follower.rebooted(now)
            if follower.engaged:
                self._rate_request(node).begin()

    def on_packet(self, packet: bytes, address: Address) -> None:
        """Take a packet of the traffic socket; also the way to replay a recording."""
        try:
            self._take_packet(packet, address)
        except Exception as error:
            self._note_error(error)

    def _take_packet(self, packet: bytes, address: Address) -> None:
        header = self.decoder.header(packet, address[0])
        if header is None:
            return
        now = self._now()
        sender = self._roster.speaker(header.src, address)
        if sender is None:
            self._pass_on(header, packet, address, now)
            return
        if header.msg_id != SIMULATED_STATE:
            # DUNE's simulation lets this one through where radio would not reach.
            sender.heard(now, address)
        if not self.decoder.wants(header):
            return
        message = self.decoder.message(packet)
        if message is not None and 0.0 < message.timestamp < MAX_PLAUSIBLE_VEHICLE_TIME_S:
            self._take_message(sender, message, now)

    def _pass_on(self, header: Header, packet: bytes, address: Address, now: float) -> None:
        """Take a packet that is not its sender's own word: an echo of ours, one relayed by a node, a stranger's."""
        via = self._roster.at(address)
        if via is None:
            self._from_unknown_address(header.src, address, now)
            self.decoder.wants(header)
        elif header.src == self.settings.imc_id:
            via.echoes += 1
        else:
            via.relayed[header.src] += 1
            if header.dst in (via.imc_id, BROADCAST_ID) and self.decoder.wants(header):
                self._relayed(via, packet, now)

    def _from_unknown_address(self, imc_id: int, address: Address, now: float) -> None:
        if imc_id in (self.settings.imc_id, 0, BROADCAST_ID):
            return
        node = self._roster.take_up(imc_id, f"0x{imc_id:04X}", now)
        if node is not None:
            node.foreign_address += 1
            node.last_foreign = address
            if node.announcement is None:
                node.heard_at = now

    def _relayed(self, via: Node, packet: bytes, now: float) -> None:
        follower = self._followers.get(via.imc_id)
        message = self.decoder.message(packet)
        if isinstance(message, imcpy.EstimatedState):
            self._heard_by_sound(via, message, now)
        if follower is None or message is None:
            return
        if isinstance(message, imcpy.Abort):
            follower.foreign_abort(int(message.src), now)
        elif isinstance(message, imcpy.PlanControl) and message.type == imcpy.PlanControl.TypeEnum.REQUEST:
            follower.foreign_plan_control(int(message.src), int(message.op))

    def _take_message(self, node: Node, message: Message, now: float) -> None:
        name = type(message).__name__
        follower = self._followers.get(node.imc_id)
        node.telemetry_at = now
        node.rates.count(name, now)
        tick = node.take_time(message.timestamp, now, self._wall_clock())
        if tick is Tick.DOUBTFUL:
            return
        if tick is Tick.JUMPED and follower is not None:
            follower.clock_jumped()
        match name:
            case "EstimatedState":
                self._take_state(node, follower, message, now)
            case "Distance":
                self._take_distance(node, message)
            case "NavigationUncertainty":
                node.take_uncertainty(message)
            case "PlanControlState" if node.in_order(name, message.timestamp):
                node.take_plan_state(message, now)
                if follower is not None:
                    follower.plan_state_changed(now)
            case "VehicleState" if node.in_order(name, message.timestamp):
                node.take_vehicle_state(message, now)
                if follower is not None:
                    follower.vehicle_state_changed(now)
            case "FollowRefState" if follower is not None:
                follower.follow_state(message, now)
            case "PlanControl" if follower is not None and int(message.dst) == self.settings.imc_id:
                follower.plan_control_reply(message, now)
            case "VehicleMedium":
                node.medium = int(message.medium)
            case "TransmissionStatus":
                for other in self._by_sound_through(node):
                    if other.sound is not None:
                        other.left_by_sound(other.sound.status(message), now)
            case "FuelLevel":
                node.battery_pct = float(message.value)
            case "EntityList" if message.op == imcpy.EntityList.OperationEnum.REPORT:
                node.take_entities(message)
            case "EntityParameters" if node.imc_id in self._rates:
                self._rates[node.imc_id].answered(message, now)

    def _take_state(self, node: Node, follower: Control | None, message: Message, now: float) -> None:
        report = node.take_state(message)
        if report is not None:
            if follower is not None:
                follower.moved(report, now)
            wall = self._clock()
            if wall - self._state_reported.get(node.imc_id, float("-inf")) >= 1.0 / self.settings.state_events_per_s:
                self._state_reported[node.imc_id] = wall
                self._tell(report)
        for result in node.gate.resolve(node.history, node.position_sd_m()):
            if follower is not None and isinstance(result, Sounding):
                follower.guard.add(result.time_s, result.lat_deg, result.lon_deg, result.bottom_depth_m, now)
            self._tell(result)

    def _take_distance(self, node: Node, message: Message) -> None:
        refused = offer_distance(node.gate, node.entity_name(int(message.src_ent)), message)
        if refused is not None:
            self._tell(refused)

    # Nodes

    def _is_other_console(self, node: Node) -> bool:
        return (
            self._commanding
            and node.address is not None
            and node.announcement is not None
            and node.announcement.system_type == int(imcpy.SystemType.CCU)
        )

    def _talks_to(self, node: Node) -> bool:
        wanted = self.settings.vehicles
        if node.address is None or node.announcement is None:
            return False
        # A console announces, too, but has nothing to tell us.
        return node.name in wanted if wanted else node.announcement.system_type != int(imcpy.SystemType.CCU)

    def _controlled(self) -> list[tuple[Node, Control]]:
        return [(self._roster[imc_id], follower) for imc_id, follower in self._followers.items()]

    def _guide(self, node: Node, guidance: Guidance) -> None:
        """Change how a vehicle is led, unless it is being led or stopped now."""
        follower = self._followers.get(node.imc_id)
        if self._guidance.get(node.imc_id, Guidance.FOLLOW) is guidance:
            return
        if follower is None or not (follower.engaged or follower.phase is Phase.STOPPING):
            self._guidance[node.imc_id] = guidance
            self._followers.pop(node.imc_id, None)

    def _attach_sound(self, node: Node, follower: Control, gateway: str) -> None:
        via = self._roster.named(gateway)
        if via is None or via.address is None:
            known = ", ".join(other.name for other in self._roster if not other.is_vehicle) or "none"
            raise RefusedError(
                node.name,
                f"its acoustic gateway {gateway!r} was never heard of (other nodes: {known})",
                "Switch the gateway on, or name another one",
            )
        if isinstance(follower, LegFollower) and (follower.sound is None or follower.sound.gateway != gateway):
            follower.attach(
                SoundPath(
                    node.name,
                    gateway,
                    lambda message: self._send(via, message),
                    lambda: next(self._request_ids) & 0xFFFF,
                    self._wall_clock,
                    self.settings.time_scale,
                ),
                lambda message: self._send(node, message),
                self._now,
            )

    def _by_sound_through(self, gateway: Node) -> Iterator[LegFollower]:
        """The vehicles that are spoken to through a gateway."""
        for follower in self._followers.values():
            if isinstance(follower, LegFollower) and follower.sound and follower.sound.gateway == gateway.name:
                yield follower

    def _heard_by_sound(self, gateway: Node, message: Message, now: float) -> None:
        """Take a vehicle's report that its gateway has made an EstimatedState of."""
        for follower in self._by_sound_through(gateway):
            if follower.node.imc_id == int(message.src) and follower.sound is not None:
                report = follower.sound.take_report(message)
                if report is not None:
                    follower.reported_by_sound(report, now)

    def _follower(self, node: Node) -> Control:
        follower = self._followers.get(node.imc_id)
        if follower is None:
            kind = Follower if self._guidance.get(node.imc_id, Guidance.FOLLOW) is Guidance.FOLLOW else LegFollower
            follower = self._followers[node.imc_id] = kind(
                node,
                self.settings,
                lambda message: self._send(node, message),
                self._tell,
                self._request_ids,
                self._seabed,
            )
        return follower

    def _rate_request(self, node: Node) -> RateRequest:
        request = self._rates.get(node.imc_id)
        if request is None:
            request = self._rates[node.imc_id] = RateRequest(
                self.settings.rate_limiters, lambda message: self._send(node, message)
            )
        return request

    def _send(self, node: Node, message: Message) -> None:
        if node.address is not None:
            self.transport.send(self._encoded(message, node.imc_id), node.address)

    # Telling the user

    def _note_error(self, error: Exception) -> None:
        self.handler_errors[type(error).__name__] += 1
        log.error("An event of the IMC bridge failed", exc_info=error)

    def _check_link(self, node: Node, now: float) -> None:
        status = node.status(now)
        follower = self._followers.get(node.imc_id)
        engaged = follower is not None and follower.engaged
        past = self._links.setdefault(node.imc_id, deque(maxlen=LINK_HISTORY))
        known = past[-1] if past else None
        reason = status.reason
        if follower is not None and not engaged and follower.refusal is not None and not reason:
            reason = f"not ours: {follower.refusal.reason}"
        same = known is not None and (known.state, known.engaged) == (status.state, engaged)
        # The seconds in the reason for a silence are no news.
        silent = status.state in (NodeState.LOST, NodeState.EXPECTED_OFFLINE)
        if same and (silent or (known is not None and known.reason == reason)):
            return
        change = LinkChange(
            node.name, status.state, engaged, reason, node.executing(self.settings.plan_id), self._wall_clock()
        )
        past.append(change)
        self._tell(change)

    def _tell(self, event: BridgeEvent) -> None:
        try:
            self._on_event(event)
        except Exception as error:
            self._note_error(error)

    def _view(self, node: Node, now: float) -> NodeView:
        status = node.status(now)
        follower = self._followers.get(node.imc_id)
        rates = self._rates.get(node.imc_id)
        scale = self.settings.time_scale

        def age(at: float | None) -> float | None:
            return None if at is None else (now - at) / scale

        return NodeView(
            name=node.name,
            imc_id=node.imc_id,
            is_vehicle=node.is_vehicle,
            state=status.state,
            engaged=follower is not None and follower.engaged,
            reason=status.reason,
            ours=node.executing(self.settings.plan_id),
            age_s=age(node.heard_at),
            announce_age_s=age(node.announced_at),
            telemetry_overdue=node.telemetry_overdue(now),
            address=f"{node.address[0]}:{node.address[1]}" if node.address else None,
            addresses=node.addresses,
            imc_version=node.announcement.imc_version if node.announcement else None,
            operation_mode=node.operation_mode_name,
            plan_id=node.plan_id or None,
            plan_state=node.plan_state_name,
            report=node.report,
            clock_offset_s=node.clock.offset_s,
            entities=None if node.entities is None else len(node.entities),
            controller=node.controller,
            bottom_sensors=tuple(sorted(node.gate.heard)),
            rates_hz=node.rates.rates_hz(now),
            soundings=node.gate.accepted,
            refused=dict(node.gate.refused),
            echoes=node.echoes,
            relayed=sum(node.relayed.values()),
            foreign_address=node.foreign_address,
            foreign_from=f"{node.last_foreign[0]}:{node.last_foreign[1]}" if node.last_foreign else None,
            conflict=node.conflict,
            clock_rate=node.clock.rate(scale),
            history=tuple(self._links.get(node.imc_id, ())),
            rate_limiters=rates.text if rates is not None else "as the vehicle has them",
            radio_gaps=node.radio_gaps,
        )
