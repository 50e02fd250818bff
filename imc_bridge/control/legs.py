"""One vehicle that is sent a whole leg at a time, for links that end at the surface.

Each waypoint becomes a plan: down where the way is too short for the depth, there, then up to the surface. Nothing is
started while the vehicle is silent or under water. Once it has acknowledged a plan, silence is expected until the leg
should be over; its outcome shows when the vehicle is in contact again. Between legs it has no plan and floats.
Everything else, engaging, stopping and what ended a plan, is the :class:`Control`'s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from imc_bridge.control.acoustics import SoundPath, SoundReport
from imc_bridge.control.control import Control, Phase
from imc_bridge.control.orders import Order
from imc_bridge.control.plans import (
    NEARNESS_S,
    OPERATION_START,
    OPERATION_STOP,
    PLAN_CONTROL_FAILURE,
    PLAN_CONTROL_SUCCESS,
    START_RETRY_S,
    descent_m,
    goto_maneuver,
    leg_plan,
    leg_time_s,
    plan_control,
)
from imc_bridge.distances import Place, distance_m
from imc_bridge.events import StateReport, Waypoint, WaypointStatus
from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.nodes.modes import PlanState
from imc_bridge.nodes.node import NO_POSITION

END_WITHIN_M = 25.0
"""A leg that ended farther from its waypoint did not lead there: Goto ends some 7 m before, and the vehicle floats."""
OUTCOME_FAILURE = 2
RADIO_SILENT_S = 3.0
"""After this long without a packet sound is tried."""
RADIO_SILENT_WALL_S = 0.5
"""The same in seconds of this machine, where that is longer."""
SOUND_START_TIMEOUT_S = 90.0
START_TIMEOUT_WALLS = 3.0
"""In units of the silence on the wall clock that is never a loss, however fast the vehicles live."""
REPORT_KEEPS_S = 90.0
"""A vehicle that reported by sound is expected for at least this much longer."""
HEARD_LATELY_S = 2.0
"""Nothing is started while the last packet is older; the bridge counts at least half of ``lost_after_wall_s``."""
HEARD_UNDER_WATER_S = 10.0
"""Contact under water for this long means that radio reaches it: DUNE's simulation checks only every few seconds."""
DEPTH_TOLERANCE_M = 0.5


@dataclass(slots=True)
class Leg:
    """A waypoint under way as a plan."""

    depth_m: float
    expected_s: float
    descend: bool
    """Whether it circles down first."""
    aim: Place
    steep: str = ""
    """Why its depth is not reached for certain, empty when it is."""
    acknowledged: bool = False
    ended: bool = False
    sent_at: float = 0.0
    """Since when an answer has been awaited while in contact."""
    deepest_m: float = 0.0
    """As far as its reports were received."""


