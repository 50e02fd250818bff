"""Makes decisions durable, and turns legs that are stored into the vehicles' orders."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from shapely import Polygon
from sqlalchemy.orm import make_transient

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import WHERE, Constraints, Limit
from app.exploration.motion.turning import disc, turned_over
from app.missions import metrics
from app.missions.clock import now
from app.missions.fleet.interface import Position, WaypointOrder, WaypointStatus
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg
from app.missions.live.journals.journal import RISES
from app.missions.live.mission import LiveMission
from app.missions.recovery.berths import home_of
from app.missions.recovery.way_home import homeward_ground
from app.missions.safety import room, travel_depth
from app.missions.safety.tide_and_bottom import FallingTide
from app.missions.spec.vehicle import Guidance
from app.missions.task.planner import turn_radius_m
from app.missions.task.way import way_m
from app.missions.team import CommittedLeg, Member
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.models import StepRow, WaypointRow
from app.storage.queries import missions as mission_queries

LEAD_M = 25.0
"""How far beyond a waypoint a vehicle may be sent to pass it straight; more than the 15 m from which DUNE circles."""

LEAD_SAMPLES = 9
"""Places on that way where the bottom is looked at."""

NO_LEG = 0
"""In place of a leg's number, in orders that are none."""

UNIT_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
"""About a circle of radius 1: what lies apart from the square lies apart from the circle."""


