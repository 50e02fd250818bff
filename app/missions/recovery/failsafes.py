"""The one table of failsafes: what is detected, what is done then, and how long it must last before and after."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from app.missions.recovery.way_home import LEAST_SHARE
from app.missions.spec.failsafes import Failsafe, Response

STRENGTH = {response: number for number, response in enumerate(Response)}


@dataclass(frozen=True, slots=True)
class Rule:
    """One line of the table.

    Attributes
    ----------
    detected, shown
        What is detected, and what the operator sees.
    response
        What is done unless the mission says otherwise.
    after_s, over_s
        How long it must last before anything is done, and how long it must be gone before it counts as over; seconds of
        the vehicles' time.
    """

    detected: str
    response: Response
    shown: str
    after_s: float = 0.0
    over_s: float = 10.0


LOW_RATIO, LOW_RESERVE_S = 1.1, 60.0
"""A vehicle turns back when what it has for sure is this many times its way home, and so much more."""

UNHEARD_S = 240.0
"""So long may a vehicle that is not heard drift without its motor: from a minute on, until DUNE brings it home."""

LAST_S = 90.0
"""A vehicle that will not get home goes on towards it until so little is left, then it comes up while it still can."""

LINK_LOST_S = 300.0
"""After so long a silence DUNE's own supervisor brings a vehicle home: so does the service, as soon as it is heard."""

CRITICAL_PCT, LOW_PCT = 10.0, 15.0
"""Levels that count where no recovery point, or nothing of the vehicle's consumption, is known."""

DEPTH_OVERSHOOT_M = 2.0
"""A vehicle may be this much deeper than the mission's limit for a while."""

ALTITUDE_SHARE = 0.5
"""Part of the least altitude below which a vehicle is too deep."""

POSITION_LOST_M = 50.0
"""A vehicle that states a larger standard deviation of its position does not know where it is."""

TABLE: Mapping[Failsafe, Rule] = {
    Failsafe.LEAK: Rule("the vehicle reports water inside", Response.SURFACE, "alarm: leak"),
    Failsafe.CRITICAL_ENERGY: Rule(
        f"what it has left does not last for its way home, and less than {LAST_S:g} s; without a way home a battery "
        f"below {CRITICAL_PCT:g} %",
        Response.SURFACE,
        "alarm: it cannot come home",
        after_s=10.0,
        over_s=60.0,
    ),
    Failsafe.TOO_DEEP: Rule(
        f"more than {DEPTH_OVERSHOOT_M:g} m deeper than limits.max_depth_m, or closer to the bottom than "
        f"{ALTITUDE_SHARE:g} of limits.min_altitude_m",
        Response.SURFACE,
        "alarm: too deep",
        after_s=10.0,
    ),
    Failsafe.POSITION_LOST: Rule(
        f"it states a standard deviation of its position above {POSITION_LOST_M:g} m",
        Response.SURFACE,
        "alarm: it does not know where it is",
        after_s=10.0,
    ),
    Failsafe.NO_POSITION: Rule(
        "it is heard and does not tell where it is; IMC vehicles are brought up by then, and go on when they tell",
        Response.WARN,
        "alarm: how old its position is",
        after_s=7.0,
    ),
    Failsafe.LOW_ENERGY: Rule(
        f"what it has left for sure is less than {LOW_RATIO:g} of its way home, {LOW_RESERVE_S:g} s, and what makes up "
        f"for a drift of {UNHEARD_S:g} s; without a recovery point a battery below {LOW_PCT:g} %",
        Response.RETURN,
        "alarm: it turns back; over when it was charged",
        after_s=2.0,
        over_s=60.0,
    ),
    Failsafe.LINK_LOST: Rule(
        f"silent for {LINK_LOST_S:g} s, unless that is expected",
        Response.RETURN,
        "alarm: link lost; it is sent home as soon as it is heard",
        after_s=LINK_LOST_S,
    ),
    Failsafe.TRAFFIC: Rule(
        "a ship (AIS) comes closer than ais.cpa_m within ais.cpa_s to a vehicle that is at or near the surface, or "
        "will be",
        Response.WARN,
        "alarm: which ship, how close, how soon; with `hold` it waits below, no longer than ais.hold_s",
        after_s=3.0,
        over_s=30.0,
    ),
    Failsafe.GEOFENCE_LEFT: Rule(
        "in a keep-out zone, or outside the area while it surveys",
        Response.WARN,
        "alarm: outside its bounds",
        after_s=20.0,
    ),
    Failsafe.SEPARATION_LOST: Rule(
        "closer to another vehicle at its depth than limits.min_separation_m",
        Response.WARN,
        "warning: too close",
        after_s=3.0,
    ),
    Failsafe.VEHICLE_ERROR: Rule("the vehicle reports an error", Response.WARN, "alarm: the vehicle's own words"),
    Failsafe.OTHER_CONSOLE: Rule(
        "it followed this mission and now follows somebody else", Response.WARN, "alarm: who has it", after_s=5.0
    ),
    Failsafe.ALL_LINKS_LOST: Rule(
        "no vehicle of the mission is heard any more", Response.WARN, "alarm: all links lost", after_s=30.0
    ),
    Failsafe.SERVICE_RESTARTED: Rule(
        "the mission was taken up by a new process while it ran",
        Response.WARN,
        "the log says so; vehicles go on with what was committed",
    ),
}
"""In order of priority: of two with the same response the first is told."""

