"""Flies a mission whose vehicles do not wait for each other: each has its own legs, and more of them ahead.

A decision is made for whoever will need a leg next, from where its last one ends and with everybody else's legs as they
are, long before the vehicle is there. So nobody waits for a decision, for a slower vehicle, or for one that is lost.
"""

import asyncio
from dataclasses import replace

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.missions.flight.decisions.deciding import Decider, moved_on, place_ahead
from app.missions.flight.decisions.leg import Place
from app.missions.flight.decisions.step_maps import StepMaps
from app.missions.flight.legs.assignment import LegAssignment
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.demand import LegDemand
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.legs.exchange import LegExchange
from app.missions.flight.legs.length_change import LengthChange
from app.missions.flight.legs.spacing import LegSpacing
from app.missions.flight.observation.waiting import Waiting
from app.missions.flight.orders import OrderBook
from app.missions.flight.survey_end import SurveyEnd
from app.missions.live.mission import LiveMission
from app.missions.live.remaining import left_words
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.task.way import planned_way_m
from app.missions.team import Member, WithdrawalCause


class OwnLegs:
    """Flies one running mission, every vehicle on its own time.

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
        constraints: Constraints,
        time_scale: float,
        energy_range: EnergyRange,
        orders: OrderBook,
    ) -> None:
        self._live = live
        self._decider = decider
        self._leg_commit = leg_commit
        self._dispatch = dispatch
        self._maps = maps
        self._waiting = waiting
        self._constraints = constraints
        self._time_scale = time_scale
        self._range = energy_range
        self._orders = orders
        self._demand = LegDemand(live, lambda: decider.takes_s, time_scale)
        self._end = SurveyEnd(live, decider.planner, self._demand, energy_range, time_scale)
        self._length = LengthChange(live, decider.planner, leg_commit, dispatch)
        self._spacing = LegSpacing(live, constraints)
        self._assignment = LegAssignment(live, self._demand, self._spacing, leg_commit, energy_range, dispatch.unflown)
        self._exchange = LegExchange(live, decider, leg_commit, energy_range, time_scale)

    @property
    def _spec(self) -> MissionSpec:
        """What the mission is to do, which may change while it is flown."""
        return self._live.spec

    async def fly(self, *, resumed: bool) -> str:
        """Fly until every vehicle has used up its way; returns why nobody goes on.

        ``resumed``: the mission had begun in an earlier run.
        """
        patient_s: float | None = self._spec.step_deadline_s / self._time_scale
        if resumed and not self._length.is_due:
            # The service may have been killed before they were taken back.
            await self._length.take_back_beyond(begun=True)
        sending = asyncio.create_task(self._dispatch.keep())
        try:
            while not self._is_over():
                if self._length.is_due:
                    await self._fit_to_length()
                self._demand.look_now(await self._orders.look())
                if await self._take_lines_back():
                    continue  # meanwhile somebody may have flown its way
                if self._end.awaits_batteries:
                    await self._waiting.for_batteries(left_words(self._spec, self._live.team))
                    continue
                if patient_s is not None or self._end.nobody_to_lead:
                    await self._waiting.for_team(patient_s=patient_s)
                    patient_s = None
                for member in self._end.flown_out():
                    self._live.withdraw(
                        member, Response.RETURN, "it has flown its way", cause=WithdrawalCause.PART_DONE
                    )
                getting = self._demand.members()
                if getting:
                    await self._decide(getting)
                    continue
                await self._until_needed(sending)
        finally:
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)
        return self._end.reason()

    def _is_over(self) -> bool:
        # Where the length has changed, who had nothing left to do may have.
        return not self._length.is_due and self._end.is_reached()

    async def _fit_to_length(self) -> None:
        """Take up another length: legs beyond its end are taken back, and who had nothing left to do is looked at."""
        self._end.look_again()
        self._demand.look_now()
        self._exchange.look_again()
        await self._length.fit()

    async def _take_lines_back(self) -> bool:
        """Let the planner know which lines vehicles have left, and where: nothing of these is flown yet.

        Returns whether there were any.
        """
        if not self._dispatch.unflown.any_left_line:
            return False
        planner, space = self._decider.planner, await self._live.in_thread(FreeSpace, self._constraints, 0.0)
        for name, place_m, ends_m in self._dispatch.unflown.take_left_lines():
            planner.leave(name, space.nearest(place_m), ends_m)
        # What was stored with the legs has these as flown, and a restart would go on from that.
        await self._leg_commit.remember(planner.snapshot())
        return True

    async def _until_needed(self, sending: asyncio.Task[None]) -> None:
        if sending.done():
            sending.result()  # raises what went wrong
        # The map is made while vehicles fly, decided for or not.
        self._maps.begin()
        await self._waiting.until(
            lambda: (
                bool(self._demand.members())
                or self._orders.waiting
                or self._length.is_due
                or self._end.is_reached()
                or self._end.nobody_to_lead
                or self._end.awaits_batteries
                or bool(self._end.flown_out())
                or sending.done()
            ),
            self._demand.next_look_s(),
        )

    async def _decide(self, getting: list[Member]) -> None:
        """Decide the next leg of some vehicles, and commit it."""
        live = self._live
        if self._demand.is_unhurried(getting):
            await self._exchange.look()
            # Writing may take as long as the disk is full: who fell silent meanwhile gets none.
            getting = self._demand.members()
            if not getting:
                return
        budget = self._spec.budget
        names = {member.name for member in getting}
        numbers = {member.name: self._demand.next_number(member) for member in getting}
        at_rest = self._end.at_rest(getting)
        places = [self._place(member, moving=member.name in names) for member in live.team.plannable]
        places = [replace(place, at_rest=place.vehicle in at_rest) for place in places]
        # What vehicles measure on legs that they are still to fly may leave something to do.
        all_flown = not any((m.ordered or m.ahead) and not m.misses for m in live.team.plannable)
        planner = self._decider.planner
        memory, committed = planner.snapshot(), False
        not_assigned: dict[str, list[FloatArray]] = {}
        legs, attempt = self._demand.legs_at_once(getting), self._spacing.most_refusals(names)
        decisions = await self._decider.decide_to_fly(max(numbers.values()), places, legs=legs, attempt=attempt)
        if self._spec.budget != budget:
            # It was decided for what was left of another length.
            planner.restore(memory)
            return
        self._demand.note_decided(names)
        done = self._end.note_decided(getting, decisions, at_rest, all_flown=all_flown)
        self._demand.look_later(names if not decisions else done)
        if not self._demand.measured:
            # What is planned for good leaves nothing to wait for.
            self._end.call_home(done)
        for later, decision in enumerate(decisions):
            starts = {place.vehicle: place.en_m for place in places}
            places = moved_on(places, decision)
            numbers_now = {name: number + later for name, number in numbers.items()}
            assigned_m = await self._assignment.assign(decision, starts, numbers_now)
            committed |= bool(assigned_m)
            for leg in self._assignment.not_assigned(decision, assigned_m):
                not_assigned.setdefault(leg.vehicle, []).append(leg.target_m[:2])
            # Who did not get this leg gets none that goes on from it.
            numbers = {name: numbers[name] for name, now in numbers_now.items() if self._assignment.has_leg(name, now)}
        # What it plans is still to be flown.
        if not committed:
            planner.restore(memory)
        else:
            for name, ends in not_assigned.items():
                planner.put_back(name, np.array(ends))
            if not_assigned:
                # What was stored with the legs has these as flown, and a restart would go on from that.
                await self._leg_commit.remember(planner.snapshot())
        self._maps.begin()

    def _place(self, member: Member, *, moving: bool) -> Place:
        left_m = planned_way_m(self._spec, member.way_left_m(self._spec)) if self._demand.wants_legs(member) else 0.0
        energy_m = self._range.beyond_m(member)
        if energy_m is not None:
            left_m = min(left_m, energy_m)
        return replace(place_ahead(member, self._live), moving=moving, left_m=left_m)
