"""The dynamic case without a network: landmarks in three dimensions, targets that move, localization that fades.

MED13's scenario lies over a terrain cast into the cube [-1, 1]^3, NGCUV12's spreads its landmarks over the lower half
of it. Lengths have no unit there; the fields keep their metre names. Depth is positive down, the surface at -1.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import BoolArray, FloatArray
from app.estimation import (
    CooperativeLocalizer,
    Fading,
    Landmark3DEstimator,
    Landmarks3D,
    LandmarkSets,
    RangeSensor,
    TargetEstimator,
    TargetTrack,
)
from app.estimation.localization import radius
from app.evaluation.explore.world import (
    CEILING,
    DEEPEST,
    MAX_STEP,
    SHALLOWEST,
    START_CORNER,
    START_SPREAD,
    CubeTerrain,
    names_of,
)
from app.evaluation.track.plain_ekf import PlainEkf
from app.evaluation.track.presumed import Presumed
from app.exploration.core.constraints import Constraints
from app.exploration.core.moving_targets import Localization, Targets, dynamic_cost
from app.exploration.core.objective import MED13_K, med13_objective
from app.exploration.core.problem import Belief, Situation
from simulator.floors.terrain import Terrain

SURFACED = 1e-9
START_ABOVE = 0.05
"""Height above the least clearance at which vehicles start over a terrain."""

TARGET_SPEED = (0.004, 0.01)
NEEDED_AT = 0.8
"""A rising was needed when the position had become this bad, of what is allowed, before the fix came."""
NEVER = 10**9
"""Looks after which a landmark counts as accurate whatever its deviation: MED13 has no such cap."""

PART_ORDERED = 2 / 3
"""Of the clearance: as close to the floor as vehicles may be sent; their altimeters hold the clearance itself."""

ROUGHLY = 0.1
"""Deviation of a depth, in distances of sight, up to which it counts as known at all."""

NEARBY = 0.4
"""How far an altimeter's reading is taken to hold, in distances of sight."""

HALVINGS = 30
"""How often the way to a waypoint is halved to find how far a vehicle comes that is lifted."""

AREA_OF_CUBE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class TrackScenario:
    """One run's setting; MED13's and NGCUV12's constants where the papers give them.

    Attributes
    ----------
    terrain : Terrain or None
        Sea floor on which the landmarks lie; None: they are spread at random over the lower half of the cube.
    robots, landmarks, targets : int
        How many there are.
    steps, seed : int
        Length of the run; seed of everything random.
    clearance : float
        MED13's d: least height above the terrain.
    visibility : float
        How far landmarks are seen; 4 is everywhere in the cube.
    accuracy, target_accuracy : float
        Standard deviations below which landmarks and targets belong to ``A``.
    com_range : float
        Each vehicle has another within it; inf as in both papers.
    fading : Fading or None
        How localization fades; None: the vehicles know where they are (MED13).
    lost_beyond : float
        Horizontal error that a vehicle's position must not exceed.
    shared_fix : bool
        NGCUV12: as soon as one vehicle surfaces all are localized. Otherwise each needs its own fix, or ranges.
    cooperative : bool
        Whether vehicles range to each other.
    plain_ekf : bool
        Whether landmarks are estimated by one first-order filter each, as in MED13's figure 1.
    fixed_noise : float or None
        Standard deviation that this filter, and its planner, takes every range to have; None: it knows the noise.
    """

    terrain: Terrain | None = None
    robots: int = 3
    landmarks: int = 1000
    targets: int = 2
    steps: int = 500
    seed: int = 0
    clearance: float = 0.3
    visibility: float = 0.4
    accuracy: float = 0.1
    target_accuracy: float = 0.1
    com_range: float = np.inf
    fading: Fading | None = None
    lost_beyond: float = 0.1
    shared_fix: bool = True
    cooperative: bool = True
    plain_ekf: bool = False
    fixed_noise: float | None = None

    @property
    def sensor(self) -> RangeSensor:
        """What landmarks are measured with: variance 0.01 of the multiplicative noise."""
        return RangeSensor(self.visibility, 0.1)

    @cached_property
    def constraints(self) -> Constraints:
        """The limits in the cube."""
        area = AREA_OF_CUBE if self.terrain is None else CubeTerrain(self.terrain).area
        if self.terrain is None:
            return Constraints(area, (), MAX_STEP, CEILING, DEEPEST, 0.0, self.com_range)
        # Planners may order what altimeters then keep from happening: estimates of the floor need not be believed.
        ordered = PART_ORDERED * self.clearance
        return Constraints(
            area, (), MAX_STEP, CEILING, DEEPEST, ordered, self.com_range, held_altitude_m=self.clearance
        )

    @property
    def threshold_sd(self) -> float:
        """Standard deviation that keeps a position's error below ``lost_beyond`` with 99 % probability.

        With 95 % for each vehicle, that all of them are below it at once would be less likely than that.
        """
        return self.lost_beyond / float(radius(np.array(1.0), 0.99))


