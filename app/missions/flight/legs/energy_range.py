"""How far vehicles may go on, so that their energy lasts for the way home from there."""

import asyncio
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.missions.flight.legs.commit import LegCommit
from app.missions.live.mission import LiveMission
from app.missions.recovery.berths import home_of, layer_of
from app.missions.recovery.energy import ASCENT_MPS
from app.missions.recovery.failsafes import drift_reserve_s, with_reserve_s
from app.missions.recovery.turn_back import turn_back_place
from app.missions.recovery.way_home import WaysHome, way_time_s
from app.missions.safety import travel_depth
from app.missions.team import Member
from imc_bridge.control.depth_layers import DepthLayer

LAND_PERIOD_S = 10.0
"""How often is looked whether the map shows other shallows, seconds of the event loop's time."""

MOVED_M = 5.0
"""The way home is looked for anew when its vehicle is so far from where that was done last."""

LEAST_DEPTH_M = 0.5
"""Water with less room than the least altitude and this is land to vehicles."""


class EnergyRange:
    """Ways home of the vehicles of one running mission, and what their energy leaves beside them."""

    def __init__(self, live: LiveMission, constraints: Constraints, leg_commit: LegCommit) -> None:
        self._live = live
        self._constraints = constraints
        self._leg_commit = leg_commit
        self._found: dict[str, tuple[FloatArray, FloatArray | None]] = {}
        self._ways: dict[tuple[float, float], tuple[WaysHome, WaysHome | None]] = {}
        """By recovery point: all ways, and those that keep off what is known to be too shallow, if anything is."""
        self._land = b""
        self._looked_s = -math.inf
        self.current_mps = (0.0, 0.0)
        """Velocity of the water, east and north."""

    def take_currents(self) -> None:
        """Take the current to be what the vehicles tell of it, on average; it counts against them, never for them."""
        self.current_mps = self._live.team.current_mps

    def way(self, member: Member) -> FloatArray | None:
        """Return the corners of a vehicle's way home, (n, 2), from about where it is; None: it has none."""
        home_m = self._home_m(member)
        if home_m is None or member.report is None:
            return None
        # Before the first step what finds ways may have to be compiled, and nobody has gone anywhere.
        if self._live.search is not None and self._live.search.began_at is None:
            return None
        here_m = member.place_m(self._live.frame)
        from_m, way_m = self._found.get(member.name, (None, None))
        if from_m is None or float(np.hypot(*(here_m - from_m))) > MOVED_M:
            way_m = self.way_from(here_m, home_m)
            self._found[member.name] = here_m, way_m
        return way_m

    def way_left_alone(self, member: Member) -> FloatArray | None:
        """Return a way home, (n, 2), for a vehicle that flies its leg to the end and then gets no order; None: none.

        It may set out from anywhere on that leg. Where something stands between the leg and the way from where the
        vehicle is now, it goes to the leg's end first, along the leg.
        """
        way_m, home_m, end_m = self.way(member), self._home_m(member), member.target_m
        if way_m is None or home_m is None or end_m is None or not member.ordered or member.withdrawal is not None:
            return way_m
        here_m = member.place_m(self._live.frame)
        last_m = self._leg_commit.followed_to_m(member, end_m)
        on_leg = here_m + np.linspace(0.0, 1.0, travel_depth.LEG_SAMPLES)[:, None] * (last_m - here_m)
        if self._live.search is None and self._sees(home_m, on_leg, way_m[0]):
            return way_m
        beyond = self.way_from(end_m, home_m)
        return way_m if beyond is None else np.vstack([end_m, beyond])

    def _sees(self, home_m: FloatArray, places_m: FloatArray, corner_m: FloatArray) -> bool:
        """Whether nothing stands between any of some places (n, 2) and a corner (2,) of the way home."""
        corners_m = np.broadcast_to(corner_m, places_m.shape)
        return bool(self._ways_to(home_m)[0].sees(places_m, corners_m).all())

    def way_from(self, here_m: FloatArray, home_m: FloatArray) -> FloatArray | None:
        """Return the corners of the way home from a place, (n, 2); None: there is none.

        In a search it leads only where somebody has looked, as near as that goes.
        """
        if self._live.search is not None:
            return self._live.search.way_towards_m(here_m, home_m)
        self._look_for_land()
        anyhow, off_land = self._ways_to(home_m)
        way_m = None if off_land is None else off_land.way(here_m)
        # Better over ground that looks too shallow, at the surface, than not at all.
        return anyhow.way(here_m) if way_m is None else way_m

    def way_past(
        self, here_m: FloatArray, home_m: FloatArray, places_m: Sequence[FloatArray], apart_m: float
    ) -> FloatArray | None:
        """Return a way home as :meth:`way_from` does, that goes round some places (2,) so far from them."""
        if self._live.search is not None:
            return self._live.search.way_m(here_m, home_m, places_m, apart_m)
        self._look_for_land()
        for bottom, least_m in ((self._leg_commit.bottom, self._least_m), (None, 0.0)):
            ways = WaysHome(self._constraints, home_m, bottom, least_m, (places_m, apart_m))
            if (way_m := ways.way(here_m)) is not None:
                return way_m
        return None

    def _home_m(self, member: Member) -> FloatArray | None:
        return home_of(member.spec, member.slot, self._live.spec, self._live.team.specs)

    def _ways_to(self, home_m: FloatArray) -> tuple[WaysHome, WaysHome | None]:
        key = (float(home_m[0]), float(home_m[1]))
        if key not in self._ways:
            bottom, least_m = self._leg_commit.bottom, self._least_m
            off_land = WaysHome(self._constraints, home_m, bottom, least_m) if self._land else None
            self._ways[key] = WaysHome(self._constraints, home_m), off_land
        return self._ways[key]

    def depths_m(self, member: Member, here_m: FloatArray, way_m: FloatArray) -> list[float]:
        """Return how deep a vehicle travels to each corner of a way, (n, 2): less over a shallow bottom.

        Each of the team has a depth of its own there, too, since ways home lead to the same place.
        """
        limits, bottom, layer = self._live.spec.limits, self._leg_commit.bottom, self.layer(member)
        return [
            layer.depth_m(travel_depth.travel_depth_m(a, b, layer.deepest_m, bottom, limits.min_altitude_m))
            for a, b in pairwise(np.vstack([here_m, way_m]))
        ]

    def layer(self, member: Member) -> DepthLayer:
        """Return at which depths a vehicle goes home, apart from the others of its team."""
        limits = self._live.spec.limits
        depths_m = {one.name: min(one.cruise_depth_m(limits), limits.max_depth_m) for one in self._live.team}
        return layer_of(member.name, depths_m, limits.min_vertical_separation_m)

    @property
    def _least_m(self) -> float:
        return self._live.spec.limits.min_altitude_m + LEAST_DEPTH_M

    def _look_for_land(self) -> None:
        """Find ways anew where the map shows other shallows than before, not too often."""
        now_s = asyncio.get_running_loop().time()
        if now_s - self._looked_s < LAND_PERIOD_S:
            return
        self._looked_s = now_s
        shallow = self._leg_commit.bottom.depth_m < self._least_m
        land = shallow.tobytes() if shallow.any() else b""
        if land != self._land:
            self._land = land
            self._ways.clear()
            self._found.clear()

    def needs_s(self, member: Member) -> float | None:
        """Return how long a vehicle's way home takes from where it is, by its clock; None: not known."""
        way_m = self.way(member)
        if way_m is None or member.report is None:
            return None
        here_m, speed_mps = member.place_m(self._live.frame), self._live.spec.speed_of(member.spec)
        up_s = member.report.position.depth_m / ASCENT_MPS
        return way_time_s(here_m, way_m, speed_mps, self.current_mps) + up_s

    def beyond_m(self, member: Member) -> float | None:
        """Return how far a vehicle may be sent beyond its legs, by its energy; None: as far as the mission likes."""
        home_m, left = self._home_m(member), member.energy.left
        if home_m is None or left is None or member.report is None:
            return None
        end_m = member.last_end_m(self._live.frame)
        speed_mps = self._live.spec.speed_of(member.spec)
        needs_s = with_reserve_s(self._needs_from_s(member, end_m, home_m), self.drift_reserve_s(member))
        over_s = left.safe_s - self._until_end_s(member) - needs_s
        return max(over_s * speed_mps, 0.0) if math.isfinite(over_s) else 0.0

    def turn_back(self, member: Member) -> FloatArray | None:
        """Return where on its planned legs it has to turn back at the latest, (2,); None: nowhere, or unknown."""
        home_m, left = self._home_m(member), member.energy.left
        if home_m is None or left is None or member.report is None or member.withdrawal is not None:
            return None
        around_s = self._around_s(member, home_m)
        return turn_back_place(
            member.place_m(self._live.frame),
            member.legs_ahead_m(),
            left.safe_s,
            lambda place_m: self._needs_from_s(member, place_m, home_m, around_s),
            self._live.spec.speed_of(member.spec),
            self.current_mps,
        )

    def allows(self, member: Member, target_m: FloatArray) -> bool:
        """Whether a vehicle's energy lasts for one more leg, to a target (2,), and for the way home from there."""
        home_m, left = self._home_m(member), member.energy.left
        if home_m is None or left is None or member.report is None:
            return True
        end_m = member.last_end_m(self._live.frame)
        speed_mps = self._live.spec.speed_of(member.spec)
        leg_s = float(np.hypot(*(target_m - end_m))) / speed_mps
        needs_s = with_reserve_s(self._needs_from_s(member, target_m, home_m), self.drift_reserve_s(member))
        return self._until_end_s(member) + leg_s + needs_s <= left.safe_s

    def lasts_for(self, member: Member, start_m: FloatArray, way_m: FloatArray) -> bool:
        """Whether a vehicle's energy lasts for a way (k, 2) from a place (2,), and home from each of its corners."""
        home_m, left = self._home_m(member), member.energy.left
        if home_m is None or left is None or member.report is None:
            return True
        speed_mps = self._live.spec.speed_of(member.spec)
        after_s = np.cumsum(np.hypot(*np.diff(np.vstack([start_m, way_m]), axis=0).T)) / speed_mps
        drift_s = self.drift_reserve_s(member)
        return all(
            float(passed_s) + with_reserve_s(self._needs_from_s(member, corner, home_m), drift_s) <= left.safe_s
            for corner, passed_s in zip(way_m, after_s, strict=True)
        )

    def drift_reserve_s(self, member: Member) -> float:
        """Return what a vehicle's reserve has to have in it for a drift in the current while nobody hears it."""
        return drift_reserve_s(self._live.spec.speed_of(member.spec), self.current_mps)

    def _until_end_s(self, member: Member) -> float:
        return member.way_ahead_m(self._live.frame) / self._live.spec.speed_of(member.spec)

    def _needs_from_s(
        self, member: Member, place_m: FloatArray, home_m: FloatArray, around_s: float | None = None
    ) -> float:
        """Return how long the way home takes from a place, straight, and longer by what it is longer from here."""
        speed_mps = self._live.spec.speed_of(member.spec)
        around_s = self._around_s(member, home_m) if around_s is None else around_s
        up_s = member.cruise_depth_m(self._live.spec.limits) / ASCENT_MPS
        return way_time_s(place_m, home_m[None], speed_mps, self.current_mps) + around_s + up_s

    def _around_s(self, member: Member, home_m: FloatArray) -> float:
        """Return how much longer than straight a vehicle's way home takes from where it is."""
        here_m, way_m = member.place_m(self._live.frame), self.way(member)
        if way_m is None:
            return 0.0
        corners = np.vstack([here_m, way_m])
        around_m = float(np.hypot(*np.diff(corners, axis=0).T).sum() - np.hypot(*(home_m - here_m)))
        return around_m / self._live.spec.speed_of(member.spec)
