"""The vehicles of one mission as its flight sees them."""

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.errors import VehicleNotFoundError
from app.missions.fleet.hub import VehicleKey
from app.missions.fleet.interface import (
    LinkCapabilities,
    LinkState,
    Position,
    VehicleReport,
    WaypointOrder,
    WaypointStatus,
)
from app.missions.flown import Flown, Phase
from app.missions.recovery.energy import Energy
from app.missions.recovery.failsafes import Active
from app.missions.spec.failsafes import Response
from app.missions.spec.limits import Limits
from app.missions.spec.mission import MissionSpec
from app.missions.spec.orders import OrderKind, OrderState
from app.missions.spec.vehicle import VehicleKind, VehicleSpec

SETTLED = frozenset({WaypointStatus.REACHED, WaypointStatus.REFUSED, WaypointStatus.MISSED})
OUT_OF_REACH = frozenset({LinkState.UNKNOWN, LinkState.LOST})


class WithdrawalCause(StrEnum):
    """What kind of reason ended a vehicle's survey."""

    CALLED = "called"
    """A person, a failsafe, or energy that lasts for the way home only: some of its part is left."""
    PART_DONE = "part_done"
    """It has done its part; others may still survey."""
    MISSION_END = "mission_end"
    """Its mission was flown to its end."""


@dataclass(frozen=True, slots=True)
class CommittedLeg:
    """A leg that is decided and written down, and not begun yet; ``number`` counts its vehicle's legs."""

    number: int
    position: Position
    target_m: NDArray[np.float64]
    """Where it ends in the mission's frame, (2,): east, north."""
    surfacing: bool = False
    """Whether it brings its vehicle up for a fix."""
    homeward: bool = False
    """Whether it leads home, or up: it takes nothing of its vehicle's way."""


@dataclass
class OperatorOrder:
    """What an operator ordered a vehicle to do, as long as that is not over; ``corners_m`` (k, 2) is its way."""

    id: int
    kind: OrderKind
    state: OrderState
    corners_m: NDArray[np.float64]
    asked_by: str
    asked_at: datetime


@dataclass(frozen=True, slots=True)
class Swath:
    """How far a ping met the bottom to port and to starboard, metres; ``time_s`` by the vehicle's clock."""

    time_s: float
    port_m: float
    starboard_m: float


@dataclass
class Withdrawal:
    """A vehicle surveys no more, for now or for good.

    Attributes
    ----------
    response
        What it does instead: never ``WARN``.
    why
        Shown to the operator.
    over
        Whether it has come to where that leads: home, up, stopped.
    led
        Whether it was sent on its way in this run.
    asked
        Whether a person wanted it: then only a person ends it.
    below
        Whether it waits below for ships to pass: it would come up where it is.
    cause
        What kind of reason that was.
    told
        Whether the mission's log says so, that of an earlier run of the service too.
    """

    response: Response
    why: str
    over: bool = False
    led: bool = False
    asked: bool = False
    below: bool = False
    cause: WithdrawalCause = WithdrawalCause.CALLED
    told: bool = False

    @property
    def done(self) -> bool:
        """Whether it has flown its part, or its mission was flown to its end."""
        return self.cause is not WithdrawalCause.CALLED

    def remember(self) -> dict[str, Any]:
        """Return what is stored, so that a restart goes on with it."""
        facts = {"response": self.response, "why": self.why, "over": self.over, "asked": self.asked}
        return facts | {"cause": self.cause}

    @classmethod
    def recall(cls, stored: dict[str, Any] | None) -> "Withdrawal | None":
        """Return what was stored."""
        if not stored:
            return None
        response, cause = Response(stored["response"]), WithdrawalCause(stored["cause"])
        return cls(response, stored["why"], stored["over"], asked=stored["asked"], cause=cause, told=True)


@dataclass(frozen=True, slots=True)
class WayHome:
    """A vehicle's way home from about where it is.

    Attributes
    ----------
    corners_m : (n, 2)
        None: it has none, or it is not known yet.
    needs_s
        How long it takes; None as for the corners.
    drift_reserve_s
        What the vehicle's reserve has for a drift while nobody hears it.
    left_alone_m : (n, 2)
        Its corners from anywhere on the vehicle's leg, for one that gets no further order.
    turn_back_m : (2,)
        Where on its planned legs it has to turn back at the latest; None: on none of them, or not known.
    """

    corners_m: NDArray[np.float64] | None = None
    needs_s: float | None = None
    drift_reserve_s: float = 0.0
    left_alone_m: NDArray[np.float64] | None = None
    turn_back_m: NDArray[np.float64] | None = None


