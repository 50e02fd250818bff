"""What flying has to do beyond the usual when its mission is a search; nothing in a survey."""

import asyncio
from collections.abc import Awaitable, Callable

import numpy as np

from app.exploration.site_search import SearchTask
from app.missions.alarm_kinds import AlarmKind
from app.missions.flight.decisions.decision import Decision
from app.missions.live.mission import LiveMission
from app.missions.search.course import IDLE_STEPS, REST_S, Course
from app.missions.team import Member
from app.missions.views.mission import Level

Wait = Callable[[Callable[[], bool], float | None], Awaitable[bool]]
"""Waits until a condition holds, or until the event loop's time; tells whether it does."""


class SearchHooks:
    """Keeps one running mission from going where something stands, and tells when a search is over.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    wait
        The flight's own way to wait for what vehicles tell.
    """

    def __init__(self, live: LiveMission, time_scale: float, wait: Wait) -> None:
        self._live = live
        self._time_scale = time_scale
        self._wait = wait
        self._course = None if live.search is None else Course(live.search, live.spec, live.frame)

    @property
    def needed(self) -> bool:
        """Whether the mission is a search."""
        return self._course is not None

    def task(self, step: int) -> SearchTask | None:
        """Return what the planner of a search is to see when a step is decided."""
        if self._course is None:
            return None
        # Who lies in the water, or goes home, is in the way of those that search on.
        apart = [m for m in self._live.team if m.withdrawal is not None and m.report is not None]
        places_m = [member.place_m(self._live.frame) for member in apart]
        return self._course.task(step, np.array(places_m).reshape(-1, 2))

    def barred(self) -> list[Member]:
        """Return the vehicles under way that have something on their way by what is known now."""
        course = self._course
        return [] if course is None else [m for m in self._live.team.surveying if m.busy and course.barred(m)]

    def still_clear(self, decision: Decision) -> bool:
        """Return whether the legs of a decision are still clear by what was seen since it was made."""
        if self._course is None:
            return True
        search = self._course.search
        return all(
            leg.refusal or search.clear(member.place_m(self._live.frame), leg.target_m[:2])
            for leg in decision.legs
            if (member := self._live.team.get(leg.vehicle)) is not None and member.report is not None
        )

    async def look_round(self) -> None:
        """Wait for scans: from every vehicle's place, and for a new one where nobody could go on."""
        course, live = self._course, self._live
        if course is None:
            return
        if course.idle >= IDLE_STEPS:
            if not await self._come_free(course):
                await self._wait(lambda: False, self._in(course.rest_s))
        elif course.idle:
            await self._scanned(course)
        rest_s = self._in(REST_S)
        if await self._wait(lambda: not course.unseen(live.team.plannable), rest_s):
            return
        blind = course.unseen(live.team.plannable)
        message = f"no scan tells what is around {', '.join(blind)}: the search waits for one"
        await live.journal.alarm(AlarmKind.NO_SCAN, message, vehicles=blind)
        await self._wait(lambda: not course.unseen(live.team.plannable), None)
        await live.journal.end([AlarmKind.NO_SCAN], "scans tell again what is around every vehicle")

    async def _come_free(self, course: Course) -> bool:
        """Wait while obstacles hold everybody and there is time; return whether that was so and is over."""
        was_held = False
        while course.held(self._live.team.plannable) and not course.little_left:
            was_held = True
            await self._scanned(course)
        return was_held and not course.little_left

    async def _scanned(self, course: Course) -> None:
        """Wait for a scan, for a while."""
        version = course.search.version
        await self._wait(lambda: course.search.version > version, self._in(REST_S))

    def _in(self, vehicle_s: float) -> float:
        """Return the event loop's time after a time of the vehicles'."""
        return asyncio.get_running_loop().time() + vehicle_s / self._time_scale

    async def tell_of(self, barred: list[Member]) -> None:
        """Write down why a step ends early."""
        names = [member.name for member in barred]
        message = f"something was seen on the way of {', '.join(names)}: another way is taken"
        await self._live.journal.log(Level.WARNING, "obstacle", message, step=self._live.header.step, vehicles=names)

    async def why_over(self, decision: Decision, step_s: float) -> str:
        """Note how a step went that took ``step_s`` on the wall clock; return why it was a search's last one, or ""."""
        course, live = self._course, self._live
        if course is None:
            return ""
        team = live.team.plannable
        legs = [np.hypot(*(leg.target_m[:2] - decision.origin_m[leg.vehicle])) for leg in decision.legs]
        course.note(np.array(legs), step_s * self._time_scale)
        away, last = course.away(team), live.header.step >= live.spec.steps
        if away and (course.search.left_s() <= 0 or last) and not course.told_late:
            course.told_late = True
            places = {member.name: member.place_m(live.frame) for member in team}
            far = ", ".join(f"{name} {course.search.way_to_entry_m(places[name]):.0f} m" for name in away)
            why = "the time is up" if course.search.left_s() <= 0 else "every step is done"
            then = "the mission ends where they are" if last else "they go on to the entry"
            message = f"{why} and not everybody is back (from the entry: {far}): {then}"
            await live.journal.alarm(AlarmKind.SEARCH_LATE, message, vehicles=away)
        homebound, homewards = decision.terms.get("homebound", 0.0), decision.terms.get("homewards", 1.0)
        over = course.over(team, int(homebound), homewards=bool(homewards))
        if not over:
            await self._tell_of_standstill(course, team, away)
        return over

    async def _tell_of_standstill(self, course: Course, team: list[Member], away: list[str]) -> None:
        """Raise an alarm, once, where nobody can go anywhere, and end it when somebody goes again."""
        alarms, stuck = self._live.journal, AlarmKind.SEARCH_STUCK
        if course.idle < IDLE_STEPS:
            if course.idle == 0 and alarms.alarms.standing([stuck]):
                await alarms.end([stuck], "a vehicle goes on")
            return
        if course.told_stuck or not (away or course.held(team)):
            return
        course.told_stuck = True
        names = away or [member.name for member in team]
        stand = "stands" if len(names) == 1 else "stand"
        leads, then = (
            ("on, or to the entry", "Bring them there")
            if away
            else ("away from the entry", "The search waits for scans that show one. Look at what stands there")
        )
        message = (
            f"nobody can go anywhere from where {', '.join(names)} {stand}: no way that was looked at is wide enough "
            f"and leads {leads}. {then}, or make search.safety_m smaller in a new mission"
        )
        await alarms.alarm(stuck, message, vehicles=names)
