"""What is sent to everyone: announces, heartbeats, questions for names, marks for other consoles."""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable

import imcpy

from imc_bridge.control.rates import parameter_query
from imc_bridge.network.codec import Message, encode
from imc_bridge.network.consoles import Board
from imc_bridge.network.discovery import Announcement, own_announce
from imc_bridge.network.transport import Address, Transport
from imc_bridge.nodes.node import Node
from imc_bridge.nodes.registry import NodeRegistry
from imc_bridge.settings import BridgeSettings

ENTITY_QUERY_S = 2.0
PARAMETER_TRIES = 5


def entity_query() -> Message:
    """The question for the names of a node's entities."""
    query = imcpy.EntityList()
    query.op = imcpy.EntityList.OperationEnum.QUERY
    return query


class Sender:
    """Sends announces, heartbeats and questions to the network, and messages to single nodes.

    Parameters
    ----------
    settings
    transport, registry
    commanding
        False for a listener, which shows nothing to other consoles.
    wall_clock
        Unix seconds, for our messages' times.
    """

    def __init__(
        self,
        settings: BridgeSettings,
        transport: Transport,
        registry: NodeRegistry,
        *,
        commanding: bool,
        wall_clock: Callable[[], float],
    ) -> None:
        self.settings = settings
        self.transport = transport
        self.board = Board(settings.name)
        """What other consoles are shown."""
        self.run = str(secrets.randbits(63))
        """What our announces are known by when they come back to us."""
        self.quiet = False
        """Whether no heartbeat is sent: vehicles send to who spoke last under our id, and another one leads them."""
        self.announced_at = -math.inf
        self._registry = registry
        self._commanding = commanding
        self._wall_clock = wall_clock
        self._announce_due = 0.0
        self._heartbeat_due = 0.0
        self._greeted: set[Address] = set()

    def begin(self, now: float) -> None:
        """Announce from now on, or as soon as it is known where we are."""
        if self.settings.position is None:
            # The first vehicle's position serves as ours, and it is answered at once; see own_announce.
            self._announce_due = now + self.settings.announce_period_s

    def tick(self, now: float) -> None:
        """Send whatever is due."""
        if now >= self._announce_due:
            self.announce(now)
        if now >= self._heartbeat_due:
            self._heartbeat_due = now + self.settings.heartbeat_period_s
            self._greeted.clear()
            for node in self._registry:
                # A system that never answered may not exist: its address is not addressed for long.
                if not self.quiet and self.talks_to(node) and (node.packets or not node.given_up(now)):
                    self._beat(node)
        for node in self._registry:
            if node.is_vehicle and self.talks_to(node):
                self._ask_for_names(node, now)
                self._ask_for_supervisor(node, now)
        for message in self.board.due(now):
            for node in self._registry:
                if self._is_other_console(node):
                    self.send(node, message)

    def _ask_for_names(self, node: Node, now: float) -> None:
        if node.entities is None and node.heard_at is not None and now - node.entities_asked_at >= ENTITY_QUERY_S:
            node.entities_asked_at = now
            self.send(node, entity_query())

    def _ask_for_supervisor(self, node: Node, now: float) -> None:
        """Ask how the task is configured that starts a plan when no console is heard."""
        task = node.lost_comms_task
        untold = task is not None and node.lost_comms is None and node.lost_comms_asked < PARAMETER_TRIES
        if task is not None and untold and now - node.entities_asked_at >= ENTITY_QUERY_S:
            node.entities_asked_at = now
            node.lost_comms_asked += 1
            self.send(node, parameter_query(task))

    def _beat(self, node: Node) -> None:
        if node.heard_at is not None or not node.addresses:
            self.send(node, imcpy.Heartbeat())
            return
        # Which of its addresses leads to it from here shows only once it answers.
        packet = self._encoded(imcpy.Heartbeat(), node.imc_id)
        for address in node.addresses:
            self.transport.send(packet, address)

    def greet(self, announcement: Announcement, host: str) -> None:
        """Send a heartbeat to a system that announced itself, at the host that its announce came from.

        However many systems claim an address, it gets one a period.
        """
        here = next((address for address in announcement.addresses if address[0] == host), None)
        if self.quiet or here is None or here in self._greeted:
            return
        if announcement.system_type != int(imcpy.SystemType.CCU):
            self._greeted.add(here)
            self.transport.send(self._encoded(imcpy.Heartbeat(), announcement.imc_id), here)

    def announce(self, now: float) -> None:
        """Announce ourselves on every port and interface."""
        self._announce_due = now + self.settings.announce_period_s
        self.announced_at = now
        self.transport.look_for_interfaces()
        position = self.position_rad()
        self.transport.announce(
            lambda addresses: encode(
                own_announce(self.settings, addresses, position, self.run),
                src=self.settings.id,
                dst=0,
                dst_ent=0,
                time_s=self._wall_clock(),
            )
        )

    def _encoded(self, message: Message, dst: int) -> bytes:
        return encode(message, src=self.settings.id, dst=dst, time_s=self._wall_clock())

    def position_rad(self) -> tuple[float, float]:
        """The place that we announce as ours."""
        if self.settings.position is not None:
            lat, lon = self.settings.position
            return math.radians(lat), math.radians(lon)
        for node in self._registry:
            if node.announcement is not None and node.announcement.is_vehicle:
                place = node.announcement.lat_rad, node.announcement.lon_rad
                if place != (0.0, 0.0):
                    return place
        return 0.0, 0.0

    def _is_other_console(self, node: Node) -> bool:
        return (
            self._commanding
            and node.address is not None
            and node.announcement is not None
            and node.announcement.system_type == int(imcpy.SystemType.CCU)
        )

    def talks_to(self, node: Node) -> bool:
        """Whether we send to a node."""
        wanted = self.settings.vehicles
        if node.address is None or node.announcement is None:
            return False
        # A console announces, too, but has no telemetry for us.
        return node.name in wanted if wanted else node.announcement.system_type != int(imcpy.SystemType.CCU)

    def send(self, node: Node, message: Message) -> None:
        """Send a message to a node; nothing while it has no address."""
        if node.address is not None:
            self.transport.send(self._encoded(message, node.imc_id), node.address)
