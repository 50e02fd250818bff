"""Whether what is ordered can be flown: inside the area, clear of zones, with the way and the energy that are left."""

import numpy as np
from shapely import LineString, Point
from shapely.geometry.base import BaseGeometry

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.lines.flown_lines import length_m
from app.missions.errors import ConflictError
from app.missions.flight.orders.context import OrderContext
from app.missions.live.mission import LiveMission
from app.missions.spec.orders import OrderKind
from app.missions.team import Member

INSIDE_M = 1e-3
"""A way that leaves the free region by no more lies in it."""


async def check_way(
    live: LiveMission, context: OrderContext, member: Member, kind: OrderKind, corners: FloatArray
) -> None:
    """Raise ConflictError where an order's way, corners (k, 2), cannot be flown by what is known now."""
    spec, name = live.spec, member.name
    begin_m = start_m(live, member, kind)

    def find_way() -> tuple[FloatArray, FloatArray, bool]:
        space = FreeSpace(context.constraints, 0.0)
        here = space.nearest(begin_m)
        way = space.connect(here, corners)
        whole = np.vstack([here, way])
        return here, way, bool(space.region.buffer(INSIDE_M).covers(LineString(whole)))

    here, way, is_inside = await live.in_thread(find_way)
    if not is_inside:
        raise ConflictError(
            f"no way leads {name!r} there inside the area and clear of the keep-out zones", "choose another place"
        )
    whole = np.vstack([begin_m, here, way])
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
    if not context.energy_range.lasts_for(member, here, way):
        raise ConflictError(
            f"the energy of {name!r} does not last for {needs_m:.0f} m and its way home from there",
            "choose a place nearer to its recovery point, or another vehicle",
        )


def start_m(live: LiveMission, member: Member, kind: OrderKind) -> FloatArray:
    """Return where an order's way begins, (2,): where its vehicle is, or where its legs end if these are flown."""
    frame = live.frame
    return member.last_end_m(frame) if kind is OrderKind.DENSER else member.place_m(frame)


def free_region(constraints: Constraints) -> BaseGeometry:
    """Return where vehicles may be."""
    return FreeSpace(constraints, 0.0).region


def is_free(region: BaseGeometry, place_m: FloatArray) -> bool:
    """Whether a place (2,) is where vehicles may be."""
    return bool(region.covers(Point(*place_m)))
