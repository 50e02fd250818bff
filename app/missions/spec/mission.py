"""What an operator asks for: the description of a mission, declared once.

The REST schema, the command line's help and the dashboard's forms are all made from these models.
"""

import math
from enum import StrEnum
from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Any, Self

import numpy as np
from pydantic import FailFast, Field, field_validator, model_validator
from shapely.geometry import Point, Polygon
from shapely.geometry.polygon import orient

from app.estimation.uncertainty import SoundingErrors
from app.exploration import DEFAULT_PLANNER
from app.exploration.planner.options import PlannerOptions
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.s44 import Order, strictest_sd_m
from app.mapping.water.vertical import LOWEST_ASTRONOMICAL_TIDE, check_depth_datum
from app.missions.spec.base import Latitude, Longitude, Model, Name, PolygonGeometry, cell_count
from app.missions.spec.budget import Allowance, Budget, Steps
from app.missions.spec.failsafes import Failsafe, Response
from app.missions.spec.recovery import Recovery
from app.missions.spec.search import DEFAULTS as SEARCH_DEFAULTS
from app.missions.spec.search import SearchSpec, filled_in
from app.missions.spec.site import SiteId
from app.missions.spec.sonar import SwathSonarSpec
from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.spec.targets import MOST_TARGETS, TargetSpec, Tracking

Speed = Annotated[float, Field(gt=0, le=5)]
MissionId = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_-]+$")]
ProfileDepth = Annotated[float, Field(ge=0, le=12_000)]
ProfileSpeed = Annotated[float, Field(ge=1300, le=1700)]

FARTHEST_HOME_M = 10_000.0
"""Farther from the area no recovery point lies."""

MAX_GRID_CELLS = 4_000_000
MAX_SEARCH_CELLS = 1_000_000
"""Of a search, which plans on every cell at every step."""

NO_TIDE = "none applied"


class Sensor(StrEnum):
    """How a vehicle sounds the bottom."""

    SINGLE_BEAM = "single_beam"
    DVL = "dvl"
    MULTIBEAM = "multibeam"


class MissionKind(StrEnum):
    """What a mission is for."""

    SURVEY = "survey"
    """To map the sea floor of an area."""
    SEARCH = "search"
    """To look for something in a partly known site, and to be back in time."""


class VehicleKind(StrEnum):
    """Which link reaches a vehicle."""

    IMC = "imc"
    REST = "rest"
    SIM = "sim"
    NEPTUS = "neptus"
    """Commanded by a Neptus console that asks this service where to, through the gateway."""


class Guidance(StrEnum):
    """How a vehicle of kind ``imc`` is led."""

    FOLLOW = "follow"
    LEGS = "legs"
    ACOUSTIC = "acoustic"


