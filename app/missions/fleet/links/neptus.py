"""Vehicles that a Neptus console commands: its ConvCAO panel tells where they are and asks where they shall go.

The panel works in steps: it uploads a step, waits for the answer, flies it, and uploads the next one when every vehicle
was within its own 12.5 m. So an upload is the arrival at the places of the last answer. Where nothing can be answered
that is safe the vehicles are told to stay, or the panel would wait for ever. It knows no stop: what is not answered any
more flies its last leg and circles at its end, until someone presses STOP in the panel.
"""

import asyncio
import time
from collections.abc import Coroutine, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from app.missions.fleet.interface import (
    EventSink,
    LinkCapabilities,
    LinkState,
    Position,
    SoundingReport,
    StopReceipt,
    VehicleInfo,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
    WaypointStatus,
)
from app.missions.fleet.links.visiting import VisitedLink, Visitor
from app.missions.safety import travel_depth
from app.missions.settings import NeptusSettings
from imc_bridge.neptus import (
    Area,
    CellPosition,
    CellSounding,
    Conventions,
    GatewaySettings,
    NeptusGateway,
    SessionKeeper,
    StepData,
)

POLLS_STOP_S = 10.0
"""A panel that waits polls ten times a second; one that did not for this long was stopped."""
GATHER_S = 0.3
"""Orders of one step come within a moment; a vehicle without one by then is told to stay."""
STAY_AFTER_S = 10.0
"""A step without any order, since no waypoint is safe, is answered with where the vehicles are."""
TAKEN_WITHIN_S = 5.0
"""The first step starts the mission, which asks its vehicles to follow while that step is still being taken in."""
PRIOR_SPACING_S = 3600.0
"""Between cells of a prior map, which are no track: far enough apart that no move is a jump."""


def gateway_settings(settings: NeptusSettings) -> GatewaySettings:
    """The gateway's settings as the service's describe them."""
    if settings.centre_lat_deg is None or settings.centre_lon_deg is None:
        raise ValueError("the gateway needs centre_lat_deg and centre_lon_deg")
    area = Area(
        settings.centre_lat_deg,
        settings.centre_lon_deg,
        settings.rows,
        settings.cols,
        settings.cell_m,
        settings.max_depth_m,
    )
    return GatewaySettings(
        Conventions(area, settings.bathymeter, settings.samples),
        settings.host,
        settings.ftp_port,
        settings.http_port,
        (settings.passive_ports[0], settings.passive_ports[1]) if settings.passive_ports else None,
        settings.public_address,
        settings.repeat_after_s,
    )


@dataclass
class _Craft(Visitor):
    depth_m: float = 0.0
    """At which the panel sends it, whatever it is told."""
    place: CellPosition | None = None
    published: bool = False
    sent_to: CellPosition | None = None
    """Where the last answer sent it."""
    refused_step: int = 0
    """The panel's step in which it was given an order that is not safe at its depth."""


@dataclass
class _Fleet:
    session: str
    crafts: list[_Craft]
    host: str
    heard_s: float
    """When its last step came, by the wall clock: the panel gives no times."""
    last_s: float
    """When anything was heard of its panel, the event loop's time: the wall clock may be set meanwhile."""
    time_step: int = 0
    pending: int | None = None
    """The step that the panel waits to be answered."""
    superseded: bool = False
    begun: asyncio.Event = field(default_factory=asyncio.Event, repr=False)
    """Set when its first step is taken in."""
    prior: Sequence[tuple[int, int, float]] = ()
    """Cells of a prior map that the mission will hear of when it has begun."""
    timer: asyncio.TimerHandle | None = field(default=None, repr=False)
    stay: asyncio.TimerHandle | None = field(default=None, repr=False)

    @property
    def waits(self) -> bool:
        """Whether the panel waits for an answer."""
        return self.pending is not None

    def still(self) -> None:
        """Forget what was to be answered later."""
        for timer in (self.timer, self.stay):
            if timer is not None:
                timer.cancel()
        self.timer = self.stay = None


