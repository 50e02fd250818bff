"""Makes a running mission's decisions in a worker thread, on the newest map."""

import asyncio
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from app.exploration.core.constraints import Constraints
from app.exploration.planner.ordered import OrderedPlanner
from app.exploration.planners import COVERERS
from app.exploration.site_search import SearchTask
from app.missions import metrics
from app.missions.alarm_kinds import AlarmKind
from app.missions.clock import now
from app.missions.flight.decisions.decision import Decision, Knowledge, decide
from app.missions.flight.decisions.leg import Place
from app.missions.flight.decisions.step_maps import StepMaps
from app.missions.live.mission import LiveMission
from app.missions.task.planner import turn_radius_m
from app.missions.task.swath import swath_task
from app.missions.team import CommittedLeg, Member
from app.missions.views.mission import Level

PACE_MEMORY = 0.9
"""Weight of the past in the running mean of how long a decision takes."""

EXPECTED_DECISION_S = 0.3
"""How long a decision is taken to last before the first was made."""

NO_COURSE_M = 1e-6
"""A shorter leg has no course."""

DECIDE_AGAIN_S = 5.0
"""How long vehicles wait, by their clock, when they may go nowhere, until that is looked at again."""


class Decider:
    """Decides where the vehicles of one running mission go.

    Attributes
    ----------
    takes_s
        How long the next decision of one leg will take, on the wall clock, as the last ones did.
    """

    def __init__(
        self, live: LiveMission, constraints: Constraints, planner: OrderedPlanner, maps: StepMaps, executor: Executor
    ) -> None:
        self._live = live
        self._constraints = constraints
        self._maps = maps
        self._executor = executor
        self._told: dict[str, str] = {}
        self.planner = planner
        self.takes_s = EXPECTED_DECISION_S

    async def decide(
        self,
        number: int,
        places: list[Place],
        task: SearchTask | None = None,
        legs: int = 1,
        most: Mapping[str, int] | None = None,
        attempt: int = 0,
    ) -> list[Decision]:
        """Bring the map up to date, then decide legs from this number on.

        Parameters
        ----------
        task
            What a search is about.
        legs
            How many each vehicle gets that gets any.
        most
            Says of vehicles that they get so many only.
        attempt
            How often in a row legs were decided that a vehicle could not fly.
        """
        live = self._live
        started_s = asyncio.get_running_loop().time()
        await live.journal.storage.done(self._maps.renew)
        step_s = live.spec.limits.max_step_m / min(live.spec.speed_of(place.vehicle) for place in places)
        await live.journal.storage.done(live.ranges.flush)
        targets = live.ranges.tracking.told(live.ranges.times.now_s(), step_s)

        sounders = [member.spec for member in live.team]

        def decided(number: int, here: list[Place], known: Knowledge) -> Decision:
            known = replace(known, water_level_m=live.gate.corrections.water_level_m(now().timestamp()))
            return decide(number, live.spec, self._constraints, self.planner, here, known, attempt)

        def work() -> list[Decision]:
            coverers = live.spec.planner.name in COVERERS
            swath = swath_task(live.spec, sounders, live.builder.coverage()) if coverers else None
            belief, (sounded_m, doubtful_m) = live.builder.belief(), live.builder.sounded_at_m()
            known = Knowledge(belief, sounded_m, doubtful_en_m=doubtful_m, targets=targets, search=task, swath=swath)
            decisions = [decided(number, places, known)]
            here = _who_gets_more(moved_on(places, decisions[0]), most, 1)
            while len(decisions) < legs and any(place.moving for place in here):
                try:
                    decisions.append(decided(number + len(decisions), here, known))
                except Exception:
                    # It comes out when this leg is the first to be decided.
                    self.planner.restore(decisions[-1].memory)
                    break
                here = _who_gets_more(moved_on(here, decisions[-1]), most, len(decisions))
            return decisions

        with metrics.PLANNING_SECONDS.time():
            decisions = await asyncio.get_running_loop().run_in_executor(self._executor, work)
        # Several legs at once take longer, and last longer: as one slow decision they would make for ever more of them.
        took_s = (asyncio.get_running_loop().time() - started_s) / len(decisions)
        # Some decisions take longer than most. Vehicles would circle for them if the usual one were allowed for.
        self.takes_s = max(took_s, PACE_MEMORY * self.takes_s + (1 - PACE_MEMORY) * took_s)
        return decisions

    async def decide_to_fly(
        self, number: int, places: list[Place], task: SearchTask | None = None, legs: int = 1, attempt: int = 0
    ) -> list[Decision]:
        """Decide legs as by :meth:`decide` of which one is flown; none where nobody may go anywhere, told once."""
        memory = self.planner.snapshot()
        decisions = await self.decide(number, places, task, legs, attempt=attempt)
        refusals = {leg.vehicle: leg.refusal for leg in decisions[0].legs if leg.refusal}
        if len(refusals) < len(decisions[0].legs) or not decisions[0].legs:
            self._told = {}
            if self._live.flight.standstill:
                self._live.stand_still("")
            if self._live.journal.alarms.standing([AlarmKind.NO_WAYPOINT]):
                await self._live.journal.end([AlarmKind.NO_WAYPOINT], "a vehicle can be sent on again")
            return decisions
        self.planner.restore(memory)
        if refusals != self._told:
            self._told = refusals
            await self._tell_of_standstill(refusals)
        return []

    async def _tell_of_standstill(self, refusals: dict[str, str]) -> None:
        live = self._live
        words = "; ".join(f"{name}: {reason}" for name, reason in refusals.items())
        if any(member.busy or member.ahead for member in live.team):
            message = f"no leg can be given to {words}; they stay where theirs end, and it is tried again"
            await live.journal.log(Level.WARNING, "waiting", message, vehicles=list(refusals))
            return
        live.stand_still(words)
        message = f"no vehicle can be sent anywhere: {words}; they stay, and the step does not count"
        await live.journal.alarm(AlarmKind.NO_WAYPOINT, message, vehicles=list(refusals))


