"""How a flight carries out what its vehicles are ordered: taken up between two decisions, until it is over."""

from dataclasses import replace

import numpy as np

from app.exploration.lines.flown_lines import line_now
from app.missions.clock import now
from app.missions.fleet.interface import WaypointStatus
from app.missions.flight.orders.context import OrderContext
from app.missions.flight.orders.flown_lines import lines_of
from app.missions.live.mission import LiveMission
from app.missions.spec.failsafes import Response
from app.missions.spec.orders import OrderKind, OrderState
from app.missions.team import Member, OperatorOrder
from app.missions.views.mission import Level
from app.storage.queries import orders as order_queries

THERE_M = 1.0
"""A leg that ends so near the end of an order's way is its last."""

DONE_WORDS = {
    OrderKind.GO: "was where it was ordered and goes on with its part",
    OrderKind.SKIP_LINE: "leaves out the rest of its line",
    OrderKind.REPEAT_LINE: "has flown the line again and goes on with its part",
    OrderKind.DENSER: "has flown the lines ordered and goes on with its part",
}


class OrderExecution:
    """Carries out the orders of one flight; its vehicles hold those that are not over."""

    def __init__(self, live: LiveMission, context: OrderContext) -> None:
        self._live = live
        self._context = context
        self._skipped_at: dict[str, int] = {}
        """Number of a vehicle's last leg when it was to leave out its line."""

    @property
    def context(self) -> OrderContext:
        """What orders of this flight are checked by, and carried out with."""
        return self._context

    @property
    def waiting(self) -> bool:
        """Whether an order waits to be taken up, or to be given up."""
        planner, unflown = self._context.planner, self._context.dispatch.unflown
        return any(
            unflown.waits(m.name)
            or (m.asked is None and planner.is_ordered(m.name))
            or (m.asked is not None and m.asked.state is OrderState.ACCEPTED and m.plannable)
            for m in self._live.team
        )

    async def look(self) -> list[str]:
        """Take up what was ordered, and see what is over; no decision is being made meanwhile.

        Returns the vehicles that need other legs now.
        """
        if not self._context.apart:
            return []
        planner, dispatch, taken = self._context.planner, self._context.dispatch, []
        unflown = dispatch.unflown
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
                    dispatch.give_up_legs(member, "its order was ended")
            elif member.left_at is not None or (
                member.withdrawal is not None and member.withdrawal.response is not Response.HOLD
            ):
                planner.drop(member.name)
                why = "it left the mission" if member.withdrawal is None else member.withdrawal.why
                await self._over(member, order, OrderState.CANCELLED, why)
            elif order.state is OrderState.ACCEPTED:
                if member.plannable:
                    await self._take(member, order)
                    taken.append(member.name)
            else:
                await self._see(member, order)
        return taken

    async def _take(self, member: Member, order: OperatorOrder) -> None:
        """Give up the legs that a vehicle has and lead it where it was ordered; nothing is decided before this ends."""
        planner, dispatch = self._context.planner, self._context.dispatch
        name, here_m = member.name, member.place_m(self._live.frame)
        if order.kind is OrderKind.SKIP_LINE:
            lines = await lines_of(self._live, member, self._context.constraints)
            line = line_now(lines)
            begin_m = here_m if line is None else line[0]
            ends = dispatch.give_up_legs(member, f"its line is left out: ordered by {order.asked_by}")
            dispatch.unflown.forget_order(name)
            if not planner.skip(name, order.id, np.array(ends).reshape(-1, 2), begin_m, here_m):
                why = f"planner {self._live.spec.planner.name!r} knows of no line that it flies now"
                await self._over(member, order, OrderState.FAILED, why)
                return
            self._skipped_at[name] = member.legs
        elif order.kind is OrderKind.DENSER:
            planner.lead(name, order.id, order.corners_m, np.zeros((0, 2)), member.last_end_m(self._live.frame))
        else:
            ends = dispatch.give_up_legs(member, f"ordered elsewhere by {order.asked_by}")
            dispatch.unflown.forget_order(name)
            planner.lead(name, order.id, order.corners_m, np.array(ends).reshape(-1, 2), here_m)
        if member.asked is order:
            member.asked = replace(order, state=OrderState.FLYING)
        self._live.changed.set()

    async def _see(self, member: Member, order: OperatorOrder) -> None:
        """See whether an order that was taken up is over."""
        planner = self._context.planner
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

    def _has_given_up(self, member: Member) -> bool:
        """Whether a vehicle gave legs of its order up that were not looked at yet."""
        return self._context.dispatch.unflown.has_of_order(member.name)

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
