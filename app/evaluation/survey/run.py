"""The papers' field experiment on any terrain: a planner beside the usual practice, even coverage and an oracle."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.arrays import FloatArray
from app.evaluation.survey.dynamics import fly_pattern_at_sea, fly_planner_at_sea
from app.evaluation.survey.oracle import oracle_soundings
from app.evaluation.survey.world import (
    FAR_M,
    SOUNDING_RATE_HZ,
    SPEED_MPS,
    SurveyScenario,
    default_map,
    fly_planner,
    fly_routes,
    rmse_m,
    stationary_map,
    unknown_belief,
)
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Turns, Vehicles
from app.exploration.lines.even_survey import Pattern, even_survey
from app.exploration.lines.lattice import Sweep, longer_axis_rad
from app.exploration.lines.lawnmower import lawnmower_routes
from app.exploration.motion.leg_rules import TURN_S
from app.exploration.planner.options import PlannerOptions
from app.exploration.survey.backbone import MARGIN_M, there_and_back
from app.exploration.survey.value import SurveyObjective, make_nodes
from app.mapping.types import Soundings

NO_TURNS = Turns(0.0, 0.0)
TVU_A_M, TVU_B = 0.25, 0.0075
"""IHO S-44 special order: total vertical uncertainty at 95 % is sqrt(a^2 + (b depth)^2)."""


@dataclass(frozen=True)
class SurveyResult:
    """How good the map of some soundings is; ``coverage_pct``: cells known to S-44 special order.

    ``rmse_m`` and ``l2_norm`` are those of the default map. A yardstick is given the better of the default map and
    the stationary one, whose figure is ``rmse_stationary_m``.
    """

    rmse_m: float
    l2_norm: float
    samples: int
    distance_m: float
    time_s: float
    coverage_pct: float
    rmse_stationary_m: float


@dataclass(frozen=True)
class RecordedTrack:
    """The better of the two maps from a track that was really flown, where the terrain file has one."""

    samples: int
    rmse_m: float


@dataclass(frozen=True)
class SurveyRun:
    """One run; names as in the command's JSON.

    ``even``: whole even lines, as many as fit. ``ratio``: RMSE over that of the best of the three patterns.
    ``gap_closed``: how far the RMSE has come from that of the best pattern (0) to that of the oracle (1).
    ``minutes``, ``flown_m`` and ``on_plan_m`` are told of surveys at sea only: how long they lasted, how far the
    vehicles flew together, and how much of that along their legs.
    """

    planner: str
    terrain: str
    seed: int
    symmetry: int
    vehicles: int
    steps: int
    max_step_m: float
    sampling: str
    sounder: str
    rmse_m: float
    l2_norm: float
    samples: int
    distance_m: float
    time_s: float
    coverage_pct: float
    rmse_stationary_m: float
    plan_ms_median: float
    plan_ms_p99: float
    plan_s: float
    usual_practice: SurveyResult
    coverage: SurveyResult
    even: SurveyResult
    random: SurveyResult
    oracle: SurveyResult
    ratio: float
    gap_closed: float
    recorded_track: RecordedTrack | None = None
    ratio_recorded: float | None = None
    minutes: float | None = None
    flown_m: float | None = None
    on_plan_m: float | None = None


def run_survey(
    scenario: SurveyScenario,
    planner: str,
    options: PlannerOptions,
    progress: Callable[[int], None] = lambda step: None,
    recorded: Soundings | None = None,
) -> SurveyRun:
    """Fly the planner and everything that it is compared with.

    The patterns travel as far as the planner did, on average over the vehicles; the oracle places as many soundings.
    ``recorded`` are the soundings of a track that was really flown over this terrain.
    """
    track = fly_planner(scenario, planner, options, progress)
    ours = judge(scenario, track.soundings, track.distance_m)
    limit = float(track.distance_m.mean())
    usual = fly_pattern(
        scenario,
        lawnmower_routes(scenario.constraints, scenario.starts_m[:, :2], np.full(scenario.vehicles, limit)),
        limit,
    )
    coverage = fly_pattern(scenario, even_coverage(scenario, limit), limit)
    lines = best_even_survey(scenario, limit)
    even = coverage if lines is None else fly_pattern(scenario, lines, limit)
    walk = fly_planner(scenario, "random", PlannerOptions(), known=unknown_belief(scenario.belief_grid))
    random = judge(scenario, walk.soundings, walk.distance_m, yardstick=True)
    return _compared(scenario, planner, ours, track.plan_s, (usual, coverage, even, random), recorded)


def run_survey_at_sea(
    scenario: SurveyScenario,
    planner: str,
    options: PlannerOptions,
    minutes: float,
    progress: Callable[[int], None] = lambda step: None,
    recorded: Soundings | None = None,
) -> SurveyRun:
    """Let vehicles with turning circles fly for so many minutes, led by the planner, then by the patterns."""
    track = fly_planner_at_sea(scenario, planner, options, minutes, progress)
    ours = judge(scenario, track.soundings, track.flown_m)
    starts, turns = scenario.starts_m[:, :2], Turns(options.turn_radius_m or TURN_S * SPEED_MPS, 0.0)
    patterns = (
        lambda metres: lawnmower_routes(scenario.constraints, starts, np.full(scenario.vehicles, metres)),
        lambda metres: even_coverage(scenario, metres),
        lambda metres: best_even_survey(scenario, metres, turns),
    )
    flown = [fly_pattern_at_sea(scenario, routes_of, minutes) for routes_of in patterns]
    walk = fly_planner_at_sea(scenario, "random", PlannerOptions(), minutes, known=unknown_belief(scenario.belief_grid))
    usual, coverage, even, random = (
        judge(scenario, track.soundings, track.flown_m, yardstick=True) for track in (*flown, walk)
    )
    run = _compared(scenario, planner, ours, track.plan_s, (usual, coverage, even, random), recorded)
    return replace(run, minutes=minutes, flown_m=float(track.flown_m.sum()), on_plan_m=float(track.on_plan_m.sum()))


def _compared(
    scenario: SurveyScenario,
    planner: str,
    ours: SurveyResult,
    plan_s: FloatArray,
    others: tuple[SurveyResult, SurveyResult, SurveyResult, SurveyResult],
    recorded: Soundings | None,
) -> SurveyRun:
    """Put a survey beside the usual practice, even coverage, even lines and the random walk (``others``)."""
    usual, coverage, even, random = others
    placed = oracle_soundings(scenario.log(3), scenario.terrain, ours.samples, float(scenario.starts_m[:, 2].mean()))
    oracle = judge(scenario, placed, np.zeros(scenario.vehicles), yardstick=True)
    beside = None
    if recorded is not None:
        beside = RecordedTrack(len(recorded), judge(scenario, recorded, np.zeros(1), yardstick=True).rmse_m)
    pattern = float(np.nanmin([usual.rmse_m, coverage.rmse_m, even.rmse_m]))
    return SurveyRun(
        planner=planner,
        terrain=scenario.terrain.name,
        seed=scenario.seed,
        symmetry=scenario.symmetry,
        vehicles=scenario.vehicles,
        steps=scenario.steps,
        max_step_m=scenario.max_step_m,
        sampling=scenario.sampling,
        sounder=scenario.sounder,
        rmse_m=ours.rmse_m,
        l2_norm=ours.l2_norm,
        samples=ours.samples,
        distance_m=ours.distance_m,
        time_s=ours.time_s,
        coverage_pct=ours.coverage_pct,
        rmse_stationary_m=ours.rmse_stationary_m,
        plan_ms_median=1e3 * float(np.median(plan_s)),
        plan_ms_p99=1e3 * float(np.quantile(plan_s, 0.99)),
        plan_s=float(plan_s.sum()),
        usual_practice=usual,
        coverage=coverage,
        even=even,
        random=random,
        oracle=oracle,
        ratio=ours.rmse_m / pattern,
        gap_closed=(pattern - ours.rmse_m) / (pattern - oracle.rmse_m) if oracle.rmse_m < pattern else float("nan"),
        recorded_track=beside,
        ratio_recorded=None if beside is None else ours.rmse_m / beside.rmse_m,
    )


def judge(
    scenario: SurveyScenario, soundings: Soundings, distance_m: FloatArray, *, yardstick: bool = False
) -> SurveyResult:
    """Map the soundings and compare with the truth; ``distance_m`` (vehicles,) is what each travelled.

    A yardstick may choose the better of the default and the stationary map.
    """
    if not len(soundings):
        return SurveyResult(
            np.nan, np.nan, 0, float(np.sum(distance_m)), float(np.max(distance_m)) / SPEED_MPS, 0.0, np.nan
        )
    estimate, stationary = default_map(soundings, scenario.grid), stationary_map(soundings, scenario.grid)
    rmse, l2 = rmse_m(estimate, scenario.terrain)
    rmse_stationary, l2_stationary = rmse_m(stationary, scenario.terrain)
    if yardstick and rmse_stationary < rmse:
        estimate, rmse, l2 = stationary, rmse_stationary, l2_stationary
    allowed = np.hypot(TVU_A_M, TVU_B * estimate.depth_m) / 1.96
    return SurveyResult(
        rmse,
        l2,
        len(soundings),
        float(np.sum(distance_m)),
        float(np.max(distance_m)) / SPEED_MPS,
        100.0 * float(np.mean(estimate.sd_m <= allowed)),
        rmse_stationary,
    )


def even_coverage(scenario: SurveyScenario, distance_m: float) -> list[FloatArray]:
    """Return routes of equal area per vehicle, in the direction and order that come closest to every place."""
    belief = unknown_belief(scenario.belief_grid)
    nodes = make_nodes(belief.xy_m, belief.weight)
    spacing = scenario.terrain.width_m * scenario.terrain.height_m / (scenario.vehicles * distance_m)
    objective = SurveyObjective(max(belief.correlation_length_m, spacing), 2.0, NO_TURNS, FAR_M)
    vehicles = _vehicles(scenario, distance_m)
    found = (there_and_back(sweep, vehicles, nodes, objective, 0.5, 0.0) for sweep in _sweeps(scenario))
    return [share.stops for share in min(found, key=lambda survey: survey[0])[1]]


def best_even_survey(scenario: SurveyScenario, distance_m: float, turns: Turns = NO_TURNS) -> list[FloatArray] | None:
    """Return the even survey of whole lines that fits into ``distance_m`` per vehicle, of both directions the closer.

    None where not even one line fits.
    """
    vehicles = _vehicles(scenario, distance_m)
    found = (even_survey(sweep, vehicles, turns, Pattern()) for sweep in _sweeps(scenario))
    surveys = [survey for survey in found if survey is not None]
    return min(surveys, key=lambda survey: survey.spacing_m).routes if surveys else None


def _sweeps(scenario: SurveyScenario) -> list[Sweep]:
    """Return both directions of lines, that along the longer axis first."""
    free, axis = FreeSpace(scenario.constraints, MARGIN_M), longer_axis_rad(scenario.area_m)
    return [Sweep(scenario.constraints, free, direction) for direction in (axis, axis + np.pi / 2)]


def _vehicles(scenario: SurveyScenario, distance_m: float) -> Vehicles:
    n = scenario.vehicles
    return Vehicles(np.ascontiguousarray(scenario.starts_m[:, :2]), np.full(n, np.nan), np.full(n, distance_m))


def fly_pattern(scenario: SurveyScenario, routes: list[FloatArray], distance_m: float) -> SurveyResult:
    """Fly given routes for at most a distance per vehicle, and judge the better of the two maps of it."""
    log = scenario.log(2)
    spacing = SPEED_MPS / SOUNDING_RATE_HZ if scenario.sampling == "continuous" else distance_m / scenario.steps
    flown = fly_routes(log, scenario.starts_m, routes, distance_m, spacing)
    return judge(scenario, log.soundings, flown, yardstick=True)
