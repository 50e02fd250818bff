"""What an operator orders vehicles to do in the middle of a mission: taken down, carried out, and told.

An order is stored before it is accepted. The flight takes it up between two decisions: it gives up the legs that the
vehicle has, and lets :class:`.OrderedPlanner` propose others, which are checked and committed like any. How far it has
come is part of the planner's memory, in the transaction of the legs; what is stored with the order itself only tells.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace

import numpy as np
from shapely import LineString, Point
from shapely.geometry.base import BaseGeometry

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.lines.flown_lines import flown_lines, length_m, line_now
from app.exploration.planner.ordered import OrderedPlanner
from app.missions import states
from app.missions.clock import now
from app.missions.errors import ConflictError
from app.missions.fleet.interface import WaypointStatus
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.live.mission import LiveMission
from app.missions.spec.failsafes import Response
from app.missions.spec.orders import OPEN, OrderKind, OrderState
from app.missions.states import ENDED, MissionState
from app.missions.team import Member, OperatorOrder
from app.missions.views.mission import Level
from app.missions.views.orders import OrderView
from app.storage.models import VehicleOrderRow
from app.storage.queries import orders as order_queries

LEGS_SEEN = 400
"""At most so many of a vehicle's last legs are looked at for its lines."""

THERE_M = 1.0
"""A leg that ends so near the end of an order's way is its last."""

INSIDE_M = 1e-3

Find = Callable[[Member, "OrderedFlight"], Awaitable[FloatArray]]
"""Returns the corners (k, 2) of an order's way for a vehicle; raises what speaks against it."""


@dataclass(frozen=True)
class OrderedFlight:
    """What carries orders out, and what they are checked by."""

    planner: OrderedPlanner
    constraints: Constraints
    energy_range: EnergyRange
    dispatch: Dispatch
    apart: bool
    """Whether vehicles have legs of their own."""


