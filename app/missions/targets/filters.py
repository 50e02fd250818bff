"""The moving targets of one mission: ranges in, what is known of each out. Without a clock, a database or a link.

Times are seconds of the service's own clock as vehicles count them; :mod:`app.missions.live.journals.vehicle_times`
makes them. The same ranges in the same order give the same filters, so that a restart takes them up exactly where they
were.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.estimation.sensors import RangeSensor
from app.estimation.targets import TargetEstimator, TargetTrack, expected_range
from app.exploration.core.moving_targets import Targets
from app.exploration.core.snapshot_codec import pack, unpack
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.interface import RangeReport
from app.missions.spec.mission import MissionSpec
from app.missions.spec.targets import TargetSpec

MEMORY = "targets"
GREATEST_RANGE_M = 20_000.0
MOST_VEHICLE_DEPTH_M = 11_100.0
LATEST_S = 5.0
"""A range that is older than the newest one used, by no more than this, is used as if it had come with it."""

FAR_OFF = 6.0
"""A range so many standard deviations from what its filter expects is an echo, not the target."""

ECHOES = 6
"""So many of them more than of others are the target after all, and its filter is wrong: it is begun anew."""

MINUTE_S = 60.0
VERTICAL = 0.3
"""How much less targets move up and down than over ground."""

TURN_S = 20.0
"""Time within which a target that turns may have turned round."""

SPEEDS = 2.0
"""Standard deviations that the greatest plausible speed is taken to be."""

ROOM = 0.5
"""How far around the area a target is looked for when it is first heard, in longest sides of the area."""


@dataclass(frozen=True, slots=True)
class Arrived:
    """A range, and when it was measured by the service's clock."""

    report: RangeReport
    at_s: float


@dataclass(frozen=True, slots=True)
class Judged:
    """A range with the target that it is to; ``reason`` is empty when it was used."""

    arrived: Arrived
    target: str
    reason: str = ""

    @property
    def used(self) -> bool:
        """Whether it went into the filter."""
        return not self.reason


@dataclass(frozen=True, slots=True)
class TargetKnowledge:
    """What is known of one target: its filter at ``at_s``, and how its ranges fared."""

    track: TargetTrack = field(default_factory=TargetTrack.unknown)
    at_s: float = -math.inf
    used: int = 0
    rejected: int = 0
    echoes: int = 0
    """Ranges that its filter did not expect, less those that it did since."""
    last_refusal: str = ""


