"""A mission's map as it is asked for: the newest, the one of a step, what changed in it, and the files made of it."""

import asyncio
import errno
from collections.abc import Collection, Sequence
from dataclasses import replace

from app.compute.compute import Compute
from app.mapping.coordinates.projected import UTM
from app.mapping.products.tracks import Track, TrackPoint
from app.missions.clock import now
from app.missions.errors import InvalidRequestError, MapNotReadyError, ProductUnavailableError
from app.missions.live.mission import LiveMission
from app.missions.live.sounding_store import accepted
from app.missions.maps.builder import BuiltMap
from app.missions.maps.file_content import FileContent
from app.missions.maps.products import (
    ACCEPTED,
    CROSSOVERS,
    MAP,
    POINTS,
    RAW,
    SEARCH,
    SOUNDINGS,
    SURVEY,
    TRACKS,
    Material,
    Product,
    ProductOptions,
    SurveyTimes,
    check_options,
    frame_of,
    make_product,
    product_kind,
)
from app.missions.maps.projection import projected_frame
from app.missions.maps.snapshot import MapSnapshot
from app.missions.operations.corrections.crossovers import check_of
from app.missions.operations.maps.sounding_files import accepted_xyz, all_lines, crowdsourced, only_vehicle, point_cloud
from app.missions.operations.scans import search_of
from app.missions.running.final_maps import FinalMaps
from app.missions.settings import ProviderSettings
from app.missions.views.maps.map import FileOption
from app.missions.views.measurements.soundings import Verdict
from app.storage.queries import missions as mission_queries
from app.storage.queries import pings as ping_queries
from app.storage.queries import soundings as sounding_queries


async def newest_map(live: LiveMission, maps: FinalMaps, *, patient: bool = True) -> MapSnapshot:
    """Return the newest map. Raises MapNotReadyError when there is no sounding yet.

    Without being ``patient``: an older one, if there is one, while a newer one is being made; not where all that it
    was made of was taken back.
    """
    built = live.builder.newest
    if not patient and built is not None and maps.busy(live.id) and live.counts.any_accepted:
        return live.map.snapshot(built)
    await maps.last(live.id)
    await live.notice_imports()
    built = live.builder.newest
    if built is None or (live.map.is_missing and not (live.running and live.counts.any_accepted)):
        built = await live.map.build()
    if built is None:
        raise MapNotReadyError(
            "no sounding was accepted yet, so there is no map", "start the mission or post measurements"
        )
    return live.map.snapshot(built)


async def map_at_step(live: LiveMission, step: int) -> MapSnapshot:
    """Return the map that soundings and pings until the end of a step make.

    Raises
    ------
    InvalidRequestError, MapNotReadyError
        For a step that the mission has not begun; where nothing was sounded until then.
    """
    if step > live.header.step:
        raise InvalidRequestError(
            "step", f"{step} is none of the mission's steps yet: its last is {live.header.step}", "give an earlier one"
        )
    if live.builder.newest is None or live.builder.stale or live.builder.arrivals.at_rest:
        await live.map.build()
    found = await accepted(live.database, live.id, 0, until_step=step)
    newest = live.builder.newest
    if newest is None:
        raise MapNotReadyError("no sounding was accepted, so there is no map", "choose a later step")
    swath = live.builder.swath.empty()
    if live.counts.beams:
        async for vehicle, pings in live.pings.all_accepted(until_step=step):
            await asyncio.to_thread(swath.add, vehicle, pings)
    try:
        bathymetry = await live.map.make(live.builder.as_of, found.table, swath)
    except ValueError:
        raise MapNotReadyError(
            f"no sounding was accepted until the end of step {step}", "choose a later step"
        ) from None
    built = BuiltMap(newest.version, len(found.table), bathymetry, newest.digest)
    return live.map.snapshot_at(built, step)