TOLD_BY_VEHICLES = frozenset(
    {
        Failsafe.LEAK,
        Failsafe.CRITICAL_ENERGY,
        Failsafe.TOO_DEEP,
        Failsafe.POSITION_LOST,
        Failsafe.NO_POSITION,
        Failsafe.LOW_ENERGY,
        Failsafe.GEOFENCE_LEFT,
        Failsafe.VEHICLE_ERROR,
        Failsafe.OTHER_CONSOLE,
    }
)
"""What is known of a vehicle by what it sends only: of one that is silent nobody knows whether they are over."""


@dataclass(frozen=True, slots=True)
class Active:
    """A failsafe that is in force for a vehicle."""

    failsafe: Failsafe
    response: Response
    message: str


@dataclass
class FailsafeJudge:
    """Decides for one vehicle what is done, from what is detected and for how long.

    Parameters
    ----------
    overrides
        The mission's own responses.
    """

    overrides: Mapping[Failsafe, Response] = field(default_factory=dict)
    _since_s: dict[Failsafe, float] = field(default_factory=dict)
    _seen_s: dict[Failsafe, float] = field(default_factory=dict)
    _messages: dict[Failsafe, str] = field(default_factory=dict)
    _active: set[Failsafe] = field(default_factory=set)

    def judge(
        self, detected: Mapping[Failsafe, str], now_s: float, unknown: Collection[Failsafe] = frozenset()
    ) -> list[Active]:
        """Return what is in force now, the strongest response first.

        Parameters
        ----------
        detected
            What is the case now, with the words for the operator.
        now_s
            Vehicles' time, which only grows.
        unknown
            What cannot be told now. Of these what is in force stays so, and what was the case counts from then.
        """
        for failsafe, message in detected.items():
            self._since_s.setdefault(failsafe, now_s)
            self._seen_s[failsafe] = now_s
            self._messages[failsafe] = message
            if now_s - self._since_s[failsafe] >= TABLE[failsafe].after_s:
                self._active.add(failsafe)
        for failsafe in [f for f in self._since_s if f not in detected]:
            if failsafe in unknown:
                self._seen_s[failsafe] = now_s
            elif failsafe not in self._active:
                del self._since_s[failsafe]
            elif now_s - self._seen_s[failsafe] >= TABLE[failsafe].over_s:
                self._active.discard(failsafe)
                del self._since_s[failsafe]
        return self.active

    @property
    def looming(self) -> set[Failsafe]:
        """What is detected, in force or not yet."""
        return set(self._since_s)

    @property
    def active(self) -> list[Active]:
        """What is in force, the strongest response first; of equals in the table's order."""
        order = list(TABLE)
        return sorted(
            (Active(f, self.response(f), self._messages[f]) for f in self._active),
            key=lambda one: (-STRENGTH[one.response], order.index(one.failsafe)),
        )

    def response(self, failsafe: Failsafe) -> Response:
        """Return what this mission does about a failsafe."""
        return self.overrides.get(failsafe, TABLE[failsafe].response)


def with_reserve_s(needs_s: float, drift_s: float = 0.0) -> float:
    """Return what a vehicle has to have left for a way home that takes so long; ``drift_s`` for a drift, too."""
    return LOW_RATIO * needs_s + LOW_RESERVE_S + drift_s


def drift_reserve_s(speed_mps: float, current_mps: tuple[float, float]) -> float:
    """Return how long a vehicle takes to come back to where it was not heard any more and gave up its waypoint.

    Meanwhile its motor is off and the current takes it along, east and north, wherever to.
    """
    strength_mps = math.hypot(*current_mps)
    return UNHEARD_S * strength_mps / max(speed_mps - strength_mps, LEAST_SHARE * speed_mps)


def table_text() -> str:
    """Return the table as Markdown."""
    lines = [
        "| failsafe | detected | after | done | over after | the operator sees |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| `{failsafe}` | {rule.detected} | {rule.after_s:g} s | {rule.response} | {rule.over_s:g} s | {rule.shown} |"
        for failsafe, rule in TABLE.items()
    ]
    return "\n".join(lines) + "\n"
