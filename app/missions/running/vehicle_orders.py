"""What an operator may order a vehicle that surveys: go somewhere, leave out or repeat a line, look closer."""

import numpy as np
from shapely import Polygon

from app.arrays import FloatArray
from app.exploration.lines.dense_lines import dense_lines
from app.exploration.lines.flown_lines import line_near, line_now
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.flight.orders import OrderBook, OrderContext, free_region, is_free, lines_of, start_m
from app.missions.live.mission import LiveMission
from app.missions.spec.orders import DenserOrder, GoOrder, OrderKind, RepeatOrder
from app.missions.spec.swath import SwathSonarSpec
from app.missions.team import Member
from app.missions.views.orders import OrderView

USUAL_ALTITUDE_M = 5.0
"""How high above the bottom a vehicle is taken to be where nothing tells."""

CLOSER = 0.5
"""Lines that are to be denser are so many times as far apart as the survey's own."""


async def go(live: LiveMission, name: str, order: GoOrder, actor: str) -> OrderView:
    """Send a vehicle to a place, then let it go on. Raises VehicleNotFoundError, ConflictError, InvalidRequestError."""
    book = live.part(OrderBook)
    lon, lat = order.position

    async def find(_member: Member, context: OrderContext) -> FloatArray:
        place_m = _place_m(book, "position", lon, lat)
        region = await live.in_thread(free_region, context.constraints)
        if not is_free(region, place_m):
            inside = is_free(Polygon(context.constraints.area), place_m)
            what = "lies in a keep-out zone or its margin" if inside else "lies outside the area"
            raise InvalidRequestError("position", f"{lat:.6f}, {lon:.6f} {what}", "a place inside, clear of the zones")
        return place_m[None]

    return await book.accept([name], OrderKind.GO, find, actor, f"goes to {lat:.6f}, {lon:.6f}")


async def skip_line(live: LiveMission, name: str, actor: str) -> OrderView:
    """Let a vehicle leave out the rest of its line. Raises VehicleNotFoundError, ConflictError."""

    async def find(member: Member, context: OrderContext) -> FloatArray:
        if not context.planner.planner.flies_lines:
            raise ConflictError(f"planner {live.spec.planner.name!r} flies no lines", "send the vehicle elsewhere: go")
        if member.asked is not None:
            raise ConflictError(
                f"vehicle {name!r} does what {member.asked.asked_by} ordered ({member.asked.kind}), not its own lines",
                "resume it first: that ends the order",
            )
        if not member.legs:
            raise ConflictError(f"vehicle {name!r} has not begun a line yet", "wait until it has")
        return np.zeros((0, 2))

    words = "is to leave out the rest of its line"
    return await live.part(OrderBook).accept([name], OrderKind.SKIP_LINE, find, actor, words)


async def repeat_line(live: LiveMission, name: str, order: RepeatOrder, actor: str) -> OrderView:
    """Let a vehicle fly a line again. Raises VehicleNotFoundError, ConflictError, InvalidRequestError."""
    book = live.part(OrderBook)

    async def find(member: Member, context: OrderContext) -> FloatArray:
        lines = await lines_of(live, member, context.constraints)
        line = line_now(lines) if order.near is None else line_near(lines, _place_m(book, "near", *order.near))
        if line is None:
            raise ConflictError(f"vehicle {name!r} has not flown a line yet", "wait until it has")
        return line

    return await book.accept([name], OrderKind.REPEAT_LINE, find, actor, "flies a line again")


async def survey_denser(live: LiveMission, order: DenserOrder, actor: str) -> OrderView:
    """Let a vehicle survey a part of the area on closer lines.

    Raises VehicleNotFoundError, ConflictError, InvalidRequestError.
    """
    book = live.part(OrderBook)
    ring = np.array(order.area.ring)
    part = Polygon(np.array([_place_m(book, "area", lon, lat) for lon, lat in ring]))
    names = [order.vehicle] if order.vehicle is not None else _nearest_first(live, part)

    async def find(member: Member, context: OrderContext) -> FloatArray:
        spacing_m = order.line_spacing_m or CLOSER * spacing_of(live, member)
        begin_m = start_m(live, member, OrderKind.DENSER)

        def lines() -> FloatArray:
            return dense_lines(part, free_region(context.constraints), spacing_m, begin_m)

        try:
            return await live.in_thread(lines)
        except ValueError as error:
            raise InvalidRequestError("area", str(error), "draw another part, or give line_spacing_m") from error

    return await book.accept(names, OrderKind.DENSER, find, actor, f"surveys {part.area:.0f} m² denser")


def _place_m(book: OrderBook, field: str, lon: float, lat: float) -> FloatArray:
    try:
        return book.local_m(lon, lat)
    except ValueError as error:
        words, _, advice = str(error).rpartition(": ")
        raise InvalidRequestError(field, f"it is far from the mission: {words}", advice) from error


def _nearest_first(live: LiveMission, part: Polygon) -> list[str]:
    """Return the vehicles that survey: those without an order first, of these the nearest to a part of the area."""
    middle = np.array([part.centroid.x, part.centroid.y])

    def far(member: Member) -> tuple[bool, float, str]:
        away_m = float(np.hypot(*(member.last_end_m(live.frame) - middle)))
        return member.asked is not None, away_m, member.name

    found = [member.name for member in sorted(live.team.plannable, key=far)]
    return found or [member.name for member in live.team]


def spacing_of(live: LiveMission, member: Member) -> float:
    """Return how far apart a vehicle's lines are in its mission, about, metres."""
    spec = live.spec
    sonar: SwathSonarSpec | None = member.spec.sonar
    if member.swath is not None:
        return float(np.clip(member.swath.port_m + member.swath.starboard_m, 1.0, 1000.0))
    if sonar is not None:
        altitude_m = member.spec.altitude_m or USUAL_ALTITUDE_M
        return float(np.clip(2.0 * altitude_m * np.tan(np.deg2rad(sonar.aperture_deg) / 2.0), 1.0, 1000.0))
    area_m2 = Polygon(spec.local_area()).area
    ways_m = [spec.allowance(vehicle).metres for vehicle in live.team.specs]
    whole_m = sum(way_m if way_m is not None else spec.steps * spec.limits.max_step_m for way_m in ways_m)
    return float(np.clip(area_m2 / max(whole_m, 1.0), 1.0, 1000.0))