class VehicleSpec(Model):
    """A vehicle that takes part in a mission."""

    name: Name = Field(description="Its name; for IMC the name it announces", examples=["lauv-xplore-1"])
    kind: VehicleKind = Field(
        default=VehicleKind.IMC,
        description="imc: DUNE over UDP; rest: polls and posts by itself; sim: simulated inside the service; "
        "neptus: of a session of Neptus' ConvCAO panel, which makes its mission itself",
    )
    sensor: Sensor = Sensor.SINGLE_BEAM
    sonar: SwathSonarSpec | None = Field(
        default=None, description="With sensor multibeam: what that sonar can do; null: its defaults"
    )
    depth_m: float | None = Field(
        default=None,
        ge=0,
        le=6000,
        description="Depth it travels at where the bottom leaves room; null: the first vehicle of a mission at "
        "limits.min_depth_m, each further one limits.min_vertical_separation_m deeper",
    )
    altitude_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="Height above the bottom that it keeps where the bottom is known, down to limits.max_depth_m and "
        "never less than limits.min_altitude_m; elsewhere it travels at depth_m. null: it keeps its depth",
    )
    speed_mps: Speed | None = Field(default=None, description="Speed asked of it; null: the mission's speed_mps")
    turn_radius_m: float | None = Field(
        default=None,
        gt=0,
        le=200,
        description="Radius of its turning circle, by which plans pay for turns; null: what it flies in 4 s",
    )
    endurance_min: float | None = Field(
        default=None,
        gt=0,
        le=60 * 24 * 365,
        description="How long its energy lasts at its speed, minutes, from the start of the mission; counts where the "
        "vehicle tells no battery level. null: not known",
    )
    recovery_point: tuple[Longitude, Latitude] | None = Field(
        default=None,
        description="Where it is taken out of the water, [longitude, latitude]; null: at the mission's recovery.point",
    )
    guidance: Guidance = Field(
        default=Guidance.FOLLOW,
        description="How a vehicle of kind imc is led. follow: by references, one a second; legs: by a plan for each "
        "whole leg, where radio ends at the surface; acoustic: by legs, and by sound while radio is silent",
    )
    gateway: Name | None = Field(
        default=None, description="With guidance acoustic: the name that the node with the modem announces"
    )
    start: tuple[Longitude, Latitude] | None = Field(
        default=None,
        description="Where a simulated vehicle starts, [longitude, latitude]; default: a corner of the area",
    )

    @model_validator(mode="after")
    def _has_the_sonar_that_is_described(self) -> Self:
        if self.sonar is not None and self.sensor is not Sensor.MULTIBEAM:
            raise ValueError(f"sonar is given but sensor is {self.sensor}: only a multibeam is described by it")
        return self

    @model_validator(mode="after")
    def _is_led_as_its_kind_can_be(self) -> Self:
        if self.guidance is not Guidance.FOLLOW and self.kind is not VehicleKind.IMC:
            raise ValueError(
                f"guidance is {self.guidance} but kind is {self.kind}: only vehicles of kind imc have that"
            )
        if (self.guidance is Guidance.ACOUSTIC) != (self.gateway is not None):
            raise ValueError(
                f"guidance is {self.guidance} and gateway is {self.gateway!r}: "
                "a gateway is named with guidance acoustic, and only there"
            )
        return self


class Limits(Model):
    """What no waypoint may break. Checked before anything is sent to a vehicle."""

    max_step_m: float = Field(default=10.0, gt=0, le=2000, description="Largest distance a vehicle moves in one step")
    min_depth_m: float = Field(default=2.0, ge=0, le=6000, description="Shallowest depth of travel under water")
    max_depth_m: float = Field(default=30.0, gt=0, le=6000, description="Deepest depth of travel")
    min_altitude_m: float = Field(default=1.0, ge=0, le=1000, description="Least clearance above the sea floor")
    keep_out_margin_m: float = Field(
        default=10.0,
        ge=0,
        le=1000,
        description="Legs stay this far from keep-out zones: vehicles turn in circles and drift. With less "
        "than 10 m the circle in which one waits for its next waypoint can reach into a zone",
    )
    border_margin_m: float = Field(
        default=0.0,
        ge=0,
        le=1000,
        description="Waypoints stay this far inside the area: vehicles turn in circles at them and drift",
    )
    com_range_m: float | None = Field(
        default=None, gt=0, description="Every vehicle keeps another one within this range; null: unlimited"
    )
    min_separation_m: float = Field(
        default=5.0,
        ge=0,
        le=10_000,
        description="Least horizontal distance between vehicles at similar depth",
    )
    min_vertical_separation_m: float = Field(
        default=1.0,
        gt=0,
        le=1000,
        description="Difference in depth that makes horizontal separation unnecessary",
    )

    @model_validator(mode="after")
    def _depth_band_is_not_empty(self) -> Self:
        if self.max_depth_m < self.min_depth_m:
            raise ValueError(
                f"max_depth_m is {self.max_depth_m} but min_depth_m is {self.min_depth_m}: "
                "max_depth_m must be at least min_depth_m"
            )
        return self


