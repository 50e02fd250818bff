"""A vehicle's own log into a mission: in batches, each written once however often the import is begun anew."""

import asyncio
import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import shapely
from pydantic import TypeAdapter, ValidationError
from shapely.geometry import Polygon

from app.mapping.coordinates.distances import horizontal_distance_m
from app.missions.clock import now
from app.missions.errors import InvalidRequestError
from app.missions.fleet.interface import PingReport, Position, SoundingReport, VehicleReport
from app.missions.fleet.links.imc import bridge_settings, ping_report, sounding_report, vehicle_report
from app.missions.live.journals.journal import TRACK_SPACING_M, position_row
from app.missions.live.mission import LiveMission
from app.missions.live.watchers.vehicles import local_place
from app.missions.operations.imports.multibeam_log import MultibeamLog, is_multibeam
from app.missions.settings import ServiceSettings
from app.missions.spec.base import Name
from app.missions.views.measurements.soundings import LogImportView, Verdict
from app.missions.views.mission import Level
from app.storage.models import BatchRow
from app.storage.queries import missions as mission_queries
from app.storage.queries import soundings as sounding_queries
from app.storage.queries.soundings import LOG_KEY
from imc_bridge import Sounding, StateReport, SwathPing
from imc_bridge.logs import LogError, VehicleLog

BATCH = 1000
"""Soundings and positions of one transaction. Batches already written are known by their number: never change it."""
PING_BATCH = 500
"""Pings of one transaction, which have batches of their own; never change it either."""
HASH_BLOCK_BYTES = 1 << 20
"""Begin of the batches' keys; counts up when the same log gives other batches than before."""

NAME: TypeAdapter[str] = TypeAdapter(Name)

Report = SoundingReport | VehicleReport | PingReport
Progress = Callable[[int, int], None]
"""Told how many bytes of the file are done, and how many it has."""


@dataclass
class Tally:
    """What came of a log so far."""

    verdicts: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    pings: Counter[str] = field(default_factory=Counter)
    """Verdicts on pings."""
    batches: int = 0
    ping_batches: int = 0
    known: int = 0
    """Batches that an earlier import had written."""
    first_s: float | None = None
    last_s: float | None = None

    def add(self, answer: dict[str, Any], *, known: bool) -> None:
        """Count a batch by the answer that is stored with it."""
        self.verdicts.update(answer["verdicts"])
        self.reasons.update(answer["reasons"])
        self.batches += 1
        self.known += known

    def add_pings(self, answer: dict[str, Any], *, known: bool) -> None:
        """Count a batch of pings by the answer that is stored with it."""
        self.pings.update(answer["pings"])
        self.reasons.update(answer["reasons"])
        self.ping_batches += 1
        self.known += known

    @property
    def was_known(self) -> bool:
        """Whether earlier imports had written all there is."""
        return self.known == self.batches + self.ping_batches

    def span(self, time_s: float) -> None:
        """Note when something was measured."""
        self.first_s = time_s if self.first_s is None else min(self.first_s, time_s)
        self.last_s = time_s if self.last_s is None else max(self.last_s, time_s)


async def import_log(
    live: LiveMission,
    settings: ServiceSettings,
    path: Path,
    *,
    vehicle: str | None = None,
    actor: str,
    progress: Progress | None = None,
) -> LogImportView:
    """Take in a vehicle's own log; importing it again, also after a crash, stores nothing twice.

    Raises
    ------
    InvalidRequestError
        When the file is no log of a vehicle, or does not tell which one's.
    """
    work = await asyncio.to_thread(LogImport, live, settings, path, vehicle)
    return await work.run(actor=actor, progress=progress)


