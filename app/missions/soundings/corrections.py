"""From what a sonar reported to a place and a depth below the datum: mounting, sound speed, drift, tide, errors.

The report itself stays as it came.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.mounting import STRAIGHT, BeamVectors, Mounting, StatedTrack, displaced, mounted
from app.mapping.swath.pings import Pings, PlacedPings, placed
from app.mapping.swath.rulings import NO_RULINGS, BeamRulings
from app.mapping.water.casts import CastPlaces, Casts
from app.mapping.water.sound_speed import SoundSpeedProfile
from app.mapping.water.tides import TideTable
from app.mapping.water.vertical import INSTANTANEOUS_WATER_LEVEL, VerticalDatum
from app.missions.fleet.interface import BeamGeometry, Position, SoundingReport
from app.missions.soundings.adjustment import TrackAdjustment
from app.missions.spec.mission import MissionSpec
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.systematic_errors import InstrumentErrors, SystematicErrors
from app.missions.spec.water import Cast, SoundSpeed, Tide
from app.storage.queries.logs import NO_LEVEL
from imc_bridge.printable import printable

ASSUMED_MPS = 1500.0
"""Speed that is set in sonars where nobody says otherwise."""

NAMED_MOUNTINGS = 5
"""Mountings of more vehicles are counted in products, not described."""

_RIGHT = InstrumentErrors()

Tracks = defaultdict[str, StatedTrack]
"""By vehicle where it was stated to be, as long as one after the other is corrected."""


def no_tracks() -> Tracks:
    """Return tracks of nobody yet."""
    return defaultdict(StatedTrack)


@dataclass(frozen=True, slots=True)
class PlacedSounding:
    """A sounding in the local frame with its corrected depth, beside the report as it came.

    Attributes
    ----------
    level_m
        Water level that was subtracted, None where there is none for its time.
    reason
        Why it has no place or depth, or may not enter the map; empty when it may.
    sd_m
        Standard deviation of the depth; 0 as long as the gate has given it none.
    """

    report: SoundingReport
    east_m: float = 0.0
    north_m: float = 0.0
    depth_m: float = 0.0
    level_m: float | None = None
    reason: str = ""
    sd_m: float = 0.0

    @property
    def accepted(self) -> bool:
        """Whether it may enter the map."""
        return not self.reason


@dataclass(frozen=True)
class _Moved:
    """By how much mountings move soundings, (n, 3) each: east, north, down."""

    sonar_m: NDArray[np.float64]
    footprint_m: NDArray[np.float64]


class Placing:
    """Places the pings of a mission, each vehicle's in the order they came; threads may share it."""

    def __init__(self, corrections: "Corrections") -> None:
        self._corrections = corrections
        self._tracks = no_tracks()

    def __call__(self, vehicle: str, pings: Pings) -> PlacedPings | None:
        """Return where the beams met the bottom, depths below the datum; None where the frame has no place for them.

        Depths for whose time there is no water level are NaN.
        """
        return self._corrections.beams(vehicle, pings, self._tracks.setdefault(vehicle, StatedTrack()))