class TargetFilters:
    """The filters of a mission's targets.

    Parameters
    ----------
    spec
        What is asked for.
    frame
        The mission's local frame.
    """

    def __init__(self, spec: MissionSpec, frame: LocalFrame) -> None:
        self.specs = {target.name: target for target in spec.targets}
        self._spec = spec.tracking
        self._frame = frame
        self._by_call = {target.called: target.name for target in spec.targets}
        area = spec.local_area()
        self._estimators = {
            target.name: _estimator(target, spec, area.min(axis=0), area.max(axis=0)) for target in spec.targets
        }
        self._blur = np.full(3, self._spec.range_sd_m**2)
        self.known: Mapping[str, TargetKnowledge] = {name: TargetKnowledge() for name in self.specs}

    def __bool__(self) -> bool:
        return bool(self.specs)

    def name_of(self, called: str) -> str | None:
        """Return the target that modems call so; None when none of the mission's is called so."""
        return self._by_call.get(called)

    def stranger(self, called: str) -> str:
        """Return why a range to ``called`` is of no use; empty when it is to one of the mission's targets."""
        if called in self._by_call:
            return ""
        names = ", ".join(self._by_call) or "it has none"
        return f"target: {called!r} is not among the targets of this mission ({names})"

    def judge(self, arrived: Iterable[Arrived]) -> tuple[list[Judged], Mapping[str, TargetKnowledge]]:
        """Return verdicts on ranges to the mission's targets, and what would then be known; nothing changes yet."""
        known = dict(self.known)
        verdicts = []
        for one in arrived:
            name = self._by_call[one.report.target]
            known[name], reason = self._judge(name, known[name], one)
            verdicts.append(Judged(one, name, reason))
        return verdicts, known

    def adopt(self, known: Mapping[str, TargetKnowledge]) -> None:
        """Make it what is known, once the ranges that it came from are stored for good."""
        self.known = known

    def _judge(self, name: str, known: TargetKnowledge, arrived: Arrived) -> tuple[TargetKnowledge, str]:
        report = arrived.report
        reason = self.implausible(report)
        if not reason and arrived.at_s < known.at_s - LATEST_S:
            late = known.at_s - arrived.at_s
            reason = f"time_s: measured {late:.0f} s before the newest range used; at most {LATEST_S:g} s can be taken"
        if reason:
            return replace(known, rejected=known.rejected + 1, last_refusal=reason), reason
        track = self._ahead(name, known, arrived.at_s)
        place, blur = self._place(report)
        if track.single:
            expected, sd = expected_range(track, place, self._spec.range_noise, blur)
            if abs(report.range_m - expected) > FAR_OFF * sd:
                reason = f"target_range_m: {report.range_m:.1f} m where {expected:.1f} ± {sd:.1f} m were expected"
                if known.echoes + 1 < ECHOES:
                    echoes, rejected = known.echoes + 1, known.rejected + 1
                    return replace(known, echoes=echoes, rejected=rejected, last_refusal=reason), reason
                track = TargetTrack.unknown()
        estimator = self._estimators[name]
        track = estimator.update(track, place[None], np.array([report.range_m]), blur[None])
        track = in_the_water(track, estimator.low_m[2], estimator.high_m[2])
        at_s = max(arrived.at_s, known.at_s)
        return replace(known, track=track, at_s=at_s, used=known.used + 1, echoes=max(known.echoes - 1, 0)), ""

    def implausible(self, report: RangeReport) -> str:
        """Return which value of a range cannot be; empty when all can."""
        place = report.position
        values = {
            "time_s": report.time_s,
            "target_range_m": report.range_m,
            "lat_deg": place.lat_deg,
            "lon_deg": place.lon_deg,
            "depth_m": place.depth_m,
        }
        for name, value in values.items():
            if not math.isfinite(value):
                return f"{name}: {value} is not a finite number"
        if report.range_m <= 0.0:
            return f"target_range_m: {report.range_m:g} is not positive"
        farthest = GREATEST_RANGE_M if self._spec.hearing_m is None else self._spec.hearing_m
        # What is heard at the very limit measures a little more than it now and then.
        allowed = farthest * (1.0 + 3.0 * self._spec.range_noise) + 3.0 * self._spec.range_sd_m
        if report.range_m > allowed:
            return f"target_range_m: {report.range_m:g} m is more than the {farthest:g} m at which targets are heard"
        if not -2.0 <= place.depth_m <= MOST_VEHICLE_DEPTH_M:
            return f"depth_m: {place.depth_m:g} is not between -2 and {MOST_VEHICLE_DEPTH_M:g}"
        try:
            self._frame.to_local(place.lat_deg, place.lon_deg)
        except ValueError as error:
            return f"lat_deg, lon_deg: {error}"
        return ""

    def _place(self, report: RangeReport) -> tuple[FloatArray, FloatArray]:
        """Return where a vehicle measured, (3,), and the variances that blur its range, (3,)."""
        place, sd = report.position, report.position_sd_m
        east, north = self._frame.to_local(place.lat_deg, place.lon_deg)
        blur = self._blur.copy()
        if sd is not None and math.isfinite(sd):
            blur[:2] += sd**2
        return np.array([float(east), float(north), place.depth_m]), blur

    def _ahead(self, name: str, known: TargetKnowledge, at_s: float) -> TargetTrack:
        """Return a filter foretold for a time; one that may be anywhere by then is begun anew."""
        if not known.track.known:
            return known.track
        estimator = self._estimators[name]
        track = estimator.predict(known.track, at_s - known.at_s)
        reach = np.array(estimator.high_m) - np.array(estimator.low_m)
        return TargetTrack.unknown() if (track.sd_m[:2] > reach[:2]).any() else track

    def at(self, name: str, at_s: float) -> TargetTrack:
        """Return what is known of a target, foretold for a time; as the last range left it where that is later."""
        return self._ahead(name, self.known[name], at_s)

    @property
    def accuracy_m(self) -> float:
        """Standard deviation below which a target is known as well as asked."""
        return self._spec.accuracy_m

    def untold_sd_mps(self, name: str) -> float:
        """Return how uncertain each horizontal component of a target's velocity is before it is ranged."""
        return self._estimators[name].speed_sd

    def accurate(self, track: TargetTrack) -> bool:
        """Tell whether a target is known as well as asked."""
        return bool(track.known and (track.sd_m < self._spec.accuracy_m).all())

    def told(self, now_s: float, ahead_s: float) -> Targets | None:
        """Return what planners are told, foretold for the end of a step that takes ``ahead_s``; None without targets.

        In the order of the mission's description; rates are per second.
        """
        if not self.specs or not self._spec.pursue:
            return None
        tracks = [self.at(name, now_s + ahead_s) for name in self.specs]
        return Targets(
            state=np.array([track.state for track in tracks]),
            covariance=np.array([track.covariance for track in tracks]),
            accurate=np.array([self.accurate(self.at(name, now_s)) for name in self.specs]),
            accuracy_sd_m=self._spec.accuracy_m,
            relative_noise=self._spec.range_noise,
            hearing_m=math.inf if self._spec.hearing_m is None else self._spec.hearing_m,
            range_sd_m=self._spec.range_sd_m,
            standoff_m=self._spec.standoff_m,
        )

    def remember(self, last_id: int) -> bytes:
        """Return the filters as bytes; ``last_id`` is the stored range that they know last."""
        targets = {
            name: {
                "means": known.track.means,
                "covariances": known.track.covariances,
                "weights": known.track.weights,
                "unease": known.track.unease,
                "at_s": known.at_s if math.isfinite(known.at_s) else None,
                "used": known.used,
                "rejected": known.rejected,
                "echoes": known.echoes,
                "last_refusal": known.last_refusal,
            }
            for name, known in self.known.items()
        }
        return pack(MEMORY, {"last_id": last_id, "targets": targets})

    def recall(self, memory: bytes) -> int:
        """Take up what :meth:`remember` returned; returns the id of the last range in it. Raises ValueError."""
        state = unpack(MEMORY, memory)
        try:
            known = {name: _known(of) for name, of in state["targets"].items() if name in self.specs}
            last_id = int(state["last_id"])
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"memory of targets lacks or garbles a field: {error}") from error
        self.known = {name: TargetKnowledge() for name in self.specs} | known
        return last_id

    def replay(self, arrived: Sequence[Arrived]) -> None:
        """Judge stored ranges again, in their order, which leads to the same filters and counts."""
        _, known = self.judge(one for one in arrived if one.report.target in self._by_call)
        self.adopt(known)


