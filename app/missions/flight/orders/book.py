"""The orders of one mission: stored before they are accepted, and handed to the flight that carries them out."""

import asyncio
from collections.abc import Awaitable, Callable

import numpy as np

from app.arrays import FloatArray
from app.missions import states
from app.missions.clock import now
from app.missions.errors import ConflictError
from app.missions.flight.orders.context import OrderContext
from app.missions.flight.orders.execution import OrderExecution
from app.missions.flight.orders.feasibility import check_way
from app.missions.flight.orders.views import order_view
from app.missions.live.mission import LiveMission
from app.missions.spec.orders import OPEN, OrderKind, OrderState
from app.missions.states import MissionState
from app.missions.team import Member, OperatorOrder
from app.missions.views.mission import Level
from app.missions.views.orders import OrderView
from app.storage.models import VehicleOrderRow
from app.storage.queries import orders as order_queries

Find = Callable[[Member, OrderContext], Awaitable[FloatArray]]
"""Returns the corners (k, 2) of an order's way for a vehicle; raises what speaks against it."""


class OrderBook:
    """The orders of one mission; its vehicles hold those that are not over."""

    def __init__(self, live: LiveMission) -> None:
        self._live = live
        self._taking = asyncio.Lock()
        self._execution: OrderExecution | None = None
        """None while no flight goes on."""

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
        member, context = self.able(name)
        corners = await find(member, context)
        if kind is not OrderKind.SKIP_LINE:
            await check_way(live, context, member, kind, corners)
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

    def able(self, name: str) -> tuple[Member, OrderContext]:
        """Return a vehicle that can take orders, and its flight's parts. Raises VehicleNotFoundError, ConflictError."""
        live = self._live
        member = live.team.named(name)
        if live.header.state is not MissionState.RUNNING:
            raise ConflictError(f"the mission is {live.header.state}: nobody is led", states.remedy(live.header.state))
        live.refuse_ending()
        if self._execution is None:
            raise ConflictError("the flight is just beginning", "try again in a moment")
        if not self._execution.context.apart:
            raise ConflictError(
                "the vehicles of this mission move as one team, a step at a time: none can be sent elsewhere alone",
                "hold it, or bring it home",
            )
        if member.withdrawal is not None:
            raise ConflictError(f"vehicle {name!r} surveys no more: {member.withdrawal.why}", "resume its survey first")
        if not member.controllable:
            raise ConflictError(f"vehicle {name!r} cannot be reached now", "wait until it is heard, or abort it")
        return member, self._execution.context

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

    # Having them carried out

    async def begin(self, context: OrderContext) -> None:
        """Take up the orders that are stored, for a flight whose planner has its memory."""
        live, planner = self._live, context.planner
        async with live.database.reading() as session:
            rows = await order_queries.in_states(session, live.id, OPEN)
            done = await order_queries.in_states(session, live.id, [OrderState.DONE])
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
        self._execution = OrderExecution(live, context)

    def end(self) -> None:
        """Take no more orders until the next flight."""
        self._execution = None

    def leave(self, member: Member) -> None:
        """Give up the legs of a vehicle that is taken out of its mission: others go on with its line."""
        if self._execution is not None and member.withdrawal is None:
            self._execution.context.dispatch.leave_line(member, "it left the mission")

    @property
    def waiting(self) -> bool:
        """Whether an order waits to be taken up, or to be given up."""
        return self._execution is not None and self._execution.waiting

    async def look(self) -> list[str]:
        """Take up what was ordered, and see what is over; returns the vehicles that need other legs now."""
        return [] if self._execution is None else await self._execution.look()

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
