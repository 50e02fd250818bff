"""What the service is told and what it answers.

Written by ``python -m app.client`` from the service's OpenAPI document: changed there, not here.
"""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from bathyfleet.client.model import Model, Open

Action: TypeAlias = Annotated[Literal["start", "pause", "resume", "abort", "finish"], Open]
"""What operators and consoles may ask of a mission."""

AlarmKind: TypeAlias = Annotated[Literal["leak", "critical_energy", "too_deep", "position_lost", "no_position", "low_energy", "link_lost", "traffic", "geofence_left", "vehicle_error", "other_console", "all_links_lost", "zone_entered", "area_left", "vehicle_lost", "vehicle_restarted", "vehicle_refuses", "stop_not_acknowledged", "not_come_home", "no_way_home", "no_vehicle", "no_waypoint", "no_scan", "search_late", "search_stuck", "no_water_level", "database_unwritable", "mission_failed", "not_begun", "watch_failed", "test"], Open]
"""What is raised as an alarm. Those of failsafes have the failsafes' names."""

AlarmSeverity: TypeAlias = Annotated[Literal["minor", "major", "critical"], Open]
"""How grave an alarm is, least to most, in the words of ITU-T X.733."""

AlarmState: TypeAlias = Annotated[Literal["open", "acknowledged"], Open]
"""Whether somebody has taken an alarm."""

BatteryState: TypeAlias = Annotated[Literal["ok", "low", "critical"], Open]
"""What a battery's level is worth."""

CastRule: TypeAlias = Annotated[Literal["nearest_in_time", "nearest_in_distance_within_time"], Open]
"""How the cast of a ping is chosen."""

Cause: TypeAlias = Annotated[Literal["sound", "switched_off", "port_in_use", "no_interface", "no_vehicle", "not_heard", "no_announce", "no_service", "announces_ceased", "no_traffic", "unreachable", "blocked_port", "stale_port", "foreign_address", "wrong_version", "same_id_twice", "same_name_twice", "our_id_taken", "clock_off", "clock_rate", "silent", "radio_gaps", "restarted", "packets_dropped", "low_rate", "no_entities", "no_soundings", "soundings_refused", "no_way_home", "foreign_control", "not_ready", "send_errors", "bad_packets", "refused", "unknown_messages", "crowded"], Open]
"""What a finding is about; the first of a node's problems is the one to look at."""

CheckStatus: TypeAlias = Annotated[Literal["ok", "note", "warning", "problem"], Open]
"""How a line of the checklist stands."""

DeliveryState: TypeAlias = Annotated[Literal["waiting", "delivered", "failed", "superseded"], Open]
"""How far the telling has come."""

ErrorKind: TypeAlias = Annotated[Literal["depth", "water_level", "roll_offset", "sound_speed"], Open]
"""What may be wrong."""

Failsafe: TypeAlias = Annotated[Literal["leak", "critical_energy", "too_deep", "position_lost", "no_position", "low_energy", "link_lost", "traffic", "geofence_left", "separation_lost", "vehicle_error", "other_console", "all_links_lost", "service_restarted"], Open]
"""What may go wrong with a vehicle, or with all of them."""

FileOption: TypeAlias = Annotated[Literal["order", "interval_m", "crs", "vehicle", "lang"], Open]
"""What may be asked of a file, by the name of REST's parameter."""

Fit: TypeAlias = Annotated[Literal["data", "from_zero", "about_zero"], Open]
"""How a range of colours follows the values: from the least, from zero, or as far below zero as above."""

FurtherLayer: TypeAlias = Annotated[Literal["density", "slope", "tvu_fraction", "difference", "tvu", "thu", "shoal_pct"], Open]
"""A layer that the tiles hold on request."""

Guidance: TypeAlias = Annotated[Literal["follow", "legs", "acoustic"], Open]
"""How a vehicle of kind ``imc`` is led."""

Homecoming: TypeAlias = Annotated[Literal["return", "stop"], Open]
"""What becomes of a vehicle that goes on no further."""

Known: TypeAlias = Annotated[Literal["determined", "undetermined", "unsettled", "beside"], Open]
"""What lines tell of a parameter."""

Language: TypeAlias = Annotated[Literal["en", "pt"], Open]
"""A language that reports are written in."""

LayerName: TypeAlias = Annotated[Literal["uncertainty", "count", "sounded", "density", "slope", "tvu_fraction", "difference", "tvu", "thu", "shoal_pct", "live"], Open]
"""A layer of the map beside those that its JSON always has."""

Level: TypeAlias = Annotated[Literal["info", "warning", "alarm"], Open]
"""How much an event matters."""

LinkState: TypeAlias = Annotated[Literal["unknown", "lost", "expected_offline", "heard", "ready", "engaged"], Open]
"""How well a vehicle can be reached, worst to best."""

LogState: TypeAlias = Annotated[Literal["waiting", "reading", "done", "failed", "taken-back"], Open]
"""How far the import of a log is."""

MissionKind: TypeAlias = Annotated[Literal["survey", "search"], Open]
"""What a mission is for."""

MissionState: TypeAlias = Annotated[Literal["draft", "ready", "running", "paused", "finished", "aborted", "failed"], Open]
"""Where a mission is in its life."""

MountingParameter: TypeAlias = Annotated[Literal["roll_deg", "pitch_deg", "heading_deg", "latency_s"], Open]
"""What overlapping lines may tell, by its name in a mounting."""

NodeState: TypeAlias = Annotated[Literal["heard", "announced", "active", "ready", "in_plan", "lost", "expected_offline"], Open]
"""How far the acquaintance with a node has come."""

Notice: TypeAlias = Annotated[Literal["raised", "escalated", "acknowledged", "ended"], Open]
"""Why somebody is told of an alarm."""

Order: TypeAlias = Annotated[Literal["exclusive", "special", "1a", "1b", "2"], Open]
"""An order of survey."""

OrderKind: TypeAlias = Annotated[Literal["go", "skip-line", "repeat-line", "denser"], Open]
"""What a vehicle that surveys can be ordered to do."""

OrderState: TypeAlias = Annotated[Literal["accepted", "flying", "done", "replaced", "cancelled", "failed"], Open]
"""How far an order has come."""

OverlayLayer: TypeAlias = Annotated[Literal["depth", "uncertainty", "count", "density", "slope", "tvu_fraction", "difference", "tvu", "thu", "shoal_pct", "live"], Open]
"""A layer that can be seen as a picture."""

Palette: TypeAlias = Annotated[Literal["deep", "violet", "matter", "balance", "landmarks", "classes"], Open]
"""Colours of the dashboard's map."""

Phase: TypeAlias = Annotated[Literal["transit", "survey", "surfacing", "returning", "home", "stopped"], Open]
"""What a vehicle is at."""

PositionQuality: TypeAlias = Annotated[Literal["untold", "stated", "good", "fading", "poor"], Open]
"""How well a vehicle knows where it is."""

Response: TypeAlias = Annotated[Literal["warn", "hold", "return", "surface", "stop"], Open]
"""What is done, least to most: what is farther down is not undone by what is farther up."""

Role: TypeAlias = Annotated[Literal["viewer", "vehicle", "operator", "admin"], Open]
"""What the holder of a token may do."""

Ruling: TypeAlias = Annotated[Literal["restored", "rejected"], Open]
"""What an operator said of a sounding."""

Sensor: TypeAlias = Annotated[Literal["single_beam", "dvl", "multibeam"], Open]
"""How a vehicle sounds the bottom."""

Severity: TypeAlias = Annotated[Literal["ok", "note", "problem"], Open]
"""How much a finding matters."""

SoundingState: TypeAlias = Annotated[Literal["used", "restored", "rejected", "doubted", "withdrawn"], Open]
"""Whether a sounding is in the map, and who decided that."""

TargetState: TypeAlias = Annotated[Literal["unheard", "searching", "uncertain", "accurate"], Open]
"""How far the search for a target has come."""

VehicleKind: TypeAlias = Annotated[Literal["imc", "rest", "sim", "neptus"], Open]
"""Which link reaches a vehicle."""

Verdict: TypeAlias = Annotated[Literal["accepted", "rejected", "duplicate"], Open]
"""What happened to one measurement."""

WaypointStatus: TypeAlias = Annotated[Literal["planned", "sent", "acknowledged", "reached", "refused", "missed"], Open]
"""The life of one waypoint. A vehicle's route is drawn from ``ACKNOWLEDGED`` on, not before."""


class ActionRequest(Model):
    """What an operator adds to an action."""

    note: str = ""
    """Kept in the mission's log beside the action"""


class ActionView(Model):
    """What an action led to, with each vehicle's answer where vehicles were stopped."""

    mission: MissionSummary
    stops: list[StopView]


class AdjustmentRequest(Model):
    """What is known beside the soundings; all of it may be left out."""

    fixes: list[FixRequest] | None = None
    """GPS fixes. Jumps of a vehicle's positions at the surface are taken for fixes without being named"""
    walk_m: float = 3.0
    """Deviation of the random walk of positions after an hour"""
    rate_mph: float = 15.0
    """Deviation of the slowly changing rate of their drift, metres an hour"""


class AdjustmentView(Model):
    """By how much positions of vehicles were changed for their drift; their raw positions stay."""

    applied: bool
    made_at: datetime | None
    """Null: nothing is applied"""
    actor: str | None
    by_ties: bool
    """Whether ties were used; else fixes alone"""
    fixes: int
    tracks: list[TrackOffsetView]
    ties_used: int
    ties_rejected: int
    before_m: float | None
    """RMS of depths less others' over all ties, unadjusted"""
    after_m: float | None
    """The same, adjusted"""
    held_out: HeldOutView | None
    """Null: too little overlaps"""
    ties: TieFeaturesView


class AgreementView(Model):
    """Differences of depths that should be the same, metres."""

    count: int
    mean_m: float
    median_m: float
    sd_m: float | None
    """Standard deviation of a sample; null: there is one difference"""
    rms_m: float
    p95_m: float
    """95 % quantile of the absolute differences"""
    max_m: float
    """Largest absolute difference"""
    within_pct: float
    """Share that is not larger than the order's largest TVU"""


class AlarmMessage(Model):
    """An alarm was raised or acknowledged; by its id the page knows whether it has it already."""

    type: Literal["alarm"]
    alarm: AlarmView


class AlarmReport(Model):
    """An alarm with everything that was told of it."""

    id: str
    mission_id: str | None
    """null: it concerns no mission"""
    kind: AlarmKind
    severity: AlarmSeverity
    vehicle: str | None
    message: str
    raised_at: datetime
    ended_at: datetime | None
    """When what raised it was over; it stays open until acknowledged. null: it goes on, or cannot end"""
    state: AlarmState
    acknowledged_at: datetime | None
    acknowledged_by: str | None
    """The name of the token, or of the user, that acknowledged it"""
    deliveries: list[DeliveryView]
    action: str
    """What whoever is on watch does about it."""


class AlarmTrial(Model):
    """Whom to try to reach."""

    severity: AlarmSeverity = "minor"
    """As grave as this: routes go by it"""
    to: str | None = None
    """Only this recipient of the settings; null: whom the routes say"""


class AlarmView(Model):
    """An alarm: who has it, or that nobody has."""

    id: str
    mission_id: str | None
    """null: it concerns no mission"""
    kind: AlarmKind
    severity: AlarmSeverity
    vehicle: str | None
    message: str
    raised_at: datetime
    ended_at: datetime | None
    """When what raised it was over; it stays open until acknowledged. null: it goes on, or cannot end"""
    state: AlarmState
    acknowledged_at: datetime | None
    acknowledged_by: str | None
    """The name of the token, or of the user, that acknowledged it"""
    action: str
    """What whoever is on watch does about it."""


class AllowedView(Model):
    """What an order of IHO S-44 allows at the depth, 95 %."""

    order: Order
    tvu_m: float
    thu_m: float


class AngleAgreementView(Model):
    """Beams of crosslines minus the grid of the main lines, for one bin of beam angles."""

    from_deg: float
    """From straight down in the vehicle, positive to starboard"""
    to_deg: float
    count: int
    mean_m: float
    sd_m: float | None
    within_pct: float


class ApproachView(Model):
    """The closest point of approach of a ship and the vehicle that it comes closest to."""

    mission_id: str
    vehicle: str
    distance_m: float
    """Between the ship's hull, as far as it is known, and the vehicle"""
    in_s: float
    """From now; 0: it is farther every moment"""
    alarm: bool
    """Closer than ais.cpa_m within ais.cpa_s"""


class AuditEntry(Model):
    """A command and what came of it."""

    id: int
    time: datetime
    actor: str
    """The token's name; empty where nobody was recognized"""
    role: str
    origin: str
    """The address that it came from, or `command line`"""
    action: str
    """The operation's name in this document, or a command's"""
    target: str
    """The path, or what the command was given"""
    mission_id: str | None
    result: str
    """done, refused or failed"""
    status: int | None
    """The HTTP status of the answer"""
    detail: str
    """Why it was refused"""
    request_id: str