class OrderBook:
    """The orders of one mission; its vehicles hold those that are not over."""

    def __init__(self, live: LiveMission) -> None:
        self._live = live
        self._taking = asyncio.Lock()
        self._flight: OrderedFlight | None = None
        self._skipped_at: dict[str, int] = {}
        """Number of a vehicle's last leg when it was to leave out its line."""

    # Taking orders down

    async def accept(self, names: list[str], kind: OrderKind, find: Find, actor: str, words: str) -> OrderView:
        """Take an order down for the first of some vehicles that can carry it out; ``words`` say what it does then.

        Raises
        ------
        VehicleNotFoundError, ConflictError, InvalidRequestError
            Why the first of them cannot.
        """
        async with self._taking:
            refusal: Exception | None = None
            for name in names:
                try:
                    return await self._accept(name, kind, find, actor, words)
                except ConflictError as error:
                    refusal = refusal or error
            raise refusal or ConflictError("no vehicle surveys", "resume one, or add one")

    async def _accept(self, name: str, kind: OrderKind, find: Find, actor: str, words: str) -> OrderView:
        live = self._live
        member, flight = self.able(name)
        corners = await find(member, flight)
        if kind is not OrderKind.SKIP_LINE:
            await self._check(member, flight, kind, corners)
        if self.able(name)[0] is not member:
            raise ConflictError(f"vehicle {name!r} left meanwhile", "choose another vehicle")
        at = now()
        row = VehicleOrderRow(
            mission_id=live.id,
            vehicle=name,
            kind=kind,
            state=OrderState.ACCEPTED,
            way={"corners": self._lon_lat(corners)},
            asked_by=actor,
            asked_at=at,
            changed_at=at,
            reason="",
        )
        async with live.database.writing() as session:
            await order_queries.end_all(
                session, live.id, name, OPEN, OrderState.REPLACED, f"{actor} ordered something else", at
            )
            session.add(row)
        member.asked = OperatorOrder(row.id, kind, OrderState.ACCEPTED, corners, actor, at)
        said = f"{name} {words}: ordered by {actor}"
        await live.journal.log(Level.INFO, "order", said, vehicle=name, actor=actor, order=row.id)
        live.changed.set()
        live.publish_summary()
        return order_view(row)

    def able(self, name: str) -> tuple[Member, OrderedFlight]:
        """Return a vehicle that can take orders, and its flight. Raises VehicleNotFoundError, ConflictError."""
        live = self._live
        member = live.team.named(name)
        if live.header.state is not MissionState.RUNNING:
            raise ConflictError(f"the mission is {live.header.state}: nobody is led", states.remedy(live.header.state))
        live.refuse_ending()
        if self._flight is None:
            raise ConflictError("the flight is just beginning", "try again in a moment")
        if not self._flight.apart:
            raise ConflictError(
                "the vehicles of this mission move as one team, a step at a time: none can be sent elsewhere alone",
                "hold it, or bring it home",
            )
        if member.withdrawal is not None:
            raise ConflictError(f"vehicle {name!r} surveys no more: {member.withdrawal.why}", "resume its survey first")
        if not member.controllable:
            raise ConflictError(f"vehicle {name!r} cannot be reached now", "wait until it is heard, or abort it")
        return member, self._flight

    async def _check(self, member: Member, flight: OrderedFlight, kind: OrderKind, corners: FloatArray) -> None:
        """Raise ConflictError where an order's way cannot be flown by what is known now."""
        live, spec, name = self._live, self._live.spec, member.name
        start = self.start_m(member, kind)

        def find_way() -> tuple[FloatArray, FloatArray, bool]:
            space = FreeSpace(flight.constraints, 0.0)
            here = space.nearest(start)
            way = space.connect(here, corners)
            whole = np.vstack([here, way])
            return here, way, bool(space.region.buffer(INSIDE_M).covers(LineString(whole)))

        here, way, is_free = await live.in_thread(find_way)
        if not is_free:
            raise ConflictError(
                f"no way leads {name!r} there inside the area and clear of the keep-out zones", "choose another place"
            )
        whole = np.vstack([start, here, way])
        needs_m, left_m = length_m(whole), member.way_left_m(spec)
        if spec.budget.steps is not None:
            # A leg ends at every corner, however short that makes it.
            legs = np.ceil(np.hypot(*np.diff(whole, axis=0).T) / spec.limits.max_step_m - 1e-9).sum()
            needs_m = max(needs_m, float(legs) * spec.limits.max_step_m)
        if needs_m > left_m:
            raise ConflictError(
                f"that takes {needs_m:.0f} m of {name!r}, and {max(left_m, 0.0):.0f} m are left of its way",
                "choose a smaller part or lines farther apart, another vehicle, or bring it home",
            )
        if not flight.energy_range.lasts_for(member, here, way):
            raise ConflictError(
                f"the energy of {name!r} does not last for {needs_m:.0f} m and its way home from there",
                "choose a place nearer to its recovery point, or another vehicle",
            )

    def start_m(self, member: Member, kind: OrderKind) -> FloatArray:
        """Return where an order's way begins, (2,): where its vehicle is, or where its legs end if these are flown."""
        frame = self._live.frame
        return member.last_end_m(frame) if kind is OrderKind.DENSER else member.place_m(frame)

    async def lines(self, member: Member) -> list[FloatArray]:
        """Return the lines that a vehicle has flown, each (k, 2), the one that it is on to where it is now."""
        flight = self._flight
        upto = member.order.step if member.ordered and member.order is not None else member.legs
        async with self._live.database.reading() as session:
            ends = await order_queries.last_legs(session, self._live.id, member.name, upto, LEGS_SEEN)
        places = np.array([place for number, *place in ends]).reshape(-1, 2)
        if member.ordered and ends and ends[-1][0] == upto:
            here_m = member.place_m(self._live.frame)
            # It may have swung out of the area, where nobody can be ordered.
            places[-1] = here_m if flight is None else FreeSpace(flight.constraints, 0.0).nearest(here_m)
        if len(ends) == 1 and member.leg.start_m is not None:
            places = np.vstack([member.leg.start_m, places])
        return flown_lines(places)

    async def cancel(self, member: Member, actor: str) -> bool:
        """Let a vehicle go on with its part, whatever it was ordered; returns whether it was ordered anything."""
        live = self._live
        async with self._taking:
            if member.asked is None:
                return False
            words = f"{member.name} goes on with its part: {actor} ended its order"
            async with live.database.writing() as session:
                await order_queries.end_all(
                    session, live.id, member.name, OPEN, OrderState.CANCELLED, f"ended by {actor}", now()
                )
            member.asked = None
        await live.journal.log(Level.INFO, "order", words, vehicle=member.name, actor=actor)
        live.changed.set()
        live.publish_summary()
        return True

    # Carrying them out

    async def begin(self, flight: OrderedFlight) -> None:
        """Take up the orders that are stored, for a flight whose planner has its memory."""
        live, planner = self._live, flight.planner
        async with live.database.reading() as session:
            rows = await order_queries.in_states(session, live.id, OPEN)
            done = await order_queries.in_states(session, live.id, [OrderState.DONE])
        self._skipped_at = {}
        for row in done:
            if planner.is_ordered(row.vehicle) and planner.taken.get(row.vehicle) == row.id:
                # Its memory is as old as the last leg; the legs that are left lead on with the vehicle's own part.
                planner.drop(row.vehicle)
        for member in live.team:
            member.asked = None
        for row in rows:
            ordered = live.team.get(row.vehicle)
            if ordered is not None:
                taken = planner.taken.get(row.vehicle, 0) >= row.id
                state = OrderState.FLYING if taken else OrderState.ACCEPTED
                corners = self._local(row.way["corners"])
                ordered.asked = OperatorOrder(row.id, OrderKind(row.kind), state, corners, row.asked_by, row.asked_at)
        self._flight = flight

    def end(self) -> None:
        """Take no more orders until the next flight."""
        self._flight = None

    def leave(self, member: Member) -> None:
        """Give up the legs of a vehicle that is taken out of its mission: others go on with its line."""
        if self._flight is not None and member.withdrawal is None:
            self._flight.dispatch.leave_line(member, "it left the mission")

    def _has_given_up(self, member: Member) -> bool:
        """Whether a vehicle gave legs of its order up that were not looked at yet."""
        return self._flight is not None and self._flight.dispatch.unflown.has_of_order(member.name)

    @property
    def waiting(self) -> bool:
        """Whether an order waits to be taken up, or to be given up."""
        flight = self._flight
        if flight is None:
            return False
        return any(
            flight.dispatch.unflown.waits(m.name)
            or (m.asked is None and flight.planner.is_ordered(m.name))
            or (m.asked is not None and m.asked.state is OrderState.ACCEPTED and m.plannable)
            for m in self._live.team
        )

    async def look(self) -> list[str]:
        """Take up what was ordered, and see what is over; no decision is being made meanwhile.

        Returns the vehicles that need other legs now.
        """
        flight, taken = self._flight, []
        if flight is None or not flight.apart:
            return []
        planner, unflown = flight.planner, flight.dispatch.unflown
        for name, ends_m in unflown.take_of_orders():
            planner.lose(name, ends_m)
        for name, ends_m in unflown.take_barred():
            planner.go_round(name, ends_m)
            taken.append(name)
        for member in [*self._live.team, *self._live.team.departed.values()]:
            order = member.asked
            if order is None:
                if planner.is_ordered(member.name):
                    planner.drop(member.name)
                    flight.dispatch.give_up_legs(member, "its order was ended")
            elif member.left_at is not None or (
                member.withdrawal is not None and member.withdrawal.response is not Response.HOLD
            ):
                planner.drop(member.name)
                why = "it left the mission" if member.withdrawal is None else member.withdrawal.why
                await self._over(member, order, OrderState.CANCELLED, why)
            elif order.state is OrderState.ACCEPTED:
                if member.plannable:
                    await self._take(member, order, flight)
                    taken.append(member.name)
            else:
                await self._see(member, order, planner)
        return taken

    async def _take(self, member: Member, order: OperatorOrder, flight: OrderedFlight) -> None:
        """Give up the legs that a vehicle has and lead it where it was ordered; nothing is decided before this ends."""
        planner, name, here_m = flight.planner, member.name, member.place_m(self._live.frame)
        if order.kind is OrderKind.SKIP_LINE:
            lines = await self.lines(member)
            line = line_now(lines)
            begin_m = here_m if line is None else line[0]
            ends = flight.dispatch.give_up_legs(member, f"its line is left out: ordered by {order.asked_by}")
            flight.dispatch.unflown.forget_order(name)
            if not planner.skip(name, order.id, np.array(ends).reshape(-1, 2), begin_m, here_m):
                why = f"planner {self._live.spec.planner.name!r} knows of no line that it flies now"
                await self._over(member, order, OrderState.FAILED, why)
                return
            self._skipped_at[name] = member.legs
        elif order.kind is OrderKind.DENSER:
            planner.lead(name, order.id, order.corners_m, np.zeros((0, 2)), member.last_end_m(self._live.frame))
        else:
            ends = flight.dispatch.give_up_legs(member, f"ordered elsewhere by {order.asked_by}")
            flight.dispatch.unflown.forget_order(name)
            planner.lead(name, order.id, order.corners_m, np.array(ends).reshape(-1, 2), here_m)
        if member.asked is order:
            member.asked = replace(order, state=OrderState.FLYING)
        self._live.changed.set()

    async def _see(self, member: Member, order: OperatorOrder, planner: OrderedPlanner) -> None:
        """See whether an order that was taken up is over."""
        if order.kind is OrderKind.SKIP_LINE:
            # Once a leg is committed after it, the planner's memory of it is.
            if member.legs > self._skipped_at.get(member.name, -1):
                await self._over(member, order, OrderState.DONE)
            return
        refused = planner.refused.get(member.name)
        if refused is not None and refused[0] == order.id and member.name not in planner.ways:
            await self._over(member, order, OrderState.FAILED, refused[1])
            return
        if member.status is WaypointStatus.REACHED and not member.ahead and member.target_m is not None:
            # Who needs its next leg only then is planned for from where it is, which may be an arrival radius away.
            planner.reach(member.name, member.target_m)
        way = planner.ways.get(member.name)
        if way is not None and (way.order != order.id or len(way.corners_m)):
            return
        ends = [member.target_m] if member.ordered and member.target_m is not None else []
        ends += [leg.target_m for leg in member.ahead]
        last_m = order.corners_m[-1]
        if not self._has_given_up(member) and not any(np.hypot(*(end - last_m)) <= THERE_M for end in ends):
            planner.drop(member.name)
            await self._over(member, order, OrderState.DONE)

    async def _over(self, member: Member, order: OperatorOrder, state: OrderState, why: str = "") -> None:
        """Note that an order is over, unless another one came meanwhile."""
        if member.asked is not order:
            return
        member.asked = None
        live = self._live

        async def write() -> None:
            async with live.database.writing() as session:
                await order_queries.change(session, order.id, state, why, now())

        await live.journal.storage.done(write)
        what = DONE_WORDS[order.kind] if state is OrderState.DONE else f"does not do what it was ordered: {why}"
        level = Level.WARNING if state is OrderState.FAILED else Level.INFO
        await live.journal.log(level, "order", f"{member.name} {what}", vehicle=member.name, order=order.id)
        live.publish_summary()

    # Places

    def _lon_lat(self, places_m: FloatArray) -> list[tuple[float, float]]:
        lat, lon = self._live.frame.to_geographic(places_m[:, 0], places_m[:, 1])
        return [(float(x), float(y)) for x, y in zip(lon, lat, strict=True)]

    def _local(self, lon_lat: list[tuple[float, float]]) -> FloatArray:
        places = np.array(lon_lat, dtype=np.float64).reshape(-1, 2)
        return np.column_stack(self._live.frame.to_local(places[:, 1], places[:, 0]))

    def local_m(self, lon: float, lat: float) -> FloatArray:
        """Return a place in the mission's frame, (2,)."""
        return np.asarray(self._local([(lon, lat)])[0])


