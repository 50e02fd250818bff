"""A vehicle led by references: the life of a FollowReference plan and of the waypoints given to it."""

from __future__ import annotations

import math

from imc_bridge.control.control import Control, Phase
from imc_bridge.control.plan_end import Evidence
from imc_bridge.control.plans import (
    OPERATION_START,
    PLAN_CONTROL_FAILURE,
    PLAN_CONTROL_SUCCESS,
    START_RETRY_S,
    plan_control,
)
from imc_bridge.control.references import SentReference
from imc_bridge.events import StateReport, WaypointStatus
from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.nodes.modes import PlanState
from imc_bridge.nodes.node import NO_POSITION

BLOCKED_S = 1.0
"""A plan that is blocked for longer, while its maneuver goes on, is started again."""
STARVED_S = 4.0
"""A plan that ended this long after the last echo ended for want of references."""
GUARD_STEP_M = 0.2
"""A guarded depth that changes by less than this is not worth a new reference of its own."""
MIN_UNANSWERED = 5
ALIVE_S = 3.0
"""A vehicle whose packets are this recent receives ours, too, unless something is wrong."""
STATE_TIMEOUT = 6
HOLD_SPEED_MPS = 1.0


class Follower(Control):
    """Leads one vehicle by a reference a second; see :class:`imc_bridge.control.control.Control` for the parameters."""

    unheard_stop = "references have ceased, so its plan ends by itself"

    _hold: SentReference | None = None
    """Where it stays at the surface: until the first waypoint comes, and while it does not tell where it is."""
    _reference_due = 0.0
    _last_sent: SentReference | None = None
    _answered_at = 0.0
    _echoed_s = -math.inf
    """When it sent its newest echo, by the vehicle's clock: a timeout from before is over."""
    _unanswered = 0
    _gap_boots = 0
    _gap_open = False
    """Whether it fell silent under water and still is."""
    _blocked_since: float | None = None
    """Since when plan control has called itself blocked while the maneuver goes on."""

    def engage(self, now: float) -> bool:
        """Begin to make the vehicle follow."""
        self._hold = None
        return super().engage(now)

    def _ordered(self, now: float) -> None:
        self._reference_due = now
        self._hold = None
        if self.phase is Phase.FOLLOWING:
            self._answered(now)

    # What the vehicle says

    def plan_control_reply(self, message: Message, now: float) -> None:
        """PlanControl of the vehicle to us."""
        kind, info = int(message.type), text(message, "info")
        if int(message.op) != OPERATION_START:
            super().plan_control_reply(message, now)
            return
        if int(message.request_id) != self._request_id or kind not in (PLAN_CONTROL_SUCCESS, PLAN_CONTROL_FAILURE):
            return
        if kind == PLAN_CONTROL_SUCCESS and "completed" not in info:
            self._plan_since_s = float(message.timestamp)
        elif kind == PLAN_CONTROL_FAILURE and self.phase is Phase.STARTING:
            self._release(
                f"plan refused: {info or 'no reason given'}", "Clear what the vehicle complains about, then engage", now
            )
        elif self.phase in (Phase.FOLLOWING, Phase.ENDED):
            if kind == PLAN_CONTROL_FAILURE:
                self._evidence.failure = info or "no reason given"
            else:
                self._evidence.completed = True
            self._plan_ended(now)

    def plan_state_changed(self, now: float) -> None:
        """PlanControlState has been taken in by the node."""
        if self._outdated():
            return
        if self._gap_open:
            self._gap_open = False
            # A vehicle whose DUNE died was not silent for want of radio.
            self.node.radio_gaps += self.node.boots == self._gap_boots
        node = self.node
        ours = node.ours
        if self.phase is Phase.STARTING and node.plan_state == PlanState.EXECUTING and ours:
            self._running(now)
        elif self.phase is Phase.FOLLOWING and self._blocked_in_our_plan():
            self._blocked_since = now if self._blocked_since is None else self._blocked_since
        elif self.phase is Phase.FOLLOWING and not ours:
            self._evidence.blocked = node.plan_state == PlanState.BLOCKED
            self._plan_ended(now)
        elif self.phase is Phase.FOLLOWING:
            self._blocked_since = None
        elif self.phase is Phase.ENDED and ours and self._evidence == Evidence():
            # A plan state that overtook or was delayed: the plan runs on.
            self._enter(Phase.FOLLOWING, now)
        else:
            super().plan_state_changed(now)

    def follow_state(self, message: Message, now: float) -> None:
        """FollowRefState: the echo of a reference is its acknowledgement."""
        self.node.controller = int(message.control_src)
        if self.node.foreign_controller is not None and self.phase in (Phase.FOLLOWING, Phase.ENDED):
            # Its plan goes by our name, but it takes no reference of ours.
            self._evidence.taken_by = self.node.controller
            self._plan_ended(now)
        if int(message.control_src) != self._settings.id:
            return
        time_s = float(message.timestamp)
        if int(message.state) == STATE_TIMEOUT:
            if self.phase is Phase.FOLLOWING and time_s >= max(self._plan_since_s, self._echoed_s):
                self._evidence.timed_out = True
                self._plan_ended(now)
            return
        self._echoed_s = max(self._echoed_s, time_s)
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
            order.note_circling(int(message.state), self._settings.loiter_radius_m, now)
            if order.status is WaypointStatus.SENT:
                self._advance(order, WaypointStatus.ACKNOWLEDGED, order.limited)
                if self.node.report is not None:
                    self.moved(self.node.report, now)

    def moved(self, report: StateReport, now: float) -> None:
        """EstimatedState has been taken in: judge arrival by it."""
        order = self._order
        if self.phase is not Phase.FOLLOWING or order is None or order.status is not WaypointStatus.ACKNOWLEDGED:
            return
        if self._hold is not None:
            return  # It is held at the surface, perhaps over its waypoint, and was not told to go on yet.
        way = order.arrival(report, self._settings.depth_tolerance_m, now)
        if way is not None:
            self._advance(order, WaypointStatus.REACHED, "; ".join(filter(None, (way, order.limited))))
        elif order.missed(report, self._settings.depth_tolerance_m):
            order.turn_back(report)
            self._reference_due = now

    def clock_jumped(self) -> None:
        """Forget what goes by the vehicle's clock, which was set."""
        super().clock_jumped()
        self._echoed_s = -math.inf

    # The passing of time

    def _begin(self, now: float) -> None:
        self._request_id = self._next_request_id()
        self._request_due = now
        self._enter(Phase.STARTING, now)
        self._tick_starting(now)

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

    def _running(self, now: float) -> None:
        self._enter(Phase.FOLLOWING, now)
        self._following_since = now
        self._evidence = Evidence()
        self._reference_due = now
        self._answered_at = now
        self._unanswered = 0
        self._last_sent = None
        self._hold = None
        self._blocked_since = None
        self._tick_following(now)

    def _tick_following(self, now: float) -> None:
        settings = self._settings
        heard_at = self.node.heard_at
        silence = math.inf if heard_at is None else now - heard_at
        if silence > STARVED_S and self.node.submerged:
            self._note_gap(long=silence > self.node.lost_after_s)
        if silence > max(self.node.patience_s, settings.lost_after_wall_s * settings.time_scale):
            self._release(
                f"silent for {silence / settings.time_scale:.0f} s: its plan has ended by itself",
                "Engage it again when it is heard",
                now,
            )
            return
        if self._without_position_too_long(self.node.patience_s, now):
            return
        if self._blocked_since is not None and now - self._blocked_since > BLOCKED_S and now >= self._request_due:
            # The maneuver goes on; a plan of its own brings plan control back to it.
            self._request_due = now + START_RETRY_S
            self._request_id = self._next_request_id()
            self._send(plan_control(OPERATION_START, self._request_id, settings))
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

    def _note_gap(self, *, long: bool) -> None:
        """The radio ended under water, so its plan ends for want of references, which is no fault."""
        if long and not self._gap_open:
            self._gap_open, self._gap_boots = True, self.node.boots
        self._gap = True
        if self._order is not None and self._order.status is WaypointStatus.ACKNOWLEDGED:
            self._order.unseen = True

    def excuse(self, seconds: float, now: float) -> None:
        """Subtract from every wait the time in which this process was held up and received nothing."""
        super().excuse(seconds, now)
        self._answered_at = min(self._answered_at + seconds, now)

    # References

    def _reference(self, now: float) -> SentReference | None:
        order = self._order
        report = self.node.report
        if order is None:
            return self._hold_at_surface()
        if self.node.without_position:
            # Nobody knows the bottom below it. At the surface it receives GPS.
            order.limited, order.circling_since = f"held at the surface: it {NO_POSITION}", None
            return self._hold_at_surface()
        self._hold = None
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
                towards=order.way,
                mapped=waypoint.bottom,
            )
            depth, order.limited = limit.depth_m, limit.reason
        if order.limited and order.sent and 0.0 <= depth - order.sent[-1].depth_m < GUARD_STEP_M:
            depth = order.sent[-1].depth_m
        lat_deg, lon_deg = order.way[-1]
        # At the surface DUNE drifts, motor off, from where it is within its tolerance and the radius on: no circles.
        radius_m = order.radius_m if depth > 0.0 else 0.0
        return SentReference(math.radians(lat_deg), math.radians(lon_deg), depth, waypoint.speed_mps, radius_m)

    def _hold_at_surface(self) -> SentReference | None:
        """Where it told to be last, at the surface; the same place until it goes on."""
        report = self.node.report
        if self._hold is None and report is not None:
            self._hold = SentReference(math.radians(report.lat_deg), math.radians(report.lon_deg), 0.0, HOLD_SPEED_MPS)
        return self._hold

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

    def _starved(self) -> bool:
        """Whether echoes were missing long enough before the plan ended to prove that no references reached it."""
        return self._since - self._answered_at > STARVED_S
