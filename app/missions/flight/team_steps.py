"""Flies a mission whose vehicles go together: in steps, each decided for all of them when the last is flown.

Searches need what every vehicle saw at its last place, and a team with short links stays together.
"""

import asyncio

import numpy as np

from app.missions.fleet.interface import WaypointStatus
from app.missions.flight.decisions.deciding import DECIDE_AGAIN_S, Decider, place_ahead, place_of
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Place
from app.missions.flight.decisions.step_maps import StepMaps
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.stragglers import missed, step_allowed_s, tell_of
from app.missions.flight.observation.waiting import Waiting
from app.missions.flight.search_hooks import SearchHooks
from app.missions.live.mission import LiveMission
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member

REPORT_DELAY_S = 0.1
"""How old a vehicle's last report is at most, on the wall clock."""


class TeamSteps:
    """Flies one running mission step by step.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(
        self,
        live: LiveMission,
        decider: Decider,
        leg_commit: LegCommit,
        dispatch: Dispatch,
        maps: StepMaps,
        waiting: Waiting,
        search_hooks: SearchHooks,
        time_scale: float,
    ) -> None:
        self._live = live
        self._decider = decider
        self._leg_commit = leg_commit
        self._dispatch = dispatch
        self._maps = maps
        self._waiting = waiting
        self._search_hooks = search_hooks
        self._time_scale = time_scale

    @property
    def _spec(self) -> MissionSpec:
        """What the mission is to do, which may change while it is flown."""
        return self._live.spec

    async def fly(self, *, resumed: bool) -> str:
        """Fly all remaining steps; returns why there are no more. ``resumed``: legs of an earlier run come first."""
        live = self._live
        if resumed:
            await self._waiting.for_team(patient_s=step_allowed_s(self._live) / self._time_scale)
            await self._dispatch.begin()
            await self._arrive(self._deadline_s())
        decision: Decision | None = None
        while live.header.step < self._spec.steps and (
            self._somebody_surveys or live.team.held or live.awaits_batteries
        ):
            if live.awaits_batteries:
                await self._waiting.for_batteries(f", {self._spec.steps - live.header.step} steps before the end")
                continue
            if not self._somebody_surveys:
                await self._waiting.until(lambda: self._somebody_surveys or not live.team.held, None)
                continue
            started_s = asyncio.get_running_loop().time()
            if decision is None:
                await self._waiting.for_team(
                    patient_s=None if live.header.step else step_allowed_s(self._live) / self._time_scale
                )
                await self._search_hooks.look_round()
                decision = await self._decide_to_fly()
                if decision is None:
                    continue
            for member in live.team.surveying:
                member.drop_legs()
            number = live.header.step + 1
            await self._leg_commit.commit(decision, {leg.vehicle: number for leg in decision.legs})
            await self._dispatch.begin()
            await self._send_until_flown()
            taken = decision
            # The map is made and its model refined while the vehicles travel.
            self._maps.begin()
            decision = await self._travel()
            if over := await self._search_hooks.why_over(taken, asyncio.get_running_loop().time() - started_s):
                if not live.team.held:
                    return over
                # Those that are back have nothing to do; who is held is not left at sea.
                await self._waiting.until(lambda: not live.team.held, None)
                decision = None
        if live.header.step < self._spec.steps:
            return "nobody surveys any more"
        return f"every step is done{live.team.missed_words()}"

    async def _decide_to_fly(self) -> Decision | None:
        """Decide a step that at least one vehicle flies: one in which nobody may go anywhere is no step.

        None where nobody is there to fly any more.
        """
        while self._live.team.plannable:
            number = self._live.header.step + 1
            decision = await self._decider.decide_to_fly(number, self._places(), self._search_hooks.task(number))
            if decision:
                return decision[0]
            await asyncio.sleep(DECIDE_AGAIN_S / self._time_scale)
            await self._waiting.for_team()
        return None

    async def _travel(self) -> Decision | None:
        """Wait until the vehicles arrived; returns the next step's decision when it could be made on the way.

        Deciding takes a moment in which vehicles would wait. So it begins when all of them are about to arrive, for the
        places where they will be. Whether they really came there decides whether the decision counts.
        """
        deadline_s, live = self._deadline_s(), self._live
        close = await self._waiting.until(
            lambda: (
                all(self._about_to_arrive(m) for m in live.team.surveying if m.busy)
                or bool(self._search_hooks.barred())
            ),
            deadline_s,
        )
        last = live.header.step >= self._spec.steps
        if not close or last or not live.team.plannable or self._search_hooks.barred():
            await self._arrive(deadline_s)
            return None
        planner = self._decider.planner
        memory, number = planner.snapshot(), live.header.step + 1
        expected = [place_ahead(member, live) for member in live.team.plannable]
        deciding = asyncio.create_task(self._decider.decide(number, expected, self._search_hooks.task(number)))
        try:
            await self._arrive(deadline_s)
            [decision] = await deciding
        finally:
            deciding.cancel()
        flown = not all(leg.refusal for leg in decision.legs)
        if flown and self._came_true(expected) and self._search_hooks.still_clear(decision):
            return decision
        planner.restore(memory)
        return None

    def _about_to_arrive(self, member: Member) -> bool:
        """Tell whether a vehicle will be at its waypoint by the time a decision takes."""
        if member.target_m is None or member.report is None:
            return False
        left_m = float(np.linalg.norm(member.target_m - member.place_m(self._live.frame)))
        ahead_s = (self._decider.takes_s + REPORT_DELAY_S) * self._time_scale
        return left_m <= self._spec.arrival_radius_m + self._spec.speed_of(member.spec) * ahead_s

    def _places(self) -> list[Place]:
        return [place_of(member, self._live) for member in self._live.team.plannable]

    def _came_true(self, expected: list[Place]) -> bool:
        """Tell whether the vehicles are the expected ones at the expected places."""
        there = {place.vehicle: place.en_m for place in self._places()}
        tolerance_m = 2 * self._spec.arrival_radius_m
        return there.keys() == {place.vehicle for place in expected} and all(
            np.linalg.norm(there[place.vehicle] - place.en_m) <= tolerance_m for place in expected
        )

    async def _send_until_flown(self) -> None:
        """Send the step again for as long as every vehicle refused it: what nobody took on is not over."""
        live = self._live
        while not live.flight.halted:
            ordered = [member for member in live.team if member.order is not None]
            if not ordered or not all(map(self._dispatch.has_refused, ordered)):
                return
            await asyncio.sleep(DECIDE_AGAIN_S / self._time_scale)
            await self._waiting.for_team()
            for member in live.team.plannable:
                if member.order is not None:
                    member.status = WaypointStatus.PLANNED
                    await self._dispatch.send_anew(member)

    async def _arrive(self, deadline_s: float) -> None:
        """Wait until every vehicle under way arrived or refused; at the deadline go on without the others."""
        if await self._waiting.until(
            lambda: not any(m.busy for m in self._live.team.surveying) or bool(self._search_hooks.barred()), deadline_s
        ):
            await self._end_early(self._search_hooks.barred())
            return
        late = [member for member in self._live.team.surveying if member.busy]
        if not late:
            return
        for member in late:
            self._dispatch.settle(member, WaypointStatus.MISSED, missed(step_allowed_s(self._live)))
        number = self._live.header.step
        await tell_of(self._live, late, f"step {number} goes on without {', '.join(m.name for m in late)}", number)

    async def _end_early(self, barred: list[Member]) -> None:
        """Where something stands on a vehicle's way, end the step: everybody is sent anew from where it is."""
        if not barred:
            return
        for member in self._live.team.surveying:
            if member.busy:
                reason = "something stands on its way" if member in barred else "the step ended before it was there"
                self._dispatch.settle(member, WaypointStatus.MISSED, reason)
        await self._search_hooks.tell_of(barred)

    @property
    def _somebody_surveys(self) -> bool:
        team = self._live.team
        return bool(team.surveying) or not list(team)

    def _deadline_s(self) -> float:
        """Return the event loop's time at which a step that begins now goes on without stragglers."""
        return asyncio.get_running_loop().time() + step_allowed_s(self._live) / self._time_scale
