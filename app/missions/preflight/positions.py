"""Lines of the checklist on how old and how sure the positions of vehicles are."""

from collections.abc import Iterator

from app.missions.live.mission import LiveMission
from app.missions.spec.mission import MissionSpec
from app.missions.views.mission import CheckStatus, CheckView

OLD_S = 120.0
"""Who waits for a start tells where it is more often than this, wall-clock seconds."""

SURE_M = 10.0
"""Standard deviation of a position by GPS under an open sky, with room; a mission's surface policy may say less."""


def position_checks(live: LiveMission) -> Iterator[CheckView]:
    """Return a line for each vehicle that has told where it is, but simulated ones: they are put where they begin."""
    most_m = _most_sd_m(live.spec)
    for member in live.team:
        info = live.hub.info(member.key)
        if info.report is None or member.capabilities.simulated:
            continue
        age_s, sd_m = info.report_age_s, info.report.position_sd_m
        is_old = age_s is not None and age_s > OLD_S
        is_vague = sd_m is not None and sd_m > most_m
        told = "" if age_s is None else f"told {_spoken(age_s)} ago"
        known = "how well it is known is not told" if sd_m is None else f"known to ±{sd_m:.1f} m"
        remedies = [
            "Let it tell where it is: its link or its navigation may have stopped" if is_old else "",
            f"Let it come to the surface for a fix: at most ±{most_m:g} m is good" if is_vague else "",
        ]
        yield CheckView(
            id=f"position.{member.name}",
            title=f"Position of {member.name}",
            status=CheckStatus.WARNING if is_old or is_vague else CheckStatus.OK,
            message=", ".join(words for words in (told, known) if words),
            remedy="; ".join(words for words in remedies if words),
        )


def _most_sd_m(spec: MissionSpec) -> float:
    policy = spec.surface_policy
    return SURE_M if policy is None or policy.max_position_sd_m is None else policy.max_position_sd_m


def _spoken(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < OLD_S else f"{seconds / 60.0:.0f} min"