class BatchVerdict(Model):
    """The verdicts on a batch, in its order. Whatever is counted accepted is stored for good."""

    accepted: int
    rejected: int
    duplicate: int
    items: list[ItemVerdict]
    replayed: bool
    """True: this idempotency key was seen before, this is the first answer"""


class BeamEditView(Model):
    """What an operator once said of some beams."""

    id: int
    ruling: Ruling
    beams: int
    """How many these are"""
    vehicles: list[str]
    """Whose they are"""
    selection: BeamSelection | None
    """What was asked for; null: each beam was named"""
    made_at: datetime
    actor: str
    note: str


class BeamEditsView(Model):
    """All that operators said of a mission's beams, oldest first: of each beam the last word counts."""

    rejected: int
    """Beams that do not count"""
    restored: int
    """Beams that count whatever their neighbours are like"""
    edits: list[BeamEditView]


class BeamPoints(Model):
    """Beams as points, column by column, in the order in which vehicles and their pings came."""

    total: int
    """Beams of the selection that met the bottom; where `every` is 1 all are here"""
    every: int
    """Pings of which one was taken: 1, 2, 4, …"""
    lon_deg: list[float]
    lat_deg: list[float]
    depth_m: list[float]
    """Below the datum, as corrected now"""
    state: list[int]
    """Places in `states`"""
    ping: list[int]
    """Places in `time_s` and `vehicle`"""
    beam: list[int]
    """Place in the ping, the first of which is 0"""
    time_s: list[float]
    """Of each ping, by the vehicle's clock, Unix seconds"""
    vehicle: list[int]
    """Of each ping, places in `vehicles`"""
    states: list[SoundingState]
    vehicles: list[str]


class BeamPointsRequest(Model):
    """Which beams are asked for as points."""

    area: PolygonGeometry | None = None
    """They met the bottom in here"""
    vehicle: str | None = None
    """They are of this vehicle"""
    from_s: float | None = None
    """Not before this time of the vehicle's clock, Unix seconds"""
    until_s: float | None = None
    """Not after this time of the vehicle's clock, Unix seconds"""
    least_depth_m: float | None = None
    """Not shoaler than this, metres below the datum, as corrected now"""
    most_depth_m: float | None = None
    """Not deeper than this, metres below the datum, as corrected now"""
    least_angle_deg: float | None = None
    """Outer beams: at least so far to either side from straight down in the vehicle, degrees"""
    limit: int = 50000
    """Most points in the answer. Of more beams those of every second ping, or fourth, and so on come; where one ping
    has more, some of its beams
    """


class BeamRulingRequest(Model):
    """Which beams an operator decides about, by what they have in common or one by one."""

    selection: BeamSelection | None = None
    """By what they have in common"""
    pings: list[NamedBeams] | None = None
    """One by one"""
    note: str = ""
    """Why; kept in the log"""


class BeamSelection(Model):
    """Which beams of a mission's swath sonars are meant: those that fulfil all that is stated."""

    area: PolygonGeometry | None = None
    """They met the bottom in here"""
    vehicle: str | None = None
    """They are of this vehicle"""
    from_s: float | None = None
    """Not before this time of the vehicle's clock, Unix seconds"""
    until_s: float | None = None
    """Not after this time of the vehicle's clock, Unix seconds"""
    least_depth_m: float | None = None
    """Not shoaler than this, metres below the datum, as corrected now"""
    most_depth_m: float | None = None
    """Not deeper than this, metres below the datum, as corrected now"""
    least_angle_deg: float | None = None
    """Outer beams: at least so far to either side from straight down in the vehicle, degrees"""


class Block(Model):
    """The blocks of P of one mixing signal; both symmetric, with eigenvalues between e1 and e2."""

    horizontal: list[list[float]]
    """7 x 7, in the order of state.vectors"""
    vertical: list[list[float]]
    """4 x 4, in the order of state.figures"""


class Budget(Model):
    """How long a mission is; exactly one of these."""

    minutes: float | None = None
    """Minutes in which each vehicle surveys, by its own clock: turns and waiting for others count, the way there and
    home and fixes at the surface do not
    """
    km_per_vehicle: float | None = None
    """Kilometres of legs that each vehicle flies, however long its turns are"""
    steps: int | None = None
    """Legs that each vehicle flies"""


class Cast(Model):
    """One of a mission's sound speed casts."""

    profile: list[tuple[float, float]]
    """Measured speeds as [depth in m, speed in m/s], from top to bottom; one pair: the same everywhere"""
    source: str = ""
    """Where the profile comes from, kept with the product"""
    time: datetime | None = None
    """When the cast was taken, UTC where no offset is given; null: not known, which only one that is alone may be"""
    position: tuple[float, float] | None = None
    """Where, [longitude, latitude]; null: not known, which the rule nearest_in_distance_within_time does not allow
    for several casts
    """
    name: str = ""
    """Its name among the mission's casts, without '/'; default: made of the source"""


class CastChangeView(Model):
    """By how much a depth differs between two casts that follow each other in time."""

    before: str
    after: str
    difference_m: float
    """Of the depth of the outer beam, from the one profile to the other"""
    is_large: bool
    """Whether that is more than `limit_m` of the list"""


class CastDescription(Model):
    """One sound speed cast: the speeds that were measured on a way through the water, when and where."""

    profile: list[tuple[float, float]]
    """Measured speeds as [depth in m, speed in m/s], from top to bottom; one pair: the same everywhere"""
    source: str = ""
    """Where the profile comes from, kept with the product"""
    time: datetime | None = None
    """When the cast was taken, UTC where no offset is given; null: not known, which only one that is alone may be"""
    position: tuple[float, float] | None = None
    """Where, [longitude, latitude]; null: not known, which the rule nearest_in_distance_within_time does not allow
    for several casts
    """


class CastRules(Model):
    """Which of several casts corrects a ping."""

    rule: CastRule = "nearest_in_time"
    """Which of several casts corrects a ping: the one nearest in time, or, of those within within_h, the one nearest
    to the vehicle (to the sounding, for single beams); where none is within that, the nearest in time
    """
    within_h: float = 4.0
    """With rule nearest_in_distance_within_time: how far a cast may be away in time, hours"""


class CastView(Model):
    """A sound speed cast, and what it corrects."""

    name: str
    source: str
    time: datetime | None
    position: tuple[float, float] | None
    profile: list[tuple[float, float]]
    soundings: int
    """Accepted soundings of single beams that it corrects"""
    pings: int
    """Accepted pings of swath sonars that it corrects"""
    first: datetime | None
    """Time of the first of them; null: it corrects none"""
    last: datetime | None
    """Time of the last of them"""
    farthest_h: float | None
    """How far one of them is away from it in time at most, hours"""


class CastsView(Model):
    """A mission's sound speed casts in the order of their times, and how well they fit what was sounded."""

    assumed_mps: float
    """Speed that is set in the sonars"""
    rule: CastRule
    within_h: float
    casts: list[CastView]
    far_h: float
    """Soundings farther away in time from their cast than this are counted, hours"""
    far_soundings: int
    """Soundings of single beams that are farther away"""
    far_pings: int
    """Pings of swath sonars that are farther away"""
    order: Order
    """Order of IHO S-44 that differences between casts are compared with"""
    angle_deg: float
    """Of the outer beam that they are compared for, from straight down"""
    sonar_m: float | None
    """Depth that it is sent from"""
    depth_m: float | None
    """The map's deepest cell, where it meets the bottom; null: no map yet"""
    limit_m: float | None
    """Half the order's largest TVU at that depth"""
    changes: list[CastChangeView]
    """From each cast to the next; empty: there is no map yet"""


class ChangesView(Model):
    """What changed at a site between two of its surveys, over the ground that both know."""

    site_id: str
    earlier: SurveyName
    later: SurveyName
    confidence: float
    """A share of so much of unchanged ground is not called changed"""
    compared_m2: float
    significant_pct: float
    """Of the compared cells, those that changed significantly"""
    expected_pct: float
    """What chance makes of unchanged ground where deviations are right"""
    deeper_pct: float
    """Of the compared cells, those that are significantly deeper now"""
    shoaler_pct: float
    lost: VolumeView
    """Volume that is gone where it is significantly deeper"""
    gained: VolumeView
    """Volume that was added where it is significantly shoaler"""
    net: VolumeView
    """Gained less lost, over all compared cells, significant or not"""
    mean_m: float | None
    """Later depth less earlier depth: positive where it is deeper now"""
    rms_m: float | None
    median_sd_m: float | None
    """Standard deviation of a difference"""
    least_m: float | None
    largest_m: float | None
    last_colour_m: float
    """Difference of the last colour of changes.png, deeper now; that of the first is its negative"""
    corners: list[tuple[float, float]]
    """Of changes.png, as those of a map"""
    vertical_datum: str
    notes: list[str]
    """What has to be known to read it, in words"""


class CheckView(Model):
    """One line of the checklist before a start."""

    id: str
    title: str
    status: CheckStatus
    message: str
    remedy: str
    """What to do about it; empty when all is well"""


class ComponentHealth(Model):
    """Whether the service can do its work."""

    status: str
    """ok, or failing when a component is not ok"""
    version: str
    """Version of bathyfleet"""
    components: dict[str, str]
    """Each component: ok, or what is wrong with it"""
    compiling: bool
    """Whether what decisions and maps are computed with is still being compiled, as after the first start on a
    machine: decisions are slow until then
    """


class ComponentView(Model):
    """A source of error."""

    name: str
    """Of its field in the mission's `uncertainty`; tide: `tide.sd_m`"""
    title: str
    unit: str
    sd: float
    """Its standard deviation, in its unit"""
    shares: list[ShareView]


class ConformityView(Model):
    """How the estimates of TVU and THU stand beside one order of IHO S-44; no order is claimed by it."""

    order: Order
    cells_pct: float
    """Share of the cells whose TVU estimate stays within the order's largest"""
    sounded_pct: float | None
    """The same among the sounded cells; null: none is"""
    horizontal_pct: float | None
    """Share of the cells whose THU estimate stays within the order's largest, of those that have one; null: none has"""
    statement: str


class CorrectionsView(Model):
    """How soundings are corrected; their raw values stay beside the corrected ones."""

    tide: Tide
    tide_table: TideTableView | None
    """Its levels count in place of tide.level_m"""
    sound_speed: SoundSpeed | None
    systematic_errors: SystematicErrors
    mountings: list[MountingView]
    """How sonars are mounted, a line for each vehicle"""
    rejected_beams: int
    """Beams of swath sonars that operators took out"""
    restored_beams: int
    """Beams that count because operators say so, whatever their neighbours"""
    vertical_datum: str
    """What corrected depths are counted from"""
    accepted: int
    """Soundings accepted under these corrections"""
    rejected: int


class CoverageSpec(Model):
    """How full coverage by swath sonars is to be, where the planner is `swath`, and lines across all others."""

    overlap_pct: float = 6.0
    """Share of half a swath that the next one sounds again, at least; more where position is uncertain"""
    crosslines_pct: float = 5.0
    """Length of lines across all others, flown last, as a share of those; by what both measured where they cross a
    survey is judged. Also where planner `lawnmower` is given the distance of lines. 0: none
    """
    cell_of_depth: float | None = None
    """Cells by depth, in files with cells of several sizes: each depth has the smallest of cell_m, twice and four
    times as much, and so on, that is at least this share of it, for example 0.05. null: one size
    """


class CrossingFeatureView(Model):
    """A crossing as GeoJSON."""

    type: Literal["Feature"]
    properties: CrossingView
    geometry: PointView


class CrossingFeaturesView(Model):
    """Crossings as GeoJSON, worst first."""

    type: Literal["FeatureCollection"]
    features: list[CrossingFeatureView]


class CrossingView(Model):
    """A place where two lines cross."""

    number: int
    """1 is the worst beside what the order allows"""
    vehicles: tuple[str, str]
    lines: tuple[int, int]
    times_s: tuple[float, float]
    """The vehicles' clocks, Unix seconds"""
    depths_m: tuple[float, float]
    difference_m: float
    """First minus second"""
    predicted_sd_m: float
    """As the soundings' standard deviations predict it"""
    angle_deg: float
    """Between the lines, 0 to 90"""
    within: bool
    """Whether it is not larger than the order's largest TVU"""
    outlier: bool
    """Whether it is larger than that, or than three robust standard deviations"""
    lat_deg: float
    """Latitude, WGS84 degrees"""
    lon_deg: float
    """Longitude, WGS84 degrees"""


