"""Flies a mission whose vehicles do not wait for each other: each has its own legs, and more of them ahead.

A decision is made for whoever will need a leg next, from where its last one ends and with everybody else's legs as they
are, long before the vehicle is there. So nobody waits for a decision, for a slower vehicle, or for one that is lost.
"""

import asyncio
import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from shapely import Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.routes import FreeSpace
from app.exploration.planners import COVERERS
from app.missions.flight.decisions.deciding import DECIDE_AGAIN_S, Decider, moved_on, place_ahead
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg, Place
from app.missions.flight.decisions.separation import too_close, ways_aside
from app.missions.flight.decisions.step_maps import StepMaps
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.legs.exchange import LegExchange
from app.missions.flight.observation.waiting import Waiting
from app.missions.flight.orders import OrderBook
from app.missions.live.mission import LiveMission
from app.missions.live.remaining import left_words
from app.missions.safety import free_space
from app.missions.spec.budget import Budget
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import INSET_M
from app.missions.task.survey_lines import lengths_words
from app.missions.task.way import LEAST_WAY_M, least_way_m, planned_way_m, way_m
from app.missions.team import Member, WithdrawalCause
from app.missions.views.mission import Level

AHEAD = 2
"""Legs that a vehicle has after the one it flies."""

AHEAD_WHEN_WATCHED = 1
"""The same where targets move, or vehicles come up by what they say of their position: decisions follow closer."""

LEAD_S = 2.0
"""So long before its last leg ends, by its clock, a vehicle gets another one where what it measures decides on that."""

DECISIONS_AHEAD = 3.0
"""How many decisions' time a vehicle's legs last at least."""

MOST_AHEAD = 20

PATIENCE = 1
"""How often a vehicle waits for others to pass before it goes aside."""

NOT_WAITED_FOR = 3
"""A vehicle that misses so many legs in a row is no longer waited for when the others have flown their ways."""

SOON = 1.3
"""A vehicle whose legs end within this many times the usual lead is decided for together with one that needs a leg."""

HARDLY_BEGUN = 0.6
"""A leg is decided together with those of others where no more than this part of a longest leg is left before it."""

ANYWHERE = 2.0
"""Who can still fly this many times across the area has nothing left to survey when its planner has no leg for it."""

LINES_FLOWN = "all lines are flown"

LEAST_TOLD_M = 5.0
"""Less of lines that are left is not told: where they end they are cut short."""

