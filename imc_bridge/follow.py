"""One vehicle under our control: the life of a FollowReference plan and of the waypoints given to it.

A :class:`Follower` neither waits nor sleeps. It is told of messages and of the passing of time, sends through a
callback, and reports through another; the bridge owns sockets and tasks. Times are seconds of the bridge's
clock.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

import imcpy
from imcpy.coordinates import WGS84

from imc_bridge.codec import ANY_ENTITY, Message
from imc_bridge.events import NodeState, StateReport, Waypoint, WaypointChange, WaypointStatus
from imc_bridge.guard import AltitudeGuard
from imc_bridge.nodes import Node, OperationMode, PlanState
from imc_bridge.seabed import Seabed
from imc_bridge.settings import BridgeSettings

MANEUVER_ID = "follow"
START_RETRY_S = 2.0
STOP_RETRY_S = 0.5
ABANDONED_STOP_RETRY_S = 2.0
EVIDENCE_S = 1.5
"""How long an ended plan is looked into before its cause is judged: an abort shows as ERROR, then BLOCKED."""
STARVED_S = 4.0
"""A plan that ended this long after the last echo ended for want of references."""
STARVED_TEXT = "path control reference"
GUARD_STEP_M = 0.2
"""A guarded depth that changes by less than this is not worth a new reference of its own."""
MIN_UNANSWERED = 5
ALIVE_S = 3.0
"""A vehicle heard this lately hears us, too, unless something is wrong."""
STATE_LOITER = 3
STATE_HOVER = 4
STATE_TIMEOUT = 6
CIRCLING_DWELL_S = 6.0
"""The closest approach comes within 5 s after DUNE has begun to circle."""
CIRCLING_MARGIN_M = 2.5
NEAR_TOLERANCE_M = 15.0
"""DUNE's own tolerance around a reference of radius 0."""
FLOWN_STRAIGHT_M = NEAR_TOLERANCE_M + 2.0
"""A reference farther away than this is flown to straight."""
CLOSE_RADIUS_M = 2.0
"""Radius asked for around a reference that DUNE circles at once: tighter than it can fly, so it comes close."""
PASSED_WITHIN_M = 8.0
"""A vehicle that passes its waypoint at most this far to the side has arrived; farther off it is sent back."""

FLAG_LOCATION = 0x01
FLAG_SPEED = 0x02
FLAG_Z = 0x04
FLAG_RADIUS = 0x08
FLAG_DIRECT = 0x20
REFERENCE_FLAGS = FLAG_LOCATION | FLAG_SPEED | FLAG_Z | FLAG_DIRECT
SPEED_METERS_PS = 0
Z_DEPTH = 1
HOLD_SPEED_MPS = 1.0

PLAN_CONTROL_REQUEST = 0
PLAN_CONTROL_SUCCESS = 1
PLAN_CONTROL_FAILURE = 2
PLAN_CONTROL_IN_PROGRESS = 3
OPERATION_START = 0
OPERATION_STOP = 1


class Phase(StrEnum):
    """Where the life cycle is."""

    IDLE = "idle"
    WAITING = "waiting"
    """For the vehicle to be in service and ready."""
    STARTING = "starting"
    """The plan was sent; nothing shows yet that it runs."""
    FOLLOWING = "following"
    ENDED = "ended"
    """The plan has ended without our wish; its cause is being looked into."""
    STOPPING = "stopping"