class TrackWorld:
    """The truth, and what the team knows of it."""

    def __init__(self, scenario: TrackScenario) -> None:
        self.scenario = scenario
        rng = np.random.default_rng([scenario.seed, 0])
        self._cube = None if scenario.terrain is None else CubeTerrain(scenario.terrain)
        self.half = np.ones(2) if self._cube is None else self._cube.half
        self.truth = self._scatter(rng)
        self.known = Landmarks3D.unknown(len(self.truth))
        low, high = self._presumed_area().tolist()
        self.estimator: Landmark3DEstimator | PlainEkf = Landmark3DEstimator(
            scenario.sensor, scenario.accuracy, NEVER, tuple(low), tuple(high)
        )
        if scenario.plain_ekf:
            self.estimator = PlainEkf(
                scenario.sensor.relative_noise, scenario.accuracy, self._presumed_area(), scenario.fixed_noise
            )
        self.presumed = Presumed(self._presumed_area(), scenario.visibility, flat=self._cube is not None)
        self._low = np.array([*-self.half, CEILING])
        self._high = np.array([*self.half, SHALLOWEST if self._cube is not None else DEEPEST])
        self.target_estimator = TargetEstimator(
            accuracy_sd_m=scenario.target_accuracy, low_m=tuple(self._low), high_m=tuple(self._high)
        )
        self.targets = self._launch_targets(rng)
        self.tracks = [TargetTrack.unknown() for _ in range(scenario.targets)]
        start = START_CORNER * self.half + rng.uniform(-START_SPREAD, START_SPREAD, (scenario.robots, 2))
        depth = np.full(len(start), CEILING)
        if self._cube is not None:
            floor = np.nan_to_num(self._cube.depth_at(start), nan=DEEPEST)
            depth = floor - scenario.clearance - START_ABOVE
        self.positions = np.column_stack([start, depth])
        """True positions (n_vehicles, 3)."""
        self._localizer = CooperativeLocalizer(scenario.fading or Fading())
        self.team = self._localizer.begin(self.positions)
        self._drift = (scenario.fading or Fading()).drift * rng.standard_normal((scenario.robots, 2))
        self._walk = np.random.default_rng([scenario.seed, 3])
        self.names = names_of(np.arange(scenario.robots))
        self._felt = np.zeros((0, 3))
        self.resurfacings = 0
        self.needless = 0
        self._up = np.ones(scenario.robots, dtype=np.bool_)

    def _scatter(self, rng: np.random.Generator) -> FloatArray:
        n = self.scenario.landmarks
        if self._cube is None:
            return rng.uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0], (n, 3))
        chosen = np.zeros((0, 3))
        while len(chosen) < n:
            xy = rng.uniform(-1.0, 1.0, (2 * n, 2)) * self.half
            drawn = np.column_stack([xy, self._cube.depth_at(xy)])
            chosen = np.vstack([chosen, drawn[np.isfinite(drawn[:, 2])]])
        return chosen[:n]

    def _presumed_area(self) -> FloatArray:
        """Return the box (2, 3) of which it is known beforehand that landmarks lie in it."""
        return np.array([[*-self.half, 0.0 if self._cube is None else SHALLOWEST], [*self.half, DEEPEST]])

    def _launch_targets(self, rng: np.random.Generator) -> FloatArray:
        k = self.scenario.targets
        places = rng.uniform(self._low, self._high, (k, 3))
        course = rng.standard_normal((k, 3))
        course /= np.linalg.norm(course, axis=1, keepdims=True)
        return np.hstack([places, course * rng.uniform(*TARGET_SPEED, (k, 1))])

    @property
    def estimated(self) -> FloatArray:
        """Where the vehicles believe to be, (n_vehicles, 3)."""
        return np.asarray(self.positions if self.scenario.fading is None else self.team.positions_m)

    def move(self, waypoints: FloatArray) -> FloatArray:
        """Send the vehicles to where they should be in their own reckoning; return how far each went."""
        if self.scenario.fading is None:
            before, self.positions = self.positions, self._reached(waypoints)
            return np.asarray(np.linalg.norm(self.positions - before, axis=1))
        fading = self.scenario.fading
        legs = waypoints - self.estimated
        distance = np.linalg.norm(legs, axis=1)
        self.positions = self.positions + legs
        self.positions[:, :2] += distance[:, None] * self._drift
        kept = fading.kept(distance)[:, None]
        pull = np.sqrt(1.0 - kept**2) * fading.drift * self._walk.standard_normal(self._drift.shape)
        self._drift = kept * self._drift + pull
        self.team = self._localizer.move(self.team, legs)
        return np.asarray(distance)

    def _reached(self, waypoints: FloatArray) -> FloatArray:
        """Return how far vehicles come in a step: whom its altimeter lifts does not get there, it is no faster."""
        before, reached = self.positions, self._clear(waypoints)
        step = self.scenario.constraints.max_step_m
        late = np.linalg.norm(reached - before, axis=1) > step
        if not late.any():
            return reached
        enough, too_far = np.zeros(len(before)), np.ones(len(before))
        for _ in range(HALVINGS):
            part = 0.5 * (enough + too_far)
            fits = np.linalg.norm(self._clear(_on_the_way(before, waypoints, part)) - before, axis=1) <= step
            enough, too_far = np.where(fits, part, enough), np.where(fits, too_far, part)
        return np.where(late[:, None], self._clear(_on_the_way(before, waypoints, enough)), reached)

    def _clear(self, positions: FloatArray) -> FloatArray:
        """Lift vehicles to the clearance above the true floor, as their altimeters do."""
        if self._cube is None:
            return positions.copy()
        floor = self._cube.depth_at(positions[:, :2])
        lifted = positions.copy()
        lifted[:, 2] = np.fmin(positions[:, 2], floor - self.scenario.clearance)
        return lifted

    def pass_time(self) -> None:
        """Let the targets go on for one step; they turn back where the water ends."""
        sd = self.target_estimator.acceleration_sd
        pull = sd * self._walk.standard_normal((len(self.targets), 3))
        self.targets[:, :3] += self.targets[:, 3:] + 0.5 * pull
        self.targets[:, 3:] += pull
        for low in (True, False):
            bound = self._low if low else self._high
            beyond = self.targets[:, :3] < bound if low else self.targets[:, :3] > bound
            self.targets[:, :3] = np.where(beyond, 2.0 * bound - self.targets[:, :3], self.targets[:, :3])
            self.targets[:, 3:] = np.where(beyond, -self.targets[:, 3:], self.targets[:, 3:])
        self.tracks = [self.target_estimator.predict(track) for track in self.tracks]

    def visible(self) -> BoolArray:
        """Return which vehicle sees which landmark, (n_vehicles, n_landmarks)."""
        near = self.scenario.sensor.visible(self.positions, self.truth)
        if self._cube is not None:
            for position, seen in zip(self.positions, near, strict=True):
                seen[seen] = self._cube.in_sight(position[None], self.truth[seen])[0]
        return near

    def sense(self, rng: np.random.Generator) -> None:
        """Let every vehicle measure from where it is, and take in what it measured."""
        self._localize(rng)
        places, fading = self.estimated, self.scenario.fading
        sd = np.zeros(len(places)) if fading is None else self.team.sd_m
        floor = self._floor_under(places)
        for j, seen in enumerate(self.visible()):
            index = np.flatnonzero(seen)
            ranges = self.scenario.sensor.measure(self.positions[j], self.truth[index], rng)
            self.known = self.estimator.update(self.known, j, places[j], index, ranges, float(sd[j]), float(floor[j]))
        if self._cube is not None:
            self._felt = np.vstack([self._felt, np.column_stack([places[:, :2], floor])[np.isfinite(floor)]])
        self.presumed.look(places, self._floor_in_cells(floor))
        blur = np.zeros((len(places), 3)) if fading is None else self.team.variance_m2
        for k, target in enumerate(self.targets):
            hearing = self.target_estimator.sensor
            ranges = np.array([hearing.measure(place, target[None, :3], rng)[0] for place in self.positions])
            ranges[~hearing.visible(self.positions, target[None, :3])[:, 0]] = np.nan
            self.tracks[k] = self.target_estimator.update(self.tracks[k], places, ranges, blur)

    def _localize(self, rng: np.random.Generator) -> None:
        """Count surfacings; there is GPS, and ranges between vehicles everywhere."""
        fading, up = self.scenario.fading, self.positions[:, 2] <= CEILING + SURFACED
        if fading is None:
            return
        lost = self.team.sd_m / self.scenario.threshold_sd
        for j in (int(k) for k in np.flatnonzero(up & ~self._up)):
            self.resurfacings += 1
            self.needless += int((lost.max() if self.scenario.shared_fix else lost[j]) < NEEDED_AT)
        self._up = up
        fixed = range(len(up)) if self.scenario.shared_fix and up.any() else np.flatnonzero(up).tolist()
        for vehicle in fixed:
            place = self.positions[vehicle, :2] + fading.fix_sd_m * rng.standard_normal(2)
            self.team = self._localizer.fix(self.team, vehicle, place)
        if self.scenario.cooperative:
            for i in range(len(up)):
                for j in range(i):
                    r = float(np.linalg.norm(self.positions[i] - self.positions[j]))
                    y = r * (1.0 + fading.range_noise * rng.standard_normal())
                    self.team = self._localizer.meet(self.team, i, j, y)

    def _floor_under(self, places: FloatArray) -> FloatArray:
        """Return the depths that the vehicles' altimeters find, (n_vehicles,)."""
        if self._cube is None:
            return np.full(len(places), np.nan)
        return np.asarray(self._cube.depth_at(self.positions[:, :2]), dtype=np.float64)

    def _floor_in_cells(self, under: FloatArray) -> FloatArray:
        """Return what each vehicle presumes of the floor in the cells of unseen landmarks, (n_vehicles, n_cells).

        That is the depth of the nearest well known landmark; far from all of them, what its altimeter finds.
        """
        cells = self.presumed.middles
        presumed = np.repeat(under[:, None], len(cells), axis=1)
        fixed = self.known.fixed
        if self._cube is not None and fixed.any():
            known = self.known.position_m[fixed]
            reach = NEARBY * self.scenario.visibility
            away, nearest = cKDTree(known[:, :2]).query(cells[:, :2], distance_upper_bound=reach)
            near = np.isfinite(np.asarray(away))
            presumed[:, near] = known[np.asarray(nearest)[near], 2]
        return presumed

    @property
    def belief(self) -> Belief:
        """The landmarks as a planner gets them: estimates of those seen, presumed places of the others."""
        k, flat = self.known, self._cube is not None
        n, seen = len(k.looks), k.looks > 0
        point = np.where(seen[:, None], k.position_m, 0.0)
        if not seen.all():
            point[~seen] = self.presumed.places(int((~seen).sum()), k.position_m[seen])
        sd = np.sqrt(np.linalg.eigvalsh(np.where(seen[:, None, None], k.covariance_m2, 0.0))[:, 2])
        depth = self._depths(point, seen) if flat else point[:, 2]
        return Belief(
            np.ascontiguousarray(np.clip(point[:, :2], -self.half, self.half)),
            depth,
            np.where(seen, sd, np.inf),
            k.accurate,
            np.ones(n),
            0.2,
            k.covariance_m2,
            flat,
            sounded_m=self._felt,
        )

    def _depths(self, point: FloatArray, seen: BoolArray) -> FloatArray:
        """Return depths of landmarks on the floor, (n,): well estimated ones, others as altimeters found it nearby."""
        sd = ROUGHLY * self.scenario.visibility
        known = seen & (self.known.sd_m[:, 2] < sd)
        depth = np.where(known, point[:, 2], np.nan)
        if len(self._felt):
            rest = np.flatnonzero(~known)
            away, nearest = cKDTree(self._felt[:, :2]).query(
                point[rest, :2], distance_upper_bound=NEARBY * self.scenario.visibility
            )
            near = np.isfinite(np.asarray(away))
            depth[rest[near]] = self._felt[np.asarray(nearest)[near], 2]
        return depth

    def situation(self, step: int) -> Situation:
        """Return what the planner is asked."""
        n = len(self.positions)
        return Situation(
            step,
            self.scenario.steps,
            self.names,
            self.estimated,
            np.full(n, np.nan),
            self.belief,
            np.zeros((0, 2)),
            self.scenario.constraints,
            self.told_of_targets(),
            self._told_of_localization(),
        )

    def told_of_targets(self) -> Targets | None:
        """Return what is known of the targets, predicted for the end of the next step."""
        if not self.tracks:
            return None
        ahead = [self.target_estimator.predict(track) for track in self.tracks]
        accurate = np.array([self.target_estimator.accurate(track) for track in self.tracks])
        sensor = self.target_estimator.sensor
        return Targets(
            np.array([track.state for track in ahead]),
            np.array([track.covariance for track in ahead]),
            accurate,
            self.scenario.target_accuracy,
            sensor.relative_noise,
            sensor.visibility_m,
        )

    def _told_of_localization(self) -> Localization | None:
        if self.scenario.fading is None:
            return None
        depth = self.estimated[:, 2]
        climb = float((depth - CEILING).min()) if self.scenario.shared_fix else float((depth - CEILING).max())
        ahead = self._localizer.foretold_sd_m(self.team, max(climb, MAX_STEP))
        return Localization(self.team.sd_m, ahead, self.scenario.threshold_sd, CEILING, self.scenario.shared_fix)

    def cost(self) -> float:
        """Return MED13's J, eq. (3), of the true landmarks and targets; ``A`` as the covariances say."""
        k, nobody = self.known, np.zeros(len(self.positions), dtype=np.int64)
        sets = LandmarkSets(k.accurate, nobody, self.visible(), ~k.accurate)
        told = self.told_of_targets()
        if told is not None:
            told = Targets(
                self.targets, told.covariance, told.accurate, told.accuracy_sd_m, told.relative_noise, told.hearing_m
            )
        static = -med13_objective(self.positions, self.truth, sets).total
        return static + dynamic_cost(self.positions, told, self._told_of_localization(), MED13_K)

    def landmark_errors(self) -> FloatArray:
        """Return how far each landmark is from its estimate, (n,); one never seen is taken to be in the middle."""
        middle = self._presumed_area().mean(axis=0)
        estimate = np.where(np.isnan(self.known.position_m), middle, self.known.position_m)
        return np.asarray(np.linalg.norm(estimate - self.truth, axis=1))

    def target_errors(self) -> FloatArray:
        """Return how far each target is from its estimate, (k,)."""
        middle = (self._low + self._high) / 2.0
        places = [track.state[:3] if track.known else middle for track in self.tracks]
        return np.asarray(np.linalg.norm(np.array(places).reshape(-1, 3) - self.targets[:, :3], axis=1))

    def localization_errors(self) -> FloatArray:
        """Return how far each vehicle is from where it believes to be, (n_vehicles,), horizontally."""
        return np.asarray(np.linalg.norm((self.estimated - self.positions)[:, :2], axis=1))


def _on_the_way(before: FloatArray, waypoints: FloatArray, part: FloatArray) -> FloatArray:
    """Return where vehicles are after parts (n,) of their ways, (n, 3)."""
    return before + part[:, None] * (waypoints - before)