def in_the_water(track: TargetTrack, top_m: float, bottom_m: float) -> TargetTrack:
    """Return a single filter that has not forgotten between which depths its target is.

    Vehicles at about a target's depth learn nothing of it, and what is not measured drifts without bounds. A depth that
    is known worse than an even spread over the water is known that well again.
    """
    variance = float(track.covariance[2, 2]) if track.single else 0.0
    spread = (bottom_m - top_m) ** 2 / 12.0
    if variance <= spread:
        return track
    P, mean = track.covariances[0], track.means[0]
    noise = 1.0 / (1.0 / spread - 1.0 / variance)
    gain = P[:, 2] / (variance + noise)
    A = np.eye(6)
    A[:, 2] -= gain
    covariance = A @ P @ A.T + noise * np.outer(gain, gain)
    return replace(
        track,
        means=(mean + gain * (0.5 * (top_m + bottom_m) - mean[2]))[None],
        covariances=0.5 * (covariance + covariance.T)[None],
    )


def _known(state: Mapping[str, Any]) -> TargetKnowledge:
    track = TargetTrack(
        np.array(state["means"], dtype=np.float64).reshape(-1, 6),
        np.array(state["covariances"], dtype=np.float64).reshape(-1, 6, 6),
        np.array(state["weights"], dtype=np.float64).reshape(-1),
        unease=float(state["unease"]),
    )
    at_s = -math.inf if state["at_s"] is None else float(state["at_s"])
    return TargetKnowledge(
        track, at_s, int(state["used"]), int(state["rejected"]), int(state["echoes"]), str(state["last_refusal"])
    )


def _estimator(target: TargetSpec, spec: MissionSpec, low_m: FloatArray, high_m: FloatArray) -> TargetEstimator:
    """Return a target's filter: it may be anywhere in and around the area when it is first heard."""
    around = ROOM * float((high_m - low_m).max())
    deepest = spec.limits.max_depth_m if target.max_depth_m is None else target.max_depth_m
    deepest = max(deepest, target.min_depth_m + 1.0)
    hearing = math.inf if spec.tracking.hearing_m is None else spec.tracking.hearing_m
    return TargetEstimator(
        sensor=RangeSensor(hearing, spec.tracking.range_noise),
        acceleration_sd=target.velocity_change_mps / math.sqrt(MINUTE_S),
        accuracy_sd_m=spec.tracking.accuracy_m,
        low_m=(float(low_m[0]) - around, float(low_m[1]) - around, target.min_depth_m),
        high_m=(float(high_m[0]) + around, float(high_m[1]) + around, deepest),
        speed_sd=target.max_speed_mps / SPEEDS,
        turn_sd=target.max_speed_mps / SPEEDS / math.sqrt(TURN_S),
        vertical=VERTICAL,
    )


def warm_up() -> None:
    """Compile what the first range needs."""
    estimator = TargetEstimator()
    track = estimator.update(TargetTrack.unknown(), np.zeros((1, 3)), np.ones(1))
    one = TargetTrack(track.means[:1], track.covariances[:1], np.ones(1))
    expected_range(one, np.zeros(3), 0.1, np.zeros(3))