ENGAGED_PHASES = frozenset({Phase.WAITING, Phase.STARTING, Phase.FOLLOWING, Phase.ENDED})


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a vehicle does not follow, and what to do about it."""

    reason: str
    remedy: str


@dataclass(frozen=True, slots=True)
class SentReference:
    """The fields of a Reference that its echo is compared by."""

    lat_rad: float
    lon_rad: float
    depth_m: float
    speed_mps: float
    radius_m: float = 0.0

    def echoed_by(self, message: Message | None) -> bool:
        """Whether FollowRefState's reference is this one (floats of 32 bits on the wire)."""
        return (
            isinstance(message, imcpy.Reference)
            and isinstance(message.z, imcpy.DesiredZ)
            and int(message.z.z_units) == Z_DEPTH
            and math.isclose(message.lat, self.lat_rad, abs_tol=1e-10)
            and math.isclose(message.lon, self.lon_rad, abs_tol=1e-10)
            and math.isclose(message.z.value, self.depth_m, abs_tol=1e-3)
        )

    def message(self) -> Message:
        """The Reference to send."""
        speed = imcpy.DesiredSpeed()
        speed.value = self.speed_mps
        speed.speed_units = SPEED_METERS_PS
        z = imcpy.DesiredZ()
        z.value = self.depth_m
        z.z_units = Z_DEPTH
        reference = imcpy.Reference()
        reference.flags = REFERENCE_FLAGS | (FLAG_RADIUS if self.radius_m else 0)
        reference.speed = speed
        reference.z = z
        reference.lat = self.lat_rad
        reference.lon = self.lon_rad
        reference.radius = self.radius_m
        return reference


@dataclass(slots=True)
class Evidence:
    """What was seen around the end of a plan that we did not end."""

    timed_out: bool = False
    failure: str = ""
    completed: bool = False
    aborted_by: int | None = None
    stopped_by: int | None = None
    taken_by: int | None = None
    error: str | None = None
    blocked: bool = False
    rebooted: bool = False
    unanswered: bool = False


@dataclass(slots=True)
class Order:
    """The current waypoint and how far it has come."""

    waypoint: Waypoint
    status: WaypointStatus | None = None
    limited: str = ""
    circling_since: float | None = None
    """Since when the vehicle has been circling or hovering at this waypoint by its own account."""
    circling_limit_m: float = 0.0
    start: tuple[float, float] | None = None
    """Where the vehicle was when the order came: latitude and longitude, degrees."""
    leading: bool = False
    """Whether it is sent to the waypoint's lead, to pass the waypoint on the way."""
    radius_m: float = 0.0
    unseen: bool = False
    """Whether the vehicle went on to it where no radio reached."""
    sent: deque[SentReference] = field(default_factory=lambda: deque(maxlen=8))


def follow_plan(settings: BridgeSettings) -> Message:
    """The plan that makes a vehicle follow our references."""
    maneuver = imcpy.FollowReference()
    maneuver.control_src = settings.imc_id
    maneuver.control_ent = ANY_ENTITY
    maneuver.timeout = settings.follow_timeout_s
    maneuver.loiter_radius = settings.loiter_radius_m
    maneuver.altitude_interval = settings.altitude_interval_m
    step = imcpy.PlanManeuver()
    step.maneuver_id = MANEUVER_ID
    step.data = maneuver
    plan = imcpy.PlanSpecification()
    plan.plan_id = settings.plan_id
    plan.start_man_id = MANEUVER_ID
    plan.maneuvers.append(step)
    return plan


def plan_control(operation: int, request_id: int, settings: BridgeSettings) -> Message:
    """A request to plan control: START with our plan, or STOP."""
    request = imcpy.PlanControl()
    request.type = imcpy.PlanControl.TypeEnum.REQUEST
    request.op = imcpy.PlanControl.OperationEnum(operation)
    request.request_id = request_id
    request.plan_id = settings.plan_id
    request.flags = 0
    if operation == OPERATION_START:
        request.arg = follow_plan(settings)
    return request