class LegCommit:
    """Writes the legs of one running mission down and makes them its vehicles' orders; sends nothing.

    Every vehicle's legs are numbered. All legs of one number are a step of the mission; the first vehicle that gets one
    begins it.

    Parameters
    ----------
    constraints
        What waypoints and the places beyond them are held to.
    leads
        Whether vehicles may be sent beyond their waypoints to pass them straight.
    """

    def __init__(self, live: LiveMission, constraints: Constraints, *, leads: bool) -> None:
        self._live = live
        self._constraints = constraints
        self._leads = leads
        self._tide = FallingTide(lambda: live.gate.corrections.water_level_m(now().timestamp()))

    @property
    def bottom(self) -> Bottom:
        """The pessimistic sea floor of the last decision; less deep by what the water has fallen since."""
        return self._tide.bottom

    def take_bottom(self, bottom: Bottom) -> None:
        """Go by another sea floor, below the surface as it is now."""
        self._tide.take(bottom)

    async def commit(self, decision: Decision, numbers: dict[str, int]) -> None:
        """Make a decision durable, its legs and the planner's memory together; then the vehicles have these legs ahead.

        ``numbers`` are the legs', by vehicle.
        """
        live = self._live
        built = live.builder.newest
        rows = [self._row(numbers[leg.vehicle], leg) for leg in decision.legs]
        number = max(row.step for row in rows)
        step = StepRow(
            mission_id=live.id,
            number=number,
            committed_at=now(),
            objective=decision.objective,
            terms=dict(decision.terms),
            figures=live.figures(),
            soundings=built.soundings if built else 0,
            map_digest=built.digest if built else "",
            memory=decision.memory,
            targets=live.ranges.memory(),
        )
        getting = [live.team.get(row.vehicle) for row in rows]
        # The step is not flown before it is on disk, however long that takes; the vehicles wait where they are.
        await live.journal.storage.done(lambda: to_the_end(self._store(step, rows)))
        if live.search is not None and live.search.began_at is None:
            live.search.began_at = step.committed_at
        if number > live.header.step:
            metrics.STEPS.inc()
            live.set_step(number, decision.objective, decision.terms)
        self.take_bottom(decision.bottom)
        starts_m = decision.origin_m
        for row, leg, member in zip(rows, decision.legs, getting, strict=True):
            now_of_name = live.team.get(row.vehicle) or live.team.departed.get(row.vehicle)
            if now_of_name is not None:
                now_of_name.committed.commit(row.step)  # it may have left, or come back, meanwhile
            if member is None or member is not now_of_name or member.left_at is not None:
                continue
            if not leg.unplanned:
                begin_m = starts_m[row.vehicle]
                if not member.ahead and member.target_m is not None and member.status is WaypointStatus.REACHED:
                    # It was there a little before the end of its last leg, all of which is counted already.
                    begin_m = member.target_m
                member.committed.way_m += way_m([begin_m, leg.target_m[:2]], live.spec)
            if row.status == WaypointStatus.REFUSED:
                live.waypoints.show_rows([row])
            elif member.withdrawal is None:  # it may have been called home meanwhile
                member.ahead.append(committed_leg(row, surfacing=leg.surfacing))
        live.publish_summary()
        for vehicle, fix in decision.fixes.items():
            rises = any(leg.surfacing for leg in decision.legs if leg.vehicle == vehicle)
            await live.journal.log(Level.INFO, "surface", fix, step=number, vehicle=vehicle, **{RISES: rises})
        await self._tell_of_pursuits(decision, number)
        for note in decision.notes:
            await live.journal.log(Level.WARNING, "safety", note, step=number)

    def leg_ahead(self, leg: Leg, number: int) -> CommittedLeg:
        """Return a decided leg as its vehicle has it ahead."""
        return committed_leg(self._row(number, leg), surfacing=leg.surfacing)

    async def rewrite(self, decision: Decision, legs: Mapping[str, list[tuple[CommittedLeg, Leg]]]) -> None:
        """Write legs in place of those with their numbers, which are not begun, and the planner's memory with them.

        ``legs`` are by vehicle; ``decision`` is the last one of those that they come from.
        """
        rows = [self._row(ahead.number, leg) for of_one in legs.values() for ahead, leg in of_one]
        await self._store_memory(decision.memory, rows)
        self.take_bottom(decision.bottom)

    async def remember(self, memory: bytes) -> None:
        """Make durable what the planner remembers, in place of what was stored with the last step."""
        await self._store_memory(memory, [])

    async def _store_memory(self, memory: bytes, rows: Sequence[WaypointRow]) -> None:
        """Write what the planner remembers, and waypoints in place of those of the same numbers."""
        live = self._live

        async def store() -> None:
            async with live.database.writing() as session:
                for row in rows:
                    await session.merge(row)
                await mission_queries.remember(session, live.id, live.header.step, memory, live.ranges.memory())

        await live.journal.storage.done(lambda: to_the_end(store()))

    def lead_home(self, member: Member, corners: list[tuple[FloatArray, float]]) -> None:
        """Give a vehicle legs that survey nothing: along corners (2,) at depths, metres.

        They are not written down: after a restart the way is found anew, from where the vehicle is then.
        """
        member.ahead.clear()
        for en_m, depth_m in corners:
            member.committed.commit(member.legs + 1)
            place = self._position(float(en_m[0]), float(en_m[1]), depth_m)
            member.ahead.append(CommittedLeg(member.legs, place, np.asarray(en_m, dtype=np.float64), homeward=True))

    def begin_next(self, member: Member) -> None:
        """Make a vehicle's next leg its order."""
        leg = member.take_next_leg(self._live.frame)
        self._order(leg, member)
        self._live.waypoints.show(leg.number, member.name, leg.position, leg.target_m)

    def barred(self, member: Member) -> str:
        """Return why a vehicle may not fly its next leg from where it is now; '' if it may."""
        if member.report is None or not member.ahead:
            return ""
        leg = member.ahead[0]
        depth_m = leg.position.depth_m
        here = np.append(member.place_m(self._live.frame), depth_m)[None]
        there = np.append(leg.target_m, depth_m)[None]
        constraints, live = self._constraints, self._live
        home_m = home_of(member.spec, member.slot, live.spec, live.team.specs)
        if member.withdrawal is not None and home_m is not None:
            constraints = homeward_ground(constraints, home_m)
        # It may be elsewhere than the leg was decided from.
        # The corner of a way in round a zone may lie farther outside than its vehicle does.
        area = Polygon(constraints.area)
        goes_round = all(room.distance_outside_m(area, place_m[0, :2]) > 0.0 for place_m in (here, there))
        limits = [limit for limit in WHERE if not (goes_round and limit is Limit.AREA)]
        broken = constraints.violations((member.name,), here, there)
        return next((violation.reason for violation in broken if violation.limit in limits), "")

    def _order(self, leg: CommittedLeg, member: Member) -> None:
        lead: Position | None = None
        circle: Position | None = None
        bottom: tuple[Position, ...] = ()
        spec = self._live.spec
        target = leg.target_m
        place = leg.position
        if member.report is not None:
            # It may have come elsewhere than where its leg was to begin, and it turns.
            start = member.place_m(self._live.frame)
            depth_m = self._depth_m(member, place.depth_m, self._turning(member, start, target))
            place = replace(place, depth_m=depth_m)
        # Who comes up at home, or is about to, stops there: beyond it others wait, or survey.
        last = member.withdrawal is not None and all(np.array_equal(one.target_m, target) for one in member.ahead)
        if member.report is not None and self._leads and not last:
            start = member.place_m(self._live.frame)
            beyond = room.lead_point(self._constraints, start, target, LEAD_M)
            on = target + np.linspace(0.0, 1.0, LEAD_SAMPLES)[:, None] * (beyond - target)
            depth_m = self._depth_m(member, place.depth_m, [on, disc(beyond, room.CIRCLE_M)])
            lead = self._position(beyond[0], beyond[1], depth_m)
            known = travel_depth.bottom_on_way(np.array([start, target, beyond]), self.bottom)
            bottom = tuple(self._position(east, north, depth) for east, north, depth in known)
            circle = self._circle(member, start, target)
        order = WaypointOrder(
            mission_id=self._live.id,
            step=leg.number,
            vehicle=member.name,
            position=place,
            speed_mps=spec.speed_of(member.spec),
            arrival_radius_m=spec.arrival_radius_m,
            min_altitude_m=spec.limits.min_altitude_m,
            lead=lead,
            circle=circle,
            last=last,
            bottom=bottom,
        )
        member.set_order(order, target)

    def followed_to_m(self, member: Member, end_m: FloatArray) -> FloatArray:
        """Return how far a vehicle goes on its leg that gets no further order, (2,): beyond the end where it is led."""
        lead = None if member.order is None else member.order.lead
        return end_m if lead is None else self._local(lead)

    def holding(self, member: Member) -> WaypointOrder | None:
        """Return an order that keeps a vehicle circling near where it is; None where there is no room for that.

        One that has no order, as after a pause, circles as deep as it is. In a search it stays where it is: what is
        beside it may not be known.
        """
        if member.report is None:
            return None
        if self._live.search is not None:
            return self.waiting_at(member, member.place_m(self._live.frame))
        inside = room.nearest_inside(Polygon(self._constraints.area), member.place_m(self._live.frame))
        centre_m = self._room(member, inside, inside)
        if centre_m is None:
            return None
        ways = [*self._turning(member, inside, centre_m), disc(centre_m, room.CIRCLE_M)]
        order = self._present_order(member, member.report.position)
        wanted_m = order.position.depth_m
        if member.withdrawal is not None and member.withdrawal.below:
            wanted_m = self._depth_below_m(member, wanted_m)
        return self._waiting(order, centre_m, self._depth_m(member, wanted_m, ways))

    def waiting_below(self, member: Member) -> WaypointOrder | None:
        """Return an order that keeps a vehicle where it is, as deep as it is; None where that is not known."""
        if member.report is None:
            return None
        order = self._present_order(member, member.report.position)
        return self._waiting(order, member.place_m(self._live.frame), self._depth_below_m(member, 0.0))

    def waiting_at(self, member: Member, place_m: FloatArray) -> WaypointOrder | None:
        """Return an order to wait at a place (2,), as deep as it goes now; None where nobody knows where it is."""
        if member.report is None:
            return None
        order = self._present_order(member, member.report.position)
        ways = self._turning(member, member.place_m(self._live.frame), place_m)
        return self._waiting(order, place_m, self._depth_m(member, order.position.depth_m, ways))

    def _present_order(self, member: Member, here: Position) -> WaypointOrder:
        """Return the order that a vehicle has, or one to where it is."""
        if member.order is not None:
            return member.order
        spec = self._live.spec
        if member.capabilities.keeps_depth:
            here = replace(here, depth_m=member.cruise_depth_m(spec.limits))
        return WaypointOrder(
            mission_id=self._live.id,
            step=NO_LEG,
            vehicle=member.name,
            position=here,
            speed_mps=spec.speed_of(member.spec),
            arrival_radius_m=spec.arrival_radius_m,
            min_altitude_m=spec.limits.min_altitude_m,
        )

    def _waiting(self, order: WaypointOrder, place_m: FloatArray, depth_m: float) -> WaypointOrder:
        place = self._position(float(place_m[0]), float(place_m[1]), depth_m)
        return replace(order, step=NO_LEG, position=place, lead=None, circle=None, last=False)

    def _depth_below_m(self, member: Member, depth_m: float) -> float:
        """Return a depth that is not shallower than where a vehicle is now."""
        here_m = depth_m if member.report is None else member.report.position.depth_m
        return max(depth_m, min(here_m, self._live.spec.limits.max_depth_m))

    def _turning(self, member: Member, start: FloatArray, target: FloatArray) -> list[FloatArray]:
        """Return what a vehicle passes over that is at ``start`` and goes to ``target``: its turn, and its way."""
        report = member.report
        heading_rad = math.nan if report is None or report.heading_rad is None else report.heading_rad
        radius_m = turn_radius_m(self._live.spec, member.spec)
        straight = start + np.linspace(0.0, 1.0, travel_depth.LEG_SAMPLES)[:, None] * (target - start)
        return [straight, turned_over(start, heading_rad, target, radius_m)]

    def _depth_m(self, member: Member, depth_m: float, ways: list[FloatArray]) -> float:
        """Return a depth, or what a vehicle's height above the bottom leaves of it over what it passes."""
        least_m = self._live.spec.limits.min_altitude_m
        height_m = least_m if member.withdrawal is not None else float(np.fmax(least_m, member.altitude_m))
        return travel_depth.depth_over_m(depth_m, ways, self.bottom, height_m)

    def _circle(self, member: Member, start: FloatArray, target: FloatArray) -> Position | None:
        """Return where a vehicle that is led by legs may circle down, apart from the others' ways and circles."""
        if member.spec.guidance is Guidance.FOLLOW:
            return None
        centre_m = self._room(member, start, target)
        return None if centre_m is None else self._position(centre_m[0], centre_m[1], 0.0)

    def _room(self, member: Member, start: FloatArray, target: FloatArray) -> FloatArray | None:
        """Return the centre of a circle near a leg's target, apart from the others' ways and circles."""
        taken: list[FloatArray] = []
        for other in self._live.team:
            if other is member or other.report is None:
                continue
            way = [other.place_m(self._live.frame)]
            way += [] if other.target_m is None else [other.target_m]
            way += [leg.target_m for leg in other.ahead]
            if other.order is not None and other.order.circle is not None:
                taken.append(room.CIRCLE_M * UNIT_SQUARE + self._local(other.order.circle))
            taken.append(np.array(way))
        return room.circling_room(self._constraints, start, target, room.CIRCLE_M, taken)

    def _local(self, position: Position) -> FloatArray:
        east, north = self._live.frame.to_local(np.array(position.lat_deg), np.array(position.lon_deg))
        return np.array([float(east), float(north)])

    async def _store(self, step: StepRow, waypoints: list[WaypointRow]) -> None:
        async with self._live.database.writing() as session:
            first = waypoints[0]
            if await session.get(WaypointRow, (first.mission_id, first.step, first.vehicle)) is not None:
                return  # written before the connection broke
            for row in (step, *waypoints):
                make_transient(row)  # of a transaction that failed
            if step.number > self._live.header.step:
                session.add(step)
                await session.flush()
                # Only the last one's is ever needed; on a day's mission all of them would fill the disk.
                await mission_queries.forget_memory(session, self._live.id, step.number - 1)
            else:
                await mission_queries.remember(
                    session, self._live.id, self._live.header.step, step.memory, step.targets
                )
            session.add_all(waypoints)

    def _row(self, step: int, leg: Leg) -> WaypointRow:
        east_m, north_m, depth_m = (float(value) for value in leg.target_m)
        position = self._position(east_m, north_m, depth_m)
        return WaypointRow(
            mission_id=self._live.id,
            step=step,
            vehicle=leg.vehicle,
            lat_deg=position.lat_deg,
            lon_deg=position.lon_deg,
            east_m=east_m,
            north_m=north_m,
            depth_m=depth_m,
            status=WaypointStatus.REFUSED if leg.refusal else WaypointStatus.PLANNED,
            reason=leg.refusal,
            changed_at=now(),
        )

    def _position(self, east_m: float, north_m: float, depth_m: float) -> Position:
        lat, lon = self._live.frame.to_geographic(np.array(east_m), np.array(north_m))
        return Position(float(lat), float(lon), float(depth_m))

    async def _tell_of_pursuits(self, decision: Decision, number: int) -> None:
        """Say which vehicles left the mapping for a target, and which came back."""
        for member in self._live.team:
            target, before = decision.pursuits.get(member.name), member.pursuing
            member.pursuing = target
            if target == before:
                continue
            words = f"{member.name} goes on with the mapping" if target is None else f"{member.name} goes for {target}"
            await self._live.journal.log(Level.INFO, "target", words, step=number, vehicle=member.name)


def committed_leg(row: WaypointRow, *, surfacing: bool = False) -> CommittedLeg:
    """Return the leg of a stored waypoint."""
    place = Position(row.lat_deg, row.lon_deg, row.depth_m)
    return CommittedLeg(row.step, place, np.array([row.east_m, row.north_m]), surfacing)
