"""One vehicle under our control, however it is led: from engaging it to the end of its plan, wanted or not.

A :class:`Control` neither waits nor sleeps. It receives messages and the passing of time, sends through a
callback, and reports through another; the bridge owns sockets and tasks. Times are seconds of the bridge's
clock. :mod:`imc_bridge.control.follow` and :mod:`imc_bridge.control.legs` say how a vehicle is led.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import imcpy

from imc_bridge.control.altitude_guard import AltitudeGuard
from imc_bridge.control.orders import Order
from imc_bridge.control.plan_end import Evidence, judge_ending
from imc_bridge.control.plans import (
    OPERATION_START,
    OPERATION_STOP,
    PLAN_CONTROL_FAILURE,
    PLAN_CONTROL_SUCCESS,
    plan_control,
)
from imc_bridge.control.seabed import Seabed
from imc_bridge.events import NodeState, StateReport, Waypoint, WaypointChange, WaypointStatus
from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.nodes.modes import OperationMode, PlanState
from imc_bridge.nodes.node import NO_POSITION, Node
from imc_bridge.nodes.status import status_of
from imc_bridge.settings import BridgeSettings

STOP_RETRY_S = 0.5
ABANDONED_STOP_RETRY_S = 2.0
EVIDENCE_S = 1.5
"""How long an ended plan is looked into before its cause is judged: an abort shows as ERROR, then BLOCKED."""


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


class Control(ABC):
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

    unheard_stop: str
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
        """Why it was released although in contact, until we stop it: another console or the vehicle decided so."""
        self._since = 0.0
        self._plan_since_s = -math.inf
        """Since when the vehicle has had our plan, by its own clock and word."""
        self._request_id = -1
        self._request_due = 0.0
        self._started_unseen = False
        self._following_since = 0.0
        self._restarts = 0
        self._evidence = Evidence()
        self._abandoned = False
        self._peers_plan = False
        """Whether what it is to be stopped in is a peer's plan."""
        self._abort = False
        self._gap = False
        """Whether radio ended under water, which ends plans that need it and is no fault."""
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
        self._abandoned = False
        status = status_of(self.node, now)
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
        nameless = not self.node.plan_id and self.node.foreign_controller is None
        return nameless or self._runs_ours()

    def _runs_ours(self) -> bool:
        """Whether what it executes is ours to end: our plan, the way home, a peer's whose vehicle we have now."""
        return self.node.ours or self.node.home_bound or self.node.runs_peers_plan

    def order(self, waypoint: Waypoint, now: float) -> None:
        """Replace the current waypoint. Repeating one is harmless unless it had been refused."""
        current = self._order
        if current is not None and current.waypoint == waypoint and current.status is not WaypointStatus.REFUSED:
            return
        self._order = self._make_order(waypoint)
        self.node.ordered_depth_m = waypoint.depth_m
        self._ordered(now)
        if self.phase is Phase.FOLLOWING:
            self.tick(now)

    def _make_order(self, waypoint: Waypoint) -> Order:
        return Order.made(waypoint, self.node.report)

    def _ordered(self, now: float) -> None:  # noqa: B027 - not every way of leading has something to do then
        """There is a new waypoint."""

    def begin_stop(self, now: float) -> None:
        """Stop following: STOP is repeated by :meth:`tick` until the vehicle acknowledges."""
        self._order = None
        self.intervention = ""
        self.stop_detail = ""
        if self.phase is Phase.STOPPING:
            return
        status = status_of(self.node, now)
        if self.phase not in (Phase.STARTING, Phase.FOLLOWING):
            idle = () if self.phase is Phase.ENDED else (NodeState.READY, NodeState.ACTIVE)
            if status.state in (NodeState.IN_PLAN, *idle) and not self._runs_ours():
                self.stop_detail = f"was not following us; {status.reason or 'in service'}"
                self._enter(Phase.IDLE, now)
                return
        self._started_unseen = self.phase is Phase.STARTING
        self._abort = False
        self._request_id = self._next_request_id()
        self._request_due = now
        self._enter(Phase.STOPPING, now)
        self.tick(now)

    def escalate_stop(self) -> None:
        """Send Abort beside STOP from now on: the vehicle does not answer."""
        self._abort = True

    def _abort_now(self, now: float) -> None:
        if not self._abort:
            self._abort = True
            self._request_due = now
            self._tick_stopping(now)

    def give_up_stop(self, now: float) -> None:
        """Stop waiting for the acknowledgement. STOP is still sent whenever the plan shows up again."""
        if self.phase is Phase.STOPPING:
            self._abandon()
            self._enter(Phase.IDLE, now)

    def _abandon(self) -> None:
        """Have the vehicle stopped wherever it shows up in the plan that it has: ours, or a peer's that it had."""
        self._abandoned, self._peers_plan = True, self.node.runs_peers_plan

    # What the vehicle says

    def plan_control_reply(self, message: Message, now: float) -> None:
        """PlanControl of the vehicle to us: whether it has stopped."""
        kind = int(message.type)
        if (
            self.phase is not Phase.STOPPING
            or int(message.op) != OPERATION_STOP
            or int(message.request_id) != self._request_id
        ):
            return
        if kind == PLAN_CONTROL_FAILURE and self.node.maneuvering_blocked:
            # It says that no plan runs, and goes on with its maneuver: only an abort ends that.
            self._abort_now(now)
        elif kind == PLAN_CONTROL_SUCCESS or (kind == PLAN_CONTROL_FAILURE and not self._runs_ours()):
            self._stopped(text(message, "info") or "plan stopped", now)

    def plan_state_changed(self, now: float) -> None:
        """PlanControlState has been taken in by the node."""
        if self.phase is Phase.ENDED:
            self._evidence.blocked |= self.node.plan_state == PlanState.BLOCKED and not self.node.maneuvering_blocked
        elif self.phase is Phase.STOPPING and not self._runs_ours() and not self._started_unseen:
            if self.node.maneuvering_blocked:
                self._abort_now(now)
            else:
                self._stopped("its plan has ended", now)

    def _outdated(self) -> bool:
        """Whether the last PlanControlState was queued while our plan was loaded and describes the time before."""
        return self.node.plan_state_time_s < self._plan_since_s

    def vehicle_state_changed(self, now: float) -> None:
        """VehicleState has been taken in by the node."""
        if self.node.operation_mode == OperationMode.ERROR and self.phase in (Phase.FOLLOWING, Phase.ENDED):
            self._evidence.error = self.node.error_text
        elif self.node.operation_mode == OperationMode.BOOT:
            self.rebooted(now)

    @abstractmethod
    def follow_state(self, message: Message, now: float) -> None:
        """Take FollowRefState in."""

    @abstractmethod
    def moved(self, report: StateReport, now: float) -> None:
        """EstimatedState has been taken in: judge arrival by it."""

    def foreign_abort(self, source: int, now: float) -> None:
        """Another console's Abort, relayed by the vehicle."""
        if self.phase in (Phase.FOLLOWING, Phase.ENDED, Phase.STARTING):
            self._evidence.aborted_by = source
            self._plan_ended(now)

    def foreign_plan_control(self, source: int, operation: int) -> None:
        """Another console's request to plan control, relayed by the vehicle.

        Whether it had an effect shows in the plan's state.
        """
        if self.phase in (Phase.FOLLOWING, Phase.ENDED) and operation in (OPERATION_START, OPERATION_STOP):
            self._evidence.stopped_by = source

    def rebooted(self, now: float) -> None:
        """DUNE has restarted: the plan is gone."""
        if self.phase in (Phase.FOLLOWING, Phase.STARTING, Phase.ENDED):
            self._evidence.rebooted = True
            self._plan_ended(now)

    def clock_jumped(self) -> None:
        """Forget what goes by the vehicle's clock, which was set."""
        self.guard.clear()
        self._plan_since_s = -math.inf

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

    @abstractmethod
    def _begin(self, now: float) -> None:
        """The vehicle is in service and ready: make it ours."""

    @abstractmethod
    def _tick_starting(self, now: float) -> None:
        """Send and judge whatever is due until our plan runs."""

    @abstractmethod
    def _tick_following(self, now: float) -> None:
        """Send and judge whatever is due while it is ours."""

    def _tick_waiting(self, now: float) -> None:
        node, settings = self.node, self._settings
        if node.can_start(now):
            self._evidence = Evidence()
            self._begin(now)
            return
        status = status_of(node, now)
        if status.state is NodeState.IN_PLAN and not self._ours_or_none():
            self._release(status.reason, "Stop that plan on its console, then engage again", now, wanted=True)
        elif now - self._since > self._waiting_limit_s():
            unready = (
                NO_POSITION
                if node.report is None or node.without_position
                else "does not report being in service and ready"
            )
            reason = status.reason or unready
            self._release(f"not ready within {now - self._since:.0f} s: {reason}", "Clear that, then engage again", now)
        elif now >= self._request_due and (
            self._runs_ours() or (node.without_position and self._blocked_in_our_plan())
        ):
            # The way home, or our plan of an earlier run, whose references have ceased: it is ended before a new one
            # starts. So is the plan of one that does not tell where it is.
            self._request_due = now + ABANDONED_STOP_RETRY_S
            self._send(plan_control(OPERATION_STOP, self._next_request_id(), settings))
            if not self._runs_ours():
                self._send(imcpy.Abort())

    def _waiting_limit_s(self) -> float:
        """How long to wait for service: longer for one that was following, which may have to come up first."""
        if not self._again:
            return self._settings.engage_timeout_s
        return max(self._settings.release_after_s, self.node.patience_s if self.node.references_needed else 0.0)

    def _tick_stopping(self, now: float) -> None:
        if now >= self._request_due:
            self._request_due = now + STOP_RETRY_S
            self._send(plan_control(OPERATION_STOP, self._request_id, self._settings))
            if self._abort:
                self._send(imcpy.Abort())

    def _blocked_in_our_plan(self) -> bool:
        """Whether it goes on with our plan and says that none runs: it takes no STOP, and takes an Abort."""
        return self.node.maneuvering_blocked and self.node.plan_id == self._settings.plan_id

    def _tick_idle(self, now: float) -> None:
        # A vehicle that came back still following after its stop went unanswered must not be left so.
        node = self.node
        # One that was seen without it may be in a mission of that peer by now.
        self._peers_plan = self._peers_plan and node.runs_peers_plan
        blocked = self._blocked_in_our_plan()
        if self._abandoned and (blocked or node.ours or self._peers_plan) and now >= self._request_due:
            self._request_due = now + ABANDONED_STOP_RETRY_S
            self._request_id = self._next_request_id()
            self._send(plan_control(OPERATION_STOP, self._request_id, self._settings))
            if blocked:
                self._send(imcpy.Abort())

    def _without_position_too_long(self, patience_s: float, now: float) -> bool:
        """Let go of a vehicle that has not told where it is for so long, though it is heard."""
        without_position_s = self.node.without_position_s
        if without_position_s <= max(patience_s, self._settings.lost_after_wall_s * self._settings.time_scale):
            return False
        words = f"heard, and has told no position for {without_position_s / self._settings.time_scale:.0f} s"
        self._release(words, "Look at its navigation; engage it again when it tells where it is", now)
        return True

    def excuse(self, seconds: float, now: float) -> None:
        """Subtract from every wait the time in which this process was held up and received nothing."""
        self._since = min(self._since + seconds, now)
        self._following_since = min(self._following_since + seconds, now)

    # Beginnings and ends

    def _advance(self, order: Order, status: WaypointStatus, reason: str = "") -> None:
        order.status = status
        self._emit(WaypointChange(self.node.name, order.waypoint, status, reason))

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase = phase
        self._since = now

    def _next_request_id(self) -> int:
        return next(self._request_ids) & 0xFFFF

    def _stopped(self, detail: str, now: float) -> None:
        self.stop_detail = detail + (" after an abort" if self._abort else "")
        self._enter(Phase.IDLE, now)

    def _plan_ended(self, now: float) -> None:
        if self.phase is not Phase.ENDED:
            self._enter(Phase.ENDED, now)

    def _judge_end(self, now: float) -> None:
        ending = judge_ending(self._evidence, self.node, starved=self._starved())
        if ending.remedy:
            self._release(ending.reason, ending.remedy, now, wanted=True)
        else:
            self._restart(ending.reason, now, own=ending.own)

    def _starved(self) -> bool:
        """Whether our plan ended because nothing of ours can have reached the vehicle."""
        return False

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
        self._abandoned = False
        if not wanted:
            self._abandon()
        self._enter(Phase.IDLE, now)
        order = self._order
        if order is not None and order.status not in (WaypointStatus.REACHED, WaypointStatus.REFUSED):
            self._advance(order, WaypointStatus.REFUSED, f"{reason}. {remedy}")
