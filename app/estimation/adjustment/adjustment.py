"""Adjusts tracks: ties and fixes, weighed against how positions drift, in one robust sparse least-squares problem."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy import sparse
from scipy.special import stdtrit

from app.arrays import BoolArray, FloatArray
from app.estimation.adjustment.drift import LEAST_FIX_M, DriftModel, DriftNodes
from app.estimation.adjustment.least_squares import DriftModels, LeastSquares, Solution, WeighedTies
from app.estimation.adjustment.ties import KnownShift, Matcher, Outcome, Relief, Sections, Tie, rms
from app.estimation.adjustment.tracks import Fixes, TrackSoundings

ROUNDS, LAST_ROUNDS = 4, 2
HELD_OUT_EACH = 4
"""Of so many sections one is left out of the first adjustment, which has to make it fit better all the same."""

BY_CHANCE = 0.01
"""Held-out sections have to fit better by so much that this is how probable it is by chance at most (Student's t)."""

WORTHWHILE = 0.92
"""So much of their RMS by fixes alone they may have left at most."""

LEAST_HELD_OUT = 4
LEAST_OFFSET_M = 1e-3
"""Of a depth that a section as a whole is off by: less stands for none."""

CAUCHY = 2.4
"""Ties that are off by so many deviations count half."""

LEAST_WEIGHT = 0.15
"""Ties that count less are called outliers."""

THREADS = 2


@dataclass(frozen=True)
class TieFound:
    """A tie as it is shown.

    Attributes
    ----------
    vehicle, time_s
        Of its section's middle.
    others
        Number of the vehicle that it was compared with most.
    east_m, north_m
        Where, adjusted.
    outcome
    before_m, after_m
        RMS of the section's depths less the others', by positions as they were and as they are; NaN: nothing overlaps.
    shift_m : (2,)
        By how much it was to be moved against the others, of which the adjustment did what all allowed.
    sd_m : (2,)
        Deviations of that along its best and worst direction, infinite where the terrain says nothing.
    held_out
        Whether the first adjustment was tried on it.
    """

    vehicle: int
    time_s: float
    others: int | None
    east_m: float
    north_m: float
    outcome: Outcome
    before_m: float
    after_m: float
    sd_m: tuple[float, float]
    held_out: bool


@dataclass(frozen=True)
class HeldOutTies:
    """How well sections fit that were left out, RMS of depths less the others' (m).

    By positions as they were, by fixes alone, and by fixes and all other ties.
    """

    sections: int
    before_m: float
    by_fixes_m: float
    after_m: float
    significance: float
    """How much better they fit than by fixes alone, in standard errors."""

    @property
    def speaks_for_ties(self) -> bool:
        """Whether ties made them fit better, by more than chance and by enough to matter."""
        needed = -float(stdtrit(self.sections - 1, BY_CHANCE))
        return self.significance >= needed and self.after_m <= WORTHWHILE * self.by_fixes_m


@dataclass(frozen=True)
class AdjustedTracks:
    """By how much vehicles' positions were off.

    Attributes
    ----------
    nodes
    offset_m : (m, 2)
        Reckoned position minus true one, east and north, at the nodes; linear between.
    sd_m : (m, 2)
        Standard deviation of each.
    before_sd_m : (m, 2)
        The same of positions as they were reckoned.
    ties
    held_out
        None: too little overlaps to leave anything out.
    by_ties
        Whether ties were used. Else the held-out ones did not fit better, and fixes alone did it.
    """

    nodes: DriftNodes
    offset_m: FloatArray
    sd_m: FloatArray
    before_sd_m: FloatArray
    ties: tuple[TieFound, ...]
    held_out: HeldOutTies | None
    by_ties: bool

    def at(self, vehicle: int, time_s: FloatArray) -> FloatArray:
        """Return by how much a vehicle's positions were off at some times (n,), (n, 2)."""
        times = np.asarray(time_s, dtype=float)
        weights = self.nodes.interpolation(np.full(len(times), vehicle), times)
        return np.asarray(weights @ self.offset_m)


def adjusted(
    soundings: TrackSoundings,
    fixes: Fixes,
    model: DriftModel | None = None,
    *,
    cell_m: float = 1.0,
    reach_m: float = 8.0,
    node_s: float = 20.0,
    section_s: float = 20.0,
    apart_s: float = 30.0,
    most_m: float = 20.0,
    offset_sd_m: float = 0.1,
) -> AdjustedTracks:
    """Return by how much vehicles' positions were off.

    Parameters
    ----------
    soundings
        As :func:`thinned` returns them, to about ``cell_m``.
    fixes
    model
        How positions drift; None: the usual. An error of 0 is one that there is not.
    cell_m, reach_m
        Side of cells that bottoms are compared on; how far a sounding tells of the bottom around it.
    node_s, section_s
        Seconds between nodes; length of the sections that are compared.
    apart_s
        Soundings of one vehicle are only compared when they were made farther apart.
    most_m
        No section is moved farther against the others than this, beyond what fixes say.
    offset_sd_m
        Of a depth that a section as a whole may be off by.

    Raises
    ------
    ValueError
        Without a sounding; for a deviation that is none.
    """
    if not len(soundings):
        raise ValueError("there is no sounding along which a track could be adjusted")
    if not 0.0 <= offset_sd_m < np.inf:
        raise ValueError(f"offset_sd_m: {offset_sd_m} is no standard deviation; 0 or more is, 0 for none")
    nodes = DriftNodes.along(soundings, fixes, node_s)
    fixes = replace(fixes, sd_m=np.maximum(fixes.sd_m, LEAST_FIX_M))
    models = DriftModels(nodes, fixes, (model or DriftModel()).usable())
    problem = LeastSquares(nodes, fixes, models.typical())
    by_fixes = problem.solve(WeighedTies.none())
    weights = nodes.interpolation(soundings.vehicle, soundings.time_s)
    dive = nodes.dive[nodes.weights(soundings.vehicle, soundings.time_s)[0][:, 1]]
    sections = Sections.of_tracks(soundings, dive, section_s)
    relief = Relief.of_sections(soundings, sections)
    matcher = Matcher(soundings, sections, nodes, relief, cell_m, reach_m, apart_s, max(offset_sd_m, LEAST_OFFSET_M))
    found = _Adjustment(matcher, problem, weights, most_m)
    held = np.arange(len(sections)) % HELD_OUT_EACH == HELD_OUT_EACH // 2
    with ThreadPoolExecutor(THREADS) as pool:
        found.pool = pool
        tried = found.run(by_fixes, ~held, ROUNDS)
        held_out = found.compare(held, by_fixes, tried)
        by_ties = held_out is not None and held_out.speaks_for_ties
        state = found.run(tried, np.ones(len(sections), dtype=bool), LAST_ROUNDS) if by_ties else by_fixes
        offset, sd, before_sd = models.average(state.ties, pool)
        shown = found.shown(state.ties if by_ties else tried.ties, offset, held, by_ties)
    return AdjustedTracks(nodes, offset, sd, before_sd, shown, held_out, by_ties)


class _Adjustment:
    """Finds ties and solves, in turns, so that each finds what the other left."""

    pool: ThreadPoolExecutor

    def __init__(self, matcher: Matcher, problem: LeastSquares, weights: sparse.csr_array, most_m: float) -> None:
        self._matcher, self._problem, self._weights, self._most_m = matcher, problem, weights, most_m

    def places(self, offset_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where all soundings are by some errors of the nodes (m, 2)."""
        soundings = self._matcher.soundings
        off = self._weights @ offset_m
        return soundings.east_m - off[:, 0], soundings.north_m - off[:, 1]

    def run(self, state: Solution, used: BoolArray, rounds: int) -> Solution:
        """Return what ties of the used sections (k,) make of a state."""
        sections = self._matcher.sections
        for _ in range(rounds):
            known = self._known(state)
            east, north = self.places(state.offset_m)

            def one(
                k: int, east: FloatArray = east, north: FloatArray = north, known: list[KnownShift] = known
            ) -> Tie | None:
                return self._matcher.tie(k, east, north, known[k], self._most_m) if used[k] else None

            found = list(self.pool.map(one, range(len(sections))))
            ties = [_NONE if tie is None else tie for tie in found]
            # Shifts are beyond what was adjusted before.
            before = np.array([tie.weights @ state.offset_m[tie.nodes] for tie in ties]).reshape(-1, 2)
            targets = before + np.array([tie.shift_m for tie in ties]).reshape(-1, 2)
            weights = np.ones(len(ties))
            for _ in range(5):
                state = self._problem.solve(WeighedTies(ties, targets, weights))
                left = np.array([tie.weights @ state.offset_m[tie.nodes] for tie in ties]).reshape(-1, 2) - targets
                information = np.array([tie.information for tie in ties]).reshape(-1, 2, 2)
                square = np.einsum("ki,kij,kj->k", left, information, left)
                weights = 1.0 / (1.0 + square / CAUCHY**2)
            state = replace(state, ties=WeighedTies(ties, targets, weights))
        return state

    def _known(self, state: Solution) -> list[KnownShift]:
        """Return for each section what is known of its shift, without its own tie, beyond a state's errors."""
        sections, nodes = self._matcher.sections, self._matcher.nodes
        combined = nodes.interpolation(sections.vehicle, sections.middle_s).tolil()
        for k, tie in enumerate(state.ties.ties):
            if tie.outcome == Outcome.USED:
                combined[k] = 0.0
                combined[[k], tie.nodes] = tie.weights
        covariances = self._problem.covariances(state, sparse.csr_array(combined))
        found = []
        for k in range(len(sections)):
            covariance, mean = covariances[k] + 1e-6 * np.eye(2), np.zeros(2)
            if k < len(state.ties.ties) and state.ties.ties[k].outcome == Outcome.USED:
                tie, weight = state.ties.ties[k], state.ties.weights[k]
                precision = np.linalg.inv(covariance) - 0.98 * weight * tie.information
                low, axes = np.linalg.eigh(precision)
                covariance = (axes / np.maximum(low, 1e-3)) @ axes.T
            found.append(KnownShift(mean, covariance))
        return found

    def compare(self, held: BoolArray, by_fixes: Solution, tried: Solution) -> HeldOutTies | None:
        """Return how well sections (k,) fit that were left out; None where too few overlap with others."""
        which = np.flatnonzero(held).tolist()
        sets = [self._residuals(which, offset) for offset in (0.0 * tried.offset_m, by_fixes.offset_m, tried.offset_m)]
        both = [k for k in range(len(which)) if all(len(one[k]) >= 5 for one in sets)]
        if len(both) < LEAST_HELD_OUT:
            return None
        squares = np.array([[np.mean(one[k] ** 2) for one in sets] for k in both])
        raw, fixed, after = np.sqrt(np.mean(squares, axis=0))
        # Logarithms: one steep place is not to decide alone.
        better = 0.5 * np.log((squares[:, 1] + 1e-6) / (squares[:, 2] + 1e-6))
        error = float(np.std(better, ddof=1)) / np.sqrt(len(better))
        return HeldOutTies(len(both), float(raw), float(fixed), float(after), float(np.mean(better) / max(error, 1e-9)))

    def _residuals(self, which: list[int], offset_m: FloatArray) -> list[FloatArray]:
        east, north = self.places(offset_m)
        return list(self.pool.map(lambda k: self._matcher.residual_m(k, east, north), which))

    def shown(self, ties: WeighedTies, offset_m: FloatArray, held: BoolArray, by_ties: bool) -> tuple[TieFound, ...]:
        """Return what became of all ties."""
        sections, nodes = self._matcher.sections, self._matcher.nodes
        which = list(range(len(sections)))
        before = self._residuals(which, 0.0 * offset_m)
        after = self._residuals(which, offset_m)
        east, north = self.places(offset_m)
        found = []
        for k in which:
            tie = ties.ties[k] if k < len(ties.ties) else _NONE
            outcome, others = tie.outcome, None
            sd = (np.inf, np.inf)
            if outcome == Outcome.USED:
                told = np.linalg.eigvalsh(tie.information)[::-1]
                sd = (float(told[0] ** -0.5), float(told[1] ** -0.5) if told[1] > 1e-9 else np.inf)
                far = np.bincount(nodes.vehicle[tie.nodes], -np.minimum(tie.weights, 0.0))
                others = int(np.argmax(far))
                if not by_ties:
                    outcome = Outcome.NOT_SIGNIFICANT
                elif ties.weights[k] < LEAST_WEIGHT:
                    outcome = Outcome.OUTLIER
            rows = slice(sections.first[k], sections.first[k + 1])
            found.append(
                TieFound(
                    vehicle=int(sections.vehicle[k]),
                    time_s=float(sections.middle_s[k]),
                    others=others,
                    east_m=float(east[rows].mean()),
                    north_m=float(north[rows].mean()),
                    outcome=outcome,
                    before_m=rms(before[k]),
                    after_m=rms(after[k]),
                    sd_m=sd,
                    held_out=bool(held[k]),
                )
            )
        return tuple(found)


_NONE = Tie(np.zeros(2), np.zeros((2, 2)), np.zeros(0, np.int64), np.zeros(0), Outcome.NO_OVERLAP, np.nan)


@cache
def warm_up() -> None:
    """Compile what compares sections (or load it from the cache), so that no request waits for it."""
    time_s = np.arange(0.0, 240.0, 0.5)
    across = np.where(time_s < 120.0, 0.0, 1.0)
    along = np.where(time_s < 120.0, time_s, 240.0 - time_s)
    depth = 10.0 + np.sin(along)
    sd = np.full(len(time_s), 0.1)
    soundings = TrackSoundings(np.zeros(len(time_s), dtype=np.int64), time_s, along, across, depth, sd)
    adjusted(soundings, Fixes.none())