class Follower:
    """The control of one vehicle.

    Parameters
    ----------
    node
        What is known of the vehicle; kept up to date by the bridge.
    settings
    send
        Sends a message to the vehicle.
    emit
        Receives :class:`WaypointChange` events.
    request_ids
        Numbers for requests, shared by all vehicles and not repeated across restarts of the service.
    seabed
        What all vehicles have measured of the bottom.
    """

    unheard_stop = "references have ceased, so its plan ends by itself"
    """What happens to a vehicle that does not acknowledge a stop."""

    def __init__(
        self,
        node: Node,
        settings: BridgeSettings,
        send: Callable[[Message], None],
        emit: Callable[[WaypointChange], None],
        request_ids: itertools.count[int],
        seabed: Seabed | None = None,
    ) -> None:
        self.node = node
        self.guard = AltitudeGuard(
            settings.guard_radius_m, settings.guard_window_s, settings.unknown_bottom_depth_m, seabed
        )
        self.phase = Phase.IDLE
        self.refusal: Refusal | None = None
        self.stop_detail = ""
        self._settings = settings
        self._send = send
        self._emit = emit
        self._request_ids = request_ids
        self._order: Order | None = None
        self.intervention = ""
        """Why it was released though heard, until we stop it: someone, or the vehicle itself, wanted that."""
        self._hold: SentReference | None = None
        self._since = 0.0
        self._plan_since_s = -math.inf
        """Since when the vehicle has had our plan, by its own clock and word."""
        self._request_id = -1
        self._request_due = 0.0
        self._started_unseen = False
        self._reference_due = 0.0
        self._last_sent: SentReference | None = None
        self._answered_at = 0.0
        self._unanswered = 0
        self._following_since = 0.0
        self._restarts = 0
        self._evidence = Evidence()
        self._abandoned = False
        self._abort = False
        self._gap = False
        self._again = False

    @property
    def engaged(self) -> bool:
        """Whether the vehicle is ours, or about to be ours again."""
        return self.phase in ENGAGED_PHASES

    # What the bridge's user asks

    def engage(self, now: float) -> bool:
        """Begin to make the vehicle follow; False, with a refusal, when that is hopeless.

        It has succeeded in phase ``FOLLOWING`` and failed in ``IDLE``.
        """
        self.refusal = None
        self._restarts = 0
        self._again = False
        self._order = None
        self._hold = None
        self._abandoned = False
        status = self.node.status(now)
        if status.state in (NodeState.LOST, NodeState.HEARD, NodeState.EXPECTED_OFFLINE):
            self.refusal = Refusal(status.reason, "Bring its link up first; `bathyfleet doctor` says what is missing")
        elif self.node.conflict is not None:
            self.refusal = Refusal(self.node.conflict, "A command could reach the wrong vehicle")
        elif status.state is NodeState.IN_PLAN and not self._ours_or_none():
            self.refusal = Refusal(status.reason, "Stop that plan on its console, then engage again")
        else:
            self._enter(Phase.WAITING, now)
        return self.engaged

    def _ours_or_none(self) -> bool:
        """Whether the plan in execution is ours; one that is still nameless may become ours."""
        return self.node.plan_id in ("", self._settings.plan_id) and self.node.foreign_controller is None

    def order(self, waypoint: Waypoint, now: float) -> None:
        """Replace the current waypoint. Repeating one is harmless unless it had been refused."""
        current = self._order
        if (
            current is not None
            and (current.waypoint.mission_id, current.waypoint.step) == (waypoint.mission_id, waypoint.step)
            and current.status is not WaypointStatus.REFUSED
        ):
            return
        self._order = self._make_order(waypoint)
        self._reference_due = now
        if self.phase is Phase.FOLLOWING:
            self._answered_at = now
            self._unanswered = 0
            self.tick(now)

    def _make_order(self, waypoint: Waypoint) -> Order:
        """Choose how the vehicle gets there: past it, where there is room for that, else close round it."""
        order = Order(waypoint)
        report = self.node.report
        if report is None:
            return order
        order.start = (report.lat_deg, report.lon_deg)
        here = order.start
        if waypoint.lead_lat_deg is not None and waypoint.lead_lon_deg is not None:
            order.leading = _distance_m(*here, waypoint.lead_lat_deg, waypoint.lead_lon_deg) > FLOWN_STRAIGHT_M
        if not order.leading and _distance_m(*here, waypoint.lat_deg, waypoint.lon_deg) <= FLOWN_STRAIGHT_M:
            order.radius_m = CLOSE_RADIUS_M
        return order

    def begin_stop(self, now: float) -> None:
        """Stop following: STOP is repeated by :meth:`tick` until the vehicle acknowledges."""
        self._order = None
        self.intervention = ""
        self.stop_detail = ""
        if self.phase is Phase.STOPPING:
            return
        status = self.node.status(now)
        if not self.engaged or self.phase is Phase.WAITING:
            ours = self.node.executing(self._settings.plan_id)
            if status.state in (NodeState.IN_PLAN, NodeState.READY, NodeState.ACTIVE) and not ours:
                self.stop_detail = f"was not following us; {status.reason or 'in service'}"
                self._enter(Phase.IDLE, now)
                return
        self._started_unseen = self.phase is Phase.STARTING
        self._abort = False
        self._request_id = self._next_request_id()
        self._request_due = now
        self._enter(Phase.STOPPING, now)
        self.tick(now)

    def clock_jumped(self) -> None:
        """Forget what goes by the vehicle's clock, which was set."""
        self.guard.clear()
        self._plan_since_s = -math.inf

    def escalate_stop(self) -> None:
        """Send Abort beside STOP from now on: the vehicle does not answer."""
        self._abort = True

    def give_up_stop(self, now: float) -> None:
        """Stop waiting for the acknowledgement. STOP is still sent whenever the plan shows up again."""
        if self.phase is Phase.STOPPING:
            self._abandoned = True
            self._enter(Phase.IDLE, now)

    # What the vehicle says

    def plan_control_reply(self, message: Message, now: float) -> None:
        """PlanControl of the vehicle to us."""
        kind = int(message.type)
        if int(message.request_id) != self._request_id or kind not in (
            PLAN_CONTROL_SUCCESS,
            PLAN_CONTROL_FAILURE,
        ):
            return
        info = str(message.info)
        operation = int(message.op)
        if operation == OPERATION_START and kind == PLAN_CONTROL_SUCCESS and "completed" not in info:
            self._plan_since_s = float(message.timestamp)
        if operation == OPERATION_STOP and self.phase is Phase.STOPPING:
            if kind == PLAN_CONTROL_SUCCESS or not self.node.executing(self._settings.plan_id):
                self._stopped(info or "plan stopped", now)
        elif operation == OPERATION_START:
            if kind == PLAN_CONTROL_FAILURE and self.phase is Phase.STARTING:
                self._release(
                    f"plan refused: {info or 'no reason given'}",
                    "Clear what the vehicle complains about, then engage",
                    now,
                )
            elif kind == PLAN_CONTROL_FAILURE and self.phase in (Phase.FOLLOWING, Phase.ENDED):
                self._evidence.failure = info or "no reason given"
                self._plan_ended(now)
            elif kind == PLAN_CONTROL_SUCCESS and "completed" in info and self.phase in (Phase.FOLLOWING, Phase.ENDED):
                self._evidence.completed = True
                self._plan_ended(now)

    def plan_state_changed(self, now: float) -> None:
        """PlanControlState has been taken in by the node."""
        node = self.node
        if node.plan_state_time_s < self._plan_since_s:
            # It waited in some queue while our plan was loaded, and tells of the time before.
            return
        ours = node.executing(self._settings.plan_id)
        if self.phase is Phase.STARTING and node.plan_state == PlanState.EXECUTING and ours:
            self._running(now)
        elif self.phase is Phase.FOLLOWING and not ours:
            self._evidence.blocked = node.plan_state == PlanState.BLOCKED
            self._plan_ended(now)
        elif self.phase is Phase.ENDED:
            self._evidence.blocked |= node.plan_state == PlanState.BLOCKED
            if ours and self._evidence == Evidence():
                # A plan state that overtook or was delayed: the plan runs on.
                self._enter(Phase.FOLLOWING, now)
        elif self.phase is Phase.STOPPING and not ours and not self._started_unseen:
            self._stopped("its plan has ended", now)

    def vehicle_state_changed(self, now: float) -> None:
        """VehicleState has been taken in by the node."""
        if self.node.operation_mode == OperationMode.ERROR and self.phase in (Phase.FOLLOWING, Phase.ENDED):
            self._evidence.error = self.node.error_text
        elif self.node.operation_mode == OperationMode.BOOT:
            self.rebooted(now)

    def follow_state(self, message: Message, now: float) -> None:
        """FollowRefState: the echo of a reference is its acknowledgement."""
        self.node.controller = int(message.control_src)
        if self.node.foreign_controller is not None and self.phase in (Phase.FOLLOWING, Phase.ENDED):
            # Its plan goes by our name, but it takes no reference of ours.
            self._evidence.taken_by = self.node.controller
            self._plan_ended(now)
        if int(message.control_src) != self._settings.imc_id:
            return
        if int(message.state) == STATE_TIMEOUT:
            if self.phase is Phase.FOLLOWING:
                self._evidence.timed_out = True
                self._plan_ended(now)
            return
        if self.phase is Phase.STARTING:
            self._running(now)
        if self.phase is not Phase.FOLLOWING or message.reference is None:
            return
        order = self._order
        if order is None:
            if self._hold is not None and self._hold.echoed_by(message.reference):
                self._answered(now)
        elif any(sent.echoed_by(message.reference) for sent in order.sent):
            self._answered(now)
            self._note_circling(order, int(message.state), now)
            if order.status is WaypointStatus.SENT:
                self._advance(order, WaypointStatus.ACKNOWLEDGED, order.limited)
                if self.node.report is not None:
                    self.moved(self.node.report, now)

    def _note_circling(self, order: Order, state: int, now: float) -> None:
        if state == STATE_HOVER:
            order.circling_limit_m = NEAR_TOLERANCE_M
        elif state == STATE_LOITER:
            order.circling_limit_m = self._settings.loiter_radius_m + CIRCLING_MARGIN_M
        else:
            order.circling_since = None
            return
        if order.circling_since is None:
            order.circling_since = now

    def moved(self, report: StateReport, now: float) -> None:
        """EstimatedState has been taken in: judge arrival by it.

        DUNE leaves off flying to a waypoint some 7 m before it and circles; one closer than 15 m it circles at
        once, and at the surface it drifts there with its motor off. A vehicle that has been doing so for a while
        does not come closer, so it has arrived, and the reason says how near.
        """
        order = self._order
        if self.phase is not Phase.FOLLOWING or order is None or order.status is not WaypointStatus.ACKNOWLEDGED:
            return
        waypoint = order.waypoint
        distance = _distance_m(report.lat_deg, report.lon_deg, waypoint.lat_deg, waypoint.lon_deg)
        if order.unseen and distance <= max(waypoint.arrival_radius_m, NEAR_TOLERANCE_M):
            came_up = f"came up {distance:.0f} m from it after it was out of reach under water"
            self._advance(order, WaypointStatus.REACHED, "; ".join(filter(None, (came_up, order.limited))))
            return
        asked_depth = order.sent[-1].depth_m
        if abs(report.depth_m - asked_depth) > self._settings.depth_tolerance_m:
            return
        if distance <= waypoint.arrival_radius_m:
            self._advance(order, WaypointStatus.REACHED, order.limited)
        elif order.leading:
            self._look_whether_passed(order, report, distance, now)
        elif (
            order.circling_since is not None
            and now - order.circling_since >= CIRCLING_DWELL_S
            and distance <= order.circling_limit_m
        ):
            as_near = f"as near as the vehicle comes: circles {distance:.0f} m from it"
            self._advance(order, WaypointStatus.REACHED, "; ".join(filter(None, (as_near, order.limited))))

    def _look_whether_passed(self, order: Order, report: StateReport, distance: float, now: float) -> None:
        waypoint = order.waypoint
        if order.start is None:
            return
        leg_north, leg_east = _offset_m(*order.start, waypoint.lat_deg, waypoint.lon_deg)
        north, east = _offset_m(waypoint.lat_deg, waypoint.lon_deg, report.lat_deg, report.lon_deg)
        if north * leg_north + east * leg_east < 0.0:
            return
        if distance <= PASSED_WITHIN_M:
            aside = f"passed at {distance:.0f} m"
            self._advance(order, WaypointStatus.REACHED, "; ".join(filter(None, (aside, order.limited))))
        else:
            order.leading = False
            order.radius_m = CLOSE_RADIUS_M if distance <= FLOWN_STRAIGHT_M else 0.0
            self._reference_due = now

    def foreign_abort(self, source: int, now: float) -> None:
        """Another console's Abort, relayed by the vehicle."""
        if self.phase in (Phase.FOLLOWING, Phase.ENDED, Phase.STARTING):
            self._evidence.aborted_by = source
            self._plan_ended(now)

    def foreign_plan_control(self, source: int, operation: int) -> None:
        """Another console's request to plan control, relayed by the vehicle.

        Whether it had an effect is told by the plan's state.
        """
        if self.phase in (Phase.FOLLOWING, Phase.ENDED) and operation in (OPERATION_START, OPERATION_STOP):
            self._evidence.stopped_by = source

    def rebooted(self, now: float) -> None:
        """DUNE has restarted: the plan is gone."""
        if self.phase in (Phase.FOLLOWING, Phase.STARTING, Phase.ENDED):
            self._evidence.rebooted = True
            self._plan_ended(now)

    # The passing of time

    def tick(self, now: float) -> None:
        """Send and judge whatever is due."""
        match self.phase:
            case Phase.WAITING:
                self._tick_waiting(now)
            case Phase.STARTING:
                self._tick_starting(now)
            case Phase.FOLLOWING:
                self._tick_following(now)
            case Phase.ENDED:
                if now - self._since >= EVIDENCE_S:
                    self._judge_end(now)
            case Phase.STOPPING:
                self._tick_stopping(now)
            case Phase.IDLE:
                self._tick_idle(now)

    def _tick_waiting(self, now: float) -> None:
        node, settings = self.node, self._settings
        if node.can_start(now):
            self._request_id = self._next_request_id()
            self._request_due = now
            self._evidence = Evidence()
            self._enter(Phase.STARTING, now)
            self._tick_starting(now)
            return
        status = node.status(now)
        if status.state is NodeState.IN_PLAN and not self._ours_or_none():
            self._release(status.reason, "Stop that plan on its console, then engage again", now, wanted=True)
        elif now - self._since > self._waiting_limit_s():
            reason = status.reason or "does not report being in service and ready"
            self._release(f"not ready within {now - self._since:.0f} s: {reason}", "Clear that, then engage again", now)
        elif node.executing(settings.plan_id) and now >= self._request_due:
            # Our plan of an earlier run: its references have ceased, so it is ended before a new one starts.
            self._request_due = now + ABANDONED_STOP_RETRY_S
            self._send(plan_control(OPERATION_STOP, self._next_request_id(), settings))

    def _waiting_limit_s(self) -> float:
        """How long to wait for service: longer for one that was following, which may have to come up first."""
        if not self._again:
            return self._settings.engage_timeout_s
        return max(self._settings.release_after_s, self.node.patience_s if self.node.references_needed else 0.0)

    def _tick_starting(self, now: float) -> None:
        if now - self._since > self._settings.start_timeout_s:
            self._release(
                f"no answer to the plan within {self._settings.start_timeout_s:g} s",
                "Check that it hears us with `bathyfleet doctor`",
                now,
            )
        elif now >= self._request_due:
            self._request_due = now + START_RETRY_S
            self._send(plan_control(OPERATION_START, self._request_id, self._settings))

    def _tick_following(self, now: float) -> None:
        settings = self._settings
        heard_at = self.node.heard_at
        silence = math.inf if heard_at is None else now - heard_at
        if silence > STARVED_S and self.node.submerged:
            self._note_gap()
        if silence > max(self.node.patience_s, settings.lost_after_wall_s * settings.time_scale):
            self._release(
                f"silent for {silence / settings.time_scale:.0f} s: its plan has ended by itself",
                "Engage it again when it is heard",
                now,
            )
            return
        reference = self._reference(now)
        if reference is None:
            return
        raised = self._last_sent is not None and self._last_sent.depth_m - reference.depth_m > GUARD_STEP_M
        if now >= self._reference_due or raised:
            self._send_reference(reference, now)
        if (
            self._unanswered >= MIN_UNANSWERED
            and now - self._answered_at > settings.answer_timeout_s
            and silence <= ALIVE_S
        ):
            self._evidence.unanswered = True
            self._plan_ended(now)
        if now - self._following_since > settings.restart_forgiven_after_s:
            self._restarts = 0

    def _note_gap(self) -> None:
        """The radio ended under water, so its plan ends for want of references, which is nobody's fault."""
        if not self._gap:
            self.node.radio_gaps += 1
        self._gap = True
        if self._order is not None and self._order.status is WaypointStatus.ACKNOWLEDGED:
            self._order.unseen = True

    def _tick_stopping(self, now: float) -> None:
        if now >= self._request_due:
            self._request_due = now + STOP_RETRY_S
            self._send(plan_control(OPERATION_STOP, self._request_id, self._settings))
            if self._abort:
                self._send(imcpy.Abort())

    def _tick_idle(self, now: float) -> None:
        # A vehicle that came back still following after its stop went unanswered must not be left so.
        if self._abandoned and self.node.executing(self._settings.plan_id) and now >= self._request_due:
            self._request_due = now + ABANDONED_STOP_RETRY_S
            self._request_id = self._next_request_id()
            self._send(plan_control(OPERATION_STOP, self._request_id, self._settings))

    def excuse(self, seconds: float, now: float) -> None:
        """Take out of every wait the time in which we were held up ourselves and could hear nothing."""
        self._since = min(self._since + seconds, now)
        self._answered_at = min(self._answered_at + seconds, now)
        self._following_since = min(self._following_since + seconds, now)

    # References

    def _reference(self, now: float) -> SentReference | None:
        order = self._order
        report = self.node.report
        if order is None:
            # Until the first waypoint comes: stay here, at the surface.
            if self._hold is None and report is not None:
                self._hold = SentReference(
                    math.radians(report.lat_deg), math.radians(report.lon_deg), 0.0, HOLD_SPEED_MPS
                )
            return self._hold
        waypoint = order.waypoint
        depth, order.limited = waypoint.depth_m, ""
        if order.unseen and order.status is WaypointStatus.REACHED:
            # It waits for the next order where that can reach it.
            depth = 0.0
        if report is not None:
            limit = self.guard.limit(
                depth,
                waypoint.min_altitude_m,
                report.time_s,
                report.lat_deg,
                report.lon_deg,
                now=now,
                towards=_way(order),
                mapped=waypoint.bottom,
            )
            depth, order.limited = limit.depth_m, limit.reason
        if order.limited and order.sent and 0.0 <= depth - order.sent[-1].depth_m < GUARD_STEP_M:
            depth = order.sent[-1].depth_m
        lat_deg, lon_deg = waypoint.lat_deg, waypoint.lon_deg
        if order.leading and waypoint.lead_lat_deg is not None and waypoint.lead_lon_deg is not None:
            lat_deg, lon_deg = waypoint.lead_lat_deg, waypoint.lead_lon_deg
        return SentReference(math.radians(lat_deg), math.radians(lon_deg), depth, waypoint.speed_mps, order.radius_m)

    def _send_reference(self, reference: SentReference, now: float) -> None:
        self._reference_due = now + self._settings.reference_period_s
        self._last_sent = reference
        self._unanswered += 1
        self._send(reference.message())
        order = self._order
        if order is not None:
            if not order.sent or order.sent[-1] != reference:
                order.sent.append(reference)
            if order.status is None:
                self._advance(order, WaypointStatus.SENT, order.limited)

    def _answered(self, now: float) -> None:
        self._answered_at = now
        self._unanswered = 0

    def _advance(self, order: Order, status: WaypointStatus, reason: str = "") -> None:
        order.status = status
        self._emit(WaypointChange(self.node.name, order.waypoint, status, reason))

    # Beginnings and ends

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase = phase
        self._since = now

    def _next_request_id(self) -> int:
        return next(self._request_ids) & 0xFFFF

    def _running(self, now: float) -> None:
        self._enter(Phase.FOLLOWING, now)
        self._following_since = now
        self._evidence = Evidence()
        self._reference_due = now
        self._answered_at = now
        self._unanswered = 0
        self._last_sent = None
        self._hold = None
        self._tick_following(now)

    def _stopped(self, detail: str, now: float) -> None:
        self.stop_detail = detail + (" after an abort" if self._abort else "")
        self._enter(Phase.IDLE, now)

    def _plan_ended(self, now: float) -> None:
        if self.phase is not Phase.ENDED:
            self._enter(Phase.ENDED, now)

    def _judge_end(self, now: float) -> None:
        seen, node = self._evidence, self.node
        if node.plan_state == PlanState.EXECUTING and node.plan_id not in ("", self._settings.plan_id):
            self._release(
                f"another console took over with plan {node.plan_id!r}",
                "Engage it again when that is done",
                now,
                wanted=True,
            )
        elif seen.taken_by is not None:
            self._release(
                f"console 0x{seen.taken_by:04X} took over with a plan of the same name",
                "Engage it again when that is done; two consoles need different plan ids",
                now,
                wanted=True,
            )
        elif seen.rebooted:
            self._restart("the vehicle has rebooted", now)
        elif seen.aborted_by is not None:
            self._let_go(f"aborted by console 0x{seen.aborted_by:04X}", now)
        elif self._starved():
            self._restart("references did not reach it in time", now)
        elif seen.error is not None or seen.blocked:
            self._let_go(f"aborted elsewhere or by itself: {self._error_text()}", now)
        elif seen.stopped_by is not None:
            self._let_go(f"stopped by console 0x{seen.stopped_by:04X}", now)
        elif seen.completed:
            self._let_go("its plan was completed by another console", now)
        elif seen.timed_out:
            self._restart("references did not reach it in time", now)
        elif seen.unanswered:
            self._restart("it does not answer our references", now)
        else:
            self._restart(seen.failure or "its plan ended without a reason", now, own=bool(seen.failure))

    def _let_go(self, reason: str, now: float) -> None:
        self._release(reason, "Engage it again when that is cleared", now, wanted=True)

    def _error_text(self) -> str:
        seen = self._evidence
        return seen.failure or seen.error or self.node.error_text or "no reason given"

    def _starved(self) -> bool:
        """Whether the plan ended for want of references; DUNE calls that an error of its path controller."""
        text = self._error_text().lower()
        if "abort" in text:
            return False
        return STARVED_TEXT in text or self._since - self._answered_at > STARVED_S

    def _restart(self, cause: str, now: float, *, own: bool = False) -> None:
        """Start the plan again, unless it fails again and again; ``own``: by the vehicle's own account."""
        self._again = True
        if self._gap:
            self._gap = False
        else:
            self._restarts += 1
        if self._restarts > self._settings.max_restarts:
            self._release(
                f"plan failed {self._restarts} times, last: {cause}",
                "Look at the vehicle's own log and its link, then engage again",
                now,
                wanted=own,
            )
            return
        self._evidence = Evidence()
        self._request_due = now
        self._enter(Phase.WAITING, now)

    def _release(self, reason: str, remedy: str, now: float, *, wanted: bool = False) -> None:
        """Let the vehicle go.

        ``wanted``: someone else, or the vehicle itself, will have it so, and it is left alone. Otherwise it may be
        engaged again at any time, and is stopped meanwhile wherever it shows up in our plan.
        """
        self.refusal = Refusal(reason, remedy)
        self.intervention = reason if wanted else ""
        self._abandoned = not wanted
        self._enter(Phase.IDLE, now)
        order = self._order
        if order is not None and order.status not in (WaypointStatus.REACHED, WaypointStatus.REFUSED):
            self._advance(order, WaypointStatus.REFUSED, f"{reason}. {remedy}")


def _way(order: Order) -> list[tuple[float, float]]:
    """Where the vehicle flies from where it is: the waypoint, then the lead where it is sent there."""
    waypoint = order.waypoint
    way = [(waypoint.lat_deg, waypoint.lon_deg)]
    if order.leading and waypoint.lead_lat_deg is not None and waypoint.lead_lon_deg is not None:
        way.append((waypoint.lead_lat_deg, waypoint.lead_lon_deg))
    return way


def _distance_m(lat1_deg: float, lon1_deg: float, lat2_deg: float, lon2_deg: float) -> float:
    return math.hypot(*_offset_m(lat1_deg, lon1_deg, lat2_deg, lon2_deg))


def _offset_m(lat1_deg: float, lon1_deg: float, lat2_deg: float, lon2_deg: float) -> tuple[float, float]:
    """North and east from the first place to the second."""
    north, east, _ = WGS84.displacement(
        math.radians(lat1_deg),
        math.radians(lon1_deg),
        0.0,
        math.radians(lat2_deg),
        math.radians(lon2_deg),
        0.0,
    )
    return float(north), float(east)