class CrossoversView(Model):
    """How well a survey agrees with itself where its lines cross."""

    version: int
    """Of the map that was newest when this was computed"""
    order: Order
    lines: int
    length_km: float
    """Of all lines"""
    crosslines: int
    """Lines across the dominant direction that cross others, flown as such or not"""
    crosslines_km: float
    crosslines_pct: float
    """Share of the length of all lines"""
    statistics: AgreementView | None
    """Of all crossings; null: there is none"""
    at_crosslines: AgreementView | None
    """Of those where a crossline crosses a main line"""
    normalised_rms: float | None
    """RMS of the differences over what the soundings' standard deviations predict: 1 is as predicted; null: there is
    no crossing
    """
    by_vehicles: list[VehiclesAgreementView]
    by_line: list[LineAgreementView]
    """Lines that cross others, largest RMS first"""
    lines_left_off: int
    """Lines that `by_line` has no place for"""
    beams: AngleAgreementView | None
    """Crosslines' beams of all angles minus the grid of the main lines; null: swath sonars have none"""
    by_angle: list[AngleAgreementView]
    """The same for each bin of beam angles"""
    histogram: HistogramView
    outliers: int
    """Crossings beyond the order's largest TVU, or far from the others"""
    left_off: int
    """Crossings that `features` has no place for; `crossovers.csv` has all"""
    features: CrossingFeaturesView


class CurrentView(Model):
    """The current: what the mission's vehicles last told of it, on average."""

    speed_mps: float
    toward_deg: float
    """Where the water goes, degrees from true north"""


class DeliveryView(Model):
    """What one recipient is told, and what came of it."""

    id: str
    """What the recipient sees as the message's id; the same at every attempt"""
    recipient: str
    """The recipient's name in the settings"""
    notice: Notice
    state: DeliveryState
    attempts: int
    created_at: datetime
    next_try_at: datetime | None
    """null: it is not tried again"""
    done_at: datetime | None
    error: str
    """Why the last attempt failed; empty when none did"""


class DenserOrder(Model):
    """A part of the area to be surveyed on closer lines."""

    area: PolygonGeometry
    line_spacing_m: float | None = None
    """Distance between lines, metres; null: half of the survey's own"""
    vehicle: str | None = None
    """Who flies it; null: who has the shortest way"""


class DifferenceView(Model):
    """Map minus reference grid over the cells that both know."""

    rmse_m: float
    l2_norm: float
    """Euclidean norm of all differences; grows with the number of cells"""
    bias_m: float
    p95_m: float
    """95th percentile of the absolute difference"""
    max_m: float
    cells: int


class DoctorView(Model):
    """What keeps vehicles on the IMC network from working with this service."""

    healthy: bool
    """At least one vehicle is there, and nothing stands in any one's way"""
    seconds: float
    """For how long was listened"""
    causes: list[Cause]
    own: list[Finding]
    """On this machine's side"""
    vehicles: list[VehicleDiagnosis]
    traffic: list[TrafficFinding]
    """Of AIS; empty where it is not set up"""


class DrawingView(Model):
    """The lines and areas of a file, in its order."""

    lines: list[DrawnLineView]
    areas: list[DrawnAreaView]
    around: PolygonGeometry | None
    """The smallest convex area around the lines with a margin, for a mission's `area` where no other is given; null:
    there are no lines, or they lie far apart
    """
    notes: list[str]
    """What was assumed or left out, in words"""


class DrawnAreaView(Model):
    """An area of a file: a polygon, or a line that ends where it began."""

    name: str
    area: PolygonGeometry
    """For a mission's `area` or its `keep_out`"""
    area_m2: float


class DrawnLineView(Model):
    """A line of a file; with name and coordinates it is one of a mission's `survey_lines`."""

    name: str
    """What the file calls it, else its number; no other line is called so"""
    coordinates: list[tuple[float, float]]
    """[longitude, latitude], WGS 84"""
    length_m: float


class EllipseView(Model):
    """Where the target is with 95 % probability, in the plane."""

    semi_major_m: float
    semi_minor_m: float
    orientation_deg: float
    """Of the longer axis, clockwise from north, 0 to 180"""


class EndRequest(Model):
    """What an operator adds when a mission is ended."""

    note: str = ""
    """Kept in the mission's log beside the action"""
    return_: bool | None = Field(None, alias="return")
    """true: vehicles go home to their recovery points, and the mission ends when they are there; false: they stop
    where they are. null: as recovery.on_finish says, and never with abort
    """


class EventMessage(Model):
    """A new line of the log."""

    type: Literal["event"]
    event: EventView


class EventView(Model):
    """One line of a mission's log."""

    id: int
    mission_id: str
    time: datetime
    level: Level
    kind: str
    """Machine-readable kind, for example step, state, vehicle, sounding, safety"""
    message: str
    data: dict[str, Any]


class FailsafeView(Model):
    """A failsafe in force for a vehicle."""

    failsafe: Failsafe
    response: Response
    message: str


class FieldProblem(Model):
    """What is wrong with one value of a request."""

    location: str
    """Where the value was: body, query, path or header"""
    field: str
    """Path of the field, for example limits.max_step_m or vehicles.0.name"""
    value: Any
    """What was sent, shortened when long; null when it was missing"""
    message: str
    """What is wrong with it"""
    expected: str
    """What would be right"""


class Finding(Model):
    """One observation, and what to do about it."""

    severity: Severity
    cause: Cause
    """For programs; the texts may change"""
    text: str
    remedy: str


class FixRequest(Model):
    """A position of a vehicle at the surface that is known better than the one it had reckoned."""

    vehicle: str
    time_s: float
    """The vehicle's clock, Unix seconds"""
    lat_deg: float
    """Latitude, WGS84 degrees"""
    lon_deg: float
    """Longitude, WGS84 degrees"""
    sd_m: float = 1.0
    """Standard deviation east and north, each"""
    resets: bool = True
    """Whether the vehicle reckoned on from the fix"""


class ForecastRange(Model):
    """From where to where a figure went, over floors of different roughness: 10 % were below, 10 % above."""

    low: float
    high: float


class ForecastView(Model):
    """What is to be expected of a mission: a forecast from a simulation, not a promise."""

    duration_s: float
    """Seconds of the vehicles' time until the last step is done; median"""
    duration_s_range: ForecastRange
    vehicles: list[VehicleForecast]
    coverage_pct: float
    """Share of the area's cells that will be known to `accuracy_m`, with swath sonars that will be ensonified;
    median over the floors
    """
    coverage_pct_range: ForecastRange
    remaining_pct: float
    """Share of the landmarks that will not be; median over the floors"""
    remaining_pct_range: ForecastRange
    mean_sd_m: float | None
    """Mean deviation of the map; median; null: nothing was sounded"""
    mean_sd_m_range: ForecastRange | None
    steps: int
    """Steps that are still to be flown"""
    steps_simulated: int
    """Of these were simulated in the time allowed; `coverage_pct` and what follows is after as many"""
    whole_survey: WholeSurveyView | None
    """What it takes until nothing is left to ensonify, whatever the budget; null: no survey with swath sonars"""
    steps_flown: int
    """The same as `steps_simulated`"""
    floors: int
    """Over how many floors of different roughness it was flown"""
    assumptions: list[str]
    """What was taken to be so, in words"""


class GoOrder(Model):
    """Where a vehicle is to go now."""

    position: tuple[float, float]
    """[longitude, latitude], inside the area, in no keep-out zone"""


class HeldOutView(Model):
    """How well sections fit that were left out: RMS of their depths less the others'."""

    sections: int
    before_m: float
    """Unadjusted"""
    by_fixes_m: float
    """Adjusted by fixes alone"""
    after_m: float
    """Adjusted by fixes and the other ties"""
    significance: float
    """How much better they fit than by fixes alone, in standard errors"""


class HistogramView(Model):
    """Counts of differences; the outer bins hold those beyond the ends, too."""

    edges_m: list[float]
    """One more than there are counts"""
    counts: list[int]


class ImportView(Model):
    """Soundings from elsewhere that a mission began with. They are not among its own."""

    id: str
    filename: str
    source: str
    site: str | None
    """The site whose depths these are; null: they came as a file"""
    sha256: str
    """Of the file"""
    created_at: datetime
    found: int
    """Depths in the file"""
    taken: int
    """Those in or near the area, as they count in the map"""
    min_depth_m: float
    max_depth_m: float
    median_sd_m: float
    notes: list[str]
    """What was assumed or done, in words"""
    replayed: bool
    """True: the same file was imported before, nothing changed"""


class InstrumentErrors(Model):
    """How one vehicle's sonar is wrong."""

    depth_m: float = 0.0
    """By how much its depths are too large, metres"""
    roll_offset_deg: float = 0.0
    """How far the beams of its swath sonar point to starboard of where they are said to, degrees: the roll of a
    patch test
    """
    sound_speed_mps: float = 0.0
    """How much faster sound is at its swath sonar than it assumes when it steers its beams, m/s: bent swaths"""


class ItemVerdict(Model):
    """The verdict on one item of a batch."""

    index: int
    verdict: Verdict
    reason: str


class LayerView(Model):
    """A layer of the map: what its values say and how it is shown."""

    name: str
    title: str
    meaning: str
    """What its values say, compared with Order 1a where with one of IHO S-44"""
    unit: str
    """By its name in UDUNITS; 1: a number"""
    palette: Palette
    fit: Fit
    range: tuple[float, float] | None
    """Values of the first and the last colour; null: they follow the data as `fit` says"""
    classes: list[str]
    """Words for the values 0, 1, 2 and so on, where there are no others; else empty"""
    scale: int | None
    """Tiles hold whole numbers, the value times this; null: no tile has it"""
    in_every_tile: bool
    """Tiles have it without being asked for it by `layer`"""
    in_json: bool
    """The map's JSON has it when asked for it by `layer`"""
    in_pictures: bool
    """It can be seen as `map.overlay.png`"""
    in_files: bool
    """Files with every layer have it"""
    of_depths: bool
    """Its values are as sure as the depths: guessed where those are"""
    absence: str
    """Why a mission may have no such layer; empty: each has it"""
    remedy: str


class Limits(Model):
    """What no waypoint may break. Checked before anything is sent to a vehicle."""

    max_step_m: float = 10.0
    """Largest distance a vehicle moves in one step"""
    min_depth_m: float = 2.0
    """Shallowest depth of travel under water"""
    max_depth_m: float = 30.0
    """Deepest depth of travel"""
    min_altitude_m: float = 1.0
    """Least clearance above the sea floor"""
    keep_out_margin_m: float = 10.0
    """Legs stay this far from keep-out zones: vehicles turn in circles and drift. With less than 10 m the circle in
    which one waits for its next waypoint can reach into a zone
    """
    border_margin_m: float = 0.0
    """Waypoints stay this far inside the area: vehicles turn in circles at them and drift"""
    com_range_m: float | None = None
    """Every vehicle keeps another one within this range; null: unlimited"""
    min_separation_m: float = 5.0
    """Least horizontal distance between vehicles at similar depth"""
    min_vertical_separation_m: float = 1.0
    """Difference in depth that makes horizontal separation unnecessary"""


class LineAgreementView(Model):
    """Differences of a line to all that cross it: its depths minus theirs."""

    count: int
    mean_m: float
    median_m: float
    sd_m: float | None
    """Standard deviation of a sample; null: there is one difference"""
    rms_m: float
    p95_m: float
    """95 % quantile of the absolute differences"""
    max_m: float
    """Largest absolute difference"""
    within_pct: float
    """Share that is not larger than the order's largest TVU"""
    vehicle: str
    line: int
    """Among the vehicle's lines, from 1"""
    crossline: bool
    start_s: float
    """The vehicle's clock at its begin, Unix seconds"""
    length_m: float
    heading_deg: float


class LinkRecord(Model):
    """One change of a vehicle's link."""

    at: datetime
    state: NodeState
    engaged: bool
    """Whether the vehicle followed us"""
    reason: str


class Liveness(Model):
    """The process answers."""

    status: str = "ok"


class LogImportView(Model):
    """What came of a vehicle's log."""

    file: str
    vehicle: str
    soundings: int
    """Accepted, stored for good"""
    rejected: int
    """Kept but not used"""
    duplicate: int
    """There before, from live telemetry or another log"""
    pings: int
    """Pings of swath sonars that were accepted, stored for good"""
    pings_rejected: int
    """Pings that are kept but not used"""
    pings_duplicate: int
    """Pings that were there before"""
    reasons: dict[str, int]
    """Why soundings and pings were rejected, and how many each"""
    refused: dict[str, int]
    """Why ranges did not become soundings, and how many each"""
    first_s: float | None
    """Vehicle's clock at the first record, Unix seconds"""
    last_s: float | None
    """Vehicle's clock at the last record, Unix seconds"""
    packets: int
    unreadable: dict[str, int]
    """Packets that could not be read, by reason"""
    skipped_bytes: int
    """Bytes that are no packet"""
    cut_off: bool
    """The file ends in the middle, as after a power loss; what came before is used"""
    notes: list[str]
    """What was assumed or done, in words"""
    casts: list[MeasuredCastView]
    """Sound speed casts that the vehicle measured; none counts before it is added"""
    known: bool
    """The whole log had been imported before; nothing was written"""


