"""A mission's survey held against itself: soundings and pings are read, and kept is what was found."""

import asyncio
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.mapping.quality.agreement import histogram, within
from app.mapping.quality.beams import BeamCheck
from app.mapping.quality.survey import SurveyCheck
from app.mapping.quality.tracks import Tracks
from app.mapping.s44 import Order
from app.mapping.swath.density import DensityGrid
from app.missions.live.mission import LiveMission
from app.missions.maps.snapshot import MapSnapshot
from app.missions.maps.swath_grid import Beams, beams_of
from app.missions.views.measurements.crossovers import (
    AgreementView,
    AngleAgreementView,
    CrossingFeaturesView,
    CrossingFeatureView,
    CrossingView,
    CrossoversView,
    HistogramView,
    LineAgreementView,
    PointView,
    VehiclesAgreementView,
)
from app.storage.bulk import read_in_pieces
from app.storage.concurrency.single_flight import Shared
from app.storage.queries import soundings as sounding_queries

MOST_FEATURES, MOST_LINES = 500, 500

PAUSE = 20.0
"""While a mission runs what was found is shown so many times as long as it took to find it."""

SPACING_CELLS = 0.5
"""Pings of a track are at least so many cells of the map apart."""


@dataclass(frozen=True)
class FoundCheck:
    """What was found when the map with this version and tag was the newest."""

    version: int
    tag: str
    check: SurveyCheck


class CrossoverCheck:
    """The check of one mission, made when it is asked for and kept as long as the map stays the same."""

    def __init__(self, live: LiveMission) -> None:
        self._live = live
        self._found: FoundCheck | None = None
        self._not_before_s = 0.0
        self._shared = Shared(self._newest)
        self._snapshot: MapSnapshot | None = None

    async def of(self, snapshot: MapSnapshot) -> FoundCheck:
        """Return the check of a map; while the mission runs one of an earlier map will do for a while.

        Raises
        ------
        PingsUnreadableError
        """
        self._snapshot = snapshot
        return await self._shared()

    async def _newest(self) -> FoundCheck:
        snapshot, found = self._snapshot, self._found
        assert snapshot is not None  # noqa: S101
        begun_s = asyncio.get_running_loop().time()
        if found is not None and (found.tag == snapshot.tag or (self._live.running and begun_s < self._not_before_s)):
            return found
        check = await survey_check(self._live)
        ended_s = asyncio.get_running_loop().time()
        self._not_before_s = ended_s + PAUSE * (ended_s - begun_s)
        self._found = FoundCheck(snapshot.version, snapshot.tag, check)
        return self._found


async def check_of(live: LiveMission, snapshot: MapSnapshot) -> FoundCheck:
    """Return how well a mission's survey agrees with itself. Raises PingsUnreadableError."""
    return await live.part(CrossoverCheck).of(snapshot)


async def survey_check(live: LiveMission) -> SurveyCheck:
    """Hold all that was accepted so far against itself.

    Pings are read once for the vehicles' ways and, where there are crosslines, twice more: for the grid of the main
    lines, and to compare. Never more than some thousand of them are in memory.
    """
    until = await live.pings.newest_block()
    tracks = await survey_tracks(live, until)
    check = await asyncio.to_thread(SurveyCheck.of, tracks)
    if not live.counts.pings or not check.is_crossline.any():
        return check
    place = live.gate.corrections.placing()
    main = DensityGrid(live.builder.grid, live.builder.mask)
    async for vehicle, pings in live.pings.all_accepted(until):
        own = pings.take(~check.crossed_at(vehicle, pings.time_s))
        beams = await asyncio.to_thread(beams_of, vehicle, own, place, live.spec.uncertainty)
        if beams is not None:
            at = beams.footprints
            await asyncio.to_thread(main.add, at.east_m, at.north_m, at.depth_m, beams.sd_m)
    compared = BeamCheck(live.builder.grid, main.depth_m)
    place = live.gate.corrections.placing()
    async for vehicle, pings in live.pings.all_accepted(until):
        own = pings.take(check.crossed_at(vehicle, pings.time_s))
        beams = await asyncio.to_thread(beams_of, vehicle, own, place, live.spec.uncertainty)
        if beams is not None:
            at = beams.footprints
            await asyncio.to_thread(compared.add, at.east_m, at.north_m, at.depth_m, at.angle_rad)
    return replace(check, beams=compared)


async def survey_tracks(live: LiveMission, until_block: int | None = None) -> Tracks:
    """Return what was sounded along the vehicles' ways; of swath sonars the beams straight down.

    ``until_block``: no pings of later blocks.
    """
    await live.journal.flush()
    tables = await _sounding_tables(live)
    place = live.gate.corrections.placing()
    spacing_m = SPACING_CELLS * live.spec.cell_m
    nadirs: dict[str, list[FloatArray]] = {}
    async for vehicle, pings in live.pings.all_accepted(until_block):
        beams = await asyncio.to_thread(beams_of, vehicle, pings, place, live.spec.uncertainty)
        if beams is not None:
            nadirs.setdefault(vehicle, []).append(await asyncio.to_thread(nadir_track, beams, spacing_m))
    tables |= {vehicle: np.concatenate(parts) for vehicle, parts in nadirs.items()}
    return await asyncio.to_thread(Tracks.of, tables)