class SurfacePolicy(Model):
    """When a vehicle comes up for a GPS fix: by how well it says that it knows where it is, by the clock, or both."""

    max_position_sd_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="Standard deviation of its position (position_sd_m) that a vehicle should not exceed; it comes up "
        "at 90 % of it. null: never because of it",
        examples=[3.0],
    )
    every_min: float | None = Field(
        default=None,
        gt=0,
        le=60 * 24,
        description="Minutes after which a vehicle comes up, also one that does not say how well it knows where it is. "
        "null: never because of the clock",
    )
    stay_s: float = Field(
        default=60.0, gt=0, le=3600, description="How long a vehicle stays up that comes up by the clock"
    )
    good_position_sd_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="It stays at the surface until its position is known this well; null: a third of the limit",
    )

    @model_validator(mode="after")
    def _can_be_reached(self) -> Self:
        if self.max_position_sd_m is None:
            if self.every_min is None:
                raise ValueError("neither max_position_sd_m nor every_min is given: give one of them")
            if self.good_position_sd_m is not None:
                raise ValueError("good_position_sd_m is given without max_position_sd_m: it has no meaning")
            return self
        if self.until_sd_m >= self.max_position_sd_m:
            raise ValueError(
                f"good_position_sd_m is {self.good_position_sd_m} but max_position_sd_m is {self.max_position_sd_m}: "
                "a good position must be known better than the limit"
            )
        return self

    @property
    def until_sd_m(self) -> float:
        """What counts as a good position again."""
        if self.max_position_sd_m is None:
            return math.inf
        return self.max_position_sd_m / 3.0 if self.good_position_sd_m is None else self.good_position_sd_m


class PlannerSpec(Model):
    """Which planner decides, and its options."""

    name: str = Field(default=DEFAULT_PLANNER, description="One of the planners of GET /api/v1/planners")
    options: PlannerOptions = Field(default_factory=PlannerOptions, description="Its settings")


class Tide(Model):
    """Water level correction: depth below the datum = sounded depth - level + datum_offset_m."""

    level_m: float = Field(
        default=0.0,
        ge=-20,
        le=20,
        description="Water level above the zero of the tide gauge or table (chart datum), metres",
    )
    source: str = Field(
        default=NO_TIDE,
        max_length=200,
        description="Where the level comes from, kept with the product",
    )
    sd_m: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="Standard deviation of the level; it counts in every cell's TVU estimate",
    )
    datum_epsg: int = Field(
        default=LOWEST_ASTRONOMICAL_TIDE,
        ge=1024,
        le=999_999,
        description="EPSG code of the depth datum that products state once a tide is applied, for example 5861 "
        "(LAT depth) or 5715 (MSL depth)",
    )
    datum_offset_m: float = Field(
        default=0.0,
        ge=-100,
        le=100,
        description="How far that datum lies above the zero that levels count from; added to every depth",
    )

    @property
    def is_unnamed(self) -> bool:
        """Whether nobody said where the level comes from."""
        return self.source == NO_TIDE

    @property
    def is_applied(self) -> bool:
        """Whether a level was stated, be it zero."""
        return self.level_m != 0.0 or self.datum_offset_m != 0.0 or not self.is_unnamed

    @field_validator("datum_epsg")
    @classmethod
    def _is_a_depth_datum(cls, epsg: int) -> int:
        check_depth_datum(epsg)
        return epsg