class NeptusFleetLink(VisitedLink):
    """Sessions of the gateway as a :class:`app.missions.fleet.interface.FleetLink`."""

    kind = "neptus"
    capabilities = LinkCapabilities(keeps_depth=True, flies_together=True)

    def __init__(self, settings: NeptusSettings, keeper: SessionKeeper) -> None:
        super().__init__(settings.lost_after_s)
        self._settings = settings
        self.gateway = NeptusGateway(gateway_settings(settings), keeper)
        self._fleets: dict[str, _Fleet] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def begin(self, work: Coroutine[Any, Any, None]) -> None:
        """Do something beside, until the link is closed."""
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def start(self, sink: EventSink) -> None:
        """Bind both ports and answer. Raises ``imc_bridge.PortInUseError`` when one cannot be had."""
        # A panel may upload as soon as the gateway answers.
        self._sink = sink
        await self.gateway.start()
        self._begin(sink)

    async def close(self) -> None:
        """Answer nothing more, then release the ports."""
        await self._end()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.gateway.close()
        for fleet in self._fleets.values():
            fleet.still()

    def vehicles(self) -> Sequence[VehicleInfo]:
        """Every vehicle of a session since the service started."""
        return [
            VehicleInfo(
                name=craft.name,
                kind=self.kind,
                state=craft.state,
                reason=self._reason(craft.state),
                age_s=_loop_s() - fleet.last_s,
                address=fleet.host,
                report=craft.report,
                details={"session": fleet.session, "time step": str(fleet.time_step)},
            )
            for fleet in self._fleets.values()
            for craft in fleet.crafts
        ]

    async def engage(self, vehicle: str) -> None:
        """Let a vehicle take part in answers. Raises VehicleRefusedError before its session's first step."""
        fleet, craft = self._find(vehicle)
        if craft.state is LinkState.HEARD and craft.place is not None:
            with suppress(TimeoutError):
                await asyncio.wait_for(fleet.begun.wait(), TAKEN_WITHIN_S)
        if craft.state is LinkState.HEARD:
            raise VehicleRefusedError(vehicle, self._reason(craft.state), "it follows with its first step")
        if craft.state is LinkState.LOST:
            raise VehicleRefusedError(vehicle, self._reason(craft.state), "press START in the panel")
        self._set_state(craft, LinkState.ENGAGED)

    async def order(self, order: WaypointOrder) -> None:
        """Lay a waypoint out for the next answer.

        Raises VehicleRefusedError when the depth at which the panel will send it is not safe there; the vehicle is told
        to stay.
        """
        fleet, craft = self._find(order.vehicle)
        if craft.state is not LinkState.ENGAGED:
            raise VehicleRefusedError(order.vehicle, "does not follow this service now", "press START in the panel")
        # Decisions heed it, too; this is the last look before anything is sent.
        if reason := travel_depth.too_deep(craft.depth_m, order.position.depth_m):
            craft.order, craft.published, craft.status = None, False, None
            craft.refused_step = fleet.time_step
            self._publish_soon(fleet)
            raise VehicleRefusedError(
                order.vehicle,
                reason,
                "Make First Depth in the panel smaller, or the area without that place",
            )
        if craft.order != order or craft.status is None:
            craft.order, craft.published = order, False
            self._report(craft, WaypointStatus.SENT)
        else:
            self._report(craft, craft.status)
        self._publish_soon(fleet)

    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopReceipt:
        """Answer nothing more for the vehicle; only the panel's own STOP ends its plan."""
        try:
            fleet, craft = self._find(vehicle)
        except VehicleRefusedError:
            return StopReceipt(vehicle, acknowledged=True, detail="was not following")
        followed = craft.state is LinkState.ENGAGED or craft.order is not None
        craft.order, craft.published, craft.status = None, False, None
        if craft.state is LinkState.ENGAGED:
            self._set_state(craft, LinkState.READY)
        if fleet.superseded:
            return StopReceipt(vehicle, acknowledged=True, detail="its panel has begun another session")
        if not followed:
            return StopReceipt(vehicle, acknowledged=True, detail="was not following")
        return StopReceipt(
            vehicle,
            acknowledged=False,
            detail="the panel knows no stop from here: it flies its last leg and stays there; press STOP in it",
        )

    # What the panel says, by way of the sessions

    def add(self, session: str, vehicles: Sequence[str], host: str, *, time_step: int = 0) -> None:
        """Take up a session; ``time_step`` of one that was taken up before a restart, and may wait for an answer."""
        depths = [
            self._settings.first_depth_m + index * self._settings.depth_separation_m for index in range(len(vehicles))
        ]
        crafts = [_Craft(name, LinkState.HEARD, depth_m=depth) for name, depth in zip(vehicles, depths, strict=True)]
        fleet = self._fleets[session] = _Fleet(session, crafts, host, time.time(), _loop_s(), time_step)
        if time_step:
            self._await_orders(fleet, time_step)
            for craft in crafts:
                self._set_state(craft, LinkState.READY)

    def sessions_of(self, host: str) -> list[str]:
        """Return the sessions that a host has, those of which nothing will be heard any more left out."""
        return [fleet.session for fleet in self._fleets.values() if fleet.host == host and not fleet.superseded]

    async def until_silent(self, session: str) -> None:
        """Wait until a session's panel must have been stopped: one that waits polls, one whose vehicles fly uploads."""
        fleet = self._fleets[session]
        while True:
            limit_s = min(POLLS_STOP_S, self._lost_after_s) if fleet.waits else self._lost_after_s
            left_s = fleet.last_s + limit_s - _loop_s()
            if left_s <= 0:
                return
            await asyncio.sleep(min(left_s, POLLS_STOP_S))

    def supersede(self, session: str) -> None:
        """Give a session up whose console has begun another one."""
        fleet = self._fleets[session]
        fleet.superseded = True
        fleet.still()
        for craft in fleet.crafts:
            self._set_state(craft, LinkState.LOST)

    def knows(self, session: str) -> bool:
        """Whether a session was taken up in this run."""
        return session in self._fleets

    def locate(self, data: StepData, host: str) -> None:
        """Note where the vehicles are."""
        fleet = self._fleets[data.session]
        fleet.host = host
        now_s = time.time()
        for craft, place in zip(fleet.crafts, data.places, strict=True):
            lat, lon = self.gateway.area.to_geographic(place.row, place.col)
            craft.place = place
            craft.report = VehicleReport(craft.name, now_s, Position(lat, lon, place.depth_m))

    def take(self, data: StepData, *, answered: bool = False) -> None:
        """Tell of a step: what was sounded, where the vehicles are, and that they arrived.

        ``answered``: it came so late that the panel was told to stay meanwhile, and waits for nothing.
        """
        fleet = self._fleets[data.session]
        now_s, since_s = time.time(), fleet.heard_s
        for sounding in self._prior_soundings(fleet):
            self._sink(sounding)
        for sounding in self._soundings(fleet, data.soundings, since_s, now_s):
            self._sink(sounding)
        fleet.heard_s, fleet.last_s, fleet.time_step = now_s, _loop_s(), data.time_step
        if not answered:
            self._await_orders(fleet, data.time_step)
        for craft in fleet.crafts:
            if craft.report is not None:
                self._sink(craft.report)
            if craft.state is not LinkState.ENGAGED:
                # Not before the soundings are in, or the first decision would be made without them.
                self._set_state(craft, LinkState.READY)
        fleet.begun.set()
        for craft in fleet.crafts:
            if craft.order is not None and craft.published and craft.status is not WaypointStatus.REACHED:
                self._report(craft, WaypointStatus.REACHED)
        if any(craft.order is not None and not craft.published for craft in fleet.crafts):
            self._publish_soon(fleet)

    def prior(self, session: str, cells: Sequence[tuple[int, int, float]]) -> None:
        """Keep the known cells of a prior map, values being depths, to be taken in as soundings with the first step."""
        self._fleets[session].prior = cells

    def polled(self, session: str, *, answered: bool) -> None:
        """Note that the panel polled; when it read the answer to its last step, that acknowledges its waypoints."""
        fleet = self._fleets.get(session)
        if fleet is None:
            return
        fleet.last_s = _loop_s()
        for craft in fleet.crafts:
            if craft.state is LinkState.LOST and fleet.time_step and not fleet.superseded:
                self._set_state(craft, LinkState.READY)
        for craft in fleet.crafts if answered else ():
            if craft.published and craft.status is WaypointStatus.SENT:
                self._report(craft, WaypointStatus.ACKNOWLEDGED)

    # Helpers

    def _soundings(
        self, fleet: _Fleet, samples: Sequence[CellSounding], since_s: float, now_s: float
    ) -> list[SoundingReport]:
        """Give the panel's samples, which come in their order, a vehicle and a time of their own."""
        area = self.gateway.area
        reports = []
        for index, sample in enumerate(samples):
            craft = fleet.crafts[sample.vehicle if sample.vehicle is not None else 0]
            lat, lon = area.to_geographic(sample.row, sample.col)
            reports.append(
                SoundingReport(
                    vehicle=craft.name,
                    time_s=since_s + (now_s - since_s) * (index + 1) / (len(samples) + 1),
                    footprint=Position(lat, lon, sample.bottom_depth_m),
                    vehicle_depth_m=sample.vehicle_depth_m,
                    range_m=sample.bottom_depth_m - sample.vehicle_depth_m,
                    source=sample.source,
                    depth_sd_m=sample.depth_sd_m,
                )
            )
        return reports

    def _prior_soundings(self, fleet: _Fleet) -> list[SoundingReport]:
        cells, fleet.prior = fleet.prior, ()
        begin_s = fleet.heard_s - PRIOR_SPACING_S * (len(cells) + 1)
        places = [self.gateway.area.to_geographic(row, col) for row, col, _ in cells]
        return [
            SoundingReport(
                vehicle=fleet.crafts[0].name,
                time_s=begin_s + index * PRIOR_SPACING_S,
                footprint=Position(lat, lon, depth_m),
                vehicle_depth_m=0.0,
                range_m=depth_m,
                source="neptus prior map",
                depth_sd_m=self._settings.prior_map_sd_m,
            )
            for index, ((lat, lon), (_, _, depth_m)) in enumerate(zip(places, cells, strict=True))
        ]

    def _await_orders(self, fleet: _Fleet, time_step: int) -> None:
        """Note that the panel waits for an answer, and see to it that one comes."""
        fleet.pending = time_step
        if fleet.stay is not None:
            fleet.stay.cancel()
        fleet.stay = asyncio.get_running_loop().call_later(STAY_AFTER_S, self._stay, fleet)

    def _stay(self, fleet: _Fleet) -> None:
        """Answer a step that nobody gave orders for; not while the mission is paused or over."""
        fleet.stay = None
        if fleet.pending is None:
            return
        if any(craft.state is LinkState.ENGAGED for craft in fleet.crafts):
            self._publish(fleet)
        else:
            fleet.stay = asyncio.get_running_loop().call_later(STAY_AFTER_S, self._stay, fleet)

    def _publish_soon(self, fleet: _Fleet) -> None:
        if fleet.pending is None:
            return
        engaged = [craft for craft in fleet.crafts if craft.state is LinkState.ENGAGED]
        decided = [
            (craft.order is not None and not craft.published) or craft.refused_step == fleet.pending
            for craft in engaged
        ]
        if len(engaged) == len(fleet.crafts) and all(decided):
            self._publish(fleet)
        elif fleet.timer is None:
            fleet.timer = asyncio.get_running_loop().call_later(GATHER_S, self._publish, fleet)

    def _publish(self, fleet: _Fleet) -> None:
        """Answer the panel's step: who has no order stays where the last answer sent it, or where it is."""
        if fleet.timer is not None:
            fleet.timer.cancel()
            fleet.timer = None
        if fleet.pending is None:
            return
        places: list[CellPosition] = []
        for craft in fleet.crafts:
            if craft.order is not None:
                position = craft.order.position
                place: CellPosition | None = CellPosition(
                    *self.gateway.area.to_cells(position.lat_deg, position.lon_deg), position.depth_m
                )
            else:
                place = craft.sent_to or craft.place
            if place is not None:
                places.append(place)
        if len(places) < len(fleet.crafts):
            # Of an earlier run of the service, and nothing was heard since: without places all stay where they are.
            places = []
        else:
            for craft, place in zip(fleet.crafts, places, strict=True):
                craft.sent_to, craft.published = place, craft.order is not None
        self.gateway.answer(fleet.session, fleet.pending, places)
        fleet.pending = None
        fleet.still()

    def _find(self, vehicle: str) -> tuple[_Fleet, _Craft]:
        for fleet in self._fleets.values():
            for craft in fleet.crafts:
                if craft.name == vehicle:
                    return fleet, craft
        raise VehicleRefusedError(vehicle, "its session is not known", "wait for the panel's next upload")

    def _reason(self, state: LinkState) -> str:
        if state is LinkState.LOST:
            return f"its panel was silent for more than {self._settings.lost_after_s:g} s, or began another session"
        return "connected; no step yet: press START in the panel" if state is LinkState.HEARD else ""

    def _silent(self) -> Iterable[Visitor]:
        limit_s = _loop_s() - self._lost_after_s
        return [craft for fleet in self._fleets.values() if fleet.last_s < limit_s for craft in fleet.crafts]


def _loop_s() -> float:
    return asyncio.get_running_loop().time()
