"""One vehicle of a mission as its flight sees it."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from app.mapping.coordinates.georeference import LocalFrame
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
from app.missions.recovery.failsafes import STRENGTH, Active
from app.missions.spec.failsafes import Response
from app.missions.spec.limits import Limits
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.team.legs import CommittedLeg, CommittedWay, OperatorOrder, OrderedLeg
from app.missions.team.reported import FixTimes, Swath
from app.missions.team.withdrawal import WayHome, Withdrawal

SETTLED = frozenset({WaypointStatus.REACHED, WaypointStatus.REFUSED, WaypointStatus.MISSED})
OUT_OF_REACH = frozenset({LinkState.UNKNOWN, LinkState.LOST})


@dataclass
class Member:
    """A vehicle that takes part: its fields are grouped by who changes them.

    Attributes
    ----------
    slot
        Its place in the depth stack.
    """

    # As it was declared when it joined.

    spec: VehicleSpec
    slot: int
    capabilities: LinkCapabilities = field(default_factory=LinkCapabilities)
    left_at: datetime | None = None
    """When it left the mission; None while it takes part."""

    # What it reports, and what follows: changed by the mission's ``VehicleReports``.

    report: VehicleReport | None = None
    """What it said last; before it was heard in this run what is stored, or what its link heard."""
    heard_s: float | None = None
    """When that was, Unix seconds by the service's clock."""
    clock_ahead_s: float | None = None
    """By how much its clock was ahead of ours at most, its seconds; None: not known yet."""
    stored_battery_pct: float | None = None
    """What its battery held when another process heard it last."""
    swath: Swath | None = None
    """What its swath sonar saw last."""
    flown: Flown = field(default_factory=Flown)
    """What it has flown, and what it is at."""
    fixes: FixTimes = field(default_factory=FixTimes)
    """When it had fixes at the surface, and how often it was sent up for one."""
    energy: Energy = field(default_factory=lambda: Energy(1.0))
    _placed: tuple[Position, LocalFrame, tuple[float, float]] | None = field(default=None, repr=False, compare=False)
    """Its last reported position, and where that is in a frame: asked for again and again."""

    # Whether it follows: changed by what engages vehicles, and whoever stops them.

    link: LinkState = LinkState.UNKNOWN
    engaged: bool = False
    followed: bool = False
    """Whether it ever followed in this run, or may have: one that then refuses, or is silent, is an alarm."""
    refusal: str = ""
    """Why it would not follow when it was asked last."""

    # Its legs: committed, then ordered one by one, by the flight's legs; what became of them its reports say.

    committed: CommittedWay = field(default_factory=CommittedWay)
    """How far all is that was committed for it."""
    ahead: list[CommittedLeg] = field(default_factory=list)
    """Its legs after the one of its order, first to last."""
    order: WaypointOrder | None = None
    target_m: NDArray[np.float64] | None = None
    """Where its order leads in the mission's frame, (2,): east, north."""
    leg: OrderedLeg = field(default_factory=OrderedLeg)
    """The leg of its order: where it begins, and its time."""
    status: WaypointStatus | None = None
    """What became of its order; None: it has none."""
    reason: str = ""
    misses: int = 0
    """How many legs in a row it did not get to the end of."""
    surfacing: bool = False
    """Whether its waypoint brings it up for a fix."""
    pursuing: str | None = None
    """The target for which it left the mapping."""

    # Where it waits: changed by what leads vehicles aside, or has them circle.

    waits_m: NDArray[np.float64] | None = None
    """Centre of the circle in which it was sent to wait, (2,); None: it was not, or has an order since."""
    lets_pass: bool = False
    """Whether it was led aside from its leg to let another vehicle pass, and the time for its leg stands still."""
    asides: int = 0
    """How often it was led aside from its leg to let another vehicle pass."""

    # Its safety: looked at by the failsafes' watch.

    way_home: WayHome = field(default_factory=WayHome)
    """Its way home from about where it is, as that was looked at last."""
    failsafes: list[Active] = field(default_factory=list)
    """What is in force for it, the strongest response first."""
    withdrawal: Withdrawal | None = None
    """Why it does not survey; None while it does."""

    # What its operator ordered: changed by the book of orders.

    asked: OperatorOrder | None = None
    """None: it does its part."""

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

    @property
    def legs(self) -> int:
        """Number of the last leg that was committed for it."""
        return self.committed.legs

    # Whether it follows

    def note_link(self, state: LinkState) -> None:
        """Note how it can be reached; one that is there and not engaged by us follows nothing of ours any more."""
        self.link = state
        if state in (LinkState.HEARD, LinkState.READY):
            self.engaged = False

    def follow(self, state: LinkState) -> None:
        """Note that it follows from now on."""
        self.engaged = self.followed = True
        self.refusal, self.link = "", state

    def disengage(self) -> None:
        """Take it as one that does not follow: the flight, if there is one, asks it to anew."""
        self.engaged = False

    # Its legs

    def take_next_leg(self, frame: LocalFrame) -> CommittedLeg:
        """Begin its first leg ahead from where it is: return it, to be made its order."""
        leg = self.ahead.pop(0)
        if self.target_m is not None and self.status is WaypointStatus.REACHED and self.waits_m is None:
            self.leg.start_m = self.target_m
        elif self.report is not None:
            self.leg.start_m = self.place_m(frame)
        self.fixes.risings += leg.surfacing and not self.surfacing
        self.surfacing = leg.surfacing
        return leg

    def set_order(self, order: WaypointOrder, target_m: NDArray[np.float64]) -> None:
        """Give it an order, which is still to be sent, and where that leads."""
        self.order, self.target_m, self.status = order, target_m, WaypointStatus.PLANNED
        self.go_on()
        self.asides = 0

    def drop_order(self) -> None:
        """Take its order away."""
        self.order = self.target_m = self.status = None
        self.go_on()
        self.asides = 0

    def drop_legs(self) -> None:
        """Take away its order and all that comes after it, uncounted: what they took of its way is taken."""
        self.ahead.clear()
        self.drop_order()

    def reach_leg(self) -> None:
        """Count that it came to the end of its leg."""
        self.misses = 0
        if self.flies_survey:
            self.flown.reach_leg()

    def miss_leg(self) -> None:
        """Count that it did not come to the end of its leg."""
        self.misses += 1
        if self.flies_survey:
            self.flown.miss_leg()

    @contextmanager
    def counting_no_misses(self) -> Iterator[None]:
        """Have a leg that ends now be counted neither as reached nor as missed: it would have got there."""
        misses, flown = self.misses, self.flown
        missed, missed_last = flown.legs_missed, flown.missed_last
        yield
        self.misses, flown.legs_missed, flown.missed_last = misses, missed, missed_last

    # Where it waits

    def wait_at(self, place_m: NDArray[np.float64]) -> None:
        """Note that it was sent to wait at a place, (2,); that is no leg."""
        self.waits_m = place_m

    def step_aside(self, most: int) -> None:
        """Count that it was led aside to let another pass; after ``most`` times its leg's time goes on all the same."""
        self.asides += 1
        self.lets_pass = self.asides <= most

    def go_on(self) -> None:
        """Note that it waits nowhere any more."""
        self.waits_m, self.lets_pass = None, False

    # Whether it surveys

    def withdraw(self, withdrawal: Withdrawal) -> bool:
        """Leave the survey, unless it left that for something as strong or is at the end of that; whether it does."""
        before = self.withdrawal
        if before is not None and (STRENGTH[before.response] >= STRENGTH[withdrawal.response] or before.over):
            return False
        self.withdrawal, self.pursuing = withdrawal, None
        return True

    def survey_again(self) -> None:
        """Take part in the survey again, whatever it left that for."""
        self.withdrawal = None

    def come_to_rest(self) -> None:
        """Note that nobody leads it any more: it came home, or stopped where it is."""
        self.flown.phase = Phase.HOME if self.is_home else Phase.STOPPED

    def leave(self, at: datetime) -> None:
        """Leave the mission."""
        self.left_at, self.pursuing = at, None
        self.come_to_rest()
        self.drop_legs()
        self.engaged = self.surfacing = False

    def take_over(self, before: "Member") -> None:
        """Go on with what was known and counted of it when it took part before."""
        self.report, self.heard_s, self.clock_ahead_s = before.report, before.heard_s, before.clock_ahead_s
        self.stored_battery_pct, self.fixes.risings = before.stored_battery_pct, before.fixes.risings
        self.flown, self.committed = before.flown, replace(before.committed)
        self.energy.used_s = before.energy.used_s

    # How far it goes, and where it is

    def last_end_m(self, frame: LocalFrame) -> NDArray[np.float64]:
        """Return where its last committed leg ends, (2,), or where it is when it has none to fly."""
        if self.ahead:
            return self.ahead[-1].target_m
        return self.target_m if self.busy and self.target_m is not None else self.place_m(frame)

    def way_left_m(self, spec: MissionSpec) -> float:
        """Return how far it may be sent yet, beyond the legs that are committed for it."""
        allowance = spec.allowance(self.spec)
        if allowance.metres is not None:
            return max(allowance.metres - self.committed.way_m - self.committed.late_m, 0.0)
        legs = allowance.most_legs(spec.limits.max_step_m) - self.committed.legs + self.committed.spared
        return max(legs, 0) * spec.limits.max_step_m

    def count_late(self, spec: MissionSpec, frame: LocalFrame) -> None:
        """Count how far it is behind its legs by the time in which it surveyed; who is ahead of them is not late."""
        if spec.budget.minutes is not None:
            come_m = self.committed.way_m - self.way_ahead_m(frame)
            self.committed.late_m = max(self.flown.survey_s * spec.speed_of(self.spec) - come_m, 0.0)

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