async def map_tiles(
    live: LiveMission, maps: FinalMaps, run: str, since: str, further: Sequence[str] = (), step: int | None = None
) -> bytes:
    """Return what changed in the map; see ``TileCache.changes``. ``step``: the map as it was at that step's end.

    ``run`` tells this process from others, whose versions begin at 1, too.
    """
    snapshot = None
    if step is not None:
        snapshot = await map_at_step(live, step)
    elif live.running and live.counts.any_accepted:
        # Not with the planning threads, which a decision may keep for seconds.
        snapshot = await asyncio.to_thread(live.map.live_snapshot)
    if snapshot is None:
        snapshot = await newest_map(live, maps, patient=False)
    tag = f"{run}.{snapshot.tag}" + ("" if step is None else f"@{step}")
    return await live.map.tiles.answer(snapshot, tag, since, tuple(sorted(set(further))))


async def export(
    live: LiveMission,
    maps: FinalMaps,
    provider: ProviderSettings,
    compute: Compute,
    name: str,
    options: ProductOptions | None = None,
) -> Product:
    """Return a product file of the mission, a key of ``PRODUCTS``.

    Raises
    ------
    InvalidRequestError, MapNotReadyError, ConflictError
        For an unknown kind or options that cannot be; where the map is needed and there is none yet; where the
        mission would have to be a search.
    ProductUnavailableError
        When the process that makes files of large maps was ended, or the disk has no room.
    """
    kind, chosen = product_kind(name), options or ProductOptions()
    needs = kind.needs
    check_options(name, live.facts, chosen)
    if FileOption.VEHICLE in kind.options:
        chosen = replace(chosen, vehicle=await only_vehicle(live, chosen.vehicle))
    if POINTS in needs:
        chosen = replace(chosen, crs=chosen.crs or UTM)
    snapshot = await newest_map(live, maps) if {MAP, CROSSOVERS} & set(needs) else None
    material = Material(
        facts=live.facts,
        created=now(),
        provider=provider.named(),
        map=None if snapshot is None else snapshot.without_live(),
        soundings=await _sounding_file(live, provider, needs, chosen),
        tracks=await track_lines(live) if TRACKS in needs else (),
        search=search_of(live) if SEARCH in needs else None,
        surveyed=await surveyed(live) if SURVEY in needs else SurveyTimes(),
        crossovers=(await check_of(live, snapshot)).check if snapshot and CROSSOVERS in needs else None,
    )
    try:
        if snapshot is not None and snapshot.large:
            return await compute.make(make_product, name, material, chosen)
        if snapshot is None:
            # The page asks for ways again and again: they wait for no map.
            return await asyncio.to_thread(make_product, name, material, chosen)
        return await live.in_background(make_product, name, material, chosen)
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        raise ProductUnavailableError(
            f"the file cannot be made: {error.strerror}", "make room on the service's disk"
        ) from None


async def _sounding_file(
    live: LiveMission, provider: ProviderSettings, needs: Collection[str], options: ProductOptions
) -> FileContent | None:
    """Return the file of soundings that is asked for. Raises ProductUnavailableError where the disk has no room."""
    try:
        if SOUNDINGS in needs:
            return await all_lines(live)
        if ACCEPTED in needs:
            return await accepted_xyz(live, frame_of(live.facts, options))
        if POINTS in needs:
            return await point_cloud(live, projected_frame(options.crs or UTM, live.facts.spec.area, live.facts.frame))
        if RAW in needs and options.vehicle is not None:
            return await crowdsourced(live, provider.named(), options.vehicle)
    except OSError as error:
        raise ProductUnavailableError(
            f"the file cannot be kept while it is sent: {error.strerror}", "make room on the service's disk"
        ) from None
    return None


async def surveyed(live: LiveMission) -> SurveyTimes:
    """Return when a mission's soundings and pings were made."""
    await live.journal.flush()
    async with live.database.reading() as session:
        extent = await sounding_queries.extent(session, live.id, Verdict.ACCEPTED)
        period = await ping_queries.period(session, live.id, without=live.pings.taken_back)
    if extent is None:
        return SurveyTimes() if period is None else SurveyTimes(*period)
    if period is None:
        return SurveyTimes(extent.first_time_s, extent.last_time_s, extent.position_sd_m)
    return SurveyTimes(min(extent.first_time_s, period[0]), max(extent.last_time_s, period[1]))


async def track_lines(live: LiveMission) -> list[Track]:
    """Return where the vehicles were."""
    await live.journal.flush()
    async with live.database.reading() as session:
        found = await mission_queries.track_points(session, live.id)
    return [Track(name, [TrackPoint(*point) for point in points]) for name, points in found.items()]
