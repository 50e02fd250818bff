"""Orders as they are stored, told to those who ask."""

from app.missions.live.mission import LiveMission
from app.missions.spec.orders import OPEN, OrderKind, OrderState
from app.missions.states import ENDED
from app.missions.views.orders import OrderView
from app.storage.models import VehicleOrderRow
from app.storage.queries import orders as order_queries


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
