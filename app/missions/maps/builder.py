"""From accepted soundings to the mission's map and to the belief a planner works on."""

import hashlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from app.arrays import BoolArray, FloatArray
from app.estimation.uncertainty import SoundingErrors
from app.exploration.core.coverage import Coverage
from app.exploration.core.problem import Belief
from app.mapping.gaussian_process.fusion import fuse, prior_map
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.gaussian_process.surveys import judged, mapped
from app.mapping.swath.ensonified import Ensonified, ensonified
from app.mapping.swath.gridded import is_of_swaths, without_guesses
from app.mapping.types import BathymetricMap, Grid, SoundingRows, Soundings
from app.missions.maps.live_grid import LiveGrid
from app.missions.maps.queue import MapQueue, Replacement
from app.missions.maps.sounding_table import SoundingTable
from app.missions.maps.swath_grid import SwathGrid

MAX_LANDMARKS = 4000
"""More landmarks make planning slower, not better: neighbouring cells are almost the same question."""

CLAIM_MARGIN, UNSEEN_MARGIN = 1.25, 2.0
"""By the first factor a cell's deviation must be below the asked accuracy to become known; up to the accuracy it stays
so. What is learned of the sea floor changes a little with every map: cells at the limit do not come and go with it.
Ground that no sounding supports may be rougher than the rest, and a model that learns of it will be less sure of all:
the second is added times its share of the area."""

Doubted = list[tuple[FloatArray, str]]
"""Soundings, rows of shape (4,), that a map leaves out, each with the reason."""

HEAVY = 20_000
"""Maps of at least so many soundings are made elsewhere, where that is possible: of fewer it is hardly quicker."""

FINEST_CELLS = 0.5
"""Soundings that lie in one square of this part of a cell count as one, where there are so many."""

RELEARN_GROWTH = 1.15
"""Hyperparameters are learned again when the soundings grew by this factor."""


@dataclass(frozen=True)
class _Learned:
    """The model with its hyperparameters, and of the soundings that it was learned on why outliers are left out.

    ``rejected``, shape (n,), has an entry for each that it was learned on; ``doubted`` are those where it is True.
    """

    model: GaussianProcessMap
    rejected: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    doubted: Doubted = field(default_factory=list)


@dataclass(frozen=True)
class BuiltMap:
    """A map and what was known when it was made. ``version`` grows with each.

    ``thorough`` maps are those before which outliers were judged and the model was learned of all soundings.
    """

    version: int
    soundings: int
    map: BathymetricMap
    digest: str
    thorough: bool = False

    @cached_property
    def mean_sd_m(self) -> float:
        """Mean standard deviation over the area."""
        return float(np.nanmean(self.map.sd_m))


def make_grid(area: FloatArray, cell_m: float) -> tuple[Grid, BoolArray]:
    """Return the grid over a polygon (n, 2), and which of its cells (rows, cols) have their centre in it."""
    low, high = area.min(axis=0), area.max(axis=0)
    # A side that is a whole number of cells up to rounding is not given one cell more.
    cols, rows = (max(1, int(np.ceil(side / cell_m - 1e-3))) for side in high - low)
    grid = Grid(float(low[0]), float(low[1]), cell_m, rows, cols)
    centres = grid.centres_m
    inside = shapely.contains_xy(Polygon(area), centres[:, 0], centres[:, 1])
    return grid, inside.reshape(rows, cols)


def digest_of(bathymetry: BathymetricMap) -> str:
    """Return what tells maps apart, steps and restarts included."""
    return hashlib.sha256(bathymetry.depth_m.tobytes()).hexdigest()


