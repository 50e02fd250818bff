"""What stands before the start of a search, beside what stands before every start."""

from collections.abc import Iterator

import numpy as np

from app.exploration.site_search.ground import UNREACHED, SiteGround
from app.missions.live.mission import LiveMission
from app.missions.live.watchers.vehicles import local_place
from app.missions.search.course import FIRST_PACE
from app.missions.search.state import Search
from app.missions.spec.mission import MissionSpec
from app.missions.views.mission import CheckStatus, CheckView

OK, NOTE, WARNING, PROBLEM = CheckStatus.OK, CheckStatus.NOTE, CheckStatus.WARNING, CheckStatus.PROBLEM


def search_checks(live: LiveMission) -> Iterator[CheckView]:
    """Return the lines of the checklist that only a search has; none for other missions."""
    search = live.search
    if search is None:
        return
    yield _ways(search, live.spec)
    for member in live.team:
        report = member.report or live.hub.info(member.key).report
        place = None if report is None else local_place(live.frame, report.position)
        if place is not None:
            away_m = search.way_to_entry_m(np.array(place))
            far = away_m > search.home_radius_m(len(list(live.team)))
            yield CheckView(
                id=f"entry.{member.name}",
                title=f"{member.name} at the entry",
                status=WARNING if far else OK,
                message=f"{away_m:.0f} m from it",
                remedy="Bring it to the entry: it is not sent where nobody has looked" if far else "",
            )
        if not member.capabilities.scans:
            seen = place is not None and search.knows(np.array(place))
            yield CheckView(
                id=f"scans.{member.name}",
                title=f"Scans of {member.name}",
                status=OK if seen else NOTE,
                message="they come" if seen else "none tells yet what is around it; the search waits for one",
                remedy="" if seen else f"Let it post to /api/v1/missions/{live.id}/scans",
            )
        circles_m = member.capabilities.circles_m
        if search.spec.safety_m < circles_m:
            yield CheckView(
                id=f"circles.{member.name}",
                title=f"Room for {member.name}",
                status=WARNING,
                message=f"it circles within {circles_m:g} m of its waypoints unless it can hover; "
                f"search.safety_m is {search.spec.safety_m:g} m",
                remedy="Make search.safety_m larger, or be sure that the vehicle can stand still",
            )


def _ways(search: Search, spec: MissionSpec) -> CheckView:
    """Return whether vehicles can leave the entry and get to the goal area and back, by what is known of the site."""
    task = search.task(0.0)
    ground = SiteGround.of(task)
    start = np.zeros_like(task.in_goal)
    row, col = ground.places(search.site.entry_m[None])[0]
    start[row, col] = True
    far = ground.hoped(start)
    around = far[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2]
    title, check = "Ways of the search", "search.ways"
    least_m = search.spec.safety_m + search.spare_m + task.grid.cell_m
    if search.spec.scanner.reach_m <= least_m:
        return CheckView(
            id=check,
            title=title,
            status=WARNING,
            message=f"the scanner reaches {search.spec.scanner.reach_m:g} m, and legs keep {search.spec.safety_m:g} m "
            "and half the arrival radius from what nobody has looked at: no vehicle gets away from where it is",
            remedy=f"Make search.safety_m smaller, or search.scanner.reach_m larger than {least_m:g} m where it is",
        )
    if task.grid.blueprint[row, col] or np.count_nonzero(around < UNREACHED) < 2:
        return CheckView(
            id=check,
            title=title,
            status=PROBLEM,
            message=f"known obstacles stand closer to the entry than search.safety_m, {search.spec.safety_m:g} m: no "
            "vehicle gets away from it",
            remedy="Move search.entry, or make search.safety_m smaller",
        )
    if not (task.in_goal & ~task.grid.blueprint).any():
        radius_m = search.spec.goal_radius_m
        why = "known obstacles cover it" if task.in_goal.any() else f"no cell's centre is within {radius_m:g} m of it"
        return CheckView(
            id=check,
            title=title,
            status=WARNING,
            message=f"the goal area holds no open cell: {why}; nobody will look at it, and its share stays 0 %",
            remedy=f"Move search.goal, or make search.goal_radius_m larger; cells are {task.grid.cell_m:g} m wide",
        )
    goal_m = ground.metres(int(far[task.in_goal].min(initial=UNREACHED))).item()
    if not np.isfinite(goal_m):
        return CheckView(
            id=check,
            title=title,
            status=WARNING,
            message="known obstacles bar every way from the entry to the goal area",
            remedy="Check search.goal, search.obstacles and keep-out zones",
        )
    there_and_back_s = 2 * goal_m / (FIRST_PACE * spec.speed_mps)
    short = there_and_back_s > search.left_s()
    return CheckView(
        id=check,
        title=title,
        status=WARNING if short else OK,
        message=f"{goal_m:.0f} m to the goal area; there and back about {there_and_back_s / 60:.0f} of "
        f"{search.left_s() / 60:.0f} min",
        remedy="Make search.window_s longer: nobody will get to the goal area" if short else "",
    )
