"""Lines that a vehicle has flown, by the legs that are stored."""

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.lines.flown_lines import flown_lines
from app.missions.live.mission import LiveMission
from app.missions.team import Member
from app.storage.queries import orders as order_queries

LEGS_SEEN = 400
"""At most so many of a vehicle's last legs are looked at for its lines."""


async def lines_of(live: LiveMission, member: Member, constraints: Constraints) -> list[FloatArray]:
    """Return the lines that a vehicle has flown, each (k, 2), the one that it is on to where it is now."""
    upto = member.order.step if member.ordered and member.order is not None else member.legs
    async with live.database.reading() as session:
        ends = await order_queries.last_legs(session, live.id, member.name, upto, LEGS_SEEN)
    places = np.array([place for number, *place in ends]).reshape(-1, 2)
    if member.ordered and ends and ends[-1][0] == upto:
        # It may have swung out of the area, where nobody can be ordered.
        places[-1] = FreeSpace(constraints, 0.0).nearest(member.place_m(live.frame))
    if len(ends) == 1 and member.leg.start_m is not None:
        places = np.vstack([member.leg.start_m, places])
    return flown_lines(places)
