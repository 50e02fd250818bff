"""The central station under limited communication: it knows and plans with nothing but what was transmitted."""

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation import RangeSensor
from app.exploration.communication.messages import (
    MAX_ENTRIES,
    MAX_NEIGHBOURS,
    STEPS,
    Entries,
    MoveOrder,
    StatusReport,
    WireFormat,
)
from app.exploration.communication.selection import fill, reachable
from app.exploration.communication.shared import Contribution, fuse, news

NOTHING = np.zeros(0, dtype=np.int64)

PRESUMED_FOR = 20
"""Steps after the last look for which a landmark is presumed to have been measured although no report says so.

Steps with a full report do not count: there was no room to say so.
"""


PRESUMED_TRUST = 0.4
"""Part of the information of a presumed look that counts: depths are guesses, and what is wrongly presumed known is
found out only when the team has gone on."""


@dataclass
class _Member:
    """A vehicle as the station knows it; arrays are (n_landmarks,).

    ``confirmed`` is the information of others that the vehicle is known to have received, ``finished`` what it is known
    to count to ``A``, ``presumed`` the information that it should have gained since its last report of each landmark,
    ``looked_at`` when it gained that by its ``clock``, which stands still while its reports are full, ``told`` what it
    has reported in this step.
    """

    position: FloatArray
    reported: Contribution
    finished: BoolArray
    confirmed: FloatArray
    presumed: FloatArray
    looked_at: IntArray
    step: int
    clock: int = 0
    heard_at: int = 0
    waypoint: FloatArray | None = None
    told: IntArray = field(default_factory=lambda: NOTHING)
    sent: Entries = field(default_factory=Entries.none)


