"""A vehicle's own log into a mission: in batches, each written once however often the import is begun anew."""

import asyncio
import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from pydantic import TypeAdapter, ValidationError
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.clock import now
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.interface import PingReport, SoundingReport, VehicleReport
from app.missions.fleet.links.imc import bridge_settings
from app.missions.large_batches import made_of
from app.missions.live.journals.journal import position_row
from app.missions.live.mission import LiveMission
from app.missions.operations.imports.log_batches import LogBatch, LogBatches, LogFacts, Near, Report
from app.missions.operations.imports.multibeam_log import is_multibeam
from app.missions.settings import ServiceSettings
from app.missions.spec.base import Name
from app.missions.views.measurements.measured_casts import shown_casts
from app.missions.views.measurements.soundings import LogImportView, Verdict
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.models import BatchRow, LogRow
from app.storage.queries import logs as log_queries
from app.storage.queries import missions as mission_queries
from app.storage.queries import soundings as sounding_queries
from app.storage.queries.soundings import LOG_KEY

HASH_BLOCK_BYTES = 1 << 20

SOUNDINGS, PINGS = "soundings", "pings"
"""What a batch is of, as keys have it."""

NAME: TypeAdapter[str] = TypeAdapter(Name)

Progress = Callable[[int, int], None]
"""Told how many bytes of the file are done, and how many it has."""


@dataclass(frozen=True)
class LogHead:
    """What is known of a log before it is read.

    Attributes
    ----------
    file
        Its name.
    digest
        SHA-256 of the file, in hexadecimal digits.
    content
        SHA-256 of what is in it, unpacked: the same log is known by that.
    """

    file: str
    digest: str
    vehicle: str
    size_bytes: int
    content: str


class LogSource(Protocol):
    """Where the batches of a log come from."""

    async def next(self) -> LogBatch | None:
        """Return the next batch; None when there is none. Raises InvalidRequestError of a damaged log."""
        ...

    def facts(self) -> LogFacts:
        """Return what the log turned out to be; after the last batch."""
        ...


class _ReadHere:
    """Batches that threads of this process read."""

    def __init__(self, batches: LogBatches) -> None:
        self._batches: Iterator[LogBatch] = iter(batches)
        self.facts = batches.facts

    async def next(self) -> LogBatch | None:
        return await asyncio.to_thread(next, self._batches, None)


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
    InvalidRequestError, ConflictError
        When the file is no log of a vehicle, or does not tell which one's; when it is there as another vehicle's.
    """
    check_log(live, path.name, vehicle)
    digest, batches = await asyncio.to_thread(_opened, live, settings, path, vehicle)
    content = batches.unpacked_sha256 or digest
    head = LogHead(path.name, digest, batches.vehicle, batches.size_bytes, content)
    return await LogImport(live, settings, head, _ReadHere(batches)).run(actor=actor, progress=progress)


def check_log(live: LiveMission, name: str, vehicle: str | None) -> None:
    """Refuse what cannot be imported whatever is in the file. Raises InvalidRequestError."""
    if vehicle is not None:
        _check_name(vehicle)
    if is_multibeam(name) and live.spec.sound_speed is not None:
        raise InvalidRequestError(
            "sound_speed",
            f"{name} has depths with the sound speed applied, and the mission's profile would be applied again",
            f"take that away first: DELETE /api/v1/missions/{live.id}/sound-speed",
        )
    if is_multibeam(name) and vehicle is not None and vehicle in live.gate.corrections.mounted_vehicles:
        raise InvalidRequestError(
            "vehicle",
            f"{name} has its beams placed with the mounting that the multibeam was given, and {vehicle}'s mounting in "
            "the mission would be applied again",
            f"set that to nothing first, PUT {{}} to /api/v1/missions/{live.id}/mountings/{vehicle}, or give the file "
            "another vehicle's name",
        )


def near(live: LiveMission) -> Near:
    """Return where a log's track and pings are of use to a mission."""
    corners = [(float(east), float(north)) for east, north in live.area]
    return Near(live.frame.origin_lat_deg, live.frame.origin_lon_deg, corners, live.margin_m)


