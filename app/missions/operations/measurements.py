"""Measurements that vehicles post: judged one by one, stored together, each batch once."""

import asyncio
import hashlib
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import partial

import numpy as np
import orjson
from sqlalchemy.ext.asyncio import AsyncSession

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.clock import now
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.interface import (
    BeamGeometry,
    PingReport,
    Position,
    RangeReport,
    SoundingReport,
    SoundSpeedReport,
    VehicleReport,
)
from app.missions.large_batches import each_of, made_of
from app.missions.live.mission import LiveMission
from app.missions.pings.store import BEAMS_PER_ITEM, JudgedBatch
from app.missions.soundings.gate import impossible_coordinates, impossible_place
from app.missions.soundings.measurement import Measurement
from app.missions.spec.vehicle import Sensor
from app.missions.states import MissionState
from app.missions.targets.filters import Arrived
from app.missions.team import Member
from app.missions.views.measurements.soundings import BatchVerdict, ItemVerdict, Verdict, batch_verdict
from app.storage.concurrency.group_commit import Grouped
from app.storage.models import BatchRow
from app.storage.queries import soundings as sounding_queries
from app.storage.queries.soundings import LOG_KEY
from imc_bridge.nodes.plausibility import ALLOWANCE_M
from imc_bridge.telemetry.soundings import Beam, StateSample, footprint

MAX_BATCH = 10_000
MAX_BATCH_BEAMS = 300_000

KEYS_KEPT = timedelta(days=1)
"""For so long the answer to an idempotency key is given again."""
LOOK_AT_KEYS_S = 3600.0

_Answer = tuple[str, BatchVerdict]
"""The digest of a batch, and what was answered."""