class Corrections:
    """The corrections of one mission.

    Parameters
    ----------
    tide
        A constant level; where there is a ``table`` its levels count instead.
    sound_speed
        One cast, or several with the rule by which they are chosen; None: the sonars' own ranges are taken.
    adjustment
        By how much positions were off; None: they are taken as they came.
    systematic
        What is always wrong with sonars and water levels.
    mountings
        How sonars are mounted, by vehicle.
    rulings
        What operators say of beams; None: nothing.
    """

    def __init__(
        self,
        frame: LocalFrame,
        tide: Tide,
        *,
        table: TideTable | None = None,
        sound_speed: SoundSpeed | None = None,
        adjustment: TrackAdjustment | None = None,
        systematic: SystematicErrors | None = None,
        mountings: Mapping[str, MountingSpec] | None = None,
        rulings: BeamRulings | None = None,
    ) -> None:
        self._frame = frame
        self._tide = tide
        self.table = table
        self.adjustment = adjustment
        self.casts = None if sound_speed is None else _casts(sound_speed, frame)
        self._sound_speed = sound_speed
        self._systematic = systematic or SystematicErrors()
        self._residual = np.array(self._systematic.water_level, dtype=float).reshape(-1, 2)
        self._mountings = {name: one for name, one in (mountings or {}).items() if not one.is_ideal}
        self._applied = {name: one.mounting for name, one in self._mountings.items()}
        self.rulings = rulings or NO_RULINGS
        self._assumed_mps = ASSUMED_MPS if sound_speed is None else sound_speed.assumed_mps

    @classmethod
    def of(
        cls,
        spec: MissionSpec,
        frame: LocalFrame,
        table: TideTable | None,
        adjustment: TrackAdjustment | None,
        stated: Mapping[str, MountingSpec],
        rulings: BeamRulings | None,
    ) -> "Corrections":
        """Return the corrections that a mission's description states, with its tide table and adjustment.

        ``stated``: how its vehicles say that their sonars are mounted, which the description may correct. ``rulings``:
        what operators say of beams.
        """
        return cls(
            frame,
            spec.tide,
            table=table,
            sound_speed=spec.sound_speed,
            adjustment=adjustment,
            systematic=spec.systematic_errors,
            mountings={**stated, **spec.mountings},
            rulings=rulings,
        )

    @property
    def vertical_datum(self) -> VerticalDatum:
        """Return what corrected depths are counted from."""
        tide = self._tide
        source = printable(tide.source).strip()
        sound = ""
        if self._sound_speed is not None:
            sound = f"; sound speed: {printable(self._sound_speed.statement).strip() or 'profile'}"
        sound += self._mounting_statement
        if self.table is None and not tide.is_applied:
            statement = f"instantaneous water level (tide: {source}{sound})"
            return VerticalDatum(INSTANTANEOUS_WATER_LEVEL, statement)
        if self.table is None:
            how = f"level {tide.level_m:+.2f} m (tide: {'source not stated' if tide.is_unnamed else source}"
        else:
            named = "" if tide.is_unnamed else f", {source}"
            how = f"tide table {printable(self.table.name)} (sha256 {self.table.digest[:12]}{named}"
        if tide.datum_offset_m:
            how += f"; datum offset {tide.datum_offset_m:+.3f} m"
        name = VerticalDatum(tide.datum_epsg, "").crs.name
        return VerticalDatum(tide.datum_epsg, f"EPSG:{tide.datum_epsg} {name}, by {how}{sound})")

    @property
    def mounted_vehicles(self) -> frozenset[str]:
        """Return whose sonars are not simply at the vehicle's reference point and along its axes."""
        return frozenset(self._mountings)

    @property
    def _mounting_statement(self) -> str:
        """Return in words how sonars are mounted, after what else is said; empty: none but along their vehicles."""
        found = self._mountings
        if len(found) > NAMED_MOUNTINGS:
            return f"; mountings of {len(found)} sonars corrected"
        return "".join(f"; mounting of {name}: {one.statement}" for name, one in sorted(found.items()))

    def water_level_m(self, time_s: float) -> float:
        """How high the water stands above the datum of corrected depths; the table's lowest where it has no level."""
        level = self._tide.level_m
        if self.table is not None:
            level = float(self.table.levels_at(time_s))
            if not np.isfinite(level):
                level = float(self.table.levels_m.min())
        return level + float(self._residual_m([time_s])[0]) - self._tide.datum_offset_m

    def apply(self, reports: Sequence[SoundingReport], tracks: Tracks | None = None) -> list[PlacedSounding]:
        """Return one result per report, in their order. Every number in a report is finite.

        ``tracks``: where vehicles were stated to be before; None: nothing is known of that.
        """
        if not reports:
            return []
        places = self._places([report.footprint for report in reports])
        raw = np.array([report.footprint.depth_m for report in reports])
        moved = self._moved(reports, places, no_tracks() if tracks is None else tracks)
        if moved is not None:
            raw = raw + moved.footprint_m[:, 2]
        shift, depth = self._sound_speed_corrected(reports, raw, places, moved)
        if moved is not None:
            shift = shift + moved.footprint_m[:, :2]
        if self.adjustment is not None:
            shift = shift - self.adjustment.offsets_of(reports)
        depth = depth - [self._errors_of(report.vehicle).depth_m for report in reports]
        levels = self._levels([report.time_s for report in reports])
        results = []
        for report, place, moved, bottom, level in zip(reports, places, shift, depth, levels, strict=True):
            if isinstance(place, str):
                results.append(PlacedSounding(report, reason=place))
                continue
            east, north = place[0] + float(moved[0]), place[1] + float(moved[1])
            if not np.isfinite(level):
                why = self.table.why_not(report.time_s) if self.table is not None else ""
                results.append(PlacedSounding(report, east, north, float(bottom), None, NO_LEVEL + why))
                continue
            below = float(bottom) - float(level) + self._tide.datum_offset_m
            results.append(PlacedSounding(report, east, north, below, float(level)))
        return results

    def mounted(self, vehicle: str, pings: Pings, track: StatedTrack | None = None) -> Pings:
        """Return a vehicle's pings with place and attitude of its sonar. Raises ValueError far from the frame."""
        return mounted(pings, self._applied.get(vehicle, STRAIGHT), self._frame, track)

    def placing(self) -> Placing:
        """Return what places pings one after the other, of which it remembers where vehicles were."""
        return Placing(self)

    def beams(self, vehicle: str, pings: Pings, track: StatedTrack | None = None) -> PlacedPings | None:
        """Return where the beams of a vehicle's pings met the bottom, depths below the datum.

        None where the frame has no place for them. Depths for whose time there is no water level are NaN. ``track``:
        where the vehicle was stated to be before.
        """
        try:
            pings = self.mounted(vehicle, pings, track)
            found = placed(self.steered(vehicle, pings), self._frame, self.casts)
        except ValueError:
            return None
        if self.adjustment is not None:
            off = self.adjustment.offsets(vehicle, pings.time_s)[found.ping]
            found = replace(found, east_m=found.east_m - off[:, 0], north_m=found.north_m - off[:, 1])
        levels, wrong_m = self._levels(pings.time_s), self._errors_of(vehicle).depth_m
        depth_m = found.depth_m - wrong_m - levels[found.ping] + self._tide.datum_offset_m
        met, beams = np.isfinite(pings.range_m) & np.isfinite(pings.angle_rad), pings.range_m.shape[1]
        said = [one.get(vehicle) for one in (self.rulings.rejected, self.rulings.restored)]
        rejected, restored = (None if one is None else one.among(pings.time_s, beams)[met] for one in said)
        return PlacedPings(pings, replace(found, depth_m=depth_m), rejected, restored)

    def ruled(self, rulings: BeamRulings) -> "Corrections":
        """Return the same corrections with other words of operators on beams."""
        found = copy(self)
        found.rulings = rulings
        return found

    def mounting_of(self, vehicle: str) -> Mounting:
        """Return how a vehicle's sonar is taken to be mounted."""
        return self._applied.get(vehicle, STRAIGHT)

    def shift_m(self, vehicle: str, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to the places of beams of some times (n,): east, north, down (n, 3).

        NaN where there is no water level.
        """
        shift = np.zeros((len(time_s), 3))
        if self.adjustment is not None:
            shift[:, :2] -= self.adjustment.offsets(vehicle, time_s)
        shift[:, 2] = self._tide.datum_offset_m - self._errors_of(vehicle).depth_m - self._levels(time_s)
        return shift

    def _errors_of(self, vehicle: str) -> InstrumentErrors:
        return self._systematic.vehicles.get(vehicle, _RIGHT)

    def steered(self, vehicle: str, pings: Pings) -> Pings:
        """Return a vehicle's pings whose beams point where they really did."""
        errors = self._errors_of(vehicle)
        if not errors.has_swath_errors:
            return pings
        faster = 1.0 + errors.sound_speed_mps / self._assumed_mps
        angle = np.arcsin(np.clip(np.sin(pings.angle_rad) * faster, -1.0, 1.0)) + np.radians(errors.roll_offset_deg)
        return replace(pings, angle_rad=angle.astype(pings.angle_rad.dtype))

    def _levels(self, time_s: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is subtracted from depths at some times (n,) beside the datum's offset, NaN where unknown."""
        found = np.full(len(time_s), self._tide.level_m) if self.table is None else self.table.levels_at(time_s)
        return found + self._residual_m(time_s)

    def _residual_m(self, time_s: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how much higher than the tide says the water stood at some times (n,)."""
        if not len(self._residual):
            return np.zeros(len(time_s))
        return np.asarray(np.interp(np.asarray(time_s, dtype=float), self._residual[:, 0], self._residual[:, 1]))

    def _sound_speed_corrected(
        self,
        reports: Sequence[SoundingReport],
        raw_m: NDArray[np.float64],
        places: Sequence[tuple[float, float] | str],
        moved: _Moved | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return how far each footprint moves, (n, 2) east and north, and the bottom's depth below the water level."""
        shift = np.zeros((len(reports), 2))
        if self.casts is None:
            return shift, raw_m
        sonar = np.array([report.vehicle_depth_m for report in reports])
        if moved is not None:
            sonar = sonar + moved.sonar_m[:, 2]
        down = raw_m - sonar
        slant = np.array([report.range_m for report in reports])
        # Where the sonar was is not always known; then the length of the slanted range says how far aside the beam met
        # the bottom, and only the direction is missing.
        across = np.sqrt(np.maximum(slant**2 - down**2, 0.0))
        offsets = np.array([self._offset(report, place) for report, place in zip(reports, places, strict=True)])
        if moved is not None:
            offsets = offsets + moved.footprint_m[:, :2] - moved.sonar_m[:, :2]
        seen = np.isfinite(offsets[:, 0])
        across[seen] = np.hypot(*offsets[seen].T)
        beams = down > 0.0
        depth = raw_m.copy()
        at = _columns(places)
        cast = self.casts.chosen(np.array([report.time_s for report in reports]), *at.T)
        across_true, down_true = self.casts.trace(cast[beams], sonar[beams], across[beams], down[beams])
        depth[beams] = sonar[beams] + down_true
        stretched = beams & seen & (across > 0.0)
        stretch = across_true[stretched[beams]] / across[stretched] - 1.0
        shift[stretched] = offsets[stretched] * stretch[:, None]
        return shift, depth

    def _moved(
        self, reports: Sequence[SoundingReport], places: Sequence[tuple[float, float] | str], tracks: Tracks
    ) -> _Moved | None:
        """Return by how much mountings move soundings and what they are sent from; None: nobody's sonar is off."""
        by_vehicle: defaultdict[str, list[int]] = defaultdict(list)
        for row, report in enumerate(reports):
            if report.vehicle in self._applied and not isinstance(places[row], str):
                by_vehicle[report.vehicle].append(row)
        if not by_vehicle:
            return None
        moved = _Moved(np.zeros((len(reports), 3)), np.zeros((len(reports), 3)))
        for vehicle, rows in by_vehicle.items():
            mounting = self._applied[vehicle]
            own = [reports[row] for row in rows]
            found = displaced(_vectors(own), mounting)
            moved.sonar_m[rows], moved.footprint_m[rows] = found.sonar_m, found.footprint_m
            if mounting.latency_s:
                at = _columns([places[row] for row in rows])
                from_m = np.nan_to_num([self._offset(reports[row], places[row]) for row in rows])
                vehicle_m = at - from_m
                time_s = np.array([report.time_s for report in own])
                late_m = tracks[vehicle].later(time_s, vehicle_m, mounting.latency_s) - vehicle_m
                moved.sonar_m[rows, :2] += late_m
                moved.footprint_m[rows, :2] += late_m
        return moved

    def _offset(self, report: SoundingReport, place: tuple[float, float] | str) -> tuple[float, float]:
        """Return the footprint's place from the sonar's, east and north; NaN where one of them is unknown."""
        if isinstance(place, str) or report.beam_geometry is None:
            return np.nan, np.nan
        geometry = report.beam_geometry
        try:
            east, north = self._frame.to_local(geometry.lat_deg, geometry.lon_deg)
        except ValueError:
            return np.nan, np.nan
        return place[0] - float(east), place[1] - float(north)

    def _places(self, footprints: list[Position]) -> list[tuple[float, float] | str]:
        """Return east and north of each footprint, or why it has none in the mission's frame."""
        lat, lon = (np.array([getattr(place, name) for place in footprints]) for name in ("lat_deg", "lon_deg"))
        try:
            east, north = self._frame.to_local(lat, lon)
        except ValueError as error:
            if len(footprints) == 1:
                return [f"position: {error}"]
            # One far-away place must not take the others of its batch with it.
            return [place for footprint in footprints for place in self._places([footprint])]
        return list(zip(east.tolist(), north.tolist(), strict=True))


def _columns(places: Sequence[tuple[float, float] | str]) -> NDArray[np.float64]:
    """Return places (n, 2), NaN for those that have none."""
    return np.array([(np.nan, np.nan) if isinstance(place, str) else place for place in places])


_UNKNOWN = BeamGeometry(np.nan, np.nan)


def _vectors(reports: Sequence[SoundingReport]) -> BeamVectors:
    """Return how the beams of soundings pointed."""
    geometry = [report.beam_geometry or _UNKNOWN for report in reports]

    def radians(name: str) -> NDArray[np.float64]:
        return np.asarray(np.radians(np.array([getattr(one, name) for one in geometry], dtype=float)))

    return BeamVectors(
        roll_rad=radians("roll_deg"),
        pitch_rad=radians("pitch_deg"),
        heading_rad=radians("heading_deg"),
        azimuth_rad=radians("azimuth_deg"),
        off_nadir_rad=radians("off_nadir_deg"),
        range_m=np.array([report.range_m for report in reports]),
    )


def _casts(sound_speed: SoundSpeed, frame: LocalFrame) -> Casts:
    """Return a mission's casts. Raises ValueError where one is nowhere near the frame."""
    casts = sound_speed.casts
    east, north = np.full(len(casts), np.nan), np.full(len(casts), np.nan)
    for number, cast in enumerate(casts):
        if cast.position is not None:
            lon, lat = cast.position
            east[number], north[number] = frame.to_local(lat, lon)
    times = np.array([np.nan if cast.time is None else cast.time.timestamp() for cast in casts])
    return Casts(
        [profile_of(cast, sound_speed.assumed_mps) for cast in casts],
        CastPlaces(times, east, north),
        sound_speed.rule,
        3600.0 * sound_speed.within_h,
    )


def profile_of(cast: Cast, assumed_mps: float) -> SoundSpeedProfile:
    """Return a cast's profile, for sonars with this speed set in them."""
    depths, speeds = np.array(cast.profile).T
    return SoundSpeedProfile(depths, speeds, assumed_mps)