@dataclass
class FixTimes:
    """Fixes of a vehicle at the surface, times by its clock.

    Attributes
    ----------
    submerged_s
        How long it has been under water since its last one.
    surfaced_s
        How long it has been at the surface now.
    risings
        How often it was sent up for one.
    """

    submerged_s: float = 0.0
    surfaced_s: float = 0.0
    risings: int = 0


@dataclass
class OrderedLeg:
    """The leg that a vehicle was ordered to fly.

    Attributes
    ----------
    start_m : (2,)
        Where it begins.
    began_s
        When it was ordered, the event loop's time.
    allowed_s
        How long it may take, by the vehicles' clock.
    """

    start_m: NDArray[np.float64] | None = None
    began_s: float = 0.0
    allowed_s: float = 0.0


@dataclass
class Member:
    """A vehicle that takes part. ``slot`` is its place in the depth stack."""

    spec: VehicleSpec
    slot: int
    capabilities: LinkCapabilities = field(default_factory=LinkCapabilities)
    report: VehicleReport | None = None
    swath: Swath | None = None
    """What its swath sonar saw last."""
    heard_s: float | None = None
    """When that was, Unix seconds by the service's clock."""
    clock_ahead_s: float | None = None
    """By how much its clock was ahead of ours at most, its seconds; None: not known yet."""
    stored_battery_pct: float | None = None
    """What its battery held when another process heard it last."""
    flown: Flown = field(default_factory=Flown)
    left_at: datetime | None = None
    """When it left the mission; None while it takes part."""
    link: LinkState = LinkState.UNKNOWN
    engaged: bool = False
    followed: bool = False
    """Whether it ever followed in this run, or may have: one that then refuses, or is silent, is an alarm."""
    refusal: str = ""
    order: WaypointOrder | None = None
    target_m: NDArray[np.float64] | None = None
    """Where its order leads in the mission's frame, (2,): east, north."""
    status: WaypointStatus | None = None
    reason: str = ""
    _placed: tuple[Position, LocalFrame, tuple[float, float]] | None = field(default=None, repr=False, compare=False)
    """Its last reported position, and where that is in a frame: asked for again and again."""
    surfacing: bool = False
    """Whether its waypoint brings it up for a fix."""
    fixes: FixTimes = field(default_factory=FixTimes)
    """When it had fixes at the surface, and how often it was sent up for one."""
    pursuing: str | None = None
    """The target for which it left the mapping."""
    ahead: list[CommittedLeg] = field(default_factory=list)
    """Its legs after the one of its order, first to last."""
    legs: int = 0
    """Number of the last leg that was committed for it."""
    misses: int = 0
    """How many legs in a row it did not get to the end of."""
    committed_m: float = 0.0
    """How long all legs are together that were committed for it, but for those that it was spared."""
    late_m: float = 0.0
    """How much farther it could have come in the time that a mission of so many minutes counts: turns, waiting."""
    spared: int = 0
    """How many legs were given up before it began them: they take nothing of how far it may be sent."""
    withdrawal: Withdrawal | None = None
    """Why it does not survey; None while it does."""
    energy: Energy = field(default_factory=lambda: Energy(1.0))
    way_home: WayHome = field(default_factory=WayHome)
    """Its way home from about where it is, as that was looked at last."""
    failsafes: list[Active] = field(default_factory=list)
    """What is in force for it, the strongest response first."""
    asked: OperatorOrder | None = None
    """What its operator ordered; None: it does its part."""
    waits_m: NDArray[np.float64] | None = None
    """Centre of the circle in which it was sent to wait, (2,); None: it was not, or has an order since."""
    leg: OrderedLeg = field(default_factory=OrderedLeg)
    """The leg of its order: where it begins, and its time."""
    lets_pass: bool = False
    """Whether it was led aside from its leg to let another vehicle pass, and the time for its leg stands still."""
    asides: int = 0
    """How often it was led aside from its leg to let another vehicle pass."""

    @property
    def name(self) -> str:
        """The vehicle's name."""
        return self.spec.name

    @property
    def key(self) -> VehicleKey:
        """What the hub knows the vehicle by."""
        return self.spec.kind, self.spec.name

    @property
    def controllable(self) -> bool:
        """Whether it can be given orders now: it follows us, told where it is, and is in reach; withdrawn or not."""
        return self.engaged and self.report is not None and self.link not in OUT_OF_REACH

    @property
    def ordered(self) -> bool:
        """Whether it has a waypoint that is not settled, whether or not it can be reached now."""
        return self.order is not None and self.status not in SETTLED

    @property
    def busy(self) -> bool:
        """Whether it is on its way to a waypoint."""
        return self.ordered and self.link not in OUT_OF_REACH

    @property
    def left_alone(self) -> bool:
        """Whether it can be reached and does not follow: another console has it, or it refuses."""
        return self.followed and not self.engaged and self.link not in OUT_OF_REACH

    @property
    def unsent(self) -> bool:
        """Whether it has a waypoint that was never sent, as when its link was lost just then."""
        return self.order is not None and self.status is WaypointStatus.PLANNED

    @property
    def plannable(self) -> bool:
        """Whether the survey can be planned for it: it is controllable, and not withdrawn for now or for good."""
        return self.controllable and self.withdrawal is None

    @property
    def flies_survey(self) -> bool:
        """Whether its legs are the survey's: those of a way home are none."""
        return self.withdrawal is None or self.withdrawal.response is Response.HOLD

    @property
    def is_home(self) -> bool:
        """Whether it came home."""
        return self.withdrawal is not None and self.withdrawal.over and self.withdrawal.response is Response.RETURN

    def set_order(self, order: WaypointOrder | None, target_m: NDArray[np.float64] | None = None) -> None:
        """Give it an order and where that leads, or take its order away."""
        self.order, self.target_m, self.waits_m = order, target_m, None
        self.lets_pass, self.asides = False, 0

    def last_end_m(self, frame: LocalFrame) -> NDArray[np.float64]:
        """Return where its last committed leg ends, (2,), or where it is when it has none to fly."""
        if self.ahead:
            return self.ahead[-1].target_m
        return self.target_m if self.busy and self.target_m is not None else self.place_m(frame)

    def way_left_m(self, spec: MissionSpec) -> float:
        """Return how far it may be sent yet, beyond the legs that are committed for it."""
        allowance = spec.allowance(self.spec)
        if allowance.metres is not None:
            return max(allowance.metres - self.committed_m - self.late_m, 0.0)
        return max(allowance.most_legs(spec.limits.max_step_m) - self.legs + self.spared, 0) * spec.limits.max_step_m

    def count_late(self, spec: MissionSpec, frame: LocalFrame) -> None:
        """Count how far it is behind its legs by the time in which it surveyed; who is ahead of them is not late."""
        if spec.budget.minutes is not None:
            come_m = self.committed_m - self.way_ahead_m(frame)
            self.late_m = max(self.flown.survey_s * spec.speed_of(self.spec) - come_m, 0.0)

    def way_ahead_m(self, frame: LocalFrame) -> float:
        """Return how long what is left of its leg is, and the legs after it."""
        ends = [leg.target_m for leg in self.ahead]
        if self.ordered and self.target_m is not None:
            ends.insert(0, self.target_m)
        if ends and self.report is not None:
            ends.insert(0, self.place_m(frame))
        return sum(float(np.hypot(*(b - a))) for a, b in pairwise(ends))

    def legs_ahead_m(self) -> NDArray[np.float64]:
        """Return where what it has been sent to and the legs after that end, (n, 2), first to last."""
        ends = [leg.target_m for leg in self.ahead]
        if self.ordered and self.target_m is not None:
            ends.insert(0, self.target_m)
        return np.array(ends).reshape(-1, 2)

    def cruise_depth_m(self, limits: Limits) -> float:
        """Return the depth it travels at where the bottom leaves room: as asked for, or its place in the stack."""
        if self.spec.depth_m is not None:
            return self.spec.depth_m
        return min(limits.min_depth_m + self.slot * limits.min_vertical_separation_m, limits.max_depth_m)

    @property
    def altitude_m(self) -> float:
        """Height above the bottom that it is to keep; NaN where it keeps a depth."""
        asked = self.spec.altitude_m
        return math.nan if asked is None or self.capabilities.keeps_depth else asked

    def place_m(self, frame: LocalFrame) -> NDArray[np.float64]:
        """Return its last reported place, (2,): east and north in the mission's frame."""
        if self.report is None:
            raise ValueError(f"{self.name} has not reported a position yet")
        position = self.report.position
        if self._placed is None or self._placed[0] is not position or self._placed[1] is not frame:
            east, north = frame.to_local(np.array(position.lat_deg), np.array(position.lon_deg))
            self._placed = position, frame, (float(east), float(north))
        return np.array(self._placed[2])


