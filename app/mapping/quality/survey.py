"""A survey held against itself: its lines and crosslines, their crossings, and crosslines' beams."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.quality.agreement import Agreement, agreement, outlying
from app.mapping.quality.beams import BeamCheck
from app.mapping.quality.crossovers import Crossings, crossings
from app.mapping.quality.line_log import LineLog
from app.mapping.quality.tracks import Lines, Tracks, crosslines, cut
from app.mapping.s44 import Order, max_tvu_m


@dataclass(frozen=True)
class SurveyCheck:
    """What a survey says of itself.

    Attributes
    ----------
    names
        Of the vehicles.
    log
        Where each line begins and ends, and how straight it is.
    is_crossline : (m,)
        Of each line.
    beams
        Crosslines' beams beside the grid of the main lines; None without swath sonars.
    """

    names: tuple[str, ...]
    lines: Lines
    log: LineLog
    is_crossline: BoolArray
    crossings: Crossings
    beams: BeamCheck | None = None

    @classmethod
    def of(cls, tracks: Tracks) -> "SurveyCheck":
        """Return what the soundings along the vehicles' ways say."""
        lines = cut(tracks)
        found = crossings(tracks, lines)
        return cls(tracks.names, lines, LineLog.of(tracks, lines), crosslines(lines, found.line), found)

    @cached_property
    def length_m(self) -> float:
        """Of all lines."""
        return float(self.lines.length_m.sum())

    @cached_property
    def crosslines_m(self) -> float:
        """Length of the crosslines."""
        return float(self.lines.length_m[self.is_crossline].sum())

    def crossed_at(self, vehicle: str, time_s: FloatArray) -> BoolArray:
        """Return at which times (n,) a vehicle was on a crossline; where its clock was set back one of them counts."""
        crossed = np.zeros(len(time_s), dtype=bool)
        if vehicle in self.names:
            own = self.is_crossline & (self.lines.vehicle == self.names.index(vehicle))
            for begin, end in zip(self.lines.start_s[own], self.lines.end_s[own], strict=True):
                crossed |= (time_s >= begin) & (time_s <= end)
        return crossed

    def statistics(self, order: Order) -> Agreement | None:
        """Return what all crossings say; None without any."""
        return agreement(self.crossings.difference_m, self.crossings.mean_depth_m, order)

    def at_crosslines(self, order: Order) -> Agreement | None:
        """Return what crossings of a crossline with a main line say, these alone; None without any."""
        one, other = self.is_crossline[self.crossings.line].T
        return self._among(one != other, order)

    def by_vehicles(self, order: Order) -> dict[tuple[str, str], Agreement]:
        """Return what crossings say for each pair of vehicles that cross, a vehicle and itself among them."""
        pair = self.lines.vehicle[self.crossings.line]
        return {
            (self.names[a], self.names[b]): found
            for a, b in np.unique(pair, axis=0).tolist()
            if (found := self._among((pair == (a, b)).all(axis=1), order)) is not None
        }

    def by_line(self, order: Order) -> dict[int, Agreement]:
        """Return what each line says that crosses another one: its depths minus the others'."""
        others = self.crossings.take(self.crossings.line[:, 0] != self.crossings.line[:, 1])
        if not len(others):
            return {}
        line = others.line.T.ravel()
        difference, depth = others.difference_m, others.mean_depth_m
        by_line = np.argsort(line, kind="stable")
        off, deep = np.concatenate([difference, -difference])[by_line], np.concatenate([depth, depth])[by_line]
        numbers, first = np.unique(line[by_line], return_index=True)
        parts = zip(numbers.tolist(), np.split(off, first[1:]), np.split(deep, first[1:]), strict=True)
        return {number: found for number, o, d in parts if (found := agreement(o, d, order)) is not None}

    def outliers(self, order: Order) -> BoolArray:
        """Return which crossings (k,) disagree more than an order allows, or far more than the others."""
        return outlying(self.crossings.difference_m, self.crossings.mean_depth_m, order)

    def worst_first(self, order: Order) -> IntArray:
        """Return the crossings (k,), that which is largest beside what an order allows first."""
        share = np.abs(self.crossings.difference_m) / max_tvu_m(self.crossings.mean_depth_m, order)
        return np.argsort(-share, kind="stable")

    def _among(self, rows: BoolArray, order: Order) -> Agreement | None:
        return agreement(self.crossings.difference_m[rows], self.crossings.mean_depth_m[rows], order)
