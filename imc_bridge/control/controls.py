"""The vehicles under control: how each is led, over which link, and at which rates it reports."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from functools import partial

from imc_bridge.control.acoustics import SoundPath
from imc_bridge.control.control import Control, Phase
from imc_bridge.control.follow import Follower
from imc_bridge.control.legs import LegFollower
from imc_bridge.control.rates import RateRequest
from imc_bridge.control.seabed import Seabed
from imc_bridge.control.way_home import WayHome
from imc_bridge.events import Guidance, RefusedError, WaypointChange
from imc_bridge.network.codec import Message
from imc_bridge.nodes.node import Node
from imc_bridge.nodes.registry import NodeRegistry
from imc_bridge.settings import BridgeSettings


class Controls:
    """How every vehicle is led: one control each, with its rates and its way home.

    Parameters
    ----------
    settings
    send
        Sends a message to a node.
    tell
        Receives what becomes of waypoints.
    wall_clock
        Unix seconds.
    """

    def __init__(
        self,
        settings: BridgeSettings,
        send: Callable[[Node, Message], None],
        tell: Callable[[WaypointChange], None],
        wall_clock: Callable[[], float],
    ) -> None:
        self._settings = settings
        self._send = send
        self._tell = tell
        self._wall_clock = wall_clock
        self._seabed = Seabed()
        self._controls: dict[int, Control] = {}
        self._guidance: dict[int, Guidance] = {}
        self._rates: dict[int, RateRequest] = {}
        self._ways_home: dict[int, WayHome] = {}
        # Replies to an earlier run's requests must not be taken for replies to ours.
        self._request_ids = itertools.count(int(time.time() * 10.0))

    def __iter__(self) -> Iterator[Control]:
        """Every control there is."""
        return iter(list(self._controls.values()))

    def get(self, node: Node) -> Control | None:
        """The control of a node, None for one that is no vehicle."""
        return self._controls.get(node.imc_id)

    def engaged(self, node: Node) -> bool:
        """Whether a node is a vehicle of ours."""
        control = self.get(node)
        return control is not None and control.engaged

    def works_with(self, node: Node) -> bool:
        """Whether a node is led, is being stopped, or has rates to be restored."""
        control, rates = self.get(node), self.asked_rates(node)
        busy = control is not None and (control.engaged or control.phase is Phase.STOPPING)
        way_home = self.way_home(node)
        busy = busy or (way_home is not None and way_home.wanted)
        return busy or (rates is not None and rates.restoring)

    def forget(self, node: Node) -> None:
        """Keep nothing of a node that has lost its place."""
        for kept in (self._controls, self._guidance, self._rates, self._ways_home):
            kept.pop(node.imc_id, None)

    def asked_rates(self, node: Node) -> RateRequest | None:
        """What was asked of a vehicle's rates, None for nothing."""
        return self._rates.get(node.imc_id)

    def rates_text(self, node: Node) -> str:
        """A vehicle's rates in words."""
        rates = self.asked_rates(node)
        return rates.text if rates is not None else "as the vehicle has them"

    def way_home(self, node: Node) -> WayHome | None:
        """The way home that a vehicle was given, None for none."""
        return self._ways_home.get(node.imc_id)

    def way_home_of(self, node: Node) -> WayHome:
        """The way home of a vehicle, made when it is first asked for."""
        way = self.way_home(node)
        if way is None:
            way = self._ways_home[node.imc_id] = WayHome(
                node, self._settings, partial(self._send, node), self._request_ids
            )
        return way

    def restore_rates(self) -> None:
        """Give every vehicle its own rates back at once."""
        for rates in self._rates.values():
            rates.restore_now()

    def tick(self, node: Node, now: float) -> None:
        """Do what is due for one vehicle."""
        control, rates = self.get(node), self.asked_rates(node)
        if control is not None:
            control.tick(now)
        way_home = self.way_home(node)
        if way_home is not None:
            way_home.tick(now)
        if rates is not None and rates.restoring:
            rates.tick(now)
        elif rates is not None and rates.pending and self.engaged(node):
            rates.observed(node.rates.rates_hz(now).get("EstimatedState", 0.0))
            rates.tick(now)

    def guide(self, node: Node, guidance: Guidance) -> None:
        """Change how a vehicle is led, unless it is being led or stopped now."""
        control = self._controls.get(node.imc_id)
        if self._guidance.get(node.imc_id, Guidance.FOLLOW) is guidance:
            return
        if control is None or not (control.engaged or control.phase is Phase.STOPPING):
            self._guidance[node.imc_id] = guidance
            self._controls.pop(node.imc_id, None)

    def attach_sound(self, node: Node, gateway: str, registry: NodeRegistry, now: Callable[[], float]) -> None:
        """Reach a vehicle through a gateway when radio is silent. Raises RefusedError for an unknown gateway."""
        control = self.of(node)
        via = registry.named(gateway)
        if via is None or via.address is None:
            known = ", ".join(other.name for other in registry if not other.is_vehicle) or "none"
            raise RefusedError(
                node.name,
                f"its acoustic gateway {gateway!r} was never heard of (other nodes: {known})",
                "Switch the gateway on, or name another one",
            )
        if isinstance(control, LegFollower) and (control.sound is None or control.sound.gateway != gateway):
            control.attach(
                SoundPath(
                    node.name,
                    gateway,
                    lambda message: self._send(via, message),
                    lambda: next(self._request_ids) & 0xFFFF,
                    lambda: self._wall_clock() + (via.clock.offset_s or 0.0),
                ),
                lambda message: self._send(node, message),
                now,
            )

    def by_sound_through(self, gateway: Node) -> Iterator[LegFollower]:
        """The vehicles reached through a gateway."""
        for control in self._controls.values():
            if isinstance(control, LegFollower) and control.sound and control.sound.gateway == gateway.name:
                yield control

    def of(self, node: Node) -> Control:
        """The control of a vehicle, made when it is first asked for."""
        control = self._controls.get(node.imc_id)
        if control is None:
            kind = Follower if self._guidance.get(node.imc_id, Guidance.FOLLOW) is Guidance.FOLLOW else LegFollower
            control = self._controls[node.imc_id] = kind(
                node,
                self._settings,
                lambda message: self._send(node, message),
                self._tell,
                self._request_ids,
                self._seabed,
            )
        return control

    def rates_of(self, node: Node) -> RateRequest:
        """What is asked of a vehicle's rates."""
        request = self._rates.get(node.imc_id)
        if request is None:
            request = self._rates[node.imc_id] = RateRequest(
                self._settings.rate_limiters, lambda message: self._send(node, message)
            )
        return request
