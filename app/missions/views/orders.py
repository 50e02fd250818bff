"""What operators ordered single vehicles to do, and what became of it."""

from datetime import datetime

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude
from app.missions.spec.orders import OrderKind, OrderState
from app.missions.views.base import View


class OrderView(View):
    """An order to one vehicle."""

    id: int
    vehicle: str
    kind: OrderKind
    state: OrderState
    way: list[tuple[Longitude, Latitude]] = Field(
        default_factory=list, description="Where it leads along, [longitude, latitude]; empty where a line is left out"
    )
    asked_by: str
    asked_at: datetime
    changed_at: datetime
    reason: str = Field(default="", description="Why it is over, where it was not carried out")
