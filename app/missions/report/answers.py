"""What a report is made of: answers of REST as they are, and the map that its pictures are drawn from."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from app.arrays import FloatArray
from app.mapping.s44 import Order
from app.missions.maps.snapshot import MapSnapshot


@dataclass(frozen=True)
class Incident:
    """An alarm or a failsafe of the mission's log."""

    time: str
    level: str
    kind: str
    failsafe: str
    response: str
    message: str


@dataclass(frozen=True)
class Answers:
    """What is known of a mission when its report is made.

    Attributes
    ----------
    rest
        What REST answers, by name: ``mission``, ``map``, ``quality``, ``corrections``, ``casts``, ``adjustment``,
        ``crosslines``, ``pings``, ``imports`` and, where the mission has them, ``holidays``, ``uncertainty_budget`` and
        ``reference``. ``period`` holds the times of the first and last sounding, ``rejected`` how many soundings each
        state has that is not used, ``refusals`` why, and how many each (numbers in reasons are left out), ``files``
        name, title, size and SHA-256 of files.
    tracks_m
        By vehicle its track, (n, 2) east and north.
    """

    rest: Mapping[str, Any]
    order: Order
    snapshot: MapSnapshot
    made_s: int
    authority: str = ""
    incidents: Sequence[Incident] = ()
    tracks_m: Mapping[str, FloatArray] = field(default_factory=dict)
    files_left_off: Sequence[str] = ()
    versions: Mapping[str, str] = field(default_factory=dict)

    def at(self, source: str) -> Any:
        """Return the value at a place of an answer. Raises KeyError, IndexError where there is none."""
        found: Any = self.rest
        for step in source.split("."):
            found = found[int(step)] if isinstance(found, list) else found[step]
        return found

    def has(self, name: str) -> bool:
        """Tell whether there is such an answer, and something in it."""
        return bool(self.rest.get(name))


def as_value(value: object) -> str:
    """Return a value as REST writes it."""
    return json.dumps(value)
