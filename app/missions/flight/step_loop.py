"""The step loop of one running mission.

Every start is a recovery: the loop takes the mission up from its last committed step, whether it was just started,
paused, or killed in the middle. A step's decision, waypoints and planner memory are one transaction; waypoints are sent
after it. So a crash between any two moments loses nothing and repeats nothing but the sending, which is harmless.
"""

import asyncio
import math
from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np

from app.exploration.core.problem import Planner
from app.exploration.planners import create_planner
from app.missions import metrics
from app.missions.clock import now
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import (
    VehicleRefusedError,
    WaypointReport,
    WaypointStatus,
)
from app.missions.flight.commit import StepCommit
from app.missions.flight.decision import Decision, Place, decide, make_constraints
from app.missions.flight.elapsed_time import keep_time, save_elapsed
from app.missions.flight.engagement import Engagement
from app.missions.flight.search_hooks import SearchHooks
from app.missions.flight.step_maps import StepMaps
from app.missions.flight.telemetry_sampler import keep_telemetry
from app.missions.live.mission import LiveMission
from app.missions.spec.mission import Guidance
from app.missions.team import SETTLED, Member
from app.missions.views.mission import Level
from app.storage import missions as mission_queries
from app.storage.uncancellable import to_the_end
from imc_bridge.control.plans import leg_time_s

PACE_MEMORY = 0.9
"""Weight of the past in the running mean of a step's duration."""

EXPECTED_DECISION_S = 0.3
"""How long a decision is taken to last before the first was made."""

SOUND_S = 60.0
"""What commands and reports take by sound, at the most."""

DECIDE_AGAIN_S = 5.0
"""How long vehicles wait, by their clock, when nobody may go anywhere, until that is looked at again."""

