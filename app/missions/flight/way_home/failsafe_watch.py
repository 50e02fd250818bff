"""Watches a running mission for what the table of failsafes lists, and has done what it says."""

import asyncio
import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import structlog

from app.missions.alarm_kinds import AlarmKind
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import FaultKind, LinkState, VehicleInfo
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.observation.waiting import until_next_look
from app.missions.live.mission import LiveMission
from app.missions.recovery.energy import CHARGED_PCT
from app.missions.recovery.failsafes import (
    ALTITUDE_SHARE,
    CRITICAL_PCT,
    DEPTH_OVERSHOOT_M,
    LAST_S,
    LOW_PCT,
    POSITION_LOST_M,
    STRENGTH,
    TABLE,
    TOLD_BY_VEHICLES,
    Active,
    FailsafeJudge,
    with_reserve_s,
)
from app.missions.spec.failsafes import Failsafe, Response
from app.missions.spec.mission import MissionSpec
from app.missions.spec.recovery import Homecoming
from app.missions.team import OUT_OF_REACH, Member, WayHome
from app.missions.views.mission import Level

HEARD_S = 3.0
"""Who was heard within so long and does not follow obeys somebody else; who is silent may be starting anew."""
FRESH_S = 5.0
"""Places of two vehicles are compared where one came so soon after the other, seconds of the vehicles' time."""

ENERGY = frozenset({Failsafe.LOW_ENERGY, Failsafe.CRITICAL_ENERGY})

FAULTS = {FaultKind.LEAK: Failsafe.LEAK, FaultKind.ERROR: Failsafe.VEHICLE_ERROR}

TEAM = ""
"""In place of a vehicle's name: what concerns all of them."""


log = structlog.get_logger(__name__)


