"""A swath survey by a team: which line each vehicle flies, and where it goes next.

Neighbours sweep towards each other, so that their border lies where they meet; who is done takes over a part of what
another has left. What lines missed is filled in the end.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.core.coverage import Coverage
from app.exploration.core.free_space import FreeSpace
from app.exploration.swath.assignment import Assignment, FlownLine, Question, recalled
from app.exploration.swath.crosslines import crosslines as crosslines_over
from app.exploration.swath.entries import nearest_entry
from app.exploration.swath.lines import lines, strips
from app.exploration.swath.lines_ahead import best_direction
from app.exploration.swath.missed import on_the_way, passable, touching
from app.exploration.swath.near_zones import led_round
from app.exploration.swath.passes import shared, tour
from app.exploration.swath.raster import Flying, LineRaster, Rasters
from app.exploration.swath.rest_of_line import rest_of_line, simple
from app.exploration.swath.sent import expected, forget_flown, sent_along
from app.exploration.swath.shares import NEAR_M, better_by_another, between, free_at, part_of_others, share_out
from app.exploration.swath.tries import MOST_TRIES, Tries, without

STILL_M = 0.05
"""Shorter legs lead nowhere."""
MOST_REFUSED = 3
"""Who was so often in a row not sent along its line gets another one."""

LOOK_AGAIN_AT = (0.02, 0.08, 0.2, 0.4)
"""Shares of the area after which the direction of lines is looked at again, with the depths that are known by then."""

TURNING_GAIN, TURNING_TEAM_GAIN = 0.1, 0.2
"""Lines of one vehicle, and of a team, are turned into another direction where that shortens what is left by more than
these shares: who of a team flies what when is foretold less surely."""


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
    turned
        Whether lines may get another direction than the preferred one.
    """

    def __init__(
        self,
        preferred_rad: float,
        raster_m: float,
        guess_m: float,
        crosslines: float = 0.0,
        space: FreeSpace | None = None,
        *,
        turned: bool = True,
    ) -> None:
        self._crosslines = crosslines
        self._turned = turned
        self._ground = space
        self._space = None if space is None or space.is_open else space
        """Where a straight way may lead through what vehicles may not enter; None: nowhere."""
        self._across: list[FloatArray] | None = None
        """Crosslines that nobody has begun; None: they are not laid yet."""
        self._direction_rad = preferred_rad
        self._rasters = Rasters(raster_m, guess_m)
        self._sweeps: dict[str, Assignment] = {}
        self._looks = 0
        self._directed: Directed | None = None
        """What the direction was last chosen by."""
        self._tries = Tries()

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
        for name in self._sweeps.keys() - team.keys():
            self._return_crossline(self._sweeps.pop(name))
        for name in team:
            self._sweeps.setdefault(name, Assignment())
        sweep = self._sweeps[vehicle]
        left = self._left(coverage)
        if sweep.skipped is not None:
            self._count(sweep.skipped, flying, left, tries=MOST_TRIES)
            sweep.skipped = None
        self._take_back(sweep, pose, flying, left)
        asked = Question(vehicle, pose, flying, self._left(coverage), team)
        for one in self._sweeps.values():
            forget_flown(one.expected, coverage)
        if sweep.laid_on is not coverage:
            sweep.laid_on = coverage
            self._lay_anew(sweep, asked)
        if sweep.course is not None and not len(sweep.course.path):
            sweep.course = None
        if sweep.course is None and not self._take_line(asked):
            self._take_crossline(sweep, asked)
        sweep.idle = sweep.course is None
        if sweep.course is None:
            return None
        return self._along(sweep, sweep.course, asked, leg_m, reach_m)

    def expect_nothing(self, vehicle: str) -> None:
        """Learn that all was measured where a vehicle was sent: what was not seen there is left."""
        if vehicle in self._sweeps:
            self._sweeps[vehicle].expected.clear()

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
            self._return_crossline(sweep)
            sweep.course = None

    def _return_crossline(self, sweep: Assignment) -> None:
        """Let somebody else fly what is left of a line across all others; what other lines see shows by itself."""
        if sweep.course is not None and sweep.course.sign == 0 and self._across is not None:
            self._across.append(sweep.course.path)

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

    def _take_back(self, sweep: Assignment, pose: FloatArray, flying: Flying, coverage: Coverage) -> None:
        """Put back what a vehicle was not sent along, the way to its line or a piece of it: it does not go on there.

        What lies behind it was not tried either.
        """
        course = sweep.course
        if course is not None and course.begun and course.sent_from is not None:
            sent_m = float(np.hypot(*(pose[:2] - course.sent_from)))
            course.sent_from = None
            # A place beside the beginning is as good.
            if not len(course.path) or np.hypot(*(pose[:2] - self._beginning(course))) <= max(NEAR_M, sent_m):
                return
            sweep.refused += 1
            if sweep.refused >= MOST_REFUSED:
                sweep.course, sweep.refused = None, 0
                return
            course.begun = False
            self._count(course.path, flying, coverage, tries=-1)
            return
        if not sweep.expected:
            return
        piece = sweep.expected[-1].path
        if np.hypot(*(pose[:2] - piece[-1])) <= max(NEAR_M, float(np.hypot(*(pose[:2] - piece[0])))):
            sweep.refused = 0
            return
        del sweep.expected[-1]
        sweep.refused += 1
        if course is None or not course.begun:
            return
        if sweep.refused < MOST_REFUSED:
            course.path = np.vstack([piece, course.path[1:]])
            return
        if len(course.path) > 1 and course.sign != 0:
            self._count(course.path, flying, coverage, tries=-1)
        sweep.course, sweep.refused = None, 0

    def _lay_anew(self, sweep: Assignment, asked: Question) -> None:
        """Lay a vehicle's line by what was measured since."""
        course = sweep.course
        if course is None:
            return
        if not course.begun:
            if course.sign == 0 and self._across is not None:
                self._across.append(course.path)
            sweep.course = None  # another one may be better by now
            return
        if len(course.path) < 2 or course.sign == 0:
            return
        raster = self._rasters.of(without(asked.coverage, sweep.hidden), course.direction_rad)
        free = raster.open & ~expected(self._sweeps, raster, asked.flying, asked.vehicle)
        if sweep.share is not None and self._sweeps_in_share(course, asked.flying):
            free &= between(raster, sweep.share)
        rest = rest_of_line(course, asked.pose[:2], asked.flying, raster, free)
        if rest is not None:
            course.path = self._led(rest, asked.flying, asked.coverage)

    def _along(self, sweep: Assignment, course: FlownLine, asked: Question, leg_m: float, reach_m: float) -> FloatArray:
        """Return the end of the next leg along a vehicle's line, and take it off the line."""
        here = asked.pose[:2]
        if not course.begun:
            begin = self._beginning(course)
            corner = begin if self._space is None else self._space.corner(here, begin, STILL_M)
            away = corner - here
            away_m = float(np.hypot(*away))
            if away_m > reach_m:
                return np.asarray(here + reach_m / away_m * away)
            if float(np.hypot(*(begin - corner))) > NEAR_M:
                return np.asarray(corner)
            course.begun = True
            self._begin(sweep, course, asked)
            if away_m > NEAR_M:
                course.sent_from = (float(here[0]), float(here[1]))
                return begin
        vertices = course.path if np.allclose(course.path[0], here) else np.vstack([here, course.path])
        ahead_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(vertices, axis=0).T))])
        goes_m = min(leg_m, float(ahead_m[-1]))
        if ahead_m[-1] - goes_m < 0.3 * goes_m:
            goes_m = float(ahead_m[-1]) if ahead_m[-1] <= leg_m else 0.5 * float(ahead_m[-1])
        end = np.array([np.interp(goes_m, ahead_m, vertices[:, k]) for k in (0, 1)])
        inner = (ahead_m > 0.0) & (ahead_m < goes_m - 1e-6)
        sweep.expected.append(sent_along(np.vstack([here, vertices[inner], end]), asked.flying, asked.coverage))
        rest = vertices[ahead_m > goes_m + 1e-6]
        course.path = np.vstack([end, rest]) if len(rest) else np.zeros((0, 2))
        return end

    def _beginning(self, course: FlownLine) -> FloatArray:
        """Return where a line begins, (2,); beyond the border: the nearest place to that where vehicles may be."""
        return course.path[0] if self._ground is None else self._ground.nearest(course.path[0])

    def _take_line(self, asked: Question) -> bool:
        """Give a vehicle its next line; return whether there is one."""
        self._lay_out(asked)
        flying, coverage = asked.flying, asked.coverage
        sweep = self._sweeps[asked.vehicle]
        raster = self._rasters.of(coverage, self._direction_rad)
        foreseen = expected(self._sweeps, raster, flying, asked.vehicle)
        left = replace(raster, open=raster.open & ~foreseen)
        swept = self._rasters.of(without(coverage, self._hidden(coverage, flying)), self._direction_rad).open
        large, small = strips(replace(left, open=left.open & swept), flying)
        small |= left.open & ~swept
        missed = small & ~touching(raster.open, foreseen)
        share = sweep.share
        own = share is not None and bool((large & between(raster, share)).any())
        before = {name: replace(one.share) for name, one in self._sweeps.items() if one.share is not None}
        if not own:
            share = sweep.share = part_of_others(self._sweeps, asked.vehicle, left, large, flying)
        sign = 1 if share is None else share.sign
        mine = large & between(raster, share) if share is not None else np.zeros_like(large)
        choice = lines(left, mine, sign, flying) if mine.any() else []
        while choice:
            line, path, away_m = nearest_entry(left, choice, asked.pose, flying.radius_m)
            path = self._led(simple(path, 0.1 * raster.cell_m), flying, coverage)
            if len(path) > 1 and (own or not self._leaves(asked, path, away_m)):
                sweep.course = FlownLine(self._direction_rad, sign, path, flying.overlap)
                self._pass_before(sweep, asked, left, (mine, missed), (path, away_m))
                return True
            choice = [other for other in choice if other is not line]
        if not own:
            # Who sweeps nothing of what others have left leaves it to them.
            for name, one in self._sweeps.items():
                one.share = before.get(name)
        if any(self._sweeps[name].course is not None for name in asked.team if name != asked.vehicle):
            small = missed  # What others may see yet is not missed.
        return bool(small.any()) and self._fill(sweep, asked, left, small)

    def _leaves(self, asked: Question, path: FloatArray, away_m: float) -> bool:
        """Return whether a line is left to another vehicle; not when all were told that nothing is left for them."""
        if all(self._sweeps[name].idle for name in asked.team):
            return False
        return better_by_another(self._sweeps, asked, path, away_m)

    def _pass_before(
        self,
        sweep: Assignment,
        asked: Question,
        left: LineRaster,
        swept_missed: tuple[BoolArray, BoolArray],
        line: tuple[FloatArray, float],
    ) -> None:
        """Send a vehicle over missed ground first where that is a small detour on the way to a line.

        Parameters
        ----------
        swept_missed
            What the vehicle has still to sweep, and what lines have missed, (along, across) both.
        line
            Its path (k, 2) and the way to it.
        """
        swept, missed = swept_missed
        if not missed.any():
            return
        found, _, _ = passable(left, missed, self._tried_twice(asked.coverage), asked)
        early = on_the_way(self._sweeps, asked, left, swept, found, line)
        if early is None:
            return
        led = self._led(early.path, asked.flying, asked.coverage)
        if len(led) > 1:
            sweep.course = FlownLine(_towards(led), 1, led, early.overlap)

    def _fill(self, sweep: Assignment, asked: Question, left: LineRaster, small: BoolArray) -> bool:
        """Send a vehicle over what lines have missed; return whether there is anything for it."""
        flying, coverage, pose = asked.flying, asked.coverage, asked.pose
        found, wide, overlap = passable(left, small, self._tried_twice(coverage), asked)
        mine = shared(found, *free_at(self._sweeps, asked.vehicle, asked.team))[asked.vehicle]
        if not mine and all(self._sweeps[name].idle for name in asked.team if name != asked.vehicle):
            mine = found  # Who is nearer was told that nothing is left, and may not be asked for again.
        for one in tour(mine, pose, flying.radius_m):
            path = self._led(one.path, flying, coverage)
            if len(path) > 1:
                sweep.course = FlownLine(_towards(path), 1, path, one.overlap)
                return True
        near_m = np.full(len(left.open), float(left.axes.turned(pose[:2])[1]))
        choice = lines(left, wide, 1, replace(flying, overlap=overlap), near_m)
        while choice:
            line, path, away_m = nearest_entry(left, choice, pose, flying.radius_m)
            path = self._led(simple(path, 0.1 * left.cell_m), flying, coverage)
            if len(path) > 1 and not self._leaves(asked, path, away_m):
                sweep.course = FlownLine(self._direction_rad, 1, path, overlap)
                return True
            choice = [other for other in choice if other is not line]
        return False

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

    def _begin(self, sweep: Assignment, course: FlownLine, asked: Question) -> None:
        """Note what a line is to see; one that sweeps passes by what two lines before it did not see."""
        coverage = asked.coverage
        sweep.hidden = None
        if course.overlap == asked.flying.overlap:
            sweep.hidden = self._hidden(coverage, asked.flying)
            coverage = without(coverage, sweep.hidden)
        sweep.counted = self._count(course.path, asked.flying, coverage)

    def _hidden(self, coverage: Coverage, flying: Flying) -> BoolArray:
        """Return the cells (rows, cols) in small pieces that two lines were to see and did not: they are passed over.

        Something stands in between: lines beside them would look in vain again.
        """
        again = self._tries.again(coverage)
        raster = self._rasters.of(again, self._direction_rad)
        _, small = strips(raster, flying)
        turned = raster.axes.turned(again.places_m(again.left))
        hidden = again.left.copy()
        hidden[again.left] = small[raster.columns_of(turned[:, 0]), raster.rows_of(turned[:, 1])]
        return hidden

    def _tried_twice(self, coverage: Coverage) -> BoolArray:
        """Return which cells of the raster hold ground that two lines were to see and did not."""
        return self._rasters.of(self._tries.again(coverage), self._direction_rad).open

    def _count(self, path: FloatArray, flying: Flying, coverage: Coverage, tries: int = 1) -> BoolArray:
        """Note what a line that is begun is to see, and return these cells (rows, cols)."""
        return self._tries.count(path, flying, coverage, self._rasters.of(coverage, self._direction_rad), tries)

    def _left(self, coverage: Coverage) -> Coverage:
        """Return a coverage without what is given up: what lines under way are to see is not, before they end."""
        under_way = (
            sweep.counted
            for sweep in self._sweeps.values()
            if sweep.counted is not None and sweep.course is not None and sweep.course.begun and len(sweep.course.path)
        )
        return self._tries.left(coverage, under_way)

    def _sweeps_in_share(self, course: FlownLine, flying: Flying) -> bool:
        """Return whether a line is one of its vehicle's share: passes lie anywhere, and so does what was turned."""
        return course.overlap == flying.overlap and course.direction_rad == self._direction_rad

    def _take_crossline(self, sweep: Assignment, asked: Question) -> None:
        """Give a vehicle the next line across all others, if one is left."""
        if self._across is None:
            raster = self._rasters.of(asked.coverage, self._direction_rad)
            self._across = crosslines_over(raster, asked.flying, self._crosslines)
        if not self._across:
            return
        both = [(k, path) for k, line in enumerate(self._across) for path in (line, line[::-1])]
        k, path = min(both, key=lambda one: float(np.hypot(*(one[1][0] - asked.pose[:2]))))
        del self._across[k]
        path = path if self._space is None else led_round(path, self._space)
        if len(path) > 1:
            sweep.course = FlownLine(self._direction_rad, 0, path, asked.flying.overlap)

    def _lay_out(self, asked: Question) -> None:
        """Choose the direction of lines and everybody's share, at the beginning and as more is known."""
        coverage = asked.coverage
        done = float(coverage.done[coverage.wanted].mean())
        begins = self._looks == 0
        if not begins and (self._looks > len(LOOK_AGAIN_AT) or done < LOOK_AGAIN_AT[self._looks - 1]):
            return
        self._looks = 1 + sum(done >= share for share in LOOK_AGAIN_AT)
        if self._directed is not None and self._directed.is_as(coverage):
            return  # Nothing is known that was not known when the direction was chosen.
        self._directed = Directed(coverage.wanted, coverage.depth_m)
        # What is left has some shape; what speaks for another direction is the bottom of the whole area.
        direction_rad = self._best_direction(replace(coverage, done=np.zeros_like(coverage.done)), asked)
        if not begins and direction_rad != self._direction_rad:
            direction_rad = self._best_direction(coverage, asked)
        if begins or direction_rad != self._direction_rad:
            self._direction_rad = direction_rad
            share_out(self._sweeps, self._rasters.of(coverage, direction_rad), asked.flying, asked.team)

    def _best_direction(self, coverage: Coverage, asked: Question) -> float:
        if not self._turned:
            return self._direction_rad
        guess_m, cell_m = self._rasters.guess_m, self._rasters.cell_m
        gain = TURNING_GAIN if len(asked.team) == 1 else TURNING_TEAM_GAIN
        return best_direction(coverage, asked.flying, guess_m, self._direction_rad, gain, asked.team, cell_m)[0]

    def remember(self) -> dict[str, Any]:
        """Return all that the survey knows, for ``recall``."""
        return {
            "direction_rad": self._direction_rad,
            "looks": self._looks,
            "across": None if self._across is None else [path.tolist() for path in self._across],
            "tried": self._tries.remember(),
            "sweeps": {name: sweep.remember() for name, sweep in self._sweeps.items()},
        }

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what ``remember`` returned. Raises KeyError, TypeError or ValueError when it is not that."""
        self._direction_rad, self._looks = float(state["direction_rad"]), int(state["looks"])
        across = state["across"]
        self._across = None if across is None else [np.array(path, dtype=np.float64) for path in across]
        self._tries.recall(state["tried"])
        self._sweeps = {name: recalled(kept) for name, kept in state["sweeps"].items()}


def _towards(path: FloatArray) -> float:
    """Return the direction of a path's first piece, anticlockwise from east."""
    east, north = path[1] - path[0]
    return float(np.arctan2(north, east))