class LogImport:
    """The import of one log into one mission.

    A batch is a transaction: its soundings, its part of the track, and the answer under a key made of the log's number
    and the batch's. Begun again after it was killed, what has an answer is read but not written.

    Attributes
    ----------
    number
        Of the log, once something of it is stored; None for one of which an earlier version stored something.

    Raises
    ------
    InvalidRequestError
        When the log's vehicle has no name that can be used.
    """

    def __init__(self, live: LiveMission, settings: ServiceSettings, head: LogHead, source: LogSource) -> None:
        self._live = live
        self._head = head
        self._source = source
        _check_name(head.vehicle)
        self._altimeter = str(settings.imc.altimeter)
        self.number: int | None = None
        self._earlier_key = ""
        """What its keys begin with where an earlier version stored the begin of it."""
        # A gate of its own: the log may lie hours before or after what the vehicle sends now.
        self._gate = live.corrections.make_gate()
        self._tally = Tally()

    async def run(self, *, actor: str, progress: Progress | None = None, import_id: str = "") -> LogImportView:
        """Read the whole log; what is counted accepted is stored for good when this returns.

        Cancelled, it ends between two batches. ``import_id``: under which it is listed. Raises ConflictError where the
        same file is there as another vehicle's.
        """
        await self._look()
        while (batch := await self._source.next()) is not None:
            pings = [report for report in batch.reports if isinstance(report, PingReport)]
            await to_the_end(self._write_pings(pings) if pings else self._write(batch.reports))
            if progress is not None:
                progress(batch.read_bytes, self._head.size_bytes)
        if progress is not None:
            progress(self._head.size_bytes, self._head.size_bytes)
        view = self._view(self._source.facts())
        if not self._tally.was_known:
            also = f" and {view.pings} pings" if view.pings else ""
            await self._live.journal.log(
                Level.INFO,
                "import",
                f"{view.soundings} soundings{also} from {view.file}, the log of {view.vehicle}",
                actor=actor,
                sha256=self._head.digest,
                **({"import_id": import_id} if import_id else {}),
                **({} if self.number is None else {"log": self.number}),
                **view.model_dump(mode="json"),
            )
        return view

    async def _look(self) -> None:
        """Look what is stored of the log.

        No content is taken as two vehicles': soundings are known again by vehicle and time. Raises ConflictError.
        """
        head = self._head
        async with self._live.database.reading() as session:
            rows = await log_queries.of_content(session, self._live.id, head.content)
            earlier = [
                (digest, batch)
                for digest in sorted({head.digest, head.content})
                for batch in await log_queries.earlier_batches(session, self._live.id, digest)
            ]
        self.number = self._standing(rows, {_vehicle_of(batch) for _, batch in earlier})
        for digest, batch in earlier:
            begin = f"{LOG_KEY}-{digest[:32]}-{self._altimeter}-{head.vehicle}"
            if self.number is None and batch.key in (f"{begin}-0", f"{begin}-pings-0"):
                self._earlier_key = begin

    def _standing(self, rows: Sequence[LogRow], named: Iterable[str] = ()) -> int | None:
        """Return the number under which the content is there, if it is; ``named``: whose it is by other means.

        Raises ConflictError where it is there as another vehicle's.
        """
        standing = [row for row in rows if row.taken_back_at is None]
        others = {row.vehicle for row in standing}.union(named) - {self._head.vehicle}
        if others:
            names = ", ".join(sorted(others))
            raise ConflictError(
                f"the same file is in the mission as the log of {names}: its soundings would count twice",
                f"leave it at that, give the name that it has there: --vehicle {names}, by REST vehicle={names}, "
                f"or take it back: DELETE /api/v1/missions/{self._live.id}/logs/{{import_id}}",
            )
        return next((row.id for row in standing if row.altimeter == self._altimeter), None)

    async def _number(self, session: AsyncSession) -> int | None:
        """Return the log's number, which it gets with the first that is stored of it. Raises ConflictError."""
        live, head = self._live, self._head
        if self._earlier_key:
            return None
        # Nobody else numbers one, or takes one back, until the transaction ends.
        await sounding_queries.answers_to(session, live.id, ())
        if self.number is not None:
            known = await log_queries.numbered(session, live.id, self.number)
            if known is None or known.taken_back_at is not None:
                raise ConflictError("the log was taken back while it was read", "send it again to have it after all")
            return self.number
        # Another process may have begun with the same log since this one looked.
        begun = self._standing(await log_queries.of_content(session, live.id, head.content))
        if begun is not None:
            return begun
        row = LogRow(
            mission_id=live.id,
            vehicle=head.vehicle,
            digest=head.content,
            altimeter=self._altimeter,
            file=head.file,
            created_at=now(),
        )
        session.add(row)
        await session.flush()
        await log_queries.bring_back_rulings(session, row)
        return row.id

    def _key_of(self, number: int | None, what: str, count: int) -> str:
        """Return the key of a batch of soundings or pings."""
        if number is None:
            return f"{self._earlier_key}-pings-{count}" if what == PINGS else f"{self._earlier_key}-{count}"
        return f"{log_queries.number_key(number)}{what}:{count}"

    async def _write(self, batch: list[Report]) -> None:
        live, tally = self._live, self._tally
        soundings = [report for report in batch if isinstance(report, SoundingReport)]
        positions = [position_row(live.id, report) for report in batch if isinstance(report, VehicleReport)]
        for report in batch:
            tally.span(report.time_s)
        async with live.journal.writing, live.database.writing() as session:
            number = await self._number(session)
            key = self._key_of(number, SOUNDINGS, tally.batches)
            known = await sounding_queries.answer_to(session, live.id, key)
            if known is not None:
                # Read once more all the same: the gate judges jumps from one batch to the next.
                await made_of(soundings, self._gate.check, soundings)
                tally.add(known.answer, known=True)
                return
            verdicts, committed = await live.journal.take(soundings, session, gate=self._gate, log=number)
            brought = [row | {"imported": True, "log": number} for row in positions]
            await mission_queries.add_positions(session, brought)
            answer: dict[str, Any] = {
                "verdicts": Counter(str(item.verdict) for item in verdicts),
                "reasons": Counter(_general(v.reason) for v in verdicts if v.verdict is Verdict.REJECTED),
            }
            session.add(self._answer(key, answer))
        committed()
        self.number = number
        tally.add(answer, known=False)

    async def _write_pings(self, pings: list[PingReport]) -> None:
        live, tally = self._live, self._tally
        for report in pings:
            tally.span(report.time_s)
        judged = await live.pings.judge(pings)
        async with live.journal.writing, live.database.writing() as session:
            number = await self._number(session)
            key = self._key_of(number, PINGS, tally.ping_batches)
            known = await sounding_queries.answer_to(session, live.id, key)
            if known is not None:
                tally.add_pings(known.answer, known=True)
                return
            verdicts, committed = await live.journal.take_pings([judged], session, log=number)
            answer: dict[str, Any] = {
                "pings": Counter(str(item.verdict) for item in verdicts),
                "reasons": Counter(_general(v.reason) for v in verdicts if v.verdict is Verdict.REJECTED),
            }
            session.add(self._answer(key, answer))
        committed()
        self.number = number
        tally.add_pings(answer, known=False)

    def _answer(self, key: str, answer: dict[str, Any]) -> BatchRow:
        return BatchRow(mission_id=self._live.id, key=key, digest=self._head.digest, answer=answer, created_at=now())

    def _view(self, facts: LogFacts) -> LogImportView:
        tally = self._tally
        return LogImportView(
            file=self._head.file,
            vehicle=self._head.vehicle,
            soundings=tally.verdicts[Verdict.ACCEPTED],
            rejected=tally.verdicts[Verdict.REJECTED],
            duplicate=tally.verdicts[Verdict.DUPLICATE],
            pings=tally.pings[Verdict.ACCEPTED],
            pings_rejected=tally.pings[Verdict.REJECTED],
            pings_duplicate=tally.pings[Verdict.DUPLICATE],
            reasons=dict(tally.reasons),
            refused=facts.refused,
            first_s=tally.first_s,
            last_s=tally.last_s,
            packets=facts.packets,
            unreadable=facts.unreadable,
            skipped_bytes=facts.skipped_bytes,
            cut_off=facts.cut_off,
            notes=facts.notes,
            casts=shown_casts(facts.casts),
            known=tally.was_known and tally.known > 0,
        )