def place_of(member: Member, live: LiveMission) -> Place:
    """Return where a vehicle is now."""
    report = member.report
    return Place(
        member.name,
        member.place_m(live.frame),
        report.heading_rad if report is not None and report.heading_rad is not None else math.nan,
        member.cruise_depth_m(live.spec.limits),
        report.position_sd_m if report is not None and report.position_sd_m is not None else math.nan,
        report.position.depth_m if member.surfacing and report is not None else math.nan,
        member.capabilities.keeps_depth,
        submerged_s=member.fixes.submerged_s,
        altitude_m=member.altitude_m,
        turn_radius_m=turn_radius_m(live.spec, member.spec),
    )


def _who_gets_more(places: list[Place], most: Mapping[str, int] | None, decided: int) -> list[Place]:
    """Return places that move on only where their vehicles may get more legs than are decided."""
    if most is None:
        return places
    return [replace(place, moving=place.moving and most.get(place.vehicle, 0) > decided) for place in places]


def moved_on(places: list[Place], decision: Decision) -> list[Place]:
    """Return where the vehicles' legs after a decision's begin; who got none in it gets none after it."""
    ends = {leg.vehicle: leg for leg in decision.legs if not leg.refusal}
    later: list[Place] = []
    for place in places:
        leg = ends.get(place.vehicle)
        if leg is None:
            later.append(replace(place, moving=False))
            continue
        east, north = leg.target_m[:2] - place.en_m
        length_m = math.hypot(east, north)
        later.append(
            replace(
                place,
                en_m=leg.target_m[:2],
                heading_rad=math.atan2(east, north) if length_m > NO_COURSE_M else place.heading_rad,
                surfacing_depth_m=float(leg.target_m[2]) if leg.surfacing else math.nan,
                left_m=max(place.left_m - length_m, 0.0),
                at_rest=False,
            )
        )
    return later


def place_ahead(member: Member, live: LiveMission, kept: Sequence[CommittedLeg] | None = None) -> Place:
    """Return where a vehicle's next leg begins: at the end of its last one, or where it is when it has none.

    ``kept`` are its legs ahead, where they are not all that it has.
    """
    here, kept = place_of(member, live), member.ahead if kept is None else kept
    flying = [member.target_m] if member.busy and member.target_m is not None else []
    ends = [here.en_m, *flying, *(leg.target_m for leg in kept)]
    if len(ends) == 1:
        return here
    east, north = ends[-1] - ends[-2]
    up = kept[-1].surfacing if kept else member.surfacing
    last_depth_m = kept[-1].position.depth_m if kept else here.surfacing_depth_m
    return replace(
        here,
        en_m=np.asarray(ends[-1], dtype=np.float64),
        heading_rad=math.atan2(east, north) if math.hypot(east, north) > NO_COURSE_M else here.heading_rad,
        surfacing_depth_m=last_depth_m if up else math.nan,
    )