DONE_WORDS = {
    OrderKind.GO: "was where it was ordered and goes on with its part",
    OrderKind.SKIP_LINE: "leaves out the rest of its line",
    OrderKind.REPEAT_LINE: "has flown the line again and goes on with its part",
    OrderKind.DENSER: "has flown the lines ordered and goes on with its part",
}


def free_region(constraints: Constraints) -> BaseGeometry:
    """Return where vehicles may be."""
    return FreeSpace(constraints, 0.0).region


def is_free(region: BaseGeometry, place_m: FloatArray) -> bool:
    """Whether a place (2,) is where vehicles may be."""
    return bool(region.covers(Point(*place_m)))


def order_view(row: VehicleOrderRow, *, ended: bool = False) -> OrderView:
    """Return a stored order; with its mission it ended, too."""
    state, reason = OrderState(row.state), row.reason
    if ended and state in OPEN:
        state, reason = OrderState.CANCELLED, "the mission ended"
    way = [] if row.kind == OrderKind.SKIP_LINE else [(lon, lat) for lon, lat in row.way["corners"]]
    return OrderView(
        id=row.id,
        vehicle=row.vehicle,
        kind=OrderKind(row.kind),
        state=state,
        way=way,
        asked_by=row.asked_by,
        asked_at=row.asked_at,
        changed_at=row.changed_at,
        reason=reason,
    )


async def orders_of(live: LiveMission) -> list[OrderView]:
    """Return what was ordered in a mission, newest first."""
    async with live.database.reading() as session:
        rows = await order_queries.newest(session, live.id)
    return [order_view(row, ended=live.header.state in ENDED) for row in rows]