def _vehicle_of(batch: BatchRow) -> str:
    """Return whose log a first batch is about that has a key of an earlier version.

    Such a key has a digest, the altimeter, the vehicle and, where the batch is one of pings, that word; a vehicle may
    be called so, too.
    """
    _altimeter, _, rest = batch.key.removeprefix(f"{LOG_KEY}-").partition("-")[2].partition("-")
    return rest.removesuffix("-pings-0" if "pings" in batch.answer else "-0")


def _check_name(vehicle: str) -> None:
    try:
        NAME.validate_python(vehicle)
    except ValidationError:
        raise InvalidRequestError(
            "vehicle",
            f"{vehicle!r} is no name of a vehicle",
            "give one of letters, digits, '.', '_' and '-', at most 64: --vehicle NAME, by REST vehicle=NAME",
        ) from None


def _opened(live: LiveMission, settings: ServiceSettings, path: Path, vehicle: str | None) -> tuple[str, LogBatches]:
    """Return the digest of a file and the log in it. Raises InvalidRequestError where there is none."""
    try:
        digest = _digest(path)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InvalidRequestError("log", f"{path} cannot be read: {reason}", "give a file that can be") from None
    return digest, LogBatches(path, vehicle, bridge_settings(settings.imc, settings.time_scale), near(live))


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(HASH_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def _general(reason: str) -> str:
    """Return a reason without its figures, so that equal ones can be counted."""
    return re.sub(r"-?\d+(\.\d+)?", "…", reason)
