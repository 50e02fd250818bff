"""Everything that arrives: the sender of a packet, and what it changes."""

from __future__ import annotations

import math
from collections.abc import Callable

import imcpy

from imc_bridge.control.control import Control
from imc_bridge.control.controls import Controls
from imc_bridge.events import BridgeEvent, Fault, PingRefused, Restarted, Sounding, SoundingRefused, SwathPing
from imc_bridge.links import Links
from imc_bridge.network.codec import BROADCAST_ID, Decoder, Header, Message
from imc_bridge.network.discovery import Announcement, read_announce
from imc_bridge.network.transport import Address
from imc_bridge.nodes.admission import Admission
from imc_bridge.nodes.node import ANNOUNCES_MISSED, Node
from imc_bridge.nodes.refusals import Refused
from imc_bridge.nodes.registry import NodeRegistry
from imc_bridge.nodes.vehicle_clock import Tick
from imc_bridge.sender import Sender
from imc_bridge.settings import BridgeSettings
from imc_bridge.telemetry.faults import is_leak_sensor
from imc_bridge.telemetry.ranges import MESSAGES as RANGE_MESSAGES
from imc_bridge.telemetry.soundings import offer_distance
from imc_bridge.telemetry.swaths import bottom_below
from imc_bridge.telemetry.water import MESSAGES as WATER_MESSAGES

WANTED = (
    "Abort",
    "Distance",
    "EntityList",
    "EntityParameters",
    "EntityState",
    "EstimatedState",
    "EstimatedStreamVelocity",
    "FollowRefState",
    "FuelLevel",
    "Heartbeat",
    "NavigationUncertainty",
    "PlanControl",
    "PlanControlState",
    "PlanDB",
    "SonarData",
    "TransmissionStatus",
    "VehicleMedium",
    "VehicleState",
    *RANGE_MESSAGES,
    *WATER_MESSAGES,
)
ENTITY_STATE = int(imcpy.EntityState().msg_id)
MAX_PLAUSIBLE_VEHICLE_TIME_S = 4e9
ANNOUNCE_AGAIN_S = 1.0


