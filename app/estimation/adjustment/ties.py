"""Ties: how far a section of track is shifted against the bottom that other soundings tell."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from app.arrays import FloatArray, IntArray
from app.estimation.adjustment import misfit, surface
from app.estimation.adjustment.drift import DriftNodes
from app.estimation.adjustment.tracks import TrackSoundings

LEAST_SOUNDINGS = 8
LEAST_OVERLAP = 0.25
"""Share of a section that others have to tell of."""

LEAST_GAIN = 0.05
"""A direction counts as told by the terrain when a tie adds so much to what is known of it already, as information."""

WORST_FIT = 5.0
"""A tie is none where the mean square of its residuals, over their variances, is larger than this."""

GRID = 15
MOST_COMPARED = 120
"""Of a section that has more soundings so many are compared, evenly chosen."""

DEVIATIONS = 3.5
LEAST_WINDOW_CELLS = 1.5
MOST_ZOOMS = 3
SHARED = 0.05
"""Information of a tie as a share of what its misfit says: neighbouring sections share errors, and every overlap is
seen from both sides."""

LEAST_SD_CELLS = 0.1
"""No tie is better than this share of the raster's cell."""


class Outcome(StrEnum):
    """What became of a tie."""

    USED = "used"
    NO_OVERLAP = "no-overlap"
    FLAT = "flat"
    MISFIT = "misfit"
    OUTLIER = "outlier"
    NOT_SIGNIFICANT = "not-significant"


@dataclass(frozen=True)
class Sections:
    """Pieces of tracks that are shifted as one, k of them.

    Attributes
    ----------
    of : (n,)
        The section of each sounding.
    first : (k + 1,)
        Where the soundings of each section begin, and the end.
    vehicle, dive : (k,)
    middle_s : (k,)
    """

    of: IntArray
    first: IntArray
    vehicle: IntArray
    dive: IntArray
    middle_s: FloatArray

    def __len__(self) -> int:
        return len(self.middle_s)

    @classmethod
    def of_tracks(cls, soundings: TrackSoundings, dive: IntArray, length_s: float) -> "Sections":
        """Cut soundings, in the order of vehicle and time, into pieces of about so many seconds."""
        begin = np.zeros(len(soundings))
        changes = np.flatnonzero(np.diff(dive, prepend=-1))
        for low, high in zip(changes, np.append(changes[1:], len(dive)), strict=True):
            span = soundings.time_s[high - 1] - soundings.time_s[low]
            piece = span / max(1, round(span / length_s)) + 1e-6
            begin[low:high] = np.floor((soundings.time_s[low:high] - soundings.time_s[low]) / piece)
        new = (np.diff(dive, prepend=-1) != 0) | (np.diff(begin, prepend=-1.0) != 0.0)
        first = np.flatnonzero(new)
        of = np.cumsum(new) - 1
        count = np.diff(np.append(first, len(soundings)))
        origin = soundings.time_s[first]
        middle = origin + np.bincount(of, soundings.time_s - origin[of], len(first)) / np.maximum(count, 1)
        return cls(of, np.append(first, len(soundings)), soundings.vehicle[first], dive[first], middle)


@dataclass(frozen=True)
class Relief:
    """How rough the bottom is: half the squared difference of depths is ``factor`` times distance to ``exponent``."""

    factor: FloatArray
    """Of each section, (k,)."""
    exponent: float

    @classmethod
    def of_sections(cls, soundings: TrackSoundings, sections: Sections) -> "Relief":
        """Learn it from soundings of the same sections, whose places to each other are known."""
        columns = surface.SoundingColumns(soundings.east_m, soundings.north_m, soundings.depth_m, soundings.sd_m)
        factor, exponent = surface.variogram(sections.of, columns)
        factors = np.full(len(sections), factor)
        middle = np.concatenate([[0.25], 0.5 * (surface.LAGS_M[1:] + surface.LAGS_M[:-1])])
        for k in range(len(sections)):
            rows = slice(sections.first[k], sections.first[k + 1])
            own_columns = surface.SoundingColumns(*(column[rows] for column in columns))
            total, count = surface.half_squares(sections.of[rows], own_columns, surface.LAGS_M)
            near = slice(1, 6)
            if count[near].sum() >= 20:
                usual = float((count[near] * factor * middle[near] ** exponent).sum())
                # A short section says little of its own: the whole survey counts as much as twenty pairs.
                own = max(float(total[near].sum()), 0.0)
                share = count[near].sum() / (count[near].sum() + 20.0)
                factors[k] = factor * (1.0 - share) + share * factor * own / usual
        return cls(np.maximum(factors, 1e-7), exponent)


@dataclass(frozen=True)
class KnownShift:
    """What is known of a section's shift before it is looked at: mean (2,) and covariance (2, 2), metres."""

    mean_m: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class Tie:
    """What a section's soundings say of its shift against the others.

    Attributes
    ----------
    shift_m : (2,)
        East and north, of its error less theirs, beyond what both were adjusted by already.
    information : (2, 2)
        Zero in directions in which the terrain says nothing.
    nodes, weights : (j,)
        Errors of which nodes are compared, and by which factor; they sum to nothing.
    outcome
    residual_m
        RMS of the section's depths less the others', unshifted, each beyond three usual ones counting as three; NaN
        where nothing overlaps.
    """

    shift_m: FloatArray
    information: FloatArray
    nodes: IntArray
    weights: FloatArray
    outcome: Outcome
    residual_m: float