class LegFollower(Control):
    """The control of one vehicle by whole legs; see :class:`imc_bridge.control.control.Control` for the parameters."""

    unheard_stop = "it flies its leg to the end and is told to stop when it is heard"

    sound: SoundPath | None = None
    """The way to it when radio is silent, where it has one."""
    _leg: Leg | None = None
    _wet_since: float | None = None
    """Since when its packets have arrived from under water without a pause."""

    def attach(self, sound: SoundPath, by_radio: Callable[[Message], None], now: Callable[[], float]) -> None:
        """Speak by sound while radio is silent."""
        self.sound = sound

        def send(message: Message) -> None:
            if self._by_sound(now()):
                sound.send(message, now())
            else:
                by_radio(message)

        self._send = send

    def _by_sound(self, now: float) -> bool:
        # Where vehicle time runs fast a moment's pause of this machine is no silence of the radio.
        silent_s = max(RADIO_SILENT_S, RADIO_SILENT_WALL_S * self._settings.time_scale)
        return self.sound is not None and self._silence(now) > silent_s

    def left_by_sound(self, what: str, now: float) -> None:
        """Note that the gateway has sent a message: the reception of a plan is not reported any further."""
        if what == "PlanControl" and self.phase is Phase.FOLLOWING:
            self._acknowledged(now)

    def reported_by_sound(self, report: SoundReport, now: float) -> None:
        """Take a position reported by sound: it shows arrival where radio cannot."""
        self.node.without_position_s = 0.0
        leg, order = self._leg, self._order
        if self.phase is not Phase.FOLLOWING or leg is None or not leg.acknowledged or order is None:
            return
        distance = distance_m((report.lat_deg, report.lon_deg), order.place)
        self.node.expected_back = max(self.node.expected_back or 0.0, now + REPORT_KEEPS_S)
        if distance <= END_WITHIN_M:
            self._leg = None
            words = f"reported by sound {distance:.0f} m from it"
            self._advance(order, WaypointStatus.REACHED, "; ".join(filter(None, (words, order.limited))))

    def engage(self, now: float) -> bool:
        """Take the vehicle over when it is in service; it gets no plan before the first waypoint."""
        engaged = super().engage(now)
        if engaged:
            self._leg, self.node.expected_back = None, None
        return engaged

    def _make_order(self, waypoint: Waypoint) -> Order:
        """Start over: a plan for another waypoint replaces the present one once the vehicle can be reached."""
        self._leg = None
        return super()._make_order(waypoint)

    def begin_stop(self, now: float) -> None:
        """Stop the leg: STOP is repeated until the vehicle acknowledges, and again when it comes back."""
        self._leg = None
        super().begin_stop(now)

    # What the vehicle says

    def plan_control_reply(self, message: Message, now: float) -> None:
        """PlanControl of the vehicle to us."""
        leg = self._leg
        if self.phase is Phase.STOPPING or leg is None or int(message.op) != OPERATION_START:
            if int(message.op) == OPERATION_STOP:
                super().plan_control_reply(message, now)
            return
        if int(message.request_id) != self._request_id:
            return
        kind, info = int(message.type), text(message, "info")
        if kind == PLAN_CONTROL_SUCCESS and "completed" in info:
            self._plan_since_s = float(message.timestamp)
            self._leg_over(now)
        elif kind == PLAN_CONTROL_SUCCESS:
            self._plan_since_s = float(message.timestamp)
            self._acknowledged(now)
        elif kind == PLAN_CONTROL_FAILURE and not leg.acknowledged:
            reason = f"plan refused: {info or 'no reason given'}"
            self._release(reason, "Clear what the vehicle complains about, then engage", now)
        elif kind == PLAN_CONTROL_FAILURE:
            self._evidence.failure = info or "no reason given"
            self._plan_ended(now)

    def plan_state_changed(self, now: float) -> None:
        """PlanControlState has been taken in by the node."""
        leg, node = self._leg, self.node
        if self._outdated():
            return
        if self.phase is not Phase.FOLLOWING:
            super().plan_state_changed(now)
            return
        if leg is None:
            # Between two legs it is idle, unless someone else gave it a plan.
            if node.plan_state == PlanState.EXECUTING and not self._ours_or_none():
                self._plan_ended(now)
            return
        if node.ours:
            if node.plan_state == PlanState.EXECUTING:
                self._acknowledged(now)
        elif node.maneuvering_blocked:
            # Its maneuver goes on; what comes after it does not, and then it is in service.
            return
        elif node.plan_state != PlanState.INITIALIZING and leg.acknowledged and not leg.ended:
            if node.plan_state == PlanState.READY and node.plan_outcome != OUTCOME_FAILURE:
                self._leg_over(now)
            else:
                self._evidence.blocked = node.plan_state == PlanState.BLOCKED
                self._plan_ended(now)

    def follow_state(self, message: Message, now: float) -> None:
        """Nothing follows references here."""

    def moved(self, report: StateReport, now: float) -> None:
        """EstimatedState has been taken in: its position after the leg shows whether it arrived."""
        leg, order = self._leg, self._order
        if leg is None or leg.ended or not leg.acknowledged:
            self._expect_up(now)
        if self.phase is not Phase.FOLLOWING or leg is None or order is None:
            return
        if leg.acknowledged:
            leg.deepest_m = max(leg.deepest_m, report.depth_m)
        if not leg.ended:
            return
        distance = distance_m((report.lat_deg, report.lon_deg), order.place)
        self._leg = None
        if distance <= max(END_WITHIN_M, order.waypoint.arrival_radius_m):
            words = "" if distance <= order.waypoint.arrival_radius_m else f"its leg ended {distance:.0f} m from it"
            steep = "" if leg.deepest_m >= leg.depth_m - DEPTH_TOLERANCE_M else leg.steep
            self._advance(order, WaypointStatus.REACHED, "; ".join(filter(None, (words, steep, order.limited))))
        else:
            self._restart(f"its leg ended {distance:.0f} m from the waypoint", now)

    # The passing of time

    def _begin(self, now: float) -> None:
        self._leg = None
        self._enter(Phase.FOLLOWING, now)
        self._following_since = now
        self._tick_following(now)

    def _waiting_limit_s(self) -> float:
        back = self.node.expected_back
        return max(super()._waiting_limit_s(), 0.0 if back is None else back - self._since)

    def _tick_starting(self, now: float) -> None:
        """There is no plan before the first waypoint."""

    def tick(self, now: float) -> None:
        """Send and judge whatever is due."""
        heard_wet = self.node.submerged and self._heard_lately(now)
        self._wet_since = (self._wet_since if self._wet_since is not None else now) if heard_wet else None
        super().tick(now)

    def _tick_following(self, now: float) -> None:
        order, leg = self._order, self._leg
        if leg is not None and not leg.ended and self.node.without_position_s > self.node.lost_after_s:
            # Its plan is stopped, so that it floats up, and begun again when it tells where it is.
            self._leg = self.node.expected_back = None
            self._restart(NO_POSITION, now)
        elif order is None or order.status in (WaypointStatus.REACHED, WaypointStatus.REFUSED):
            self._watch_idle(now)
        elif leg is None:
            if self._reachable(now):
                self._begin_leg(order, now)
            else:
                self._watch_idle(now)
        elif not leg.acknowledged:
            self._ask_again(order, leg, now)
        elif not leg.ended:
            self._watch_leg(leg, now)
        else:
            self._watch_idle(now)

    def _ask_again(self, order: Order, leg: Leg, now: float) -> None:
        """Send a leg again that was not acknowledged, while in contact."""
        if not self._heard_lately(now) and not self._by_sound(now):
            if self.node.expected_back is None:
                # It may have received the plan and dived.
                self.node.expected_back = now + leg.expected_s
            leg.sent_at = now
            self._watch_leg(leg, now)
        elif now - leg.sent_at > self._start_timeout_s:
            self._release(
                f"no answer to its leg within {now - leg.sent_at:.0f} s"
                + (f"; {self.sound.last_problem}" if self.sound and self.sound.last_problem else ""),
                "It is heard but does not answer: look at its own log, then engage it again",
                now,
            )
        elif now >= self._request_due:
            self._send_leg(order, leg, now)

    def _watch_leg(self, leg: Leg, now: float) -> None:
        if self.sound is not None and self._by_sound(now):
            self.sound.ask(now)
        if self._silence(now) > self._settings.lost_after_s and not self._expected_away(now):
            self._release(
                f"not heard since it left on a leg of {leg.expected_s:.0f} s",
                "Look for it at its waypoint; engage it again when it is heard",
                now,
            )

    def _heard_lately(self, now: float) -> bool:
        settings = self._settings
        return self._silence(now) <= max(HEARD_LATELY_S, 0.5 * settings.lost_after_wall_s * settings.time_scale)

    def _reachable(self, now: float) -> bool:
        """Whether a message sent now arrives: contact at the surface, lasting contact under water, or sound.

        A vehicle that does not tell where it is gets none.
        """
        if self.node.without_position:
            return False
        if self._by_sound(now):
            return True
        wet = self._wet_since is not None and now - self._wet_since >= HEARD_UNDER_WATER_S
        return self._heard_lately(now) and (not self.node.submerged or wet)

    def _expect_up(self, now: float) -> None:
        """Note that a vehicle without a plan, last in contact under water, is silent until it has floated up."""
        node = self.node
        node.expected_back = now + node.ascent_s if node.submerged else None
        if node.expected_back is not None and self._evidence.rebooted:
            # It has to start up and to discover us again.
            node.expected_back += self._settings.engage_timeout_s + self._settings.announce_period_s

    def _watch_idle(self, now: float) -> None:
        if self.sound is not None and self._by_sound(now):
            self.sound.ask(now)
            return
        if self._without_position_too_long(self._settings.release_after_s, now):
            return
        silence = self._silence(now)
        if not self._expected_away(now) and silence > max(
            self._settings.release_after_s, self._settings.lost_after_wall_s * self._settings.time_scale
        ):
            self._release(
                f"silent for {silence / self._settings.time_scale:.0f} s between two legs",
                "Engage it again when it is heard",
                now,
            )

    @property
    def _start_timeout_s(self) -> float:
        settings = self._settings
        shortest = SOUND_START_TIMEOUT_S if self.sound is not None else settings.start_timeout_s
        return max(shortest, START_TIMEOUT_WALLS * settings.lost_after_wall_s * settings.time_scale)

    def _silence(self, now: float) -> float:
        return math.inf if self.node.heard_at is None else now - self.node.heard_at

    def _expected_away(self, now: float) -> bool:
        return self.node.expected_back is not None and now <= self.node.expected_back

    # Legs

    def _begin_leg(self, order: Order, now: float) -> Leg:
        waypoint, report = order.waypoint, self.node.report
        depth, length = waypoint.depth_m, 0.0
        order.limited = ""
        if report is not None:
            limit = self.guard.limit(
                waypoint.depth_m,
                waypoint.min_altitude_m,
                report.time_s,
                report.lat_deg,
                report.lon_deg,
                now=now,
                towards=(order.place,),
                mapped=waypoint.bottom,
            )
            depth, order.limited = limit.depth_m, limit.reason
            length = distance_m((report.lat_deg, report.lon_deg), order.place)
        leg = self._leg = self._planned(order, depth, length, now)
        self._request_id = self._next_request_id()
        self._send_leg(order, leg, now)
        return leg

    def _planned(self, order: Order, depth_m: float, length_m: float, now: float) -> Leg:
        """Choose where the Goto is aimed, and whether to circle down before it.

        Beyond the waypoint, as far as there is room, for it ends that much earlier.
        """
        waypoint = order.waypoint
        short_m = NEARNESS_S * waypoint.speed_mps
        ahead_m = 0.0 if order.lead is None else min(distance_m(order.place, order.lead), short_m)
        steep = length_m + ahead_m - short_m < descent_m(depth_m)
        descend = steep and waypoint.circle_lat_deg is not None and waypoint.circle_lon_deg is not None
        aim = order.place
        if not descend and order.lead is not None and ahead_m > 0.0:
            share = ahead_m / distance_m(order.place, order.lead)
            (lat, lon), (lead_lat, lead_lon) = order.place, order.lead
            aim = lat + share * (lead_lat - lat), lon + share * (lead_lon - lon)
        words = f"{length_m:.0f} m are too short to get to {depth_m:.1f} m, and there is no room to circle down"
        return Leg(
            depth_m,
            leg_time_s(length_m, depth_m, waypoint.speed_mps, math.hypot(*(self.node.current_mps() or (0.0, 0.0)))),
            descend,
            aim,
            words if steep and not descend else "",
            sent_at=now,
        )

    def _send_leg(self, order: Order, leg: Leg, now: float) -> None:
        self._request_due = now + START_RETRY_S
        # A single maneuver is the shortest plan there is.
        plan = (
            goto_maneuver(order.waypoint, leg.depth_m)
            if self._by_sound(now)
            else leg_plan(self._settings, order.waypoint, leg.depth_m, descend=leg.descend, aim=leg.aim)
        )
        self._send(plan_control(OPERATION_START, self._request_id, self._settings, plan))
        if order.status is None:
            self._advance(order, WaypointStatus.SENT, order.limited)

    def _acknowledged(self, now: float) -> None:
        leg, order = self._leg, self._order
        if leg is None or order is None or leg.acknowledged:
            return
        leg.acknowledged = True
        self.node.expected_back = now + leg.expected_s
        self._advance(order, WaypointStatus.ACKNOWLEDGED, order.limited)

    def _leg_over(self, now: float) -> None:
        """Note that the plan is done; the next position report shows where it led."""
        if self._leg is not None:
            self._leg.ended = True
            self._expect_up(now)

    def excuse(self, seconds: float, now: float) -> None:
        """Subtract from every wait the time in which this process was held up and received nothing."""
        super().excuse(seconds, now)
        if self._leg is not None:
            self._leg.sent_at = min(self._leg.sent_at + seconds, now)

    def _plan_ended(self, now: float) -> None:
        self._leg = None
        self._expect_up(now)
        super()._plan_ended(now)
