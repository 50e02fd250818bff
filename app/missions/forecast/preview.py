"""Plans of missions that are being described, as they are asked for: one at a time, in a thread of their own."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from pydantic import Field

from app.arrays import FloatArray
from app.estimation import SingleBeam
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.compilation import Compilation
from app.missions.errors import InvalidRequestError
from app.missions.fleet.hub import FleetHub
from app.missions.forecast.plan import SAME_M, TeamPlan, VehiclePlan, plan
from app.missions.forecast.ranges import ForecastRange
from app.missions.forecast.request import described_team, starts_of
from app.missions.forecast.whole_survey import WholeSurveyView, whole_view
from app.missions.live.watchers.vehicles import near_report
from app.missions.running.admission import check_spec
from app.missions.spec.mission import MissionKind, MissionSpec
from app.missions.task.survey_lines import lengths_words, line_remarks
from app.missions.views.base import View

NO_PLAN = "a search has no plan before it: where it goes depends on what stands there"

BUDGET_S = 0.8
"""Seconds of the processor for a plan that is found leg by leg."""

DECIMALS = 7
"""Of degrees: a centimetre."""


class PlannedVehicleView(View):
    """What one vehicle would do."""

    vehicle: str
    way: list[tuple[float, float]] = Field(description="From where it begins, [longitude, latitude]")
    way_home: list[tuple[float, float]] | None = Field(
        description="From the end of that; null: it has no recovery point, or no way leads there"
    )
    distance_m: float = Field(description="Length of `way`")
    distance_home_m: float | None = Field(description="Length of `way_home`")
    duration_s: float = Field(description="Seconds of its time for `way`, turns and fixes by the clock included")
    duration_s_range: ForecastRange = Field(
        description="Without turns and fixes, and with every turn flown as a whole circle"
    )
    home_s: float | None = Field(description="Seconds for `way_home`")
    energy_needs_s: float = Field(
        description="How long its energy has to last: for its way, the way home, and a reserve"
    )
    energy_left_s: float | None = Field(description="How long it lasts for sure; null: not known")
    turn_back: tuple[float, float] | None = Field(
        description="Where on its way it has to turn back for want of energy; null: nowhere, or not known"
    )
    turn_back_m: float | None = Field(description="How far along its way that is")


class PlanView(View):
    """The lines that a mission would begin with, and what they take: a plan, not a promise."""

    vehicles: list[PlannedVehicleView]
    distance_m: float = Field(description="Of all vehicles together")
    duration_s: float = Field(description="Until the last vehicle is at the end of its way, by the vehicles' time")
    duration_s_range: ForecastRange
    energy_suffices: bool | None = Field(
        description="Whether every vehicle's energy lasts; null: of one or more it is not known, the others' does"
    )
    whole: bool = Field(description="Whether this is all; else the ways end where the time for planning was up")
    whole_survey: WholeSurveyView | None = Field(
        description="What it takes until nothing is left to ensonify, or all lines that were asked for are "
        "flown, whatever the budget; null: a survey of neither kind, or not all of it was planned in time"
    )
    assumptions: list[str] = Field(description="What was taken to be so, in words")


class PlanPreviews:
    """Plans missions beside those that run."""

    def __init__(self, hub: FleetHub, compilation: Compilation) -> None:
        self._hub = hub
        self._compilation = compilation
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="preview")
        self._one = asyncio.Lock()
        self._closing = threading.Event()

    def close(self) -> None:
        """End what is being made."""
        self._closing.set()
        self._executor.shutdown(wait=True, cancel_futures=True)

    async def of(self, spec: MissionSpec, floor_depth_m: float | None = None) -> PlanView:
        """Return the plan of a mission as it is described; ends soon after whoever waits for it is cancelled.

        Raises
        ------
        InvalidRequestError
            When there can be no plan: no vehicle, no such planner, a search.
        """
        await asyncio.to_thread(check_spec, spec, self._hub.kinds)
        if spec.kind is MissionKind.SEARCH:
            raise InvalidRequestError("kind", NO_PLAN, "plan missions of kind survey")
        frame = spec.frame()
        members = [
            replace(member, report=near_report(frame, self._hub.info(member.key).report))
            for member in described_team(self._hub, spec)
        ]
        await self._compilation.planner(spec.planner.name, SingleBeam())
        gone = threading.Event()

        def work() -> tuple[TeamPlan, str]:
            starts_m, where = starts_of(spec, members)
            stop = partial(any_set, gone, self._closing)
            return plan(spec, members, starts_m, floor_depth_m=floor_depth_m, budget_s=BUDGET_S, stop=stop), where

        try:
            # Those that were given up while they waited their turn never begin.
            async with self._one:
                found, where = await asyncio.get_running_loop().run_in_executor(self._executor, work)
        finally:
            gone.set()
        return await asyncio.to_thread(_view, spec, found, where, guessed=floor_depth_m is None)


def any_set(*events: threading.Event) -> bool:
    """Return whether one of the events has happened."""
    return any(event.is_set() for event in events)


def _view(spec: MissionSpec, found: TeamPlan, where: str, *, guessed: bool) -> PlanView:
    frame = spec.frame()
    vehicles = [_vehicle(way, frame) for way in found.ways]
    enough = [None if v.energy_left_s is None else v.energy_needs_s <= v.energy_left_s for v in vehicles]
    assumptions = [
        where,
        f"Straight legs at {spec.speed_mps:g} m/s without current; nobody waits for a link, and none is lost.",
        "Planners that adapt begin with this plan and leave it for what they find.",
    ]
    if any(v.sonar or v.sensor == "multibeam" for v in spec.vehicles):
        assumptions.append(
            f"Lines over a level bottom {found.depth_m:.0f} m deep{', which is a guess' if guessed else ''}."
        )
    if not found.own:
        assumptions.append("Drawn as even lines: for so many vehicles and zones the planner lays its own at the start.")
    assumptions += [f"{remark[:1].upper()}{remark[1:]}." for remark in line_remarks(spec)]
    if found.left_out.length_m:
        which = f" ({lengths_words(found.left_out.by_name)})" if found.left_out.by_name else ""
        assumptions.append(
            f"{found.left_out.length_m / 1000.0:.2f} km of lines are left out{which}: keep-out zones cut the area into "
            "parts, and no vehicle that can fly them begins in one of these."
        )
    if not found.whole:
        assumptions.append(f"Only what could be planned in {BUDGET_S:g} s of the processor is drawn.")
    if spec.surface_policy is not None and spec.surface_policy.every_min is None:
        assumptions.append("Coming up for fixes is not in it.")
    return PlanView(
        vehicles=vehicles,
        distance_m=sum(v.distance_m for v in vehicles),
        duration_s=max(v.duration_s for v in vehicles),
        duration_s_range=ForecastRange(
            low=max(v.duration_s_range.low for v in vehicles), high=max(v.duration_s_range.high for v in vehicles)
        ),
        energy_suffices=False if False in enough else None if None in enough else True,
        whole=found.whole,
        whole_survey=_whole(found),
        assumptions=assumptions,
    )


def _whole(found: TeamPlan) -> WholeSurveyView | None:
    """Return what all of a survey takes, by its plan."""
    if found.whole_survey is None:
        return None
    planned = {way.name: way.distance_m for way in found.ways}
    within = all(way.distance_m <= planned[name] + SAME_M for name, way in found.whole_survey.items())
    return whole_view([found.whole_survey], within_budget=within)


def _vehicle(way: VehiclePlan, frame: LocalFrame) -> PlannedVehicleView:
    home = None if way.way_home_m is None else np.vstack([way.corners_m[-1], way.way_home_m])
    at = None if way.turn_back_m is None else _places(way.place_m(way.turn_back_m)[None], frame)[0]
    return PlannedVehicleView(
        vehicle=way.name,
        way=_places(way.corners_m, frame),
        way_home=None if home is None else _places(home, frame),
        distance_m=way.distance_m,
        distance_home_m=None if home is None else float(np.hypot(*np.diff(home, axis=0).T).sum()),
        duration_s=way.seconds,
        duration_s_range=ForecastRange(low=way.least_s, high=way.most_s),
        home_s=None if home is None else way.home_s,
        energy_needs_s=way.needs_s,
        energy_left_s=way.left_s,
        turn_back=at,
        turn_back_m=way.turn_back_m,
    )


def _places(corners_m: FloatArray, frame: LocalFrame) -> list[tuple[float, float]]:
    lat_deg, lon_deg = frame.to_geographic(corners_m[:, 0], corners_m[:, 1])
    return [
        (round(float(lon), DECIMALS), round(float(lat), DECIMALS)) for lon, lat in zip(lon_deg, lat_deg, strict=True)
    ]
