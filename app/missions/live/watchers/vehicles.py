"""What operators are shown of a mission's vehicles."""

import math
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.clock import now
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import LinkState, Position, VehicleInfo, VehicleReport
from app.missions.flown import Phase
from app.missions.recovery.failsafes import with_reserve_s
from app.missions.safety.room import CIRCLE_M
from app.missions.spec.mission import MissionSpec
from app.missions.spec.orders import OrderKind
from app.missions.spec.surface_policy import SurfacePolicy
from app.missions.team import Member, Swath, Team
from app.missions.views.messages import VehiclesMessage
from app.missions.views.mission import CurrentView, FailsafeView, PositionQuality, VehicleView, WaitingCircle
from app.missions.views.orders import OrderView

SWATH_KEPT_S = 5.0
"""By its vehicle's clock, how long a ping is shown."""


class VehicleViews:
    """Shows the vehicles of one mission as their links know them now.

    Parameters
    ----------
    breach
        Returns where a vehicle is that it must not be.
    """

    def __init__(
        self,
        mission_id: str,
        spec: Callable[[], MissionSpec],
        frame: LocalFrame,
        hub: FleetHub,
        team: Team,
        breach: Callable[[str], str],
        time_scale: float = 1.0,
    ) -> None:
        self._time_scale = time_scale
        self._mission_id = mission_id
        self._spec = spec
        """What the mission is to do, as it was said last."""
        self._frame = frame
        self._hub = hub
        self._team = team
        self._breach = breach
        self._places: dict[str, tuple[Position, tuple[float, float] | None]] = {}

    def all(self) -> list[VehicleView]:
        """Return the vehicles that take part, and after them those that left, as they were last heard of."""
        infos = self._hub.infos()
        shown = [*self._team, *(member for member in self._team.departed.values() if member.report is not None)]
        return [self._view(member, infos.get(member.key)) for member in shown]

    def current(self) -> CurrentView | None:
        """Return the current as the vehicles that take part estimate it; None while none of them does."""
        told = self._team.told_current_mps
        if told is None:
            return None
        east, north = told
        toward_deg = round(math.degrees(math.atan2(east, north)) % 360.0, 1) % 360.0
        return CurrentView(speed_mps=round(math.hypot(east, north), 3), toward_deg=toward_deg)

    def message(self) -> VehiclesMessage:
        """Return what those who watch the mission are shown of its vehicles."""
        return VehiclesMessage(time=now(), vehicles=self.all(), current=self.current())

    def of(self, info: VehicleInfo) -> VehicleView | None:
        """Return a vehicle of this name and kind, if it takes part."""
        member = self._team.get(info.name)
        return None if member is None or member.key != (info.kind, info.name) else self._view(member, info)

    def _view(self, member: Member, info: VehicleInfo | None) -> VehicleView:
        info = info or self._hub.info(member.key)
        report, heard_s = self._last_heard(member, info)
        view = VehicleView(
            name=member.name,
            kind=member.spec.kind,
            sensor=member.spec.sensor,
            mission_id=self._mission_id if member.left_at is None else None,
            active=member.left_at is None,
            left_at=member.left_at,
            breach=self._breach(member.name),
            link=info.state,
            reason=_reason(member, info) or _waits_for_the_others(member, self._spec()),
            age_s=None if heard_s is None else rounded(max(now().timestamp() - heard_s, 0.0), 2),
            address=info.address,
            imc_id=info.imc_id,
            surfacing=member.surfacing,
            risings=member.fixes.risings,
            pursuing=member.pursuing,
            phase=member.flown.phase,
            flown_m=round(member.flown.flown_m, 1),
            on_plan_m=round(member.flown.on_plan_m, 1),
            idle_s=round(member.flown.idle_s, 1),
            order=self._order(member),
            waiting_circle=self._waiting_circle(member),
            **self._recovery(member),
        )
        if report is None:
            return view
        position = report.position
        place = self._place(member.name, position)
        return view.model_copy(
            update={
                # No more digits than mean anything: this goes to every viewer several times a second.
                "lat_deg": round(position.lat_deg, 8),
                "lon_deg": round(position.lon_deg, 8),
                "east_m": place and round(place[0], 3),
                "north_m": place and round(place[1], 3),
                "depth_m": round(position.depth_m, 3),
                "altitude_m": rounded(report.altitude_m, 3),
                "heading_deg": rounded(report.heading_rad and math.degrees(report.heading_rad) % 360, 2),
                "speed_mps": rounded(report.speed_mps, 3),
                "battery_pct": rounded(report.battery_pct, 2),
                "position_sd_m": rounded(report.position_sd_m, 3),
                "swath_m": _swath_m(member.swath, report),
                "localization": _position_quality(report.position_sd_m, self._spec().surface_policy),
            }
        )

    def _last_heard(self, member: Member, info: VehicleInfo) -> tuple[VehicleReport | None, float | None]:
        """Return what a vehicle reported last, as far as this is to be shown, and when that was, Unix seconds."""
        owner = self._hub.claimed_by(member.key)
        if owner not in (None, self._mission_id) and member.left_at is None:
            # It is in another mission by now: here it stays where it was when this one ended.
            return member.report, member.heard_s
        age_s = info.report_age_s
        heard_s = member.heard_s if age_s is None else now().timestamp() - age_s
        if owner == self._mission_id and member.left_at is None:
            return member.report or info.report, heard_s
        # The mission does not hear it any more, but perhaps its link does: it comes up, and drifts.
        return near_report(self._frame, info.report) or member.report or info.report, heard_s

    def _order(self, member: Member) -> OrderView | None:
        """Return what its operator ordered a vehicle to do."""
        order = member.asked
        if order is None:
            return None
        lat, lon = self._frame.to_geographic(order.corners_m[:, 0], order.corners_m[:, 1])
        skips = order.kind is OrderKind.SKIP_LINE
        return OrderView(
            id=order.id,
            vehicle=member.name,
            kind=order.kind,
            state=order.state,
            way=[] if skips else [(round(float(x), 8), round(float(y), 8)) for x, y in zip(lon, lat, strict=True)],
            asked_by=order.asked_by,
            asked_at=order.asked_at,
            changed_at=order.asked_at,
        )

    def _waiting_circle(self, member: Member) -> WaitingCircle | None:
        """Return where a vehicle was sent to wait, as long as it does."""
        if member.waits_m is None or not member.engaged:
            return None
        return WaitingCircle(centre=self._lon_lats(member.waits_m)[0], radius_m=CIRCLE_M)

    def _recovery(self, member: Member) -> dict[str, Any]:
        """Return what is shown of a vehicle's energy, its way home, and what is wrong with it."""
        recovery, left, home = self._spec().recovery_of(member.spec), member.energy.left, member.way_home
        needs_s = home.needs_s
        turn_back_at = None
        if left is not None and needs_s is not None and math.isfinite(needs_s) and member.withdrawal is None:
            slack_s = (left.safe_s - with_reserve_s(needs_s, home.drift_reserve_s)) / self._time_scale
            turn_back_at = (now() + timedelta(seconds=max(slack_s, 0.0))).replace(microsecond=0)
        over = member.withdrawal is not None and member.withdrawal.over
        active = [FailsafeView(failsafe=a.failsafe, response=a.response, message=a.message) for a in member.failsafes]
        return {
            "withdrawn": "" if member.withdrawal is None else member.withdrawal.why,
            "part_done": member.withdrawal is not None and member.withdrawal.done,
            "energy_left_pct": energy_left_pct(member),
            "energy_left_s": None if left is None else round(left.safe_s),
            "recovery_point": None if recovery is None else recovery.point,
            "return_needs_s": None if needs_s is None or not math.isfinite(needs_s) else round(needs_s),
            "turn_back_at": turn_back_at,
            "turn_back_point": None if home.turn_back_m is None else self._lon_lats(home.turn_back_m)[0],
            "way_home": [] if over or home.corners_m is None else self._lon_lats(home.corners_m),
            "failsafes": active,
        }

    def _lon_lats(self, places_m: FloatArray) -> list[tuple[float, float]]:
        """Return longitudes and latitudes of places, (n, 2) or (2,)."""
        lats, lons = self._frame.to_geographic(*np.atleast_2d(places_m).T)
        return [(round(float(lon), 7), round(float(lat), 7)) for lon, lat in zip(lons, lats, strict=True)]

    def _place(self, name: str, position: Position) -> tuple[float, float] | None:
        """Return where a vehicle is; it is shown far more often than it moves."""
        known = self._places.get(name)
        if known is None or known[0] is not position:
            known = self._places[name] = position, local_place(self._frame, position)
        return known[1]


