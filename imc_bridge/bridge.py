"""The console: sockets, nodes and vehicles under control put together behind one small class."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from imc_bridge.control.control import Phase
from imc_bridge.control.controls import Controls
from imc_bridge.control.depth_layers import ALONE, DepthLayer
from imc_bridge.control.way_home import MOST_PLACES, guarded
from imc_bridge.events import (
    BridgeEvent,
    EventCallback,
    Guidance,
    NodeState,
    NodeView,
    PacketsDropped,
    RefusedError,
    StopResult,
    Waypoint,
)
from imc_bridge.links import Links
from imc_bridge.network.drops import DropMeter
from imc_bridge.network.transport import Address, Transport
from imc_bridge.nodes.node import Node
from imc_bridge.nodes.registry import NodeRegistry
from imc_bridge.nodes.status import status_of
from imc_bridge.receiver import Receiver
from imc_bridge.sender import Sender
from imc_bridge.settings import BridgeSettings
from imc_bridge.views import view_of

log = logging.getLogger(__name__)

TICK_S = 0.2
MIN_TICK_WALL_S = 0.02
STOP_ESCALATION = 0.5
"""Share of a stop's patience after which Abort is sent too."""
SILENT_STOP_WALL_S = 0.5
"""So long at the most a vehicle that is silent is waited for when it is stopped."""
CLOSE_TIMEOUT_WALL_S = 3.0
HELD_UP_WALL_S = 0.4
"""A tick that is later than this shows that we were held up ourselves."""
WORTH_TELLING_WALL_S = 2.0
LONGEST_GRACE_WALL_S = 60.0
GRACE_GROWTH = 0.5
"""On a machine that is always late at most this share of time is excused, or no wait would ever end."""


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
        self.handler_errors: Counter[str] = Counter()
        self._commanding = commanding
        self._clock = clock
        self._wall_clock = wall_clock
        self._on_event: EventCallback = lambda _event: None
        self._registry = NodeRegistry(settings)
        self.transport = Transport(settings, self.on_packet, self.on_announce)
        self._sender = Sender(settings, self.transport, self._registry, commanding=commanding, wall_clock=wall_clock)
        self._controls = Controls(settings, self._sender.send, self._tell, wall_clock)
        self._links = Links(self._tell, wall_clock)
        self._receiver = Receiver(
            settings,
            self._registry,
            self._controls,
            self._links,
            self._tell,
            self._note_error,
            clock,
            wall_clock,
            self._sender,
        )
        self._registry.capacity.in_use = self._controls.works_with
        self._registry.left += [self._controls.forget, self._links.forget, self._receiver.forget]
        self.board = self._sender.board
        """What other consoles are shown."""
        self.decoder, self.announces = self._receiver.decoder, self._receiver.announces
        """Count what arrived at the traffic and at the announce socket."""
        self.admission = self._receiver.admission
        """Counts what was refused, and why."""
        self.drops = DropMeter(self.transport.dropped)
        """Counts what this machine threw away before we could read it."""
        self._task: asyncio.Task[None] | None = None
        self._started_at: float | None = None
        self._has_led = False
        """Whether it was to lead a vehicle: one that was not gives way to another system under its id."""
        self._turn = asyncio.Event()
        self._tick_wall_s = max(TICK_S / settings.time_scale, MIN_TICK_WALL_S)

    # Life

    def listen(self, on_event: EventCallback) -> None:
        """Send events to ``on_event`` without opening sockets, as a replay does."""
        self._on_event = on_event

    async def start(self, on_event: EventCallback) -> None:
        """Bind the ports, announce and listen; events go to ``on_event`` from the event loop's thread.

        Raises
        ------
        imc_bridge.network.transport.PortInUseError
            When a port belongs to another program.
        ValueError
            When a configured interface is absent.
        """
        if self._task is not None:
            raise RuntimeError("this bridge has been started already")
        self._on_event = on_event
        self.transport.open()
        self._started_at = self._clock()
        self._sender.begin(self._now())
        self._task = asyncio.create_task(self._run(), name="imc-bridge")

    @property
    def listening_s(self) -> float:
        """For how long it has been started, seconds of the wall clock."""
        return 0.0 if self._started_at is None else self._clock() - self._started_at

    async def close(self) -> None:
        """Stop every engaged vehicle, restore rates, release the ports; safe to repeat."""
        if self._task is None:
            return
        busy = [control.node for control in self._controls if control.engaged or control.phase is Phase.STOPPING]
        # Nobody leads them from here on: their ways home stay armed.
        await asyncio.gather(*(self._stop(node, CLOSE_TIMEOUT_WALL_S) for node in busy))
        self._controls.restore_rates()
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

    # Packets

    def know_peers(self, imc_ids: Iterable[int]) -> None:
        """Learn the ids of services that share their missions with us: their plans, too, are ended for ours.

        Only where one of our missions needs the vehicle, and by an explicit stop.
        """
        self._registry.peers |= set(imc_ids) - {self.settings.id}

    @property
    def double(self) -> str:
        """Another system that announces our own id, while it does; usually empty."""
        return self._receiver.double

    def on_packet(self, packet: bytes, address: Address) -> None:
        """Take a packet of the traffic socket; also the way to replay a recording."""
        self._receiver.on_packet(packet, address)

    def on_announce(self, packet: bytes, address: Address) -> None:
        """Take a packet of the announce socket; also the way to replay a recording."""
        self._receiver.on_announce(packet, address)

    # What the user asks

    def nodes(self, name: str | None = None) -> tuple[NodeView, ...]:
        """Every known node, by id; with a name only those that are called so."""
        now = self._now()
        return tuple(
            view_of(
                node,
                now,
                self.settings.time_scale,
                engaged=self._controls.engaged(node),
                history=self._links.history(node),
                rate_limiters=self._controls.rates_text(node),
                way_home=way_home.text if (way_home := self._controls.way_home(node)) is not None else "",
            )
            for node in self._registry
            if name is None or node.name == name
        )

    def want(self, vehicle: str) -> None:
        """Reserve a place for a vehicle of this name, however many other systems announce themselves."""
        self._registry.capacity.wanted.add(vehicle)

    def position_rad(self) -> tuple[float, float]:
        """The place that we announce as ours."""
        return self._sender.position_rad()

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
        node = self._commanded(vehicle)
        self.want(vehicle)
        self._controls.guide(node, guidance)
        control = self._controls.of(node)
        if self.double and not control.engaged:
            reason = f"our IMC id 0x{self.settings.id:04X} is announced by {self.double}, too"
            raise RefusedError(vehicle, reason, "Stop that service, or give one of the two another `imc.id`")
        if guidance is Guidance.ACOUSTIC:
            self._controls.attach_sound(node, gateway, self._registry, self._now)
        self._has_led = True
        if not control.engaged and control.engage(self._now()):
            self._controls.rates_of(node).begin()
            way_home = self._controls.way_home(node)
            if way_home is not None:
                way_home.engaged()
        while control.engaged and control.phase is not Phase.FOLLOWING:
            await self._turn.wait()
        if not control.engaged:
            refusal = control.refusal
            reason = refusal.reason if refusal else "stopped while it was being engaged"
            raise RefusedError(vehicle, reason, refusal.remedy if refusal else "Engage it again")

    def _commanded(self, vehicle: str) -> Node:
        """Return a vehicle that may be commanded. Raises RefusedError."""
        if not self._commanding:
            raise RefusedError(vehicle, "this bridge only listens", "Use one that may command")
        node = self._registry.named(vehicle)
        if node is None:
            known = ", ".join(n.name for n in self._registry if n.is_vehicle) or "none"
            raise RefusedError(vehicle, f"never heard of (known: {known})", "Switch it on; see `bathyfleet doctor`")
        return node

    async def keep_way_home(self, vehicle: str, way: Sequence[Waypoint], layer: DepthLayer = ALONE) -> None:
        """Store a way home on board, in place of the former one; return when the vehicle confirms it.

        The vehicle's own supervisor starts it when no console was heard for minutes after a plan that failed. It is
        armed while the vehicle is ours or lost: a stop disarms it, engaging the vehicle arms it again. Where the bottom
        leaves less room than the way asks for its depth follows from ``layer``.

        Raises
        ------
        RefusedError
            When it is not confirmed; it is sent again when the vehicle answers, unless it has nothing to start it with.
        """
        node = self._commanded(vehicle)
        if not 0 < len(way) <= MOST_PLACES:
            raise RefusedError(vehicle, f"its way home has {len(way)} places", f"Give it 1 to {MOST_PLACES}")
        self._controls.way_home_of(node).keep(guarded(way, self._controls.of(node).guard, node, self._now(), layer))
        await self._confirmed(node)

    async def drop_way_home(self, vehicle: str) -> None:
        """Leave no way home on board; raises RefusedError when that is not confirmed."""
        node = self._commanded(vehicle)
        self._controls.way_home_of(node).drop()
        await self._confirmed(node)

    async def _confirmed(self, node: Node) -> None:
        way_home = self._controls.way_home_of(node)
        while way_home.busy:
            if not self._sender.talks_to(node):
                raise RefusedError(node.name, "we do not talk to it", "See `imc.vehicles` in the settings")
            await self._turn.wait()
        if way_home.refusal is not None:
            raise RefusedError(node.name, way_home.refusal.reason, way_home.refusal.remedy)

    def intervention(self, vehicle: str) -> str:
        """Return why a vehicle left us of its own or another console's will, until :meth:`stop` is called; else ''."""
        node = self._registry.named(vehicle)
        return self._controls.of(node).intervention if node is not None and self._commanding else ""

    def goto(self, vehicle: str, waypoint: Waypoint) -> None:
        """Replace the vehicle's waypoint; its progress is reported by events.

        Raises
        ------
        RefusedError
            When the vehicle is not engaged.
        """
        node = self._registry.named(vehicle)
        control = self._controls.get(node) if node is not None else None
        if control is None or not control.engaged:
            refusal = control.refusal if control is not None else None
            raise RefusedError(
                vehicle,
                f"not engaged: {refusal.reason}" if refusal else "not engaged",
                refusal.remedy if refusal else "Engage it first",
            )
        control.order(waypoint, self._now())

    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopResult:
        """Make the vehicle stop following; wait at most ``timeout_s`` (wall clock) for its acknowledgement.

        A plan of another console is left alone. Half-way through the patience Abort is sent as well. When nothing is
        acknowledged the references have ceased all the same, which ends the plan on board within seconds, and STOP
        goes on being sent whenever the vehicle shows up in our plan.
        """
        node = self._registry.named(vehicle)
        if node is None:
            return StopResult(vehicle, False, "never heard of")
        if not self._commanding:
            return StopResult(vehicle, False, "this bridge only listens")
        way_home = self._controls.way_home(node)
        if way_home is not None:
            way_home.stopped()
        return await self._stop(node, timeout_s)

    async def _stop(self, node: Node, timeout_s: float) -> StopResult:
        vehicle, control = node.name, self._controls.of(node)
        if status_of(node, self._now()).state in (NodeState.LOST, NodeState.EXPECTED_OFFLINE):
            # It is out of reach, and is stopped when its packets arrive again.
            timeout_s = min(timeout_s, SILENT_STOP_WALL_S)
        control.begin_stop(self._now())
        begun = self._clock()
        while control.phase is Phase.STOPPING:
            waited = self._clock() - begun
            if waited >= timeout_s:
                control.give_up_stop(self._now())
                reason = status_of(node, self._now()).reason
                return StopResult(
                    vehicle,
                    False,
                    f"no acknowledgement within {timeout_s:g} s{f' ({reason})' if reason else ''}; "
                    f"{control.unheard_stop}",
                )
            if waited >= STOP_ESCALATION * timeout_s:
                control.escalate_stop()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._turn.wait(), timeout_s - waited)
        if control.engaged:
            return StopResult(vehicle, False, "engaged again while it was being stopped")
        self._controls.rates_of(node).restore()
        self._links.check(node, control, self._now())
        return StopResult(vehicle, True, control.stop_detail or "stopped")

    # Time

    def wall_time_s(self) -> float:
        """Unix seconds of this machine."""
        return self._wall_clock()

    def _now(self) -> float:
        """Seconds of the vehicles' clock rate: every period and timeout is measured in these."""
        return self._clock() * self.settings.time_scale

    async def _run(self) -> None:
        last, grace = self._clock(), LONGEST_GRACE_WALL_S
        while True:
            last, held_up = self._clock(), self._clock() - last - self._tick_wall_s
            grace = min(grace + GRACE_GROWTH * max(held_up, self._tick_wall_s), LONGEST_GRACE_WALL_S)
            if held_up > HELD_UP_WALL_S:
                excused = min(held_up, grace)
                grace -= excused
                self._excuse(excused * self.settings.time_scale)
            self.pass_time()
            turn, self._turn = self._turn, asyncio.Event()
            turn.set()
            await asyncio.sleep(self._tick_wall_s)

    def _excuse(self, seconds: float) -> None:
        """Count no silence that this process or its machine caused by being busy."""
        now = self._now()
        if seconds > WORTH_TELLING_WALL_S * self.settings.time_scale:
            log.warning("The IMC bridge was held up for %.1f s", seconds / self.settings.time_scale)
        for node in self._registry:
            node.excuse(seconds, now)
        for control in self._controls:
            control.excuse(seconds, now)

    def pass_time(self) -> None:
        """Do whatever is due by now; runs by itself in a started bridge, a replay calls it after every packet."""
        try:
            self._tick(self._now())
        except Exception as error:
            self._note_error(error)

    def _tick(self, now: float) -> None:
        self._sender.quiet = bool(self.double) and not self._has_led
        self._sender.tick(now)
        lost = self.drops.look(self._clock())
        if lost:
            self._tell(PacketsDropped(lost))
        for node in self._registry:
            if node.is_vehicle and self._sender.talks_to(node):
                self._alone(partial(self._controls.tick, node, now))
        self._registry.pass_time(now)
        for node in self._registry:
            self._alone(partial(self._links.check, node, self._controls.get(node), now))

    def _alone(self, work: Callable[[], None]) -> None:
        """Do what concerns one vehicle: whatever goes wrong in it keeps the others' references from no tick."""
        try:
            work()
        except Exception as error:
            self._note_error(error)

    # Telling the user

    def _note_error(self, error: Exception) -> None:
        self.handler_errors[type(error).__name__] += 1
        log.error("An event of the IMC bridge failed", exc_info=error)

    def _tell(self, event: BridgeEvent) -> None:
        try:
            self._on_event(event)
        except Exception as error:
            self._note_error(error)
