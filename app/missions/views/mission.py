"""What the mission service answers about missions, vehicles and steps; REST, live view and dashboard share it."""

from datetime import datetime
from enum import StrEnum
from typing import Any

from pydantic import Field, SkipValidation, computed_field

from app.missions.fleet.interface import LinkState, WaypointStatus
from app.missions.flown import Flown, Phase, efficiency_pct
from app.missions.spec.base import Latitude, Longitude
from app.missions.spec.budget import Budget
from app.missions.spec.failsafes import Failsafe, Response
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import Sensor, VehicleKind
from app.missions.states import Action, MissionState, allowed_actions
from app.missions.views.base import View
from app.missions.views.orders import OrderView
from app.missions.views.search import SearchProgress
from app.missions.views.targets import TargetView


class PositionQuality(StrEnum):
    """How well a vehicle knows where it is."""

    UNTOLD = "untold"
    """It does not say."""
    STATED = "stated"
    """It says, and the mission has no surface_policy to judge it by."""
    GOOD = "good"
    """As well as after a fix."""
    FADING = "fading"
    POOR = "poor"
    """Worse than the mission allows."""


LOW_BATTERY_PCT, CRITICAL_BATTERY_PCT = 40.0, 15.0
"""Below the first a mission should not be started without a thought, below the second not at all."""


class BatteryState(StrEnum):
    """What a battery's level is worth."""

    OK = "ok"
    LOW = "low"
    CRITICAL = "critical"
    """Too little for a start."""

    @classmethod
    def of(cls, level_pct: float) -> "BatteryState":
        """Return what a level is worth."""
        if level_pct < CRITICAL_BATTERY_PCT:
            return cls.CRITICAL
        return cls.LOW if level_pct < LOW_BATTERY_PCT else cls.OK


class FailsafeView(View):
    """A failsafe in force for a vehicle."""

    failsafe: Failsafe
    response: Response
    message: str


class WaitingCircle(View):
    """Where a vehicle waits: a circle that was found free of zones and of other vehicles' ways."""

    centre: tuple[Longitude, Latitude]
    radius_m: float = Field(description="Of the room that it is given: circles are not flown on rails")


class VehicleView(View):
    """A vehicle as an operator sees it now."""

    name: str
    kind: VehicleKind
    sensor: Sensor | None = None
    mission_id: str | None = Field(default=None, description="The mission it takes part in, if any")
    active: bool = Field(default=True, description="False once it left its mission")
    left_at: datetime | None = Field(default=None, description="When it left the mission; null while it takes part")
    breach: str = Field(
        default="", description="Where it is that it must not be: in a keep-out zone or outside the area; else empty"
    )
    link: LinkState
    reason: str = Field(
        default="", description="What is missing or wrong and what to do, or why it waits; empty: all is well"
    )
    age_s: float | None = Field(
        default=None,
        description="Seconds since it last told where it is; since it was heard where it never did; null: never",
    )
    address: str | None = None
    imc_id: int | None = None
    lat_deg: float | None = None
    lon_deg: float | None = None
    east_m: float | None = None
    north_m: float | None = None
    depth_m: float | None = None
    altitude_m: float | None = None
    heading_deg: float | None = None
    speed_mps: float | None = None
    battery_pct: float | None = None
    position_sd_m: float | None = Field(
        default=None, description="How well it says that it knows where it is: standard deviation in metres"
    )
    localization: PositionQuality = Field(
        default=PositionQuality.UNTOLD, description="What that is worth beside the mission's surface_policy"
    )
    swath_m: tuple[float, float] | None = Field(
        default=None,
        description="How far its swath sonar reached with its last ping, level to port and to starboard, metres; null: "
        "it has none, or did not measure within the last seconds",
    )
    surfacing: bool = Field(default=False, description="On its way up, or at the surface, for a GPS fix")
    risings: int = Field(default=0, description="How often it was sent up for a fix in this mission")
    pursuing: str | None = Field(default=None, description="The target that it leaves the mapping for")
    phase: Phase | None = Field(default=None, description="What it is at; null while it takes part in no mission")
    flown_m: float = Field(default=0.0, description="What it has flown in this mission, along its track")
    on_plan_m: float = Field(default=0.0, description="Of those, metres along planned legs")
    idle_s: float = Field(default=0.0, description="Vehicle time in which it waited for a decision")
    order: OrderView | None = Field(default=None, description="What its operator ordered; null: it does its part")
    withdrawn: str = Field(default="", description="Why it surveys no more; empty while it does")
    part_done: bool = Field(default=False, description="It surveys no more as it has flown all that it had to")
    energy_left_pct: float | None = Field(
        default=None, description="What is left of its energy, by its battery or else by endurance_min; null: not known"
    )
    energy_left_s: float | None = Field(
        default=None, description="How long that lasts at its speed for sure, vehicle time; null: not known"
    )
    recovery_point: tuple[Longitude, Latitude] | None = Field(
        default=None, description="Where it comes home to, [longitude, latitude]; null: nowhere"
    )
    return_needs_s: float | None = Field(
        default=None, description="How long its way home takes from where it is, vehicle time; null: not known"
    )
    turn_back_at: datetime | None = Field(
        default=None, description="When it has to turn back, if it goes no farther from home; null: not known"
    )
    turn_back_point: tuple[Longitude, Latitude] | None = Field(
        default=None,
        description="Where on its planned legs it has to turn back at the latest, [longitude, latitude]; null: on none "
        "of them, or not known",
    )
    way_home: list[tuple[Longitude, Latitude]] = Field(
        default_factory=list,
        description="Corners of its way home from about where it is, the last its recovery point; empty: none, or over",
    )
    waiting_circle: WaitingCircle | None = Field(
        default=None, description="Where it was sent to wait; null: it was not, or goes on"
    )
    failsafes: list[FailsafeView] = Field(
        default_factory=list, description="What is wrong with it and what is done about that, the strongest first"
    )

    @computed_field  # type: ignore[prop-decorator]
    @property
    def battery(self) -> BatteryState | None:
        """What its battery's level is worth; null while it has not said."""
        return None if self.battery_pct is None else BatteryState.of(self.battery_pct)