TOLD_PCT = 0.1
"""A mission that leaves more of its area unseen says so when it ends."""


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
        self._range = energy_range
        self._orders = orders
        self._constraints = constraints
        self._live = live
        self._decider = decider
        self._leg_commit = leg_commit
        self._dispatch = dispatch
        self._maps = maps
        self._waiting = waiting
        self._exchange = LegExchange(live, decider, leg_commit, energy_range, time_scale)
        self._time_scale = time_scale
        self._watched = bool(live.spec.targets) or live.spec.surface_policy is not None
        self._measured = live.spec.planner.name in COVERERS
        """Whether legs follow from what was measured on those just before."""
        self._ahead = 0 if self._measured else AHEAD_WHEN_WATCHED if self._watched else AHEAD
        self._taking_part = {member.name for member in live.team if member.legs}
        """Vehicles that go on with their own numbers: they had legs, and were not away since."""
        self._absent_since_s: dict[str, float] = {}
        self._refusals: dict[str, int] = {}
        """How often in a row vehicles got no leg because of others."""
        self._again_at_s: dict[str, float] = {}
        """When vehicles that got no leg are looked at again, the event loop's time."""
        self._done: set[str] = set()
        """Vehicles for which nothing was left to do when all that was flown had been looked at."""
        self._idle: set[str] = set()
        """Vehicles that had flown all their legs when there was nothing for them."""
        self._sent_home: set[str] = set()
        """Vehicles that were sent home with what was too little of their way for a further line."""
        self._left_pct = 0.0
        """Share of the area that was not ensonified when that was last looked at."""

    @property
    def _spec(self) -> MissionSpec:
        """What the mission is to do, which may change while it is flown."""
        return self._live.spec

    async def fly(self, *, resumed: bool) -> str:
        """Fly until every vehicle has used up its way; returns why nobody goes on.

        ``resumed``: the mission had begun in an earlier run.
        """
        patient_s: float | None = self._spec.step_deadline_s / self._time_scale
        if resumed and not self._length_changed:
            # The service may have been killed before they were taken back.
            await self._give_back_beyond(self._spec.budget, begun=True)
        sending = asyncio.create_task(self._dispatch.keep())
        try:
            while not self._over():
                if self._length_changed:
                    await self._fit_legs()
                for name in await self._orders.look():
                    self._again_at_s.pop(name, None)
                if await self._take_lines_back():
                    continue  # meanwhile somebody may have flown its way
                if self._awaits_batteries:
                    await self._waiting.for_batteries(left_words(self._spec, self._live.team))
                    continue
                if patient_s is not None or self._nobody_to_lead:
                    await self._waiting.for_team(patient_s=patient_s)
                    patient_s = None
                for member in self._flown_out():
                    self._live.withdraw(
                        member, Response.RETURN, "it has flown its way", cause=WithdrawalCause.PART_DONE
                    )
                getting = self._who_gets_legs()
                if getting:
                    await self._decide(getting)
                    continue
                await self._until_needed(sending)
        finally:
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)
        left = [m for m in self._live.team.surveying if self._wants_legs(m) or m.ordered or m.ahead]
        if self._done and any(self._wants_legs(member) for member in left):
            return self._all_seen() if self._measured else self._with_lines("nobody can fly a further line")
        team = self._live.team
        gave_up = (m for m in team if m.withdrawal is not None and not m.withdrawal.done)
        if any(m.name not in self._sent_home and self._has_way(m) for m in gave_up):
            return f"nobody surveys any more{left_words(self._spec, self._live.team)}"
        words = "every step is done" if self._spec.budget.steps is not None else "everybody has flown its way"
        words = self._with_lines(words)
        words += f" but {', '.join(m.name for m in left)}" if left else ""
        return words + team.missed_words({m.name for m in left})

    def _with_lines(self, words: str) -> str:
        """Return why nobody goes on, in words, and what that says of lines that were asked for."""
        if not self._spec.lines_asked_for:
            return words
        planner = self._decider.planner.planner
        left_m, by_name = planner.lines_left_m(), planner.lines_left()
        named = {name: one_m for name, one_m in by_name.items() if one_m > LEAST_TOLD_M}
        if left_m <= LEAST_TOLD_M or (by_name and not named):
            return LINES_FLOWN
        return f"{words}: {left_m / 1000.0:.2f} km of lines are not flown" + (
            f": {lengths_words(named)}" if named else ""
        )

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

    @property
    def _length_changed(self) -> bool:
        return self._live.fitted_budget != self._spec.budget

    async def _fit_legs(self) -> None:
        """Take up another length: legs beyond its end are taken back, and who had nothing left to do is looked at."""
        self._live.fitted_budget = budget = self._spec.budget
        self._done, self._idle, self._sent_home = set(), set(), set()
        self._again_at_s = {}
        self._exchange.look_again()
        await self._give_back_beyond(budget, begun=False)

    async def _give_back_beyond(self, budget: Budget, *, begun: bool) -> None:
        """Take legs back that are not begun and end beyond the mission's end.

        ``begun``: only those that begin there. What is left of a vehicle's way before them is decided anew.
        """
        planner, given_back = self._decider.planner, False
        for member in self._live.team.surveying:
            keep = self._legs_within(member, begun=begun)
            if keep == len(member.ahead):
                continue
            ends_m = self._dispatch.spare_after(member, keep, f"the mission ends after {budget.words}")
            if member.asked is None:
                planner.put_back(member.name, np.array(ends_m))
                given_back = True
        if given_back:
            # What was stored with the legs has these as flown, and a restart would go on from that.
            await self._leg_commit.remember(planner.snapshot())

    def _legs_within(self, member: Member, *, begun: bool) -> int:
        """Return how many of the legs that a vehicle has ahead end within its way, with ``begun`` begin there."""
        ahead, spec = member.ahead, self._spec
        if spec.budget.steps is not None:
            return sum(leg.number <= spec.steps for leg in ahead)
        allowed_m, begin_m = spec.allowance(member.spec).metres, member.target_m if member.ordered else None
        if allowed_m is None or not ahead or (begin_m is None and member.report is None):
            return len(ahead)
        begin_m = member.place_m(self._live.frame) if begin_m is None else begin_m
        ends_m, over_m = [begin_m, *(leg.target_m for leg in ahead)], member.committed_m + member.late_m - allowed_m
        keep = len(ahead)
        while keep and over_m > LEAST_WAY_M:
            last_m = way_m(ends_m[keep - 1 : keep + 1], spec)
            if begun and over_m < last_m:
                break
            over_m -= last_m
            keep -= 1
        return keep

    def _all_seen(self) -> str:
        but = f" but {self._left_pct:.1f} % of the area, which lines do not see" if self._left_pct >= TOLD_PCT else ""
        return f"nothing is left to ensonify{but}"

    async def _until_needed(self, sending: asyncio.Task[None]) -> None:
        if sending.done():
            sending.result()  # raises what went wrong
        now_s = asyncio.get_running_loop().time()
        # Whose time has come and who gets no leg all the same needs none now: waiting for it would be no waiting.
        later_s = min((at_s for at_s in self._again_at_s.values() if at_s > now_s), default=None)
        # Vehicles come nearer to the end of their legs without telling anything new.
        fastest_mps = max((self._spec.speed_of(member.spec) for member in self._live.team), default=1.0)
        soon_s = now_s + 0.5 * self._spec.limits.max_step_m / (fastest_mps * self._time_scale)
        if self._measured:
            soon_s = min(soon_s, now_s + 0.2 * self._lead_s)
        # The map is made while vehicles fly, decided for or not.
        self._maps.begin()
        await self._waiting.until(
            lambda: (
                bool(self._who_gets_legs())
                or self._orders.waiting
                or self._length_changed
                or self._over()
                or self._nobody_to_lead
                or self._awaits_batteries
                or bool(self._flown_out())
                or sending.done()
            ),
            soon_s if later_s is None else min(later_s, soon_s),
        )

    async def _decide(self, getting: list[Member]) -> None:
        """Decide the next leg of some vehicles, and commit it."""
        live = self._live
        unhurried_s = 2.0 * DECISIONS_AHEAD * self._decider.takes_s
        if not self._watched and all(self._lasts_s(member) > unhurried_s for member in getting):
            await self._exchange.look()
            # Writing may take as long as the disk is full: who fell silent meanwhile gets none.
            getting = self._who_gets_legs()
            if not getting:
                return
        budget = self._spec.budget
        names = {member.name for member in getting}
        numbers = {member.name: self._next_number(member) for member in getting}
        at_rest = {member.name for member in getting if not member.ordered and not member.ahead} & self._idle
        places = [self._place(member, moving=member.name in names) for member in live.team.plannable]
        places = [replace(place, at_rest=place.vehicle in at_rest) for place in places]
        # What vehicles measure on legs that they are still to fly may leave something to do.
        all_flown = not any((m.ordered or m.ahead) and not m.misses for m in live.team.plannable)
        planner = self._decider.planner
        memory, committed = planner.snapshot(), False
        not_given: dict[str, list[FloatArray]] = {}
        self._decider.attempt = max(self._refusals.get(name, 0) for name in names)
        decisions = await self._decider.decide_to_fly(max(numbers.values()), places, legs=self._legs_at_once(getting))
        if self._spec.budget != budget:
            # It was decided for what was left of another length.
            planner.restore(memory)
            return
        self._taking_part |= names
        self._again_at_s = {name: at_s for name, at_s in self._again_at_s.items() if name not in names}
        done = names & frozenset().union(*(decision.done for decision in decisions[:1]))
        self._left_pct = decisions[0].terms.get("left_pct", self._left_pct) if decisions else self._left_pct
        self._idle -= names
        self._idle |= {m.name for m in getting if m.name in done and not m.ordered and not m.ahead}
        # What vehicles were just measuring is not known yet.
        self._done = (self._done - names) | (done & at_rest if self._measured else done) if all_flown else set()
        self._look_later(names if not decisions else done)
        if not self._measured:
            # What is planned for good leaves nothing to wait for.
            self._call_home(done)
        for later, decision in enumerate(decisions):
            starts = {place.vehicle: place.en_m for place in places}
            places = moved_on(places, decision)
            given = await self._commit(decision, starts, {name: number + later for name, number in numbers.items()})
            committed |= bool(given)
            for leg in self._not_given(decision, given):
                not_given.setdefault(leg.vehicle, []).append(leg.target_m[:2])
            # Who did not get this leg gets none that goes on from it.
            numbers = {name: number for name, number in numbers.items() if self._has_leg(name, number + later)}
        # What it plans is still to be flown.
        if not committed:
            planner.restore(memory)
        else:
            for name, ends in not_given.items():
                planner.put_back(name, np.array(ends))
            if not_given:
                # What was stored with the legs has these as flown, and a restart would go on from that.
                await self._leg_commit.remember(planner.snapshot())
        self._maps.begin()

    def _not_given(self, decision: Decision, given_m: dict[str, FloatArray]) -> Iterable[Leg]:
        """Return the planned legs of a decision that no vehicle got, and that nobody is led to in another way."""
        for leg in decision.legs:
            end_m = given_m.get(leg.vehicle)
            gets_it = end_m is not None and np.array_equal(end_m, leg.target_m)
            is_led_round = self._dispatch.unflown.is_barred_end(leg.vehicle, leg.target_m[:2])
            if not leg.unplanned and not leg.refusal and not gets_it and not is_led_round:
                yield leg

    async def _commit(
        self, decision: Decision, starts_m: dict[str, FloatArray], numbers: dict[str, int]
    ) -> dict[str, FloatArray]:
        """Commit the legs of a decision that can be flown from where they were to begin; returns their ends, (3,)."""
        live = self._live
        begun = [
            leg
            for leg in decision.legs
            if leg.vehicle in numbers
            and (member := live.team.get(leg.vehicle)) is not None
            and member.controllable
            and member.legs < numbers[leg.vehicle]
            and self._wants_legs(member)
            and not self._dispatch.unflown.is_barred(leg.vehicle)
            and self._begins_at(member, starts_m[leg.vehicle])
            and self._comes_home_after(member, leg)
        ]
        wished, decision = decision.legs, self._apart(replace(decision, legs=begun))
        self._look_later({leg.vehicle for leg in decision.legs if leg.refusal})
        legs = [leg for leg in decision.legs if not leg.refusal]
        if legs:
            for leg in wished:
                if not leg.refusal and leg.vehicle in numbers and self._dispatch.unflown.is_barred(leg.vehicle):
                    # The planner takes it as flown, and it goes on from legs that are not.
                    self._dispatch.unflown.add_barred(leg.vehicle, [leg.target_m[:2]])
            await self._leg_commit.commit(replace(decision, legs=legs), numbers)
            live.changed.set()
        elif any(self._refusals.get(leg.vehicle) == 1 for leg in decision.legs):
            for note in decision.notes:
                await live.journal.log(Level.WARNING, "safety", note)
        return {leg.vehicle: leg.target_m for leg in legs}

    def _comes_home_after(self, member: Member, leg: Leg) -> bool:
        """Whether a vehicle's energy lasts for a leg and its way home after it; where not, it goes home."""
        if leg.refusal or self._range.allows(member, leg.target_m[:2]):
            return True
        if not member.ahead and not member.ordered:
            self._live.withdraw(member, Response.RETURN, "its energy lasts for its way home and for no further leg")
        # It flies the legs it has. Looked at again at once it would be decided for all that time, and others wait.
        self._look_later({member.name})
        return False

    def _call_home(self, done: frozenset[str] | set[str]) -> None:
        """Send vehicles home that have flown all that is planned for them and can fly no further line."""
        for member in self._live.team.plannable:
            idle = not member.ahead and not member.ordered
            if member.name in done and idle and self._spec.ends_at_home(member.spec):
                energy_m, left_m = self._range.beyond_m(member), member.way_left_m(self._spec)
                if self._spec.lines_asked_for:
                    why, cause = "no line is left for it", WithdrawalCause.PART_DONE
                elif energy_m is not None and energy_m < left_m:
                    why, cause = "its energy lasts for its way home and for no further line", WithdrawalCause.CALLED
                elif left_m > ANYWHERE * float(np.hypot(*np.ptp(self._spec.local_area(), axis=0))):
                    why, cause = "nothing is left for it to survey", WithdrawalCause.PART_DONE
                else:
                    why = "what is left of its way is for going home and for no further line"
                    cause = WithdrawalCause.PART_DONE
                self._live.withdraw(member, Response.RETURN, why, cause=cause)
                self._sent_home.add(member.name)

    def _flown_out(self) -> list[Member]:
        """Return the vehicles that have flown their way and go home: none of them waits at sea for the others."""
        return [
            member
            for member in self._live.team.plannable
            if not self._has_way(member)
            and not member.ahead
            and not member.ordered
            and member.asked is None
            and self._spec.ends_at_home(member.spec)
        ]

    def _has_leg(self, name: str, number: int) -> bool:
        member = self._live.team.get(name)
        return member is not None and member.legs == number

    def _look_later(self, names: set[str]) -> None:
        again_at_s = asyncio.get_running_loop().time() + DECIDE_AGAIN_S / self._time_scale
        self._again_at_s |= dict.fromkeys(names, again_at_s)

    def _legs_at_once(self, getting: list[Member]) -> int:
        """Return how many legs are decided together, so that they last until the next decision is made."""
        if self._watched:
            return 1
        fastest_mps = max(self._spec.speed_of(member.spec) for member in self._live.team)
        way_m = (self._lead_s if self._measured else DECISIONS_AHEAD * self._decider.takes_s) * self._time_scale
        way_m *= fastest_mps
        idle = any(not member.ordered and not member.ahead for member in getting)
        return min(max(math.ceil(way_m / self._spec.limits.max_step_m), 1 + self._ahead * idle), MOST_AHEAD)

    def _begins_at(self, member: Member, start_m: FloatArray) -> bool:
        if not member.busy and not member.ahead:
            return True  # it is there or near it, and its way is looked at once more before it is sent
        return bool(np.array_equal(member.last_end_m(self._live.frame), start_m))

    def _apart(self, decision: Decision) -> Decision:
        """Give no leg to a vehicle that would come too close to another one on the way."""
        close = too_close(decision, self._live, self._spec)
        for name in {leg.vehicle for leg in decision.legs} - close.keys():
            self._refusals.pop(name, None)
        if not close:
            return decision
        for name in close:
            self._refusals[name] = self._refusals.get(name, 0) + 1
            aside = self._step_aside(decision, name) if self._refusals[name] > PATIENCE else None
            if aside is not None:
                return aside
        legs = [replace(leg, refusal=close.get(leg.vehicle, leg.refusal)) for leg in decision.legs]
        notes = [f"{name}: {reason}; it waits" for name, reason in close.items()]
        return replace(decision, legs=legs, notes=[*decision.notes, *notes])

    def _step_aside(self, decision: Decision, name: str) -> Decision | None:
        """Return a decision in which one vehicle goes somewhere else, so that nobody waits for each other for ever."""
        [planned] = [leg for leg in decision.legs if leg.vehicle == name]
        start = np.append(decision.origin_m[name], planned.target_m[2])
        others = [leg for leg in decision.legs if leg.vehicle != name and not leg.refusal]
        for target in self._ways_aside(start, planned, decision.bottom):
            legs = [*others, replace(planned, target_m=target)]
            tried = replace(decision, legs=legs)
            close = too_close(tried, self._live, self._spec)
            if name not in close:
                left = [replace(leg, refusal=close.get(leg.vehicle, "")) for leg in legs]
                return replace(tried, legs=left, notes=[*decision.notes, f"{name} goes aside to let others pass"])
        return None

    def _ways_aside(self, start: FloatArray, planned: Leg, bottom: Bottom) -> FloatArray:
        """Return where a vehicle may go in place of the end of its leg, (k, 3).

        Who comes in comes in elsewhere, or goes beside where it is: zones may bar all ways in but one.
        """
        if not planned.unplanned:
            return ways_aside(start, planned.target_m, self._constraints.for_plans, bottom)
        if free_space.distance_outside_m(Polygon(self._constraints.area), start[:2]) == 0.0:
            return np.zeros((0, 3))
        beside = free_space.ways_beside(self._constraints, start[:2], self._spec.limits.max_step_m)
        beside = beside[np.argsort(np.hypot(*(beside - planned.target_m[:2]).T), kind="stable")]
        ends = [*free_space.ways_in(self._constraints, start[:2], INSET_M), *beside]
        return np.array([np.append(end, planned.target_m[2]) for end in ends]).reshape(-1, 3)

    def _place(self, member: Member, *, moving: bool) -> Place:
        left_m = planned_way_m(self._spec, member.way_left_m(self._spec)) if self._wants_legs(member) else 0.0
        energy_m = self._range.beyond_m(member)
        if energy_m is not None:
            left_m = min(left_m, energy_m)
        return replace(place_ahead(member, self._live), moving=moving, left_m=left_m)

    def _next_number(self, member: Member) -> int:
        """Return the number of a vehicle's next leg: one that joins or comes back goes on with what others fly."""
        if member.name in self._taking_part or member.ordered or member.ahead:
            return member.legs + 1
        others = [m.legs - len(m.ahead) for m in self._live.team.plannable if m is not member]
        reached = min(others, default=self._live.header.step)
        return max(member.legs, min(reached, self._live.header.step)) + 1

    def _who_gets_legs(self) -> list[Member]:
        """Return the vehicles to decide for now: none, or those that need a leg, with others that soon will."""
        now_s = asyncio.get_running_loop().time()
        self._taking_part &= {member.name for member in self._live.team if member.controllable}
        able = [
            member
            for member in self._live.team.plannable
            if self._wants_legs(member)
            and self._again_at_s.get(member.name, -math.inf) <= now_s
            and len(member.ahead) < MOST_AHEAD
        ]
        if not any(self._needs_leg(member) for member in able):
            return []
        return [member for member in able if self._needs_leg(member) or self._will_need_leg(member)]

    def _needs_leg(self, member: Member) -> bool:
        if not member.ordered and not member.ahead:
            return True
        if self._measured:
            return self._lasts_s(member) < self._lead_s
        if len(member.ahead) < self._ahead:
            return True
        return not self._watched and self._lasts_s(member) < DECISIONS_AHEAD * self._decider.takes_s

    @property
    def _lead_s(self) -> float:
        """How long before a vehicle's legs end the next one is decided, on the wall clock, where they are measured."""
        # A vehicle rather circles for a slow decision than gets all the next ones from what is not measured yet.
        shortest_s = LEAD_S / self._time_scale
        return shortest_s + DECISIONS_AHEAD * min(self._decider.takes_s, shortest_s)

    def _will_need_leg(self, member: Member) -> bool:
        if self._measured:
            return self._lasts_s(member) < SOON * self._lead_s
        # Where decisions are slow one for everybody takes the time of one for somebody.
        others_s = len(self._live.team.plannable) * self._decider.takes_s
        if not self._watched and self._lasts_s(member) < DECISIONS_AHEAD * self._decider.takes_s + others_s:
            return True
        left_m = self._left_of_leg_m(member)
        return len(member.ahead) <= self._ahead and left_m <= HARDLY_BEGUN * self._spec.limits.max_step_m

    def _left_of_leg_m(self, member: Member) -> float:
        if member.target_m is None or member.report is None or not member.ordered:
            return 0.0
        return float(np.linalg.norm(member.target_m - member.place_m(self._live.frame)))

    def _lasts_s(self, member: Member) -> float:
        """Return how long a vehicle's legs last, on the wall clock."""
        speed_mps = self._spec.speed_of(member.spec) * self._time_scale
        return member.way_ahead_m(self._live.frame) / speed_mps

    def _over(self) -> bool:
        """Whether everybody has flown its way; who does not get on, or is out of reach for long, keeps nobody.

        Who is held with some of its way left is waited for.
        """
        if self._length_changed:
            return False  # who had nothing left to do may have
        team = self._live.team.surveying
        left = [
            m
            for m in team
            if (self._wants_legs(m) and (m.name not in self._done or m.asked is not None)) or m.ordered or m.ahead
        ]
        if not left:
            held = any(self._has_way(m) for m in self._live.team.held)
            return bool(list(self._live.team)) and not held and not self._awaits_batteries
        names = {m.name for m in left}
        somebody_is_done = self._somebody_is_home or any(m.controllable for m in team if m.name not in names)
        if any(m.controllable and not (somebody_is_done and m.misses >= NOT_WAITED_FOR) for m in left):
            return False
        if not somebody_is_done and any(self._wants_legs(m) for m in left):
            return False
        patience_s = self._spec.step_deadline_s / self._time_scale
        return all(m.controllable or self._absent_s(m) >= patience_s for m in left)

    @property
    def _awaits_batteries(self) -> bool:
        """Whether nobody surveys, and somebody may do so again with another battery."""
        if not self._live.awaits_batteries:
            return False
        return any(self._has_way(m) and m.name not in self._sent_home for m in self._live.team)

    @property
    def _somebody_is_home(self) -> bool:
        """Whether a vehicle has flown its way and is home, or on its way there."""
        return any(
            m.withdrawal is not None and m.withdrawal.response is Response.RETURN and not self._has_way(m)
            for m in self._live.team
        )

    def _absent_s(self, member: Member) -> float:
        """Return for how long a vehicle has been out of reach, as far as anybody looked, on the wall clock."""
        now_s = asyncio.get_running_loop().time()
        if member.controllable:
            self._absent_since_s.pop(member.name, None)
            return 0.0
        return now_s - self._absent_since_s.setdefault(member.name, now_s)

    def _wants_legs(self, member: Member) -> bool:
        return member.withdrawal is None and self._has_way(member)

    def _has_way(self, member: Member) -> bool:
        if self._spec.budget.steps is not None:
            return self._next_number(member) <= self._spec.steps
        return member.way_left_m(self._spec) > least_way_m(self._spec)

    @property
    def _nobody_to_lead(self) -> bool:
        team = self._live.team
        if not list(team):
            return True
        somebody_wants_legs = any(self._wants_legs(member) for member in team.surveying)
        return not team.plannable and not self._somebody_is_home and somebody_wants_legs
