"""How long a mission is: told otherwise before it starts, and while it is flown."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from sqlalchemy.ext.asyncio import AsyncSession

from app.arrays import FloatArray
from app.missions.clock import now
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.flight.runner import flies_apart
from app.missions.live.journals.journal import add_lines
from app.missions.live.mission import LiveMission
from app.missions.running.admission import check_way
from app.missions.running.supervisor import MissionSupervisor
from app.missions.spec.budget import Budget
from app.missions.spec.mission import MissionKind, MissionSpec
from app.missions.states import ENDED, NOT_STARTED, MissionState, remedy
from app.missions.task.constraints import make_constraints
from app.missions.task.planner import make_planner
from app.missions.task.way import least_way_m
from app.missions.team import SETTLED, Member
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.models import MissionRow, MissionVehicleRow
from app.storage.queries import missions as mission_queries

FINISH = "finish it instead: POST /api/v1/missions/{id}/finish"


@dataclass(frozen=True)
class _Standing:
    """How much of its mission's length a vehicle has used up, in every unit: each is counted whatever the length is in.

    Attributes
    ----------
    last
        Number of the last leg that was committed for it.
    open_m
        Ends of its legs that are not flown, (n, 2), the one that it flies first, after where it is.
    come_m
        How far it has come along its legs, metres.
    surveyed_s
        How long it has surveyed, seconds by its clock.
    """

    last: int
    open_m: FloatArray
    come_m: float
    surveyed_s: float

    @property
    def flown_legs(self) -> int:
        """Legs that are over."""
        return self.last - max(len(self.open_m) - 1, 0)

    def left_m(self, spec: MissionSpec, member: Member) -> float:
        """Return how far a vehicle may fly yet if its mission is as long as a description says, metres."""
        allowance, speed_mps = spec.allowance(member.spec), spec.speed_of(member.spec)
        if allowance.metres is not None:
            by_clock_m = self.surveyed_s * speed_mps if spec.budget.minutes is not None else 0.0
            return max(allowance.metres - max(self.come_m, by_clock_m), 0.0)
        legs = max(spec.steps - self.flown_legs, 0)
        flown_next = _length_m(self.open_m[: legs + 1])
        return flown_next + max(legs - max(len(self.open_m) - 1, 0), 0) * spec.limits.max_step_m

    def is_done(self, spec: MissionSpec, member: Member) -> bool:
        """Whether nothing would be left for a vehicle."""
        if spec.budget.steps is not None:
            return self.flown_legs >= spec.steps
        return self.left_m(spec, member) <= least_way_m(spec)

    def used(self, unit: str, speed_mps: float) -> float:
        """Return how much it has used up, in a unit of budgets."""
        if unit == "steps":
            return float(self.flown_legs)
        if unit == "km_per_vehicle":
            return self.come_m / 1000.0
        return max(self.come_m / speed_mps, self.surveyed_s) / 60.0


async def set_budget(live: LiveMission, supervisor: MissionSupervisor, budget: Budget, actor: str) -> None:
    """Change how long a survey is, of one under way from its beginning on: what is flown counts.

    Description, what vehicles may fly yet and the line of the log are stored together; from then on everything goes by
    it, and the flight takes back the legs ahead that are too many. Vehicles fly on meanwhile.

    Raises
    ------
    ConflictError, InvalidRequestError
        The latter when that is used up already, or flown before anybody moves.
    """
    async with supervisor.acting(live.id):
        _check_state(live)
        if budget == live.spec.budget:
            return
        spec = live.spec.with_budget(budget)
        _check_length(spec.model_copy(update={"vehicles": live.team.specs}))
        # Of a mission that goes step by step, the step that is flown counts.
        together = live.header.state not in NOT_STARTED and not await live.in_thread(_flies_apart, live)
        await to_the_end(_change(live, budget, actor, together=together))


def _check_state(live: LiveMission) -> None:
    state = live.header.state
    if live.spec.kind is MissionKind.SEARCH:
        words = "describe it anew: PUT /api/v1/missions/{id}" if state in NOT_STARTED else "let it end, or finish it"
        raise ConflictError("the mission is a search: its length is search.window_s, no budget", words)
    if state in ENDED:
        raise ConflictError(f"the mission is {state}: its length stays as it is", remedy(state))
    live.refuse_ending()
    _refuse_flown_out(live)


def _refuse_flown_out(live: LiveMission) -> None:
    if live.header.state is MissionState.RUNNING and live.flight.flown_out:
        raise ConflictError("the mission was just flown to its end", "create a new mission to go on")


def _check_length(spec: MissionSpec) -> None:
    """Refuse what is flown before anybody moves. Raises InvalidRequestError, which names the field of the budget."""
    try:
        check_way(spec)
    except InvalidRequestError as error:
        raise InvalidRequestError(error.field.removeprefix("budget."), str(error), error.remedy) from None


def _flies_apart(live: LiveMission) -> bool:
    return flies_apart(live, make_constraints(live.spec), make_planner(live.spec, live.planning_sensor))


async def _change(live: LiveMission, budget: Budget, actor: str, *, together: bool) -> None:
    before, left_m = live.spec.budget, {}
    async with live.database.writing() as session:
        spec = live.spec.with_budget(budget)
        standings = await _standings(session, live)
        words = f"the length is {budget.words} now, it was {before.words}: changed by {actor}"
        if live.header.state not in NOT_STARTED:
            _refuse_flown_out(live)
            if together:
                _check_steps_left(live, spec)
            else:
                _check_is_left(live, spec, standings)
            left_m = {m.name: standings[m.name].left_m(spec, m) for m in live.team if m.flown.left_m is not None}
            words += _who_is_sent_on(live, spec, standings)
        line = live.journal.line(
            Level.INFO, "budget", words, actor=actor, before=before.model_dump(), budget=budget.model_dump()
        )
        mission = await session.get_one(MissionRow, live.id)
        mission.spec = mission.spec | {"budget": budget.model_dump(mode="json")}
        mission.updated_at = now()
        for name, metres in left_m.items():
            vehicle = await session.get(MissionVehicleRow, (live.id, name))
            if vehicle is not None and vehicle.flown:
                vehicle.flown = vehicle.flown | {"left_m": round(metres, 2)}
        await add_lines(session, [line])
    # Committed: from here on nothing waits until all of it holds.
    live.header.updated_at = mission.updated_at
    live.relength(budget, left_m)
    live.journal.tell(line)


async def _standings(session: AsyncSession, live: LiveMission) -> Mapping[str, _Standing]:
    """Return how far each vehicle has come; where nobody has counted since a restart, by what is written down."""
    newest = {row.vehicle: row.step for row in await mission_queries.newest_waypoints(session, live.id)}
    way_m, _ = await mission_queries.committed_way(session, live.id)
    rows = await mission_queries.unsettled_waypoints(session, live.id, SETTLED)
    found = {}
    for member in live.team:
        counted, flies = member.legs > 0, member.flies_survey and member.report is not None
        stored = np.array([[row.east_m, row.north_m] for row in rows if row.vehicle == member.name]).reshape(-1, 2)
        ends_m = member.legs_ahead_m() if counted else stored
        open_m = np.vstack([member.place_m(live.frame), ends_m]) if len(ends_m) and flies else np.zeros((0, 2))
        whole_m = member.committed.way_m if counted else way_m.get(member.name, 0.0)
        last = member.legs if counted else newest.get(member.name, 0)
        come_m = max(whole_m - _length_m(open_m), 0.0)
        found[member.name] = _Standing(last, open_m, come_m, member.flown.survey_s)
    return found


def _length_m(places_m: FloatArray) -> float:
    return sum(float(np.hypot(*(b - a))) for a, b in pairwise(places_m))


def _check_steps_left(live: LiveMission, spec: MissionSpec) -> None:
    """Refuse a length whose steps are all flown. Raises InvalidRequestError."""
    flown = live.header.step - any(member.ordered for member in live.team)
    if spec.steps <= flown:
        words = f"{spec.budget.words} comes to {spec.steps} steps, and {flown} are flown"
        raise InvalidRequestError(spec.budget.unit, words, f"give more, or {FINISH}")


def _check_is_left(live: LiveMission, spec: MissionSpec, standings: Mapping[str, _Standing]) -> None:
    """Refuse a length that is used up, by whoever goes on or, where nobody does, by all. Raises InvalidRequestError."""
    members = live.team.going_on or list(live.team)
    if not members or not all(standings[m.name].is_done(spec, m) for m in members):
        return
    unit = spec.budget.unit
    used = {m.name: standings[m.name].used(unit, spec.speed_of(m.spec)) for m in members}
    name = min(used, key=lambda one: used[one])
    told = {
        "minutes": f"{used[name]:.1f} min",
        "km_per_vehicle": f"{used[name]:.2f} km",
        "steps": f"{used[name]:.0f} legs",
    }[unit]
    verb = "has surveyed" if unit == "minutes" else "has flown"
    raise InvalidRequestError(
        unit,
        f"{spec.budget.words} is used up: {name} {verb} {told}, and no vehicle less",
        f"give more than {told}, or {FINISH}",
    )


def _who_is_sent_on(live: LiveMission, spec: MissionSpec, standings: Mapping[str, _Standing]) -> str:
    """Return who has flown its part and is on its way home, or there, and could go on; as words after others."""
    names = [
        m.name
        for m in live.team
        if m.withdrawal is not None and m.withdrawal.done and not standings[m.name].is_done(spec, m)
    ]
    return f"; {', '.join(names)} had flown all: resume who is to survey on" if names else ""
