"""The systems on the network: nodes by id, by name and by address, and what their announces change."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from imc_bridge.network.discovery import Announcement, reachable_first
from imc_bridge.network.transport import Address
from imc_bridge.nodes.capacity import Capacity, Standing, standing_of
from imc_bridge.nodes.newcomers import Newcomers
from imc_bridge.nodes.node import ANNOUNCES_MISSED, LONGEST_DIVE_S, Node
from imc_bridge.settings import BridgeSettings

MAX_CLAIMS = 8
MOVED_SILENT_S = 5.0
"""A vehicle that announces another address is believed when nothing came from the one before for this long."""

Claim = tuple[str, str]
"""Name and uid (or addresses) that distinguish nodes of the same id."""


@dataclass(frozen=True, slots=True)
class Arrival:
    """What an announce has changed.

    ``stale`` are addresses at which the node was reached before and is not any more.
    """

    node: Node
    first: bool = False
    rebooted: bool = False
    stale: tuple[Address, ...] = ()


@dataclass(frozen=True, slots=True)
class _Move:
    """Where a node may be now: its announce, the host of that, how long it must have been silent where it was."""

    announcement: Announcement
    host: str
    silent_s: float


class NodeRegistry:
    """The nodes of the network.

    Parameters
    ----------
    settings

    Attributes
    ----------
    capacity : Capacity
        Decides which systems get a place.
    newcomers : Newcomers
        Those who announced themselves while there was none.
    left : list[Callable[[Node], None]]
        Called with every node that lost its place, so that nothing of it is kept elsewhere.
    """

    def __init__(self, settings: BridgeSettings) -> None:
        self._settings = settings
        self._nodes: dict[int, Node] = {}
        self.peers: set[int] = set()
        """Ids of services that share their missions with us."""
        self.capacity = Capacity(self._nodes)
        self.capacity.wanted.update(settings.vehicles)
        self.newcomers = Newcomers()
        self.left: list[Callable[[Node], None]] = []
        self._by_address: dict[Address, Node] = {}
        self._claims: dict[int, dict[Claim, float]] = {}
        self._moves: dict[int, _Move] = {}
        self._conflict_until: dict[int, float] = {}

    def __iter__(self) -> Iterator[Node]:
        """Every node by id; nodes may be added meanwhile."""
        return iter([self._nodes[imc_id] for imc_id in sorted(self._nodes)])

    def __getitem__(self, imc_id: int) -> Node:
        return self._nodes[imc_id]

    def named(self, name: str) -> Node | None:
        """The node of this name."""
        return next((node for node in self._nodes.values() if node.name == name), None)

    def stranger(self, imc_id: int, host: str, now: float) -> Node | None:
        """The node of this id, whose packets come from anywhere; None when too many without an announce are known."""
        node = self._nodes.get(imc_id)
        if node is None and self._make_room(Standing.UNANNOUNCED, host, "", now):
            node = self._add(imc_id, f"0x{imc_id:04X}", host, now)
        return node

    def find_place(self, announcement: Announcement, host: str, now: float, *, heard: bool = False) -> bool:
        """Whether a system that announced itself has a place or gets one.

        With ``heard`` packets came from its announced address: a node without any gives the id up to it.
        """
        node = self._nodes.get(announcement.imc_id)
        if heard and node is not None and standing_of(node) is Standing.UNHEARD and not self.capacity.in_use(node):
            self._drop(node)
            node = None
        if node is not None and node.announcement is not None:
            return True
        standing = Standing.HEARD if heard else Standing.UNHEARD
        if not self._make_room(standing, host, announcement.name, now):
            return False
        if announcement.imc_id not in self._nodes:  # new, or the one that left
            self._add(announcement.imc_id, announcement.name, host, now)
        return True

    def first_heard(self, node: Node) -> None:
        """Give a node with its first packet the name that it announced, unless another one uses it."""
        if node.announcement is None or node.name == node.announcement.name:
            return
        holder = self.named(node.announcement.name)
        if holder is not None and standing_of(holder) is not Standing.HEARD:
            self._take_over(node.announcement.name, node)

    def _make_room(self, standing: Standing, host: str, name: str, now: float) -> bool:
        there_is, leaver = self.capacity.room(standing, host, name, now)
        if leaver is not None:
            self._drop(leaver)
        return there_is

    def _add(self, imc_id: int, name: str, host: str, now: float) -> Node:
        node = self._nodes[imc_id] = Node(imc_id, name, self._settings, now, self.peers)
        node.host = host
        self._name(node, name)
        return node

    def _drop(self, node: Node) -> None:
        del self._nodes[node.imc_id]
        self._claims.pop(node.imc_id, None)
        self._moves.pop(node.imc_id, None)
        self._conflict_until.pop(node.imc_id, None)
        for address in node.addresses:
            if self._by_address.get(address) is node:
                del self._by_address[address]
        self.capacity.look_again()
        for tell in self.left:
            tell(node)

    def speaker(self, imc_id: int, address: Address) -> Node | None:
        """The node of this id if it announced this address as its own: only then a packet is the node's own word."""
        node = self._nodes.get(imc_id)
        return node if node is not None and address in node.addresses else None

    def at(self, address: Address) -> Node | None:
        """The node that announced this address, even when it relays packets of others."""
        return self._by_address.get(address)

    def comes_from_elsewhere(self, imc_id: int, source_host: str, now: float) -> bool:
        """Whether an announce of a node that is there came from a host that is not its own.

        A node is bound to the hosts of its announces unless it is silent for long: no other node takes its place.
        """
        node = self._nodes.get(imc_id)
        return node is not None and bool(node.hosts) and source_host not in node.hosts and not node.given_up(now)

    def may_be_another(self, imc_id: int) -> bool:
        """Whether the node of this id never answered: another system that announces the id may be the real one."""
        node = self._nodes.get(imc_id)
        return node is not None and standing_of(node) is Standing.UNHEARD

    def is_old(self, imc_id: int, timestamp: float, now: float) -> bool:
        """Whether a node in contact sent this long ago. While it restarts, maybe with another time, it is silent."""
        node = self._nodes.get(imc_id)
        heard = node is not None and node.heard_at is not None and now - node.heard_at <= self._settings.lost_after_s
        return node is not None and heard and node.clock.is_old(timestamp)

    def note_move(self, announcement: Announcement, host: str) -> None:
        """Note that a node, by its uid the same that runs on, announces itself from another host, as after DHCP."""
        node = self._nodes.get(announcement.imc_id)
        known = node.announcement if node is not None else None
        if known is not None and announcement.uid is not None and _claim(announcement) == _claim(known):
            self._moves[announcement.imc_id] = _Move(announcement, host, MOVED_SILENT_S)

    def moved(self, imc_id: int, address: Address, timestamp: float, now: float) -> tuple[Announcement, str] | None:
        """The announce of a node that speaks on from another address, and its host; None while that is not certain.

        Where it was before it may always return to: what came from elsewhere meanwhile was another system's.
        """
        node, move = self._nodes.get(imc_id), self._moves.get(imc_id)
        if node is None or move is None or node.announcement is None or node.heard_at is None:
            return None
        settings = self._settings
        silent_s = move.silent_s and max(move.silent_s, settings.lost_after_wall_s * settings.time_scale)
        there = (*move.announcement.addresses, *move.announcement.streams)
        if address not in there or now - node.heard_at < silent_s or not node.clock.goes_on(timestamp, now):
            return None
        self._moves[imc_id] = _Move(node.announcement, node.host, 0.0 if move.silent_s else MOVED_SILENT_S)
        return move.announcement, move.host

    def note_rival(self, announcement: Announcement, now: float) -> None:
        """Note an announce that changes nothing: if it is another node's of the same id, that is for the operator."""
        node = self._nodes.get(announcement.imc_id)
        if node is not None:
            self._contested(node, announcement, now)

    def announced(self, announcement: Announcement, source_host: str, now: float) -> Arrival | None:
        """Take in an announce of a system that has a place; None when it is a second node's of the same id."""
        node = self._nodes[announcement.imc_id]
        first = node.announcement is None
        if self._contested(node, announcement, now):
            return None
        if node.announcement is None or node.announcement.name != announcement.name:
            self._name(node, announcement.name)
        addresses = reachable_first(announcement, source_host, by_tcp=self._settings.transport == "tcp")
        stale = tuple(address for address in node.addresses if address not in addresses)
        node.host = source_host
        node.hosts = frozenset({source_host, *(host for host, _ in addresses)})
        rebooted = node.announced(announcement, addresses, now)
        for address in stale:
            if self._by_address.get(address) is node:
                del self._by_address[address]
        for address in addresses:
            owner = self._by_address.get(address)
            if owner is None or owner.given_up(now):
                self._by_address[address] = node
        return Arrival(node, first, rebooted, stale)

    def pass_time(self, now: float) -> None:
        """Forget conflicts that have not shown for a while, and unknown systems that fell silent."""
        self.capacity.look_again()
        for node in list(self._nodes.values()):
            if self.capacity.expired(node, now, self._settings.time_scale):
                self._drop(node)
        for imc_id, until in list(self._conflict_until.items()):
            if now > until:
                del self._conflict_until[imc_id]
                self._nodes[imc_id].id_conflict = None
        self._look_for_namesakes(now)

    def _look_for_namesakes(self, now: float) -> None:
        """Note who announces the name of another: after a restart of ours either could be called by it.

        A new computer of a vehicle has its name at once, who is there alone otherwise once the other one cannot be
        under water any more.
        """
        named: dict[str, Node] = {}
        heard = [node for node in self._nodes.values() if standing_of(node) is Standing.HEARD]
        for node in heard:
            node.namesake = None
        for node in sorted(heard, key=lambda node: -node.last_sign):
            if node.announcement is None or node.given_up(now):
                continue
            other = named.setdefault(node.announcement.name, node)
            if other is not node and (self.capacity.in_use(node) or not node.replaced_by(other, now)):
                node.namesake, other.namesake = other, node
        for name, node in named.items():
            holder = self.named(name)
            if node.namesake is not None or holder is None or holder is node:
                continue
            if holder.replaced_by(node, now) or now - holder.last_sign > LONGEST_DIVE_S:
                self._take_over(name, node)

    def _take_over(self, name: str, node: Node) -> None:
        """Give a node a name that another has, and the addresses that both have announced.

        Neither may be in use: whoever leads a vehicle stops it by its name.
        """
        holder = self.named(name)
        if holder is None or self.capacity.in_use(holder) or self.capacity.in_use(node):
            return
        self._name(holder, "")
        self._name(node, name)
        if standing_of(holder) is Standing.HEARD:
            self._name(holder, name)
        for address in node.addresses:
            if self._by_address.get(address) is holder:
                self._by_address[address] = node

    def _contested(self, node: Node, new: Announcement, now: float) -> bool:
        """Note which node claims the id; return whether a second one does, whose announce must not count.

        A node that restarts comes back under its name with a new uid, once. Two nodes come in turns.
        """
        patience = ANNOUNCES_MISSED * self._settings.announce_period_s
        claims = self._claims.setdefault(node.imc_id, {})
        for claim, seen in list(claims.items()):
            if now - seen > patience:
                del claims[claim]
        mine = _claim(new)
        rivals = [claim for claim in claims if claim != mine]
        known = node.announcement
        # A silent one, as after a single forged announce, blocks no other.
        returned = mine in claims and known is not None and _claim(known) in rivals
        renamed = any(name != new.name for name, _ in rivals)
        if len(claims) < MAX_CLAIMS or mine in claims:
            claims[mine] = now
        if known is None or not (returned or renamed or (rivals and node.id_conflict)):
            return False
        self._conflict_until[node.imc_id] = now + patience
        names = sorted({known.name, new.name, *(name for name, _ in rivals)})
        others = ", ".join(f"{host}:{port}" for host, port in (*known.addresses[:2], *new.addresses[:2]))
        node.id_conflict = (
            f"id 0x{node.imc_id:04X} is announced by {' and by '.join(map(repr, names))}: give one another id"
            if len(names) > 1
            else f"two nodes named {names[0]!r} announce id 0x{node.imc_id:04X} ({others}): stop one of them"
        )
        return _claim(known) != mine

    def _name(self, node: Node, name: str) -> None:
        """Give a node its announced name, made unique."""
        taken = {other.name for other in self._nodes.values() if other is not node}
        node.name = name if name and name not in taken else f"{name} (0x{node.imc_id:04X})".strip()
        node.intake.vehicle = node.pings.vehicle = node.ranges.vehicle = node.faults.vehicle = node.name


def _claim(announcement: Announcement) -> Claim:
    return announcement.name, announcement.uid or repr(sorted((*announcement.addresses, *announcement.streams)))