async def measure(
    live: LiveMission,
    items: Sequence[Measurement],
    *,
    idempotency_key: str | None = None,
    sender: str = "",
) -> BatchVerdict:
    """Take in measurements; what is counted accepted is stored for good when this returns.

    Idempotency keys are the ``sender``'s own: what others sent under the same key has nothing to do with his.

    Raises
    ------
    ConflictError
        When the mission is a draft, or the idempotency key came before with other content.
    """
    if live.header.state is MissionState.DRAFT:
        raise ConflictError("the mission is a draft and takes no measurements yet", "add a vehicle to it first")
    if len(items) > MAX_BATCH:
        raise InvalidRequestError("items", f"{len(items)} items are too many", f"send at most {MAX_BATCH} at once")
    beams = sum(len(item.beams.angles_deg) for item in items if item.beams is not None)
    if beams > MAX_BATCH_BEAMS:
        raise InvalidRequestError("items", f"{beams} beams are too many", f"send at most {MAX_BATCH_BEAMS} at once")
    work = range(len(items) + beams // BEAMS_PER_ITEM)
    digest, refusals, reports, pings = await made_of(work, _looked_through, live, items)
    ranges = _ranges(live, items, refusals)
    key = _Key.of(sender, idempotency_key) if idempotency_key is not None else None
    batch = _Batch(items, key, digest, refusals, reports, pings, ranges)
    return await live.part(_Intake).group(batch)


def _looked_through(
    live: LiveMission, items: Sequence[Measurement]
) -> tuple[str, dict[int, str], dict[int, SoundingReport], "_Pings"]:
    """Return what a batch is known by, and by item why it is refused, its sounding, and its pings; changes nothing."""
    # Batches without what came later to measurements are known by what they were known by before.
    dumped = [
        item.model_dump(exclude={n for n in ("beams", "sound_speed_mps") if getattr(item, n) is None}) for item in items
    ]
    digest = hashlib.sha256(orjson.dumps(dumped)).hexdigest()
    near = _all_near(items, live.frame)
    refusals = {i: _refusal(live, item, near=near) for i, item in enumerate(items)}
    reports = {i: report for i, item in enumerate(items) if not refusals[i] and (report := _sounding(item))}
    pings = {i: ping for i, item in enumerate(items) if not refusals[i] and (ping := _ping(item))}
    judged = live.pings.judge_here(list(pings.values()))
    return digest, refusals, reports, _Pings(list(pings), judged)


@dataclass(frozen=True)
class _Key:
    """An idempotency key as its sender knows it, as it is stored, and as it was before keys had owners, if that."""

    given: str
    stored: str
    before: str | None

    @classmethod
    def of(cls, sender: str, key: str) -> "_Key":
        if not sender:
            return cls(key, key, None)
        owner = hashlib.sha256(sender.encode()).hexdigest()[:32]
        # A log's keys are nobody's who sends measurements.
        return cls(key, f"{owner}:{key}", None if key.startswith(LOG_KEY) else key)


@dataclass(frozen=True)
class _Pings:
    """The pings of a batch as the gate judges them, and which of its items they are."""

    items: Sequence[int]
    judged: JudgedBatch


@dataclass(frozen=True)
class _Batch:
    """A batch that was looked through: by item why it is refused, its sounding, its ping, its range to a target."""

    items: Sequence[Measurement]
    key: _Key | None
    digest: str
    refusals: Mapping[int, str]
    reports: Mapping[int, SoundingReport]
    pings: _Pings
    ranges: Mapping[int, Arrived]

    @property
    def known(self) -> dict[int, Measurement]:
        """The items that are not refused."""
        return {i: item for i, item in enumerate(self.items) if not self.refusals[i]}


class _Intake:
    """One mission's batches on their way to the disk."""

    def __init__(self, live: LiveMission) -> None:
        self._live = live
        self._keys_looked_at_s = -math.inf
        self.group: Grouped[_Batch, BatchVerdict] = Grouped(self._take, lambda batch: bool(batch.ranges))

    async def _take(self, batches: Sequence[_Batch]) -> list[BatchVerdict | Exception]:
        """Store batches in one transaction: many vehicles that post at the same time wait for the disk once.

        It raises only where nothing was stored.
        """
        live = self._live
        keys = {name for batch in batches if batch.key for name in (batch.key.stored, batch.key.before) if name}
        async with live.journal.writing, live.ranges.writing, live.database.writing() as session:
            rows = await sounding_queries.answers_to(session, live.id, keys)
            known = _answers(batches, {row.key: (row.digest, BatchVerdict.model_validate(row.answer)) for row in rows})
            fresh = _first_of_each(batches, known)
            doubts = {i: await _doubts(live, batches[i]) for i in fresh}
            stored, committed = await _store(live, [batches[i] for i in fresh], list(doubts.values()), session)
            await self._forget_old_keys(session)
        for work in committed:
            work()
        answers = dict(zip(fresh, stored, strict=True))
        known |= {key.stored: (batches[i].digest, answers[i]) for i in fresh if (key := batches[i].key) is not None}
        results: list[BatchVerdict | Exception] = [
            answers.get(i) or _again(batch, known) for i, batch in enumerate(batches)
        ]
        try:
            for i, (batch, result) in enumerate(zip(batches, results, strict=True)):
                if isinstance(result, BatchVerdict):
                    # The first answer may have got lost together with the process that knew where the vehicle is.
                    await _hear(live, batch, doubts.get(i, {}), only_unknown=result.replayed)
            # Where the vehicle is, and whether it arrived, is on disk as well before it is answered.
            await live.journal.flush()
            await live.sound_speeds.flush()
        except Exception as error:
            # The batches are stored: each sender hears of it and asks again; done alone they would be duplicates.
            return [error for _ in batches]
        return results

    async def _forget_old_keys(self, session: AsyncSession) -> None:
        """Once an hour forget keys that nobody sends again; a sounding is known without them, too."""
        moment = asyncio.get_running_loop().time()
        if moment - self._keys_looked_at_s >= LOOK_AT_KEYS_S:
            self._keys_looked_at_s = moment
            await sounding_queries.forget_answers(session, self._live.id, now() - KEYS_KEPT, LOG_KEY)


def _answers(batches: Sequence[_Batch], rows: Mapping[str, _Answer]) -> dict[str, _Answer]:
    """Return the answers given to the batches' keys.

    One that was stored before keys had owners is the answer to the same content, whoever sends it again; other content
    under that key is another sender's.
    """
    found = {}
    for batch in batches:
        if batch.key is None:
            continue
        own, before = rows.get(batch.key.stored), rows.get(batch.key.before or "")
        if own is not None:
            found[batch.key.stored] = own
        elif before is not None and before[0] == batch.digest:
            found[batch.key.stored] = before
    return found


def _first_of_each(batches: Sequence[_Batch], known: Collection[str]) -> list[int]:
    """Return which batches are to be stored: those without a key, and the first of every key that is not known."""
    seen = set(known)
    found = []
    for i, batch in enumerate(batches):
        if batch.key is None or batch.key.stored not in seen:
            found.append(i)
        if batch.key is not None:
            seen.add(batch.key.stored)
    return found


def _again(batch: _Batch, known: Mapping[str, _Answer]) -> BatchVerdict | ConflictError:
    """Return the answer to a batch whose key came before: the first one's, if it is the same batch."""
    key = batch.key or _Key.of("", "")
    digest, first = known[key.stored]
    if digest == batch.digest:
        return first.model_copy(update={"replayed": True})
    return ConflictError(
        f"idempotency key {key.given!r} was used before with other measurements", "use a new key for every new batch"
    )


async def _doubts(live: LiveMission, batch: _Batch) -> dict[int, str]:
    """Return by item why its vehicle cannot be where it says; its place may be true whatever else is wrong with it."""
    doubts = {i: reason for i, item in batch.known.items() if (reason := _impossible_depth(item))}
    links = {name: live.hub.polled.get(_member(live, name).spec.kind) for name in _names(batch)}

    def judge(i: int) -> None:
        item = batch.items[i]
        link = links[item.vehicle]
        if link is not None and (reason := link.doubt(_vehicle_report(item))) and not _is_at_work(live, item):
            doubts[i] = reason

    can_be = (i for i in batch.known if i not in doubts)
    await each_of(sorted(can_be, key=lambda i: batch.items[i].time_s), judge)
    return doubts


def _is_at_work(live: LiveMission, item: Measurement) -> bool:
    """Tell whether a vehicle is near the area or where it was sent, and not much deeper than it may go.

    Nothing speaks against that, wherever it was before: some tell only where they come to, without the way there.
    """
    east, north = map(float, live.frame.to_local(item.lat_deg, item.lon_deg))
    if item.depth_m > live.spec.limits.max_depth_m + ALLOWANCE_M:
        return False
    target_m = _member(live, item.vehicle).target_m
    if target_m is not None and math.dist((east, north), target_m) <= live.spec.arrival_radius_m + ALLOWANCE_M:
        return True
    return not live.gate.outside(east, north)


async def _store(
    live: LiveMission, batches: Sequence[_Batch], doubts: Sequence[Mapping[int, str]], session: AsyncSession
) -> tuple[list[BatchVerdict], list[Callable[[], None]]]:
    """Store batches that are new; returns their answers, and what is done once they are committed."""
    reports = [report for batch in batches for report in batch.reports.values()]
    on_reports, counted = await live.journal.take(reports, session)
    on_pings, pinged = await live.journal.take_pings([b.pings.judged for b in batches if b.pings.items], session)
    verdicts, ping_verdicts, then, answers = iter(on_reports), iter(on_pings), [counted, pinged], []
    for batch, refused in zip(batches, doubts, strict=True):
        taken = {i: next(verdicts) for i in batch.reports} | {i: next(ping_verdicts) for i in batch.pings.items}
        if batch.ranges:
            on_ranges, used = await live.ranges.take(list(batch.ranges.values()), session)
            taken |= dict(zip(batch.ranges, on_ranges, strict=True))
            then.append(used)
        reasons = {**batch.refusals, **refused}
        answers.append(await made_of(batch.items, _batch_verdict, len(batch.items), taken, reasons))
    moment = now()
    written = [await made_of(answer.items, partial(answer.model_dump, mode="json")) for answer in answers]
    session.add_all(
        BatchRow(
            mission_id=live.id,
            key=batch.key.stored,
            digest=batch.digest,
            answer=answer,
            created_at=moment,
        )
        for batch, answer in zip(batches, written, strict=True)
        if batch.key is not None
    )
    return answers, then


async def _hear(live: LiveMission, batch: _Batch, doubts: Mapping[int, str], *, only_unknown: bool = False) -> None:
    """Tell the links where vehicles are; ``only_unknown``: of those only whose place they do not know."""
    links = {}
    for name in _names(batch):
        member = _member(live, name)
        link = live.hub.polled.get(member.spec.kind)
        if link is not None and not (only_unknown and live.hub.info(member.key).report is not None):
            links[name] = link
    if only_unknown and links:
        doubts = await _doubts(live, batch)
    fresh = [item for i, item in batch.known.items() if item.vehicle in links and i not in doubts]
    reports = await made_of(fresh, _vehicle_reports, fresh)
    await each_of(reports, lambda report: links[report.vehicle].heard(report))
    if not only_unknown:
        await each_of(fresh, partial(_note_sound_speed, live))


def _note_sound_speed(live: LiveMission, item: Measurement) -> None:
    if item.sound_speed_mps is not None:
        place = Position(item.lat_deg, item.lon_deg, item.depth_m)
        report = SoundSpeedReport(item.vehicle, item.time_s, place, item.sound_speed_mps, "rest")
        live.sound_speeds.note(report, posted=True)


def _names(batch: _Batch) -> set[str]:
    return {item.vehicle for item in batch.known.values()}


def _member(live: LiveMission, name: str) -> Member:
    # One that left meanwhile was still heard.
    return live.team.get(name) or live.team.departed[name]


def _impossible_depth(item: Measurement) -> str:
    return impossible_place(item.lat_deg, item.lon_deg, item.depth_m).removeprefix("vehicle_")


def _refusal(live: LiveMission, item: Measurement, *, near: bool) -> str:
    member = live.team.get(item.vehicle)
    if member is None:
        return f"vehicle: {item.vehicle!r} takes no part in this mission"
    if member.spec.kind not in live.hub.polled:
        polled = " or ".join(live.hub.polled)
        words = f"is of kind {member.spec.kind}; only vehicles of kind {polled} post measurements"
        return f"vehicle: {item.vehicle!r} {words}"
    if item.beams is not None and member.spec.sensor is not Sensor.MULTIBEAM:
        words = f"has sensor {member.spec.sensor}; only vehicles with sensor {Sensor.MULTIBEAM} send pings"
        return f"beams: {item.vehicle!r} {words}"
    if not near and (reason := _impossible_place(item, live.frame)):
        return reason
    if item.target is not None and (reason := _impossible_depth(item)):
        return reason
    return _useless_range(item, live)


def _useless_range(item: Measurement, live: LiveMission) -> str:
    if item.target is None:
        return ""
    return live.ranges.tracking.stranger(item.target) or live.ranges.not_yet(item.time_s)


def _ranges(live: LiveMission, items: Sequence[Measurement], refusals: Mapping[int, str]) -> dict[int, Arrived]:
    """Return the ranges to targets by their item; each is as old as its vehicle's newest item says."""
    newest: dict[str, float] = {}
    for item in items:
        newest[item.vehicle] = max(newest.get(item.vehicle, -math.inf), item.time_s)
    return {
        i: live.ranges.posted(
            RangeReport(
                vehicle=item.vehicle,
                time_s=item.time_s,
                target=item.target,
                range_m=item.target_range_m,
                position=Position(item.lat_deg, item.lon_deg, item.depth_m),
                source="rest",
                position_sd_m=item.position_sd_m,
            ),
            newest[item.vehicle],
        )
        for i, item in enumerate(items)
        if item.target is not None and item.target_range_m is not None and not refusals[i]
    }


def _all_near(items: Sequence[Measurement], frame: LocalFrame) -> bool:
    """Tell whether every place is possible: at once, which costs far less than one by one."""
    if any(impossible_coordinates(item.lat_deg, item.lon_deg) for item in items):
        return False
    try:
        frame.to_local([item.lat_deg for item in items], [item.lon_deg for item in items])
    except ValueError:
        return False
    return True


def _impossible_place(item: Measurement, frame: LocalFrame) -> str:
    if reason := impossible_coordinates(item.lat_deg, item.lon_deg):
        return reason
    try:
        frame.to_local(item.lat_deg, item.lon_deg)
    except ValueError as error:
        return f"lat_deg, lon_deg: {error}"
    return ""


def _sounding(item: Measurement) -> SoundingReport | None:
    if item.range_m is None:
        return None
    place, geometry = _footprint(item, item.range_m)
    return SoundingReport(
        vehicle=item.vehicle,
        time_s=item.time_s,
        footprint=place,
        vehicle_depth_m=item.depth_m,
        range_m=item.range_m,
        source="rest",
        beam=item.beam,
        depth_sd_m=item.range_sd_m,
        position_sd_m=item.position_sd_m,
        beam_geometry=geometry,
    )


def _ping(item: Measurement) -> PingReport | None:
    if item.beams is None or item.heading_deg is None:
        return None
    with np.errstate(over="ignore"):  # a range that is too large is none
        ranges = np.array(item.beams.ranges_m, dtype=float).astype(np.float32)
    return PingReport(
        vehicle=item.vehicle,
        time_s=item.time_s,
        position=Position(item.lat_deg, item.lon_deg, item.depth_m),
        roll_rad=math.radians(item.roll_deg),
        pitch_rad=math.radians(item.pitch_deg),
        heading_rad=math.radians(item.heading_deg),
        angles_rad=np.radians(item.beams.angles_deg).astype(np.float32),
        ranges_m=ranges,
        source="rest",
        position_sd_m=item.position_sd_m,
    )


def _footprint(item: Measurement, range_m: float) -> tuple[Position, BeamGeometry]:
    """Return where a beam met the bottom, and how it pointed."""
    if item.beam_off_nadir_deg is None or item.heading_deg is None:
        below = Position(item.lat_deg, item.lon_deg, item.depth_m + range_m)
        attitude = () if item.heading_deg is None else (item.roll_deg, item.pitch_deg, item.heading_deg)
        return below, BeamGeometry(item.lat_deg, item.lon_deg, *attitude)
    state = StateSample(
        item.time_s,
        math.radians(item.lat_deg),
        math.radians(item.lon_deg),
        item.depth_m,
        math.radians(item.roll_deg),
        math.radians(item.pitch_deg),
        math.radians(item.heading_deg),
    )
    beam = Beam(item.beam, math.radians(item.beam_azimuth_deg), math.radians(item.beam_off_nadir_deg))
    geometry = BeamGeometry(
        item.lat_deg,
        item.lon_deg,
        item.roll_deg,
        item.pitch_deg,
        item.heading_deg,
        item.beam_azimuth_deg,
        item.beam_off_nadir_deg,
    )
    return Position(*footprint(state, beam, range_m)), geometry


def _vehicle_reports(items: Sequence[Measurement]) -> list[VehicleReport]:
    """Return what items tell of their vehicles, in the order of their times; beams of one time make one report."""
    found: dict[tuple[str, float], VehicleReport] = {}
    for item in sorted(items, key=lambda item: item.time_s):
        report = _vehicle_report(item)
        other = found.get((item.vehicle, item.time_s))
        if other is not None:
            heights = [one.altitude_m for one in (other, report) if one.altitude_m is not None]
            report = replace(report, altitude_m=min(heights, default=None))
        found[item.vehicle, item.time_s] = report
    return list(found.values())


def _altitude_m(item: Measurement) -> float | None:
    """Return how far below a vehicle its beam met the bottom; None where it has none, or none that looks down."""
    if item.range_m is None:
        return None
    below_m = _footprint(item, item.range_m)[0].depth_m - item.depth_m
    return below_m if below_m > 0.0 else None


def _vehicle_report(item: Measurement) -> VehicleReport:
    return VehicleReport(
        vehicle=item.vehicle,
        time_s=item.time_s,
        position=Position(item.lat_deg, item.lon_deg, item.depth_m),
        heading_rad=None if item.heading_deg is None else math.radians(item.heading_deg),
        speed_mps=item.speed_mps,
        altitude_m=_altitude_m(item),
        battery_pct=item.battery_pct,
        position_sd_m=item.position_sd_m,
    )


def _batch_verdict(count: int, taken: Mapping[int, ItemVerdict], refusals: Mapping[int, str]) -> BatchVerdict:
    items = []
    for index in range(count):
        if index in taken:
            items.append(taken[index].model_copy(update={"index": index}))
        elif refusals[index]:
            items.append(ItemVerdict(index=index, verdict=Verdict.REJECTED, reason=refusals[index]))
        else:
            items.append(ItemVerdict(index=index, verdict=Verdict.ACCEPTED, reason="position report"))
    return batch_verdict(items)
