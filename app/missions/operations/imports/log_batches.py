"""A vehicle's own log, read in batches that are the same every time; nothing is stored here."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry import Polygon

from app.mapping.coordinates.distances import horizontal_distance_m
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.water.measured_casts import MeasuredCast, SoundSpeedSamples, measured_casts
from app.missions.errors import InvalidRequestError
from app.missions.fleet.interface import PingReport, Position, SoundingReport, VehicleReport
from app.missions.fleet.links.imc import ping_report, sounding_report, vehicle_report
from app.missions.live.journals.journal import TRACK_SPACING_M
from app.missions.live.watchers.vehicles import local_place
from app.missions.operations.imports.multibeam_log import MultibeamLog, is_multibeam
from imc_bridge import Sounding, SoundSpeedSample, StateReport, SwathPing
from imc_bridge.logs import LogContent, LogError, LogEvent, VehicleLog
from imc_bridge.settings import BridgeSettings

BATCH = 1000
"""Soundings and positions of one transaction. Batches already written are known by their number: never change it."""
PING_BATCH = 500
"""Pings of one transaction, which have batches of their own; never change it either."""

MOST_SPEEDS = 200_000
"""Of one probe so many speeds of sound are kept at most, some hours at full rate; of more every second one."""

Report = SoundingReport | VehicleReport | PingReport


@dataclass(frozen=True)
class Near:
    """Where a log's track and pings are of use: a mission's area in its frame, and how far around it.

    Attributes
    ----------
    area : (n, 2)
        Corners, metres east and north of the origin.
    """

    origin_lat_deg: float
    origin_lon_deg: float
    area: Sequence[tuple[float, float]]
    margin_m: float


@dataclass(frozen=True)
class LogBatch:
    """What is written in one transaction: pings, or soundings and places of the vehicle."""

    reports: list[Report]
    read_bytes: int
    """Of the file as it lies on disk, how far reading has come."""


@dataclass(frozen=True)
class LogFacts:
    """What a log turned out to be when it was read to its end."""

    size_bytes: int
    packets: int
    skipped_bytes: int
    cut_off: bool
    refused: dict[str, int]
    unreadable: dict[str, int]
    notes: list[str]
    casts: list[MeasuredCast] = field(default_factory=list)
    """Sound speed casts that the vehicle measured."""


class _Water:
    """Sound speeds of one probe, as a bounded number of them."""

    def __init__(self) -> None:
        self.count = 0
        self._every = 1
        self._rows: list[tuple[float, float, float, float, float]] = []

    def add(self, one: SoundSpeedSample) -> None:
        """Take one in."""
        if self.count % self._every == 0:
            self._rows.append((one.time_s, one.depth_m, one.speed_mps, one.lat_deg, one.lon_deg))
            if len(self._rows) > MOST_SPEEDS:
                self._every, self._rows = 2 * self._every, self._rows[::2]
        self.count += 1

    def samples(self) -> SoundSpeedSamples:
        """Return them, or evenly some of them."""
        return SoundSpeedSamples(*np.array(self._rows, dtype=float).reshape(-1, 5).T)


class LogBatches:
    """The batches of a log, in the order of the file.

    Parameters
    ----------
    vehicle
        Its vehicle's name; None: the one that the log announces.

    Raises
    ------
    InvalidRequestError
        When the file cannot be read, is no log of a vehicle, or does not tell which one's.
    """

    def __init__(self, content: LogContent, vehicle: str | None, bridge: BridgeSettings, near: Near) -> None:
        self._water: defaultdict[str, _Water] = defaultdict(_Water)
        """By probe what it measured of the sound's speed."""
        self._frame = LocalFrame(near.origin_lat_deg, near.origin_lon_deg)
        self._zone = Polygon(near.area).buffer(near.margin_m)
        shapely.prepare(self._zone)
        try:
            self._log: VehicleLog | MultibeamLog = (
                MultibeamLog(content, vehicle, self._is_near)
                if is_multibeam(content.name)
                else VehicleLog(content, bridge, vehicle)
            )
            self.unpacked_sha256 = self._log.file.unpacked_sha256()
        except LogError as error:
            raise InvalidRequestError("log", str(error), error.remedy) from None
        except OSError as error:
            reason = error.strerror or type(error).__name__
            raise InvalidRequestError("log", f"{content} cannot be read: {reason}", "give a file that can be") from None
        self.vehicle = self._log.vehicle

    @property
    def size_bytes(self) -> int:
        """Size of the file as it lies on disk."""
        return self._log.file.size_bytes

    def facts(self) -> LogFacts:
        """Return what was found; of a log that was read to its end."""
        log, file = self._log, self._log.file
        return LogFacts(
            size_bytes=file.size_bytes,
            packets=file.packets,
            skipped_bytes=file.skipped_bytes,
            cut_off=file.cut_off,
            refused=dict(log.refused),
            unreadable=dict(log.faults),
            notes=list(log.notes) if isinstance(log, MultibeamLog) else [],
            casts=self._casts(),
        )

    def _casts(self) -> list[MeasuredCast]:
        """Return the casts of the probe that measured most."""
        most = max(self._water.values(), key=lambda water: water.count, default=None)
        return [] if most is None else measured_casts(most.samples())

    def __iter__(self) -> Iterator[LogBatch]:
        """Yield everything from the beginning."""
        batch: list[Report] = []
        pings: list[Report] = []
        for report in self._reports():
            gathered, full = (pings, PING_BATCH) if isinstance(report, PingReport) else (batch, BATCH)
            gathered.append(report)
            if len(gathered) == full:
                yield LogBatch(gathered.copy(), self._log.file.read_bytes)
                gathered.clear()
        yield from (LogBatch(rest, self._log.file.read_bytes) for rest in (batch, pings) if rest)

    def _reports(self) -> Iterator[Report]:
        """Yield every sounding, and the track near the area thinned like that of live telemetry."""
        last: tuple[float, float] | None = None
        self._water.clear()
        for event in self._events():
            if isinstance(event, Sounding):
                yield sounding_report(event)
            elif isinstance(event, SwathPing):
                yield ping_report(event)
            elif isinstance(event, SoundSpeedSample):
                self._water[event.source].add(event)
            elif isinstance(event, StateReport):
                end = (event.lat_deg, event.lon_deg)
                if last is None or horizontal_distance_m(last, end) >= TRACK_SPACING_M:
                    last = end
                    if self._is_near(*end):
                        yield vehicle_report(event)

    def _events(self) -> Iterator[LogEvent]:
        try:
            yield from self._log.events()
        except LogError as error:
            raise InvalidRequestError("log", str(error), error.remedy) from None

    def _is_near(self, lat_deg: float, lon_deg: float) -> bool:
        place = local_place(self._frame, Position(lat_deg, lon_deg, 0.0))
        return place is not None and bool(shapely.contains_xy(self._zone, *place))


