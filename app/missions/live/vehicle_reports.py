"""What a mission's vehicles report, and what follows from it for the mission."""

import asyncio
import math

import structlog

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.alarm_kinds import AlarmKind
from app.missions.clock import now
from app.missions.fleet.interface import (
    FleetEvent,
    LinkReport,
    PingReport,
    RangeReport,
    RestartReport,
    ScanReport,
    SoundingReport,
    SoundSpeedReport,
    VehicleReport,
    WaypointReport,
    WaypointStatus,
)
from app.missions.flown import Phase, is_flown
from app.missions.live.boundaries import Boundaries
from app.missions.live.header import MissionHeader
from app.missions.live.journals.journal import Journal
from app.missions.live.journals.range_journal import RangeJournal
from app.missions.live.journals.sound_speed_journal import SoundSpeedJournal
from app.missions.live.watchers.vehicles import local_place
from app.missions.live.watchers.waypoints import WaypointViews
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.spec.surface_policy import SurfacePolicy
from app.missions.states import AT_SEA, ENDED
from app.missions.team import Member, Team, Withdrawal
from app.missions.views.mission import Level

LONGEST_GAP_S = 60.0
"""What a vehicle flew in a longer silence is not known."""
SURFACE_M = 0.7
"""Who is not deeper can receive satellites."""
LONGEST_SILENCE_S = 6 * 3600.0
"""A vehicle was under way, surveyed and used energy, in a silence that was not longer."""
CLOCK_SET_S = 60.0
"""A vehicle's clock that gets farther ahead of ours than ever by more than that was set forward."""
PACE_MEMORY = 0.9
"""Weight of the past in the running mean of a leg's duration."""

log = structlog.get_logger(__name__)