class LogView(Model):
    """A vehicle's own log: what came of it, or how far its import is."""

    id: str
    file: str
    """Its name"""
    vehicle: str | None
    """Whose it is; null: the log has not said so yet"""
    sha256: str
    """Of the file"""
    state: LogState
    created_at: datetime
    """When it was sent; of one from the command line when it had been imported"""
    actor: str
    """Who sent it"""
    read_bytes: int | None
    """How far reading has come; null: it is long over"""
    size_bytes: int | None
    """Of the file; null: it is not known any more"""
    result: LogImportView | None
    """What came of it, when it is done"""
    problem: str
    """Why it failed; what was stored before stays, and is not stored twice"""
    remedy: str
    """What to do about it"""
    taken_back_at: datetime | None
    """When it was; null: it counts, or never did"""
    taken_back_by: str
    """Who took it back"""
    can_be_taken_back: bool
    """Whether DELETE stops its reading or takes it back; false: it is taken back, nothing is stored of it, or an
    earlier version did not note what it brought
    """


class MapMessage(Model):
    """A new map can be fetched: ``GET /missions/{id}/map`` or its picture."""

    type: Literal["map"]
    version: int
    live: int
    """Grows with what was sounded or corrected since: the tiles show it"""
    step: int
    min_depth_m: float | None
    max_depth_m: float | None


class MapView(Model):
    """The map as JSON: row 0 is south, column 0 is west, null outside the area or where unknown."""

    mission_id: str
    version: int
    """Grows with every new map; 0: no sounding yet"""
    step: int
    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int
    corners: list[tuple[float, float]]
    """[longitude, latitude] of the grid's corners: north-west, north-east, south-east, south-west"""
    vertical_datum: str
    """What depths are counted from"""
    min_depth_m: float | None
    max_depth_m: float | None
    model: str
    depth_m: list[list[float | None]]
    sd_m: list[list[float | None]]
    count: list[list[int]]
    sounded: list[list[bool]]
    layers: dict[str, list[list[float | None]]]
    """Further layers that were asked for, by name"""


class MeasuredCastView(Model):
    """A sound speed cast that a vehicle measured on its way; beyond its depths nothing is known."""

    time: datetime
    """The middle of the time in which it was measured, by the vehicle's clock"""
    position: tuple[float, float]
    """The middle of where, [longitude, latitude]"""
    profile: list[tuple[float, float]]
    """[depth in m, speed in m/s] from top to bottom: means and medians of bins of half a metre, or more"""
    sd_mps: float
    """How far single speeds lie from those of their bins, as a standard deviation"""
    samples: int
    """Speeds that it is made of"""
    bins: list[tuple[int, float]]
    """For each entry of the profile [speeds in its bin, how far they lie from their median as a standard deviation
    in m/s]; empty: of a log that was read by an earlier version
    """
    lag_mps: float | None
    """By how much speeds on the way down are larger than on the way up, m/s; from 0.5 on, either way, only the way
    down counts. Null: too little was measured on both
    """


class Measurement(Model):
    """One measurement posted by a vehicle: its position, and a sounding, a ping or a range to a target, if any."""

    vehicle: str
    time_s: float
    """The vehicle's clock, Unix seconds"""
    lat_deg: float
    """Latitude of the vehicle, WGS84 degrees"""
    lon_deg: float
    """Longitude of the vehicle, WGS84 degrees"""
    depth_m: float
    """Depth of the vehicle below the surface, metres"""
    range_m: float | None = None
    """Range from the vehicle to the bottom: vertical, or along the beam where beam_off_nadir_deg is given; null:
    position report only
    """
    beam: int = 0
    beam_off_nadir_deg: float | None = None
    """Angle of the beam from straight down in the vehicle; the footprint is then computed from it and the vehicle's
    attitude
    """
    beam_azimuth_deg: float = 0.0
    """Direction of the beam in the vehicle, from the bow to starboard"""
    roll_deg: float = 0.0
    """Starboard down is positive"""
    pitch_deg: float = 0.0
    """Nose up is positive"""
    range_sd_m: float | None = None
    position_sd_m: float | None = None
    beams: PostedBeams | None = None
    """One ping of a swath sonar, of vehicles with sensor multibeam; it needs heading_deg and comes without range_m"""
    target: str | None = None
    """The moving target that target_range_m was measured to"""
    target_range_m: float | None = None
    """Range from the vehicle to that target, metres"""
    sound_speed_mps: float | None = None
    """Speed of sound in the water about the vehicle, by its probe, m/s: what it measures becomes casts that can be
    added. Ignored where no water has it (below 1350 or above 1650)
    """
    heading_deg: float | None = None
    speed_mps: float | None = None
    battery_pct: float | None = None


class MeasurementBatch(Model):
    """Measurements in the order in which they were made. Each item has its own verdict."""

    items: list[Measurement]


class MissionSpec(Model):
    """A mission as an operator describes it."""

    name: str
    """Shown to people; need not be unique"""
    area: PolygonGeometry
    """The area to map, or the site to search"""
    kind: MissionKind = "survey"
    """survey: map the sea floor; search: look for something in a partly known site, see `search`"""
    keep_out: list[PolygonGeometry] | None = None
    """Zones no vehicle may enter"""
    survey_lines: list[SurveyLine] | None = None
    """Lines of a line plan, which planner `lawnmower` flies in place of lines of its own; what lies outside the area
    or in keep-out zones is not flown. The mission ends when they are flown, or with its budget
    """
    vehicles: list[VehicleSpec] | None = None
    budget: Budget | None = None
    """How long the mission is: minutes, km_per_vehicle or steps"""
    steps: int = 100
    """Steps after which the mission is finished, short for a budget in steps; with another budget as many legs of
    limits.max_step_m as the vehicle with the longest way needs
    """
    cell_m: float = 1.0
    """Cell of the map's grid"""
    limits: Limits | None = None
    planner: PlannerSpec | None = None
    recovery: Recovery | None = None
    """Where vehicles come home to, and when; null: they stop where they are, in a search they come to its entry"""
    failsafes: dict[Failsafe, Response] | None = None
    """What is done when something fails, where it is not what `bathyfleet failsafes` lists"""
    surface_policy: SurfacePolicy | None = None
    """When vehicles come up for a GPS fix; null: never because of their position"""
    coverage: CoverageSpec | None = None
    targets: list[TargetSpec] | None = None
    """Moving targets to keep track of"""
    tracking: Tracking | None = None
    search: SearchSpec | None = None
    """With kind search, and only there: what is sought. Then planner.name is rollout unless given, and steps as many
    as the time window has room for
    """
    speed_mps: float = 1.3
    """Speed asked of vehicles that have none of their own"""
    arrival_radius_m: float = 3.0
    """Horizontal distance at which a waypoint counts as reached. Unless given, at most half of limits.max_step_m"""
    step_deadline_s: float = 60.0
    """Least time that a leg is given, seconds of vehicle time, longer where it is long; after that it counts as
    missed and the vehicle flies its next, or, in steps of the whole team, the step ends without it
    """
    accuracy_m: float = 0.25
    """Standard deviation below which a cell counts as accurately known"""
    shoal_depth_m: float | None = None
    """What is shallower counts as shoal, metres below the datum of the map: its layer shoal_pct is the chance of
    that in each cell. It keeps no vehicle away: limits.min_altitude_m does. null: no such layer
    """
    sounding_noise: float = 0.01
    """Standard deviation of a range as a fraction of it, where the vehicle states none"""
    uncertainty: SoundingErrors | None = None
    """What makes soundings of swath sonars uncertain"""
    tide: Tide | None = None
    sound_speed: SoundSpeed | None = None
    """Sound speed correction by one cast or several; null: the sonars' own ranges are taken"""
    systematic_errors: SystematicErrors | None = None
    """What is always wrong with sonars and water levels"""
    mountings: dict[str, Any] | None = None
    """How sonars are mounted, by vehicle, in place of what their vehicles state: corrected when a patch test was
    evaluated
    """
    site: str | None = None
    """The site that it surveys, which keeps what it finds; null: none"""
    site_prior: bool = True
    """With a site: begin with the depths that its earlier surveys found"""
    after: str | None = None
    """The mission that it follows, for example with the next area: it begins by itself once that one was flown to
    its end and its vehicles are fit to go on; not when that one was ended by a person, aborted or failed. null:
    it begins when it is started
    """
    seed: int = 0
    """Seed of every random decision"""


class MissionSummary(Model):
    """A mission in a list."""

    id: str
    name: str
    state: MissionState
    reason: str
    """Why it is in this state"""
    created_at: datetime
    updated_at: datetime
    ending: MissionState | None
    """What it becomes once all its vehicles are home; null while it goes on"""
    after: str | None
    """The mission that it follows; null: it follows none"""
    progress: Progress
    allowed_actions: list[Action]
    """What may be asked of it in this state: ``POST /missions/{id}/start`` and so on."""


class MissionView(Model):
    """A mission with everything an operator sees of it."""

    id: str
    name: str
    state: MissionState
    reason: str
    """Why it is in this state"""
    created_at: datetime
    updated_at: datetime
    ending: MissionState | None
    """What it becomes once all its vehicles are home; null while it goes on"""
    after: str | None
    """The mission that it follows; null: it follows none"""
    progress: Progress
    spec: MissionSpec
    """A mission as an operator describes it."""
    origin: tuple[float, float]
    """Origin of the local frame, [longitude, latitude]"""
    vehicles: list[VehicleView]
    waypoints: list[WaypointView]
    """The newest waypoint of each vehicle"""
    current: CurrentView | None
    """As its vehicles estimate it, and energy is counted with it; null: none tells of it"""
    targets: list[TargetView]
    """What is known of the moving targets"""
    has_reference: bool
    """Whether the map is compared with a grid, which `GET …/reference` describes"""
    allowed_actions: list[Action]
    """What may be asked of it in this state: ``POST /missions/{id}/start`` and so on."""
    efficiency_pct: float | None
    """Share of all metres flown that led along planned legs; null while nothing was flown."""


class MountingEstimateRequest(Model):
    """How well lines fit each other beside the mounting; all of it may be left out."""

    position_sd_m: float = 0.3
    """How far a line may lie aside of another one as a whole, standard deviation east and north, metres"""
    level_sd_m: float = 0.05
    """How far it may lie too deep as a whole, as from the water level, standard deviation, metres"""


class MountingEstimateView(Model):
    """What overlapping lines of a vehicle say of how its sonar is mounted. Nothing is changed by it."""

    vehicle: str
    applied: MountingSpec
    """What counts now"""
    parameters: list[ParameterEstimateView]
    proposal: MountingSpec | None
    """What to send to PUT .../mountings/{name}; null: lines agree as well as they do now without it"""
    before_m: float
    """RMS of lines' depths beside the mean of all in the same cell, as they are now"""
    after_m: float
    """With the proposal; where there is none, with all that is determined"""
    significance: float
    """By how many standard deviations its square became smaller"""
    cells: int
    """Cells that at least two lines saw"""
    beams: int
    """Beams that were compared; of many a part is chosen"""
    lines: list[PatchLineView]
    """The lines that were compared, in the order of their times"""


class MountingSpec(Model):
    """How a sonar is mounted in its vehicle, in the vehicle's frame: forward, starboard, down, right-handed."""

    roll_deg: float = 0.0
    """Roll of the sonar in the vehicle, degrees, positive: its starboard side is lower, so that a beam said to point
    straight down points to port
    """
    pitch_deg: float = 0.0
    """Pitch of the sonar in the vehicle, degrees, positive: its bow side is higher, so that a beam said to point
    straight down points ahead
    """
    heading_deg: float = 0.0
    """Heading (yaw) of the sonar in the vehicle, degrees, positive: turned clockwise as seen from above"""
    latency_s: float = 0.0
    """How late positions are, seconds: one that is stated for a time is where the vehicle was so much earlier. Depth
    and attitude are taken as they are
    """
    offset_m: tuple[float, float, float] | None = None
    """[forward, starboard, down] from the point that position and depth are stated for to the sonar, metres"""
    source: str = ""
    """Where these come from, for example a patch test"""


class MountingView(Model):
    """How the sonar of one vehicle is mounted."""

    vehicle: str
    stated: MountingSpec
    """As the vehicle was described when it joined"""
    corrected: MountingSpec | None
    """What counts in place of that; null: what is stated counts"""


class NamedBeams(Model):
    """Some beams of one ping."""

    vehicle: str
    time_s: float
    """Time of the ping by the vehicle's clock, Unix seconds, to the last digit"""
    beams: list[int]
    """Their places in the ping, the first of which is 0"""


class NewCasts(Model):
    """Sound speed casts that are added to those that a mission has."""

    casts: list[Cast]
    """All of them are taken or none; one of a name that there is replaces that cast"""
    assumed_mps: float | None = None
    """Speed that is set in the sonars, m/s, for a mission's first casts; where it has casts it has to be theirs.
    Null: theirs, or 1500
    """


class NoteRequest(Model):
    """What the next watch should know."""

    text: str
    """Kept in the mission's log"""


class OrderView(Model):
    """An order to one vehicle."""

    id: int
    vehicle: str
    kind: OrderKind
    state: OrderState
    way: list[tuple[float, float]]
    """Where it leads along, [longitude, latitude]; empty where a line is left out"""
    asked_by: str
    asked_at: datetime
    changed_at: datetime
    reason: str
    """Why it is over, where it was not carried out"""


