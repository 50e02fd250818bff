"""Which legs of a decision vehicles get: between deciding and committing a vehicle may have come elsewhere, or left."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np

from app.arrays import FloatArray
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.demand import LegDemand
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.legs.spacing import LegSpacing
from app.missions.flight.legs.unflown import UnflownLegs
from app.missions.live.mission import LiveMission
from app.missions.spec.failsafes import Response
from app.missions.team import Member
from app.missions.views.mission import Level


class LegAssignment:
    """Commits those of the decided legs that vehicles of a running mission can begin where they were to begin.

    Parameters
    ----------
    unflown
        Tells whose legs something bars; what goes on from these is noted there.
    """

    def __init__(
        self,
        live: LiveMission,
        demand: LegDemand,
        spacing: LegSpacing,
        leg_commit: LegCommit,
        energy_range: EnergyRange,
        unflown: UnflownLegs,
    ) -> None:
        self._live = live
        self._demand = demand
        self._spacing = spacing
        self._leg_commit = leg_commit
        self._range = energy_range
        self._unflown = unflown

    async def assign(
        self, decision: Decision, starts_m: Mapping[str, FloatArray], numbers: Mapping[str, int]
    ) -> dict[str, FloatArray]:
        """Commit what vehicles can fly of a decision, and return where these legs end, (3,), by vehicle.

        Parameters
        ----------
        starts_m
            Where the legs were to begin, (2,), by vehicle.
        numbers
            The legs' numbers; who is not in it gets none.
        """
        live = self._live
        begun = [
            leg
            for leg in decision.legs
            if leg.vehicle in numbers
            and (member := live.team.get(leg.vehicle)) is not None
            and member.controllable
            and member.legs < numbers[leg.vehicle]
            and self._demand.wants_legs(member)
            and not self._unflown.is_barred(leg.vehicle)
            and self._begins_at(member, starts_m[leg.vehicle])
            and self._comes_home_after(member, leg)
        ]
        wished, decision = decision.legs, self._spacing.apart(replace(decision, legs=begun))
        self._demand.look_later({leg.vehicle for leg in decision.legs if leg.refusal})
        legs = [leg for leg in decision.legs if not leg.refusal]
        if legs:
            self._bar_what_goes_on(wished, numbers)
            await self._leg_commit.commit(replace(decision, legs=legs), dict(numbers))
            live.changed.set()
        elif self._spacing.is_first_refusal(decision):
            for note in decision.notes:
                await live.journal.log(Level.WARNING, "safety", note)
        return {leg.vehicle: leg.target_m for leg in legs}

    def not_assigned(self, decision: Decision, ends_m: Mapping[str, FloatArray]) -> Iterable[Leg]:
        """Yield the planned legs of a decision that no vehicle got, and that nobody is led to in another way.

        ``ends_m``: what :meth:`assign` returned for it.
        """
        for leg in decision.legs:
            end_m = ends_m.get(leg.vehicle)
            gets_it = end_m is not None and np.array_equal(end_m, leg.target_m)
            is_led_round = self._unflown.is_barred_end(leg.vehicle, leg.target_m[:2])
            if not leg.unplanned and not leg.refusal and not gets_it and not is_led_round:
                yield leg

    def has_leg(self, name: str, number: int) -> bool:
        """Whether the last leg that was committed for a vehicle has this number."""
        member = self._live.team.get(name)
        return member is not None and member.legs == number

    def _bar_what_goes_on(self, wished: Iterable[Leg], numbers: Collection[str]) -> None:
        """Note the legs that go on from barred ones: the planner takes them as flown."""
        for leg in wished:
            if not leg.refusal and leg.vehicle in numbers and self._unflown.is_barred(leg.vehicle):
                self._unflown.add_barred(leg.vehicle, [leg.target_m[:2]])

    def _comes_home_after(self, member: Member, leg: Leg) -> bool:
        """Whether a vehicle's energy lasts for a leg and its way home after it; where not, it goes home."""
        if leg.refusal or self._range.allows(member, leg.target_m[:2]):
            return True
        if not member.ahead and not member.ordered:
            self._live.withdraw(member, Response.RETURN, "its energy lasts for its way home and for no further leg")
        # It flies the legs it has. Looked at again at once it would be decided for all that time, and others wait.
        self._demand.look_later({member.name})
        return False

    def _begins_at(self, member: Member, start_m: FloatArray) -> bool:
        if not member.busy and not member.ahead:
            return True  # it is there or near it, and its way is looked at once more before it is sent
        return bool(np.array_equal(member.last_end_m(self._live.frame), start_m))