class VehicleReports:
    """What a mission's vehicles report, on its way to team, journal and boundaries."""

    def __init__(
        self,
        frame: LocalFrame,
        team: Team,
        header: MissionHeader,
        journal: Journal,
        ranges: RangeJournal,
        sound_speeds: SoundSpeedJournal,
        boundaries: Boundaries,
        waypoints: WaypointViews,
        changed: asyncio.Event,
        time_scale: float,
    ) -> None:
        self._frame = frame
        self._team = team
        self._header = header
        self._journal = journal
        self._ranges = ranges
        self._sound_speeds = sound_speeds
        self._boundaries = boundaries
        self._waypoints = waypoints
        self._changed = changed
        self._time_scale = time_scale
        self.leg_s: float | None = None
        """How long a leg takes, running mean on the wall clock."""

    def take(self, event: FleetEvent, spec: MissionSpec, *, running: bool, standing: bool = False) -> None:
        """Take an event from one of the mission's vehicles; called from the event loop, never blocks.

        ``running``: whether the mission's flight goes on in this process; ``standing``: whether nobody can be sent
        anywhere meanwhile.
        """
        member = self._team.get(event.vehicle)
        if member is None:
            return
        match event:
            case VehicleReport():
                place = local_place(self._frame, event.position)
                if place is None:
                    log.warning("position is not near the mission, ignored", vehicle=event.vehicle)
                    return
                heard_before = member.clock_ahead_s is not None
                passed_s = self._passed_s(member, event)
                if running:
                    self._count_time(member, passed_s, spec, standing=standing)
                    self._count_way(member, passed_s, place, spec, heard_before=heard_before)
                self._count_energy(member, event, passed_s, spec.surface_policy)
                member.report, member.heard_s = event, now().timestamp()
                if running and member.flown.phase is Phase.SURVEY:
                    member.count_late(spec, self._frame)
                self._journal.position(event, member.flown if running else None)
                self._hold_against_boundaries(event, place)
                if spec.targets:
                    self._ranges.times.heard(event.vehicle, event.time_s)
            case SoundingReport():
                self._journal.sounding(event)
                return
            case PingReport():
                self._journal.ping(event)
                return
            case ScanReport():
                self._journal.scan(event)
                return
            case RangeReport():
                self._ranges.note(event, member.report.time_s if member.report else None)
                return
            case SoundSpeedReport():
                self._sound_speeds.note(event)
                return
            case LinkReport():
                member.note_link(event.state)
            case RestartReport():
                # The link may lead it again at once. The loop asks all the same, and says when it follows.
                member.disengage()
                words = f"{event.vehicle}: {event.reason}"
                line = self._journal.alarm_line(AlarmKind.VEHICLE_RESTARTED, words, vehicle=event.vehicle)
                self._journal.note_line(line)
            case WaypointReport():
                self._receive_waypoint(member, event)
        self._changed.set()

    def _passed_s(self, member: Member, report: VehicleReport) -> float:
        """Return how much time has passed for a vehicle since its last report, without what its clock was set by.

        What comes late, after a silence, is behind our clock and catches up with it: its clock was not set.
        """
        passed_s = 0.0 if member.report is None else report.time_s - member.report.time_s
        ahead_s, most_s = report.time_s - self._time_scale * now().timestamp(), member.clock_ahead_s
        if most_s is None or passed_s < 0.0:
            member.clock_ahead_s = ahead_s
            return passed_s
        member.clock_ahead_s = max(ahead_s, most_s)
        was_set = ahead_s > most_s + CLOCK_SET_S and not member.capabilities.simulated
        return max(passed_s - (ahead_s - most_s), 0.0) if was_set else passed_s

    def _count_time(self, member: Member, passed_s: float, spec: MissionSpec, *, standing: bool) -> None:
        """Note what a vehicle is at, and count how long it has surveyed since its last report."""
        member.flown.phase = self._phase(member, member.way_left_m(spec))
        if member.flown.phase is Phase.SURVEY and 0.0 < passed_s <= LONGEST_SILENCE_S and not standing:
            member.flown.survey_s += passed_s

    def _count_way(
        self, member: Member, passed_s: float, place: tuple[float, float], spec: MissionSpec, *, heard_before: bool
    ) -> None:
        """Add what a vehicle has flown since its last report, if that can have been.

        ``heard_before``: in this run of the service. While it was down nobody knows whether a vehicle was idle.
        """
        flown = member.flown
        way_left_m = member.way_left_m(spec)
        flown.left_m = way_left_m + (member.way_ahead_m(self._frame) if member.flies_survey else 0.0)
        before = None if member.report is None else local_place(self._frame, member.report.position)
        if before is None:
            return
        if passed_s > LONGEST_GAP_S or not is_flown(math.dist(before, place), passed_s):
            return
        leg = None
        if member.ordered and member.leg.start_m is not None and member.target_m is not None:
            leg = place_of(member.leg.start_m), place_of(member.target_m)
        flown.add_way(before, place, leg)
        waits = not member.ordered and member.legs and way_left_m > 0.0 and member.withdrawal is None
        if waits and heard_before:
            flown.idle_s += passed_s

    def _count_energy(
        self, member: Member, report: VehicleReport, passed_s: float, policy: SurfacePolicy | None
    ) -> None:
        """Count what a vehicle has used since its last report."""
        energy = member.energy
        energy.take_level(report.battery_pct, report.battery_confidence_pct, report.energy_left_s)
        if self._header.state not in AT_SEA:
            energy.begin()
            return
        if 0.0 < passed_s <= LONGEST_SILENCE_S:
            energy.pass_time(passed_s, report.speed_mps)
            at_surface, stay_s = report.position.depth_m <= SURFACE_M, 0.0 if policy is None else policy.stay_s
            member.fixes.pass_time(passed_s, at_surface=at_surface, stay_s=stay_s)
        member.flown.used_s = energy.used_s

    def _phase(self, member: Member, way_left_m: float) -> Phase:
        if member.withdrawal is not None:
            return phase_of(member.withdrawal)
        if member.left_alone:
            return Phase.STOPPED
        if member.surfacing:
            return Phase.SURFACING
        outside = self._boundaries.comes_in(member.name) or self._boundaries.breach(member.name)
        if member.legs == 0 or outside:
            return Phase.TRANSIT
        return Phase.SURVEY if member.ordered or member.ahead or way_left_m > 0.0 else Phase.STOPPED

    def _hold_against_boundaries(self, report: VehicleReport, place: tuple[float, float]) -> None:
        if self._header.state in ENDED:
            return
        member = self._team.get(report.vehicle)
        on_its_way_home = member is not None and member.withdrawal is not None
        for crossing in self._boundaries.judge(
            report.vehicle,
            place,
            report.position.depth_m,
            asyncio.get_running_loop().time(),
            may_leave=on_its_way_home,
        ):
            journal, words, data = self._journal, crossing.message, crossing.data
            if crossing.begins:
                journal.note_line(journal.alarm_line(crossing.alarm, words, **data))
            elif crossing.ends:
                journal.note_line(journal.end_line([crossing.alarm], words, **data))
            else:
                journal.note_line(journal.line(Level.INFO, "boundary", words, **data))

    def _receive_waypoint(self, member: Member, event: WaypointReport) -> None:
        if event.mission_id != self._journal.mission_id or member.order is None or event.step != member.order.step:
            return
        if member.status is WaypointStatus.MISSED:
            return  # its vehicle acknowledged it, or came to its end, after it was given up
        member.status = event.status
        member.reason = event.reason
        if event.status is WaypointStatus.REACHED:
            member.reach_leg()
            took_s = asyncio.get_running_loop().time() - member.leg.began_s
            before_s = took_s if self.leg_s is None else self.leg_s
            self.leg_s = PACE_MEMORY * before_s + (1 - PACE_MEMORY) * took_s
        elif event.status in (WaypointStatus.MISSED, WaypointStatus.REFUSED):
            member.miss_leg()
        self._journal.waypoint(event)
        self._waypoints.take(event)


def phase_of(withdrawal: Withdrawal) -> Phase:
    """Return what a vehicle is at that does not survey any more."""
    if withdrawal.response is Response.RETURN:
        return Phase.HOME if withdrawal.over else Phase.RETURNING
    return Phase.STOPPED if withdrawal.over or withdrawal.response is Response.HOLD else Phase.SURFACING


def place_of(place_m: FloatArray) -> tuple[float, float]:
    """Return an array (2,) as a pair."""
    return float(place_m[0]), float(place_m[1])
