"""Changing a mission's corrections: every stored sounding is corrected anew from its raw values."""

import math
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import select, update
from sqlalchemy.ext.asyncio import AsyncSession

from app.mapping.readers.file_extensions import MULTIBEAM
from app.mapping.water.tide_files import TideTableError, parse_tid
from app.mapping.water.tides import TideTable
from app.mapping.water.vertical import VerticalDatum
from app.missions.clock import now
from app.missions.errors import ConflictError, InvalidRequestError, VehicleNotFoundError
from app.missions.fleet.interface import BeamGeometry, Position, SoundingReport
from app.missions.live.mission import LiveMission
from app.missions.soundings.adjustment import TrackAdjustment
from app.missions.soundings.corrections import Corrections, Tracks, no_tracks
from app.missions.soundings.gate import Gate
from app.missions.spec.base import FieldError
from app.missions.spec.mission import MissionSpec
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.spec.water import SoundSpeed, Tide
from app.missions.views.measurements.corrections import (
    CorrectionsView,
    MountingView,
    TideCorrection,
    TideTableView,
)
from app.missions.views.measurements.soundings import Ruling, Verdict
from app.missions.views.mission import Level
from app.storage.models import ImportRow, MissionRow, SoundingRow, TideTableRow
from app.storage.queries import events as event_queries
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import stored_maps
from app.storage.queries.logs import NO_LEVEL

AT_ONCE = 10_000
"""At most so many soundings are corrected and written at a time."""

NUMBERS = ("level_m", "east_m", "north_m", "depth_m")

CORRECTIONS = {"tide", "sound_speed", "systematic_errors", "mountings"}
"""Fields of a mission's description that say how soundings are corrected."""


def corrections_view(live: LiveMission) -> CorrectionsView:
    """Return a mission's corrections as they are shown."""
    table, rulings = live.gate.corrections.table, live.gate.corrections.rulings
    return CorrectionsView(
        tide=live.spec.tide,
        tide_table=table
        and TideTableView(
            name=table.name,
            first=table.first,
            last=table.last,
            entries=len(table.times_s),
            sha256=table.digest,
            utc_assumed=table.utc_assumed,
        ),
        sound_speed=live.spec.sound_speed,
        systematic_errors=live.spec.systematic_errors,
        mountings=_mountings(live),
        rejected_beams=rulings.rejected_beams,
        restored_beams=rulings.restored_beams,
        vertical_datum=live.facts.vertical_datum.statement,
        accepted=live.counts.accepted,
        rejected=live.counts.rejected,
    )


def _mountings(live: LiveMission) -> list[MountingView]:
    """Return how sonars are mounted, of the vehicles that take part, in their order, then of others by name."""
    stated, corrected = live.corrections.stated_mountings, live.spec.mountings
    names = [member.name for member in live.team]
    names += sorted((stated.keys() | corrected.keys()) - set(names))
    return [
        MountingView(vehicle=name, stated=stated.get(name, MountingSpec()), corrected=corrected.get(name))
        for name in names
    ]


async def set_tide(live: LiveMission, tide: TideCorrection, actor: str) -> CorrectionsView:
    """Change level, datum and table, or nothing when the table cannot be read (InvalidRequestError)."""
    table: TideTable | None = None
    row: TideTableRow | None = None
    if tide.table is not None:
        try:
            table = await live.in_background(partial(parse_tid, tide.table, name=tide.table_name))
        except TideTableError as error:
            raise InvalidRequestError("table", str(error), "correct that line and send the whole table again") from None
        row = TideTableRow(mission_id=live.id, name=table.name, text=tide.table)
    plain = Tide.model_validate(tide.model_dump(exclude={"table", "table_name"}))

    async def store(session: AsyncSession) -> None:
        known = await session.get(TideTableRow, live.id)
        if known is not None:
            await session.delete(known)
            await session.flush()
        if row is not None:
            session.add(row)

    async with live.correcting:
        datum, offset_m = live.gate.corrections.vertical_datum, live.spec.tide.datum_offset_m
        spec = live.spec.model_copy(update={"tide": plain})
        await recorrect(live, spec, table, live.gate.corrections.adjustment, store)
    what = f"tide table {table.name}" if table is not None else f"a constant level of {plain.level_m:+.2f} m"
    if table is not None and table.utc_assumed:
        what += ", whose times state no zone and are taken for UTC"
    await live.journal.log(Level.INFO, "corrections", f"tide corrected by {what}, set by {actor}", actor=actor)
    if (datum.epsg, offset_m) != (live.gate.corrections.vertical_datum.epsg, plain.datum_offset_m):
        await _warn_of_imports(live, datum)
    return corrections_view(live)