REPORT_DELAY_S = 0.1
"""How old a vehicle's last report is at most, on the wall clock."""


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
        self._turned_down: set[str] = set()
        """Vehicles that refused the step's waypoint when it was sent."""
        self._maps = StepMaps(live, executor, time_scale)
        self._lookout = SearchHooks(live, time_scale, self._wait)
        self._committing = StepCommit(live, self._constraints, leads=not self._lookout.needed)

    async def run(self) -> str:
        """Fly all remaining steps. Returns why there are no more; raises whatever went wrong."""
        live = self._live
        live.running_since_s = asyncio.get_running_loop().time()
        metrics.RUNNING.inc()
        keepers = [
            asyncio.create_task(Engagement(live, self._hub, self._time_scale, self._send_to).keep()),
            asyncio.create_task(keep_time(live)),
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
                    decision = await self._decide_to_fly(planner)
                await self._committing.commit(decision)
                await self._send()
                await self._send_until_flown()
                taken = decision
                # The map is made and its model refined while the vehicles travel.
                self._maps.begin()
                decision = await self._travel(planner)
                step_s = asyncio.get_running_loop().time() - started_s
                self._keep_pace(step_s)
                if await self._lookout.is_over(taken, step_s):
                    return "everybody is back at the entry"
            return "every step is done"
        finally:
            metrics.RUNNING.dec()
            for keeper in keepers:
                keeper.cancel()
            await asyncio.gather(*keepers, return_exceptions=True)
            await self._maps.end()
            await to_the_end(save_elapsed(live))
            live.running_since_s = None
            live.standstill = ""

    async def _recover(self) -> Planner:
        """Take up the last committed step: the planner's memory, and the waypoints that were not settled."""
        planner = create_planner(self._spec.planner.name, self._spec.planner.options, self._live.planning_sensor)
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
                self._committing.order(row, member)
                again.append(row)
        self._live.waypoints.show_rows(again, WaypointStatus.PLANNED)
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
        flown = not all(leg.refusal for leg in decision.legs)
        if flown and self._came_true(expected) and self._lookout.still_clear(decision):
            return decision
        planner.restore(memory)
        return None

    def _about_to_arrive(self, member: Member) -> bool:
        """Tell whether a vehicle will be at its waypoint by the time a decision takes."""
        if member.target_m is None or member.report is None:
            return False
        left_m = float(np.linalg.norm(member.target_m - member.place_m(self._live.frame)))
        ahead_s = (self._decision_s + REPORT_DELAY_S) * self._time_scale
        return left_m <= self._spec.arrival_radius_m + self._spec.speed_mps * ahead_s

    def _places(self, *, ahead: bool = False) -> list[Place]:
        """Return where the vehicles are that can be planned for; ``ahead``: or will be, where they are under way."""
        return [
            Place(
                member.name,
                member.target_m
                if ahead and member.busy and member.target_m is not None
                else member.place_m(self._live.frame),
                member.report.heading_rad if member.report and member.report.heading_rad is not None else math.nan,
                member.cruise_depth_m(self._spec.limits),
                member.report.position_sd_m if member.report and member.report.position_sd_m is not None else math.nan,
                member.report.position.depth_m if member.surfacing and member.report else math.nan,
                member.capabilities.keeps_depth,
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

    async def _decide(self, planner: Planner, places: list[Place]) -> Decision:
        """Bring the map up to date, then make the decision, in a worker thread."""
        live = self._live
        started_s = asyncio.get_running_loop().time()
        await live.journal.storage.done(self._maps.renew)

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

    async def _decide_to_fly(self, planner: Planner) -> Decision:
        """Decide a step that at least one vehicle flies: one in which nobody may go anywhere is no step.

        While there is none, it is told why, and decided anew when something has changed, at least once a while.
        """
        told: list[str] = []
        while True:
            memory = planner.snapshot()
            decision = await self._decide(planner, self._places())
            refusals = [f"{leg.vehicle}: {leg.refusal}" for leg in decision.legs]
            if not refusals or not all(leg.refusal for leg in decision.legs):
                self._live.standstill = ""
                return decision
            planner.restore(memory)
            if refusals != told:
                told = refusals
                self._live.standstill = "; ".join(refusals)
                self._live.publish_summary()
                await self._live.journal.log(
                    Level.ALARM,
                    "waiting",
                    f"no vehicle can be sent anywhere: {self._live.standstill}; they stay, and the step does not count",
                    vehicles=[leg.vehicle for leg in decision.legs],
                )
            await asyncio.sleep(DECIDE_AGAIN_S / self._time_scale)
            await self._gather_team(patient=False)

    async def _send_until_flown(self) -> None:
        """Send the step again for as long as every vehicle refused it: what nobody took on is not over."""
        live = self._live
        while not live.halted:
            ordered = [member for member in live.team if member.order is not None]
            if not ordered or not all(member.name in self._turned_down for member in ordered):
                return
            await asyncio.sleep(DECIDE_AGAIN_S / self._time_scale)
            await self._gather_team(patient=False)
            for member in live.team.present:
                if member.order is not None:
                    member.status = WaypointStatus.PLANNED
                    self._turned_down.discard(member.name)
                    await self._send_to(member)

    async def _send(self) -> None:
        self._turned_down.clear()
        await asyncio.gather(
            *(self._send_to(member) for member in self._live.team if member.engaged and member.ordered)
        )

    async def _send_to(self, member: Member) -> None:
        if member.order is None or self._live.halted:
            return
        try:
            await self._hub.order(member.key, member.order)
        except VehicleRefusedError as error:
            member.engaged = False
            self._turned_down.add(member.name)
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
                float(np.linalg.norm(member.target_m - member.place_m(self._live.frame))),
                member.order.position.depth_m,
                member.order.speed_mps,
            )
            + (SOUND_S if member.spec.guidance is Guidance.ACOUSTIC else 0.0)
            for member in self._live.team
            if member.spec.guidance is not Guidance.FOLLOW and member.report is not None
            if member.order is not None and member.target_m is not None
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
