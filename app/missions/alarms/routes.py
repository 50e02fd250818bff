"""Who is told of an alarm, and after how long. Pure: no clock, no database."""

import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from app.missions.alarm_kinds import AlarmKind, AlarmSeverity
from app.missions.alarm_settings import AlarmSettings, Route
from app.missions.views.alarms import Notice

_NAMESPACE = uuid.UUID("6f0f6a52-9f0e-4d53-8d0d-6a4f5f0f2f5b")
"""Ours, for the ids of deliveries."""


@dataclass(frozen=True, slots=True)
class EscalationStep:
    """Somebody who is told when nobody has acknowledged for so long."""

    recipient: str
    after_s: float


def steps(
    settings: AlarmSettings, kind: AlarmKind, severity: AlarmSeverity, mission_id: str | None, mission_name: str
) -> list[EscalationStep]:
    """Return who is told of an alarm, each once, the first ones first."""
    least_s: dict[str, float] = {}
    for route in _matching(settings, kind, severity, mission_id, mission_name):
        for recipient in route.to:
            least_s[recipient] = min(route.after_s, least_s.get(recipient, route.after_s))
    return sorted((EscalationStep(*item) for item in least_s.items()), key=lambda step: step.after_s)


def due(
    ladder: Sequence[EscalationStep], told_after_s: float | None, age_s: float
) -> tuple[list[EscalationStep], float | None]:
    """Return who is to be told now of an alarm that is so old, and after how long somebody is next; None: nobody is.

    ``told_after_s`` is up to which step was told already; None: nobody was.
    """
    told_s = -1.0 if told_after_s is None else told_after_s
    now = [step for step in ladder if told_s < step.after_s <= age_s]
    return now, next((step.after_s for step in ladder if step.after_s > max(age_s, told_s)), None)


def hears_what_follows(
    settings: AlarmSettings,
    recipient: str,
    kind: AlarmKind,
    severity: AlarmSeverity,
    mission_id: str | None,
    mission_name: str,
) -> bool:
    """Tell whether somebody who was told of an alarm is told who acknowledged it, and that it is over."""
    routes = _matching(settings, kind, severity, mission_id, mission_name)
    return any(route.acknowledgements for route in routes if recipient in route.to)


def delivery_id(alarm_id: str, recipient: str, notice: Notice) -> str:
    """Return the id under which somebody is told: always the same, whoever makes it and whenever."""
    return str(uuid.uuid5(_NAMESPACE, f"{alarm_id}/{notice}/{recipient}"))


def _matching(
    settings: AlarmSettings, kind: AlarmKind, severity: AlarmSeverity, mission_id: str | None, mission_name: str
) -> list[Route]:
    return [
        route
        for route in settings.routes
        if severity.at_least(route.severity)
        and (not route.kinds or kind in route.kinds)
        and (not route.missions or _named(route.missions, mission_id, mission_name))
    ]


def _named(patterns: Sequence[str], mission_id: str | None, mission_name: str) -> bool:
    names = [name for name in (mission_id, mission_name) if name]
    return any(fnmatchcase(name, pattern) for name in names for pattern in patterns)
