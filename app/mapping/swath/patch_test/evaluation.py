"""The mounting with which a vehicle's lines agree, what is known of it, and whether they agree better."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.swath.mounting import Mounting
from app.mapping.swath.patch_test.beams import PatchBeams
from app.mapping.swath.patch_test.cells import BEND, LATENCY, ROLL, SharedCells, shared_cells
from app.mapping.swath.patch_test.solution import Equations, LineErrors, Step

PARAMETERS = ("roll_rad", "pitch_rad", "heading_rad", "latency_s")

STEPS = np.array([1e-4, 1e-4, 1e-4, 0.05])
"""By which parameters are changed to see what that does."""

BENT_BY = 0.001
"""And the sound speed at the sonar, by a share."""

LIMITS = np.array([np.radians(10.0), np.radians(10.0), np.radians(15.0), 2.0])
"""Nothing farther than this from the mounting that counts now is looked for."""

KNOWN = np.array([np.radians(0.2), np.radians(0.6), np.radians(1.2), 0.12])
"""A parameter whose standard deviation is larger is not determined."""

MATTERS = np.array([np.radians(0.02), np.radians(0.05), np.radians(0.1), 0.005])
"""Smaller changes are not proposed."""

LEAST_SD = np.array([np.radians(0.01), np.radians(0.02), np.radians(0.05), 0.002])
"""Nothing is known better: errors of attitude and of time do not average out over the beams of some lines."""

WIDENED = np.array([1.0, 1.25, 1.25, 1.25])
"""What is told is this much wider than what the equations say, which do not know all that is wrong with beams and
ground: so much larger were errors on generated floors (``benchmarks.mapping.patch_test``, even seeds)."""

SURE = 3.0
"""Nor are those of fewer standard deviations, or with which the spread falls by fewer of its own."""

SETTLED = 0.5
"""An estimate has settled when it changes by no more than so many of its deviations."""

ROUNDS = ((4, 3, 1.0), (2, 3, 1.0), (1, 3, 0.5))
"""Size of the cells, in the smallest, how often beams are placed anew, and what share of each step is made: near the
end steps to and fro, as beams change their cells, have to become smaller."""

LAST = 8
"""So often at most, to the end, with what is known."""

LEAST_CELLS, LEAST_BLOCKS = 30, 5
OF_HEIGHT = 0.1
"""The smallest cells are as wide as this share of the height of the sonar above ground."""


class NoOverlapError(ValueError):
    """No two lines saw enough of the same ground."""


class NotWantedError(Exception):
    """Nobody waits any more."""


class Known(StrEnum):
    """What lines tell of a parameter."""

    DETERMINED = "determined"
    UNDETERMINED = "undetermined"
    UNSETTLED = "unsettled"
    BESIDE = "beside"


@dataclass(frozen=True)
class ParameterEstimate:
    """One of the four.

    Attributes
    ----------
    known
        ``beside``: farther away than is looked for.
    value, sd
        Radians or seconds; None where it is not determined.
    proposed
        Whether it differs from what counts now by enough, or another one does that it is told with, and lines agree
        better with them.
    """

    known: Known
    value: float | None = None
    sd: float | None = None
    proposed: bool = False


@dataclass(frozen=True)
class LineAgreement:
    """How well lines agree: RMS of their depths in cells beside the cells' means, metres.

    ``significance``: by how many of its standard deviations the mean square became smaller.
    """

    before_m: float
    after_m: float
    significance: float


@dataclass(frozen=True)
class MountingEstimate:
    """What overlapping lines say of a mounting.

    Attributes
    ----------
    parameters
        By their names.
    proposal
        What counts now with what is proposed in its place; None where nothing is.
    agreement
        Now, and with the proposal; where nothing is proposed with all that is determined.
    cells, lines, beams
        How many were compared; lines as their numbers.
    """

    parameters: dict[str, ParameterEstimate]
    proposal: Mounting | None
    agreement: LineAgreement
    cells: int
    lines: tuple[int, ...]
    beams: int


def block_size_m(height_m: float) -> float:
    """Return the side of the largest cells, in which ground is chosen, for a sonar that is so high above it."""
    return ROUNDS[0][0] * OF_HEIGHT * max(height_m, 1.0)


def estimate(
    beams: PatchBeams,
    mounting: Mounting,
    height_m: float,
    errors: LineErrors,
    is_wanted: Callable[[], bool] = lambda: True,
) -> MountingEstimate:
    """Return what beams say of their sonar's mounting.

    Parameters
    ----------
    mounting
        That counts now: its lever arm stays, and its parameters are begun with.
    height_m
        Usual height of the sonar above ground.
    errors
        How well lines fit each other beside the mounting.
    is_wanted
        Asked between steps, each of which takes up to some seconds: whether anybody still waits for the answer.

    Raises
    ------
    NoOverlapError, NotWantedError
    """
    search = _Search(beams, mounting, height_m, errors, is_wanted)
    for size, rounds, share in ROUNDS:
        for _ in range(rounds):
            search.go_on(size, share)
    held: dict[int, Known] = {}
    while True:
        free = [number for number in range(len(PARAMETERS)) if number not in held]
        search.hold(held)
        for _ in range(LAST if free else 0):
            step = search.go_on(1, ROUNDS[-1][2], free)
            if search.has_settled(step, free):
                break
        found = search.judged(free, step) if free else {}
        if not found:
            break
        held |= found
    sd = dict(zip(free, np.hypot(WIDENED[free] * step.sd, LEAST_SD[free]).tolist(), strict=True)) if free else {}
    return search.result(free, sd, held)


class _Search:
    """Goes from one mounting to a better one; parameters are numbered as in :data:`PARAMETERS`."""

    def __init__(
        self,
        beams: PatchBeams,
        mounting: Mounting,
        height_m: float,
        errors: LineErrors,
        is_wanted: Callable[[], bool],
    ) -> None:
        self._is_wanted = is_wanted
        self._beams, self._start, self._height_m, self._errors = beams, mounting, height_m, errors
        self._bent = beams.bent(BENT_BY)
        self._block_m = block_size_m(height_m)
        self._first = np.array([getattr(mounting, name) for name in PARAMETERS])
        self._at = self._first.copy()
        cells = self._cells_of(self._at, 1)
        if cells.cells < LEAST_CELLS:
            raise NoOverlapError(f"they share {cells.cells} cells, {LEAST_CELLS} are asked for")
        self._before = _Spread.of(cells, errors)
        self._equations = Equations(cells, errors)
        self._begun = False

    def go_on(self, size: int, share: float, free: Sequence[int] | None = None) -> Step:
        """Make one step with cells of so many times the smallest; ``free``: None: whatever is known there.

        Where lines share no ground as they are placed now the step is empty, and nothing is moved.
        """
        cells = self._cells_of(self._at, size)
        step = Step(np.zeros(0), np.zeros(0), np.zeros((0, 3)))
        if len(cells):
            self._equations = equations = Equations(cells, self._errors)
            # A wrong roll tilts even ground, which would be taken for a slope that tells of pitch.
            chosen = list(free) if free is not None else _knowable(equations) if self._begun else [ROLL]
            step = equations.solve(chosen)
            self._at[chosen] += np.clip(share * step.change, -0.5 * LIMITS[chosen], 0.5 * LIMITS[chosen])
            self._at = np.clip(self._at, self._first - LIMITS, self._first + LIMITS)
        self._begun = True
        return step

    def hold(self, held: dict[int, Known]) -> None:
        """Take what is not known as it is now."""
        for number in held:
            self._at[number] = self._first[number]

    def judged(self, free: Sequence[int], step: Step) -> dict[int, Known]:
        """Return which of the free parameters are not known after a last step, and why; none: all are."""
        if not len(step.change):
            return dict.fromkeys(free, Known.UNSETTLED)
        if _excess(step, free).max() > 1.0:
            return {_least_known(self._equations, step, free): Known.UNDETERMINED}
        # They depend on each other: where one is not found, neither are others but the roll.
        dependent = [number for number in free if number != ROLL]
        moving = np.abs(step.change) > self._still(step, free)
        beside = np.abs(self._at - self._first)[list(free)] >= 0.999 * LIMITS[list(free)]
        for wrong, why in ((beside, Known.BESIDE), (moving, Known.UNSETTLED)):
            if wrong.any():
                return dict.fromkeys({*dependent, *np.array(free)[wrong].tolist()}, why)
        return {}

    def has_settled(self, step: Step, free: Sequence[int]) -> bool:
        """Whether the last step moved nothing by more than it is sure of, and no other would."""
        return not len(step.change) or bool((np.abs(step.change) <= 0.5 * self._still(step, free)).all())

    def _still(self, step: Step, free: Sequence[int]) -> FloatArray:
        """Return the steps (p,) within which parameters count as settled."""
        return np.asarray(np.maximum(SETTLED * step.sd, 0.5 * MATTERS[list(free)]))

    def result(self, free: Sequence[int], sd: dict[int, float], held: dict[int, Known]) -> MountingEstimate:
        """Return what was found when these were free."""
        changed = [n for n in free if abs(self._at[n] - self._first[n]) >= max(SURE * sd[n], MATTERS[n])]
        best, spread = self._first, self._before
        proposed: set[int] = set()
        # Roll is told by itself, the others together: nothing speaks for a mounting with half of what they say.
        for group in ([ROLL], [number for number in free if number != ROLL]):
            if set(group) & set(changed):
                other = best.copy()
                other[group] = self._at[group]
                after = self._spread_of(other)
                if _is_better(spread, after):
                    best, spread = other, after
                    proposed |= set(group)
        parameters = {
            PARAMETERS[n]: ParameterEstimate(Known.DETERMINED, float(self._at[n]), float(sd[n]), n in proposed)
            for n in free
        }
        parameters |= {PARAMETERS[n]: ParameterEstimate(why) for n, why in held.items()}
        if not proposed:
            spread = self._spread_of(self._at)
        return MountingEstimate(
            parameters={name: parameters[name] for name in PARAMETERS},
            proposal=self._mounting(best) if proposed else None,
            agreement=_agreement(self._before, spread),
            cells=spread.cells.cells,
            lines=tuple(np.unique(spread.cells.line).tolist()),
            beams=self._beams.pings.beams,
        )

    def _spread_of(self, at: FloatArray) -> "_Spread":
        return _Spread.of(self._cells_of(at, 1), self._errors)

    def _mounting(self, at: FloatArray) -> Mounting:
        return replace(self._start, **dict(zip(PARAMETERS, at.tolist(), strict=True)))

    def _cells_of(self, at: FloatArray, size: int) -> SharedCells:
        if not self._is_wanted():
            raise NotWantedError
        where, ping = self._beams.placed(self._mounting(at))
        change = np.empty((len(where), BEND + 1, 3))
        for number, by in enumerate(STEPS.tolist()):
            other = at.copy()
            other[number] += by
            change[:, number] = (self._beams.placed(self._mounting(other))[0] - where) / by
        change[:, BEND] = (self._bent.placed(self._mounting(at))[0] - where) / BENT_BY
        sizes = (size * self._block_m / ROUNDS[0][0], self._block_m)
        times = self._beams.pings.time_s[ping]
        return shared_cells(where, change, self._beams.line[ping], times, sizes, self._height_m)


def _excess(step: Step, free: Sequence[int]) -> FloatArray:
    """Return each deviation beside that up to which a parameter counts as known."""
    return np.asarray(step.sd / KNOWN[list(free)])


def _knowable(equations: Equations) -> list[int]:
    """Return which parameters can be told together; the one that is least known is left out first."""
    free = list(range(len(PARAMETERS)))
    while free:
        step = equations.solve(free)
        if _excess(step, free).max() <= 1.0:
            break
        free.remove(_least_known(equations, step, free))
    return free


def _least_known(equations: Equations, step: Step, free: Sequence[int]) -> int:
    """Return which parameter is given up: latency, where everything else is known without it, else the worst."""
    others = [number for number in free if number != LATENCY]
    if LATENCY in free and others and _excess(equations.solve(others), others).max() <= 1.0:
        return LATENCY
    return free[int(np.argmax(_excess(step, free)))]


def _is_better(before: "_Spread", after: "_Spread") -> bool:
    """Whether lines agree better by a mounting, as they are, or at least in shape and no worse as they are."""
    if _significance(before.block, before.whole_m2, after.block, after.whole_m2) >= SURE:
        return True
    in_shape = _significance(before.block, before.shape, after.block, after.shape)
    return in_shape >= SURE and after.rms_m <= before.rms_m


def _significance(block: IntArray, before_m2: FloatArray, other: IntArray, after_m2: FloatArray) -> float:
    """Return by how many deviations mean squares of blocks became smaller."""
    _, of, those = np.intersect1d(block, other, return_indices=True)
    gain = before_m2[of] - after_m2[those]
    if len(gain) < LEAST_BLOCKS:
        return 0.0
    return float(gain.mean() * np.sqrt(len(gain)) / max(float(gain.std(ddof=1)), 1e-12))


def _agreement(before: "_Spread", after: "_Spread") -> LineAgreement:
    significance = _significance(before.block, before.whole_m2, after.block, after.whole_m2)
    return LineAgreement(before.rms_m, after.rms_m, significance)


@dataclass(frozen=True)
class _Spread:
    """How far lines' depths differ in their cells: in all, and the mean square of each block (b,) of ground.

    ``whole_m2`` as lines are, ``shape`` in variances when each is shifted to where it fits, outliers counting less.
    """

    cells: SharedCells
    rms_m: float
    block: IntArray
    whole_m2: FloatArray
    shape: FloatArray

    @classmethod
    def of(cls, cells: SharedCells, errors: LineErrors) -> "_Spread":
        equations = Equations(cells, errors)
        block, of = np.unique(cells.block, return_inverse=True)
        whole = equations.differences_m() ** 2
        means = [np.bincount(of, each) / np.bincount(of) for each in (whole, equations.misfit())]
        return cls(cells, float(np.sqrt(whole.mean())), block, means[0], means[1])