class SoundSpeed(Model):
    """Sound speed correction: every beam is followed through the profile for the time that its sonar measured."""

    assumed_mps: float = Field(default=1500.0, ge=1300, le=1700, description="Speed that is set in the sonars, m/s")
    profile: Annotated[list[tuple[ProfileDepth, ProfileSpeed]], FailFast()] = Field(
        min_length=1,
        max_length=2000,
        description="Measured speeds as [depth in m, speed in m/s], from top to bottom; one pair: the same everywhere",
        examples=[[[0.0, 1512.3], [5.0, 1509.8], [20.0, 1506.1]]],
    )
    source: str = Field(default="", max_length=200, description="Where the profile comes from, kept with the product")

    @field_validator("profile")
    @classmethod
    def _depths_ascend(cls, profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
        for index, (above, below) in enumerate(pairwise(depth for depth, _ in profile)):
            if below <= above:
                raise ValueError(f"entry {index + 1} is at {below:g} m, not below the {above:g} m of the one before it")
        return profile


class CoverageSpec(Model):
    """What full coverage by swath sonars is asked for, where the planner is `swath`."""

    overlap_pct: float = Field(
        default=6.0,
        ge=0,
        le=80,
        description="Share of half a swath that the next one sounds again, at least; more where position is uncertain",
    )
    crosslines_pct: float = Field(
        default=5.0,
        ge=0,
        le=50,
        description="Length of lines across all others, flown last, as a share of those; by what both measured where "
        "they cross a survey is judged. 0: none",
    )
    cell_of_depth: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Cells by depth, in files with cells of several sizes: each depth has the smallest of cell_m, "
        "twice and four times as much, and so on, that is at least this share of it, for example 0.05. null: one size",
    )