class FailsafeWatch:
    """Judges the vehicles of one running mission by the table."""

    def __init__(self, live: LiveMission, hub: FleetHub, energy_range: EnergyRange, time_scale: float) -> None:
        self._live = live
        self._hub = hub
        self._range = energy_range
        self._time_scale = time_scale
        self._judges: dict[str, FailsafeJudge] = {}
        self._told = told_before(live)
        self._carried = self._told_at(asyncio.get_running_loop().time() * time_scale)
        """By vehicle: alarms that an earlier flight raised, and when each was so or not known at the latest."""
        self._lowest: dict[str, tuple[float, float]] = {}
        """By vehicle whose energy was told to be low: the lowest level since, percent, and the most used, seconds."""
        self._ships: dict[str, set[int]] = {}
        """By vehicle: the ships (MMSI) that came too close a moment ago."""
        self._words_of_ships: list[tuple[str, str]] = []
        """Vehicles and alarms about ships that are still to be written."""
        self._deaf = False
        """Whether it was told that no ship is heard any more."""
        self._below_since_s: dict[str, float] = {}
        """Since when vehicles have waited below for ships."""
        self._have_waited: set[str] = set()
        """Vehicles that have waited below for as long as they may."""
        self._been_apart: set[frozenset[str]] = set()
        """Vehicles are launched side by side: who has not been apart yet is not too close."""

    async def keep(self) -> None:
        """Look at every vehicle's failsafes again and again, until cancelled."""
        while True:
            self.look()
            await until_next_look(self._time_scale)

    def look(self) -> None:
        """Look once which failsafes are active on which vehicles, and see to what follows."""
        now_s = asyncio.get_running_loop().time() * self._time_scale
        too_close = self._too_close()
        self._range.take_currents()
        news: list[tuple[str, list[Active]]] = []
        for member in self._live.team:
            try:
                self._look_at(member, now_s, too_close.get(member.name, {}))
            except Exception:
                # Whatever cannot be told of one keeps nobody from looking after the others.
                log.exception("the failsafes of a vehicle could not be looked at", vehicle=member.name)
            news.append((member.name, member.failsafes))
        lost = self._all_lost()
        news.append((TEAM, self._judges.setdefault(TEAM, FailsafeJudge()).judge(lost, now_s)))
        # Lines of the log are noted: neither this look nor the next waits for a database that is slow, or full.
        words_of_ships, self._words_of_ships = self._words_of_ships, []
        journal = self._live.journal
        for name, words in words_of_ships:
            facts = {"failsafe": Failsafe.TRAFFIC, "vehicle": name}
            journal.note_line(journal.alarm_line(AlarmKind(Failsafe.TRAFFIC), words, **facts))
        for name, found in news:
            self._tell(name, found, now_s)
        self._tell_of_deafness()

    def _look_at(self, member: Member, now_s: float, too_close: dict[Failsafe, str]) -> None:
        """Tell what a vehicle's way home takes, and do what its failsafes ask for."""
        member.way_home = WayHome(
            corners_m=self._range.way(member),
            left_alone_m=self._range.way_left_alone(member),
            needs_s=self._range.needs_s(member),
            drift_reserve_s=self._range.drift_reserve_s(member),
            turn_back_m=self._range.turn_back(member),
        )
        over = member.withdrawal is not None and member.withdrawal.over
        detected = {} if over else self._detected(member) | too_close
        # Who waits at the surface to be taken out of the water is in ships' way, too.
        detected |= self._ships_of(member)
        member.failsafes = self._waiting_below(member, now_s, self._judge(member, now_s, detected))
        self._act(member, member.failsafes)

    def _judge(self, member: Member, now_s: float, detected: dict[Failsafe, str]) -> list[Active]:
        judge = self._judges.get(member.name)
        if judge is None:
            judge = self._judges[member.name] = FailsafeJudge(overrides(self._live.spec, member))
        found = judge.judge(detected, now_s, self._unknown(member))
        if self._live.spec.recovery_of(member.spec) is not None:
            return found
        # Nobody can be sent home who has none.
        return [replace(one, response=Response.WARN) if one.response is Response.RETURN else one for one in found]

    def _unknown(self, member: Member) -> frozenset[Failsafe]:
        """Return what cannot be told of a vehicle now, since it is not heard."""
        link = self._hub.info(member.key)
        if link.state is LinkState.LOST or (link.state is LinkState.EXPECTED_OFFLINE and not _is_heard(link)):
            return TOLD_BY_VEHICLES
        # Whom it obeys is asked of who is there at this moment.
        return frozenset() if _is_heard(link) else frozenset({Failsafe.OTHER_CONSOLE})

    def _act(self, member: Member, found: list[Active]) -> None:
        strongest = next(iter(found), None)
        withdrawal = member.withdrawal
        held = withdrawal is not None and withdrawal.response is Response.HOLD and not withdrawal.asked
        if strongest is not None and strongest.response is not Response.WARN:
            withdrawn = self._live.withdraw(member, strongest.response, strongest.message)
            if withdrawn and member.withdrawal is not None:
                member.withdrawal.below = strongest.failsafe is Failsafe.TRAFFIC
        elif held:
            member.survey_again()
            self._live.changed.set()

    def _ships_of(self, member: Member) -> dict[Failsafe, str]:
        """Return which ship comes too close to a vehicle; of those that join it is told one by one."""
        begun = self._ships.get(member.name, set())
        found = self._live.ships.encounters(member, begun)
        self._ships[member.name] = now = {one.ship.position.mmsi for one in found}
        if begun:
            for one in found:
                if one.ship.position.mmsi in now - begun:
                    self._words_of_ships.append((member.name, f"{member.name}: {one.words}, too"))
        return {Failsafe.TRAFFIC: found[0].words} if found else {}

    def _waiting_below(self, member: Member, now_s: float, found: list[Active]) -> list[Active]:
        """Return what is in force; who is up already, or has waited long for ships, is not kept from going on."""
        held = any(one.failsafe is Failsafe.TRAFFIC and one.response is not Response.WARN for one in found)
        if not held:
            self._below_since_s.pop(member.name, None)
            self._have_waited.discard(member.name)
            return found
        traffic = self._live.ships.traffic
        most_s = math.inf if traffic is None else traffic.settings.hold_s
        withdrawal = member.withdrawal
        if withdrawal is not None and withdrawal.below:
            since_s = self._below_since_s.setdefault(member.name, now_s)
            if member.name not in self._have_waited and now_s - since_s > most_s:
                self._have_waited.add(member.name)
                words = f"{member.name} waited {most_s:.0f} s for ships to pass, and comes up"
                self._words_of_ships.append((member.name, words))
        if member.name not in self._have_waited and not self._live.ships.is_up(member):
            return found
        warned = [replace(one, response=Response.WARN) if one.failsafe is Failsafe.TRAFFIC else one for one in found]
        return sorted(warned, key=lambda one: -STRENGTH[one.response])

    def _detected(self, member: Member) -> dict[Failsafe, str]:
        """Return what is wrong with a vehicle now, in words for the operator."""
        report, limits = member.report, self._live.spec.limits
        link = self._hub.info(member.key)
        found = {FAULTS[fault.kind]: f"it reports: {fault.reason}" for fault in link.faults}
        if link.state is LinkState.LOST and member.followed:
            return found | {Failsafe.LINK_LOST: f"its link is lost: {link.reason or 'silent'}"}
        if link.without_position and member.followed:
            found[Failsafe.NO_POSITION] = f"it does not tell where it is: its position is {link.report_age_s:.0f} s old"
        if report is None:
            return found
        found |= self._energy(member)
        depth_m, altitude_m = report.position.depth_m, report.altitude_m
        if depth_m > limits.max_depth_m + DEPTH_OVERSHOOT_M:
            found[Failsafe.TOO_DEEP] = f"it is at {depth_m:.1f} m, and {limits.max_depth_m:g} m is the limit"
        elif altitude_m is not None and 0.0 < altitude_m < ALTITUDE_SHARE * limits.min_altitude_m and depth_m > 1.0:
            found[Failsafe.TOO_DEEP] = (
                f"it is {altitude_m:.1f} m above the bottom, and {limits.min_altitude_m:g} m is the limit"
            )
        if report.position_sd_m is not None and report.position_sd_m > POSITION_LOST_M:
            found[Failsafe.POSITION_LOST] = f"it knows where it is to {report.position_sd_m:.0f} m"
        breach = self._live.boundaries.breach(member.name)
        if breach and member.legs and member.withdrawal is None:
            found[Failsafe.GEOFENCE_LEFT] = f"it is {breach}"
        refuses = member.followed and not member.engaged and member.refusal
        if refuses and _is_heard(link) and not link.without_position:
            found[Failsafe.OTHER_CONSOLE] = member.refusal.removeprefix(f"{member.name}: ")
        return found

    def _energy(self, member: Member) -> dict[Failsafe, str]:
        left, needs_s = member.energy.left, member.way_home.needs_s
        if needs_s is None:
            level = member.energy.level_pct
            if level is None or level >= LOW_PCT:
                return {}
            words = f"its battery is at {level:.0f} %, and it has no way home"
            return {Failsafe.CRITICAL_ENERGY if level < CRITICAL_PCT else Failsafe.LOW_ENERGY: words}
        if left is None:
            return {}
        found = {}
        if left.time_s < min(needs_s, LAST_S):
            found[Failsafe.CRITICAL_ENERGY] = (
                f"its energy lasts {left.time_s:.0f} s, and its way home takes {needs_s:.0f} s"
                if math.isfinite(needs_s)
                else "the current is too strong for its way home"
            )
        if left.safe_s <= with_reserve_s(needs_s, member.way_home.drift_reserve_s):
            found[Failsafe.LOW_ENERGY] = (
                f"its energy lasts {left.safe_s:.0f} s for sure, and its way home takes {needs_s:.0f} s"
            )
        return found

    def _too_close(self) -> dict[str, dict[Failsafe, str]]:
        """Return whom vehicles are too close to."""
        limits, live = self._live.spec.limits, self._live
        flying = [m for m in live.team if m.controllable and m.report is not None and m.legs]
        found: dict[str, dict[Failsafe, str]] = {}
        for one, other in combinations(flying, 2):
            # By when they came: vehicles' own clocks may differ by hours.
            between_s = abs((one.heard_s or 0.0) - (other.heard_s or 0.0)) * self._time_scale
            if one.report is None or other.report is None or between_s > FRESH_S:
                continue
            apart_m = abs(one.report.position.depth_m - other.report.position.depth_m)
            away_m = float(np.hypot(*(one.place_m(live.frame) - other.place_m(live.frame))))
            pair = frozenset((one.name, other.name))
            if away_m >= limits.min_separation_m or apart_m >= limits.min_vertical_separation_m:
                self._been_apart.add(pair)
            elif pair in self._been_apart and apart_m < limits.min_vertical_separation_m / 2:
                for a, b in ((one, other), (other, one)):
                    found[a.name] = {Failsafe.SEPARATION_LOST: f"{b.name} is {away_m:.1f} m away at the same depth"}
        return found

    def _all_lost(self) -> dict[Failsafe, str]:
        followed = [m for m in self._live.team if m.followed and not (m.withdrawal is not None and m.withdrawal.over)]
        lost = [m for m in followed if self._hub.info(m.key).state is LinkState.LOST]
        if len(followed) < 2 or len(lost) < len(followed):
            return {}
        return {Failsafe.ALL_LINKS_LOST: f"none of {len(followed)} vehicles is heard any more"}

    def _tell_of_deafness(self) -> None:
        """Write down when no ship is heard any more, and when one is again: no ships about looks the same."""
        traffic = self._live.ships.traffic
        why = "" if traffic is None else traffic.deaf
        if bool(why) == self._deaf:
            return
        self._deaf = bool(why)
        level, words = Level.INFO, "AIS is heard again"
        if why:
            level = Level.WARNING
            words = f"no ship is heard by AIS any more ({why}): nobody is warned of any, and nobody waits for any"
        self._live.journal.note_line(self._live.journal.line(level, "traffic", words))

    def _tell(self, name: str, found: list[Active], now_s: float) -> None:
        """Write down what begins and what is over."""
        before = self._told.get(name, frozenset())
        now = {one.failsafe: one for one in found}
        undecided = self._undecided(name, before, frozenset(now), now_s)
        self._told[name] = stay = undecided | self._still_low(name, before, frozenset(now)) | now.keys()
        who, journal = f"{name}: " if name else "", self._live.journal
        for failsafe, one in now.items():
            if failsafe not in before:
                words = f"{who}{one.message}"
                facts = {"failsafe": failsafe, "response": one.response} | ({"vehicle": name} if name else {})
                if failsafe is Failsafe.SEPARATION_LOST:
                    journal.note_line(journal.line(Level.WARNING, "failsafe", words, **facts))
                else:
                    journal.note_line(journal.alarm_line(AlarmKind(failsafe.value), words, **facts))
        for failsafe in before - stay:
            words = f"{who}{failsafe.replace('_', ' ')} is over"
            facts = {"failsafe": failsafe} | ({"vehicle": name} if name else {})
            if failsafe is Failsafe.SEPARATION_LOST:
                journal.note_line(journal.line(Level.INFO, "failsafe", words, **facts))
            else:
                journal.note_line(journal.end_line([AlarmKind(failsafe.value)], words, **facts))
        if before != stay:
            self._live.publish_summary()

    def _still_low(self, name: str, before: frozenset[Failsafe], now: frozenset[Failsafe]) -> frozenset[Failsafe]:
        """Return which alarms of a vehicle's energy are so as long as it was not charged.

        Nearer to home, or at home, less is needed, and no battery has more in it. Of an alarm of an earlier flight
        nobody knows at which level it was: it is over unless it is so in this one, too.
        """
        member, low = self._live.team.get(name), (before | now) & ENERGY
        if name not in self._lowest and not now & ENERGY:
            return frozenset()
        if member is None or not low:
            self._lowest.pop(name, None)
            return frozenset()
        level, used_s = member.energy.level_pct, member.energy.used_s
        lowest, most_s = self._lowest.get(name, (math.inf, 0.0))
        if level is None:
            charged = used_s < most_s
        else:
            charged = level > lowest + CHARGED_PCT
            lowest = min(lowest, level)
        self._lowest[name] = lowest, max(most_s, used_s)
        return frozenset() if charged else low

    def _told_at(self, now_s: float) -> dict[str, dict[Failsafe, float]]:
        return {name: dict.fromkeys(told, now_s) for name, told in self._told.items()}

    def _undecided(
        self, name: str, before: frozenset[Failsafe], now: frozenset[Failsafe], now_s: float
    ) -> frozenset[Failsafe]:
        """Return which alarms of an earlier flight may still be so though this one does not know it.

        Whoever they are of has to be heard for as long as for any other before they are over.
        """
        carried = self._carried.get(name, {})
        for failsafe in now & carried.keys():
            del carried[failsafe]
        judge = self._judges.get(name)
        looming = set() if judge is None else judge.looming
        silent = not any(self._is_known(member) for member in self._live.team if name in (member.name, TEAM))
        carried |= dict.fromkeys(carried.keys() if silent else carried.keys() & looming, now_s)
        return frozenset(f for f in before & carried.keys() if now_s - carried[f] < TABLE[f].over_s)

    def _is_known(self, member: Member) -> bool:
        """Whether a vehicle is heard, or is where nothing more is asked of it."""
        at_rest = member.withdrawal is not None and member.withdrawal.over
        return at_rest or self._hub.info(member.key).state not in OUT_OF_REACH


def told_before(live: LiveMission) -> dict[str, frozenset[Failsafe]]:
    """Return the failsafes of which alarms were raised that are not over, by their vehicles' names."""
    kinds = [AlarmKind(failsafe.value) for failsafe in Failsafe if failsafe.value in set(AlarmKind)]
    found: dict[str, frozenset[Failsafe]] = {}
    for kind, vehicle in live.journal.alarms.standing(kinds):
        name = TEAM if vehicle is None else vehicle
        found[name] = found.get(name, frozenset()) | {Failsafe(kind.value)}
    return found


def overrides(spec: MissionSpec, member: Member) -> dict[Failsafe, Response]:
    """Return what is done for a vehicle where it differs from the table."""
    found: dict[Failsafe, Response] = {}
    recovery = spec.recovery_of(member.spec)
    if recovery is not None and recovery.on_low_energy is Homecoming.STOP:
        found[Failsafe.LOW_ENERGY] = Response.SURFACE
    if recovery is not None and recovery.on_lost_link is Homecoming.STOP:
        found[Failsafe.LINK_LOST] = Response.SURFACE
    return found | spec.failsafes


def _is_heard(link: VehicleInfo) -> bool:
    return link.age_s is not None and link.age_s <= HEARD_S
