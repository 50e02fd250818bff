"""What is known of one node: identity, contact, activity, position.

A :class:`Node` is fed messages and the time they arrived and keeps no clock of its own. Arrival times are in
seconds of the bridge's clock, which runs ``time_scale`` times faster than the wall clock; the vehicle's own
timestamps order its messages.
"""

from __future__ import annotations

import math
from collections.abc import Set

from imc_bridge.events import LostComms, StateReport
from imc_bridge.network.codec import Message
from imc_bridge.network.discovery import MAX_NAME, Announcement
from imc_bridge.network.text_fields import text
from imc_bridge.network.transport import Address
from imc_bridge.nodes.lost_comms import is_lost_comms, read_lost_comms
from imc_bridge.nodes.modes import OperationMode, PlanState, mode_name
from imc_bridge.nodes.plausibility import PlausiblePlace, PositionVerdict
from imc_bridge.nodes.rate_meter import RateMeter
from imc_bridge.nodes.refusals import Refused
from imc_bridge.nodes.vehicle_clock import Tick, VehicleClock
from imc_bridge.printable import printable
from imc_bridge.settings import PLAN_NAME, BridgeSettings, plan_name
from imc_bridge.telemetry.energy import Energy, read_fuel
from imc_bridge.telemetry.faults import Faults
from imc_bridge.telemetry.positions import told_place
from imc_bridge.telemetry.ranges import RangeIntake
from imc_bridge.telemetry.soundings import SoundingIntake, StateHistory, StateSample, beam_table
from imc_bridge.telemetry.swaths import PingIntake
from imc_bridge.telemetry.water import WaterIntake

UNCERTAINTY_VALID_S = 10.0
CURRENT_VALID_S = 3600.0
"""DUNE estimates the current at the surface only: when it drifts there, and from where it comes up."""
FASTEST_CURRENT_MPS = 5.0
SUBMERGED_DEPTH_M = 0.3
"""Radio is gone that far below; the depth sensor's noise at the surface is about 0.1 m."""
ANNOUNCES_MISSED = 3
SLOWEST_ASCENT_MPS = 0.1
"""How fast a vehicle without motor floats up, at least."""
CONTACT_AGAIN_S = 20.0
"""DUNE looks for contacts every 5 s; a few of our heartbeats may be lost."""
LONGEST_DIVE_S = 3600.0
"""So long a vehicle may be silent under water in a plan whose length is not known here, as another console's or the way
home on board; one that was away for longer may come back under another address."""
STATE_MESSAGES_FRESH_S = 3.0
"""What was told longer ago need not be so any more: where it is, above all."""
STEADY_S = 1.0
"""At most so much of a pause between two packets counts as contact: DUNE's heartbeats are no farther apart."""
NO_POSITION = "tells no position: it has no GPS fix yet, or its navigation has failed"
MAX_TEXT = 500
"""Characters kept of what a vehicle says in words."""
NO_OUTCOME = 0
"""PlanControlState.last_outcome of a plan control that has had no plan yet."""
MEDIUM_UNDERWATER = 3
ANY_CONSOLE = 0xFFFF


