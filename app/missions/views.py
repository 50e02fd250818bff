"""What the mission service answers: the shapes that the REST API, the live view and the dashboard share."""

from datetime import datetime
from enum import StrEnum
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, SkipValidation

from app.mapping.s44 import Order
from app.missions.fleet import LinkState, WaypointStatus
from app.missions.search.views import SearchMessage, SearchProgress
from app.missions.spec import MissionSpec, Sensor, SoundSpeed, Tide, VehicleKind
from app.missions.spec_base import Latitude, Longitude
from app.missions.states import MissionState
from app.missions.target_views import TargetView
from app.missions.view_base import View


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


class VehicleView(View):
    """A vehicle as an operator sees it now."""

    name: str
    kind: VehicleKind
    sensor: Sensor | None = None
    mission_id: str | None = Field(default=None, description="The mission it takes part in, if any")
    active: bool = Field(default=True, description="False once it left its mission")
    link: LinkState
    reason: str = Field(default="", description="What is missing or wrong, and what to do; empty when all is well")
    age_s: float | None = Field(default=None, description="Seconds since last heard; null: never")
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
    surfacing: bool = Field(default=False, description="On its way up, or at the surface, for a GPS fix")
    risings: int = Field(default=0, description="How often it was sent up for a fix in this mission")
    pursuing: str | None = Field(default=None, description="The target that it leaves the mapping for")


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
    status: WaypointStatus
    reason: str = ""


class Progress(View):
    """How far a mission has come."""

    step: int = Field(description="Last committed step; 0 before the first")
    steps: int
    soundings: int = Field(description="Accepted soundings")
    rejected: int = Field(description="Soundings kept but not used")
    distance_m: float = Field(description="Distance travelled by all vehicles, along their tracks")
    coverage_pct: float = Field(description="Share of the area's cells known to accuracy_m")
    remaining_pct: float = Field(default=100.0, description="Share of the landmarks never known to accuracy_m")
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
    progress: Progress


class MissionView(MissionSummary):
    """A mission with everything an operator sees of it."""

    # Checked when it was stored; checking its geometry for every answer would take milliseconds.
    spec: SkipValidation[MissionSpec]
    origin: tuple[Longitude, Latitude] = Field(description="Origin of the local frame, [longitude, latitude]")
    vehicles: list[VehicleView]
    waypoints: list[WaypointView] = Field(description="The newest waypoint of each vehicle")
    targets: list[TargetView] = Field(default_factory=list, description="What is known of the moving targets")


class Verdict(StrEnum):
    """What happened to one measurement."""

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    """Stored with the reason, not used for the map."""
    DUPLICATE = "duplicate"
    """Already there; nothing stored."""


class Ruling(StrEnum):
    """What an operator said of a sounding."""

    RESTORED = "restored"
    """It counts, whatever gate and map think of it."""
    REJECTED = "rejected"
    """It does not count."""


class SoundingState(StrEnum):
    """Whether a sounding is in the map, and who decided that."""

    USED = "used"
    RESTORED = "restored"
    """Used because an operator restored it."""
    REJECTED = "rejected"
    """Kept out by the gate."""
    DOUBTED = "doubted"
    """Left out of the map because its neighbours say otherwise."""
    WITHDRAWN = "withdrawn"
    """Kept out by an operator."""


class SoundingView(View):
    """A stored sounding; what was measured never changes, only whether it counts."""

    id: int
    vehicle: str
    time_s: float = Field(description="The vehicle's clock, Unix seconds")
    beam: int
    step: int
    lat_deg: float
    lon_deg: float
    range_m: float
    raw_depth_m: float = Field(description="Of the bottom below the surface, as measured")
    depth_m: float | None = Field(description="Corrected, below the datum; null where no correction could be made")
    sd_m: float | None
    state: SoundingState
    reason: str = Field(description="Why it is not used, or who restored it")


class SoundingPage(View):
    """Some soundings, in the order they came."""

    total: int = Field(description="Of all pages")
    items: list[SoundingView]
    next_after: int | None = Field(description="Give it as `after` for the next page; null: this is the last")


