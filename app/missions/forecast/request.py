"""Forecasts as they are asked for: one at a time, in a thread of their own, until nobody waits for the answer."""

import asyncio
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from pydantic import Field
from shapely.geometry import Point, Polygon

from app.arrays import FloatArray
from app.compute.cluster import NotDoneError
from app.compute.compute import Compute
from app.missions.compilation import Compilation
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.hub import FleetHub
from app.missions.forecast.floor import forecast_cell_m, thinned
from app.missions.forecast.ranges import (
    DEVIATION_SD,
    WAY_SD,
    ForecastRange,
    coverages_with_unforeseen,
    range_of,
    with_unforeseen,
)
from app.missions.forecast.simulate import SOUNDINGS_A_CELL, Forecast, floors_under, fly_over, forecast
from app.missions.forecast.swarm import SoFar
from app.missions.forecast.swath_flight import sweeps
from app.missions.forecast.whole_survey import WholeSurveyView, whole_view, whole_way
from app.missions.live.mission import LiveMission
from app.missions.live.watchers.vehicles import near_report
from app.missions.running.admission import check_spec
from app.missions.running.team_changes import refuse_ended
from app.missions.spec.mission import MissionKind, MissionSpec
from app.missions.task.constraints import make_constraints
from app.missions.team import Member, Team
from app.missions.views.base import View
from app.storage.queries import missions as mission_queries
from app.storage.queries import soundings as sounding_queries

NO_FORECAST = "what a search will find cannot be forecast: it depends on what stands there"

BUDGET_S = 10.0
"""Seconds of the processor for each floor."""

PATIENCE_S = 60.0
"""After so long by the clock no further floor is begun, nor one waited for that the cluster flies."""

START_MARGIN_M, START_SPACING_M = 2.0, 5.0
NEAR_M = 500.0
"""A vehicle farther away than this is taken to be brought to the area first."""


class VehicleForecast(View):
    """What one vehicle will have done."""

    vehicle: str
    distance_m: float = Field(description="Median over the floors")
    distance_m_range: ForecastRange


class ForecastView(View):
    """What is to be expected of a mission: a forecast from a simulation, not a promise."""

    duration_s: float = Field(description="Seconds of the vehicles' time until the last step is done; median")
    duration_s_range: ForecastRange
    vehicles: list[VehicleForecast]
    coverage_pct: float = Field(
        description="Share of the area's cells that will be known to `accuracy_m`, with swath sonars that will be "
        "ensonified; median over the floors"
    )
    coverage_pct_range: ForecastRange
    remaining_pct: float = Field(description="Share of the landmarks that will not be; median over the floors")
    remaining_pct_range: ForecastRange
    mean_sd_m: float | None = Field(description="Mean deviation of the map; median; null: nothing was sounded")
    mean_sd_m_range: ForecastRange | None
    steps: int = Field(description="Steps that are still to be flown")
    steps_simulated: int = Field(
        description="Of these were simulated in the time allowed; `coverage_pct` and what follows is after as many"
    )
    whole_survey: WholeSurveyView | None = Field(
        description="What it takes until nothing is left to ensonify, whatever the budget; null: no survey with swath "
        "sonars"
    )
    steps_flown: int = Field(description="The same as `steps_simulated`")
    floors: int = Field(description="Over how many floors of different roughness it was flown")
    assumptions: list[str] = Field(description="What was taken to be so, in words")


