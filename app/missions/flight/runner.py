"""One running mission: taken up where it stands, flown to its end.

Every start is a recovery: a mission goes on from what was last committed, whether it was just started, paused, or
killed in the middle. A decision, its legs and the planner's memory are one transaction; legs are sent after it. So a
crash between any two moments loses nothing and repeats nothing but the sending, which is harmless.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np
import structlog

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.ordered import OrderedPlanner
from app.missions import metrics
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import WaypointReport, WaypointStatus
from app.missions.flight.decisions.deciding import Decider
from app.missions.flight.decisions.step_maps import StepMaps
from app.missions.flight.legs.asides import Asides
from app.missions.flight.legs.commit import LegCommit, committed_leg
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.legs.giving_way import GivingWay
from app.missions.flight.legs.keeping_off import KeepingOff, KeepOutZones
from app.missions.flight.legs.next_moment import NextMoment
from app.missions.flight.legs.other_vehicles import OtherVehicles
from app.missions.flight.legs.room_aside import RoomAside
from app.missions.flight.observation.elapsed_time import keep_time, save_elapsed
from app.missions.flight.observation.engagement import Engagement
from app.missions.flight.observation.telemetry_sampler import keep_telemetry
from app.missions.flight.observation.vehicle_clocks import VehicleClocks
from app.missions.flight.observation.waiting import Waiting
from app.missions.flight.orders import OrderBook, OrderContext
from app.missions.flight.own_legs import OwnLegs
from app.missions.flight.search_hooks import SearchHooks
from app.missions.flight.team_steps import TeamSteps
from app.missions.flight.watches import Watches
from app.missions.flight.way_home.failsafe_watch import FailsafeWatch
from app.missions.flight.way_home.onboard_way import OnboardWays
from app.missions.flight.way_home.withdrawals import Withdrawals
from app.missions.live.mission import LiveMission
from app.missions.spec.failsafes import Response
from app.missions.task.constraints import limits_of_decisions, make_constraints
from app.missions.task.planner import make_planner
from app.missions.team import SETTLED, Member, WithdrawalCause
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.queries import missions as mission_queries

log = structlog.get_logger(__name__)


class Runner:
    """Runs one mission from its last committed leg to its last one; cancel ``run`` to stop it.

    Parameters
    ----------
    others
        What there is to meet beside the mission's own vehicles.
    time_scale
        How much faster than the wall clock the vehicles live.
    map_pause_s
        For how long no map is made after one, at least, on the wall clock.
    maps_ready
        Returns when what maps are made with is compiled.
    """

    def __init__(
        self,
        live: LiveMission,
        hub: FleetHub,
        others: OtherVehicles,
        executor: Executor,
        time_scale: float,
        map_pause_s: float,
        maps_ready: Callable[[], Awaitable[None]],
    ) -> None:
        self._live = live
        self._time_scale = time_scale
        self._constraints = constraints = make_constraints(live.spec)
        planner = OrderedPlanner(make_planner(live.spec, live.planning_sensor))
        self._apart = flies_apart(live, constraints, planner.planner)
        self._maps = StepMaps(live, executor, time_scale, map_pause_s, maps_ready)
        self._waiting = Waiting(live)
        self._search_hooks = SearchHooks(live, time_scale, self._waiting.until)
        decided = limits_of_decisions(constraints, planner.planner) if self._apart else constraints
        self._decider = Decider(live, decided, planner, self._maps, executor)
        self._leg_commit = LegCommit(live, constraints, leads=not self._search_hooks.needed)
        self._dispatch = Dispatch(live, hub, self._leg_commit, time_scale, persistent=self._apart)
        self._engagement = Engagement(live, hub, time_scale, self._dispatch.send)
        self._range = EnergyRange(live, constraints, self._leg_commit)
        self._watch = FailsafeWatch(live, hub, self._range, time_scale)
        zones = KeepOutZones(live.spec.to_local(zone) for zone in live.spec.keep_out)
        asides = Asides(live, self._leg_commit, self._dispatch)
        self._keeping_off = KeepingOff(live, constraints, zones, asides, time_scale)
        moment = NextMoment(live, time_scale)
        room = RoomAside(live, constraints, self._leg_commit, zones, asides, moment)
        self._giving_way = GivingWay(live, moment, room, asides, others, time_scale)
        self._onboard = OnboardWays(live, hub, self._range, time_scale)
        self._orders = live.part(OrderBook)
        self._order_context = OrderContext(planner, constraints, self._range, self._dispatch, self._apart)
        self._withdrawals = Withdrawals(live, hub, self._leg_commit, self._dispatch, self._range, time_scale)

    async def run(self) -> str:
        """Fly to the mission's end. Returns why nobody goes on; raises whatever went wrong."""
        live = self._live
        live.flight_begins()
        metrics.RUNNING.inc()
        watches = Watches(live)
        keepers = [
            asyncio.create_task(watches.keep(name, watch))
            for name, watch in (
                ("engaging vehicles", self._engagement.keep),
                ("the mission's clock", partial(keep_time, live)),
                ("telemetry for charts", partial(keep_telemetry, live, self._time_scale)),
                ("comparing vehicles' clocks", VehicleClocks(live, self._time_scale).keep),
                ("failsafes", self._watch.keep),
                ("bringing vehicles home", self._withdrawals.keep),
                ("ways home on board", self._onboard.keep),
                ("keeping vehicles off zones", self._keeping_off.keep),
                ("keeping vehicles apart", self._giving_way.keep),
            )
        ]
        try:
            resumed = await self._recover()
            await self._orders.begin(self._order_context)
            reason = await self._fly_home(resumed)
            live.flight.come_to_end()
            await self._onboard.drop()
            return reason
        finally:
            self._orders.end()
            metrics.RUNNING.dec()
            for keeper in keepers:
                keeper.cancel()
            await asyncio.gather(*keepers, return_exceptions=True)
            await self._maps.end()
            live.flight.stop_counting()
            await to_the_end(save_elapsed(live))
            live.flight_ends()

    async def _fly_home(self, resumed: bool) -> str:
        """Fly until nobody goes on, and everybody is home; returns why nobody goes on.

        Who joins while others are on their way home, or is sent on, surveys for what it has left of its way.
        """
        flight = self._flight()
        while True:
            reason = (resumed and self._ended_before()) or await flight.fly(resumed=resumed)
            self._call_home(reason)
            staying = {member.name: member for member in self._live.team.surveying}
            if await self._withdrawals.finished(partial(self._somebody_came, staying)):
                return reason
            resumed = False

    def _somebody_came(self, staying: Mapping[str, Member]) -> bool:
        """Whether somebody surveys who is none of those that stay where they are."""
        return any(staying.get(member.name) is not member for member in self._live.team.surveying)

    def _flight(self) -> OwnLegs | TeamSteps:
        shared = (self._live, self._decider, self._leg_commit, self._dispatch, self._maps, self._waiting)
        if self._apart:
            return OwnLegs(*shared, self._constraints, self._time_scale, self._range, self._orders)
        return TeamSteps(*shared, self._search_hooks, self._time_scale)

    def _ended_before(self) -> str:
        """Return why an earlier flight called everybody home at the mission's end; '' where it did not."""
        team = self._live.team
        if team.going_on:
            return ""
        withdrawals = [member.withdrawal for member in team if member.withdrawal is not None]
        return next((one.why for one in withdrawals if one.cause is WithdrawalCause.MISSION_END), "")

    def _call_home(self, why: str) -> None:
        """Send everybody home at the mission's end who has a recovery point, unless the mission wants it otherwise."""
        for member in self._live.team:
            if self._live.spec.ends_at_home(member.spec):
                self._live.withdraw(member, Response.RETURN, why, cause=WithdrawalCause.MISSION_END)

    async def _recover(self) -> bool:
        """Take up what was last committed: the planner's memory, and the legs that were not flown; whether any was."""
        live = self._live
        for member in live.team:
            member.drop_legs()
        async with live.database.reading() as session:
            step = await mission_queries.last_step(session, live.id)
            if step is None:
                return False
            rows = await mission_queries.unsettled_waypoints(session, live.id, SETTLED)
            ended = await mission_queries.settled_waypoints(session, live.id, SETTLED)
            newest = await mission_queries.newest_waypoints(session, live.id)
            way_m, spared = await mission_queries.committed_way(session, live.id)
        await self._remember(step.memory)
        live.set_step(step.number, step.objective, step.terms)
        last = {row.vehicle: row.step for row in newest}
        came_to_m = {
            row.vehicle: np.array([row.east_m, row.north_m]) for row in ended if row.status == WaypointStatus.REACHED
        }
        for member in live.team.departed.values():
            # It may come back, and goes on with its own numbers.
            self._count_legs(member, last, way_m, spared)
            of_it = [row for row in rows if row.vehicle == member.name and member.withdrawal is None]
            member.ahead[:] = map(committed_leg, of_it)
            if member.ahead:
                self._dispatch.leave_line(member, "it left the mission")
        for member in live.team:
            was_led = member.legs > 0
            self._count_legs(member, last, way_m, spared)
            of_it = [row for row in rows if row.vehicle == member.name and member.withdrawal is None]
            member.ahead += [committed_leg(row) for row in of_it if self._apart or row.step == step.number]
            if not was_led:
                # After a pause all that was flown is written down.
                self._leave_out_passed(member, came_to_m.get(member.name))
            member.count_late(live.spec, live.frame)
        await live.journal.log(Level.INFO, "resumed", f"going on after step {step.number}", step=step.number)
        return True

    @staticmethod
    def _count_legs(
        member: Member, last: Mapping[str, int], way_m: Mapping[str, float], spared: Mapping[str, int]
    ) -> None:
        """Let a vehicle have the legs that were committed for it, and how long they are together."""
        name = member.name
        member.committed = replace(
            member.committed, legs=last.get(name, 0), way_m=way_m.get(name, 0.0), spared=spared[name]
        )

    async def _remember(self, memory: bytes) -> None:
        """Let the planner take up what it had in mind; where it cannot read that it begins anew, on the same map."""
        planner = self._decider.planner
        blank = planner.snapshot()
        try:
            planner.restore(memory)
        except ValueError as error:
            planner.restore(blank)
            said = (
                f"what the planner had in mind was written by another version: it plans anew on the same map ({error})"
            )
            await self._live.journal.log(Level.WARNING, "resumed", said)

    def _leave_out_passed(self, member: Member, begin_m: FloatArray | None) -> None:
        """Leave out the legs that a vehicle had flown before anybody could write that down.

        ``begin_m``: where the first of them begins, (2,), if it got to the end of the one before.
        """
        if member.report is None or len(member.ahead) < 2:
            return
        ends_m = np.array([leg.target_m for leg in member.ahead])
        first = nearest_leg(member.place_m(self._live.frame), ends_m, begin_m)
        for leg in member.ahead[:first]:
            reason = "flown while nobody was there to note it"
            self._live.journal.waypoint(
                WaypointReport(member.name, self._live.id, leg.number, WaypointStatus.MISSED, reason)
            )
        del member.ahead[:first]


def flies_apart(live: LiveMission, constraints: Constraints, planner: PlannerBase) -> bool:
    """Whether vehicles of a mission have legs of their own, rather than go together in steps."""
    linked = np.isfinite(constraints.com_range_m) or any(m.capabilities.flies_together for m in live.team)
    return live.search is None and not linked and planner.decides_apart


def nearest_leg(place_m: FloatArray, ends_m: FloatArray, begin_m: FloatArray | None = None) -> int:
    """Return which of a vehicle's legs goes on from where it is: the one that passes it closest, the first of equals.

    Parameters
    ----------
    place_m : (2,)
    ends_m : (n, 2)
        Where the legs end; each begins at the end before.
    begin_m : (2,) or None
        Where the first one begins; None: anywhere.
    """
    starts = np.vstack([ends_m[:1] if begin_m is None else begin_m[None], ends_m[:-1]])
    along = ends_m - starts
    length2 = np.einsum("ij,ij->i", along, along)
    part = np.einsum("ij,ij->i", place_m - starts, along) / np.where(length2 > 0.0, length2, 1.0)
    nearest = starts + np.clip(part, 0.0, 1.0)[:, None] * along
    return int(np.argmin(np.hypot(*(nearest - place_m).T)))