class MissionSpec(Model):
    """A mission as an operator describes it."""

    name: str = Field(
        min_length=1,
        max_length=120,
        description="Shown to people; need not be unique",
        examples=["Leixoes quay"],
    )
    kind: MissionKind = Field(
        default=MissionKind.SURVEY,
        description="survey: map the sea floor; search: look for something in a partly known site, see `search`",
    )
    area: PolygonGeometry = Field(description="The area to map, or the site to search")
    keep_out: list[PolygonGeometry] = Field(
        default_factory=list, max_length=100, description="Zones no vehicle may enter"
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
        default=None, description="Where vehicles come home to, and when; null: they stop where they are"
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
        default=3.0, gt=0, le=100, description="Horizontal distance at which a waypoint counts as reached"
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
        default=None, description="Sound speed correction; null: the sonars' own ranges are taken"
    )
    systematic_errors: SystematicErrors = Field(
        default_factory=SystematicErrors, description="What is always wrong with sonars and water levels"
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
            raise ValueError("kind is search, whose length is search.window_s: leave budget out, or give it in steps")
        fastest = max([self.speed_of(vehicle) for vehicle in self.vehicles], default=self.speed_mps)
        steps = self.budget.allowance(fastest).most_legs(self.limits.max_step_m)
        if "steps" in given and self.steps != steps:
            raise ValueError(
                f"steps is {self.steps} but budget, {self.budget.model_dump_json()}, comes to {steps}: give one of them"
            )
        object.__setattr__(self, "steps", steps)
        return self

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
            raise ValueError(f"{name} is {point}: it is nowhere near the area") from None
        place = Point(float(east), float(north))
        away_m = float(Polygon(self.local_area()).distance(place))
        if away_m > FARTHEST_HOME_M:
            raise ValueError(
                f"{name} lies {away_m:.0f} m from the area: vehicles come home over at most {FARTHEST_HOME_M:.0f} m"
            )
        for index, zone in enumerate(self.keep_out):
            if Polygon(self.to_local(zone)).buffer(self.limits.keep_out_margin_m).contains(place):
                raise ValueError(f"{name} lies in keep_out.{index} or in its margin: give one that vehicles may go to")

    @model_validator(mode="after")
    def _targets_can_be_told_apart(self) -> Self:
        taken = {vehicle.name: "a vehicle" for vehicle in self.vehicles}
        for target in self.targets:
            for name in {target.name, target.called}:
                if name in taken:
                    raise ValueError(
                        f"target {target.name!r}: {name!r} is the name of {taken[name]} already: give it another one"
                    )
            taken |= dict.fromkeys((target.name, target.called), f"target {target.name!r}")
        return self

    @model_validator(mode="after")
    def _a_search_says_what_is_sought(self) -> Self:
        if (self.kind is MissionKind.SEARCH) != (self.search is not None):
            told = "missing" if self.search is None else "given"
            raise ValueError(
                f"kind is {self.kind} and search is {told}: a mission of kind search needs it, and no other has it"
            )
        if self.search is None:
            return self
        if self.site is not None:
            raise ValueError("site is given and kind is search: only surveys find depths, leave site out")
        site = Polygon(self.local_area())
        for name in ("goal", "entry"):
            lon, lat = getattr(self.search, name)
            east, north = self.frame().to_local(np.array(lat), np.array(lon))
            outside_m = float(site.distance(Point(float(east), float(north))))
            if outside_m > 0:
                raise ValueError(
                    f"search.{name} lies {outside_m:.1f} m outside the area: it must be a place [longitude, latitude] "
                    "in it"
                )
        size = self.local_area().max(axis=0)
        cells = cell_count(size, self.cell_m)
        if cells > MAX_SEARCH_CELLS:
            raise ValueError(
                f"the site has {cells:.0f} cells of {self.cell_m} m, at most {MAX_SEARCH_CELLS} are searched: make "
                "cell_m larger or the area smaller"
            )
        if self.search.safety_m < self.arrival_radius_m:
            raise ValueError(
                f"search.safety_m is {self.search.safety_m} m but arrival_radius_m is {self.arrival_radius_m} m: a "
                "vehicle that arrives beside its waypoint must not be nearer to an obstacle than that; make "
                "arrival_radius_m smaller or safety_m larger"
            )
        return self

    @model_validator(mode="after")
    def _area_is_of_a_sensible_size(self) -> Self:
        area = self.local_area()
        size = area.max(axis=0) - area.min(axis=0)
        cells = cell_count(size, self.cell_m)
        if min(size) < 2 * self.cell_m:
            raise ValueError(
                f"the area is {size[0]:.1f} m x {size[1]:.1f} m, less than two cells of {self.cell_m} m: "
                "enlarge it or make cell_m smaller"
            )
        # A disc of this radius holds the centre of a cell wherever it lies.
        if Polygon(area).buffer(-self.cell_m * np.sqrt(0.5)).is_empty:
            raise ValueError(
                f"the area is nowhere wide enough for cells of {self.cell_m} m: enlarge it or make cell_m smaller"
            )
        within = Polygon(area).buffer(-self.limits.border_margin_m, join_style="mitre")
        if within.is_empty or not isinstance(within, Polygon):
            raise ValueError(
                f"limits.border_margin_m is {self.limits.border_margin_m} m, which leaves no area in one piece: "
                "make it smaller"
            )
        if cells > MAX_GRID_CELLS:
            raise ValueError(
                f"the area of {size[0]:.0f} m x {size[1]:.0f} m has {cells:.0f} cells of {self.cell_m} m, "
                f"at most {MAX_GRID_CELLS} are taken: make cell_m larger or the area smaller"
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
        """Return where a vehicle comes home to, and when; None where neither it nor the mission says."""
        if vehicle.recovery_point is None:
            return self.recovery
        of_all = {} if self.recovery is None else self.recovery.model_dump(exclude={"point"})
        return Recovery(point=vehicle.recovery_point, **of_all)

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

    def to_local(self, polygon: PolygonGeometry) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Vertices of a polygon in the local frame, counter-clockwise, shape (n, 2)."""
        lons, lats = zip(*polygon.ring, strict=True)
        east, north = self.frame().to_local(np.array(lats), np.array(lons))
        vertices = np.column_stack([east, north])
        ring_area = Polygon(vertices).exterior.is_ccw
        return vertices if ring_area else vertices[::-1]


@lru_cache(maxsize=256)
def _frame(lat_deg: float, lon_deg: float) -> LocalFrame:
    """Return the frame about an origin; making one takes milliseconds, and a description is checked often."""
    return LocalFrame(lat_deg, lon_deg)