class Forecaster:
    """Makes forecasts beside the planning of running missions: on a cluster over all floors at the same time.

    A cluster that fails is done without, in the time that is left.
    """

    def __init__(self, hub: FleetHub, compilation: Compilation, compute: Compute) -> None:
        self._hub = hub
        self._compilation = compilation
        self._compute = compute
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="forecast")
        self._one = asyncio.Lock()
        self._closing = threading.Event()

    def close(self) -> None:
        """End what is being made."""
        self._closing.set()
        self._executor.shutdown(wait=True, cancel_futures=True)

    async def of_description(self, spec: MissionSpec, floor_depth_m: float | None = None) -> ForecastView:
        """Return what is to be expected of a mission as it is described. Raises InvalidRequestError."""
        await asyncio.to_thread(check_spec, spec, self._hub.kinds)
        if spec.kind is MissionKind.SEARCH:
            raise InvalidRequestError("kind", NO_FORECAST, "forecast missions of kind survey")
        return await self.make(spec, floor_depth_m=floor_depth_m)

    async def of_mission(self, live: LiveMission, floor_depth_m: float | None = None) -> ForecastView:
        """Return what is to be expected of a mission from now on. Raises ConflictError, InvalidRequestError."""
        refuse_ended(live, "has nothing before it")
        if live.search is not None:
            raise ConflictError(NO_FORECAST, "see its time window, search.window_s")
        async with live.database.reading() as session:
            prior = await sounding_queries.imported_arrays(session, live.id)
            step = await mission_queries.last_step(session, live.id)
        sounded = await asyncio.to_thread(sounded_so_far, live)
        flying = live.team.surveying or list(live.team)
        told = (near_report(live.frame, live.hub.info(member.key).report) for member in flying)
        team = [replace(member, report=member.report or report) for member, report in zip(flying, told, strict=True)]
        return await self.make(
            live.spec,
            members=team,
            so_far=SoFar(live.header.step + 1, prior, sounded, b"" if step is None else step.memory),
            floor_depth_m=floor_depth_m,
        )

    async def make(
        self,
        spec: MissionSpec,
        *,
        members: list[Member] | None = None,
        so_far: SoFar = SoFar(),  # noqa: B008 - frozen
        floor_depth_m: float | None = None,
    ) -> ForecastView:
        """Return a forecast; ends soon after whoever waits for it is cancelled.

        Parameters
        ----------
        members
            The vehicles as they are; None: those of the description, not yet in the water.
        so_far
            What was done of the mission.

        Raises
        ------
        InvalidRequestError
            When the mission has no vehicle.
        """
        ours = members or described_team(self._hub, spec)
        starts, where = await asyncio.to_thread(starts_of, spec, ours)
        begun = time.monotonic()
        found = await self._there(spec, ours, starts, so_far, floor_depth_m) if self._compute.elsewhere else None
        if found is None:
            left_s = max(PATIENCE_S - (time.monotonic() - begun), 0.0)
            found = await self._here(spec, ours, starts, so_far, floor_depth_m, left_s)
        steps = max(spec.steps - so_far.first_step + 1, 0)
        return _view(spec, found, where, steps, await asyncio.to_thread(_whole, spec, ours, found))

    async def _there(
        self,
        spec: MissionSpec,
        members: list[Member],
        starts_m: FloatArray,
        so_far: SoFar,
        floor_depth_m: float | None,
    ) -> Forecast | None:
        """Return what the cluster flies as long as a forecast may take; None where it fails, or flies nothing."""
        floors = await asyncio.to_thread(lambda: list(floors_under(spec, members, so_far, floor_depth_m)))
        flying = [
            asyncio.ensure_future(
                self._compute.away(fly_over, floor, spec, members, starts_m, so_far, BUDGET_S),
            )
            for floor in floors
        ]
        try:
            await asyncio.wait(flying, timeout=PATIENCE_S, return_when=asyncio.FIRST_EXCEPTION)
            flown = [(floor, task.result()) for floor, task in zip(floors, flying, strict=True) if task.done()]
        except NotDoneError:
            return None
        finally:
            for task in flying:
                task.cancel()
            await asyncio.gather(*flying, return_exceptions=True)
        return Forecast([flight for _, flight in flown], [floor for floor, _ in flown]) if flown else None

    async def _here(
        self,
        spec: MissionSpec,
        members: list[Member],
        starts_m: FloatArray,
        so_far: SoFar,
        floor_depth_m: float | None,
        patience_s: float,
    ) -> Forecast:
        # The time that a forecast may take is for steps, not for compiling.
        await self._compilation.search()
        gone = threading.Event()
        work = partial(
            forecast,
            spec,
            members,
            starts_m,
            so_far,
            floor_depth_m=floor_depth_m,
            budget_s=BUDGET_S,
            patience_s=patience_s,
            stop=lambda: gone.is_set() or self._closing.is_set(),
        )
        try:
            async with self._one:
                return await asyncio.get_running_loop().run_in_executor(self._executor, work)
        finally:
            gone.set()


def sounded_so_far(live: LiveMission) -> FloatArray:
    """Return what a mission has sounded itself, (n, 4), as densely as it is flown ahead.

    Of what swath sonars saw it is one sounding in each cell.
    """
    rows = np.concatenate([live.builder.soundings, *live.builder.arrivals.noted()])
    built = live.builder.newest
    if not live.builder.swath.beams or built is None:
        return thinned(rows, forecast_cell_m(live.spec) / SOUNDINGS_A_CELL)
    seen = built.map.sounded & np.isfinite(built.map.depth_m) & np.isfinite(built.map.sd_m)
    return np.column_stack([built.map.grid.centres_m[seen.ravel()], built.map.depth_m[seen], built.map.sd_m[seen]])


def described_team(hub: FleetHub, spec: MissionSpec) -> list[Member]:
    """Return the vehicles of a description, none of them in the water yet. Raises InvalidRequestError without any."""
    team = Team(hub.capabilities)
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    if not members:
        raise InvalidRequestError("vehicles", "the mission has no vehicle", "add one: without any nothing is done")
    return members


