"""What an operator asks for: the description of a mission, declared once.

The REST schema, the command line's help and the dashboard's forms are all made from these models.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from functools import lru_cache
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, field_validator, model_validator
from shapely.geometry import Point, Polygon
from shapely.geometry.polygon import orient

from app.arrays import FloatArray
from app.estimation.uncertainty import SoundingErrors
from app.exploration import DEFAULT_PLANNER
from app.exploration.planner.options import PlannerOptions
from app.mapping.coordinates.georeference import MAX_EXTENT_M, LocalFrame
from app.mapping.s44 import Order, strictest_sd_m
from app.missions.spec.base import HALF_ROUND_DEG, FieldError, Model, Name, PolygonGeometry, ShownName, cell_count
from app.missions.spec.budget import Allowance, Budget, Steps
from app.missions.spec.failsafes import Failsafe, Response
from app.missions.spec.limits import Limits
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.recovery import Homecoming, Recovery
from app.missions.spec.search import DEFAULTS as SEARCH_DEFAULTS
from app.missions.spec.search import SearchSpec, filled_in
from app.missions.spec.site import SiteId
from app.missions.spec.surface_policy import SurfacePolicy
from app.missions.spec.survey_lines import MOST_CORNERS, MOST_LINES, MOST_LINES_KM, SurveyLine
from app.missions.spec.swath import CoverageSpec
from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.spec.targets import MOST_TARGETS, TargetSpec, Tracking
from app.missions.spec.vehicle import Speed, VehicleSpec
from app.missions.spec.water import SoundSpeed, Tide

MissionId = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_-]+$")]
FARTHEST_HOME_M = 10_000.0
"""Farther from the area no recovery point lies."""

BACK_STEPS, MOST_BACK_M = 3.0, 25.0
"""Who is so many steps from a search's entry, and no farther than that, is home there."""
MAX_GRID_CELLS = 4_000_000
MAX_SEARCH_CELLS = 1_000_000
"""Of a search, which plans on every cell at every step."""


class MissionKind(StrEnum):
    """What a mission is for."""

    SURVEY = "survey"
    """To map the sea floor of an area."""
    SEARCH = "search"
    """To look for something in a partly known site, and to be back in time."""


class PlannerSpec(Model):
    """Which planner decides, and its options."""

    @model_validator(mode="before")
    @classmethod
    def _options_are_a_planner_s(cls, data: Any) -> Any:
        """Say of an option that there is none of which there are, in this planner."""
        options = data.get("options") if isinstance(data, dict) else None
        unknown = [n for n in options if n not in PlannerOptions.model_fields] if isinstance(options, dict) else []
        if unknown:
            # Needed for words only: it brings all planners along.
            from app.exploration.planners import COVERERS, PLANNERS, SEARCHERS, options_of

            name = data.get("name", DEFAULT_PLANNER)
            known = SEARCHERS | COVERERS | PLANNERS
            if isinstance(name, str) and name in known:
                has = ", ".join(sorted(options_of(known[name])))
                words = f"planner {name!r} has no option {str(unknown[0])[:40]!r}: its options are {has}"
                raise FieldError(f"options.{unknown[0]}", words)
        return data

    name: str = Field(default=DEFAULT_PLANNER, description="One of the planners of GET /api/v1/planners")
    options: PlannerOptions = Field(
        default_factory=PlannerOptions, description="Its settings: those that GET /api/v1/planners lists for it"
    )


QUARTER_ROUND_DEG = 90.0
"""No latitude is larger."""


