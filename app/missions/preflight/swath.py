"""The lines of the checklist about full coverage with swath sonars."""

from collections.abc import Iterator

from app.exploration.planners import COVERERS
from app.missions.live.mission import LiveMission
from app.missions.task.swath import swath_sonar
from app.missions.views.mission import CheckStatus, CheckView


def swath_checks(live: LiveMission) -> Iterator[CheckView]:
    """Return what there is to say of vehicles that cover an area: whether their pings lie close enough together."""
    if live.spec.planner.name not in COVERERS:
        return
    for member in live.team:
        sonar = swath_sonar(member.spec)
        if sonar is None:
            continue
        flies, cell_m = live.spec.speed_of(member.spec), live.spec.cell_m
        most = sonar.speed_mps(cell_m)
        apart = f"at {flies:g} m/s and {sonar.rate_hz:g} pings a second they lie {flies / sonar.rate_hz:.2f} m apart"
        dense = flies <= most
        yield CheckView(
            id=f"density.{member.name}",
            title=f"Pings of {member.name}",
            status=CheckStatus.OK if dense else CheckStatus.WARNING,
            message=apart
            + ("" if dense else f": cells of {cell_m:g} m are met by fewer than two, and will not be dense"),
            remedy="" if dense else f"Fly at {most:.2g} m/s at most, or make cell_m larger",
        )
