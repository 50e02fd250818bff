"""Forecasts as they are asked for: one at a time, in a thread of their own, until nobody waits for the answer."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from pydantic import Field
from shapely.geometry import Point, Polygon

from app.mapping.types import FloatArray
from app.missions.errors import InvalidRequestError
from app.missions.forecasting import Forecast, forecast
from app.missions.members import Member, Team
from app.missions.spec import MissionSpec
from app.missions.view_base import View

BUDGET_S = 6.0
START_MARGIN_M, START_SPACING_M = 2.0, 5.0
NEAR_M = 500.0
"""A vehicle farther away than this is taken to be brought to the area first."""


class VehicleForecast(View):
    """What one vehicle will have done."""

    vehicle: str
    distance_m: float


class ForecastView(View):
    """What is to be expected of a mission: a forecast from a simulation, not a promise."""

    duration_s: float = Field(description="Seconds of the vehicles' time until the last step is done")
    vehicles: list[VehicleForecast]
    coverage_pct: float = Field(description="Share of the area's cells that will be known to `accuracy_m`")
    remaining_pct: float = Field(description="Share of the landmarks that never were")
    mean_sd_m: float | None = Field(description="Mean deviation of the map; null: nothing was sounded")
    steps: int = Field(description="Steps that are still to be flown")
    steps_simulated: int = Field(
        description="Of these were simulated in the time allowed; `coverage_pct` and what follows is after as many"
    )
    assumptions: list[str] = Field(description="What was taken to be so, in words")


class Forecaster:
    """Makes forecasts beside the planning of running missions."""

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="forecast")
        self._one = asyncio.Lock()
        self._closing = threading.Event()

    def close(self) -> None:
        """End what is being made."""
        self._closing.set()
        self._executor.shutdown(wait=True, cancel_futures=True)

    async def make(
        self,
        spec: MissionSpec,
        *,
        members: list[Member] | None = None,
        prior: FloatArray | None = None,
        first_step: int = 1,
        floor_depth_m: float | None = None,
    ) -> ForecastView:
        """Return a forecast; ends soon after whoever waits for it is cancelled.

        Parameters
        ----------
        members
            The vehicles as they are; None: those of the description, not yet in the water.
        prior
            Imported soundings, shape (n, 4).

        Raises
        ------
        InvalidRequestError
            When the mission has no vehicle.
        """
        team = Team()
        ours = members or [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
        if not ours:
            raise InvalidRequestError("vehicles", "the mission has no vehicle", "add one: without any nothing is done")
        gone = threading.Event()
        known = np.zeros((0, 4)) if prior is None else prior
        starts, where = await asyncio.to_thread(starts_of, spec, ours)
        work = partial(
            forecast,
            spec,
            ours,
            starts,
            known,
            floor_depth_m=floor_depth_m,
            first_step=first_step,
            budget_s=BUDGET_S,
            stop=lambda: gone.is_set() or self._closing.is_set(),
        )
        try:
            async with self._one:
                found = await asyncio.get_running_loop().run_in_executor(self._executor, work)
        finally:
            gone.set()
        return _view(spec, found, where, spec.steps - first_step + 1)


def starts_of(spec: MissionSpec, members: list[Member]) -> tuple[FloatArray, str]:
    """Return where the vehicles begin, (vehicles, 2), and that in words: where they are, or in the area's corner."""
    frame, area = spec.frame(), Polygon(spec.local_area())
    width = float(np.ptp(spec.local_area()[:, 0]))
    starts, reported = [], 0
    for index, member in enumerate(members):
        corner = np.array([START_MARGIN_M + index * START_SPACING_M % max(width - START_MARGIN_M, 1.0), START_MARGIN_M])
        place = corner
        if member.report is not None:
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


def _view(spec: MissionSpec, found: Forecast, where: str, steps: int) -> ForecastView:
    floor = found.floor
    assumptions = [
        f"Sea floor: {floor.words}.",
        where,
        f"Straight legs at {spec.speed_mps:g} m/s without current; nobody waits for a link, and none is lost.",
    ]
    if spec.surface_policy is not None:
        assumptions.append("Coming up for fixes is not in it.")
    if spec.targets:
        assumptions.append("Going for moving targets is not in it.")
    if found.steps_flown < steps:
        assumptions.append(
            f"Only {found.steps_flown} of {steps} steps were simulated in {BUDGET_S:g} s: duration and distances are "
            "drawn out to all of them; coverage and deviation are those after as many."
        )
    return ForecastView(
        duration_s=found.duration_s,
        vehicles=[VehicleForecast(vehicle=name, distance_m=metres) for name, metres in found.distances_m.items()],
        coverage_pct=found.coverage_pct,
        remaining_pct=found.remaining_pct,
        mean_sd_m=found.mean_sd_m,
        steps=steps,
        steps_simulated=found.steps_flown,
        assumptions=assumptions,
    )