class TideCorrection(Tide):
    """A mission's tide: a constant level, or a table of high and low waters in its place."""

    table: str | None = Field(
        default=None,
        max_length=8_000_000,
        description="Text of a .tid table, UTC: a line 'YYYY/MM/DD hh:mm:ss.sss level' per high or low water. Levels "
        "between two are a half cosine; soundings beyond the table are rejected until it covers them. Null: level_m",
    )
    table_name: str = Field(default="", max_length=200, description="Its name; default: the harbour that it states")


class TideTableView(View):
    """A tide table in short."""

    name: str
    first: datetime = Field(description="Time of the first entry")
    last: datetime = Field(description="Time of the last entry")
    entries: int
    sha256: str = Field(description="Of the table as it was sent")


class CorrectionsView(View):
    """How soundings are corrected; their raw values stay beside the corrected ones."""

    tide: Tide
    tide_table: TideTableView | None = Field(description="Its levels count in place of tide.level_m")
    sound_speed: SoundSpeed | None
    vertical_datum: str = Field(description="What corrected depths are counted from")
    accepted: int = Field(description="Soundings accepted under these corrections")
    rejected: int


class ImportOptions(BaseModel):
    """What a file does not say by itself."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    filename: str = Field(
        min_length=1,
        max_length=200,
        pattern=r"^[^/\\\x00-\x1f\x7f]+$",
        description="Its name; the ending says what it is: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc or .bag",
        examples=["harbour_2019.xyz"],
    )
    source: str = Field(default="", max_length=500, description="Where it comes from, kept with the mission")
    crs: str | None = Field(
        default=None,
        min_length=1,
        max_length=2000,
        description="What positions are in where the file does not say: EPSG:4326, EPSG:32629, WKT, or local for the "
        "mission's own frame",
    )
    positive: Literal["down", "up"] | None = Field(
        default=None, description="Which way values grow: down for depths, up for heights; default: what the file says"
    )
    sd_m: float | None = Field(
        default=None, gt=0, le=1000, description="Standard deviation of the depths that state none, metres"
    )
    order: Order | None = Field(
        default=None, description="In place of sd_m: the S-44 order surveyed to; its largest TVU is assumed"
    )
    datum_offset_m: float = Field(
        default=0.0, ge=-200, le=200, description="Added to every depth to bring it to the mission's datum"
    )


class ImportView(View):
    """Soundings from elsewhere that a mission began with. They are not among its own."""

    id: str
    filename: str
    source: str
    sha256: str = Field(description="Of the file")
    created_at: datetime
    found: int = Field(description="Depths in the file")
    taken: int = Field(description="Those in or near the area, as they count in the map")
    min_depth_m: float
    max_depth_m: float
    median_sd_m: float
    notes: list[str] = Field(description="What was assumed or done, in words")
    replayed: bool = Field(default=False, description="True: the same file was imported before, nothing changed")


class ReferenceView(View):
    """The grid that a mission's map is compared with."""

    filename: str
    source: str
    created_at: datetime
    cells: int = Field(description="Cells of the map's grid that it knows")
    notes: list[str]


class ItemVerdict(View):
    """The verdict on one item of a batch."""

    index: int
    verdict: Verdict
    reason: str = ""


class BatchVerdict(View):
    """The verdicts on a batch, in its order. Whatever is counted accepted is stored for good."""

    accepted: int
    rejected: int
    duplicate: int
    items: list[ItemVerdict]
    replayed: bool = Field(
        default=False, description="True: this idempotency key was seen before, this is the first answer"
    )


class LogImportView(View):
    """What came of a vehicle's log."""

    file: str
    vehicle: str
    soundings: int = Field(description="Accepted, stored for good")
    rejected: int = Field(description="Kept but not used")
    duplicate: int = Field(description="There before, from live telemetry or another log")
    reasons: dict[str, int] = Field(description="Why soundings were rejected, and how many each")
    refused: dict[str, int] = Field(description="Why ranges did not become soundings, and how many each")
    first_s: float | None = Field(description="Vehicle's clock at the first record, Unix seconds")
    last_s: float | None = Field(description="Vehicle's clock at the last record, Unix seconds")
    packets: int
    unreadable: dict[str, int] = Field(description="Packets that could not be read, by reason")
    skipped_bytes: int = Field(description="Bytes that are no packet")
    cut_off: bool = Field(description="The file ends in the middle, as after a power loss; what came before is used")
    known: bool = Field(description="The whole log had been imported before; nothing was written")


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


