"""Measurements that vehicles post: judged one by one, stored together, each batch once."""

import asyncio
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from functools import partial

import orjson
from sqlalchemy.ext.asyncio import AsyncSession

from app.mapping.georeference import LocalFrame
from app.missions.clock import now
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet import BeamGeometry, Position, RangeReport, SoundingReport, VehicleReport
from app.missions.hub import FleetHub
from app.missions.links.rest import RestFleetLink
from app.missions.live import LiveMission
from app.missions.measurement import Measurement
from app.missions.spec import VehicleKind
from app.missions.states import MissionState
from app.missions.tracking import Arrived
from app.missions.verdicts import batch_verdict
from app.missions.views import BatchVerdict, ItemVerdict, Verdict
from app.storage import soundings as sounding_queries
from app.storage.grouping import Grouped
from app.storage.models import BatchRow
from app.storage.soundings import LOG_KEY
from imc_bridge.soundings import Beam, StateSample, footprint

MAX_BATCH = 10_000

KEYS_KEPT = timedelta(days=1)
"""For so long the answer to an idempotency key is given again."""
LOOK_AT_KEYS_S = 3600.0


async def measure(
    live: LiveMission,
    hub: FleetHub,
    rest: RestFleetLink,
    items: Sequence[Measurement],
    *,
    idempotency_key: str | None = None,
) -> BatchVerdict:
    """Take in measurements; what is counted accepted is stored for good when this returns.

    Raises
    ------
    ConflictError
        When the mission is a draft, or the idempotency key came before with other content.
    """
    if live.header.state is MissionState.DRAFT:
        raise ConflictError("the mission is a draft and takes no measurements yet", "add a vehicle to it first")
    if len(items) > MAX_BATCH:
        raise InvalidRequestError("items", f"{len(items)} items are too many", f"send at most {MAX_BATCH} at once")
    digest = hashlib.sha256(orjson.dumps([item.model_dump() for item in items])).hexdigest()
    strangers = {i: _stranger(live, item) for i, item in enumerate(items)}
    reports = {i: report for i, item in enumerate(items) if not strangers[i] and (report := _sounding(item))}
    ranges = _ranges(live, items, strangers)
    batch = _Batch(items, idempotency_key, digest, strangers, reports, ranges)
    if live.intake is None:
        live.intake = Grouped(partial(_take, live, hub, rest), lambda batch: bool(batch.ranges))
    answer: BatchVerdict = await live.intake(batch)
    return answer


@dataclass(frozen=True)
class _Batch:
    """A batch that was looked through: by item why it is refused, its sounding, its range to a target."""

    items: Sequence[Measurement]
    key: str | None
    digest: str
    strangers: Mapping[int, str]
    reports: Mapping[int, SoundingReport]
    ranges: Mapping[int, Arrived]

    @property
    def known(self) -> list[Measurement]:
        return [item for i, item in enumerate(self.items) if not self.strangers[i]]


@dataclass
class _Taken:
    """What a batch came to, and what is done once that is committed."""

    answer: BatchVerdict | ConflictError
    then: list[Callable[[], None]]


async def _take(
    live: LiveMission, hub: FleetHub, rest: RestFleetLink, batches: Sequence[_Batch]
) -> list[BatchVerdict | Exception]:
    """Store batches in one transaction: many vehicles that post at the same time wait for the disk once."""
    async with live.journal.writing, live.ranges.writing, live.database.writing() as session:
        taken = [await _take_one(live, hub, rest, batch, session) for batch in batches]
        await _forget_old_keys(live, session)
    for one in taken:
        for work in one.then:
            work()
    # Where the vehicle is, and whether it arrived, is on disk as well before it is answered.
    await live.journal.flush()
    return [one.answer for one in taken]


async def _forget_old_keys(live: LiveMission, session: AsyncSession) -> None:
    """Once an hour forget keys that nobody sends again; a sounding is known without them, too."""
    moment = asyncio.get_running_loop().time()
    if moment - live.keys_looked_at_s >= LOOK_AT_KEYS_S:
        live.keys_looked_at_s = moment
        await sounding_queries.forget_answers(session, live.id, now() - KEYS_KEPT, LOG_KEY)