class OwnShipView(Model):
    """Where the operation's own ship is, by her GPS or AIS transponder. What she does not tell is null."""

    lat_deg: float
    lon_deg: float
    sog_mps: float | None
    """Speed over ground"""
    cog_deg: float | None
    """Course over ground"""
    heading_deg: float | None
    """True, of a compass"""
    source: str
    """Where that came from"""
    heard_at: datetime
    """When it was heard, UTC"""
    age_s: float
    """Since it was heard"""
    current: bool
    """Heard just now; false: she may be elsewhere"""


class ParameterEstimateView(Model):
    """What overlapping lines tell of one parameter of a mounting."""

    name: MountingParameter
    known: Known
    """determined; undetermined: the lines do not tell it; unsettled: the search for it does not come to rest;
    beside: it would be far from what counts now, where nothing is looked for
    """
    value: float | None
    """Degrees or seconds, in place of what counts now; null: not determined"""
    sd: float | None
    """Its standard deviation"""
    proposed: bool
    """Whether it is among what `proposal` changes"""
    why: str
    """Why it is proposed, or not, or which lines would tell it"""


class PatchLineView(Model):
    """A line that shares ground with others."""

    start_s: float
    """The vehicle's clock, Unix seconds"""
    end_s: float
    heading_deg: float
    """Of the vehicle, clockwise from north"""
    speed_mps: float


class PcaoModel(Model):
    """A controller that ``bathyfleet train`` wrote."""

    P: list[Block]
    """One block per mixing signal"""
    format: Literal["bathyfleet-pcao"] = "bathyfleet-pcao"
    version: Literal[1] = 1
    state: StateDefinition | None = None
    e1: float = 0.01
    e2: float = 10.0
    training: Training | None = None


class PingPartView(Model):
    """Some of a vehicle's pings: a file of them, or those that are in none yet."""

    number: int | None
    """Of the file, for `GET /missions/{mission_id}/pings/{number}`; null: in no file yet"""
    vehicle: str
    first_time_s: float
    """The vehicle's clock at the first ping, Unix seconds"""
    last_time_s: float
    """The vehicle's clock at the last ping, Unix seconds"""
    pings: int
    """Accepted ones"""
    beams: int
    """Their beams that detected something"""
    rejected: int
    """Pings that are kept but not used; the file says why"""
    size_bytes: int | None
    """Of the file"""
    sha256: str | None
    """Of the file"""
    taken_back: bool
    """True: they came by a log that was taken back, and do not count"""


class PingsView(Model):
    """All pings of a mission, in the order in which they came."""

    pings: int
    """Accepted ones of all parts that were not taken back"""
    beams: int
    rejected: int
    parts: list[PingPartView]


class PlanView(Model):
    """The lines that a mission would begin with, and what they take: a plan, not a promise."""

    vehicles: list[PlannedVehicleView]
    distance_m: float
    """Of all vehicles together"""
    duration_s: float
    """Until the last vehicle is at the end of its way, by the vehicles' time"""
    duration_s_range: ForecastRange
    energy_suffices: bool | None
    """Whether every vehicle's energy lasts; null: of one or more it is not known, the others' does"""
    whole: bool
    """Whether this is all; else the ways end where the time for planning was up"""
    whole_survey: WholeSurveyView | None
    """What it takes until nothing is left to ensonify, or all lines that were asked for are flown, whatever the
    budget; null: a survey of neither kind, or not all of it was planned in time
    """
    assumptions: list[str]
    """What was taken to be so, in words"""


class PlannedVehicleView(Model):
    """What one vehicle would do."""

    vehicle: str
    way: list[tuple[float, float]]
    """From where it begins, [longitude, latitude]"""
    way_home: list[tuple[float, float]] | None
    """From the end of that; null: it has no recovery point, or no way leads there"""
    distance_m: float
    """Length of `way`"""
    distance_home_m: float | None
    """Length of `way_home`"""
    duration_s: float
    """Seconds of its time for `way`, turns and fixes by the clock included"""
    duration_s_range: ForecastRange
    """Without turns and fixes, and with every turn flown as a whole circle"""
    home_s: float | None
    """Seconds for `way_home`"""
    energy_needs_s: float
    """How long its energy has to last: for its way, the way home, and a reserve"""
    energy_left_s: float | None
    """How long it lasts for sure; null: not known"""
    turn_back: tuple[float, float] | None
    """Where on its way it has to turn back for want of energy; null: nowhere, or not known"""
    turn_back_m: float | None
    """How far along its way that is"""


class PlannerOptions(Model):
    """Settings of the planners; each reads those that GET /api/v1/planners lists for it."""

    regressors: Literal["map", "polynomial"] = "map"
    """What CAO's estimator is linear in: predictions from the current map, or powers of raw positions."""
    objective: Literal["J", "J+J1", "J+J2", "J+J3", "J+J1+J2", "J+J1+J3", "J+J2+J3", "full", "med13"] = "full"
    """What CAO measures after each step where landmarks are seen: AURO15's objective up to one of its terms, or
    MED13's cost.
    """
    contribution: Literal["team", "vehicle"] = "vehicle"
    """What CAO learns from where landmarks are seen: the team's objective, or for each vehicle the difference that
    its last move made to it.
    """
    degree: int = 1
    """Highest power of a vehicle's position in polynomial regressors."""
    candidates: int = 48
    """Candidates per vehicle that CAO weighs in a step (N)."""
    window: int | None = None
    """Past steps to which CAO fits its estimator (L + T_h); by default 30, with polynomials 15."""
    alpha: float = 1.0
    """First size of random moves, as a fraction of the largest step."""
    alpha_decay: float = 0.6
    """Exponent of the decay of alpha; above 0.5 the squares have a finite sum."""
    alpha_floor: float = 0.2
    """Least alpha, so that random moves never die out."""
    search: int = 4000
    """Changes tried when a survey plan is made anew."""
    turn_radius_m: float = 0.0
    """Radius of the tightest circle that vehicles fly; survey plans pay for turns."""
    cruise_depth_m: float | None = None
    """Depth at which vehicles survey; by default the depth at which each joined."""
    line_spacing_m: float | None = None
    """Distance from line to line. The mission ends when all lines are flown, or with its budget; by default lines
    are as close as the budget allows.
    """
    line_heading_deg: float | None = None
    """Course of the lines, clockwise from true north; by default that of the area's longer side, or what the planner
    finds better.
    """
    keep_line_order: bool = False
    """With survey_lines: fly them in the order in which they are given, though another one is shorter."""
    rollouts: int = 300
    """Changes to the team's plan that a rollout step tries."""
    tries: int = 0
    """Real tries per step of OSARSES (only in simulation)."""
    accuracy_sd_m: float = 0.02
    """Standard deviation below which a landmark counts as accurately estimated."""
    model: PcaoModel | None = None
    """What pcao flies with: the content of a model file that bathyfleet train wrote; without one, the controller
    that ships with bathyfleet.
    """


class PlannerSpec(Model):
    """Which planner decides, and its options."""

    name: str = "cao"
    """One of the planners of GET /api/v1/planners"""
    options: PlannerOptions | None = None
    """Its settings: those that GET /api/v1/planners lists for it"""


class PlannerView(Model):
    """A planner that a mission may name, or one that is installed and cannot be used."""

    name: str
    summary: str
    package: str
    """What brings it, with its version"""
    problem: str
    """Why it cannot be used; empty: it can"""
    options: dict[str, Any]
    """JSON schema of its options"""


class PointView(Model):
    """A GeoJSON point."""

    type: Literal["Point"]
    coordinates: tuple[float, float]


class PolygonGeometry(Model):
    """A GeoJSON polygon: one closed outer ring of [longitude, latitude] positions, no holes. A Feature of one and a
    MultiPolygon of one part are taken as that polygon; heights are left out.
    """

    coordinates: list[list[tuple[float, float]]]
    """One ring of [longitude, latitude]; the last position repeats the first"""
    type: Literal["Polygon"] = "Polygon"


class PostedBeams(Model):
    """What a swath sonar measured with one ping: angle and range of each beam, in the same order."""

    angles_deg: list[float]
    """Across the track, from straight down in the vehicle; positive to starboard"""
    ranges_m: list[float | None]
    """Slant ranges, metres; null, 0 or less: nothing was detected"""


class PreflightView(Model):
    """What stands before a start."""

    ready: bool
    """False while any line is a problem: a start would be refused or fail"""
    checks: list[CheckView]
    questions: list[str]
    """What somebody has to have looked at, from the setting checklist: see `confirmed` of a start"""


class Problem(Model):
    """A problem document (RFC 9457)."""

    type: str
    """Stable name of the kind of problem, a URN"""
    title: str
    """The kind of problem in words"""
    status: int
    """The HTTP status"""
    detail: str
    """What happened here"""
    instance: str
    """The path that was asked, with the request's id after #"""
    remedy: str
    """What to do about it"""
    errors: list[FieldProblem]
    """The fields that are wrong, if any are"""


class ProductView(Model):
    """A file that can be downloaded."""

    name: str
    """Its name for bathyfleet export"""
    title: str
    media_type: str
    href: str
    """Path on this service"""
    needs_map: bool
    """Whether a first map is needed"""
    options: list[FileOption]
    """Which of the parameters of its path make a difference to it"""


class ProfilePointView(Model):
    """A sounding near the line."""

    along_m: float
    across_m: float
    """To starboard of the line; negative: to port"""
    depth_m: float
    sd_m: float


class ProfileView(Model):
    """The map along a line, point by point; null outside the area or where unknown. All lists are equally long."""

    mission_id: str
    name: str
    version: int
    """Of the map"""
    step: int
    vertical_datum: str
    """What depths are counted from"""
    length_m: float
    spacing_m: float
    """Between two points"""
    positions: list[tuple[float, float]]
    """[longitude, latitude] of the points"""
    along_m: list[float]
    depth_m: list[float | None]
    sd_m: list[float | None]
    """Standard deviation: the largest of the cells that a point is between"""
    sounded: list[bool]
    """Whether the point's cell was sounded; else its depth is interpolated"""
    layers: dict[str, list[float | None]]
    """Further layers that were asked for, by name"""
    within_m: float
    """How far from the line its `soundings` lie at most"""
    soundings: list[ProfilePointView]
    """Accepted ones of single beams, in the order of the line"""
    soundings_found: int
    """So many there are; where more than are listed, evenly chosen ones are"""


class Progress(Model):
    """How far a mission has come."""

    step: int
    """Last committed step; 0 before the first"""
    steps: int
    """Steps after which it is finished; with a budget in minutes or kilometres about so many, as legs may be shorter
    than limits.max_step_m
    """
    budget: Budget
    """How long the mission is, as it was given"""
    minutes_left: float | None
    """Vehicle time under way that is left, of the vehicle with most; null: not known"""
    km_left_per_vehicle: float | None
    """What is left to fly for the vehicle with most; null: not known"""
    soundings: int
    """Accepted soundings"""
    rejected: int
    """Soundings and pings kept but not used"""
    pings: int
    """Accepted pings of swath sonars"""
    beams: int
    """Beams of these that detected something; they are no soundings"""
    ensonified_pct: float | None
    """Share of the area's cells that beams of swath sonars met; null without any. With coverage.cell_of_depth cells
    are those that the depth of a place asks for, here, in dense_pct and in holidays
    """
    dense_pct: float | None
    """Share of the area's cells with at least five soundings; null without swath sonars"""
    holidays: int | None
    """Holidays: pieces of ground of at least three by three cells that were missed inside of what was swept; null
    without swath sonars
    """
    distance_m: float
    """Distance travelled by all vehicles, along their tracks"""
    coverage_pct: float
    """Share of the area's cells known to accuracy_m; with swath sonars of those that a beam met"""
    remaining_pct: float
    """Share of the landmarks not known to accuracy_m"""
    mean_sd_m: float | None
    """Mean standard deviation of the map"""
    objective: float | None
    """The planner's objective at the last step"""
    terms: dict[str, float]
    elapsed_s: float
    """Wall-clock seconds in state running"""
    eta_s: float | None
    """Estimated wall-clock seconds until the last step"""
    search: SearchProgress | None
    """In missions of kind search: how it stands"""


class ProposedZoneView(Model):
    """What a chart shows to keep out of. It is a proposal: nothing keeps out of it before a mission has it."""

    object: str
    """The chart's class, as LNDARE, OBSTRN, RESARE or PONTON"""
    reason: str
    """What it is, in words"""
    name: str
    """What the chart calls it; it may be empty"""
    depth_m: float | None
    """Least depth over it, as charted; null: not known"""
    position_m: float
    """How far off it may be; its outline is enlarged by that"""
    zone: PolygonGeometry
    """For a mission's `keep_out`"""


class ProposedZonesView(Model):
    """What a chart shows to keep out of, the nearest to the middle of the area first."""

    zones: list[ProposedZoneView]
    notes: list[str]
    """What was assumed or left out, in words"""


