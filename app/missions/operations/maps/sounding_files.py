"""A mission's soundings as files, made piece by piece as they are read: however many there are, few are in memory."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from app import __version__
from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import Frame, ProjectedFrame
from app.mapping.products.crowdsourced import CrowdsourcedFile, Provider, RawSounding
from app.mapping.products.text import soundings_xyz
from app.mapping.swath.pings import Pings
from app.mapping.types import Soundings
from app.missions.clock import now
from app.missions.errors import InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.maps.file_content import FileContent
from app.missions.maps.sounding_lines import COLUMNS, header_line, sounding_lines
from app.missions.maps.swath_grid import beams_of
from app.missions.views.measurements.soundings import Verdict
from app.storage.bulk import read_in_pieces, read_numbers
from app.storage.queries import soundings as sounding_queries
from app.storage.unnamed_file import unnamed_file

RAW = ("lon_deg", "lat_deg", "raw_depth_m", "sd_m", "time_s", "position_sd_m")
"""Columns of a :class:`RawSounding`, in its order."""
SOUNDED = ("time_s", "east_m", "north_m", "depth_m", "sd_m")
"""Columns of a point of a cloud."""


async def all_lines(live: LiveMission) -> FileContent:
    """Return every sounding, rejected ones included, as CSV."""
    await live.journal.flush()
    content = FileContent(header_line(live.facts.vertical_datum.statement, _left_out(live)))
    query = sounding_queries.columns_query(live.id, COLUMNS)
    await read_in_pieces(live.database, query, lambda rows: content.add(sounding_lines(rows)))
    return content


async def accepted_xyz(live: LiveMission, frame: Frame) -> FileContent:
    """Return the accepted soundings as XYZ text: position, depth, deviation.

    Positions are eastings and northings, in a mission's own frame longitude and latitude.
    """
    await live.journal.flush()
    left_out = _left_out(live)
    content = FileContent(f"# {left_out}\n".encode() if left_out else b"")
    begin_bytes = content.size_bytes

    def take(rows: FloatArray) -> None:
        soundings = Soundings.of_rows(rows[:, :4])
        if isinstance(frame, ProjectedFrame):
            easting, northing = frame.from_local(soundings.east_m, soundings.north_m)
            soundings = replace(soundings, east_m=easting, north_m=northing)
        text = soundings_xyz(
            soundings,
            frame,
            vertical_datum=live.facts.vertical_datum.statement,
            geographic=isinstance(frame, LocalFrame),
            headed=content.size_bytes == begin_bytes,
        )
        content.add(text)

    take(np.zeros((0, 5)))  # the header, also where nothing was accepted
    await read_numbers(live.database, sounding_queries.accepted_query(live.id), take)
    return content


async def point_cloud(live: LiveMission, frame: ProjectedFrame) -> FileContent:
    """Return the accepted soundings of every sonar, the beams of swath sonars among them, as LAZ.

    Raises PingsUnreadableError.
    """
    # What writes these files takes a third of a second to import, which every start of the service would pay.
    from app.mapping.products.point_cloud import PointCloudFile

    await live.journal.flush()
    async with live.database.reading() as session:
        sounding = await sounding_queries.vehicles_of(session, live.id, Verdict.ACCEPTED)
    # Whoever sends a first ping from here on is not in it.
    until = await live.pings.newest_block()
    chunks, waiting = await live.pings.contents()
    pinging = {chunk.vehicle for chunk in chunks if chunk.log not in live.pings.taken_back}
    names = sorted(sounding | pinging | waiting.keys())
    file = unnamed_file()
    cloud = PointCloudFile(file, frame, names, live.facts.vertical_datum.statement)
    for vehicle in sorted(sounding):
        query = sounding_queries.accepted_columns_query(live.id, vehicle, SOUNDED)

        def take(rows: FloatArray, vehicle: str = vehicle) -> None:
            cloud.add(vehicle, *rows.T)

        await read_numbers(live.database, query, take)
    place, errors = live.gate.corrections.placing(), live.spec.uncertainty

    def add_beams(vehicle: str, pings: Pings) -> None:
        beams = beams_of(vehicle, pings, place, errors)
        if beams is not None:
            at = beams.footprints
            time_s = pings.time_s[at.ping]
            cloud.add(vehicle, time_s, at.east_m, at.north_m, at.depth_m, beams.sd_m, at.angle_rad)

    async for vehicle, pings in live.pings.all_accepted(until):
        await asyncio.to_thread(add_beams, vehicle, pings)
    await asyncio.to_thread(cloud.close)
    return FileContent.of_file(file)


def _left_out(live: LiveMission) -> str:
    """Return what of a mission's measurements is in no file of soundings; empty: nothing."""
    pings = live.counts.pings
    return (
        f"the beams of {pings} pings of swath sonars are not among these: see pings, or soundings.laz" if pings else ""
    )


async def crowdsourced(live: LiveMission, provider: Provider | None, vehicle: str) -> FileContent:
    """Return the raw accepted soundings of a vehicle as IHO B-12 has them.

    Raises InvalidRequestError where nobody is named who hands them in.
    """
    if provider is None:
        raise InvalidRequestError(
            "provider",
            "IHO B-12 asks who hands soundings in, and the settings do not say",
            "set provider.organization and provider.email in bathyfleet.toml",
        )
    async with live.database.reading() as session:
        uncertain = await sounding_queries.any_position_sd(session, live.id, vehicle)
    file = CrowdsourcedFile(vehicle, provider, __version__, now(), uncertain)
    content, first = FileContent(file.begin()), True

    def take(rows: Sequence[Sequence[Any]]) -> None:
        nonlocal first
        content.add(file.part((RawSounding(*row) for row in rows), first=first))
        first = False

    await read_in_pieces(live.database, sounding_queries.accepted_columns_query(live.id, vehicle, RAW), take)
    content.add(file.end())
    return content


async def only_vehicle(live: LiveMission, vehicle: str | None) -> str:
    """Return the vehicle whose soundings are meant. Raises InvalidRequestError when that is not clear."""
    await live.journal.flush()
    async with live.database.reading() as session:
        present = sorted(await sounding_queries.vehicles_of(session, live.id, Verdict.ACCEPTED))
    if vehicle is None and len(present) == 1:
        return present[0]
    if not present:
        raise InvalidRequestError(
            "vehicle", "no vehicle has an accepted sounding", "what swath sonars measured is under pings"
        )
    if vehicle not in present:
        said = "several vehicles have soundings" if vehicle is None else f"{vehicle!r} has no accepted sounding"
        raise InvalidRequestError("vehicle", said, f"name one of {', '.join(present)}")
    return vehicle
