"""Exchanges legs that are decided and not begun for better ones, when the map has become newer since.

They are decided anew from where the legs before them end, as many as there are, by the planner, which takes its own
legs back.
What comes out is held to everything that a new leg is held to. It replaces the old legs in one transaction with the
planner's memory, or nothing is changed.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from app.missions.flight.decisions.deciding import Decider, place_ahead
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg, Place
from app.missions.flight.decisions.separation import too_close
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.live.mission import LiveMission
from app.missions.task.way import planned_way_m, way_m
from app.missions.team import CommittedLeg, Member

LEAD_DECISIONS, LEAD_S = 3.0, 2.0
"""A vehicle's next leg stays as it is where it begins within so many decisions' time and seconds by its clock."""

SAME_M = 1e-3
"""Legs that end no farther apart are the same."""


class LegExchange:
    """Looks for better legs than those that one running mission's vehicles have ahead.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(
        self, live: LiveMission, decider: Decider, leg_commit: LegCommit, energy_range: EnergyRange, time_scale: float
    ) -> None:
        self._live = live
        self._decider = decider
        self._leg_commit = leg_commit
        self._range = energy_range
        self._time_scale = time_scale
        self._looked_at: object = None
        """The newest map when legs were last decided anew."""

    def look_again(self) -> None:
        """Let the legs be decided anew on the same map: how far vehicles may fly has changed."""
        self._looked_at = None

    async def look(self) -> bool:
        """Decide the legs that are not begun anew, if there is a newer map than last time; whether any changed."""
        live = self._live
        if live.builder.newest is self._looked_at or live.flight.halted:
            return False
        old = {member.name: legs for member in live.team.plannable if (legs := self._open_legs(member))}
        planner = self._decider.planner
        memory, most = planner.snapshot(), {name: len(legs) for name, legs in old.items()}
        budget = live.spec.budget
        if not old or not planner.take_back(most):
            return False
        places = [self._place(member, old.get(member.name, [])) for member in live.team.plannable]
        number = max(legs[0].number for legs in old.values())
        try:
            decisions = await self._decider.decide(number, places, legs=max(most.values()), most=most)
        except BaseException:
            planner.restore(memory)
            raise
        if live.spec.budget != budget:
            planner.restore(memory)
            return False
        self._looked_at = live.builder.newest
        anew = {name: [leg for d in decisions for leg in d.legs if leg.vehicle == name] for name in old}
        if self._are_same(old, anew):
            return False
        if not self._may_be_flown(decisions, old, anew):
            planner.restore(memory)
            return False
        try:
            await self._exchange(decisions[-1], old, anew)
        except BaseException:
            planner.restore(memory)
            raise
        return True

    def _open_legs(self, member: Member) -> list[CommittedLeg]:
        """Return the legs of a vehicle that will not be begun before others are decided."""
        if (
            member.asked is not None
            or member.withdrawal is not None
            or not member.busy
            or member.target_m is None
            or member.pursuing is not None
        ):
            return []
        left_m = float(np.linalg.norm(member.target_m - member.place_m(self._live.frame)))
        left_s = left_m / (self._live.spec.speed_of(member.spec) * self._time_scale)
        soon = left_s < LEAD_DECISIONS * self._decider.takes_s + LEAD_S / self._time_scale
        legs = member.ahead[1:] if soon else list(member.ahead)
        return [] if member.surfacing or any(leg.surfacing for leg in member.ahead) else legs

    def _place(self, member: Member, legs: list[CommittedLeg]) -> Place:
        """Return where a vehicle's leg after those that stay begins, and how far it may fly from there."""
        live = self._live
        kept = member.ahead[: len(member.ahead) - len(legs)]
        taken_m = self._way_m(member, legs)
        metres = live.spec.allowance(member.spec).metres is not None
        given_back_m = taken_m if metres else len(legs) * live.spec.limits.max_step_m
        left_m = planned_way_m(live.spec, member.way_left_m(live.spec) + given_back_m)
        energy_m = self._range.beyond_m(member)
        if energy_m is not None:
            left_m = min(left_m, energy_m + taken_m)
        return replace(place_ahead(member, live, kept), moving=bool(legs), left_m=left_m)

    def _way_m(self, member: Member, legs: list[CommittedLeg]) -> float:
        if not legs or member.target_m is None:
            return 0.0
        kept = member.ahead[: len(member.ahead) - len(legs)]
        begin_m = kept[-1].target_m if kept else member.target_m
        return way_m([begin_m, *(leg.target_m for leg in legs)], self._live.spec)

    def _are_same(self, old: Mapping[str, list[CommittedLeg]], anew: Mapping[str, list[Leg]]) -> bool:
        return all(
            len(anew[name]) == len(legs)
            and all(
                not leg.refusal and math.dist(leg.target_m[:2], was.target_m) <= SAME_M
                for leg, was in zip(anew[name], legs, strict=True)
            )
            for name, legs in old.items()
        )

    def _may_be_flown(
        self, decisions: list[Decision], old: Mapping[str, list[CommittedLeg]], anew: Mapping[str, list[Leg]]
    ) -> bool:
        """Whether all new legs may replace the old ones now; nothing else runs meanwhile."""
        live, members = self._live, []
        for name, legs in old.items():
            member = live.team.get(name)
            if member is None or not member.controllable or member.withdrawal is not None:
                return False
            if member.ahead[-len(legs) :] != legs or not (member.ordered or len(member.ahead) > len(legs)):
                return False  # some were begun, or dropped
            if len(anew[name]) != len(legs) or any(leg.refusal or leg.surfacing for leg in anew[name]):
                return False
            members.append(member)
        if any(decision.fixes or decision.pursuits for decision in decisions):
            return False
        before = {member.name: list(member.ahead) for member in members}
        numbers = {name: legs[0].number for name, legs in old.items()}
        try:
            for member in members:
                del member.ahead[-len(old[member.name]) :]
            for later, decision in enumerate(decisions):
                if too_close(decision, live, live.spec):
                    return False
                for leg in decision.legs:
                    member = live.team.members[leg.vehicle]
                    if not self._range.allows(member, leg.target_m[:2]):
                        return False
                    member.ahead.append(self._leg_commit.leg_ahead(leg, numbers[leg.vehicle] + later))
            return True
        finally:
            for member in members:
                member.ahead[:] = before[member.name]

    async def _exchange(
        self, last: Decision, old: Mapping[str, list[CommittedLeg]], anew: Mapping[str, list[Leg]]
    ) -> None:
        """Write the new legs in place of the old ones, then let the vehicles have them ahead."""
        live = self._live
        members = [live.team.members[name] for name in old]
        new = {
            name: [self._leg_commit.leg_ahead(leg, was.number) for leg, was in zip(anew[name], legs, strict=True)]
            for name, legs in old.items()
        }
        longer_m = {m.name: self._way_m(m, old[m.name]) for m in members}
        for member in members:
            # Who comes to its next leg meanwhile waits until it is written down which one that is.
            del member.ahead[-len(old[member.name]) :]
        written = False
        try:
            await self._leg_commit.rewrite(last, {name: list(zip(new[name], anew[name], strict=True)) for name in new})
            written = True
        finally:
            for member in members:
                if live.team.get(member.name) is member and member.withdrawal is None:
                    legs = new[member.name] if written else old[member.name]
                    member.ahead.extend(legs)
                    if written:
                        member.committed.way_m += self._way_m(member, legs) - longer_m[member.name]
        live.changed.set()
