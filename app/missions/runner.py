"""The step loop of one running mission.

Every start is a recovery: the loop takes the mission up from its last committed step, whether it was just started,
paused, or killed in the middle. A step's decision, waypoints and planner memory are one transaction; waypoints are sent
after it. So a crash between any two moments loses nothing and repeats nothing but the sending, which is harmless.
"""

import asyncio
import math
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future

import numpy as np
import structlog
from numpy.typing import NDArray
from sqlalchemy.orm import make_transient

from app.estimation import SingleBeam
from app.exploration.bottom import Bottom
from app.exploration.planners import create_planner
from app.exploration.problem import Planner
from app.missions import metrics, safety
from app.missions.clock import now
from app.missions.decision import Decision, Place, decide, make_constraints
from app.missions.engaging import Engaging
from app.missions.fleet import (
    Position,
    VehicleRefusedError,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.hub import FleetHub
from app.missions.live import RISES, LiveMission
from app.missions.map_builder import MapBuilder
from app.missions.members import SETTLED, Member
from app.missions.sampling import keep_telemetry
from app.missions.search.lookout import Lookout
from app.missions.spec import Guidance
from app.missions.views import Level
from app.storage import missions as mission_queries
from app.storage.models import StepRow, WaypointRow
from app.storage.shielding import to_the_end
from imc_bridge.plans import leg_time_s

ELAPSED_PERIOD_S = 5.0
CLOCK_SET_S = 2.0
"""A wall clock that gained or lost more than this between two looks was set."""
PACE_MEMORY = 0.9
"""Weight of the past in the running mean of a step's duration."""

EXPECTED_DECISION_S = 0.3
"""How long a decision is taken to last before the first was made."""

SOUND_S = 60.0
"""What commands and reports take by sound, at the most."""

LEAD_M = 25.0
"""How far beyond a waypoint a vehicle may be sent to pass it straight; more than the 15 m from which DUNE circles."""

PATIENCE_S = 2.0
"""How much of the vehicles' time a decision may wait for a newer map."""

REPORT_DELAY_S = 0.1
"""How old a vehicle's last report is at most, on the wall clock."""

FloatArray = NDArray[np.float64]

_LEARNING = threading.Lock()

log = structlog.get_logger(__name__)


class Runner:
    """Runs one mission from its last committed step to its last one; cancel ``run`` to stop it.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(self, live: LiveMission, hub: FleetHub, executor: Executor, time_scale: float) -> None:
        self._live = live
        self._hub = hub
        self._executor = executor
        self._time_scale = time_scale
        self._spec = live.spec
        self._constraints = make_constraints(live.spec)
        self._decision_s = EXPECTED_DECISION_S
        self._mapping_s = 0.0
        self._mapping: asyncio.Task[None] | None = None
        self._bottom = Bottom.unknown()
        self._lookout = Lookout(live, time_scale, self._wait)

    async def run(self) -> str:
        """Fly all remaining steps. Returns why there are no more; raises whatever went wrong."""
        live = self._live
        live.running_since_s = asyncio.get_running_loop().time()
        metrics.RUNNING.inc()
        keepers = [
            asyncio.create_task(Engaging(live, self._hub, self._time_scale, self._send_to).keep()),
            asyncio.create_task(self._keep_time()),
            asyncio.create_task(keep_telemetry(live, self._time_scale)),
        ]
        try:
            planner = await self._recover()
            decision: Decision | None = None
            while live.header.step < self._spec.steps:
                started_s = asyncio.get_running_loop().time()
                if decision is None:
                    await self._gather_team(patient=live.header.step == 0)
                    await self._lookout.look_round()
                    decision = await self._decide(planner, self._places())
                await self._commit(decision)
                await self._send()
                taken = decision
                # The map is made and its model refined while the vehicles travel.
                self._begin_map()
                self._executor.submit(_learn, live.builder).add_done_callback(_log_failure)
                decision = await self._travel(planner)
                step_s = asyncio.get_running_loop().time() - started_s
                self._keep_pace(step_s)
                if await self._lookout.is_over(taken, step_s):
                    return "everybody is back at the entry"
            return "every step is done"
        finally:
            metrics.RUNNING.dec()
            helpers = [*keepers, *([self._mapping] if self._mapping else [])]
            for helper in helpers:
                helper.cancel()
            await asyncio.gather(*helpers, return_exceptions=True)
            await to_the_end(self._save_elapsed())
            live.running_since_s = None

    async def _recover(self) -> Planner:
        """Take up the last committed step: the planner's memory, and the waypoints that were not settled."""
        sensor = SingleBeam() if self._live.search is None else self._live.search.site.scanner
        planner = create_planner(self._spec.planner.name, self._spec.planner.options, sensor)
        async with self._live.database.reading() as session:
            step = await mission_queries.last_step(session, self._live.id)
            if step is None:
                return planner
            rows = await mission_queries.waypoints_of_step(session, self._live.id, step.number)
        planner.restore(step.memory)
        self._live.set_step(step.number, step.objective, step.terms)
        again = []
        for row in rows:
            member = self._live.team.get(row.vehicle)
            if member is not None and WaypointStatus(row.status) not in SETTLED:
                member.order = self._order(row, member)
                member.status = WaypointStatus.PLANNED
                again.append(self._live.waypoint_view(row).model_copy(update={"status": WaypointStatus.PLANNED}))
        self._live.show_waypoints(again)
        await self._live.journal.log(
            Level.INFO, "resumed", f"going on after step {step.number} of {self._spec.steps}", step=step.number
        )
        if again or step.number < self._spec.steps:
            await self._gather_team(patient=True)
            await self._send()
            await self._arrive(self._deadline_s())
        return planner

    async def _gather_team(self, *, patient: bool) -> None:
        """Wait until a vehicle can be planned for; patient: until all of them can, or the step's time is over."""
        team = self._live.team
        if patient and await self._wait(
            lambda: bool(team.present) and all(m.present for m in team), self._deadline_s()
        ):
            return
        if team.present:
            return
        absent = [member.name for member in team]
        message = (
            "no vehicle can be sent anywhere; waiting for one" if absent else "every vehicle left; add one to go on"
        )
        await self._live.journal.log(Level.ALARM, "waiting", message, vehicles=absent)
        await self._wait(lambda: bool(team.present), None)

    async def _travel(self, planner: Planner) -> Decision | None:
        """Wait until the vehicles arrived; returns the next step's decision when it could be made on the way.

        Deciding takes a moment in which vehicles would wait. So it begins when all of them are about to arrive, for the
        places where they will be. Whether they really came there decides whether the decision counts.
        """
        deadline_s = self._deadline_s()
        close = await self._wait(
            lambda: all(self._about_to_arrive(m) for m in self._live.team if m.busy) or bool(self._lookout.barred()),
            deadline_s,
        )
        last = self._live.header.step >= self._spec.steps
        if not close or last or not self._live.team.present or self._lookout.barred():
            await self._arrive(deadline_s)
            return None
        memory = planner.snapshot()
        expected = self._places(ahead=True)
        deciding = asyncio.create_task(self._decide(planner, expected))
        try:
            await self._arrive(deadline_s)
            decision = await deciding
        finally:
            deciding.cancel()
        if self._came_true(expected) and self._lookout.still_clear(decision):
            return decision
        planner.restore(memory)
        return None

    def _about_to_arrive(self, member: Member) -> bool:
        """Tell whether a vehicle will be at its waypoint by the time a decision takes."""
        if member.order is None or member.report is None:
            return False
        left_m = float(np.linalg.norm(self._target_m(member.order) - member.place_m(self._live.frame)))
        ahead_s = (self._decision_s + REPORT_DELAY_S) * self._time_scale
        return left_m <= self._spec.arrival_radius_m + self._spec.speed_mps * ahead_s

    def _target_m(self, order: WaypointOrder) -> FloatArray:
        east, north = self._live.frame.to_local(np.array(order.position.lat_deg), np.array(order.position.lon_deg))
        return np.array([float(east), float(north)])

    def _places(self, *, ahead: bool = False) -> list[Place]:
        """Return where the vehicles are that can be planned for; ``ahead``: or will be, where they are under way."""
        return [
            Place(
                member.name,
                self._target_m(member.order)
                if ahead and member.busy and member.order
                else member.place_m(self._live.frame),
                member.report.heading_rad if member.report and member.report.heading_rad is not None else math.nan,
                member.cruise_depth_m(self._spec.limits),
                member.report.position_sd_m if member.report and member.report.position_sd_m is not None else math.nan,
                member.report.position.depth_m if member.surfacing and member.report else math.nan,
            )
            for member in self._live.team.present
        ]

    def _came_true(self, expected: list[Place]) -> bool:
        """Tell whether the vehicles are the expected ones at the expected places."""
        there = {place.vehicle: place.en_m for place in self._places()}
        tolerance_m = 2 * self._spec.arrival_radius_m
        return there.keys() == {place.vehicle for place in expected} and all(
            np.linalg.norm(there[place.vehicle] - place.en_m) <= tolerance_m for place in expected
        )

    def _begin_map(self) -> None:
        """Make a map of what has been sounded so far, unless one is being made."""
        if self._mapping is None:
            self._mapping = asyncio.create_task(self._make_map())

    async def _make_map(self) -> None:
        live, loop = self._live, asyncio.get_running_loop()
        started_s = loop.time()
        await live.journal.flush()
        await live.whole.complete()
        before = live.builder.newest
        built = await loop.run_in_executor(self._executor, live.builder.build)
        if built is not None and built is not before:
            live.publish_map(built)
        self._mapping_s = loop.time() - started_s
        await live.whole.keep_when_grown(live.header.step)

    async def _renew_map(self) -> None:
        """Bring the map up to date, unless vehicles would circle for long meanwhile: then the newest has to do.

        That is so where many soundings are mapped, or time runs fast. A failure to make the map comes out here.
        """
        live = self._live
        patient = live.builder.newest is None or self._mapping_s * self._time_scale <= PATIENCE_S
        if self._mapping is not None and (patient or self._mapping.done()):
            mapping, self._mapping = self._mapping, None
            await mapping
        await live.journal.flush()
        await live.notice_imports()
        await live.whole.complete()
        if patient and live.builder.stale:
            await self._make_map()

    async def _decide(self, planner: Planner, places: list[Place]) -> Decision:
        """Bring the map up to date, then make the decision, in a worker thread."""
        live = self._live
        started_s = asyncio.get_running_loop().time()
        await live.journal.storage.done(self._renew_map)

        step_s = self._spec.limits.max_step_m / self._spec.speed_mps
        await live.journal.storage.done(live.ranges.flush)
        targets = live.ranges.tracking.told(live.ranges.times.now_s(), step_s)
        task = self._lookout.task(live.header.step + 1)

        def work() -> Decision:
            sounded_m, doubtful_m = live.builder.sounded_at_m()
            return decide(
                live.header.step + 1,
                self._spec,
                self._constraints,
                planner,
                places,
                live.builder.belief(),
                sounded_m,
                live.gate.corrections.water_level_m(now().timestamp()),
                doubtful_m,
                targets,
                task,
            )

        with metrics.PLANNING_SECONDS.time():
            decision = await asyncio.get_running_loop().run_in_executor(self._executor, work)
        took_s = asyncio.get_running_loop().time() - started_s
        # Some decisions take longer than most. Vehicles would circle for them if the usual one were allowed for.
        self._decision_s = max(took_s, PACE_MEMORY * self._decision_s + (1 - PACE_MEMORY) * took_s)
        return decision

    async def _commit(self, decision: Decision) -> None:
        """Make the step durable: decision, waypoints and memory together."""
        live = self._live
        number = live.header.step + 1
        built = live.builder.newest
        rows = [self._waypoint_row(number, leg.vehicle, leg.target_m, leg.refusal) for leg in decision.legs]
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
        for member in live.team:
            member.order = None
            member.status = None
        for row in rows:
            member_of_row = live.team.get(row.vehicle)
            if member_of_row is not None and row.status != WaypointStatus.REFUSED:
                member_of_row.order = self._order(row, member_of_row)
                member_of_row.status = WaypointStatus.PLANNED
        live.show_waypoints([live.waypoint_view(row) for row in rows])
        live.publish_summary()
        for leg in decision.legs:
            going = live.team.get(leg.vehicle)
            if going is not None:
                going.risings += leg.surfacing and not going.surfacing
                going.surfacing = leg.surfacing
        for vehicle, fix in decision.fixes.items():
            rises = any(leg.surfacing for leg in decision.legs if leg.vehicle == vehicle)
            await live.journal.log(Level.INFO, "surface", fix, step=number, vehicle=vehicle, **{RISES: rises})
        await self._tell_of_pursuits(decision, number)
        for note in decision.notes:
            await live.journal.log(Level.WARNING, "safety", note, step=number)

    async def _tell_of_pursuits(self, decision: Decision, number: int) -> None:
        """Say which vehicles left the mapping for a target, and which came back."""
        for member in self._live.team:
            target, before = decision.pursuits.get(member.name), member.pursuing
            member.pursuing = target
            if target == before:
                continue
            words = f"{member.name} goes on with the mapping" if target is None else f"{member.name} goes for {target}"
            await self._live.journal.log(Level.INFO, "target", words, step=number, vehicle=member.name)

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

    def _waypoint_row(
        self,
        step: int,
        vehicle: str,
        target_m: np.ndarray,
        refusal: str,
    ) -> WaypointRow:
        lat, lon = self._live.frame.to_geographic(np.array(target_m[0]), np.array(target_m[1]))
        return WaypointRow(
            mission_id=self._live.id,
            step=step,
            vehicle=vehicle,
            lat_deg=float(lat),
            lon_deg=float(lon),
            east_m=float(target_m[0]),
            north_m=float(target_m[1]),
            depth_m=float(target_m[2]),
            status=WaypointStatus.REFUSED if refusal else WaypointStatus.PLANNED,
            reason=refusal,
            changed_at=now(),
        )

    def _order(self, row: WaypointRow, member: Member) -> WaypointOrder:
        lead: Position | None = None
        bottom: tuple[Position, ...] = ()
        if member.report is not None and not self._lookout.needed:
            start, target = member.place_m(self._live.frame), np.array([row.east_m, row.north_m])
            beyond = safety.lead_point(self._constraints, start, target, LEAD_M)
            lead = self._position(beyond[0], beyond[1], row.depth_m)
            tide_m = self._spec.tide.level_m
            known = safety.bottom_on_way(np.array([start, target, beyond]), self._bottom)
            bottom = tuple(self._position(east, north, depth + tide_m) for east, north, depth in known)
        return WaypointOrder(
            mission_id=self._live.id,
            step=row.step,
            vehicle=row.vehicle,
            position=Position(row.lat_deg, row.lon_deg, row.depth_m),
            speed_mps=self._spec.speed_mps,
            arrival_radius_m=self._spec.arrival_radius_m,
            min_altitude_m=self._spec.limits.min_altitude_m,
            lead=lead,
            bottom=bottom,
        )

    def _position(self, east_m: float, north_m: float, depth_m: float) -> Position:
        lat, lon = self._live.frame.to_geographic(np.array(east_m), np.array(north_m))
        return Position(float(lat), float(lon), float(depth_m))

    async def _send(self) -> None:
        await asyncio.gather(*(self._send_to(member) for member in self._live.team if member.engaged and member.busy))

    async def _send_to(self, member: Member) -> None:
        if member.order is None or self._live.halted:
            return
        try:
            await self._hub.order(member.key, member.order)
        except VehicleRefusedError as error:
            member.engaged = False
            self._settle(member, WaypointStatus.REFUSED, str(error))
            await self._live.journal.log(Level.WARNING, "vehicle", str(error), vehicle=member.name)

    def _settle(self, member: Member, status: WaypointStatus, reason: str) -> None:
        if member.order is not None:
            report = WaypointReport(member.name, member.order.mission_id, member.order.step, status, reason)
            self._live.receive(report)

    async def _arrive(self, deadline_s: float) -> None:
        """Wait until every vehicle under way arrived or refused; at the deadline go on without the others."""
        if await self._wait(
            lambda: not any(m.busy for m in self._live.team) or bool(self._lookout.barred()), deadline_s
        ):
            await self._end_early(self._lookout.barred())
            return
        late = [member for member in self._live.team if member.busy]
        for member in late:
            self._settle(member, WaypointStatus.MISSED, f"not reached within {self._step_time_s():.0f} s")
        await self._live.journal.log(
            Level.WARNING,
            "straggler",
            f"step {self._live.header.step} goes on without {', '.join(m.name for m in late)}",
            step=self._live.header.step,
            vehicles=[m.name for m in late],
        )

    async def _end_early(self, barred: list[Member]) -> None:
        """Where something stands on a vehicle's way, end the step: everybody is sent anew from where it is."""
        if not barred:
            return
        for member in self._live.team:
            if member.busy:
                reason = "something stands on its way" if member in barred else "the step ended before it was there"
                self._settle(member, WaypointStatus.MISSED, reason)
        await self._lookout.tell_of(barred)

    def _deadline_s(self) -> float:
        """Return the event loop's time at which a step that begins now goes on without stragglers."""
        return asyncio.get_running_loop().time() + self._step_time_s() / self._time_scale

    def _step_time_s(self) -> float:
        """Return how long a step may take: longer than asked for where a vehicle is silent until its leg is over."""
        legs_s = [
            leg_time_s(
                float(np.linalg.norm(self._target_m(member.order) - member.place_m(self._live.frame))),
                member.order.position.depth_m,
                member.order.speed_mps,
            )
            + (SOUND_S if member.spec.guidance is Guidance.ACOUSTIC else 0.0)
            for member in self._live.team
            if member.spec.guidance is not Guidance.FOLLOW and member.order is not None and member.report is not None
        ]
        return max(self._spec.step_deadline_s, *legs_s) if legs_s else self._spec.step_deadline_s

    async def _wait(self, condition: Callable[[], bool], deadline_s: float | None) -> bool:
        """Wait until ``condition`` holds; False when the deadline passed first."""
        changed = self._live.changed
        try:
            async with asyncio.timeout_at(deadline_s):
                while not condition():
                    changed.clear()
                    await changed.wait()
        except TimeoutError:
            return condition()
        return True

    def _keep_pace(self, seconds: float) -> None:
        before = self._live.seconds_per_step
        self._live.seconds_per_step = seconds if before is None else PACE_MEMORY * before + (1 - PACE_MEMORY) * seconds

    async def _keep_time(self) -> None:
        loop = asyncio.get_running_loop()
        ahead_s = now().timestamp() - loop.time()
        while True:
            await asyncio.sleep(ELAPSED_PERIOD_S)
            await to_the_end(self._save_elapsed())
            before_s, ahead_s = ahead_s, now().timestamp() - loop.time()
            await self._tell_of_clock(ahead_s - before_s)

    async def _tell_of_clock(self, by_s: float) -> None:
        """Say that the wall clock was set; nothing that moves vehicles depends on it."""
        if abs(by_s) < CLOCK_SET_S:
            return
        message = (
            f"this machine's clock was set {'forward' if by_s > 0 else 'back'} by {abs(by_s):.0f} s: times in the log, "
            "and the water level that a tide table gives for now, follow it. See that it is right"
        )
        await self._live.journal.log(Level.WARNING, "clock", message, seconds=round(by_s))

    async def _save_elapsed(self) -> None:
        live = self._live
        loop_time = asyncio.get_running_loop().time()
        if live.running_since_s is None:
            return
        seconds = loop_time - live.running_since_s
        try:
            async with live.database.writing() as session:
                await mission_queries.add_elapsed(session, live.id, seconds, now())
        except Exception as error:
            live.journal.storage.note(error)  # the next time counts these seconds, too
            return
        live.running_since_s += seconds
        live.header.elapsed_s += seconds


def _learn(builder: MapBuilder) -> None:
    """Learn the map's model, unless another mission does: decisions must not wait until all threads have learned."""
    if _LEARNING.acquire(blocking=False):
        try:
            builder.learn()
        finally:
            _LEARNING.release()


def _log_failure(done: Future[None]) -> None:
    error = None if done.cancelled() else done.exception()
    if error is not None:
        log.error("learning the map's model failed; the last one stays in use", exc_info=error)