class MapBuilder:
    """Collects soundings and makes maps of them.

    ``add`` may be called from the event loop at any time; ``build`` and ``learn`` belong in worker threads.

    Parameters
    ----------
    area : (n, 2)
        Corners of a polygon, east and north.
    live
        Also keep the interpolation that takes every sounding in at once.
    cell_of_depth
        The share of its depth that each place's cell is judged by in surveys with swath sonars; None: all are judged
        by ``cell_m``.
    errors
        Of swath sonars' soundings; None: the usual ones.
    """

    def __init__(
        self,
        area: FloatArray,
        cell_m: float,
        accuracy_m: float,
        *,
        live: bool = False,
        cell_of_depth: float | None = None,
        errors: SoundingErrors | None = None,
    ) -> None:
        self.grid, self.mask = make_grid(area, cell_m)
        self._accuracy_m, self._cell_of_depth = accuracy_m, cell_of_depth
        stride = int(np.ceil(np.sqrt(max(self.mask.sum(), 1) / MAX_LANDMARKS)))
        self._nodes = np.zeros_like(self.mask)
        self._nodes[stride // 2 :: stride, stride // 2 :: stride] = True
        self._nodes &= self.mask
        if not self._nodes.any():
            self._nodes = self.mask.copy()
        self.elsewhere: Callable[..., Any] = _here
        """Computes a function of a module with its arguments, in place of the thread that asks."""
        self._nodes_xy = self.grid.centres_m[self._nodes.ravel()]
        self.arrivals = MapQueue()
        self.live = LiveGrid(self.grid, self.mask) if live else None
        """What came since the newest map was made; None: nobody asks for it."""
        self.swath = SwathGrid(self.grid, self.mask, errors or SoundingErrors(), cell_of_depth)
        """What swath sonars have ensonified."""
        self._beams_mapped = 0
        self._believed: BathymetricMap | None = None
        """The newest map with depths where it shows none; None: the map as it is."""
        self._table = SoundingTable()
        # Those that an operator restored: they are no outliers whatever their neighbours say.
        self._trusted = np.zeros(0, dtype=bool)
        self._prior: BathymetricMap | None = None
        self._learned = _Learned(self._new_model())
        self._building = threading.Lock()
        self._learning = threading.Lock()
        self._newest: BuiltMap | None = None
        self._doubted: Doubted = []
        # What ``arrivals.replaced`` was when the newest map's soundings were taken in.
        self._replaced_mapped = 0
        self._version = 0
        self._shares: tuple[BuiltMap | None, float, float] = (None, 0.0, 100.0)
        self._ensonified: Ensonified | None = None
        # Counts how often all soundings were replaced: what is learned meanwhile of the old ones is void.
        self._generation = 0

    def add(self, soundings: SoundingRows) -> None:
        """Take in soundings, shape (n, 4): east, north, depth, standard deviation in metres."""
        if len(soundings):
            if self.live is not None:
                # Before it arrives: what a map has taken, the live grid has noted.
                self.live.note(soundings)
            self.arrivals.add(soundings)

    def show(self, built: BuiltMap, doubted: Doubted) -> None:
        """Begin with a map that was stored, and with what it left out; its soundings stay where they are stored."""
        self._version = built.version
        self._newest, self._doubted, self._believed = built, doubted, None
        self.arrivals.rest()

    def release(self) -> None:
        """Let go of the soundings, which are read again when they are needed; map and doubts stay."""
        # Nothing is released that a thread works with.
        if self._building.acquire(blocking=False):
            if self._learning.acquire(blocking=False):
                if self.arrivals.rest():
                    self._doubted = self.doubted()
                    self._table, self._trusted = SoundingTable(), np.zeros(0, dtype=bool)
                    self._prior, self._learned = None, _Learned(self._new_model())
                    if self.live is not None:
                        self.live.release()
                self._learning.release()
            self._building.release()

    def _new_model(self) -> GaussianProcessMap:
        # Outliers are judged by ``learn``.
        return GaussianProcessMap(reject_outliers=False, least_merge_m=FINEST_CELLS * self.grid.cell_m)

    @property
    def is_current(self) -> bool:
        """Whether nothing that the newest map was made of was changed since; more may have come."""
        return self.arrivals.replaced == self._replaced_mapped

    @property
    def newest(self) -> BuiltMap | None:
        """The newest map; None before the first sounding was built in."""
        return self._newest

    @property
    def stale(self) -> bool:
        """Whether there are soundings that the newest map does not hold."""
        return bool(self.arrivals) or self.swath.beams != self._beams_mapped

    def build(self, *, thorough: bool = False) -> BuiltMap | None:
        """Make a map of everything added so far; None without soundings.

        Gross outliers are judged by ``learn``; a sounding that came since is trusted until then. A thorough map judges
        every sounding and learns the model first, as a product should. While the soundings are not in memory, or
        another map is being made, the newest map stays as it is: no decision waits for what somebody else asked for.
        """
        if not self._building.acquire(blocking=thorough or self._newest is None):
            return self._newest
        try:
            return self._make(thorough=thorough)
        finally:
            self._building.release()

    def _make(self, *, thorough: bool) -> BuiltMap | None:
        """Make the map; the caller holds ``_building``."""
        came = self.arrivals.take()
        if came is None:
            return self._newest
        upto, generation = self.arrivals.taken, self._generation
        self._take_in(came[0])
        if self.live is not None and (generation != self._generation or self.live.outgrown(len(self._soundings))):
            self.live.begin_anew(self._soundings, upto)
        beams = self.swath.beams
        if thorough and self._newest is not None and self._newest.thorough and not came[0] and not beams:
            return self._newest  # who asked for it at the same time has made it
        if not len(self._soundings) and self._prior is None and not beams:
            self._newest = None
            return None
        own = self._learn(self._compute(thorough=True), always=True, mapping=not beams) if thorough else None
        if came[0] or beams != self._beams_mapped or (self._newest is not None and thorough):
            self._newest = self._build(own, thorough=thorough)
            self._beams_mapped = beams
            self._replaced_mapped = came[1]
            if self.live is not None:
                self.live.settle(self._soundings, upto)
        return self._newest

    def _take_in(self, came: list[SoundingRows | Replacement]) -> None:
        """Add what came."""
        arrived: list[SoundingRows] = []
        for item in came:
            if isinstance(item, Replacement):
                self._prior = (
                    prior_map(Soundings.of_rows(item.prior), self.grid, self.mask) if len(item.prior) else None
                )
                if item.soundings is not None:
                    self._generation += 1
                    arrived, self._table, self._trusted = [], SoundingTable.of(item.soundings), item.trusted
                    self._learned = _Learned(self._new_model())
            else:
                arrived.append(item)
        if arrived:
            for rows in arrived:
                self._table.extend(rows)
            new = np.zeros(len(self._table) - len(self._trusted), dtype=bool)
            self._trusted = np.concatenate([self._trusted, new])

    def _build(self, own: BathymetricMap | None, *, thorough: bool) -> BuiltMap | None:
        """Make a map; ``own`` is that of the mission's own soundings, where it was made already."""
        bathymetry = self._prior
        measured = self.swath.map(self._soundings) if self.swath.beams else None
        if measured is None and len(self._soundings):
            measured = own if own is not None else self._measured(self._compute(thorough=thorough))
        if measured is not None:
            bathymetry = measured if bathymetry is None else fuse(measured, bathymetry)
        if bathymetry is None:
            return None  # Every beam so far fell outside of the area.
        bathymetry = self._with_margin(bathymetry)
        # Vehicles rather believe a guess than nothing; people are shown none.
        self._believed = bathymetry
        if is_of_swaths(bathymetry) and self._prior is None:
            bathymetry = without_guesses(bathymetry)
        digest = digest_of(bathymetry)
        self._version += 1
        return BuiltMap(self._version, len(self._soundings), bathymetry, digest, thorough)

    def own_map(self) -> BathymetricMap | None:
        """Return the map of the mission's own soundings, without those that were imported.

        It is of what the newest map was made of; outliers that were told by then are left out. None where it has
        none, or they are not in memory.
        """
        with self._building:
            if self.arrivals.at_rest:
                return None
            if self._prior is None and self._newest is not None:
                return self._newest.map
            if self.swath.beams:
                measured = self.swath.map(self._soundings)
                return None if measured is None else without_guesses(measured)
            return self._measured(self._compute(thorough=True)) if len(self._soundings) else None

    def _with_margin(self, bathymetry: BathymetricMap) -> BathymetricMap:
        """Ask more of cells that were not known in the newest map."""
        bound = bathymetry.claim_sd_m
        asked = CLAIM_MARGIN + UNSEEN_MARGIN * float(np.isinf(bound[self.mask]).mean())
        before = np.zeros_like(self.mask) if self._newest is None else self._newest.map.known(self._accuracy_m)
        return replace(bathymetry, bound_sd_m=bound * np.where(before, 1.0, asked))

    def _compute(self, *, thorough: bool) -> Callable[..., Any]:
        """Return who computes: maps that vehicles are led by are always made here."""
        return self.elsewhere if thorough and len(self._soundings) >= HEAVY else _here

    def _measured(self, compute: Callable[..., Any]) -> BathymetricMap:
        """Return the map of the mission's own soundings."""
        learned = self._learned
        used = np.ones(len(self._table), dtype=bool)
        used[: len(learned.rejected)] = ~learned.rejected
        bathymetry, model = compute(mapped, self._soundings, used, learned.model, self.grid, self.mask)
        if not len(learned.rejected):
            # The first fit had to learn; keep what it found.
            self._learned = _Learned(model)
        return bathymetry  # type: ignore[no-any-return]

    def learn(self, *, always: bool = False) -> None:
        """Judge outliers and learn the model's hyperparameters anew when there are enough more soundings.

        Slower than a build, so it is done while the vehicles travel. The next ``build`` uses what was found.
        """
        self._learn(_here, always=always)

    def _learn(self, compute: Callable[..., Any], *, always: bool, mapping: bool = False) -> BathymetricMap | None:
        """Judge outliers and learn the model; with ``mapping`` return the map of what is no outlier.

        None where nothing was learned.
        """
        if not self._learning.acquire(blocking=always):
            return None  # somebody is at it
        try:
            generation = self._generation
            model, before = self._learned.model, len(self._learned.rejected)
            known, trusted = self._soundings, self._trusted
            if not len(known) or (len(known) < RELEARN_GROWTH * before and not always):
                return None
            # Both were taken while soundings may have been added: the shorter one says for how many.
            restored = np.zeros(len(known), dtype=bool)
            restored[: len(trusted)] = trusted[: len(known)]
            place = (self.grid, self.mask) if mapping else ()
            fitted, reasons, made = compute(judged, known, restored, model, *place)
            if generation != self._generation:
                return None
            rejected = np.zeros(len(known), dtype=bool)
            rejected[list(reasons)] = True
            doubted = [(known[i].copy(), reason) for i, reason in reasons.items()]
            self._learned = _Learned(fitted, rejected, doubted)
            return made  # type: ignore[no-any-return]
        finally:
            self._learning.release()

    def doubted(self) -> Doubted:
        """Return the soundings, rows of shape (4,), that the map leaves out as outliers, each with the reason.

        Does not wait for a map that is being made.
        """
        return self._learned.doubted if len(self._learned.rejected) else self._doubted

    @property
    def soundings(self) -> SoundingRows:
        """All that the newest map was made of, (n, 4), those left out as outliers included."""
        return self._soundings

    @property
    def _soundings(self) -> SoundingRows:
        return self._table.rows

    def as_of(self, soundings: SoundingRows, swath: SwathGrid) -> BathymetricMap:
        """Return the map that the first soundings (n, 4) and beams alone make, under the model learned of all of them.

        Raises ValueError without any.
        """
        with self._building:
            learned, prior = self._learned, self._prior
        ensonified = swath.map(soundings) if swath.beams else None
        if ensonified is not None:
            return without_guesses(ensonified) if prior is None else fuse(ensonified, prior)
        doubted = {row[:3].tobytes() for row, _ in learned.doubted}
        used = np.array([row[:3].tobytes() not in doubted for row in soundings], dtype=bool)
        if not used.any():
            if prior is None:
                raise ValueError("there is no sounding to make a map of")
            return prior
        compute = self.elsewhere if len(soundings) >= HEAVY else _here
        measured: BathymetricMap = compute(mapped, soundings, used, learned.model, self.grid, self.mask)[0]
        return measured if prior is None else fuse(measured, prior)

    def coverage_pct(self) -> float:
        """Return the share of the area's cells that are known to the asked accuracy: now, supported by soundings."""
        return self._counted()[1]

    def remaining_pct(self) -> float:
        """Return the share of the landmarks that are not known to the asked accuracy."""
        return self._counted()[2]

    def _counted(self) -> tuple[BuiltMap | None, float, float]:
        """Return both shares of the newest map: they are asked for with every look at the mission."""
        built = self._newest
        if built is None:
            return None, 0.0, 100.0
        if built is not self._shares[0]:
            known = built.map.known(self._accuracy_m)
            shares = float(100.0 * known[self.mask].mean()), float(100.0 * (~known[self._nodes]).mean())
            self._ensonified = ensonified(built.map, self._cell_of_depth)
            if self._ensonified is not None:
                shares = self._ensonified.ensonified_pct, 100.0 - self._ensonified.ensonified_pct
            self._shares = built, *shares
        return self._shares

    def ensonified(self) -> Ensonified | None:
        """Return how far a survey with swath sonars has come; None where nothing of one is in the newest map."""
        self._counted()
        return self._ensonified

    def coverage(self) -> Coverage:
        """Return what swath sonars have to ensonify and have, on cells that lines are planned on."""
        prior = self._prior
        return self.swath.coverage(None if prior is None else prior.depth_m)

    def belief(self) -> Belief:
        """Return what is known at the landmarks (a lattice of the grid's cells)."""
        n = len(self._nodes_xy)
        if self._newest is None:
            extent = float(np.ptp(self.grid.centres_m, axis=0).max())
            return Belief(
                xy_m=self._nodes_xy,
                depth_m=np.full(n, np.nan),
                sd_m=np.full(n, np.inf),
                accurate=np.zeros(n, dtype=bool),
                weight=np.ones(n),
                correlation_length_m=extent / 5,
            )
        bathymetry = self._believed or self._newest.map
        sd_m = bathymetry.planning_sd_m[self._nodes]
        return Belief(
            xy_m=self._nodes_xy,
            depth_m=bathymetry.depth_m[self._nodes],
            sd_m=np.where(np.isnan(sd_m), np.inf, sd_m),
            # Not latched as in AURO15: more soundings may show that a map was too sure of itself.
            accurate=bathymetry.known(self._accuracy_m)[self._nodes],
            weight=bathymetry.roughness[self._nodes],
            correlation_length_m=bathymetry.correlation_length_m,
        )

    def sounded_at_m(self) -> tuple[FloatArray, FloatArray]:
        """Return where was sounded, (n, 2), and where soundings are left out as outliers, (k, 2).

        What came since the newest map was begun counts as sounded.
        """
        places = np.concatenate([rows[:, :2] for rows in (self._soundings, *self.arrivals.noted())])
        if self.swath.beams and self._newest is not None:
            seen = self._nodes & self._newest.map.sounded
            return np.concatenate([places, self.grid.centres_m[seen.ravel()]]), np.zeros((0, 2))
        rejected = self._learned.rejected[: len(places)]
        doubtful = np.zeros(len(places), dtype=bool)
        doubtful[: len(rejected)] = rejected
        return places[~doubtful], places[doubtful]


def _here(work: Callable[..., Any], *arguments: Any) -> Any:
    return work(*arguments)