class QualityView(Model):
    """How good the map is, as far as it can be told."""

    version: int
    """Of the map"""
    vertical_datum: str
    common_sd_m: float
    """Standard deviation of what all soundings share, counted in every TVU"""
    tvu: list[ConformityView]
    difference: DifferenceView | None
    """To the reference grid; null: there is none that it meets"""


class Recovery(Model):
    """Where vehicles are taken out of the water, and what brings them there."""

    point: tuple[float, float]
    """Where vehicles are taken out of the water, [longitude, latitude]; may lie outside the area"""
    radius_m: float = 25.0
    """Who is this close to the point is home"""
    on_finish: Homecoming = "return"
    """What vehicles do at the mission's end, unless finish says otherwise"""
    on_low_energy: Homecoming = "return"
    """What a vehicle does when its energy is just enough for its way home"""
    on_lost_link: Homecoming = "return"
    """What a vehicle does whose link was lost for long, once it is heard again"""
    wait_for_batteries: bool = False
    """Whether a mission goes on while all are home with some of their way left, until one is resumed with another
    battery; otherwise it is finished then
    """


class ReferenceView(Model):
    """The grid that a mission's map is compared with."""

    filename: str
    source: str
    created_at: datetime
    cells: int
    """Cells of the map's grid that it knows"""
    notes: list[str]


class RefusedRuling(Model):
    """A sounding that was left as it was."""

    id: int
    reason: str


class RepeatOrder(Model):
    """Which line a vehicle is to fly again."""

    near: tuple[float, float] | None = None
    """The line that passes this place closest, [longitude, latitude]; null: the newest"""


class RulingRequest(Model):
    """Which soundings an operator decides about, and what is added to that."""

    ids: list[int]
    """Ids of soundings of this mission"""
    note: str = ""
    """Kept in the mission's log beside the action"""


class RulingsView(Model):
    """What came of an operator's word on many soundings; the map is that of the new choice."""

    changed: list[int]
    """Ids of those that are otherwise now"""
    unchanged: int
    """How many were so already"""
    refused: list[RefusedRuling]
    """Those that cannot be so, with the reason"""


class Scan(Model):
    """One look round from a vehicle: a laser scanner's turn, or a sweep of an imaging sonar."""

    vehicle: str
    time_s: float
    """The vehicle's clock, Unix seconds"""
    lat_deg: float
    """Latitude, WGS84 degrees"""
    lon_deg: float
    """Longitude, WGS84 degrees"""
    bearing_step_deg: float
    """By how much further clockwise each next beam looks"""
    reach_m: float
    """Within this range it tells of everything"""
    ranges_m: list[float | None]
    """Range of each beam's first echo; null, or more than reach_m: there was none within reach"""
    depth_m: float = 0.0
    """Depth of the vehicle below the surface"""
    first_bearing_deg: float = 0.0
    """Bearing of the first beam, clockwise from true north"""


class ScanBatch(Model):
    """Scans in the order in which they were made."""

    items: list[Scan]


class ScannerSpec(Model):
    """A laser scanner or an imaging sonar that looks round, on every vehicle."""

    reach_m: float = 8.0
    """Range within which it tells of everything"""
    resolution_deg: float = 0.5
    """Angle between neighbouring beams"""


class SearchGridView(Model):
    """A search's site: what is known of each cell."""

    mission_id: str
    version: int
    """Scans that it was made of"""
    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int
    corners: list[tuple[float, float]]
    """[longitude, latitude] of the grid's corners: north-west, north-east, south-east, south-west"""
    cells: str
    """One byte per cell, rows from south to north, each from west to east, in base64. 1: explored and free, 2: not
    explored, 3: obstacle known beforehand, 4: obstacle found
    """


class SearchMessage(Model):
    """How a search stands: its grid can be fetched anew."""

    type: Literal["search"]
    search: SearchProgress


class SearchProgress(Model):
    """How a search stands."""

    version: int
    """Scans that the site's grid was made of"""
    explored_pct: float
    """Share of the site's open cells that were looked at and are free"""
    goal_pct: float
    """The same within the goal area"""
    found_cells: int
    """Cells with an obstacle that is on no plan"""
    left_s: float
    """Vehicle time until everybody has to be back; negative: too late"""
    began_at: datetime | None
    """When the time began to run: at the first step"""
    back: list[str]
    """Vehicles at the entry"""
    out_of_contact: list[str]
    """Vehicles farther from the transmitter than it reaches"""


class SearchSpec(Model):
    """A search: something near the goal is sought, the rest of the site is looked at, and all are back in time."""

    goal: tuple[float, float]
    """Where it is expected, [longitude, latitude]"""
    entry: tuple[float, float]
    """Where vehicles enter, and where they are when the time is up, [longitude, latitude]"""
    window_s: float
    """Time from the first step in which every vehicle is back, seconds of vehicle time; pauses count"""
    goal_radius_m: float = 50.0
    """Radius of the goal area about it"""
    transmitter: tuple[float, float] | None = None
    """Where the team's radio stands; null: at the entry"""
    transmitter_range_m: float = 200.0
    """Farther away a vehicle is out of contact"""
    safety_m: float = 2.0
    """Legs keep this far from obstacles and from what nobody has looked at; not below arrival_radius_m"""
    scanner: ScannerSpec | None = None
    obstacles: list[PolygonGeometry] | None = None
    """What is known to stand there: quays on a chart, walls on a plan"""
    simulated_obstacles: list[PolygonGeometry] | None = None
    """What simulated vehicles meet beyond `obstacles`; planners do not know of it"""


class SessionView(Model):
    """Who asks, and what he may do."""

    name: str
    """Name of the access token, or `local operator`"""
    role: Role
    local: bool
    """True while no token was made and the user asks who runs the service"""
    signed_in: bool
    """True when a browser's session says who asks: it can be signed out"""
    vehicle: str | None = None
    """The one vehicle that a token of role vehicle acts for"""


class ShareView(Model):
    """What something adds to the uncertainty of a beam, standard deviations in metres."""

    angle_deg: float
    """Of the beam from straight down"""
    vertical_m: float
    """Of the depth"""
    horizontal_m: float
    """Of the place, east and north together"""


class ShipView(Model):
    """A ship as it was heard last. What it does not tell is null, or an empty text."""

    mmsi: int
    name: str
    call_sign: str
    type: str
    status: str
    own: bool
    """Belongs to the operation: no cause for an alarm"""
    lat_deg: float
    lon_deg: float
    sog_mps: float | None
    """Speed over ground"""
    cog_deg: float | None
    """Course over ground"""
    heading_deg: float | None
    length_m: float | None
    width_m: float | None
    draught_m: float | None
    heard_at: datetime
    """When it was heard, UTC"""
    age_s: float
    """Since it was heard"""
    closest: ApproachView | None
    """To vehicles that are at or near the surface, or will be; null: to none within half an hour"""


class SimulatedTarget(Model):
    """A target that moves about in the service's own simulation; vehicles of kind ``sim`` range to it."""

    start: tuple[float, float]
    """Where it starts, [longitude, latitude]"""
    depth_m: float = 2.0
    course_deg: float = 0.0
    """Clockwise from north; it turns at the sea's edge"""
    speed_mps: float = 0.3


class SiteChanges(Model):
    """What may be changed of a site; what is left out stays."""

    name: str | None = None
    area: PolygonGeometry | None = None
    cell_m: float | None = None
    yearly_change_m: float | None = None


class SiteChoice(Model):
    """Which site a mission belongs to."""

    site: str | None
    """The site; null: none"""


class SiteMapView(Model):
    """A site's depths from all its surveys, as of a time. Rows go from south to north; null: nobody surveyed there."""

    site_id: str
    at: datetime
    """As of when: what was known before is less certain by then"""
    west_m: float
    """Western edge of the grid in the site's local frame"""
    south_m: float
    cell_m: float
    rows: int
    cols: int
    corners: list[tuple[float, float]]
    """North-west, north-east, south-east and south-west corner, [longitude, latitude]"""
    vertical_datum: str
    known_pct: float
    """Of the site's cells, those that a survey knows"""
    min_depth_m: float | None
    max_depth_m: float | None
    surveys: list[SurveyName]
    """What `survey` counts in, oldest first"""
    depth_m: list[list[float | None]]
    sd_m: list[list[float | None]]
    """Standard deviation of the depths, grown with their age"""
    survey: list[list[int | None]]
    """Number in `surveys` of the newest one that counts in the cell"""
    count: list[list[int]]
    """Surveys that count in the cell: those since it was found changed"""
    sounded: list[list[bool]]
    """Whether one of them sounded it; else its soundings support the depth"""


class SiteSpec(Model):
    """A site as an operator describes it."""

    name: str
    """Shown to people; need not be unique"""
    area: PolygonGeometry
    """What belongs to the site"""
    cell_m: float = 1.0
    """Cell of the site's grid, metres"""
    yearly_change_m: float = 0.0
    """By how much the floor may change in a year, standard deviation in metres: what was known grows as uncertain,
    after four years by twice as much. 0: surveys count the same however old
    """


class SiteView(Model):
    """A site that is surveyed again and again."""

    id: str
    name: str
    area: PolygonGeometry
    cell_m: float
    """Cell of the site's grid"""
    yearly_change_m: float
    """By how much the floor may change in a year, standard deviation"""
    created_at: datetime
    updated_at: datetime
    missions: int
    """Missions of the site, whatever their state"""
    surveys: int
    """Missions that ended, whose depths the site keeps"""
    last_survey_at: datetime | None
    """When the newest survey made its last sounding"""


class SnapshotMessage(Model):
    """First message on the live socket: everything needed to draw the picture."""

    type: Literal["snapshot"]
    mission: MissionView
    tracks: dict[str, list[tuple[float, float, float]]]
    """Per vehicle its track so far as [longitude, latitude, depth], to within 0.2 m"""
    map_version: int
    last_event_id: int
    alarms: list[AlarmView]
    """Those of the mission that nobody has acknowledged, oldest first"""


class SoundSpeed(Model):
    """Sound speed correction: every beam is followed through a cast's profile for the time that its sonar measured.
    It is a cast itself; ``further`` ones make it several, of which ``rule`` gives each ping its own.
    """

    profile: list[tuple[float, float]]
    """Measured speeds as [depth in m, speed in m/s], from top to bottom; one pair: the same everywhere"""
    rule: CastRule = "nearest_in_time"
    """Which of several casts corrects a ping: the one nearest in time, or, of those within within_h, the one nearest
    to the vehicle (to the sounding, for single beams); where none is within that, the nearest in time
    """
    within_h: float = 4.0
    """With rule nearest_in_distance_within_time: how far a cast may be away in time, hours"""
    source: str = ""
    """Where the profile comes from, kept with the product"""
    time: datetime | None = None
    """When the cast was taken, UTC where no offset is given; null: not known, which only one that is alone may be"""
    position: tuple[float, float] | None = None
    """Where, [longitude, latitude]; null: not known, which the rule nearest_in_distance_within_time does not allow
    for several casts
    """
    name: str = ""
    """Its name among the mission's casts, without '/'; default: made of the source"""
    assumed_mps: float = 1500.0
    """Speed that is set in the sonars, m/s"""
    further: list[Cast] | None = None
    """Further casts; then each needs its own time and name and, with rule nearest_in_distance_within_time, a
    position
    """


class SoundingErrors(Model):
    """Standard deviations (1 sigma) of what makes soundings of swath sonars uncertain."""

    range_m: float = 0.03
    """Range: the part that is the same at all ranges, m"""
    range_pct: float = 0.5
    """Range: the part that grows with it, %"""
    beam_angle_deg: float = 0.1
    """Direction of a beam in the sonar, degrees"""
    roll_deg: float = 0.05
    """Roll as it is measured, degrees"""
    pitch_deg: float = 0.05
    """Pitch as it is measured, degrees"""
    heading_deg: float = 0.5
    """Heading as it is measured, degrees"""
    roll_patch_deg: float = 0.1
    """Roll of the sonar in the vehicle, as a patch test leaves it, degrees"""
    heave_m: float = 0.05
    """Depth of the vehicle from moment to moment: heave, waves, m"""
    waterline_m: float = 0.02
    """Depth of the sonar below the water level as a whole: draught, m"""
    surface_sound_speed_mps: float = 0.5
    """Sound speed at the sonar, by which it steers its beams, m/s"""
    sound_speed_profile_mps: float = 0.5
    """Sound speed between the sonar and the bottom, m/s"""
    position_m: float = 1.5
    """East and north of a vehicle that does not say how well it knows its place, m each"""


class SoundingPage(Model):
    """Some soundings, in the order they came."""

    total: int
    """Of all pages"""
    items: list[SoundingView]
    next_after: int | None
    """Give it as `after` for the next page; null: this is the last"""


