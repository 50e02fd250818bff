"""A swath survey by a team: who sweeps what, on which line, and where each goes next.

Neighbours sweep towards each other, so that their border lies where they meet; who is done takes over a part of what
another has left. What lines missed is filled in the end.
"""

import base64
import zlib
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from scipy.ndimage import label

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.coverage import Coverage
from app.exploration.core.routes import FreeSpace
from app.exploration.swath.lines import ALMOST, STEEPEST, Line, bend_radius_m, gentle, lines, needed_lines, strips
from app.exploration.swath.lines_ahead import approaches_m, best_direction, nearest_entry, path_m
from app.exploration.swath.lines_ahead import pose as pose_of
from app.exploration.swath.near_zones import led_round
from app.exploration.swath.passes import BUSY, MOST_TOURED, Pass, Passable, pieces, shared, tour
from app.exploration.swath.raster import Flying, LineRaster, raster_of, steepness

MOST_TRIES = 4
"""What so many lines were to see and did not is given up."""

MOST_REFUSED = 3
"""Who was so often in a row not sent along its line gets another one."""

LOOK_AGAIN_AT = (0.02, 0.08, 0.2, 0.4)
"""Shares of the area after which the direction of lines is looked at again, with the depths that are known by then."""

TURNING_GAIN = 0.2
"""Lines are turned into another direction where that shortens what is left by more than this share."""

WORTH_HELPING = 1.2
"""What another has left is shared where it is more than so many lines of it."""

FILLING_OVERLAP, STUBBORN_OVERLAP = 0.4, 0.95
"""Shares of half a swath that holes lie within: where a line to fill them sees them well, and where it is over them."""

EARLY = 0.4
"""Missed ground is passed on the way to a line where the detour is less than so much of the way back from the last."""

DETOUR = 1.5
"""A line is left to another vehicle where the way there is longer than so many times the other's detour, and ``BUSY``
of what the other has still to fly of its own line."""

SHOALING, SHOALING_OF_STEEP = (0.01, 0.1), 1.0
"""Metres by which unknown ground is presumed to rise a metre away from known ground, least and most: so many times what
the steepest known ground does. Lines rather begin too close."""

BEYOND_M = 1e9
"""Farther across than any area."""

NEAR_M = 0.5
"""Who is so near the beginning of a line is there."""

FEW_LINES = 4.0
"""Shares are whole lines where there are fewer lines than so many for each vehicle."""

FLOWN, LAST_PART = 0.5, 0.2
"""A piece of a line counts as flown where this share of the cells under the last part of it is ensonified, and of those
beside its end that were open: what is behind the last ping is still to come."""


@dataclass
class Strip:
    """What a vehicle sweeps: between two places across the lines, towards ``sign`` (1 or -1)."""

    low_m: float
    high_m: float
    sign: int


@dataclass
class FlownLine:
    """A line as it is flown: what is left of it, (k, 2) east and north, and how it was found."""

    direction_rad: float
    sign: int
    path: FloatArray
    overlap: float
    begun: bool = False


@dataclass(frozen=True)
class Piece:
    """A piece of a line that a vehicle was sent along.

    Attributes
    ----------
    path : (k, 2)
        East and north.
    open_m : (n, 2)
        Places across its end that nobody had seen when it was sent.
    """

    path: FloatArray
    open_m: FloatArray


@dataclass
class Assignment:
    """What one vehicle is at, and the pieces of lines that it was sent along and may not have flown yet."""

    share: Strip | None = None
    course: FlownLine | None = None
    expected: list[Piece] = field(default_factory=list)
    refused: int = 0
    """How often in a row it was not sent where it was to go."""
    laid_on: Coverage | None = None
    """What its line was laid by last."""
    skipped: FloatArray | None = None
    """A line (k, 2) that its operator wants left out, until that is noted."""
    idle: bool = False
    """Whether there was nothing for it when it was last asked for."""


@dataclass(frozen=True)
class Directed:
    """What the direction of lines follows from; the same arrays hold the same."""

    wanted: BoolArray
    depth_m: FloatArray

    def is_as(self, coverage: Coverage) -> bool:
        """Return whether nothing of it is different."""
        return coverage.wanted is self.wanted and coverage.depth_m is self.depth_m