class Receiver:
    """Takes packets in. Nothing that arrives can raise out of it.

    Parameters
    ----------
    settings
    registry, controls, links
        Known nodes, controlled vehicles and their links; each is updated.
    tell
        Receives events for the bridge's user.
    failed
        Receives errors of our own.
    clock
        Seconds of the wall clock that never step back.
    wall_clock
        Unix seconds.
    sender
        Answers newcomers.
    """

    def __init__(
        self,
        settings: BridgeSettings,
        registry: NodeRegistry,
        controls: Controls,
        links: Links,
        tell: Callable[[BridgeEvent], None],
        failed: Callable[[Exception], None],
        clock: Callable[[], float],
        wall_clock: Callable[[], float],
        sender: Sender,
    ) -> None:
        self.decoder = Decoder(WANTED)
        self.announces = Decoder(("Announce",))
        self._double = ""
        self._double_at = -math.inf
        self._settings = settings
        self._registry = registry
        self._controls = controls
        self._links = links
        self._tell = tell
        self._note_error = failed
        self._clock = clock
        self._wall_clock = wall_clock
        self._sender = sender
        self._state_reported: dict[int, float] = {}
        self.admission = Admission(settings, registry, clock)

    @property
    def double(self) -> str:
        """Another system that announces our own id, while it does; usually empty."""
        patience = ANNOUNCES_MISSED * self._settings.announce_period_s
        return self._double if self._now() - self._double_at <= patience else ""

    def _now(self) -> float:
        return self._clock() * self._settings.time_scale

    def on_announce(self, packet: bytes, address: Address) -> None:
        """Take a packet of the announce socket; also the way to replay a recording."""
        try:
            if self.admission.admits(address, announce=True):
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
        if announcement.imc_id == self._settings.id:
            if announcement.run != self._sender.run:
                self._double, self._double_at = f"{announcement.name!r} at {address[0]}", self._now()
                self._answer(self._double_at)
            return
        now = self._now()
        if not self._counts(announcement.imc_id, message.timestamp, address, now):
            self._registry.note_rival(announcement, now)
            self._registry.note_move(announcement, address[0])
            if self._registry.may_be_another(announcement.imc_id):
                self._greet(announcement, address, now)
            return
        if not self._registry.find_place(announcement, address[0], now):
            self.admission.refuse(Refused.CROWDED, address)
            self._greet(announcement, address, now)
            return
        self._take_up(announcement, address[0], now)

    def _greet(self, announcement: Announcement, address: Address, now: float) -> None:
        """Speak once to a system without a place: one that is there answers, and has shown thereby that it is."""
        self._registry.newcomers.note(announcement, address[0])
        self._sender.greet(announcement, address[0])
        self._answer(now)

    def _answer(self, now: float) -> None:
        """Announce ourselves, so that a newcomer need not wait for our next announce."""
        if now - self._sender.announced_at > ANNOUNCE_AGAIN_S:
            self._sender.announce(now)

    def _take_up(self, announcement: Announcement, host: str, now: float) -> None:
        arrival = self._registry.announced(announcement, host, now)
        if arrival is None:
            return
        node = arrival.node
        if announcement.is_vehicle:
            # Its guard learns the bottom from the first sounding on.
            self._controls.of(node)
        streams = self._sender.transport.streams
        for stale in arrival.stale:
            streams.drop(stale)
        if node.address is not None and node.address in announcement.streams:
            streams.want(node.address)
        if arrival.rebooted:
            self._reboot(node, now)
        if arrival.first or arrival.rebooted:
            self._answer(now)
        self._links.check(node, self._controls.get(node), now)

    def _counts(self, imc_id: int, timestamp: float, address: Address, now: float) -> bool:
        """Whether an announce may change where a node is: neither a stranger's, nor one that was recorded before."""
        if not self.admission.admits_id(imc_id, address):
            return False
        if self._registry.comes_from_elsewhere(imc_id, address[0], now):
            return self.admission.refuse(Refused.MOVED, address)
        return not self._registry.is_old(imc_id, timestamp, now) or self.admission.refuse(Refused.OLD, address)

    def _reboot(self, node: Node, now: float) -> None:
        self._tell(Restarted(node.name, node.submerged))
        control, way_home = self._controls.get(node), self._controls.way_home(node)
        if way_home is not None:
            way_home.restarted()
        if control is not None:
            control.rebooted(now)
            if control.engaged:
                self._controls.rates_of(node).begin()

    def on_packet(self, packet: bytes, address: Address) -> None:
        """Take a packet of the traffic socket; also the way to replay a recording."""
        try:
            if self.admission.admits(address):
                self._take_packet(packet, address)
        except Exception as error:
            self._note_error(error)

    def _take_packet(self, packet: bytes, address: Address) -> None:
        header = self.decoder.header(packet, address[0])
        if header is None:
            return
        now = self._now()
        node = self._registry.speaker(header.src, address) or self._newcomer(header, address, now)
        if node is None:
            self._pass_on(header, packet, address, now)
            return
        if not self.decoder.wants(header):
            return
        if header.msg_id == ENTITY_STATE and not is_leak_sensor(node.entity_name(header.src_ent)):
            # Dozens of entities tell how they are every second.
            self.decoder.unwanted["EntityState"] += 1
            return
        message = self.decoder.received(packet)
        if message is None:
            # What is damaged shows no contact.
            return
        if node.packets == 0:
            if not self._registry.capacity.may_be_heard(node, address[0]):
                self.admission.refuse(Refused.CROWDED, address)
                return
            self._registry.first_heard(node)
        if not node.clock.is_old(message.timestamp):
            node.heard(now, address)
        if 0.0 < message.timestamp < MAX_PLAUSIBLE_VEHICLE_TIME_S:
            self._take_message(node, message, now, address)

    def _newcomer(self, header: Header, address: Address, now: float) -> Node | None:
        """The system that had no place when it announced itself and now sends, if it gets one; or one that moved."""
        imc_id = header.src
        moved = self._registry.moved(imc_id, address, header.timestamp, now)
        if moved is not None:
            self._take_up(*moved, now)
            return self._registry.speaker(imc_id, address)
        announcement = self._registry.newcomers.answered(imc_id, address)
        if announcement is None:
            return None
        if not self._registry.find_place(announcement, address[0], now, heard=True):
            self.admission.refuse(Refused.CROWDED, address)
            return None
        self._take_up(announcement, address[0], now)
        return self._registry.speaker(imc_id, address)

    def forget(self, node: Node) -> None:
        """Keep nothing of a node that has lost its place."""
        self._state_reported.pop(node.imc_id, None)

    def _pass_on(self, header: Header, packet: bytes, address: Address, now: float) -> None:
        """Take a packet that is not its sender's own word: an echo of ours, one relayed by a node, a stranger's."""
        via = self._registry.at(address)
        if via is None:
            self._from_unknown_address(header.src, address, now)
            self.decoder.wants(header)
        elif header.src == self._settings.id:
            via.echoes += 1
        else:
            via.relayed += 1
            if header.dst in (via.imc_id, BROADCAST_ID) and self.decoder.wants(header):
                self._relayed(via, packet, now)

    def _from_unknown_address(self, imc_id: int, address: Address, now: float) -> None:
        if imc_id in (self._settings.id, 0, BROADCAST_ID) or not self.admission.admits_id(imc_id, address):
            return
        node = self._registry.stranger(imc_id, address[0], now)
        if node is None:
            self.admission.refuse(Refused.CROWDED, address)
            return
        node.foreign_address += 1
        node.last_foreign = address
        if node.announcement is None:
            node.heard_at = now

    def _relayed(self, via: Node, packet: bytes, now: float) -> None:
        control = self._controls.get(via)
        message = self.decoder.received(packet)
        if isinstance(message, imcpy.EstimatedState):
            self._heard_by_sound(via, message, now)
        if control is None or message is None:
            return
        if isinstance(message, imcpy.Abort):
            control.foreign_abort(int(message.src), now)
        elif isinstance(message, imcpy.PlanControl) and message.type == imcpy.PlanControl.TypeEnum.REQUEST:
            control.foreign_plan_control(int(message.src), int(message.op))

    def _heard_by_sound(self, gateway: Node, message: Message, now: float) -> None:
        """Take a vehicle's report that its gateway has made an EstimatedState of."""
        for control in self._controls.by_sound_through(gateway):
            if control.node.imc_id == int(message.src) and control.sound is not None:
                report = control.sound.take_report(message)
                if report is not None:
                    control.reported_by_sound(report, now)

    def _take_message(self, node: Node, message: Message, now: float, address: Address) -> None:
        name = type(message).__name__
        control = self._controls.get(node)
        rates, way_home = self._controls.asked_rates(node), self._controls.way_home(node)
        tick = node.take_time(message.timestamp, now, self._wall_clock())
        if tick is Tick.DOUBTFUL:
            self.admission.refuse(Refused.OLD, address)
            return
        node.rates.count(name, now)
        if tick is Tick.JUMPED and control is not None:
            control.clock_jumped()
        match name:
            case "EstimatedState":
                self._take_state(node, control, message, now, address)
            case "Distance":
                self._tell_refused(offer_distance(node.intake, node.entity_name(int(message.src_ent)), message))
            case "SonarData":
                self._tell_refused(node.pings.offer(node.entity_name(int(message.src_ent)), message))
            case "NavigationUncertainty":
                node.take_uncertainty(message)
            case _ if name in RANGE_MESSAGES:
                node.ranges.offer(name, message)
            case _ if name in WATER_MESSAGES:
                node.water.offer(name, node.entity_name(int(message.src_ent)), message)
            case "PlanControlState" if node.in_order(name, message.timestamp):
                if node.take_plan_state(message, now):
                    node.restarted()
                    self._reboot(node, now)
                if control is not None:
                    control.plan_state_changed(now)
            case "VehicleState" if node.in_order(name, message.timestamp):
                if node.take_vehicle_state(message, now):
                    node.restarted()
                    self._reboot(node, now)
                self._tell_fault(node.faults.take_vehicle_state(message, node.error_text))
                if control is not None:
                    control.vehicle_state_changed(now)
            case "EntityState":
                self._tell_fault(node.faults.take_entity(node.entity_name(int(message.src_ent)) or "", message))
            case "FollowRefState" if control is not None:
                control.follow_state(message, now)
            case "PlanControl" if control is not None and int(message.dst) == self._settings.id:
                control.plan_control_reply(message, now)
            case "VehicleMedium":
                node.medium = int(message.medium)
            case "TransmissionStatus":
                for other in self._controls.by_sound_through(node):
                    if other.sound is not None:
                        other.left_by_sound(other.sound.status(message), now)
            case "EstimatedStreamVelocity":
                node.take_stream(message)
            case "FuelLevel":
                node.take_fuel(message)
            case "EntityList" if message.op == imcpy.EntityList.OperationEnum.REPORT:
                node.take_entities(message)
            case "EntityParameters":
                if rates is not None:
                    rates.answered(message, now)
                node.take_parameters(message)
            case "PlanDB" if way_home is not None and int(message.dst) == self._settings.id:
                way_home.replied(message)

    def _take_state(self, node: Node, control: Control | None, message: Message, now: float, address: Address) -> None:
        report = node.take_state(message, now)
        if isinstance(report, Refused):
            self.admission.refuse(report, address)
        elif report is not None:
            if control is not None:
                control.moved(report, now)
            wall = self._clock()
            if wall - self._state_reported.get(node.imc_id, float("-inf")) >= 1.0 / self._settings.state_events_per_s:
                self._state_reported[node.imc_id] = wall
                self._tell(report)
        for result in node.intake.resolve(node.history, node.position_sd_m()):
            if control is not None and isinstance(result, Sounding):
                control.guard.add(result.time_s, result.lat_deg, result.lon_deg, result.bottom_depth_m, now)
            self._tell(result)
        for ping in node.pings.resolve(node.history, node.position_sd_m()):
            if control is not None and isinstance(ping, SwathPing):
                control.guard.add(ping.time_s, *bottom_below(ping), now)
            self._tell(ping)
        for measured in node.ranges.resolve(node.history, node.position_sd_m()):
            self._tell(measured)
        for water in node.water.resolve(node.history):
            self._tell(water)

    def _tell_fault(self, fault: Fault | None) -> None:
        if fault is not None:
            self._tell(fault)

    def _tell_refused(self, refused: SoundingRefused | PingRefused | None) -> None:
        if refused is not None:
            self._tell(refused)