@dataclass(frozen=True)
class WantedLog:
    """What is to be read of a log: under which name, as which vehicle's, and where; it can be pickled."""

    name: str
    vehicle: str | None
    bridge: BridgeSettings
    near: Near
    unconfined: bool = False
    """Whether it is read even where the system has nothing to lock the reading process in with."""


@dataclass(frozen=True)
class OpenedLog:
    """The first that is read of a log that can be used.

    Attributes
    ----------
    unpacked_sha256
        Of what the file holds, where it is compressed; else empty.
    """

    vehicle: str
    size_bytes: int
    unpacked_sha256: str = ""


@dataclass(frozen=True)
class RefusedLog:
    """Why a log cannot be used: an InvalidRequestError."""

    field: str
    message: str
    remedy: str


@dataclass(frozen=True)
class UnreadLog:
    """That a log is not read since nothing locks the process in: why, by layer."""

    confined: dict[str, str]


LogItem = OpenedLog | LogBatch | LogFacts | RefusedLog | UnreadLog


def read_log(content: LogContent, wanted: WantedLog) -> Iterator[LogItem]:
    """Yield what is in a log, one after the other: that it could be opened, batches, facts; or why it is refused."""
    try:
        batches = LogBatches(content, wanted.vehicle, wanted.bridge, wanted.near)
        yield OpenedLog(batches.vehicle, batches.size_bytes, batches.unpacked_sha256)
        yield from batches
        yield batches.facts()
    except InvalidRequestError as error:
        yield RefusedLog(error.field, str(error), error.remedy)
    except MemoryError:
        yield RefusedLog(
            "log", "reading it takes too much memory", "divide it, or import it with bathyfleet import-log"
        )
