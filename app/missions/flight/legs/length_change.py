"""A mission that becomes longer or shorter while it is flown: legs beyond its end are taken back."""

import numpy as np

from app.exploration.motion.leg_rules import LEAST_WAY_M
from app.exploration.planner.ordered import OrderedPlanner
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.live.mission import LiveMission
from app.missions.task.way import way_m
from app.missions.team import Member


class LengthChange:
    """Fits the legs of a running mission to its length."""

    def __init__(self, live: LiveMission, planner: OrderedPlanner, leg_commit: LegCommit, dispatch: Dispatch) -> None:
        self._live = live
        self._planner = planner
        self._leg_commit = leg_commit
        self._dispatch = dispatch

    @property
    def is_due(self) -> bool:
        """Whether legs are not fitted yet to the length that the mission has now."""
        return not self._live.legs_fit_length

    async def fit(self) -> None:
        """Take legs back that are not begun and end beyond the end that the mission has now."""
        self._live.note_legs_fitted()
        await self.take_back_beyond(begun=False)

    async def take_back_beyond(self, *, begun: bool) -> None:
        """Take legs back that are not begun and end beyond the mission's end.

        ``begun``: only those that begin there. What is left of a vehicle's way before them is decided anew.
        """
        given_back = False
        for member in self._live.team.surveying:
            keep = self._legs_within(member, begun=begun)
            if keep == len(member.ahead):
                continue
            ends_m = self._dispatch.spare_after(member, keep, f"the mission ends after {self._live.spec.budget.words}")
            if member.asked is None:
                self._planner.put_back(member.name, np.array(ends_m))
                given_back = True
        if given_back:
            # What was stored with the legs has these as flown, and a restart would go on from that.
            await self._leg_commit.remember(self._planner.snapshot())

    def _legs_within(self, member: Member, *, begun: bool) -> int:
        """Return how many of the legs that a vehicle has ahead end within its way, with ``begun`` begin there."""
        ahead, spec = member.ahead, self._live.spec
        if spec.budget.steps is not None:
            return sum(leg.number <= spec.steps for leg in ahead)
        allowed_m, begin_m = spec.allowance(member.spec).metres, member.target_m if member.ordered else None
        if allowed_m is None or not ahead or (begin_m is None and member.report is None):
            return len(ahead)
        begin_m = member.place_m(self._live.frame) if begin_m is None else begin_m
        ends_m = [begin_m, *(leg.target_m for leg in ahead)]
        over_m = member.committed.way_m + member.committed.late_m - allowed_m
        keep = len(ahead)
        while keep and over_m > LEAST_WAY_M:
            last_m = way_m(ends_m[keep - 1 : keep + 1], spec)
            if begun and over_m < last_m:
                break
            over_m -= last_m
            keep -= 1
        return keep