def starts_of(spec: MissionSpec, members: list[Member]) -> tuple[FloatArray, str]:
    """Return where the vehicles begin, (vehicles, 2), and that in words: where they are, or in the area's corner.

    Before a mission that follows another one they will be elsewhere.
    """
    frame, area = spec.frame(), Polygon(spec.local_area())
    width = float(np.ptp(spec.local_area()[:, 0]))
    starts, reported = [], 0
    for index, member in enumerate(members):
        corner = np.array([START_MARGIN_M + index * START_SPACING_M % max(width - START_MARGIN_M, 1.0), START_MARGIN_M])
        place = corner
        if member.report is not None and spec.after is None:
            here = member.place_m(frame)
            if area.distance(Point(here)) <= NEAR_M:
                place, reported = here, reported + 1
        elif member.spec.start is not None:
            place = np.array([float(x) for x in frame.to_local(member.spec.start[1], member.spec.start[0])])
        starts.append(place)
    words = "Vehicles begin where they are." if reported == len(members) else "Vehicles begin in a corner of the area."
    if 0 < reported < len(members):
        words = f"{reported} of {len(members)} vehicles begin where they are, the others in a corner of the area."
    return np.array(starts), words


def _whole(spec: MissionSpec, members: list[Member], found: Forecast) -> WholeSurveyView | None:
    """Return what all of a survey takes, with the batteries for it."""
    constraints = make_constraints(spec)
    flights = [
        {
            member.name: whole_way(
                spec,
                constraints,
                member,
                whole.ways_m[member.name],
                whole.clocks_s[member.name],
                whole.distances_m[member.name],
                whole.drawn_out,
            )
            for member in members
        }
        for flight in found.flights
        if (whole := flight.whole) is not None
    ]
    if not flights:
        return None
    within = all(flight.whole is not None and flight.whole.within_budget for flight in found.flights)
    return whole_view(flights, within_budget=within)


def _view(
    spec: MissionSpec, found: Forecast, where: str, steps: int, whole: WholeSurveyView | None = None
) -> ForecastView:
    first, flights = found.floors[0], found.flights
    kinds = ", ".join(floor.kind for floor in found.floors)
    assumptions = [
        f"Sea floor: {first.words}.",
        f"Flown over {len(flights)} floors: {kinds}. Ranges leave out the lowest and the highest tenth; which floor it "
        "will be is not known."
        if len(flights) > 1
        else "Flown over one floor only, for want of time: on a rougher one it will be worse.",
        where,
        f"Turning circles and straight legs at {spec.speed_mps:g} m/s without current; nobody waits for a link, and "
        "none is lost.",
    ]
    assumptions += _said_of_whole(spec, found)
    if spec.surface_policy is not None:
        assumptions.append("Coming up for fixes is not in it.")
    if spec.targets:
        assumptions.append("Going for moving targets is not in it.")
    if found.steps_flown < steps and not sweeps(spec):
        assumptions.append(
            f"Only {found.steps_flown} of {steps} steps were simulated on every floor, in {BUDGET_S:g} s of the "
            "processor each: duration and distances are drawn out to all of them; coverage and deviation are those "
            "after as many."
        )

    sds = with_unforeseen([f.mean_sd_m for f in flights if f.mean_sd_m is not None], DEVIATION_SD)
    durations = with_unforeseen([flight.duration_s for flight in flights], WAY_SD)
    coverages = [flight.coverage_pct for flight in flights]
    remainders = [flight.remaining_pct for flight in flights]
    ways = {
        name: with_unforeseen([flight.distances_m[name] for flight in flights], WAY_SD)
        for name in flights[0].distances_m
    }
    return ForecastView(
        duration_s=_median(durations),
        duration_s_range=range_of(durations),
        vehicles=[
            VehicleForecast(vehicle=name, distance_m=_median(way), distance_m_range=range_of(way))
            for name, way in ways.items()
        ],
        coverage_pct=_median(coverages),
        coverage_pct_range=range_of(coverages_with_unforeseen(coverages)),
        remaining_pct=_median(remainders),
        remaining_pct_range=range_of(remainders),
        mean_sd_m=_median(sds) if sds else None,
        mean_sd_m_range=range_of(sds) if sds else None,
        steps=steps,
        steps_simulated=found.steps_flown,
        whole_survey=whole,
        steps_flown=found.steps_flown,
        floors=len(flights),
        assumptions=assumptions,
    )


def _median(values: list[float]) -> float:
    return float(np.median(values))


def _said_of_whole(spec: MissionSpec, found: Forecast) -> list[str]:
    """Return what is to be said of a survey with swath sonars."""
    if not sweeps(spec):
        return []
    drawn_out = max(flight.whole.drawn_out for flight in found.flights if flight.whole is not None)
    if drawn_out <= 1.0:
        return []
    return [
        f"Not all was flown in {BUDGET_S:g} s of the processor for each floor: what was left then, up to "
        f"{100.0 * (1.0 - 1.0 / drawn_out):.0f} % of the survey, is drawn out from the rest."
    ]
