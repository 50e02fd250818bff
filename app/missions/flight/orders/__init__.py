"""What an operator orders vehicles to do in the middle of a mission: taken down, carried out, and told.

An order is stored by ``book`` before it is accepted, once ``feasibility`` finds that it can be flown. The flight takes
it up between two decisions (``execution``): it gives up the legs that the vehicle has, and lets
:class:`.OrderedPlanner` propose others, which are checked and committed like any. How far it has come is part of the
planner's memory, in the transaction of the legs; what is stored with the order itself only tells (``views``).
"""

from app.missions.flight.orders.book import OrderBook
from app.missions.flight.orders.context import OrderContext
from app.missions.flight.orders.feasibility import free_region, is_free, start_m
from app.missions.flight.orders.flown_lines import lines_of
from app.missions.flight.orders.views import orders_of

__all__ = ["OrderBook", "OrderContext", "free_region", "is_free", "lines_of", "orders_of", "start_m"]