class MapView(View):
    """The map as JSON: row 0 is south, column 0 is west, null outside the area or where unknown."""

    mission_id: str
    version: int = Field(description="Grows with every new map; 0: no sounding yet")
    step: int
    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int
    corners: list[tuple[Longitude, Latitude]] = Field(
        description="[longitude, latitude] of the grid's corners: north-west, north-east, south-east, south-west"
    )
    vertical_datum: str = Field(description="What depths are counted from")
    min_depth_m: float | None
    max_depth_m: float | None
    model: str
    depth_m: list[list[float | None]]
    sd_m: list[list[float | None]]
    count: list[list[int]]
    sounded: list[list[bool]]
    layers: dict[str, list[list[float | None]]] = Field(
        default_factory=dict, description="Further layers that were asked for, by name"
    )


class ConformityView(View):
    """How the TVU estimate stands beside one order of IHO S-44; no order is claimed by it."""

    order: Order
    cells_pct: float = Field(description="Share of the cells whose TVU estimate stays within the order's largest")
    sounded_pct: float | None = Field(description="The same among the sounded cells; null: none is")
    statement: str = Field(examples=["TVU estimate meets Order 1a in 83.2 % of cells"])


class DifferenceView(View):
    """Map minus reference grid over the cells that both know."""

    rmse_m: float
    l2_norm: float = Field(description="Euclidean norm of all differences; grows with the number of cells")
    bias_m: float
    p95_m: float = Field(description="95th percentile of the absolute difference")
    max_m: float
    cells: int


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


class QualityView(View):
    """How good the map is, as far as it can be told."""

    version: int = Field(description="Of the map")
    vertical_datum: str
    common_sd_m: float = Field(description="Standard deviation of what all soundings share, counted in every TVU")
    tvu: list[ConformityView]
    difference: DifferenceView | None = Field(description="To the reference grid; null: there is none that it meets")


class ProductView(View):
    """A file that can be downloaded."""

    name: str = Field(description="Its name for bathyfleet export", examples=["tif"])
    title: str
    media_type: str
    href: str = Field(description="Path on this service")
    needs_map: bool = Field(description="Whether a first map is needed")


class SnapshotMessage(View):
    """First message on the live socket: everything needed to draw the picture."""

    type: Literal["snapshot"] = "snapshot"
    mission: MissionView
    tracks: dict[str, list[tuple[float, float, float]]] = Field(
        description="Per vehicle its track so far as [longitude, latitude, depth], to within 0.2 m"
    )
    map_version: int
    last_event_id: int


class VehiclesMessage(View):
    """Positions and links, a few times per second."""

    type: Literal["vehicles"] = "vehicles"
    time: datetime
    vehicles: list[VehicleView]


class TargetsMessage(View):
    """What is known of the moving targets, a few times per second where a mission has any."""

    type: Literal["targets"] = "targets"
    time: datetime
    targets: list[TargetView]


class WaypointsMessage(View):
    """Waypoints whose state changed."""

    type: Literal["waypoints"] = "waypoints"
    waypoints: list[WaypointView]


class StateMessage(View):
    """The mission's state or progress changed."""

    type: Literal["mission"] = "mission"
    mission: MissionSummary


class MapMessage(View):
    """A new map can be fetched: ``GET /missions/{id}/map`` or its picture."""

    type: Literal["map"] = "map"
    version: int
    step: int
    min_depth_m: float | None
    max_depth_m: float | None


class EventMessage(View):
    """A new line of the log."""

    type: Literal["event"] = "event"
    event: EventView


LiveMessage = (
    SnapshotMessage
    | VehiclesMessage
    | TargetsMessage
    | SearchMessage
    | WaypointsMessage
    | StateMessage
    | MapMessage
    | EventMessage
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
    """A planner that a mission may name."""

    name: str
    summary: str
    options: dict[str, Any] = Field(description="JSON schema of its options")