class SoundingPoints(Model):
    """Many soundings as points, column by column, in the order they came."""

    total: int
    """Of all pages"""
    id: list[int]
    lon_deg: list[float]
    lat_deg: list[float]
    depth_m: list[float]
    """Below the datum of the map; as it was measured where that is not known"""
    state: list[int]
    """Places in `states`"""
    vehicle: list[int]
    """Places in `vehicles`"""
    states: list[SoundingState]
    vehicles: list[str]
    next_after: int | None
    """Give it as `after` for the next page; null: this is the last"""


class SoundingView(Model):
    """A stored sounding; what was measured never changes, only whether it counts."""

    id: int
    vehicle: str
    time_s: float
    """The vehicle's clock, Unix seconds"""
    beam: int
    step: int
    lat_deg: float
    lon_deg: float
    range_m: float
    raw_depth_m: float
    """Of the bottom below the surface, as measured"""
    depth_m: float | None
    """Corrected, below the datum; null where no correction could be made"""
    sd_m: float | None
    state: SoundingState
    reason: str
    """Why it is not used, or who restored it"""


class StartRequest(Model):
    """What an operator adds when a mission is started."""

    note: str = ""
    """Kept in the mission's log beside the action"""
    confirmed: list[str] | None = None
    """Which of the checklist's `questions` the operator has looked at. The mission's log keeps them, and those that
    nobody confirmed
    """


class StateDefinition(Model):
    """What P multiplies; docs/pcao.md says how each is made."""

    vectors: list[str] | None = None
    figures: list[str] | None = None
    mixing_signals: int = 3


class StateMessage(Model):
    """The mission's state or progress changed."""

    type: Literal["mission"]
    mission: MissionSummary


class StepView(Model):
    """A step that was decided: its figures, and where it sent the vehicles."""

    number: int
    committed_at: datetime
    objective: float | None
    terms: dict[str, float]
    figures: dict[str, float]
    """How far the mission had come: coverage_pct, remaining_pct, mean_sd_m, distance_m; empty in steps of before
    they were kept
    """
    soundings: int
    """Soundings that its map was made of"""
    waypoints: list[WaypointView]


class StopView(Model):
    """A vehicle's answer to a stop."""

    vehicle: str
    acknowledged: bool
    detail: str


class SurfacePolicy(Model):
    """When a vehicle comes up for a GPS fix: by how well it says that it knows where it is, by the clock, or both."""

    max_position_sd_m: float | None = None
    """Standard deviation of its position (position_sd_m) that a vehicle should not exceed; it comes up at 90 % of
    it. null: never because of it
    """
    every_min: float | None = None
    """Minutes after which a vehicle comes up, also one that does not say how well it knows where it is. null: never
    because of the clock
    """
    stay_s: float = 60.0
    """How long a vehicle stays up that comes up by the clock"""
    good_position_sd_m: float | None = None
    """It stays at the surface until its position is known this well; null: a third of the limit"""


class SurveyLine(Model):
    """A line, straight or with bends as the middle of a channel has them."""

    name: str
    """What the plan calls it, as its number; no other line is called so"""
    coordinates: list[tuple[float, float]]
    """Two or more [longitude, latitude], flown from one to the next; heights are left out"""
    keep_direction: bool = False
    """Fly it as it is drawn; false: in the direction that takes less way"""


class SurveyName(Model):
    """A survey in short."""

    mission_id: str
    name: str
    at: datetime
    """Its last sounding"""


class SurveyView(Model):
    """What a mission has to do with its site: a survey once it has ended."""

    mission_id: str
    name: str
    state: str | None
    """Of the mission; null: it was removed, its depths are kept"""
    surveyed: bool
    """Whether the site has its depths: false until it ends, and while its map is made"""
    left_out: str
    """Why its depths are not in the site's model; empty where they are"""
    began_at: datetime | None
    """First sounding"""
    ended_at: datetime | None
    """Last sounding"""
    soundings: int
    """Accepted ones, without beams of swath sonars"""
    beams: int
    share_pct: float
    """Of the site's cells, those that it knows"""
    median_sd_m: float | None
    """Standard deviation of its depths"""
    min_depth_m: float | None
    max_depth_m: float | None
    changed_pct: float | None
    """Of its cells that were known before, those where it differs from what was foretold by more than 1.96
    deviations: about 5 where nothing changed. null: none was known
    """
    vertical_datum: str


class SwathSonarSpec(Model):
    """A multibeam sonar, looking down, across the vehicle's heading."""

    aperture_deg: float = 120.0
    """Angle between its outermost beams, half of it to each side, degrees"""
    beams: int = 256
    """How many beams a ping has, at equal angles"""
    rate_hz: float = 5.0
    """Pings a second, Hz"""
    range_m: float = 100.0
    """Longest slant range, metres"""


class SystematicErrorView(Model):
    """One error, as the survey shows it beside those that are taken out already."""

    kind: ErrorKind
    """depth: a vehicle's depths beside the mean of those that cross each other; water_level: the largest residual
    beside the tide; roll_offset and sound_speed: of a swath sonar
    """
    vehicle: str | None
    """Null: of all"""
    unit: str
    found: float
    """What is left in soundings as they are corrected now"""
    sd: float
    """Its standard deviation, from leaving lines or pieces of tracks out"""
    significance: float
    """How many standard deviations it is from zero"""
    observations: int
    """Crossings, or beams, that tell of it"""
    rms_before_m: float
    """RMS of the differences it was found in"""
    rms_after_m: float
    """What would be left of them"""
    proposed: bool
    """Whether it is large and sure enough to be taken out"""
    why: str
    """Why it is proposed, or not"""


class SystematicErrors(Model):
    """Errors that are the same for many soundings; they are taken out of every depth beside tide and sound speed."""

    vehicles: dict[str, Any] | None = None
    """By vehicle; one that is missing is right"""
    water_level: list[tuple[float, float]] | None = None
    """By how much depths are still too large at some times, beside the tide: [Unix seconds of the vehicles' clocks,
    metres], in order; linear between them, and as at the nearest before and after
    """
    source: str = ""
    """Where these come from, kept with the product"""


class SystematicErrorsView(Model):
    """What a survey shows of systematic errors."""

    applied: SystematicErrors
    """What is taken out of soundings now"""
    errors: list[SystematicErrorView]
    unknown: list[str]
    """What cannot be told, and why"""
    proposal: SystematicErrors | None
    """What to send to PUT .../systematic-errors to take out what is proposed, what is applied included; null:
    nothing is proposed
    """


class TargetRangePage(Model):
    """Some ranges, in the order they were judged."""

    items: list[TargetRangeView]
    next_after: int | None
    """Give it as `after` for the next page; null: this is the last"""


class TargetRangeView(Model):
    """A range to a target as it was measured, and whether it was used."""

    id: int
    target: str
    vehicle: str
    time_s: float
    """The vehicle's clock, Unix seconds"""
    received_at: datetime
    step: int
    source: str
    """What told of it: rest, sim, or an IMC message"""
    range_m: float
    lat_deg: float
    """Where the vehicle was"""
    lon_deg: float
    depth_m: float
    used: bool
    reason: str
    """Why it was not used"""


class TargetSpec(Model):
    """A moving target with something on it that vehicles range to by sound."""

    name: str
    """Its name"""
    acoustic_name: str | None = None
    """What vehicles' modems call it; lbl-7 is transponder 7 of a long base line; null: its name"""
    max_speed_mps: float = 1.0
    """How fast it may be"""
    velocity_change_mps: float = 0.1
    """Standard deviation by which its velocity along east and along north changes within a minute"""
    min_depth_m: float = 0.0
    """Shallowest depth at which it may be found"""
    max_depth_m: float | None = None
    """Deepest; null: limits.max_depth_m of the vehicles"""
    simulated: SimulatedTarget | None = None
    """Let it move about in the service's own simulation; null: it is a real one"""


class TargetView(Model):
    """A moving target as an operator sees it now: foretold from the last range until this moment."""

    name: str
    state: TargetState
    accurate: bool
    """Known as well as tracking.accuracy_m asks: within A"""
    in_area: bool | None
    """Whether it is thought to be above the area to map"""
    lat_deg: float | None
    lon_deg: float | None
    east_m: float | None
    north_m: float | None
    depth_m: float | None
    speed_mps: float | None
    """Over ground, horizontally; null: its ranges do not tell yet"""
    course_deg: float | None
    """Clockwise from north; null: not known, or it may stand still"""
    sd_east_m: float | None
    sd_north_m: float | None
    sd_depth_m: float | None
    ellipse: EllipseView | None
    age_s: float | None
    """Seconds since a range to it was used, as vehicles count them; null: never"""
    ranges: int
    """Ranges that were used"""
    rejected: int
    """Ranges that were not"""
    last_refusal: str
    """Why the last of those was not used"""
    pursued_by: str | None
    """The vehicle that left the mapping for it"""


class TargetsMessage(Model):
    """What is known of the moving targets, a few times per second where a mission has any."""

    type: Literal["targets"]
    time: datetime
    targets: list[TargetView]


class TelemetryView(Model):
    """What the vehicles told of themselves while the mission ran."""

    times_s: list[float]
    """The moments, Unix seconds by the service's clock, ascending"""
    vehicles: list[VehicleTelemetry]


class Tide(Model):
    """Water level correction: depth below the datum = sounded depth - level + datum_offset_m."""

    level_m: float = 0.0
    """Water level above the zero of the tide gauge or table (chart datum), metres"""
    source: str = "none applied"
    """Where the level comes from, kept with the product"""
    sd_m: float = 0.0
    """Standard deviation of the level; it counts in every cell's TVU estimate"""
    datum_epsg: int = 5861
    """EPSG code of the depth datum that products state once a tide is applied, for example 5861 (LAT depth) or 5715
    (MSL depth)
    """
    datum_offset_m: float = 0.0
    """How far that datum lies above the zero that levels count from; added to every depth"""


class TideCorrection(Model):
    """A mission's tide: a constant level, or a table of high and low waters or observed levels in its place."""

    level_m: float = 0.0
    """Water level above the zero of the tide gauge or table (chart datum), metres"""
    source: str = "none applied"
    """Where the level comes from, kept with the product"""
    sd_m: float = 0.0
    """Standard deviation of the level; it counts in every cell's TVU estimate"""
    datum_epsg: int = 5861
    """EPSG code of the depth datum that products state once a tide is applied, for example 5861 (LAT depth) or 5715
    (MSL depth)
    """
    datum_offset_m: float = 0.0
    """How far that datum lies above the zero that levels count from; added to every depth"""
    table: str | None = None
    """Text of a table: a line 'YYYY/MM/DD hh:mm:ss.sss level' (.tid) or '2026-11-30T11:00:00Z 1.0' per high or low
    water, or per observed level. Times without a zone or an offset are UTC; blanks, a tab, a comma or a semicolon
    before the level, in metres. A half cosine leads from one extreme to the next, observed levels run smoothly;
    soundings beyond the table, or in a gap of it, are rejected until a table covers them. Null: level_m
    """
    table_name: str = ""
    """Its name; default: the harbour that it states"""


class TideTableView(Model):
    """A tide table in short."""

    name: str
    first: datetime
    """Time of the first entry"""
    last: datetime
    """Time of the last entry"""
    entries: int
    sha256: str
    """Of the table as it was sent"""
    utc_assumed: bool
    """Whether it states no zone for some of its times, which are taken for UTC"""


class TieFeatureView(Model):
    """A tie as GeoJSON."""

    type: Literal["Feature"]
    properties: TieView
    geometry: PointView


class TieFeaturesView(Model):
    """Ties as GeoJSON."""

    type: Literal["FeatureCollection"]
    features: list[TieFeatureView]


class TieView(Model):
    """A section of a track that was compared with what others sounded there."""

    number: int
    vehicle: str
    time_s: float
    """The vehicle's clock in its middle, Unix seconds"""
    other: str | None
    """The vehicle that it was compared with most; null: it was not used"""
    outcome: Literal["used", "no-overlap", "flat", "misfit", "outlier", "not-significant"]
    """Used, or why not: others' soundings are too far, the terrain says nothing, depths differ wherever it is moved
    to, it contradicts the others, or no tie at all made held-out ones fit better
    """
    before_m: float | None
    """RMS of its depths less the others', unadjusted"""
    after_m: float | None
    """The same, adjusted"""
    sd_m: tuple[float | None, float | None]
    """How well it tells by how much to move it, in its best and its worst direction; null: not at all"""


class TileJson(Model):
    """Where a layer's tiles are (TileJSON 3.0)."""

    name: str
    description: str
    tiles: list[str]
    """Address of each tile, with {z}, {x} and {y}"""
    minzoom: int
    maxzoom: int
    """A cell of the map is at least four pixels wide there; there are tiles beyond"""
    bounds: list[float]
    """West, south, east and north, degrees"""
    center: list[float]
    """Longitude, latitude and zoom to begin with"""
    layer: str
    unit: str
    """Of `range`; empty for layers by classes"""
    range: list[float]
    """Values of the first and the last colour"""
    tilejson: str = "3.0.0"
    version: str = "1.0.0"
    attribution: str = ""
    scheme: str = "xyz"
    format: str = "png"


