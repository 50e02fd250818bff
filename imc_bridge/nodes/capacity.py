"""How many nodes are kept, and which leave when there are too many: IMC has no authentication, and ids are free."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum

from imc_bridge.nodes.node import Node

MAX_NODES = 256
MAX_HEARD_OF_HOST = 128
MAX_UNHEARD = 64
MAX_UNHEARD_OF_HOST = 32
MAX_UNANNOUNCED = 32
MAX_UNANNOUNCED_OF_HOST = 8
UNANNOUNCED_SILENT_S = 10.0
"""A system without an announce that is silent for this long leaves for another."""
UNANNOUNCED_KEPT_WALL_S = 60.0
UNHEARD_KEPT_WALL_S = 300.0
"""Silent ones are shown for this long, if their places are not needed."""


class Standing(IntEnum):
    """What is known of a node, which decides how firm its place is."""

    UNANNOUNCED = 0
    """Packets come under its id: anybody can send those."""
    UNHEARD = 1
    """It was announced, and nothing came from where it says that it is."""
    HEARD = 2
    """It sends from its announced address."""


_MOST = {
    Standing.UNANNOUNCED: (MAX_UNANNOUNCED, MAX_UNANNOUNCED_OF_HOST),
    Standing.UNHEARD: (MAX_UNHEARD, MAX_UNHEARD_OF_HOST),
    Standing.HEARD: (MAX_NODES, MAX_HEARD_OF_HOST),
}


def standing_of(node: Node) -> Standing:
    """The standing of a node."""
    if node.announcement is None:
        return Standing.UNANNOUNCED
    return Standing.HEARD if node.packets else Standing.UNHEARD


class Capacity:
    """Decides about places.

    Parameters
    ----------
    nodes
        Those who have one, by id.

    Attributes
    ----------
    wanted : set[str]
        Names of vehicles of missions and settings: they get a place, and keep it.
    in_use : Callable[[Node], bool]
        Whether a node is in use, which keeps its place as well.
    """

    def __init__(self, nodes: Mapping[int, Node]) -> None:
        self.wanted: set[str] = set()
        self.in_use: Callable[[Node], bool] = lambda _node: False
        self._nodes = nodes
        self._full: set[tuple[Standing, str]] = set()

    def look_again(self) -> None:
        """Forget which hosts have all their places: time has passed."""
        self._full.clear()

    def keeps(self, node: Node) -> bool:
        """Whether a node never leaves."""
        return node.name in self.wanted or self.in_use(node)

    def expired(self, node: Node, now: float, time_scale: float) -> bool:
        """Whether a node that never answered is no longer shown."""
        standing = standing_of(node)
        kept_s = UNANNOUNCED_KEPT_WALL_S if standing is Standing.UNANNOUNCED else UNHEARD_KEPT_WALL_S
        if standing is Standing.HEARD or now - node.last_sign <= kept_s * time_scale:
            return False
        return not self.keeps(node)

    def room(self, standing: Standing, host: str, name: str, now: float) -> tuple[bool, Node | None]:
        """Whether there is a place for one more node, and which node leaves it.

        Parameters
        ----------
        standing
            What the node will be.
        host
            The host that it sends or announces itself from.
        name
            As announced.
        now
            Seconds of the bridge's clock.
        """
        if standing is not Standing.UNANNOUNCED and self._is_wanted(name):
            if len(self._nodes) < MAX_NODES:
                return True, None
            leaver = self._weakest(lambda node: True)
            return leaver is not None, leaver
        if (standing, host) in self._full:
            return False, None
        found, leaver = self._in_turn(standing, host, now)
        if not found:
            self._full.add((standing, host))
        return found, leaver

    def may_be_heard(self, node: Node, host: str) -> bool:
        """Whether a node that never answered may give its place to one that does."""
        if self.keeps(node):
            return True
        if (Standing.HEARD, host) in self._full:
            return False
        _, most_of_host = _MOST[Standing.HEARD]
        of_host = [other for other in self._nodes.values() if other.host == host and self._counts_as_heard(other)]
        if len(of_host) < most_of_host:
            return True
        self._full.add((Standing.HEARD, host))
        return False

    def _counts_as_heard(self, node: Node) -> bool:
        return standing_of(node) is Standing.HEARD and not self.keeps(node)

    def _is_wanted(self, name: str) -> bool:
        """Whether a name's place is still free: no system uses it yet."""
        holder = next((node for node in self._nodes.values() if node.name == name), None)
        return name in self.wanted and (holder is None or standing_of(holder) is not Standing.HEARD)

    def _in_turn(self, standing: Standing, host: str, now: float) -> tuple[bool, Node | None]:
        most, most_of_host = _MOST[standing]
        alike = [node for node in self._nodes.values() if standing_of(node) is standing and not self.keeps(node)]
        of_host = [node for node in alike if node.host == host]
        for group, limit in ((of_host, most_of_host), (alike, most)):
            if len(group) >= limit:
                longest = min(group, key=lambda node: node.last_sign)
                return (True, longest) if _is_silent(longest, now) else (False, None)
        if len(self._nodes) < MAX_NODES:
            return True, None
        leaver = self._weakest(lambda node: standing_of(node) < standing or _is_silent(node, now))
        return leaver is not None, leaver

    def _weakest(self, may_leave: Callable[[Node], bool]) -> Node | None:
        leavers = [node for node in self._nodes.values() if not self.keeps(node) and may_leave(node)]
        return min(leavers, key=lambda node: (standing_of(node), node.last_sign), default=None)


def _is_silent(node: Node, now: float) -> bool:
    if node.announcement is None:
        return now - node.last_sign > UNANNOUNCED_SILENT_S
    return node.given_up(now)