async def _take_one(
    live: LiveMission, hub: FleetHub, rest: RestFleetLink, batch: _Batch, session: AsyncSession
) -> _Taken:
    if batch.key is not None:
        known = await sounding_queries.answer_to(session, live.id, batch.key)
        if known is not None and known.digest != batch.digest:
            error = ConflictError(
                f"idempotency key {batch.key!r} was used before with other measurements",
                "use a new key for every new batch",
            )
            return _Taken(error, [])
        if known is not None:
            # The first answer may have got lost together with the process that knew where the vehicle is.
            hear = partial(_hear, hub, rest, batch.known, only_unknown=True)
            return _Taken(BatchVerdict.model_validate(known.answer | {"replayed": True}), [hear])
    verdicts, committed = await live.journal.take(list(batch.reports.values()), session)
    then = [committed]
    taken = dict(zip(batch.reports, verdicts, strict=True))
    if batch.ranges:
        on_ranges, used = await live.ranges.take(list(batch.ranges.values()), session)
        taken |= dict(zip(batch.ranges, on_ranges, strict=True))
        then.append(used)
    answer = _batch_verdict(len(batch.items), taken, batch.strangers)
    if batch.key is not None:
        session.add(
            BatchRow(
                mission_id=live.id,
                key=batch.key,
                digest=batch.digest,
                answer=answer.model_dump(mode="json"),
                created_at=now(),
            )
        )
    return _Taken(answer, [*then, partial(_hear, hub, rest, batch.known)])


def _hear(hub: FleetHub, rest: RestFleetLink, items: Sequence[Measurement], *, only_unknown: bool = False) -> None:
    """Tell the link where vehicles are; ``only_unknown``: of those only whose place it does not know."""
    places = {name: hub.info((VehicleKind.REST, name)).report for name in {item.vehicle for item in items}}
    for item in items:
        if not only_unknown or places[item.vehicle] is None:
            rest.heard(_vehicle_report(item))


def _stranger(live: LiveMission, item: Measurement) -> str:
    member = live.team.get(item.vehicle)
    if member is None:
        return f"vehicle: {item.vehicle!r} takes no part in this mission"
    if member.spec.kind is not VehicleKind.REST:
        return f"vehicle: {item.vehicle!r} is of kind {member.spec.kind}; only vehicles of kind rest post measurements"
    return _impossible_place(item, live.frame) or _useless_range(item, live)


def _useless_range(item: Measurement, live: LiveMission) -> str:
    if item.target is None:
        return ""
    return live.ranges.tracking.stranger(item.target) or live.ranges.not_yet(item.time_s)


def _ranges(live: LiveMission, items: Sequence[Measurement], strangers: Mapping[int, str]) -> dict[int, Arrived]:
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
        if item.target is not None and item.target_range_m is not None and not strangers[i]
    }


def _impossible_place(item: Measurement, frame: LocalFrame) -> str:
    if not -90 <= item.lat_deg <= 90:
        return f"lat_deg: {item.lat_deg} is not between -90 and 90"
    if not -180 <= item.lon_deg <= 180:
        return f"lon_deg: {item.lon_deg} is not between -180 and 180"
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


def _footprint(item: Measurement, range_m: float) -> tuple[Position, BeamGeometry]:
    """Return where a beam met the bottom, and how it pointed."""
    if item.beam_off_nadir_deg is None or item.heading_deg is None:
        below = Position(item.lat_deg, item.lon_deg, item.depth_m + range_m)
        return below, BeamGeometry(item.lat_deg, item.lon_deg)
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


def _vehicle_report(item: Measurement) -> VehicleReport:
    return VehicleReport(
        vehicle=item.vehicle,
        time_s=item.time_s,
        position=Position(item.lat_deg, item.lon_deg, item.depth_m),
        heading_rad=None if item.heading_deg is None else math.radians(item.heading_deg),
        speed_mps=item.speed_mps,
        altitude_m=item.range_m,
        battery_pct=item.battery_pct,
        position_sd_m=item.position_sd_m,
    )


def _batch_verdict(count: int, taken: Mapping[int, ItemVerdict], strangers: Mapping[int, str]) -> BatchVerdict:
    items = []
    for index in range(count):
        if index in taken:
            items.append(taken[index].model_copy(update={"index": index}))
        elif strangers[index]:
            items.append(ItemVerdict(index=index, verdict=Verdict.REJECTED, reason=strangers[index]))
        else:
            items.append(ItemVerdict(index=index, verdict=Verdict.ACCEPTED, reason="position report"))
    return batch_verdict(items)