class TotalView(Model):
    """A beam's total propagated uncertainty, 95 %."""

    angle_deg: float
    """Of the beam from straight down"""
    tvu_m: float
    thu_m: float


class TrackOffsetView(Model):
    """By how much a vehicle's positions were changed."""

    vehicle: str
    nodes: int
    mean_m: float
    """Mean length of the change"""
    max_m: float
    before_sd_m: float
    """How uncertain its reckoned positions are by the assumed drift, east or north, at the worst"""
    sd_m: float
    """The same of its adjusted ones"""


class Tracking(Model):
    """How well targets are to be known, and how well vehicles range to them."""

    accuracy_m: float = 5.0
    """A target counts as accurately known while its standard deviations along east, north and depth are below this"""
    range_noise: float = 0.01
    """Standard deviation of a range to a target as a fraction of it"""
    range_sd_m: float = 0.5
    """The part of it that is the same at any range, metres"""
    hearing_m: float | None = None
    """Farther than this no target is heard; null: unlimited"""
    pursue: bool = True
    """Whether a vehicle leaves the mapping for a target that is not known well enough: one of three, none of a team
    of one
    """
    standoff_m: float = 10.0
    """A vehicle that goes for a target comes no closer to any"""


class TrafficFinding(Model):
    """What the doctor says of AIS, and what to do about it."""

    severity: Severity
    text: str
    remedy: str


class TrafficMessage(Model):
    """The ships near the mission, about once a second where AIS is set up."""

    type: Literal["traffic"]
    time: datetime
    ships: list[ShipView]
    own_ship: OwnShipView | None


class TrafficSourceView(Model):
    """Where sentences come from."""

    name: str
    open: bool
    reason: str
    """Why nothing can be heard; empty while it is open"""
    sentences: int
    """Of AIS, that could be read"""
    silent_s: float | None
    """Since the last of them; null: none came yet"""


class TrafficView(Model):
    """The ships about and how they are heard."""

    ships: list[ShipView]
    """The nearest to a mission first"""
    own_ship: OwnShipView | None
    """null: not heard for ais.max_age_s, or never"""
    sources: list[TrafficSourceView]
    """Empty: AIS is not set up, see the settings ais.*"""
    malformed: int
    """Sentences that could not be read"""
    dropped: int
    """Sentences that came faster than they can be read"""
    turned_away: int
    """Positions of ships there was no room for; near ones come before others"""
    jumps: int
    """Positions too far from where the ship had just been"""


class Training(Model):
    """How the controller came about."""

    command: str = ""
    """What makes it again"""
    bathyfleet: str = ""
    """The version that trained it"""
    method: str = ""
    """pcao, cma or random"""
    seed: int = 0
    """Of the optimiser"""
    terrains: list[str] | None = None
    seeds: list[int] | None = None
    """Of the Monte-Carlo runs on each terrain"""
    robots: int = 3
    landmarks: int = 1100
    steps: int = 500
    evaluations: int = 0
    """Controllers that were scored"""
    score: float | None = None
    """E(P) of eq. (17), per run"""


class UncertaintyBudgetView(Model):
    """Where the uncertainty of a swath sonar's soundings comes from, over level ground, for single beams."""

    depth_m: float
    """Mean depth of the map"""
    below_sonar_m: float
    """That minus the depth at which the highest vehicle travels"""
    components: list[ComponentView]
    totals: list[TotalView]
    allowed: list[AllowedView]


class VehicleCastView(Model):
    """A sound speed cast that a vehicle measured, as it sent it or as its log has it."""

    time: datetime
    """The middle of the time in which it was measured, by the vehicle's clock"""
    position: tuple[float, float]
    """The middle of where, [longitude, latitude]"""
    profile: list[tuple[float, float]]
    """[depth in m, speed in m/s] from top to bottom: means and medians of bins of half a metre, or more"""
    sd_mps: float
    """How far single speeds lie from those of their bins, as a standard deviation"""
    samples: int
    """Speeds that it is made of"""
    bins: list[tuple[int, float]]
    """For each entry of the profile [speeds in its bin, how far they lie from their median as a standard deviation
    in m/s]; empty: of a log that was read by an earlier version
    """
    lag_mps: float | None
    """By how much speeds on the way down are larger than on the way up, m/s; from 0.5 on, either way, only the way
    down counts. Null: too little was measured on both
    """
    vehicle: str
    file: str | None
    """The log's name; null: it was sent"""
    probe: str | None
    """What measured it; null: a log does not keep that"""


class VehicleDiagnosis(Model):
    """What was found of one vehicle."""

    name: str
    imc_id: int
    state: NodeState
    healthy: bool
    causes: list[Cause]
    """Of its problems, the one to look at first in front"""
    findings: list[Finding]
    history: list[LinkRecord]
    """The last changes of its link, oldest first"""


class VehicleForecast(Model):
    """What one vehicle will have done."""

    vehicle: str
    distance_m: float
    """Median over the floors"""
    distance_m_range: ForecastRange


class VehicleSpec(Model):
    """A vehicle that takes part in a mission."""

    name: str
    """Its name; for IMC the name it announces"""
    kind: VehicleKind = "imc"
    """imc: DUNE over UDP; rest: polls and posts by itself; sim: simulated inside the service; neptus: of a session
    of Neptus' ConvCAO panel, which makes its mission itself
    """
    sensor: Sensor = "single_beam"
    sonar: SwathSonarSpec | None = None
    """With sensor multibeam: what that sonar can do; null: its defaults"""
    mounting: MountingSpec | None = None
    """How its sonar is mounted, of whichever sensor; corrected later by `mountings` of the mission"""
    depth_m: float | None = None
    """Depth it travels at where the bottom leaves room; null: the first vehicle of a mission at limits.min_depth_m,
    each further one limits.min_vertical_separation_m deeper
    """
    altitude_m: float | None = None
    """Height above the bottom that it keeps where the bottom is known, down to limits.max_depth_m and never less
    than limits.min_altitude_m; elsewhere it travels at depth_m. null: it keeps its depth
    """
    speed_mps: float | None = None
    """Speed asked of it; null: the mission's speed_mps"""
    turn_radius_m: float | None = None
    """Radius of its turning circle, by which plans pay for turns; null: what it flies in 4 s"""
    endurance_min: float | None = None
    """How long its energy lasts at its speed, minutes, from the start of the mission; counts where the vehicle tells
    no battery level. null: not known
    """
    recovery_point: tuple[float, float] | None = None
    """Where it is taken out of the water, [longitude, latitude]; null: at the mission's recovery.point"""
    guidance: Guidance = "follow"
    """How a vehicle of kind imc is led. follow: by references, one a second; legs: by a plan for each whole leg,
    where radio ends at the surface; acoustic: by legs, and by sound while radio is silent
    """
    gateway: str | None = None
    """With guidance acoustic: the name that the node with the modem announces"""
    start: tuple[float, float] | None = None
    """Where a simulated vehicle starts, [longitude, latitude]; default: a corner of the area"""
    simulated_mounting: MountingSpec | None = None
    """How the sonar of a simulated vehicle really is mounted, to see what a wrong `mounting` does; null: as
    `mounting` says
    """


class VehicleTelemetry(Model):
    """One vehicle's figures, a value or null for each of the moments."""

    vehicle: str
    depth_m: list[float | None]
    altitude_m: list[float | None]
    battery_pct: list[float | None]
    age_s: list[float | None]
    """Seconds since it was heard"""


class VehicleView(Model):
    """A vehicle as an operator sees it now."""

    name: str
    kind: VehicleKind
    sensor: Sensor | None
    mission_id: str | None
    """The mission it takes part in, if any"""
    active: bool
    """False once it left its mission"""
    left_at: datetime | None
    """When it left the mission; null while it takes part"""
    breach: str
    """Where it is that it must not be: in a keep-out zone or outside the area; else empty"""
    link: LinkState
    reason: str
    """What is missing or wrong and what to do, or why it waits; empty: all is well"""
    age_s: float | None
    """Seconds since it last told where it is; since it was heard where it never did; null: never"""
    address: str | None
    imc_id: int | None
    lat_deg: float | None
    lon_deg: float | None
    east_m: float | None
    north_m: float | None
    depth_m: float | None
    altitude_m: float | None
    heading_deg: float | None
    speed_mps: float | None
    battery_pct: float | None
    position_sd_m: float | None
    """How well it says that it knows where it is: standard deviation in metres"""
    localization: PositionQuality
    """What that is worth beside the mission's surface_policy"""
    swath_m: tuple[float, float] | None
    """How far its swath sonar reached with its last ping, level to port and to starboard, metres; null: it has none,
    or did not measure within the last seconds
    """
    surfacing: bool
    """On its way up, or at the surface, for a GPS fix"""
    risings: int
    """How often it was sent up for a fix in this mission"""
    pursuing: str | None
    """The target that it leaves the mapping for"""
    phase: Phase | None
    """What it is at; null while it takes part in no mission"""
    flown_m: float
    """What it has flown in this mission, along its track"""
    on_plan_m: float
    """Of those, metres along planned legs"""
    idle_s: float
    """Vehicle time in which it waited for a decision"""
    order: OrderView | None
    """What its operator ordered; null: it does its part"""
    withdrawn: str
    """Why it surveys no more; empty while it does"""
    part_done: bool
    """It surveys no more as it has flown all that it had to"""
    energy_left_pct: float | None
    """What is left of its energy, by its battery or else by endurance_min; null: not known"""
    energy_left_s: float | None
    """How long that lasts at its speed for sure, vehicle time; null: not known"""
    recovery_point: tuple[float, float] | None
    """Where it comes home to, [longitude, latitude]; null: nowhere"""
    return_needs_s: float | None
    """How long its way home takes from where it is, vehicle time; null: not known"""
    turn_back_at: datetime | None
    """When it has to turn back, if it goes no farther from home; null: not known"""
    turn_back_point: tuple[float, float] | None
    """Where on its planned legs it has to turn back at the latest, [longitude, latitude]; null: on none of them, or
    not known
    """
    way_home: list[tuple[float, float]]
    """Corners of its way home from about where it is, the last its recovery point; empty: none, or over"""
    waiting_circle: WaitingCircle | None
    """Where it was sent to wait; null: it was not, or goes on"""
    failsafes: list[FailsafeView]
    """What is wrong with it and what is done about that, the strongest first"""
    battery: BatteryState | None
    """What its battery's level is worth; null while it has not said."""


class VehiclesAgreementView(Model):
    """Differences where two vehicles cross, or one crosses its own way."""

    count: int
    mean_m: float
    median_m: float
    sd_m: float | None
    """Standard deviation of a sample; null: there is one difference"""
    rms_m: float
    p95_m: float
    """95 % quantile of the absolute differences"""
    max_m: float
    """Largest absolute difference"""
    within_pct: float
    """Share that is not larger than the order's largest TVU"""
    vehicles: tuple[str, str]
    """Depths of the first minus those of the second; twice the same: the later minus the earlier"""


class VehiclesMessage(Model):
    """Positions and links, a few times per second."""

    type: Literal["vehicles"]
    time: datetime
    vehicles: list[VehicleView]
    current: CurrentView | None
    """As these estimate it; null: none tells of it"""


class VolumeView(Model):
    """A volume with its standard deviation, cubic metres."""

    m3: float
    sd_m3: float


class WaitingCircle(Model):
    """Where a vehicle waits: a circle that was found free of zones and of other vehicles' ways."""

    centre: tuple[float, float]
    radius_m: float
    """Of the room that it is given: circles are not flown on rails"""


class WaypointView(Model):
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
    way_home: list[tuple[float, float]]
    """Where it goes when it hears of nobody any more: corners as [longitude, latitude], the last at its recovery
    point; told to vehicles that ask for their waypoint
    """
    status: WaypointStatus
    reason: str


class WaypointsMessage(Model):
    """Waypoints whose state changed."""

    type: Literal["waypoints"]
    waypoints: list[WaypointView]


class WholeSurveyView(Model):
    """What it takes until nothing is left to ensonify or all lines are flown, whatever the budget is."""

    duration_s: float
    """Until the last vehicle is done, by the vehicles' time; median"""
    duration_s_range: ForecastRange
    distance_m: float
    """Of all vehicles together; median"""
    distance_m_range: ForecastRange
    vehicles: list[WholeVehicleView]
    within_budget: bool
    """Whether the mission's budget lasts for it on every floor"""


class WholeVehicleView(Model):
    """What one vehicle does in all of a survey."""

    vehicle: str
    distance_m: float
    """Its way, turns included where they were flown; median over the floors"""
    distance_m_range: ForecastRange
    duration_s: float
    """Seconds of its time for that, ways to fetch batteries included; median"""
    batteries: int | None
    """How many full batteries that takes, on the floor that takes most: one more than it has to come back for
    another; null: it is not known how long one lasts, or its way home and out is too long for one
    """


LiveMessage: TypeAlias = SnapshotMessage | VehiclesMessage | TargetsMessage | SearchMessage | WaypointsMessage | StateMessage | TrafficMessage | MapMessage | EventMessage | AlarmMessage