async def _warn_of_imports(live: LiveMission, datum: VerticalDatum) -> None:
    """Tell that what was imported is no sounding and stays where it is, now that soundings are below another datum."""
    async with live.database.reading() as session:
        named = select(ImportRow.filename).where(ImportRow.mission_id == live.id).order_by(ImportRow.created_at)
        files = (await session.scalars(named)).all()
    if not files:
        return
    words = (
        f"imported depths ({', '.join(files)}) stay as they are. Soundings were below {datum.statement}, and are below "
        f"{live.gate.corrections.vertical_datum.statement} now: import anew, with another datum offset, what is not"
    )
    await live.journal.log(Level.WARNING, "corrections", words)


async def set_sound_speed(live: LiveMission, sound_speed: SoundSpeed | None, actor: str) -> CorrectionsView:
    """Change the casts altogether; None: the sonars' own ranges are taken. Raises InvalidRequestError."""
    if sound_speed is not None:
        check_casts(live, sound_speed)
        await check_none_applied(live)
    async with live.correcting:
        await correct_by(live, live.spec.model_copy(update={"sound_speed": sound_speed}))
    words = "sound speed is not corrected" if sound_speed is None else f"sound speed: {sound_speed.statement}"
    await live.journal.log(Level.INFO, "corrections", f"{words}, set by {actor}", actor=actor)
    return corrections_view(live)


async def check_none_applied(live: LiveMission) -> None:
    """Refuse a first sound speed where a multibeam's own files were taken in, to which theirs is applied already.

    Raises InvalidRequestError.
    """
    if live.spec.sound_speed is not None:
        return
    files = sorted(await _multibeam_files(live))
    if files:
        raise InvalidRequestError(
            "profile",
            f"pings from {', '.join(files)} have the sound speed applied, and it would be applied again",
            "leave this mission without a sound speed: correct them in the multibeam's own processing",
        )


async def _multibeam_files(live: LiveMission) -> dict[str, str]:
    """Return the multibeam's own files that pings were taken in from, with the vehicle of each."""
    async with live.database.reading() as session:
        rows = await event_queries.events_of_kind(session, live.id, "import")
    return {
        row.data["file"]: row.data["vehicle"]
        for row in rows
        if row.data.get("pings")
        and row.data["file"].lower().endswith(MULTIBEAM)
        and row.data.get("log") not in live.pings.taken_back
    }


async def set_mounting(live: LiveMission, vehicle: str, mounting: MountingSpec | None, actor: str) -> CorrectionsView:
    """Change how a vehicle's sonar is mounted; None: as the vehicle states.

    Raises VehicleNotFoundError, InvalidRequestError where its beams came placed.
    """
    await check_who_sounded(live, vehicle)
    async with live.correcting:
        applied = live.corrections.stated_mountings.get(vehicle, MountingSpec()) if mounting is None else mounting
        if not applied.is_ideal:
            files = await placed_files(live, vehicle)
            if files:
                raise InvalidRequestError(
                    "mounting",
                    f"beams from {', '.join(files)} are placed with the mounting that the multibeam was given, and it "
                    "would be applied again",
                    f"leave {vehicle} without a mounting here: correct it in the multibeam's own processing, and "
                    "import its files anew into another mission",
                )
        mountings = {name: one for name, one in live.spec.mountings.items() if name != vehicle}
        if mounting is not None:
            mountings[vehicle] = mounting
        await correct_by(live, live.spec.model_copy(update={"mountings": mountings}))
    how = "as the vehicle states" if mounting is None else mounting.statement
    words = f"mounting of {vehicle}'s sonar: {how}, set by {actor}"
    await live.journal.log(Level.INFO, "corrections", words, vehicle=vehicle, actor=actor)
    return corrections_view(live)


async def check_who_sounded(live: LiveMission, vehicle: str) -> None:
    """Raise VehicleNotFoundError where a vehicle takes no part in a mission, and none of its logs was imported."""
    known = await _who_sounded(live)
    if vehicle not in known:
        who = ", ".join(sorted(known)) or "none so far"
        raise VehicleNotFoundError(f"vehicle {vehicle!r} takes no part in the mission", f"these do: {who}")