class SwathSurvey:
    """The lines of a team, decided one leg at a time.

    Parameters
    ----------
    preferred_rad
        Direction of lines, anticlockwise from east, as long as no other is better.
    raster_m
        Cell of the raster that lines are found on, where the coverage's is not coarser.
    guess_m
        Depth that is taken as long as none is known.
    crosslines
        Length of the lines across all others that are flown in the end, as a share of those.
    space
        Where vehicles may go; None: wherever lines lie.
    """

    def __init__(
        self,
        preferred_rad: float,
        raster_m: float,
        guess_m: float,
        crosslines: float = 0.0,
        space: FreeSpace | None = None,
    ) -> None:
        self._crosslines = crosslines
        self._space = None if space is None or space.is_open else space
        self._across: list[FloatArray] | None = None
        """Crosslines that nobody has begun; None: they are not laid yet."""
        self._direction_rad = preferred_rad
        self._raster_m, self._guess_m = raster_m, guess_m
        self._sweeps: dict[str, Assignment] = {}
        self._looks = 0
        self._directed: Directed | None = None
        """What the direction was last chosen by."""
        self._steepest: tuple[FloatArray, float] | None = None
        """How much the bottom is presumed to rise, and the depths that this follows from."""
        self._tried = np.zeros((0, 0), dtype=np.int64)

    def next_leg(
        self,
        vehicle: str,
        pose: FloatArray,
        flying: Flying,
        coverage: Coverage,
        team: dict[str, FloatArray],
        leg_m: float,
        reach_m: float = np.inf,
    ) -> FloatArray | None:
        """Return where a vehicle goes from a pose (3,), (2,) east and north; None when nothing is left for it.

        Parameters
        ----------
        team
            The poses of all vehicles that survey, by name.
        leg_m
            Longest leg along a line: what is measured under way bends the rest of it.
        reach_m
            Lines farther away than this take more than one leg to get to.
        """
        if self._tried.shape != coverage.wanted.shape:
            self._tried = np.zeros(coverage.wanted.shape, dtype=np.int64)
        left = Coverage(
            coverage.west_m,
            coverage.south_m,
            coverage.cell_m,
            coverage.wanted,
            coverage.done | (self._tried >= MOST_TRIES),
            coverage.depth_m,
        )
        self._sweeps = {name: sweep for name, sweep in self._sweeps.items() if name in team}
        for name in team:
            self._sweeps.setdefault(name, Assignment())
        sweep = self._sweeps[vehicle]
        if sweep.skipped is not None:
            self._count(sweep.skipped, flying, left, tries=MOST_TRIES)
            left = replace(left, done=coverage.done | (self._tried >= MOST_TRIES))
            sweep.skipped = None
        self._take_back(sweep, pose)
        self._forget_flown(coverage)
        if sweep.laid_on is not coverage:
            sweep.laid_on = coverage
            self._lay_anew(sweep, vehicle, pose, flying, left)
        if sweep.course is not None and not len(sweep.course.path):
            sweep.course = None
        if sweep.course is None and not self._take_line(vehicle, pose, flying, left, team):
            self._take_crossline(sweep, pose, flying, left)
        sweep.idle = sweep.course is None
        if sweep.course is None:
            return None
        return self._along(sweep, pose, flying, left, leg_m, reach_m)

    def put_back(self, vehicle: str, ends_m: FloatArray, *, keeps_line: bool) -> None:
        """Expect nothing of pieces of lines that end at places (n, 2) and are not flown.

        ``keeps_line``: they are put back before what is left of the line; else lines are found anew.
        """
        sweep = self._sweeps.get(vehicle)
        if sweep is None:
            return
        for end in ends_m[::-1]:
            if not sweep.expected or np.hypot(*(sweep.expected[-1].path[-1] - end)) > NEAR_M:
                continue
            piece = sweep.expected.pop().path
            if sweep.course is not None and sweep.course.begun:
                sweep.course.path = np.vstack([piece, sweep.course.path[1:]])
        sweep.refused = 0
        if not keeps_line:
            if sweep.course is not None and sweep.course.sign == 0 and self._across is not None:
                self._across.append(sweep.course.path)
            sweep.course = None

    def skip_line(self, vehicle: str, here_m: FloatArray) -> bool:
        """Leave out what is left of a vehicle's line, from where it is (2,); returns False where it has none."""
        sweep = self._sweeps.get(vehicle)
        if sweep is None or sweep.course is None or not len(sweep.course.path):
            return False
        rest = sweep.course.path
        # What lies behind on a piece that was put back was flown.
        first = int(np.argmin(np.hypot(*(rest - here_m).T)))
        rest = rest[first:] if len(rest) - first > 1 else np.vstack([here_m, rest[-1]])
        if sweep.course.sign != 0:
            sweep.skipped = rest
        sweep.course = None
        return True

    def piece_m(self, vehicle: str) -> FloatArray:
        """Return the piece of a line that a vehicle was sent along last, (k, 2) east and north; empty: it was not."""
        sweep = self._sweeps.get(vehicle)
        return sweep.expected[-1].path if sweep is not None and sweep.expected else np.zeros((0, 2))

    def lines_m(self) -> dict[str, FloatArray]:
        """Return what is left of each vehicle's line, (k, 2) east and north."""
        return {name: sweep.course.path for name, sweep in self._sweeps.items() if sweep.course is not None}

    def _take_back(self, sweep: Assignment, pose: FloatArray) -> None:
        """Put a piece of a line back that a vehicle was not sent along: it does not go on from its end."""
        if not sweep.expected:
            return
        piece = sweep.expected[-1].path
        if np.hypot(*(pose[:2] - piece[-1])) <= max(NEAR_M, float(np.hypot(*(pose[:2] - piece[0])))):
            sweep.refused = 0
            return
        del sweep.expected[-1]
        course = sweep.course
        sweep.refused += 1
        if course is None or not course.begun:
            return
        course.path = np.vstack([piece, course.path[1:]])
        if sweep.refused >= MOST_REFUSED:
            sweep.course, sweep.refused = None, 0

    def _lay_anew(self, sweep: Assignment, vehicle: str, pose: FloatArray, flying: Flying, coverage: Coverage) -> None:
        """Lay a vehicle's line by what was measured since."""
        if sweep.course is None:
            return
        if sweep.course.begun:
            self._adapt(sweep.course, vehicle, pose, flying, coverage)
            return
        if sweep.course.sign == 0 and self._across is not None:
            self._across.append(sweep.course.path)
        sweep.course = None  # another one may be better by now

    def _along(
        self, sweep: Assignment, pose: FloatArray, flying: Flying, coverage: Coverage, leg_m: float, reach_m: float
    ) -> FloatArray:
        """Return the end of the next leg along a vehicle's line, and take it off the line."""
        course = sweep.course
        if course is None:
            raise ValueError("there is no line to fly along")
        if not course.begun:
            corner = course.path[0] if self._space is None else self._space.way(pose[:2], course.path[0])[0]
            away = corner - pose[:2]
            away_m = float(np.hypot(*away))
            if away_m > reach_m:
                return np.asarray(pose[:2] + reach_m / away_m * away)
            if float(np.hypot(*(course.path[0] - corner))) > NEAR_M:
                return np.asarray(corner)
            course.begun = True
            self._count(course.path, flying, coverage)
            if away_m > NEAR_M:
                return np.asarray(course.path[0])
        vertices = course.path if np.allclose(course.path[0], pose[:2]) else np.vstack([pose[:2], course.path])
        ahead_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(vertices, axis=0).T))])
        goes_m = min(leg_m, float(ahead_m[-1]))
        if ahead_m[-1] - goes_m < 0.3 * goes_m:
            goes_m = float(ahead_m[-1]) if ahead_m[-1] <= leg_m else 0.5 * float(ahead_m[-1])
        end = np.array([np.interp(goes_m, ahead_m, vertices[:, k]) for k in (0, 1)])
        inner = (ahead_m > 0.0) & (ahead_m < goes_m - 1e-6)
        piece = np.vstack([pose[:2], vertices[inner], end])
        sweep.expected.append(Piece(piece, _open_beside_end(piece, flying, coverage)))
        rest = vertices[ahead_m > goes_m + 1e-6]
        course.path = np.vstack([end, rest]) if len(rest) else np.zeros((0, 2))
        return end

    def _adapt(self, course: FlownLine, vehicle: str, pose: FloatArray, flying: Flying, coverage: Coverage) -> None:
        """Lay what is left of a line anew, by what was measured since."""
        if len(course.path) < 2 or not course.begun or course.sign == 0:
            return
        raster = self._raster(coverage, course.direction_rad)
        here = raster.axes.turned(pose[:2])
        turned = raster.axes.turned(course.path)
        forwards = turned[-1, 0] >= turned[0, 0]
        columns = raster.columns_of(np.array([here[0], turned[-1, 0]]))
        ahead = np.zeros(raster.open.shape[0], dtype=bool)
        ahead[min(columns) : max(columns) + 1] = True
        ahead[columns[0]] = False
        if not ahead.any():
            return
        if forwards != (turned[-1, 0] >= here[0]):
            course.path = np.zeros((0, 2))  # it is past the end
            return
        free = raster.open & ~self._expected(raster, flying, vehicle) & ahead[:, None]
        share = self._sweeps[vehicle].share
        if share is not None:
            free &= _between(raster, share)
        old = np.interp(raster.along_m, *(turned if forwards else turned[::-1]).T)
        near = np.abs(raster.across_m - old[:, None]) <= 2.5 * raster.half_width_m(flying)
        choice = lines(raster, free & near, course.sign, closer(flying, course.overlap), old)
        if not choice:
            course.path = np.zeros((0, 2))
            return
        wish = np.full(raster.open.shape[0], np.nan)
        for line in choice:
            wish[line.columns] = line.across_m
        needed = np.flatnonzero(np.isfinite(wish))
        last = needed[-1] if forwards else needed[0]
        whole = np.arange(columns[0], last + 1) if forwards else np.arange(last, columns[0] + 1)
        asked = course.sign * wish[whole]
        asked[np.isnan(asked)] = np.inf
        width = flying.half_width_m(
            raster.depth_m[whole, raster.rows_of(np.where(np.isfinite(asked), course.sign * asked, here[1]))]
        )
        level = gentle(asked, raster.cell_m, bend_radius_m(width, flying))
        level = np.where(np.isfinite(level), course.sign * level, here[1])
        bend = STEEPEST * np.abs(raster.along_m[whole] - here[0])
        across = np.clip(level, here[1] - bend, here[1] + bend)
        path = Line(whole, across).path(raster)
        path = path if forwards else path[::-1]
        passed = (raster.axes.turned(path)[:, 0] - here[0]) * (1 if forwards else -1) <= 0.5 * raster.cell_m
        course.path = self._led(_simple(path[~passed], 0.1 * raster.cell_m), flying, coverage)

    def _take_line(
        self, vehicle: str, pose: FloatArray, flying: Flying, coverage: Coverage, team: dict[str, FloatArray]
    ) -> bool:
        """Give a vehicle its next line; return whether there is one."""
        self._lay_out(flying, coverage, team)
        sweep = self._sweeps[vehicle]
        raster = self._raster(coverage, self._direction_rad)
        expected = self._expected(raster, flying, vehicle)
        left = replace(raster, open=raster.open & ~expected)
        large, small = strips(left, flying)
        missed = small & ~_touching(raster.open, expected)
        share = sweep.share
        own = share is not None and bool((large & _between(raster, share)).any())
        if not own:
            share = sweep.share = self._help(vehicle, left, large, flying)
        sign = 1 if share is None else share.sign
        mine = large & _between(raster, share) if share is not None else np.zeros_like(large)
        choice = lines(left, mine, sign, flying) if mine.any() else []
        while choice:
            line, path, away_m = nearest_entry(left, choice, pose, flying.radius_m)
            path = self._led(_simple(path, 0.1 * raster.cell_m), flying, coverage)
            if len(path) > 1 and (own or not self._closer(vehicle, pose, path, away_m, team)):
                early = self._on_the_way(vehicle, pose, flying, coverage, team, left, (mine, missed), (path, away_m))
                led = path if early is None else self._led(early.path, flying, coverage)
                if early is None or len(led) < 2:
                    sweep.course = FlownLine(self._direction_rad, sign, path, flying.overlap)
                else:
                    sweep.course = FlownLine(_towards(led), 1, led, early.overlap)
                return True
            choice = [other for other in choice if other is not line]
        if any(self._sweeps[name].course is not None for name in team if name != vehicle):
            small = missed  # What others may see yet is not missed.
        return bool(small.any()) and self._fill(vehicle, pose, flying, coverage, team, left, small)

    def _fill(
        self,
        vehicle: str,
        pose: FloatArray,
        flying: Flying,
        coverage: Coverage,
        team: dict[str, FloatArray],
        left: LineRaster,
        small: BoolArray,
    ) -> bool:
        """Send a vehicle over what lines have missed; return whether there is anything for it."""
        sweep = self._sweeps[vehicle]
        found, wide, overlap = self._missed(left, small, flying, coverage, pose)
        mine = shared(found, *self._free_at(vehicle, pose, team))[vehicle]
        if not mine and all(self._sweeps[name].idle for name in team if name != vehicle):
            mine = found  # Who is nearer was told that nothing is left, and may not be asked for again.
        for one in tour(mine, pose, flying.radius_m):
            path = self._led(one.path, flying, coverage)
            if len(path) > 1:
                sweep.course = FlownLine(_towards(path), 1, path, one.overlap)
                return True
        near_m = np.full(len(left.open), float(left.axes.turned(pose[:2])[1]))
        choice = lines(left, wide, 1, closer(flying, overlap), near_m)
        while choice:
            line, path, away_m = nearest_entry(left, choice, pose, flying.radius_m)
            path = self._led(_simple(path, 0.1 * left.cell_m), flying, coverage)
            if len(path) > 1 and not self._closer(vehicle, pose, path, away_m, team):
                sweep.course = FlownLine(self._direction_rad, 1, path, overlap)
                return True
            choice = [other for other in choice if other is not line]
        return False

    def _missed(
        self, left: LineRaster, small: BoolArray, flying: Flying, coverage: Coverage, pose: FloatArray
    ) -> tuple[list[Passable], BoolArray, float]:
        """Return the pieces of missed ground that a pass sees, cells of the others, and the overlap of lines to these.

        What two lines looked at in vain is led over: something stands in between.
        """
        stubborn = small & _touching(small, self._tried_twice(coverage))
        found, wide = pieces(left, small & ~stubborn, closer(flying, FILLING_OVERLAP), pose[:2])
        over, not_over = pieces(left, stubborn, closer(flying, STUBBORN_OVERLAP), pose[:2])
        return found + over, wide | not_over, STUBBORN_OVERLAP if not_over.any() else FILLING_OVERLAP

    def _on_the_way(
        self,
        vehicle: str,
        pose: FloatArray,
        flying: Flying,
        coverage: Coverage,
        team: dict[str, FloatArray],
        left: LineRaster,
        swept_missed: tuple[BoolArray, BoolArray],
        line: tuple[FloatArray, float],
    ) -> Pass | None:
        """Return a pass over missed ground that is a small detour on the way to a line; None where none is.

        Parameters
        ----------
        swept_missed
            What the vehicle has still to sweep, and what lines have missed, (along, across) both.
        line
            Its path (k, 2) and the way to it.
        """
        swept, missed = swept_missed
        path, away_m = line
        if not missed.any():
            return None
        found, _, _ = self._missed(left, missed, flying, coverage, pose)
        rows = np.flatnonzero(swept.any(axis=0))
        ends_m = left.across_m[rows[[0, -1]]]
        best: tuple[float, Pass] | None = None
        for piece in shared(found, *self._free_at(vehicle, pose, team))[vehicle][:MOST_TOURED]:
            (one,) = tour([piece], pose, flying.radius_m)
            onward_m = approaches_m(pose_of(one.path, end=True), pose_of(path)[None], flying.radius_m)
            detour_m = one.way_m + float(onward_m[0]) - away_m
            later_m = float(np.abs(ends_m - left.axes.turned(piece.middle_m)[1]).max())
            if detour_m < EARLY * later_m and (best is None or detour_m < best[0]):
                best = detour_m, one
        return None if best is None else best[1]

    def _free_at(
        self, vehicle: str, pose: FloatArray, team: dict[str, FloatArray]
    ) -> tuple[dict[str, FloatArray], dict[str, float]]:
        """Return where all vehicles are next free for another line, (2,), and how far it is there for them."""
        places, busy_m = {vehicle: pose[:2]}, {vehicle: 0.0}
        for name, at in team.items():
            course = self._sweeps[name].course
            if name == vehicle:
                continue
            flies = course is not None and len(course.path) > 1
            places[name] = course.path[-1] if course is not None and flies else at[:2]
            busy_m[name] = path_m(np.vstack([at[:2], course.path])) if course is not None and flies else 0.0
        return places, busy_m

    def _led(self, path: FloatArray, flying: Flying, coverage: Coverage) -> FloatArray:
        """Return a line (k, 2) as vehicles may fly it; empty where they may not, and what it was to see is given up."""
        if self._space is None or not len(path):
            return path
        led = led_round(path, self._space)
        if len(led) > 1:
            return led
        if len(path) > 1:
            self._count(path, flying, coverage, tries=MOST_TRIES)
        return np.zeros((0, 2))

    def _closer(
        self, vehicle: str, here: FloatArray, path: FloatArray, away_m: float, team: dict[str, FloatArray]
    ) -> bool:
        """Return whether another vehicle had better fly a line: one that waits nearer to it, or a busy one later."""
        for name, pose in team.items():
            course = self._sweeps[name].course
            if name == vehicle:
                continue
            if course is None:
                waits_m = min(float(np.hypot(*(end - pose[:2]))) for end in (path[0], path[-1]))
                if float(np.hypot(*(path[0] - here[:2]))) > DETOUR * waits_m + NEAR_M:
                    return True
                continue
            if len(course.path) < 2:
                continue
            detour_m = min(float(np.hypot(*(end - course.path[-1]))) for end in (path[0], path[-1]))
            if away_m > DETOUR * detour_m + BUSY * path_m(np.vstack([pose[:2], course.path])):
                return True
        return False

    def _tried_twice(self, coverage: Coverage) -> BoolArray:
        """Return which cells of the raster hold ground that two lines were to see and did not."""
        done = coverage.done | (self._tried < 2)
        again = Coverage(coverage.west_m, coverage.south_m, coverage.cell_m, coverage.wanted, done, coverage.depth_m)
        return self._raster(again, self._direction_rad).open

    def _take_crossline(self, sweep: Assignment, pose: FloatArray, flying: Flying, coverage: Coverage) -> None:
        """Give a vehicle the next line across all others, if one is left."""
        if self._across is None:
            self._across = self._lay_crosslines(flying, coverage)
        if not self._across:
            return
        both = [(k, path) for k, line in enumerate(self._across) for path in (line, line[::-1])]
        k, path = min(both, key=lambda one: float(np.hypot(*(one[1][0] - pose[:2]))))
        del self._across[k]
        path = path if self._space is None else led_round(path, self._space)
        if len(path) > 1:
            sweep.course = FlownLine(self._direction_rad, 0, path, flying.overlap)

    def _lay_crosslines(self, flying: Flying, coverage: Coverage) -> list[FloatArray]:
        raster = self._raster(coverage, self._direction_rad)
        length_m = self._crosslines * float(_work(raster, raster.wanted, flying).sum())
        columns = np.flatnonzero(raster.wanted.any(axis=1))
        wide_m = float(raster.wanted.sum(axis=1)[columns].mean()) * raster.cell_m
        count = min(max(1, round(length_m / wide_m)), len(columns)) if length_m > 0.0 else 0
        found = []
        for part in np.array_split(columns, count) if count else []:
            column = int(part[len(part) // 2])
            rows = np.flatnonzero(raster.wanted[column])
            # The longest piece where keep-out zones part it.
            piece = max(np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1), key=len)
            across_m = raster.across_m[[piece[0], piece[-1]]]
            found.append(raster.axes.to_en(np.column_stack([np.full(2, raster.along_m[column]), across_m])))
        return found

    def _lay_out(self, flying: Flying, coverage: Coverage, team: dict[str, FloatArray]) -> None:
        """Choose the direction of lines and everybody's share, at the beginning and as more is known."""
        done = float(coverage.done[coverage.wanted].mean())
        begins = self._looks == 0
        if not begins and (self._looks > len(LOOK_AGAIN_AT) or done < LOOK_AGAIN_AT[self._looks - 1]):
            return
        self._looks = 1 + sum(done >= share for share in LOOK_AGAIN_AT)
        if self._directed is not None and self._directed.is_as(coverage):
            return  # Nothing is known that was not known when the direction was chosen.
        self._directed = Directed(coverage.wanted, coverage.depth_m)
        # What is left has some shape; what speaks for another direction is the bottom of the whole area.
        whole = replace(coverage, done=np.zeros_like(coverage.done))
        direction_rad, _ = best_direction(
            whole, flying, self._guess_m, self._direction_rad, TURNING_GAIN, self._raster_m
        )
        if not begins and direction_rad != self._direction_rad:
            direction_rad, _ = best_direction(
                coverage, flying, self._guess_m, self._direction_rad, TURNING_GAIN, self._raster_m
            )
        if begins or direction_rad != self._direction_rad:
            self._direction_rad = direction_rad
            self._share_out(flying, coverage, team)

    def _share_out(self, flying: Flying, coverage: Coverage, team: dict[str, FloatArray]) -> None:
        """Give pairs of neighbours a block each, of as much work as they are; both begin at its sides."""
        raster = self._raster(coverage, self._direction_rad)
        names = sorted(team, key=lambda name: (float(raster.axes.turned(team[name][:2])[1]), name))
        work = _work(raster, raster.open, flying).sum(axis=0)
        whole = float(needed_lines(raster, raster.open, flying).max(initial=1.0))
        for name in names:
            self._sweeps[name].share = None
        # Nobody is given less than a line: the way to it would be longer.
        names = names[: max(1, int(whole + ALMOST))]
        if len(names) == 1:
            across = float(raster.axes.turned(team[names[0]][:2])[1])
            low, high = float(raster.across_m[0]), float(raster.across_m[-1])
            self._sweeps[names[0]].share = Strip(-BEYOND_M, BEYOND_M, 1 if across - low <= high - across else -1)
            return
        upto = np.cumsum(work) / max(float(work.sum()), 1e-9)
        parts = np.arange(len(names) + 1) / len(names)
        if whole < FEW_LINES * len(names):
            # Few lines are shared as whole ones: parts of lines at every border would be lines more.
            parts = np.round(parts * np.ceil(whole)) / np.ceil(whole)
        first = 0
        while first < len(names):
            pair = names[first : first + 2]
            low, high = (
                -BEYOND_M
                if k == 0
                else BEYOND_M
                if k == len(names)
                else float(np.interp(parts[k], upto, raster.across_m))
                for k in (first, first + len(pair))
            )
            self._sweeps[pair[0]].share = Strip(low, high, 1)
            if len(pair) == 2:
                self._sweeps[pair[1]].share = Strip(low, high, -1)
            first += 2

    def _help(self, vehicle: str, left: LineRaster, large: BoolArray, flying: Flying) -> Strip | None:
        """Return a part of what another has left to sweep; None where nobody has much."""
        shares = {name: s.share for name, s in self._sweeps.items() if s.share is not None and name != vehicle}
        best: tuple[float, Strip] | None = None
        for share in shares.values():
            inside = large & _between(left, share)
            work = _work(left, inside, flying)
            lines_long = inside.any(axis=1).sum() * left.cell_m
            if work.sum() > max(WORTH_HELPING * lines_long, 1e-9) and (best is None or work.sum() > best[0]):
                best = float(work.sum()), share
        if best is None:
            # Nobody sweeps what is left: whoever comes first.
            alone = large.copy()
            for share in shares.values():
                alone &= ~_between(left, share)
            return Strip(-BEYOND_M, BEYOND_M, 1) if alone.any() else None
        found = best[1]
        both = [share for share in shares.values() if (share.low_m, share.high_m) == (found.low_m, found.high_m)]
        if len(both) == 1:
            return Strip(found.low_m, found.high_m, -found.sign)
        across = _work(left, large & _between(left, found), flying).sum(axis=0)
        middle_m = float(np.interp(0.5, np.cumsum(across) / across.sum(), left.across_m))
        for share in both:
            if share.sign > 0:
                share.high_m = middle_m
            else:
                share.low_m = middle_m
        return Strip(found.low_m, middle_m, -1)

    def _expected(self, raster: LineRaster, flying: Flying, vehicle: str) -> BoolArray:
        """Return what will be seen on what everybody was sent along, and on what the others' lines have left."""
        seen = np.zeros_like(raster.open)
        for name, sweep in self._sweeps.items():
            paths = [piece.path for piece in sweep.expected]
            if name != vehicle and sweep.course is not None and len(sweep.course.path) > 1:
                paths.append(sweep.course.path)
            for path in paths:
                seen |= raster.under(path, flying)
        return seen

    def _forget_flown(self, coverage: Coverage) -> None:
        """Expect nothing any more of pieces that were flown; those before them were flown, too."""
        for sweep in self._sweeps.values():
            for k in range(len(sweep.expected) - 1, -1, -1):
                rows, cols = _under(sweep.expected[k].path, coverage)
                last = int((1.0 - LAST_PART) * len(rows))
                rows, cols = rows[last:], cols[last:]
                inside = coverage.wanted[rows, cols]
                if not inside.any() or (
                    coverage.done[rows, cols][inside].mean() >= FLOWN and _end_seen(sweep.expected[k].open_m, coverage)
                ):
                    del sweep.expected[: k + 1]
                    break

    def _count(self, path: FloatArray, flying: Flying, coverage: Coverage, tries: int = 1) -> None:
        """Note what a line that is begun is to see, what it leads over in any case."""
        raster = self._raster(coverage, self._direction_rad)
        seen = raster.under(path, flying)
        turned = raster.axes.turned(path)
        seen[raster.columns_of(turned[:, 0]), raster.rows_of(turned[:, 1])] = True
        places = raster.axes.turned(coverage.places_m(coverage.left))
        inside = seen[raster.columns_of(places[:, 0]), raster.rows_of(places[:, 1])]
        rows, cols = np.nonzero(coverage.left)
        self._tried[rows[inside], cols[inside]] += tries

    def _raster(self, coverage: Coverage, direction_rad: float) -> LineRaster:
        if self._steepest is None or self._steepest[0] is not coverage.depth_m:
            self._steepest = coverage.depth_m, float(np.clip(SHOALING_OF_STEEP * steepness(coverage), *SHOALING))
        return raster_of(coverage, direction_rad, self._raster_m, self._guess_m, self._steepest[1])

    def remember(self) -> dict[str, Any]:
        """Return all that the survey knows, for ``recall``."""
        return {
            "direction_rad": self._direction_rad,
            "looks": self._looks,
            "across": None if self._across is None else [path.tolist() for path in self._across],
            "tried": [self._tried.shape, _packed(self._tried)],
            "sweeps": {
                name: {
                    "share": None if s.share is None else asdict(s.share),
                    "course": None
                    if s.course is None
                    else {
                        "direction_rad": s.course.direction_rad,
                        "sign": s.course.sign,
                        "path": s.course.path.tolist(),
                        "overlap": s.course.overlap,
                        "begun": s.course.begun,
                    },
                    "expected": [piece.path.tolist() for piece in s.expected],
                    "ends": [piece.open_m.tolist() for piece in s.expected],
                    "refused": s.refused,
                    "skipped": None if s.skipped is None else s.skipped.tolist(),
                }
                for name, s in self._sweeps.items()
            },
        }

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what ``remember`` returned. Raises KeyError, TypeError or ValueError when it is not that."""
        self._direction_rad, self._looks = float(state["direction_rad"]), int(state["looks"])
        across = state["across"]
        self._across = None if across is None else [np.array(path, dtype=np.float64) for path in across]
        shape, packed = state["tried"]
        self._tried = _unpacked(packed, tuple(shape))
        self._sweeps = {}
        for name, kept in state["sweeps"].items():
            course = kept["course"]
            self._sweeps[name] = Assignment(
                None if kept["share"] is None else Strip(**kept["share"]),
                None
                if course is None
                else FlownLine(
                    float(course["direction_rad"]),
                    int(course["sign"]),
                    np.array(course["path"], dtype=np.float64).reshape(-1, 2),
                    float(course["overlap"]),
                    bool(course["begun"]),
                ),
                _pieces(kept["expected"], kept.get("ends", [])),
                int(kept.get("refused", 0)),
                skipped=None
                if kept.get("skipped") is None
                else np.array(kept["skipped"], dtype=np.float64).reshape(-1, 2),
            )


def _pieces(paths: list[Any], ends: list[Any]) -> list[Piece]:
    """Return pieces as they were remembered; earlier versions noted nothing of their ends."""
    places = [*ends, *([[]] * (len(paths) - len(ends)))]
    return [
        Piece(*(np.array(one, dtype=np.float64).reshape(-1, 2) for one in both))
        for both in zip(paths, places, strict=True)
    ]


def _packed(tried: IntArray) -> str:
    return base64.b64encode(zlib.compress(np.minimum(tried, 255).astype(np.uint8).tobytes(), level=1)).decode()


def _unpacked(packed: str, shape: tuple[int, ...]) -> IntArray:
    return np.frombuffer(zlib.decompress(base64.b64decode(packed)), np.uint8).reshape(shape).astype(np.int64)


def closer(flying: Flying, overlap: float) -> Flying:
    """Return the same with another overlap."""
    return replace(flying, overlap=overlap)


def _between(raster: LineRaster, share: Strip) -> BoolArray:
    inside = (raster.across_m >= share.low_m) & (raster.across_m <= share.high_m)
    return np.broadcast_to(inside, raster.open.shape)


def _touching(cells: BoolArray, others: BoolArray) -> BoolArray:
    """Return those of some cells (along, across) whose piece shares any with others."""
    number, count = label(cells, np.ones((3, 3)))
    touched = np.zeros(count + 1, dtype=bool)
    touched[number[cells & others]] = True
    return np.asarray(touched[number])


def _work(raster: LineRaster, cells: BoolArray, flying: Flying) -> FloatArray:
    """Return how long lines over cells are, metres, (along, across)."""
    return np.asarray(np.where(cells, raster.work_m(flying), 0.0))


def _under(path: FloatArray, coverage: Coverage) -> tuple[Any, Any]:
    """Return the rows and columns of the grid's cells under a path (k, 2)."""
    lengths = np.hypot(*np.diff(path, axis=0).T)
    begins = np.concatenate([[0.0], np.cumsum(lengths)])
    at = np.arange(0.0, begins[-1] + 1e-9, coverage.cell_m)
    cols = np.floor((np.interp(at, begins, path[:, 0]) - coverage.west_m) / coverage.cell_m).astype(np.int64)
    rows = np.floor((np.interp(at, begins, path[:, 1]) - coverage.south_m) / coverage.cell_m).astype(np.int64)
    shape = coverage.wanted.shape
    return np.clip(rows, 0, shape[0] - 1), np.clip(cols, 0, shape[1] - 1)


def _open_beside_end(path: FloatArray, flying: Flying, coverage: Coverage) -> FloatArray:
    """Return the centres (n, 2) of open cells across the end of a path (k, 2), as far as the swath goes there."""
    back = path[-2] - path[-1]
    back = back / max(float(np.hypot(*back)), 1e-9)
    end = path[-1] + 0.5 * coverage.cell_m * back
    rows, cols = _under(np.stack([end, end]), coverage)
    depth_m = coverage.depth_m[rows[:1], cols[:1]]
    half_m = float(flying.half_width_m(depth_m)[0]) if np.isfinite(depth_m).all() else 0.0
    aside_m = np.arange(-max(half_m, coverage.cell_m), max(half_m, coverage.cell_m) + 1e-9, coverage.cell_m)
    places = end + aside_m[:, None] * np.array([-back[1], back[0]])
    return np.asarray(places[_cells_at(places, coverage, coverage.left)])


def _end_seen(places: FloatArray, coverage: Coverage) -> bool:
    """Return whether most of the places (n, 2) that were open beside a piece's end are ensonified."""
    return not len(places) or float(_cells_at(places, coverage, coverage.done).mean()) >= FLOWN


def _cells_at(places: FloatArray, coverage: Coverage, cells: BoolArray) -> BoolArray:
    """Return which places (n, 2) lie in some cells of the grid."""
    cols = np.floor((places[:, 0] - coverage.west_m) / coverage.cell_m).astype(np.int64)
    rows = np.floor((places[:, 1] - coverage.south_m) / coverage.cell_m).astype(np.int64)
    shape = cells.shape
    inside = (rows >= 0) & (rows < shape[0]) & (cols >= 0) & (cols < shape[1])
    return np.asarray(inside & cells[np.where(inside, rows, 0), np.where(inside, cols, 0)])


def _towards(path: FloatArray) -> float:
    """Return the direction of a path's first piece, anticlockwise from east."""
    east, north = path[1] - path[0]
    return float(np.arctan2(north, east))


def _simple(path: FloatArray, tolerance_m: float) -> FloatArray:
    """Return a path (k, 2) with as few vertices as leave it where it is (Douglas and Peucker 1973)."""
    if len(path) < 3:
        return path
    keep = np.zeros(len(path), dtype=bool)
    keep[[0, -1]] = True
    pieces = [(0, len(path) - 1)]
    while pieces:
        first, last = pieces.pop()
        chord = path[last] - path[first]
        rest = path[first + 1 : last] - path[first]
        if not len(rest):
            continue
        off = np.abs(chord[0] * rest[:, 1] - chord[1] * rest[:, 0]) / max(float(np.hypot(*chord)), 1e-9)
        k = int(off.argmax())
        if off[k] > tolerance_m:
            keep[first + 1 + k] = True
            pieces += [(first, first + 1 + k), (first + 1 + k, last)]
    return path[keep]