@dataclass(frozen=True)
class Around:
    """The bottom around a section as others tell it, on a raster."""

    who: IntArray
    """Rows of the soundings that were used."""
    raster: surface.RasterFrame
    bottom: surface.Surface
    shares: surface.CellWeights
    """Of those rows."""


@dataclass(frozen=True)
class Matcher:
    """Compares sections with the rest of a survey.

    Attributes
    ----------
    soundings
        Thinned, in the order of vehicle and time, at the vehicles' own positions.
    sections, nodes, relief
    cell_m
        Side of the raster's cells.
    reach_m
        Soundings farther away tell nothing of a place.
    apart_s
        What a vehicle sounded less than this before or after a section says nothing of it.
    offset_sd_m
        Of a depth that all of a section may be off by: tide, draught.
    """

    soundings: TrackSoundings
    sections: Sections
    nodes: DriftNodes
    relief: Relief
    cell_m: float
    reach_m: float
    apart_s: float
    offset_sd_m: float

    def around(self, section: int, east_m: FloatArray, north_m: FloatArray, aside_m: float) -> Around | None:
        """Return the bottom around a section, so far to all sides, by soundings at some places (n,); None: nobody's."""
        found, sections = self.soundings, self.sections
        rows = slice(sections.first[section], sections.first[section + 1])
        east, north = east_m[rows], north_m[rows]
        margin = aside_m + 2.0 * self.cell_m
        west, south = east.min() - margin, north.min() - margin
        cols = int(np.ceil((east.max() + margin - west) / self.cell_m))
        high = int(np.ceil((north.max() + margin - south) / self.cell_m))
        more = self.reach_m
        near = (east_m > west - more) & (east_m < east.max() + margin + more)
        near &= (north_m > south - more) & (north_m < north.max() + margin + more)
        who = np.flatnonzero(near)
        low_s, high_s = found.time_s[rows.start] - self.apart_s, found.time_s[rows.stop - 1] + self.apart_s
        own = (found.vehicle[who] == sections.vehicle[section]) & (found.time_s[who] > low_s)
        who = who[~(own & (found.time_s[who] < high_s))]
        if not len(who):
            return None
        raster = surface.RasterFrame(west, south, self.cell_m)
        wanted = surface.near_track(east, north, raster, high, cols, aside_m)
        others = surface.SoundingColumns(east_m[who], north_m[who], found.depth_m[who], found.sd_m[who])
        relief = surface.PowerLaw(float(self.relief.factor[section]), self.relief.exponent)
        return Around(who, raster, *surface.surface(others, raster, wanted, relief, self.reach_m))

    def residual_m(self, section: int, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
        """Return a section's depths less the others' where those are near, (j,)."""
        around = self.around(section, east_m, north_m, self.cell_m)
        if around is None:
            return np.zeros(0)
        own = self._section(section, around.raster, east_m, north_m)
        off = misfit.residuals(own, around.bottom, self._near_m)
        return np.asarray(off[np.isfinite(off)])

    @property
    def _near_m(self) -> float:
        return max(0.5 * self.reach_m, self.cell_m)

    def _section(
        self, section: int, raster: surface.RasterFrame, east_m: FloatArray, north_m: FloatArray
    ) -> misfit.SectionSoundings:
        rows = slice(self.sections.first[section], self.sections.first[section + 1])
        x = (east_m[rows] - raster.west) / raster.cell - 0.5
        y = (north_m[rows] - raster.south) / raster.cell - 0.5
        return misfit.SectionSoundings(x, y, self.soundings.depth_m[rows], self.soundings.sd_m[rows] ** 2)

    def tie(self, section: int, east_m: FloatArray, north_m: FloatArray, known: KnownShift, most_m: float) -> Tie:
        """Return how far a section is shifted against the others.

        Parameters
        ----------
        east_m, north_m : (n,)
            Places of all soundings, adjusted as far as that was done.
        known
            Of the section's shift against the others without this tie.
        most_m
            No shift is looked for farther away.
        """
        nothing = np.zeros(0, np.int64), np.zeros(0)
        rows = slice(self.sections.first[section], self.sections.first[section + 1])
        unknown = Tie(np.zeros(2), np.zeros((2, 2)), *nothing, Outcome.NO_OVERLAP, np.nan)
        if rows.stop - rows.start < LEAST_SOUNDINGS:
            return unknown
        sd = np.sqrt(np.diag(known.covariance))
        window = np.minimum(np.maximum(DEVIATIONS * sd, LEAST_WINDOW_CELLS * self.cell_m), most_m)
        aside = float((np.abs(known.mean_m) + window).max()) + self.cell_m
        around = self.around(section, east_m, north_m, aside)
        if around is None:
            return unknown
        own = self._section(section, around.raster, east_m, north_m)
        off = misfit.residuals(own, around.bottom, self._near_m)
        residual = rms(off[np.isfinite(off)])
        background = max(float(own.depth.var()), self.relief.factor[section] * self.reach_m**self.relief.exponent, 1e-4)
        precision = np.linalg.inv(known.covariance)
        mean, covariance, fit, overlap = known.mean_m, known.covariance, 0.0, 0.0
        centre = known.mean_m
        every = slice(None, None, max(1, len(own.x) // MOST_COMPARED))
        compared = misfit.SectionSoundings(*(np.ascontiguousarray(column[every]) for column in own))
        usual = misfit.Usual(float(own.depth.mean()), background)
        grain_m = self.cell_m * float(np.sqrt(every.step))
        for _ in range(MOST_ZOOMS):
            at = np.linspace(-1.0, 1.0, GRID)
            shift = np.stack(np.meshgrid(centre[0] + at * window[0], centre[1] + at * window[1]), axis=-1).reshape(
                -1, 2
            )
            cost, seen, square = misfit.misfit(
                compared,
                around.bottom,
                shift[:, 0] / self.cell_m,
                shift[:, 1] / self.cell_m,
                usual,
                self.offset_sd_m**2,
                grain_m,
            )
            best = int(np.argmin(cost))
            fit, overlap = float(square[best]), float(seen[best])
            away = shift - known.mean_m
            log = -0.5 * cost / max(1.0, fit) - 0.5 * np.einsum("ki,ij,kj->k", away, precision, away)
            chance = np.exp(log - log.max())
            chance /= chance.sum()
            mean = chance @ shift
            covariance = (shift - mean).T @ ((shift - mean) * chance[:, None])
            spacing = 2.0 * window / (GRID - 1)
            width = np.sqrt(np.diag(covariance))
            if (width > 1.2 * spacing).all():
                break
            centre, window = mean, np.minimum(np.maximum(4.0 * width, 2.0 * spacing), window)
        if overlap < LEAST_OVERLAP:
            return Tie(np.zeros(2), np.zeros((2, 2)), *nothing, Outcome.NO_OVERLAP, residual)
        if fit > WORST_FIT:
            return Tie(np.zeros(2), np.zeros((2, 2)), *nothing, Outcome.MISFIT, residual)
        covariance = covariance + (LEAST_SD_CELLS * self.cell_m) ** 2 * np.eye(2)
        shift_m, information = _told(mean, covariance, known)
        if not information.any():
            return Tie(np.zeros(2), np.zeros((2, 2)), *nothing, Outcome.FLAT, residual)
        moved = own._replace(x=own.x - mean[0] / self.cell_m, y=own.y - mean[1] / self.cell_m)
        nodes, weights = self._compared(section, around, moved)
        if not len(nodes):
            return unknown
        return Tie(shift_m, SHARED * information, nodes, weights, Outcome.USED, residual)

    def _compared(self, section: int, around: Around, moved: misfit.SectionSoundings) -> tuple[IntArray, FloatArray]:
        rows = np.arange(self.sections.first[section], self.sections.first[section + 1])
        own, others = np.zeros(len(rows)), np.zeros(len(around.who))
        misfit.influence(moved, around.bottom, around.shares, own, others)
        if own.sum() <= 0.0 or others.sum() <= 0.0:
            return np.zeros(0, np.int64), np.zeros(0)
        total = np.zeros(len(self.nodes))
        for which, weight in ((rows, own / own.sum()), (around.who, -others / others.sum())):
            used = weight != 0.0
            at, share = self.nodes.weights(self.soundings.vehicle[which[used]], self.soundings.time_s[which[used]])
            np.add.at(total, at.ravel(), (weight[used, None] * share).ravel())
        nodes = np.flatnonzero(np.abs(total) > 1e-6)
        return nodes, total[nodes]


def rms(off: FloatArray) -> float:
    """Return the root of the mean square of differences, those beyond three robust deviations as three; NaN of none."""
    if not len(off):
        return float("nan")
    usual = 1.4826 * float(np.median(np.abs(off)))
    return float(np.sqrt(np.mean(np.minimum(np.abs(off), 3.0 * usual + 1e-9) ** 2)))


def _told(mean: FloatArray, covariance: FloatArray, known: KnownShift) -> tuple[FloatArray, FloatArray]:
    """Return what was added to what was known, as a shift (2,) and its information (2, 2)."""
    # In coordinates in which what was known is a unit circle.
    root = np.linalg.cholesky(known.covariance)
    inverse = np.linalg.inv(root)
    precision = np.linalg.inv(inverse @ covariance @ inverse.T)
    gain, axes = np.linalg.eigh(precision - np.eye(2))
    told = gain > LEAST_GAIN
    if not told.any():
        return np.zeros(2), np.zeros((2, 2))
    pull = precision @ (inverse @ (mean - known.mean_m))
    basis = axes[:, told]
    shift = basis @ ((basis.T @ pull) / gain[told])
    information = inverse.T @ (basis * gain[told]) @ basis.T @ inverse
    return known.mean_m + root @ shift, 0.5 * (information + information.T)