async def _sounding_tables(live: LiveMission) -> dict[str, FloatArray]:
    """Return by vehicle its accepted soundings (n, 5): time, east, north, depth, standard deviation."""
    found: dict[str, list[FloatArray]] = {}

    def take(rows: Sequence[Any]) -> None:
        names = np.array([row[0] for row in rows])
        values = np.array([tuple(row)[1:] for row in rows], dtype=float)
        for name in np.unique(names).tolist():
            found.setdefault(name, []).append(values[names == name])

    await read_in_pieces(live.database, sounding_queries.track_query(live.id), take)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def nadir_track(beams: Beams, spacing_m: float) -> FloatArray:
    """Return the beam of each ping that points most steeply down, (k, 5) as soundings are; none nearer than asked."""
    pings, at = beams.pings, beams.footprints
    order = np.lexsort((np.abs(at.angle_rad - pings.roll_rad[at.ping]), at.ping))
    _, first = np.unique(at.ping[order], return_index=True)
    rows = order[first]
    table = np.column_stack([pings.time_s[at.ping], at.east_m, at.north_m, at.depth_m, beams.sd_m])[rows]
    return table[_spaced(table[:, 1:3], spacing_m)]


def _spaced(places: FloatArray, spacing_m: float) -> BoolArray:
    """Return the first of the places (k, 2) along a way in each of its pieces of a length."""
    along = np.cumsum(np.hypot(*np.diff(places, axis=0, prepend=places[:1]).T))
    return np.diff(np.floor(along / spacing_m), prepend=-1.0) > 0.0


def crossovers_view(found: FoundCheck, snapshot: MapSnapshot, order: Order) -> CrossoversView:
    """Return what was found as JSON shows it."""
    check = found.check
    crossings, lines = check.crossings, check.lines
    statistics, at_crosslines = check.statistics(order), check.at_crosslines(order)
    normalised = crossings.difference_m / np.maximum(crossings.predicted_sd_m, 1e-6)
    counted = histogram(crossings.difference_m)
    beams = check.beams
    overall = None if beams is None else beams.overall(order)
    by_line = sorted(check.by_line(order).items(), key=lambda one: -one[1].rms_m)
    return CrossoversView(
        version=found.version,
        order=order,
        lines=len(lines),
        length_km=check.length_m / 1000.0,
        crosslines=int(check.is_crossline.sum()),
        crosslines_km=check.crosslines_m / 1000.0,
        crosslines_pct=100.0 * check.crosslines_m / max(check.length_m, 1e-9),
        statistics=None if statistics is None else AgreementView(**asdict(statistics)),
        at_crosslines=None if at_crosslines is None else AgreementView(**asdict(at_crosslines)),
        normalised_rms=float(np.sqrt(np.mean(normalised**2))) if len(normalised) else None,
        by_vehicles=[
            VehiclesAgreementView(vehicles=pair, **asdict(one)) for pair, one in check.by_vehicles(order).items()
        ],
        by_line=[
            LineAgreementView(
                vehicle=check.names[lines.vehicle[line]],
                line=int(lines.number[line]),
                crossline=bool(check.is_crossline[line]),
                start_s=float(lines.start_s[line]),
                length_m=float(lines.length_m[line]),
                heading_deg=float(np.degrees(lines.heading_rad[line])),
                **asdict(one),
            )
            for line, one in by_line[:MOST_LINES]
        ],
        lines_left_off=max(len(by_line) - MOST_LINES, 0),
        beams=None if overall is None else AngleAgreementView(**asdict(overall)),
        by_angle=[] if beams is None else [AngleAgreementView(**asdict(one)) for one in beams.by_angle(order)],
        histogram=HistogramView(edges_m=counted.edges_m.tolist(), counts=list(counted.counts)),
        outliers=int(check.outliers(order).sum()),
        left_off=max(len(crossings) - MOST_FEATURES, 0),
        features=_features(check, snapshot, order),
    )


def _features(check: SurveyCheck, snapshot: MapSnapshot, order: Order) -> CrossingFeaturesView:
    rows = check.worst_first(order)[:MOST_FEATURES]
    found, lines = check.crossings.take(rows), check.lines
    lat, lon = snapshot.facts.frame.to_geographic(found.east_m, found.north_m)
    allowed = within(found.difference_m, found.mean_depth_m, order)
    outliers = check.outliers(order)[rows]
    features = []
    for k in range(len(found)):
        (first, second), place = found.line[k].tolist(), (round(float(lon[k]), 8), round(float(lat[k]), 8))
        crossing = CrossingView(
            number=k + 1,
            vehicles=(check.names[lines.vehicle[first]], check.names[lines.vehicle[second]]),
            lines=(int(lines.number[first]), int(lines.number[second])),
            times_s=tuple(found.time_s[k].tolist()),
            depths_m=tuple(found.depth_m[k].tolist()),
            difference_m=float(found.difference_m[k]),
            predicted_sd_m=float(found.predicted_sd_m[k]),
            angle_deg=float(np.degrees(found.angle_rad[k])),
            within=bool(allowed[k]),
            outlier=bool(outliers[k]),
            lat_deg=place[1],
            lon_deg=place[0],
        )
        point = PointView(type="Point", coordinates=place)
        features.append(CrossingFeatureView(type="Feature", properties=crossing, geometry=point))
    return CrossingFeaturesView(type="FeatureCollection", features=features)