async def placed_files(live: LiveMission, vehicle: str) -> list[str]:
    """Return the multibeam's own files whose beams came placed, of one vehicle; also those that are being read."""
    stored = [file for file, own in (await _multibeam_files(live)).items() if own == vehicle]
    return sorted({*stored, *live.placed_files.being_read(vehicle)})


def check_casts(live: LiveMission, sound_speed: SoundSpeed) -> None:
    """Refuse casts that were taken nowhere near the mission's area. Raises InvalidRequestError."""
    try:
        live.spec.check_casts(sound_speed)
    except FieldError as error:
        words, _, advice = str(error).rpartition(": ")
        raise InvalidRequestError(error.field, words, advice) from None


async def set_systematic_errors(live: LiveMission, errors: SystematicErrors, actor: str) -> CorrectionsView:
    """Change what is always wrong and is taken out of every depth. Raises InvalidRequestError."""
    known = await _who_sounded(live)
    for name in errors.vehicles:
        if name not in known:
            who = ", ".join(sorted(known)) or "none so far"
            raise InvalidRequestError("vehicles", f"{name!r} takes no part in the mission", f"these do: {who}")
    async with live.correcting:
        await correct_by(live, live.spec.model_copy(update={"systematic_errors": errors}))
    words = "no systematic errors are taken out" if errors.is_empty else f"systematic errors: {_described(errors)}"
    await live.journal.log(Level.INFO, "corrections", f"{words}, set by {actor}", actor=actor)
    return corrections_view(live)


async def correct_by(live: LiveMission, spec: MissionSpec) -> None:
    """Correct soundings by what a changed description says, with tide table and adjustment as they are."""

    async def store(_session: AsyncSession) -> None:
        pass

    before = live.gate.corrections
    await recorrect(live, spec, before.table, before.adjustment, store)


async def _who_sounded(live: LiveMission) -> set[str]:
    """Return the mission's vehicles, and whose logs were imported."""
    async with live.database.reading() as session:
        sounded = await sounding_queries.vehicles_of(session, live.id)
    chunks, waiting = await live.pings.contents()
    sounded |= waiting.keys() | {chunk.vehicle for chunk in chunks}
    return {vehicle.name for vehicle in live.spec.vehicles} | {member.name for member in live.team} | sounded


def _described(errors: SystematicErrors) -> str:
    parts = []
    for name, one in errors.vehicles.items():
        wrong = [
            *([f"{one.depth_m:+.3f} m"] if one.depth_m else []),
            *([f"roll {one.roll_offset_deg:+.2f} degrees"] if one.roll_offset_deg else []),
            *([f"sound speed {one.sound_speed_mps:+.1f} m/s"] if one.sound_speed_mps else []),
        ]
        parts += [f"{name} {', '.join(wrong)}"] if wrong else []
    if errors.water_level:
        parts.append(f"water level of up to {max(abs(level) for _, level in errors.water_level):.3f} m")
    return "; ".join(parts)


def check_level_is_known(live: LiveMission) -> None:
    """Raise ConflictError when the tide table has no level for the present: every sounding would be refused."""
    table = live.gate.corrections.table
    why = table.why_not(now().timestamp()) if table is not None else ""
    if why:
        raise ConflictError(why, "send a table that covers today, or a constant level: PUT /api/v1/missions/{id}/tide")


async def recorrect(
    live: LiveMission,
    spec: MissionSpec,
    table: TideTable | None,
    adjustment: TrackAdjustment | None,
    store: Callable[[AsyncSession], Awaitable[None]],
) -> None:
    """Correct every stored sounding anew; ``store`` writes what else changes. The caller holds ``correcting``."""
    corrections = Corrections.of(spec, live.frame, table, adjustment, live.corrections.stated_mountings, None)
    async with live.journal.writing:
        # Nothing else changes soundings meanwhile. Computing may have to wait for a thread, and the database's turn is
        # for all missions, whose stops are written, too.
        changes = await _recorrected_pieces(live, corrections)
        async with live.database.writing() as session:
            for piece in changes:
                await session.execute(update(SoundingRow), piece.rows())
            mission = await session.get_one(MissionRow, live.id)
            mission.spec = mission.spec | spec.model_dump(mode="json", include=CORRECTIONS)
            await store(session)
            await session.flush()
            await stored_maps.forget(session, live.id)
            counted = await sounding_queries.counts(session, live.id)
        # Committed: from here on nothing waits until all of it holds. Who joined meanwhile has sounded nothing yet.
        corrections = Corrections.of(
            spec, live.frame, table, adjustment, live.corrections.stated_mountings, live.gate.corrections.rulings
        )
        counts = live.counts.of_soundings(counted.get("accepted", 0), counted.get("rejected", 0))
        live.recorrect(spec, corrections, counts)
    live.changed.set()
    live.publish_summary()