def _swath_m(swath: Swath | None, report: VehicleReport) -> tuple[float, float] | None:
    """Return how far a sonar reaches to port and to starboard, as long as it is about what it reached last."""
    if swath is None or abs(report.time_s - swath.time_s) > SWATH_KEPT_S:
        return None
    return round(swath.port_m, 2), round(swath.starboard_m, 2)


def _position_quality(sd_m: float | None, policy: SurfacePolicy | None) -> PositionQuality:
    """Return how good a position of this deviation is by the mission's policy."""
    if sd_m is None:
        return PositionQuality.UNTOLD
    if policy is None or policy.max_position_sd_m is None:
        return PositionQuality.STATED
    if sd_m <= policy.until_sd_m:
        return PositionQuality.GOOD
    return PositionQuality.FADING if sd_m <= policy.max_position_sd_m else PositionQuality.POOR


def _reason(member: Member, info: VehicleInfo) -> str:
    launched = member.capabilities.simulated and info.state is LinkState.UNKNOWN and member.report is not None
    # Nothing is to be done about a simulated vehicle that was put away with its mission.
    return member.refusal.removeprefix(f"{member.name}: ") or ("" if launched else info.reason)


def _waits_for_the_others(member: Member, spec: MissionSpec) -> str:
    """Return why a vehicle that follows us is sent nowhere any more; '' where it surveys."""
    begun = member.controllable and member.withdrawal is None and member.legs > 0
    if not begun or member.flown.phase is not Phase.STOPPED or member.way_left_m(spec) > 0.0:
        return ""
    return "it has flown all of the length that it was given, and waits for the others"


def local_place(frame: LocalFrame, position: Position) -> tuple[float, float] | None:
    """Return east and north of a position, metres; None when it is not near enough to be on the frame."""
    try:
        east, north = frame.to_local(position.lat_deg, position.lon_deg)
    except ValueError:
        return None
    return float(east), float(north)


def near_report(frame: LocalFrame, report: VehicleReport | None) -> VehicleReport | None:
    """Return what a vehicle reports, if it is near enough to be on the frame; before its first fix DUNE is at 0, 0."""
    return None if report is None or local_place(frame, report.position) is None else report


def energy_left_pct(member: Member) -> float | None:
    """Return what is left of a vehicle's energy, by its battery or else by the clock; None: not known."""
    left = member.energy.left
    return rounded(member.energy.level_pct if left is None else left.pct, 1)


def rounded(value: float | None, digits: int) -> float | None:
    """Return a value with so many decimals; None stays."""
    return None if value is None else round(value, digits)