class LogImport:
    """The import of one log into one mission.

    A batch is a transaction: its soundings, its part of the track, and the answer under a key made of the file's
    digest and the batch's number. Begun again after it was killed, what has an answer is read but not written.

    Raises
    ------
    InvalidRequestError
        When the file cannot be read or holds nothing that can be used.
    """

    def __init__(self, live: LiveMission, settings: ServiceSettings, path: Path, vehicle: str | None) -> None:
        self._live = live
        try:
            self._digest = _digest(path)
            self._log = _opened(live, settings, path, vehicle)
        except LogError as error:
            raise InvalidRequestError("log", str(error), error.remedy) from None
        except OSError as error:
            reason = error.strerror or type(error).__name__
            raise InvalidRequestError("log", f"{path} cannot be read: {reason}", "give a file that can be") from None
        try:
            NAME.validate_python(self._log.vehicle)
        except ValidationError:
            raise InvalidRequestError(
                "vehicle",
                f"{self._log.vehicle!r} is no name of a vehicle",
                "give one of letters, digits, '.', '_' and '-', at most 64, with --vehicle",
            ) from None
        self._path = path
        self._key = f"{LOG_KEY}-{self._digest[:32]}-{settings.imc.altimeter}-{self._log.vehicle}"
        # A gate of its own: the log may lie hours before or after what the vehicle sends now.
        self._gate = live.make_gate()
        self._zone = Polygon(live.area).buffer(live.margin_m)
        self._tally = Tally()

    async def run(self, *, actor: str, progress: Progress | None = None) -> LogImportView:
        """Read the whole log; what is counted accepted is stored for good when this returns."""
        batches = self._batches()
        while batch := await asyncio.to_thread(next, batches, None):
            pings = [report for report in batch if isinstance(report, PingReport)]
            await (self._write_pings(pings) if pings else self._write(batch))
            if progress is not None:
                progress(self._log.file.read_bytes, self._log.file.size_bytes)
        if progress is not None:
            progress(self._log.file.size_bytes, self._log.file.size_bytes)
        view = self._view()
        if not self._tally.was_known:
            also = f" and {view.pings} pings" if view.pings else ""
            await self._live.journal.log(
                Level.INFO,
                "import",
                f"{view.soundings} soundings{also} from {view.file}, the log of {view.vehicle}",
                actor=actor,
                sha256=self._digest,
                **view.model_dump(),
            )
        return view

    def _batches(self) -> Iterator[list[Report]]:
        batch: list[Report] = []
        pings: list[Report] = []
        for report in self._reports():
            gathered, full = (pings, PING_BATCH) if isinstance(report, PingReport) else (batch, BATCH)
            gathered.append(report)
            if len(gathered) == full:
                yield gathered.copy()
                gathered.clear()
        yield from (rest for rest in (batch, pings) if rest)

    def _reports(self) -> Iterator[Report]:
        """Yield every sounding, and the track near the area thinned like that of live telemetry."""
        last: tuple[float, float] | None = None
        for event in self._log.events():
            if isinstance(event, Sounding):
                yield sounding_report(event)
            elif isinstance(event, SwathPing):
                yield ping_report(event)
            elif isinstance(event, StateReport):
                end = (event.lat_deg, event.lon_deg)
                if last is None or horizontal_distance_m(last, end) >= TRACK_SPACING_M:
                    last = end
                    report = vehicle_report(event)
                    place = local_place(self._live.frame, report.position)
                    if place is not None and shapely.contains_xy(self._zone, *place):
                        yield report

    async def _write(self, batch: list[Report]) -> None:
        live, tally = self._live, self._tally
        soundings = [report for report in batch if isinstance(report, SoundingReport)]
        positions = [
            position_row(live.id, report, imported=True) for report in batch if isinstance(report, VehicleReport)
        ]
        for report in batch:
            tally.span(report.time_s)
        key = f"{self._key}-{tally.batches}"
        async with live.journal.writing, live.database.writing() as session:
            known = await sounding_queries.answer_to(session, live.id, key)
            if known is not None:
                # Read once more all the same: the gate judges jumps from one batch to the next.
                self._gate.check(soundings)
                tally.add(known.answer, known=True)
                return
            verdicts, committed = await live.journal.take(soundings, session, gate=self._gate)
            await mission_queries.add_positions(session, positions)
            answer: dict[str, Any] = {
                "verdicts": Counter(str(item.verdict) for item in verdicts),
                "reasons": Counter(_general(v.reason) for v in verdicts if v.verdict is Verdict.REJECTED),
            }
            session.add(BatchRow(mission_id=live.id, key=key, digest=self._digest, answer=answer, created_at=now()))
        committed()
        tally.add(answer, known=False)

    async def _write_pings(self, pings: list[PingReport]) -> None:
        live, tally = self._live, self._tally
        for report in pings:
            tally.span(report.time_s)
        key = f"{self._key}-pings-{tally.ping_batches}"
        judged = await live.pings.judge(pings)
        async with live.journal.writing, live.database.writing() as session:
            known = await sounding_queries.answer_to(session, live.id, key)
            if known is not None:
                tally.add_pings(known.answer, known=True)
                return
            verdicts, committed = await live.journal.take_pings([judged], session)
            answer: dict[str, Any] = {
                "pings": Counter(str(item.verdict) for item in verdicts),
                "reasons": Counter(_general(v.reason) for v in verdicts if v.verdict is Verdict.REJECTED),
            }
            session.add(BatchRow(mission_id=live.id, key=key, digest=self._digest, answer=answer, created_at=now()))
        committed()
        tally.add_pings(answer, known=False)

    def _view(self) -> LogImportView:
        tally, file = self._tally, self._log.file
        return LogImportView(
            file=self._path.name,
            vehicle=self._log.vehicle,
            soundings=tally.verdicts[Verdict.ACCEPTED],
            rejected=tally.verdicts[Verdict.REJECTED],
            duplicate=tally.verdicts[Verdict.DUPLICATE],
            pings=tally.pings[Verdict.ACCEPTED],
            pings_rejected=tally.pings[Verdict.REJECTED],
            pings_duplicate=tally.pings[Verdict.DUPLICATE],
            reasons=dict(tally.reasons),
            refused=dict(self._log.refused),
            first_s=tally.first_s,
            last_s=tally.last_s,
            packets=file.packets,
            unreadable=self._log.faults,
            skipped_bytes=file.skipped_bytes,
            cut_off=file.cut_off,
            notes=self._log.notes if isinstance(self._log, MultibeamLog) else [],
            known=tally.was_known and tally.known > 0,
        )


def _opened(live: LiveMission, settings: ServiceSettings, path: Path, vehicle: str | None) -> VehicleLog | MultibeamLog:
    """Return the log in a file. Raises LogError, InvalidRequestError and OSError where there is none."""
    if not is_multibeam(path):
        return VehicleLog(path, bridge_settings(settings.imc, settings.time_scale), vehicle)
    if live.spec.sound_speed is not None:
        raise InvalidRequestError(
            "sound_speed",
            f"{path.name} has depths with the sound speed applied, and the mission's profile would be applied again",
            f"take that away first: DELETE /api/v1/missions/{live.id}/sound-speed",
        )
    zone = Polygon(live.area).buffer(live.margin_m)

    def near(lat_deg: float, lon_deg: float) -> bool:
        place = local_place(live.frame, Position(lat_deg, lon_deg, 0.0))
        return place is not None and bool(shapely.contains_xy(zone, *place))

    return MultibeamLog(path, vehicle, near)


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(HASH_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def _general(reason: str) -> str:
    """Return a reason without its figures, so that equal ones can be counted."""
    return re.sub(r"-?\d+(\.\d+)?", "…", reason)
