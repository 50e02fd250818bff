"""Makes a step durable, and turns what is stored of it into the vehicles' orders."""

import numpy as np
from sqlalchemy.orm import make_transient

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.missions import metrics, safety
from app.missions.clock import now
from app.missions.fleet.interface import Position, WaypointOrder, WaypointStatus
from app.missions.flight.decision import Decision, Leg
from app.missions.live.mission import RISES, LiveMission
from app.missions.spec.mission import Guidance
from app.missions.team import Member
from app.missions.views.mission import Level
from app.storage import missions as mission_queries
from app.storage.models import StepRow, WaypointRow
from app.storage.uncancellable import to_the_end
from imc_bridge.control.plans import CIRCLE_RADIUS_M

LEAD_M = 25.0
"""How far beyond a waypoint a vehicle may be sent to pass it straight; more than the 15 m from which DUNE circles."""

CIRCLE_M = CIRCLE_RADIUS_M + 2.5
"""Radius of the room for a circle: it is not flown on rails."""

UNIT_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
"""About a circle of radius 1: what lies apart from the square lies apart from the circle."""


class StepCommit:
    """Writes one running mission's steps down and gives its vehicles their orders; sends nothing.

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
        self._bottom = Bottom.unknown()
        self._targets: dict[str, FloatArray] = {}
        """Where every vehicle of the step is sent, (2,)."""

    async def commit(self, decision: Decision) -> None:
        """Make a step durable, decision, waypoints and memory together; then order the vehicles to fly it."""
        live = self._live
        number = live.header.step + 1
        built = live.builder.newest
        rows = [self._row(number, leg) for leg in decision.legs]
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
        # The step is not flown before it is on disk, however long that takes; the vehicles wait where they are.
        await live.journal.storage.done(lambda: to_the_end(self._store(step, rows)))
        if live.search is not None and live.search.began_at is None:
            live.search.began_at = step.committed_at
        metrics.STEPS.inc()
        live.set_step(number, decision.objective, decision.terms)
        self._bottom = decision.bottom
        self._targets = {leg.vehicle: leg.target_m[:2] for leg in decision.legs}
        for member in live.team:
            member.set_order(None)
            member.status = None
        for row in rows:
            member_of_row = live.team.get(row.vehicle)
            if member_of_row is not None and row.status != WaypointStatus.REFUSED:
                self.order(row, member_of_row)
        live.waypoints.show_rows(rows)
        live.publish_summary()
        await self._tell_of_surfacing(decision, number)
        await self._tell_of_pursuits(decision, number)
        for note in decision.notes:
            await live.journal.log(Level.WARNING, "safety", note, step=number)

    def order(self, row: WaypointRow, member: Member) -> None:
        """Give a vehicle the order that belongs to a stored waypoint."""
        lead: Position | None = None
        circle: Position | None = None
        bottom: tuple[Position, ...] = ()
        spec = self._live.spec
        target = np.array([row.east_m, row.north_m])
        if member.report is not None and self._leads:
            start = member.place_m(self._live.frame)
            beyond = safety.lead_point(self._constraints, start, target, LEAD_M)
            lead = self._position(beyond[0], beyond[1], row.depth_m)
            known = safety.bottom_on_way(np.array([start, target, beyond]), self._bottom)
            bottom = tuple(self._position(east, north, depth) for east, north, depth in known)
            circle = self._circle(member, start, target)
        order = WaypointOrder(
            mission_id=self._live.id,
            step=row.step,
            vehicle=row.vehicle,
            position=Position(row.lat_deg, row.lon_deg, row.depth_m),
            speed_mps=spec.speed_mps,
            arrival_radius_m=spec.arrival_radius_m,
            min_altitude_m=spec.limits.min_altitude_m,
            lead=lead,
            circle=circle,
            bottom=bottom,
        )
        member.set_order(order, target)
        member.status = WaypointStatus.PLANNED

    def _circle(self, member: Member, start: FloatArray, target: FloatArray) -> Position | None:
        """Return where a vehicle that is led by legs may circle down, apart from the others' ways and circles."""
        if member.spec.guidance is Guidance.FOLLOW:
            return None
        taken: list[FloatArray] = []
        for other in self._live.team:
            if other is member or other.report is None:
                continue
            way = [other.place_m(self._live.frame)]
            if other.name in self._targets:
                way.append(self._targets[other.name])
            if other.order is not None and other.order.circle is not None:
                taken.append(CIRCLE_M * UNIT_SQUARE + self._local(other.order.circle))
            taken.append(np.array(way))
        centre_m = safety.circling_room(self._constraints, start, target, CIRCLE_M, taken)
        return None if centre_m is None else self._position(centre_m[0], centre_m[1], 0.0)

    def _local(self, position: Position) -> FloatArray:
        east, north = self._live.frame.to_local(np.array(position.lat_deg), np.array(position.lon_deg))
        return np.array([float(east), float(north)])

    async def _store(self, step: StepRow, waypoints: list[WaypointRow]) -> None:
        async with self._live.database.writing() as session:
            known = await session.get(StepRow, (step.mission_id, step.number))
            if known is not None and known.committed_at == step.committed_at:
                return  # written before the connection broke
            for row in (step, *waypoints):
                make_transient(row)  # of a transaction that failed
            session.add(step)
            await session.flush()
            session.add_all(waypoints)
            # Only the last one's is ever needed; on a day's mission all of them would fill the disk.
            await mission_queries.forget_memory(session, self._live.id, step.number - 1)

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

    async def _tell_of_surfacing(self, decision: Decision, number: int) -> None:
        """Note which vehicles go up for a fix, and say why."""
        live = self._live
        for leg in decision.legs:
            going = live.team.get(leg.vehicle)
            if going is not None:
                going.risings += leg.surfacing and not going.surfacing
                going.surfacing = leg.surfacing
        for vehicle, fix in decision.fixes.items():
            rises = any(leg.surfacing for leg in decision.legs if leg.vehicle == vehicle)
            await live.journal.log(Level.INFO, "surface", fix, step=number, vehicle=vehicle, **{RISES: rises})

    async def _tell_of_pursuits(self, decision: Decision, number: int) -> None:
        """Say which vehicles left the mapping for a target, and which came back."""
        for member in self._live.team:
            target, before = decision.pursuits.get(member.name), member.pursuing
            member.pursuing = target
            if target == before:
                continue
            words = f"{member.name} goes on with the mapping" if target is None else f"{member.name} goes for {target}"
            await self._live.journal.log(Level.INFO, "target", words, step=number, vehicle=member.name)