@dataclass(frozen=True)
class _Changed:
    """What changes in some soundings, as columns: millions of them wait in memory until all can be written.

    ``numbers`` is (n, 4): level, east, north, depth; no level is NaN. ``outcomes`` are verdict and reason, by ``which``
    (n,).
    """

    ids: NDArray[np.int64]
    numbers: NDArray[np.float64]
    which: NDArray[np.int32]
    outcomes: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, changes: Sequence[dict[str, Any]]) -> "_Changed":
        known: dict[tuple[str, str], int] = {}
        which = [known.setdefault((change["verdict"], change["reason"]), len(known)) for change in changes]
        return cls(
            np.array([change["id"] for change in changes], np.int64),
            np.array([[change[name] for name in NUMBERS] for change in changes], float),
            np.array(which, np.int32),
            tuple(known),
        )

    def rows(self) -> list[dict[str, Any]]:
        """Return what changes in each row, by its id."""
        found = []
        for number, values, which in zip(self.ids.tolist(), self.numbers.tolist(), self.which.tolist(), strict=True):
            verdict, reason = self.outcomes[which]
            change = dict(zip(NUMBERS, values, strict=True)) | {"id": number, "verdict": verdict, "reason": reason}
            if math.isnan(values[0]):
                change["level_m"] = None
            found.append(change)
        return found


async def _recorrected_pieces(live: LiveMission, corrections: Corrections) -> list[_Changed]:
    """Correct all stored soundings, so many at a time that their rows take little memory."""
    found: list[_Changed] = []
    after, tracks = 0, no_tracks()
    while True:
        async with live.database.reading() as session:
            rows = await sounding_queries.soundings_after(session, live.id, after, AT_ONCE)
        if not rows:
            return found
        after = rows[-1].id
        found.append(
            await live.in_background(lambda rows: _Changed.of(recorrected(rows, corrections, live.gate, tracks)), rows)
        )


def recorrected(
    rows: Sequence[SoundingRow], corrections: Corrections, gate: Gate, tracks: Tracks | None = None
) -> list[dict[str, Any]]:
    """Return what changes in each row, by its id; ``tracks``: where vehicles were stated to be before.

    Verdicts stay, but for soundings that had no water level and have one now, or the other way round.
    """
    changes = []
    for row, found in zip(rows, corrections.apply([report_of(row) for row in rows], tracks), strict=True):
        change: dict[str, Any] = {"id": row.id, "level_m": found.level_m, "verdict": row.verdict, "reason": row.reason}
        change |= {"east_m": found.east_m, "north_m": found.north_m, "depth_m": found.depth_m}
        if row.verdict == sounding_queries.TAKEN_BACK:
            # Whether it may count shows when its log is sent again; an operator's word on it needs a water level.
            before = "" if row.reason.startswith(NO_LEVEL) else row.reason
            change["reason"] = found.reason or before
        elif row.verdict == Verdict.ACCEPTED and found.reason:
            change |= {"verdict": Verdict.REJECTED, "reason": found.reason}
        elif row.reason.startswith(NO_LEVEL):
            outside = "" if row.ruling == Ruling.RESTORED else gate.outside(found.east_m, found.north_m)
            reason = found.reason or outside
            change |= {"verdict": Verdict.REJECTED if reason else Verdict.ACCEPTED, "reason": reason}
        changes.append(change)
    return changes


def report_of(row: SoundingRow) -> SoundingReport:
    """Return a stored sounding as it came from the vehicle."""
    geometry = BeamGeometry.where_known(
        row.vehicle_lat_deg,
        row.vehicle_lon_deg,
        row.roll_deg,
        row.pitch_deg,
        row.heading_deg,
        row.beam_azimuth_deg,
        row.beam_off_nadir_deg,
    )
    return SoundingReport(
        vehicle=row.vehicle,
        time_s=row.time_s,
        footprint=Position(row.lat_deg, row.lon_deg, row.raw_depth_m),
        vehicle_depth_m=row.vehicle_depth_m,
        range_m=row.range_m,
        source=row.source,
        beam=row.beam,
        depth_sd_m=row.sd_m,
        position_sd_m=row.position_sd_m,
        beam_geometry=geometry,
    )