class CurrentView(View):
    """The current: what the mission's vehicles last told of it, on average."""

    speed_mps: float
    toward_deg: float = Field(description="Where the water goes, degrees from true north")


class WaypointView(View):
    """One waypoint of one vehicle."""

    vehicle: str
    step: int
    lat_deg: float
    lon_deg: float
    east_m: float
    north_m: float
    depth_m: float
    speed_mps: float
    arrival_radius_m: float
    min_altitude_m: float
    way_home: list[tuple[Longitude, Latitude]] = Field(
        default_factory=list,
        description="Where it goes when it hears of nobody any more: corners as [longitude, latitude], the "
        "last at its recovery point; told to vehicles that ask for their waypoint",
    )
    status: WaypointStatus
    reason: str = ""


class Progress(View):
    """How far a mission has come."""

    step: int = Field(description="Last committed step; 0 before the first")
    steps: int = Field(
        description="Steps after which it is finished; with a budget in minutes or kilometres about so many, as legs "
        "may be shorter than limits.max_step_m"
    )
    budget: Budget = Field(description="How long the mission is, as it was given")
    minutes_left: float | None = Field(
        default=None, description="Vehicle time under way that is left, of the vehicle with most; null: not known"
    )
    km_left_per_vehicle: float | None = Field(
        default=None, description="What is left to fly for the vehicle with most; null: not known"
    )
    soundings: int = Field(description="Accepted soundings")
    rejected: int = Field(description="Soundings and pings kept but not used")
    pings: int = Field(default=0, description="Accepted pings of swath sonars")
    beams: int = Field(default=0, description="Beams of these that detected something; they are no soundings")
    ensonified_pct: float | None = Field(
        default=None,
        description="Share of the area's cells that beams of swath sonars met; null without any. With "
        "coverage.cell_of_depth cells are those that the depth of a place asks for, here, in dense_pct and in holidays",
    )
    dense_pct: float | None = Field(
        default=None, description="Share of the area's cells with at least five soundings; null without swath sonars"
    )
    holidays: int | None = Field(
        default=None,
        description="Holidays: pieces of ground of at least three by three cells that were missed inside of what was "
        "swept; null without swath sonars",
    )
    distance_m: float = Field(description="Distance travelled by all vehicles, along their tracks")
    coverage_pct: float = Field(
        description="Share of the area's cells known to accuracy_m; with swath sonars of those that a beam met"
    )
    remaining_pct: float = Field(default=100.0, description="Share of the landmarks not known to accuracy_m")
    mean_sd_m: float | None = Field(default=None, description="Mean standard deviation of the map")
    objective: float | None = Field(default=None, description="The planner's objective at the last step")
    terms: dict[str, float] = Field(default_factory=dict)
    elapsed_s: float = Field(default=0.0, description="Wall-clock seconds in state running")
    eta_s: float | None = Field(default=None, description="Estimated wall-clock seconds until the last step")
    search: SearchProgress | None = Field(default=None, description="In missions of kind search: how it stands")