class Node:
    """One node of the IMC network.

    Parameters
    ----------
    imc_id
    name
        As announced, or the hexadecimal id of a node that never announced.
    settings
    now
        Time of the first packet.
    """

    def __init__(
        self, imc_id: int, name: str, settings: BridgeSettings, now: float, peers: Set[int] = frozenset()
    ) -> None:
        self.imc_id = imc_id
        self.name = name
        self._peers = peers
        self.announcement: Announcement | None = None
        self.announced_at: float | None = None
        self.first_announced_at: float | None = None
        self.addresses: tuple[Address, ...] = ()
        self.address: Address | None = None
        self.host = ""
        """Where its last announce, or without one its first packet, came from."""
        self.hosts: frozenset[str] = frozenset()
        """Where its announces may come from: the host of the last one that counted, and those it announced."""
        self.id_conflict: str | None = None
        """Which systems announce its id, when it is not this one alone."""
        self.namesake: Node | None = None
        """Another node that announces its name, while both are heard."""
        self.boots = 0
        """How often it has restarted."""
        self.started_at: float | None = None
        """When it announced a restart."""
        self.ordered_depth_m = 0.0
        """How deep it may be by our orders: it continues its descent after the last contact."""
        self._restart_seen = False
        """Whether its last restart showed before its next announce."""

        self.packets = 0
        self.heard_at: float | None = None
        self.echoes = 0
        self.relayed = 0
        """How many packets of others it passed on."""
        self.foreign_address = 0
        self.last_foreign: Address | None = None
        """Where packets under its id came from last that is not an address of its own."""
        self.rates = RateMeter()

        self.clock = VehicleClock()

        self.entities: dict[int, str] | None = None
        self.entities_asked_at = -math.inf
        self.lost_comms_task: str | None = None
        """Name of the task that starts a plan when no console is heard; None where it does not run or is not known."""
        self.lost_comms: LostComms | None = None
        self.lost_comms_asked = 0
        """How often it was asked for that."""
        self.operation_mode: int | None = None
        self.operation_mode_at: float | None = None
        self.error_text = ""
        self.plan_state: int | None = None
        self.plan_state_at: float | None = None
        self.plan_id = ""
        self.maneuver_id = ""
        self.plan_outcome: int | None = None
        self.plan_state_time_s = -math.inf
        """When it was in that state, by the vehicle's clock."""
        self.radio_gaps = 0
        """How often radio ended under water while it was led by references."""
        self.expected_back: float | None = None
        """Until when its silence is part of a plan of ours, seconds of the bridge's clock."""
        self.controller: int | None = None
        """Id of the console whose references its FollowReference maneuver reports to take."""
        self.medium: int | None = None
        self.energy: Energy | None = None
        self.history = StateHistory()
        self.places = PlausiblePlace()
        self.report: StateReport | None = None
        self.report_at: float | None = None
        """When it last told where it is."""
        self.without_position_s = 0.0
        """For how long it has been in contact since without telling that; silence does not count."""
        self.intake = SoundingIntake(name, beam_table(settings.altimeter), settings.max_range_m)
        self.pings = PingIntake(name)
        self.ranges, self.water = RangeIntake(name), WaterIntake(name)
        self.faults = Faults(name)
        self._uncertainty: tuple[float, float] | None = None
        self._current: tuple[float, float, float] | None = None
        self.settings = settings
        self._latest: dict[str, float] = {}

    @property
    def is_vehicle(self) -> bool:
        """Whether it announced itself as a vehicle, or without a type."""
        return self.announcement is None or self.announcement.is_vehicle

    @property
    def conflict(self) -> str | None:
        """Why it is not certain who a command would reach; None when it is."""
        if self.id_conflict is not None or self.namesake is None or self.announcement is None:
            return self.id_conflict
        ids = sorted((self.imc_id, self.namesake.imc_id))
        both = " and ".join(f"id 0x{imc_id:04X}" for imc_id in ids)
        return f"{both} announce one name, {self.announcement.name!r}: rename one of them"

    # Discovery

    def announced(self, announcement: Announcement, addresses: tuple[Address, ...], now: float) -> bool:
        """Take an announce in; True when the node has restarted since the last one."""
        previous = self.announcement
        self.announcement = announcement
        self.announced_at = now
        if self.first_announced_at is None:
            self.first_announced_at = now
        self.addresses = addresses
        if self.address not in addresses:
            self.address = addresses[0] if addresses else None
        rebooted = (
            previous is not None
            and previous.uid is not None
            and announcement.uid is not None
            and previous.uid != announcement.uid
        )
        if rebooted and self._restart_seen:
            # Its telemetry has shown that already.
            self._restart_seen = False
            return False
        if rebooted:
            self.boots += 1
            self.started_at = now
            self._forget_plan()
        return rebooted

    def restarted(self) -> None:
        """Note that its telemetry shows a restart, which its announce will show later."""
        self.boots += 1
        self._restart_seen = True
        self._forget_entities()

    def _forget_entities(self) -> None:
        """It may be configured otherwise now."""
        self.entities = self.lost_comms_task = self.lost_comms = None
        self.entities_asked_at, self.lost_comms_asked = -math.inf, 0

    def _forget_plan(self) -> None:
        self._forget_entities()
        self.operation_mode = self.plan_state = None
        self.operation_mode_at = self.plan_state_at = None
        self.plan_id = self.maneuver_id = ""
        self.controller = None
        self._latest.clear()

    @property
    def last_sign(self) -> float:
        """When it spoke or announced itself last."""
        return max((at for at in (self.heard_at, self.announced_at) if at is not None), default=-math.inf)

    def replaced_by(self, other: Node, now: float) -> bool:
        """Whether it is another computer of the same vehicle that speaks now, under the same name and another id.

        It speaks from an address of this one, which has been silent since it announced itself first. Elsewhere it would
        be another vehicle, of the name of one that may be under water.
        """
        since = other.first_announced_at
        gone = since is not None and self.last_sign < since and now - self.last_sign > self.lost_after_s
        return gone and other.address in self.addresses

    def given_up(self, now: float) -> bool:
        """Whether it was silent long enough for another host to announce its id."""
        patience = max(ANNOUNCES_MISSED * self.settings.announce_period_s, min(self.patience_s, LONGEST_DIVE_S))
        return now - self.last_sign > patience

    # Packets and the vehicle's clock

    def heard(self, now: float, address: Address) -> None:
        """Note that a packet of its own arrived from one of its addresses."""
        self.packets += 1
        pause_s = math.inf if self.heard_at is None else now - self.heard_at
        if pause_s <= self.lost_after_s:
            self.without_position_s += min(pause_s, STEADY_S)
        self.heard_at = now
        self.address = address

    def excuse(self, seconds: float, now: float) -> None:
        """Subtract from its silence the time in which this process was held up and received nothing."""

        def later(at: float | None) -> float | None:
            return None if at is None else min(at + seconds, now)

        self.heard_at, self.announced_at = later(self.heard_at), later(self.announced_at)
        self.report_at = later(self.report_at)
        self.operation_mode_at, self.plan_state_at = later(self.operation_mode_at), later(self.plan_state_at)
        if self.expected_back is not None:
            self.expected_back += seconds

    def in_order(self, name: str, timestamp: float) -> bool:
        """Whether a message is newer, by the vehicle's clock, than the last of its kind."""
        if timestamp <= self._latest.get(name, -math.inf):
            return False
        self._latest[name] = timestamp
        return True

    def take_time(self, timestamp: float, now: float, wall_time_s: float) -> Tick:
        """Keep up with the vehicle's clock; after a jump everything that was ordered by it is forgotten."""
        tick = self.clock.take(timestamp, now, wall_time_s)
        if tick is Tick.JUMPED:
            self._latest.clear()
            self.places.clear()
            self.history.clear()
            self.intake.clear()
            self.pings.clear()
            self.ranges.clear()
            self.water.clear()
            self._uncertainty = None
            self._current = None
            self.faults.clock_jumped()
        return tick

    # Telemetry

    def take_state(self, message: Message, now: float) -> StateReport | Refused | None:
        """EstimatedState: None when it is out of order, repeated or holds no position, Refused where it cannot be."""
        place = told_place(message)
        if place is None or not all(map(math.isfinite, (message.phi, message.theta, message.psi))):
            return None
        lat, lon = place
        time_s = message.timestamp
        sample = StateSample(
            time_s, lat, lon, message.depth, message.phi, message.theta, math.remainder(message.psi, math.tau)
        )
        step = self.places.take(sample)
        if step is PositionVerdict.DOUBTFUL:
            return Refused.PLACE
        if step is PositionVerdict.MOVED:
            # Nothing was measured on a line between the two places.
            self.history.clear()
        if not self.history.add(sample) or not self.in_order("EstimatedState", time_s):
            return None
        self.report_at, self.without_position_s = now, 0.0
        energy = self.energy
        speed = math.hypot(message.vx, message.vy)
        altitude = float(message.alt)
        self.report = StateReport(
            vehicle=self.name,
            time_s=time_s,
            lat_deg=math.degrees(lat),
            lon_deg=math.degrees(lon),
            depth_m=sample.depth_m,
            heading_rad=sample.yaw_rad,
            speed_mps=speed if math.isfinite(speed) else 0.0,
            altitude_m=altitude if math.isfinite(altitude) and altitude >= 0.0 else None,
            battery_pct=energy.level_pct if energy else None,
            battery_confidence_pct=energy.confidence_pct if energy else None,
            energy_left_s=energy.left_s if energy else None,
            position_sd_m=self.position_sd_m(),
            current_mps=self.current_mps(),
        )
        return self.report

    def take_uncertainty(self, message: Message) -> None:
        """NavigationUncertainty: x and y are variances of the position."""
        variance = 0.5 * (message.x + message.y)
        if math.isfinite(variance) and variance >= 0.0:
            self._uncertainty = (message.timestamp, math.sqrt(variance))

    def position_sd_m(self) -> float | None:
        """Standard deviation of the position per axis, None when the vehicle has not reported it lately."""
        if self._uncertainty is None or self.clock.time_s is None:
            return None
        at_s, sd = self._uncertainty
        return sd if self.clock.time_s - at_s <= UNCERTAINTY_VALID_S else None

    def take_stream(self, message: Message) -> None:
        """EstimatedStreamVelocity: x is north, y is east."""
        east, north = float(message.y), float(message.x)
        if math.hypot(east, north) <= FASTEST_CURRENT_MPS:
            self._current = (message.timestamp, east, north)

    def current_mps(self) -> tuple[float, float] | None:
        """Velocity of the water, east and north, None when the vehicle has not estimated it lately."""
        if self._current is None or self.clock.time_s is None:
            return None
        at_s, east, north = self._current
        return (east, north) if self.clock.time_s - at_s <= CURRENT_VALID_S else None

    def take_fuel(self, message: Message) -> None:
        """FuelLevel: level, confidence and the time that is left."""
        self.energy = read_fuel(message) or self.energy

    def take_vehicle_state(self, message: Message, now: float) -> bool:
        """VehicleState: the operation mode and the errors that explain it; True when it has just begun to boot."""
        boots = int(message.op_mode) == OperationMode.BOOT
        restarted = boots and self.operation_mode not in (None, OperationMode.BOOT) and not self._restart_seen
        self.operation_mode = int(message.op_mode)
        self.operation_mode_at = now
        errors = ", ".join(filter(None, (text(message, "error_ents"), text(message, "last_error"))))
        self.error_text = printable(errors, most=MAX_TEXT)
        return restarted

    def take_plan_state(self, message: Message, now: float) -> bool:
        """PlanControlState; True when it shows a restart: a plan was in execution, and now there never was one."""
        restarted = (
            self.runs_plan
            and bool(self.plan_id)
            and int(message.state) in (PlanState.READY, PlanState.BLOCKED)
            and not text(message, "plan_id")
            and int(message.last_outcome) == NO_OUTCOME
        )
        self.plan_state = int(message.state)
        self.plan_state_at = now
        self.plan_id = printable(text(message, "plan_id"), most=MAX_TEXT)
        self.maneuver_id = printable(text(message, "man_id"), most=MAX_TEXT)
        self.plan_outcome = int(message.last_outcome)
        self.plan_state_time_s = float(message.timestamp)
        if not self.runs_plan:
            self.controller = None
        return restarted

    @property
    def foreign_controller(self) -> int | None:
        """The console that its maneuver listens to when that is not us."""
        return None if self.controller in (None, ANY_CONSOLE, self.settings.id) else self.controller

    def take_entities(self, message: Message) -> None:
        """EntityList report: ``Name=id;…``."""
        self.entities = listed_entities(message) or self.entities
        self.lost_comms_task = next(filter(is_lost_comms, (self.entities or {}).values()), None)

    def take_parameters(self, message: Message) -> None:
        """EntityParameters of that task."""
        if text(message, "name") == self.lost_comms_task:
            self.lost_comms = read_lost_comms(message)

    def entity_name(self, entity: int) -> str | None:
        """Name of an entity, None while names are unknown; an id the list lacks has the name ``entity N``."""
        return None if self.entities is None else self.entities.get(entity, f"entity {entity}")

    # Judgement

    @property
    def submerged(self) -> bool:
        """Whether it was under water at the last contact."""
        return self.medium == MEDIUM_UNDERWATER or (self.report is not None and self.report.depth_m > SUBMERGED_DEPTH_M)

    @property
    def references_needed(self) -> bool:
        """Whether what it executes is our FollowReference plan, which ends by itself when references cease.

        A peer's is taken for one, too: it is not waited for longer than for ours.
        """
        return (self.ours or self.runs_peers_plan) and self.expected_back is None

    @property
    def lost_after_s(self) -> float:
        """Silence that is longer is a break of contact."""
        return max(self.settings.lost_after_s, self.settings.lost_after_wall_s * self.settings.time_scale)

    @property
    def without_position(self) -> bool:
        """Whether it is heard, or was at the last contact, and does not tell where it is: it may be over any bottom."""
        return self.without_position_s > self.fresh_s

    @property
    def fresh_s(self) -> float:
        """What it told of itself counts for so long, while it is in contact."""
        return max(STATE_MESSAGES_FRESH_S, self.settings.lost_after_wall_s * self.settings.time_scale)

    @property
    def patience_s(self) -> float:
        """How long it may be silent before its silence means a loss."""
        if not self.submerged:
            return self.settings.release_after_s
        if not self.references_needed:
            return LONGEST_DIVE_S
        return self.settings.follow_timeout_s + self.ascent_s

    @property
    def ascent_s(self) -> float:
        """Longest time to float up from its last reported depth and to be in contact again."""
        depth = self.report.depth_m if self.report is not None else 0.0
        return max(depth, self.ordered_depth_m, 0.0) / SLOWEST_ASCENT_MPS + CONTACT_AGAIN_S

    @property
    def maneuvering_blocked(self) -> bool:
        """Whether plan control calls itself blocked while a maneuver goes on.

        DUNE does so when its own VehicleState is late, and stays so: the vehicle goes on with what it does, takes no
        STOP, and takes an Abort or another plan.
        """
        return self.plan_state == PlanState.BLOCKED and self.operation_mode == OperationMode.MANEUVER

    def can_start(self, now: float) -> bool:
        """In service and ready for a plan, and at a known place, by messages that are not old."""
        limit = self.fresh_s
        return (
            self.operation_mode == OperationMode.SERVICE
            and self.plan_state == PlanState.READY
            and _fresh(self.operation_mode_at, now, limit)
            and _fresh(self.plan_state_at, now, limit)
            and _fresh(self.report_at, now, limit)
        )

    @property
    def runs_plan(self) -> bool:
        """Whether a plan is in execution, or about to be."""
        return self.plan_state in (PlanState.EXECUTING, PlanState.INITIALIZING)

    @property
    def ours(self) -> bool:
        """Whether it executes our plan, as far as it says, and not at another console's behest."""
        named = self.plan_id == self.settings.plan_id
        # As earlier versions called it, whose ids alone told their plans apart.
        named = named or (self.plan_id == PLAN_NAME and self.controller == self.settings.id)
        return self.runs_plan and named and self.foreign_controller is None

    @property
    def home_bound(self) -> bool:
        """Whether it goes home by a plan that we left on board, perhaps in an earlier run."""
        ours = self.maneuver_id.startswith(home_prefix(self.settings.plan_id))
        return self.plan_state == PlanState.EXECUTING and ours

    @property
    def runs_peers_plan(self) -> bool:
        """Whether it executes a plan of a service that shares its missions with us, or goes home by one."""
        return self.runs_plan and any(
            self.plan_id == name or self.maneuver_id.startswith(home_prefix(name))
            for name in map(plan_name, self._peers)
        )

    @property
    def of_earlier_version(self) -> bool:
        """Whether it executes a plan of a version whose plans do not tell whose they are."""
        named = self.plan_id == PLAN_NAME or self.maneuver_id.startswith(home_prefix(PLAN_NAME))
        return self.runs_plan and named and self.controller is None

    def telemetry_overdue(self, now: float) -> bool:
        """Whether it announced itself long ago and nothing else came."""
        since = self.first_announced_at
        return self.heard_at is None and since is not None and now - since > self.settings.telemetry_timeout_s

    @property
    def operation_mode_name(self) -> str | None:
        """The operation mode in words."""
        return None if self.operation_mode is None else mode_name(OperationMode, self.operation_mode)

    @property
    def plan_state_name(self) -> str | None:
        """The state of plan control in words."""
        return None if self.plan_state is None else mode_name(PlanState, self.plan_state)


def home_prefix(plan_id: str) -> str:
    """What the names of the maneuvers of a way home begin with, by which a vehicle shows whose plan it executes."""
    return f"{plan_id} home"


def listed_entities(message: Message) -> dict[int, str]:
    """Names by id of an EntityList report; empty when it lists none."""
    entities = {}
    for item in text(message, "list").split(";"):
        name, separator, number = item.rpartition("=")
        if separator and number.isdigit():
            entities[int(number)] = printable(name, most=MAX_NAME)
    return entities


def _fresh(at: float | None, now: float, limit_s: float) -> bool:
    return at is not None and now - at <= limit_s