@dataclass
class Team:
    """All vehicles of a mission, by name, in the order of their slots."""

    capabilities_of: Callable[[VehicleKind], LinkCapabilities] = lambda _kind: LinkCapabilities()
    """Returns what vehicles of a kind can do."""
    energy_of: Callable[[VehicleSpec], Energy] = lambda _spec: Energy(1.0)
    """Returns the count of what a vehicle uses, which has seen nothing yet."""
    members: dict[str, Member] = field(default_factory=dict)
    departed: dict[str, Member] = field(default_factory=dict)
    """Those that took part and do not any more, as they were last."""

    def join(self, spec: VehicleSpec, slot: int) -> Member:
        """Add a vehicle, or take one back."""
        before = self.departed.pop(spec.name, None)
        member = Member(spec, slot, self.capabilities_of(spec.kind), energy=self.energy_of(spec))
        if before is not None and before.key == member.key:
            member.report, member.heard_s, member.fixes.risings = before.report, before.heard_s, before.fixes.risings
            member.clock_ahead_s = before.clock_ahead_s
            member.stored_battery_pct = before.stored_battery_pct
            member.legs, member.committed_m, member.spared = before.legs, before.committed_m, before.spared
            member.flown, member.late_m = before.flown, before.late_m
            member.energy.used_s = before.energy.used_s
        self.members[spec.name] = member
        return member

    def leave(self, name: str, at: datetime) -> None:
        """Take a vehicle out; what was last known of it stays."""
        member = self.members.pop(name, None)
        if member is not None:
            member.left_at, member.status, member.pursuing = at, None, None
            member.flown.phase = Phase.HOME if member.is_home else Phase.STOPPED
            member.set_order(None)
            member.ahead.clear()
            member.engaged = member.surfacing = False
            self.departed[name] = member

    def __iter__(self) -> Iterator[Member]:
        return iter(list(self.members.values()))

    def get(self, name: str) -> Member | None:
        """Return the vehicle of this name, if it takes part."""
        return self.members.get(name)

    def named(self, name: str) -> Member:
        """Return the vehicle of this name. Raises VehicleNotFoundError when it takes no part."""
        member = self.members.get(name)
        if member is None:
            those = ", ".join(self.members) or "none"
            raise VehicleNotFoundError(f"vehicle {name!r} takes no part in this mission", f"those that do: {those}")
        return member

    @property
    def specs(self) -> list[VehicleSpec]:
        """How those that take part are described."""
        return [member.spec for member in self.members.values()]

    @property
    def told_current_mps(self) -> tuple[float, float] | None:
        """Velocity of the water, east and north: what vehicles tell of it, on average; None: none tells of it."""
        told = [m.report.current_mps for m in self if m.report is not None and m.report.current_mps is not None]
        if not told:
            return None
        east, north = np.mean(told, axis=0)
        return float(east), float(north)

    @property
    def current_mps(self) -> tuple[float, float]:
        """The same as it is counted with: none while no vehicle tells of one."""
        return self.told_current_mps or (0.0, 0.0)

    @property
    def plannable(self) -> list[Member]:
        """Those that the survey can be planned for: controllable, and not withdrawn."""
        return [m for m in self.members.values() if m.plannable]

    @property
    def surveying(self) -> list[Member]:
        """Those that take part in the survey, whether or not they can be reached now."""
        return [m for m in self.members.values() if m.withdrawal is None]

    @property
    def going_on(self) -> list[Member]:
        """Those that survey, or may again when they are not held any more."""
        return [*self.surveying, *self.held]

    @property
    def at_rest(self) -> list[Member]:
        """Those that lie where they were to be in the end: home, up or stopped."""
        return [
            m for m in self.members.values() if m.withdrawal is not None and m.withdrawal.over and m.report is not None
        ]

    def awaits_batteries(self, spec: MissionSpec) -> bool:
        """Whether nobody surveys, and who is home with some of its way left, or goes there, is waited for."""
        if spec.recovery is None or not spec.recovery.wait_for_batteries or spec.search is not None or self.going_on:
            return False
        called = [m.withdrawal for m in self.members.values() if m.withdrawal is not None]
        return any(one.response is Response.RETURN and not one.done for one in called)

    def missed_words(self, besides: Collection[str] = ()) -> str:
        """Return who missed legs, as words after a reason; '' where nobody did. ``besides``: who was named before."""
        missed = [
            f"{m.name} missed {m.flown.legs_missed} of its {m.flown.legs_missed + m.flown.legs_reached} legs"
            for m in self.members.values()
            if m.flown.legs_missed and m.name not in besides
        ]
        return f", {'' if besides else 'but '}{', '.join(missed)}" if missed else ""

    @property
    def held(self) -> list[Member]:
        """Those that wait where they are, for a person or for something to be over, and may survey again."""
        return [m for m in self.members.values() if m.withdrawal is not None and m.withdrawal.response is Response.HOLD]