class MissionSpec(Model):
    """A mission as an operator describes it."""

    name: ShownName = Field(examples=["Leixoes quay"])
    kind: MissionKind = Field(
        default=MissionKind.SURVEY,
        description="survey: map the sea floor; search: look for something in a partly known site, see `search`",
    )
    area: PolygonGeometry = Field(description="The area to map, or the site to search")
    keep_out: list[PolygonGeometry] = Field(
        default_factory=list, max_length=100, description="Zones no vehicle may enter"
    )
    survey_lines: list[SurveyLine] = Field(
        default_factory=list,
        max_length=MOST_LINES,
        description="Lines of a line plan, which planner `lawnmower` flies in place of lines of its own; what lies "
        "outside the area or in keep-out zones is not flown. The mission ends when they are flown, or with its budget",
    )
    vehicles: list[VehicleSpec] = Field(default_factory=list, max_length=100)
    budget: Budget = Field(
        default=Budget(steps=100), description="How long the mission is: minutes, km_per_vehicle or steps"
    )
    steps: Steps = Field(
        default=100,
        description="Steps after which the mission is finished, short for a budget in steps; with another budget as "
        "many legs of limits.max_step_m as the vehicle with the longest way needs",
    )
    cell_m: float = Field(default=1.0, gt=0, le=1000, description="Cell of the map's grid")
    limits: Limits = Field(default_factory=Limits)
    planner: PlannerSpec = Field(default_factory=PlannerSpec)
    recovery: Recovery | None = Field(
        default=None,
        description="Where vehicles come home to, and when; null: they stop where they are, in a search they come to "
        "its entry",
    )
    failsafes: dict[Failsafe, Response] = Field(
        default_factory=dict,
        description="What is done when something fails, where it is not what `bathyfleet failsafes` lists",
        examples=[{"geofence_left": "return"}],
    )
    surface_policy: SurfacePolicy | None = Field(
        default=None, description="When vehicles come up for a GPS fix; null: never because of their position"
    )
    coverage: CoverageSpec = Field(default_factory=CoverageSpec)
    targets: list[TargetSpec] = Field(
        default_factory=list, max_length=MOST_TARGETS, description="Moving targets to keep track of"
    )
    tracking: Tracking = Field(default_factory=Tracking)
    search: SearchSpec | None = Field(
        default=None,
        description="With kind search, and only there: what is sought. Then planner.name is rollout unless given, and "
        "steps as many as the time window has room for",
        json_schema_extra={"x-defaults": SEARCH_DEFAULTS},
    )
    speed_mps: Speed = Field(default=1.3, description="Speed asked of vehicles that have none of their own")
    arrival_radius_m: float = Field(
        default=3.0,
        gt=0,
        le=100,
        description="Horizontal distance at which a waypoint counts as reached. Unless given, at most half of "
        "limits.max_step_m",
    )
    step_deadline_s: float = Field(
        default=60.0,
        gt=0,
        le=86_400,
        description="Least time that a leg is given, seconds of vehicle time, longer where it is long; after that it "
        "counts as missed and the vehicle flies its next, or, in steps of the whole team, the step ends without it",
    )
    accuracy_m: float = Field(
        default=0.25,
        gt=0,
        le=100,
        description="Standard deviation below which a cell counts as accurately known",
        # What each order of S-44 asks for where it is strictest.
        json_schema_extra={"x-orders": {order.spoken: strictest_sd_m(order) for order in Order}},
    )
    shoal_depth_m: float | None = Field(
        default=None,
        ge=-100,
        le=11_000,
        allow_inf_nan=False,
        description="What is shallower counts as shoal, metres below the datum of the map: its layer shoal_pct is the "
        "chance of that in each cell. It keeps no vehicle away: limits.min_altitude_m does. null: no such layer",
    )
    sounding_noise: float = Field(
        default=0.01,
        ge=0,
        le=1,
        description="Standard deviation of a range as a fraction of it, where the vehicle states none",
    )
    uncertainty: SoundingErrors = Field(
        default_factory=SoundingErrors, description="What makes soundings of swath sonars uncertain"
    )
    tide: Tide = Field(default_factory=Tide)
    sound_speed: SoundSpeed | None = Field(
        default=None,
        description="Sound speed correction by one cast or several; null: the sonars' own ranges are taken",
    )
    systematic_errors: SystematicErrors = Field(
        default_factory=SystematicErrors, description="What is always wrong with sonars and water levels"
    )
    mountings: dict[Name, MountingSpec] = Field(
        default_factory=dict,
        max_length=100,
        description="How sonars are mounted, by vehicle, in place of what their vehicles state: corrected when a patch "
        "test was evaluated",
    )
    site: SiteId | None = Field(
        default=None, description="The site that it surveys, which keeps what it finds; null: none"
    )
    site_prior: bool = Field(
        default=True, description="With a site: begin with the depths that its earlier surveys found"
    )
    after: MissionId | None = Field(
        default=None,
        description="The mission that it follows, for example with the next area: it begins by itself once that one "
        "was flown to its end and its vehicles are fit to go on; not when that one was ended by a person, aborted or "
        "failed. null: it begins when it is started",
    )
    seed: int = Field(default=0, ge=0, lt=2**63, description="Seed of every random decision")

    @model_validator(mode="before")
    @classmethod
    def _a_search_has_its_own_defaults(cls, data: Any) -> Any:
        return filled_in(data)

    @field_validator("failsafes")
    @classmethod
    def _nobody_comes_up_under_ships(cls, failsafes: dict[Failsafe, Response]) -> dict[Failsafe, Response]:
        response = failsafes.get(Failsafe.TRAFFIC, Response.WARN)
        if response not in (Response.WARN, Response.HOLD):
            raise ValueError(
                f"traffic is {response.value!r}, which brings vehicles up where ships are: say 'warn', or 'hold' to "
                "keep them below"
            )
        return failsafes

    @field_validator("vehicles")
    @classmethod
    def _names_are_unique(cls, vehicles: list[VehicleSpec]) -> list[VehicleSpec]:
        names = [v.name for v in vehicles]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"vehicle {twice[0]!r} is listed twice: every vehicle takes part once")
        return vehicles

    @model_validator(mode="after")
    def _has_one_length(self) -> Self:
        given = self.model_fields_set & {"budget", "steps"}
        if given == {"steps"}:
            object.__setattr__(self, "budget", Budget(steps=self.steps))
            return self
        if self.kind is MissionKind.SEARCH and self.budget.steps is None:
            raise FieldError(
                "budget", "kind is search, whose length is search.window_s: leave budget out, or give it in steps"
            )
        steps = self._steps_of(self.budget)
        if "steps" in given and self.steps != steps:
            raise FieldError(
                "steps",
                f"steps is {self.steps} but budget, {self.budget.model_dump_json()}, comes to {steps}: give one of "
                "them",
            )
        object.__setattr__(self, "steps", steps)
        return self

    def _steps_of(self, budget: Budget) -> int:
        fastest = max([self.speed_of(vehicle) for vehicle in self.vehicles], default=self.speed_mps)
        return budget.allowance(fastest).most_legs(self.limits.max_step_m)

    def with_budget(self, budget: Budget) -> Self:
        """Return the same mission of another length."""
        return self.model_copy(update={"budget": budget, "steps": self._steps_of(budget)})

    @model_validator(mode="after")
    def _arrives_within_a_step(self) -> Self:
        if "arrival_radius_m" not in self.model_fields_set:
            object.__setattr__(self, "arrival_radius_m", min(self.arrival_radius_m, self.limits.max_step_m / 2))
        return self

    @model_validator(mode="after")
    def _everything_is_near_the_area(self) -> Self:
        lons, _ = zip(*self.area.ring, strict=True)
        if max(lons) - min(lons) > HALF_ROUND_DEG:
            raise FieldError(
                "area",
                f"area reaches from longitude {min(lons)} to {max(lons)}: one that crosses 180 degrees cannot be "
                "surveyed; give the part on each side of it as a mission of its own",
            )
        if not self._is_near(self.area.ring):
            away = next(corner for corner in self.area.ring if not self._is_near([corner]))
            raise FieldError(
                "area",
                f"area reaches to {list(away)}, which is not within {MAX_EXTENT_M / 1000:.0f} km of its south-western "
                "corner: choose a smaller one",
            )
        places = {f"keep_out.{index}": zone.ring for index, zone in enumerate(self.keep_out)}
        places |= {f"survey_lines.{index}": line.coordinates for index, line in enumerate(self.survey_lines)}
        if self.search is not None:
            for name in ("obstacles", "simulated_obstacles"):
                standing: list[PolygonGeometry] = getattr(self.search, name)
                places |= {f"search.{name}.{index}": obstacle.ring for index, obstacle in enumerate(standing)}
            if self.search.transmitter is not None:
                places["search.transmitter"] = [self.search.transmitter]
        if not places or self._is_near([place for ring in places.values() for place in ring]):
            return self
        name, place = next((name, at) for name, ring in places.items() for at in ring if not self._is_near([at]))
        raise FieldError(name, f"{name} is at {list(place)}, nowhere near the area: {self._where_it_belongs(place)}")

    def _where_it_belongs(self, place: tuple[float, float]) -> str:
        """Return in words what to give in place of one that is not near the area."""
        lon, lat = place
        if abs(lon) <= QUARTER_ROUND_DEG and self._is_near([(lat, lon)]):
            return f"latitude and longitude look exchanged, give [longitude, latitude], here [{lat}, {lon}]"
        return "give [longitude, latitude] of a place near it"

    def _is_near(self, places: Sequence[tuple[float, float]]) -> bool:
        """Whether places, [longitude, latitude], can be told in the mission's frame."""
        lons, lats = zip(*places, strict=True)
        try:
            self.frame().to_local(np.array(lats), np.array(lons))
        except ValueError:
            return False
        return True

    @model_validator(mode="after")
    def _recovery_points_are_near_and_clear(self) -> Self:
        points = {"recovery.point": None if self.recovery is None else self.recovery.point}
        points |= {f"vehicles.{index}.recovery_point": v.recovery_point for index, v in enumerate(self.vehicles)}
        for name, point in points.items():
            if point is not None:
                self.check_recovery_point(name, point)
        return self

    def check_recovery_point(self, name: str, point: tuple[float, float]) -> None:
        """Refuse a recovery point that is far from the area or in a keep-out zone. Raises ValueError."""
        try:
            east, north = self.frame().to_local(np.array(point[1]), np.array(point[0]))
        except ValueError:
            words = f"{name} is at {list(point)}, nowhere near the area: {self._where_it_belongs(point)}"
            raise FieldError(name, words) from None
        place = Point(float(east), float(north))
        away_m = float(Polygon(self.local_area()).distance(place))
        if away_m > FARTHEST_HOME_M:
            raise FieldError(
                name,
                f"{name} lies {away_m:.0f} m from the area: vehicles come home over at most {FARTHEST_HOME_M:.0f} m",
            )
        for index, zone in enumerate(self.keep_out):
            if Polygon(self.to_local(zone)).buffer(self.limits.keep_out_margin_m).contains(place):
                words = f"{name} lies in keep_out.{index} or in its margin: give one that vehicles may go to"
                raise FieldError(name, words)

    @model_validator(mode="after")
    def _casts_are_near(self) -> Self:
        if self.sound_speed is not None:
            self.check_casts(self.sound_speed, "sound_speed.")
        return self

    def check_casts(self, sound_speed: SoundSpeed, prefix: str = "") -> None:
        """Refuse sound speed casts that were taken nowhere near the area. Raises FieldError."""
        for number, cast in enumerate(sound_speed.casts):
            if cast.position is not None and not self._is_near([cast.position]):
                field = f"{prefix}further.{number - 1}.position" if number else f"{prefix}position"
                raise FieldError(
                    field,
                    f"cast {cast.name!r} is at {list(cast.position)}, nowhere near the area: "
                    f"{self._where_it_belongs(cast.position)}",
                )

    @model_validator(mode="after")
    def _survey_lines_can_be_told_apart_and_flown(self) -> Self:
        if not self.survey_lines:
            return self
        if self.kind is MissionKind.SEARCH:
            raise FieldError("survey_lines", "survey_lines are given and kind is search: only surveys fly lines")
        names: dict[str, int] = {}
        for index, line in enumerate(self.survey_lines):
            if line.name in names:
                raise FieldError(
                    f"survey_lines.{index}.name",
                    f"{line.name!r} is the name of survey_lines.{names[line.name]} already: give each line its own",
                )
            names[line.name] = index
        corners = sum(len(line.coordinates) for line in self.survey_lines)
        if corners > MOST_CORNERS:
            words = f"the lines have {corners} positions, at most {MOST_CORNERS} are taken: simplify them"
            raise FieldError("survey_lines", words)
        length_km = sum(self._length_m(line) for line in self.survey_lines) / 1000.0
        if length_km > MOST_LINES_KM:
            words = f"the lines are {length_km:.0f} km long, at most {MOST_LINES_KM:.0f} km are taken: divide the plan"
            raise FieldError("survey_lines", words)
        if "crosslines_pct" not in self.coverage.model_fields_set:
            # A plan has the crosslines that it is to have.
            object.__setattr__(self, "coverage", self.coverage.model_copy(update={"crosslines_pct": 0.0}))
        return self

    def _length_m(self, line: SurveyLine) -> float:
        return float(np.hypot(*np.diff(self.local_line(line), axis=0).T).sum())

    @model_validator(mode="after")
    def _targets_can_be_told_apart(self) -> Self:
        taken = {vehicle.name: "a vehicle" for vehicle in self.vehicles}
        for index, target in enumerate(self.targets):
            for name in {target.name, target.called}:
                if name in taken:
                    raise FieldError(
                        f"targets.{index}",
                        f"target {target.name!r}: {name!r} is the name of {taken[name]} already: give it another one",
                    )
            taken |= dict.fromkeys((target.name, target.called), f"target {target.name!r}")
        return self

    @model_validator(mode="after")
    def _a_search_says_what_is_sought(self) -> Self:
        if (self.kind is MissionKind.SEARCH) != (self.search is not None):
            told = "missing" if self.search is None else "given"
            raise FieldError(
                "search",
                f"kind is {self.kind} and search is {told}: a mission of kind search needs it, and no other has it",
            )
        if self.search is None:
            return self
        if self.site is not None:
            raise FieldError("site", "site is given and kind is search: only surveys find depths, leave site out")
        site = Polygon(self.local_area())
        for name in ("goal", "entry"):
            lon, lat = getattr(self.search, name)
            east, north = self.frame().to_local(np.array(lat), np.array(lon))
            outside_m = float(site.distance(Point(float(east), float(north))))
            if outside_m > 0:
                raise FieldError(
                    f"search.{name}",
                    f"search.{name} lies {outside_m:.1f} m outside the area: it must be a place [longitude, latitude] "
                    "in it",
                )
        size = self.local_area().max(axis=0)
        cells = cell_count(size, self.cell_m)
        if cells > MAX_SEARCH_CELLS:
            raise FieldError(
                "cell_m",
                f"the site has {cells:.0f} cells of {self.cell_m} m, at most {MAX_SEARCH_CELLS} are searched: make "
                f"cell_m at least {_least_cell_m(size, MAX_SEARCH_CELLS):g}, or the area smaller",
            )
        if self.search.safety_m < self.arrival_radius_m:
            raise FieldError(
                "search.safety_m",
                f"search.safety_m is {self.search.safety_m} m but arrival_radius_m is {self.arrival_radius_m} m: a "
                "vehicle that arrives beside its waypoint must not be nearer to an obstacle than that; make "
                "arrival_radius_m smaller or safety_m larger",
            )
        return self

    @model_validator(mode="after")
    def _area_is_of_a_sensible_size(self) -> Self:
        area = self.local_area()
        size = area.max(axis=0) - area.min(axis=0)
        cells = cell_count(size, self.cell_m)
        if min(size) < 2 * self.cell_m:
            raise FieldError(
                "cell_m",
                f"the area is {size[0]:.1f} m x {size[1]:.1f} m, less than two cells of {self.cell_m} m: "
                f"enlarge it, or make cell_m at most {_rounded_down(0.5 * float(min(size))):g}",
            )
        # A disc of this radius holds the centre of a cell wherever it lies.
        if Polygon(area).buffer(-self.cell_m * np.sqrt(0.5)).is_empty:
            raise FieldError(
                "cell_m",
                f"the area is nowhere wide enough for cells of {self.cell_m} m: enlarge it or make cell_m smaller",
            )
        within = Polygon(area).buffer(-self.limits.border_margin_m, join_style="mitre")
        if within.is_empty or not isinstance(within, Polygon):
            raise FieldError(
                "limits.border_margin_m",
                f"limits.border_margin_m is {self.limits.border_margin_m} m, which leaves no area in one piece: "
                "make it smaller",
            )
        if cells > MAX_GRID_CELLS:
            raise FieldError(
                "cell_m",
                f"the area of {size[0]:.0f} m x {size[1]:.0f} m has {cells:.0f} cells of {self.cell_m} m, at most "
                f"{MAX_GRID_CELLS} are taken: make cell_m at least {_least_cell_m(size, MAX_GRID_CELLS):g}, or the "
                "area smaller",
            )
        return self

    def speed_of(self, vehicle: VehicleSpec | str) -> float:
        """Return the speed asked of a vehicle, m/s; of an unknown name the mission's."""
        if isinstance(vehicle, str):
            own = next((known.speed_mps for known in self.vehicles if known.name == vehicle), None)
        else:
            own = vehicle.speed_mps
        return self.speed_mps if own is None else own

    def recovery_of(self, vehicle: VehicleSpec) -> Recovery | None:
        """Return where a vehicle comes home to, and when; None where neither it nor the mission says.

        In a search that is its entry, where all are in the end anyway, unless something else is said.
        """
        if vehicle.recovery_point is None and self.recovery is None and self.search is not None:
            return Recovery(
                point=self.search.entry,
                radius_m=min(BACK_STEPS * self.limits.max_step_m, MOST_BACK_M),
                on_finish=Homecoming.STOP,
            )
        if vehicle.recovery_point is None:
            return self.recovery
        of_all = {} if self.recovery is None else self.recovery.model_dump(exclude={"point"})
        return Recovery(point=vehicle.recovery_point, **of_all)

    def ends_at_home(self, vehicle: VehicleSpec) -> bool:
        """Whether a vehicle goes home when it has flown its way, rather than wait for the others and stop at sea."""
        recovery = self.recovery_of(vehicle)
        return recovery is not None and recovery.on_finish is Homecoming.RETURN

    def allowance(self, vehicle: VehicleSpec | str) -> Allowance:
        """Return what a vehicle may fly in the whole mission."""
        return self.budget.allowance(self.speed_of(vehicle))

    def frame(self) -> LocalFrame:
        """The mission's local frame; its origin is the south-western corner of the area's bounding box."""
        lons, lats = zip(*self.area.ring, strict=True)
        return _frame(min(lats), min(lons))

    def local_area(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The area's vertices in the local frame, shape (n, 2): east, north in metres."""
        return self.to_local(self.area)

    def local_inner_area(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Where waypoints may be: the area without its margin, vertices as in :meth:`local_area`."""
        area = self.local_area()
        if self.limits.border_margin_m == 0.0:
            return area
        inner = Polygon(area).buffer(-self.limits.border_margin_m, join_style="mitre")
        return np.asarray(orient(inner).exterior.coords)[:-1]

    @property
    def lines_asked_for(self) -> bool:
        """Whether it ends when lines are flown that somebody asked for: those of a plan, or lines at a distance."""
        return bool(self.survey_lines) or self.planner.options.line_spacing_m is not None

    def local_line(self, line: SurveyLine) -> np.ndarray[Any, np.dtype[np.float64]]:
        """A line's positions in the local frame, shape (n, 2)."""
        lons, lats = zip(*line.coordinates, strict=True)
        return np.column_stack(self.frame().to_local(np.array(lats), np.array(lons)))

    def to_local(self, polygon: PolygonGeometry) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Vertices of a polygon in the local frame, counter-clockwise, shape (n, 2)."""
        lons, lats = zip(*polygon.ring, strict=True)
        east, north = self.frame().to_local(np.array(lats), np.array(lons))
        vertices = np.column_stack([east, north])
        ring_area = Polygon(vertices).exterior.is_ccw
        return vertices if ring_area else vertices[::-1]


def _least_cell_m(size_m: FloatArray, most: int) -> float:
    """Return about the least cell of which no more than ``most`` cover a rectangle, in two digits."""
    digit_m = 10.0 ** (math.floor(math.log10(math.sqrt(float(np.prod(size_m)) / most))) - 1)
    tried = math.ceil(math.sqrt(float(np.prod(size_m)) / most) / digit_m)
    while cell_count(size_m, tried * digit_m) > most:
        tried += 1
    return tried * digit_m


def _rounded_down(value: float) -> float:
    """Return a positive number in two digits, no larger than it is."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.floor(value / digit) * digit


@lru_cache(maxsize=256)
def _frame(lat_deg: float, lon_deg: float) -> LocalFrame:
    """Return the frame about an origin; making one takes milliseconds, and a description is checked often."""
    return LocalFrame(lat_deg, lon_deg)
