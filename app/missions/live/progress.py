"""How far a mission has come, how long it still takes, and how it stands in a list."""

import math
from typing import TYPE_CHECKING

import numpy as np

from app.missions.live.remaining import remaining, within_window
from app.missions.search.progress import progress_of
from app.missions.states import ENDED, NOT_STARTED, MissionState
from app.missions.views.mission import MissionSummary, Progress
from app.missions.views.search import SearchProgress

if TYPE_CHECKING:
    from app.missions.live.mission import LiveMission


def figures(live: "LiveMission") -> dict[str, float]:
    """Return how far the mission has come, as each step keeps it."""
    built = live.builder.newest
    found = {
        "coverage_pct": live.builder.coverage_pct(),
        "remaining_pct": live.builder.remaining_pct(),
        "distance_m": live.journal.travelled_m,
    }
    return found | ({} if built is None else {"mean_sd_m": built.mean_sd_m})


def progress(live: "LiveMission") -> Progress:
    """Return how far the mission has come."""
    built = live.builder.newest
    header, counts = live.header, live.counts
    search = search_progress(live)
    left = remaining(live.spec, live.team) if search is None else within_window(search)
    swept = live.builder.ensonified()
    return Progress(
        step=header.step,
        steps=max(live.spec.steps, header.step),
        budget=live.spec.budget,
        minutes_left=left.minutes,
        km_left_per_vehicle=left.km_per_vehicle,
        soundings=counts.accepted,
        rejected=counts.rejected + counts.rejected_pings,
        pings=counts.pings,
        beams=counts.beams,
        ensonified_pct=None if swept is None else swept.ensonified_pct,
        dense_pct=None if swept is None else swept.dense_pct,
        holidays=None if swept is None else len(swept.holidays),
        distance_m=live.journal.travelled_m,
        coverage_pct=live.builder.coverage_pct(),
        remaining_pct=live.builder.remaining_pct(),
        mean_sd_m=built.mean_sd_m if built is not None else None,
        objective=header.objective,
        terms=header.terms or {},
        elapsed_s=header.elapsed_s + live.flight.unstored_s,
        eta_s=_eta_s(live),
        search=search,
    )


def _eta_s(live: "LiveMission") -> float | None:
    """Return how long the mission still takes, wall-clock seconds; a search as long as its time window lasts.

    A survey for a time or a distance takes what is left of that, as its vehicles fly; of steps, what steps took.
    One that ends when its lines are flown takes no longer than these.
    """
    if live.header.state in ENDED:
        return 0.0
    if live.search is not None:
        return max(live.search.left_s(), 0.0) / live.time_scale
    if list(live.team) and not live.team.going_on:
        # What they still fly is their way home.
        return None if live.awaits_batteries else 0.0
    left = remaining(live.spec, live.team)
    if left.minutes is not None and live.header.state not in NOT_STARTED:
        return min(60.0 * left.minutes, _lines_left_s(live)) / live.time_scale
    if live.reports.leg_s is None:
        return None
    committed = [len(m.ahead) + m.ordered for m in live.team.going_on]
    leg_m, flying = live.spec.limits.max_step_m, [*live.team.plannable, *live.team.held]
    legs = [m.way_left_m(live.spec) / leg_m for m in flying] or [live.spec.steps - live.header.step]
    return (max(0.0, *legs) + max(committed, default=0)) * live.reports.leg_s


def _lines_left_s(live: "LiveMission") -> float:
    """Return how long the team flies lines that were asked for, of its time; infinite without such."""
    left_m = (live.header.terms or {}).get("left_m")
    going_on = live.team.going_on
    if left_m is None or not going_on or not live.spec.lines_asked_for:
        return math.inf
    ahead_m = np.array([member.way_ahead_m(live.frame) for member in going_on])
    speeds_mps = np.array([live.spec.speed_of(member.spec) for member in going_on])
    # What nobody has been given yet is dealt so that all are done at the same time.
    return float(max((left_m + ahead_m.sum()) / speeds_mps.sum(), (ahead_m / speeds_mps).max()))


def summary(live: "LiveMission") -> MissionSummary:
    """Return the mission as it stands in a list."""
    header = live.header
    return MissionSummary(
        id=live.id,
        name=live.spec.name,
        state=header.state,
        reason=_why_it_waits(live) or header.reason,
        created_at=header.created_at,
        updated_at=header.updated_at,
        ending=None if live.ending is None or header.state in ENDED else live.ending.state,
        after=live.spec.after,
        progress=progress(live),
    )


def _why_it_waits(live: "LiveMission") -> str:
    trouble = live.journal.storage.trouble
    if not trouble:
        stands = live.flight.standstill and live.header.state is MissionState.RUNNING
        return f"no vehicle can be sent anywhere: {live.flight.standstill}" if stands else ""
    waits = "; the vehicles wait at their waypoints" if live.header.state is MissionState.RUNNING else ""
    return f"nothing can be written down: {trouble}{waits}"


def search_progress(live: "LiveMission") -> SearchProgress | None:
    """Return how a search stands; None in a survey."""
    ended_at = live.header.updated_at if live.header.state in ENDED else None
    return progress_of(live.search, live.team, live.frame, ended_at)