class MissionSummary(View):
    """A mission in a list."""

    id: str
    name: str
    state: MissionState
    reason: str = Field(default="", description="Why it is in this state")
    created_at: datetime
    updated_at: datetime
    ending: MissionState | None = Field(
        default=None, description="What it becomes once all its vehicles are home; null while it goes on"
    )
    after: str | None = Field(default=None, description="The mission that it follows; null: it follows none")
    progress: Progress

    @computed_field  # type: ignore[prop-decorator]
    @property
    def allowed_actions(self) -> list[Action]:
        """What may be asked of it in this state: ``POST /missions/{id}/start`` and so on."""
        aborted = self.ending is MissionState.ABORTED
        return [one for one in allowed_actions(self.state) if not (aborted and one is Action.FINISH)]


class MissionView(MissionSummary):
    """A mission with everything an operator sees of it."""

    # Checked when it was stored; checking its geometry for every answer would take milliseconds.
    spec: SkipValidation[MissionSpec]
    origin: tuple[Longitude, Latitude] = Field(description="Origin of the local frame, [longitude, latitude]")
    vehicles: list[VehicleView]
    waypoints: list[WaypointView] = Field(description="The newest waypoint of each vehicle")
    current: CurrentView | None = Field(
        default=None, description="As its vehicles estimate it, and energy is counted with it; null: none tells of it"
    )
    targets: list[TargetView] = Field(default_factory=list, description="What is known of the moving targets")
    has_reference: bool = Field(
        default=False, description="Whether the map is compared with a grid, which `GET …/reference` describes"
    )

    @computed_field  # type: ignore[prop-decorator]
    @property
    def efficiency_pct(self) -> float | None:
        """Share of all metres flown that led along planned legs; null while nothing was flown."""
        return efficiency_pct(Flown(vehicle.flown_m, vehicle.on_plan_m) for vehicle in self.vehicles)


class Level(StrEnum):
    """How much an event matters."""

    INFO = "info"
    WARNING = "warning"
    ALARM = "alarm"


class EventView(View):
    """One line of a mission's log."""

    id: int
    mission_id: str
    time: datetime
    level: Level
    kind: str = Field(description="Machine-readable kind, for example step, state, vehicle, sounding, safety")
    message: str
    data: dict[str, Any] = Field(default_factory=dict)


class CheckStatus(StrEnum):
    """How a line of the checklist stands."""

    OK = "ok"
    NOTE = "note"
    """Worth knowing; nothing is wrong."""
    WARNING = "warning"
    """The mission can start, but look at it first."""
    PROBLEM = "problem"


class StepView(View):
    """A step that was decided: its figures, and where it sent the vehicles."""

    number: int
    committed_at: datetime
    objective: float | None
    terms: dict[str, float]
    figures: dict[str, float] = Field(
        description="How far the mission had come: coverage_pct, remaining_pct, mean_sd_m, distance_m; empty in steps "
        "of before they were kept"
    )
    soundings: int = Field(description="Soundings that its map was made of")
    waypoints: list[WaypointView]


class CheckView(View):
    """One line of the checklist before a start."""

    id: str = Field(examples=["links"])
    title: str
    status: CheckStatus
    message: str
    remedy: str = Field(default="", description="What to do about it; empty when all is well")


class PreflightView(View):
    """What stands before a start."""

    ready: bool = Field(description="False while any line is a problem: a start would be refused or fail")
    checks: list[CheckView]
    questions: list[str] = Field(
        default_factory=list,
        description="What somebody has to have looked at, from the setting checklist: see `confirmed` of a start",
    )


class StopView(View):
    """A vehicle's answer to a stop."""

    vehicle: str
    acknowledged: bool
    detail: str


class ActionView(View):
    """What an action led to, with each vehicle's answer where vehicles were stopped."""

    mission: MissionSummary
    stops: list[StopView] = Field(default_factory=list)


class PlannerView(View):
    """A planner that a mission may name, or one that is installed and cannot be used."""

    name: str
    summary: str
    package: str = Field(description="What brings it, with its version")
    problem: str = Field(default="", description="Why it cannot be used; empty: it can")
    options: dict[str, Any] = Field(description="JSON schema of its options")