class StationNode:
    """The station's half of the exchange (AURO15 sec. 3.4), and the knowledge that the planner decides with.

    Each step: :meth:`begin`, :meth:`receive` every report that arrives, :meth:`conclude`, plan with :attr:`depth_m`,
    :attr:`sd_m` and :attr:`accurate`, then send each vehicle its :meth:`order`. A vehicle is known from its first
    report on, so that one can join at any time; one that falls silent is presumed to have followed its last order and
    delays no other.

    Beyond the paper:

    - Estimates of several vehicles are put together (they stem from different looks), so that the station may know a
      landmark accurately that no vehicle does.
    - The station knows the sensors and where the vehicles were: a landmark that they must have measured is presumed to
      be known that well until a report says so, or until ``PRESUMED_FOR`` steps with room for it have passed.

    Parameters
    ----------
    xy_m : (n_landmarks, 2)
        Where the landmarks are.
    sensor : RangeSensor
        Of the vehicles, for what they presumably see.
    wire : WireFormat
        Agreed with the vehicles.
    travel_m : float
        Largest step.
    capacity : int
        Most entries in a message.
    apart_m : float
        Landmarks closer together than this are near-duplicates.
    """

    def __init__(
        self,
        xy_m: FloatArray,
        sensor: RangeSensor,
        wire: WireFormat,
        travel_m: float,
        capacity: int = 10,
        apart_m: float = 0.0,
    ) -> None:
        n = len(xy_m)
        self._xy = np.ascontiguousarray(xy_m, dtype=np.float64)
        self._sensor, self._wire, self._travel_m = sensor, wire, travel_m
        self._capacity, self._apart_m = min(capacity, MAX_ENTRIES), apart_m
        self._needed = 1.0 / wire.accuracy_sd_m**2
        self._members: dict[int, _Member] = {}
        self._known = np.zeros(n, dtype=np.bool_)
        self._count = 0
        self._depth, self._information = np.full(n, np.nan), np.zeros(n)
        self._reach: BoolArray = np.zeros((0, 0), dtype=np.bool_)

    @property
    def depth_m(self) -> FloatArray:
        """Estimates put together from all reports, (n,); NaN where nothing was reported."""
        return self._depth

    @property
    def known_accurate(self) -> BoolArray:
        """``A`` as far as reports prove it, (n,); only grows."""
        return self._known

    @property
    def known_sd_m(self) -> FloatArray:
        """Standard deviations as far as reports prove them, (n,); inf where there are none."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.sqrt(self._information), dtype=np.float64)

    @property
    def accurate(self) -> BoolArray:
        """``A`` for the planner, (n,): proven, or presumed."""
        return np.asarray(self._known | (self._information + self._presumed() > self._needed), dtype=np.bool_)

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviations for the planner, (n,), with what is presumed; inf where there is neither."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.sqrt(self._information + self._presumed()), dtype=np.float64)

    @property
    def members(self) -> tuple[int, ...]:
        """Numbers of the vehicles known so far, ascending."""
        return tuple(sorted(self._members))

    def position(self, number: int) -> FloatArray:
        """Return where a vehicle is, (3,): its last report, or after one step of silence its waypoint."""
        return self._members[number].position

    def heard_within(self, steps: int) -> tuple[int, ...]:
        """Return the numbers of the vehicles that reported in one of the last ``steps`` steps, ascending."""
        return tuple(k for k in self.members if self._count - self._members[k].heard_at < steps)

    def begin(self) -> None:
        """Begin a step: no report has arrived yet."""
        self._count += 1
        for member in self._members.values():
            member.told = NOTHING
            if member.heard_at == self._count - 1 and member.waypoint is not None:
                member.position = member.waypoint  # until it says otherwise

    def receive(self, message: bytes) -> StatusReport:
        """Take in a vehicle's report; one that comes late or twice changes nothing."""
        report = self._wire.decode_report(message)
        n = len(self._xy)
        member = self._members.get(report.vehicle)
        if member is None:
            member = _Member(
                report.position,
                Contribution.nothing(n),
                np.zeros(n, np.bool_),
                np.zeros(n),
                np.zeros(n),
                np.zeros(n, np.int64),
                report.step,
            )
            self._members[report.vehicle] = member
        elif not 0 < (report.step - member.step) % STEPS < STEPS // 2:
            return report
        member.position, member.step, member.heard_at = report.position, report.step, self._count
        if report.acknowledges:
            index = member.sent.index
            member.confirmed[index] = 1.0 / member.sent.sd_m**2
            member.finished[index[member.sent.accurate]] = True
        member.sent = Entries.none()
        member.reported.take(report.entries)
        member.told = report.entries.index
        member.presumed[member.told] = 0.0
        finished = report.entries.index[report.entries.accurate]
        member.finished[finished] = True
        self._known[finished] = True
        return report

    def conclude(self) -> None:
        """Merge this step's reports, and presume what was looked at without a report."""
        members = [self._members[number] for number in self.members]
        self._depth, self._information = fuse([member.reported for member in members], len(self._xy))
        self._known |= self._information > self._needed
        if not members:
            return
        positions = np.array([member.position for member in members])
        gained = _gained(
            positions, self._xy, self._guess(positions), self._sensor.visibility_m, self._sensor.relative_noise
        )
        visible_by = gained > 0.0
        self._reach = reachable(positions, visible_by, self._xy, self._travel_m)
        for member, gain in zip(members, gained, strict=True):
            if member.heard_at == self._count:
                gain[member.told] = 0.0  # the report included this step's look
                member.presumed += PRESUMED_TRUST * gain
                member.looked_at[gain > 0.0] = member.clock
            member.clock += len(member.told) < self._capacity
            member.presumed[member.clock - member.looked_at > PRESUMED_FOR] = 0.0

    def order(self, number: int, waypoint: FloatArray) -> bytes:
        """Return the message to a vehicle: its next waypoint, vehicles nearby, and news from the others."""
        member = self._members[number]
        row = self.members.index(number)
        by_distance = sorted(
            (float(np.linalg.norm(self.position(k) - member.position)), k)
            for k, near in zip(self.members, self._reach[row], strict=True)
            if near
        )
        neighbours = [k for _, k in by_distance[:MAX_NEIGHBOURS]]
        member.waypoint = np.asarray(waypoint, dtype=np.float64)
        entries, answers = self._choose(number, member), member.heard_at == self._count
        if answers:
            member.sent = entries  # vehicles acknowledge the answer to their last report, no other order
        return self._wire.encode_order(
            MoveOrder(
                member.step,
                number,
                waypoint,
                answers,
                np.array(neighbours, dtype=np.int64),
                np.array([self.position(k) for k in neighbours]).reshape(-1, 3),
                entries,
            )
        )

    def _presumed(self) -> FloatArray:
        presumed = [member.presumed for member in self._members.values()]
        return np.asarray(np.sum(presumed, axis=0), dtype=np.float64) if presumed else np.zeros(len(self._xy))

    def _guess(self, positions: FloatArray) -> FloatArray:
        """Return depths (n,), unknown ones as that of the closest known landmark."""
        known = np.isfinite(self._depth)
        if not known.any():
            return np.full(len(self._xy), positions[:, 2].max() + self._sensor.visibility_m / 2)
        if known.all():
            return self._depth
        depth = self._depth.copy()
        _, nearest = cKDTree(self._xy[known]).query(self._xy[~known])
        depth[~known] = self._depth[known][nearest]
        return depth

    def _choose(self, number: int, member: _Member) -> Entries:
        others = [self._members[k].reported for k in self.members if k != number]
        depth, information = fuse(others, len(self._xy))
        told = news(information, member.confirmed)
        waiting = np.flatnonzero(~member.finished & (self._known | told))
        distance = np.hypot(*(self._xy[waiting] - member.position[:2]).T)
        chosen = fill(waiting[np.argsort(distance, kind="stable")], self._xy, self._capacity, self._apart_m)
        with np.errstate(divide="ignore"):
            sd = 1.0 / np.sqrt(information[chosen])
        return Entries(chosen, np.nan_to_num(depth[chosen], nan=self._wire.low[2]), sd, self._known[chosen])


@njit(cache=True, nogil=True)
def _gained(positions: FloatArray, xy: FloatArray, depth: FloatArray, visibility: float, noise: float) -> FloatArray:
    """Return the information (n_vehicles, n) that one look from each position gives; 0 where nothing is seen."""
    result = np.zeros((len(positions), len(xy)))
    for j in range(len(positions)):
        for m in range(len(xy)):
            dx = xy[m, 0] - positions[j, 0]
            dy = xy[m, 1] - positions[j, 1]
            dz = depth[m] - positions[j, 2]
            r2 = dx * dx + dy * dy + dz * dz
            if r2 < visibility * visibility and dz > 0.0:
                result[j, m] = dz * dz / (noise * noise * r2 * r2)
    return result
