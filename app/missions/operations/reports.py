"""Reports of surveys: the answers of REST are gathered, and made into a document by a process of its own."""

import asyncio
import hashlib
import platform
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from typing import Any, TypeVar

import numpy as np
import orjson

from app import __version__
from app.arrays import FloatArray
from app.compute.compute import Compute
from app.mapping.products.tracks import Track
from app.mapping.s44 import Order
from app.missions.clock import now
from app.missions.live.mission import LiveMission
from app.missions.maps.file_content import FileContent
from app.missions.maps.products import (
    PRODUCTS,
    SWATHS,
    Material,
    Product,
    ProductOptions,
    make_product,
    product_name,
    snapshot_holidays,
)
from app.missions.maps.snapshot import MapSnapshot, quality_of
from app.missions.operations.corrections.adjustment import adjustment_view
from app.missions.operations.corrections.cast_use import casts_view
from app.missions.operations.corrections.crossovers import FoundCheck, check_of, crossovers_view
from app.missions.operations.corrections.recorrection import corrections_view
from app.missions.operations.corrections.review import soundings_page
from app.missions.operations.corrections.uncertainty_budget import budget_from, travel_depth_m
from app.missions.operations.imports.imports import imports_of, reference_of
from app.missions.operations.maps.mission_maps import newest_map, surveyed, track_lines
from app.missions.operations.maps.sounding_files import all_lines
from app.missions.operations.pings import pings_of
from app.missions.report.answers import Answers, Incident
from app.missions.report.contents import document_of
from app.missions.report.kinds import ReportKind
from app.missions.report.texts import Language, Texts
from app.missions.running.final_maps import FinalMaps
from app.missions.running.mission_views import mission_view
from app.missions.settings import ProviderSettings
from app.missions.states import AT_SEA
from app.missions.views.base import View
from app.missions.views.measurements.soundings import SoundingState
from app.missions.views.mission import Level
from app.storage.concurrency.single_flight import Shared
from app.storage.queries import events as event_queries
from app.storage.queries import soundings as sounding_queries

SUMMED = ("tif", "soundings.csv", "tracks.geojson", "crossovers.csv", "holidays.geojson")
"""Files whose checksums stand in reports: those that are quickly made, and the same each time they are."""

MOST_SOUNDINGS = 50_000
"""Files of more soundings are left out of that."""

Asked = TypeVar("Asked")
Made = TypeVar("Made")

NUMBER = re.compile(r"-?\d+(\.\d+)?([eE][+-]?\d+)?")


@dataclass(frozen=True)
class ReportOptions:
    """What may be asked of a report: its file, its language, and the order of S-44 that depths are held against."""

    kind: ReportKind
    language: Language = Language.EN
    order: Order = Order.ORDER_1A


class Reports:
    """Makes reports, one at a time, beside everything else."""

    def __init__(self, maps: FinalMaps, provider: ProviderSettings, compute: Compute) -> None:
        self._maps = maps
        self._compute = compute
        self._authority = provider.organization
        self._turn = asyncio.Lock()

    async def report(self, live: LiveMission, options: ReportOptions) -> Product:
        """Return a mission's report; who asks for the same at the same time gets the same.

        Raises
        ------
        MapNotReadyError, PingsUnreadableError
            Before anything was sounded; where a file of pings is missing.
        ProductUnavailableError
            When the process that makes reports of large maps was ended.
        """
        shared = live.part(_Asked).by_options
        if options not in shared:
            shared[options] = Shared(partial(self._made, live, options), ends_unwanted=True)
        return await shared[options]()

    async def answers(self, live: LiveMission, order: Order = Order.ORDER_1A) -> Answers:
        """Return what a mission's report is made of. Raises what :meth:`report` does."""
        return await self._apart(live, order, _answers, order)

    async def _made(self, live: LiveMission, options: ReportOptions) -> Product:
        kind = options.kind
        async with self._turn:
            content = await self._apart(live, options.order, _report, options)
        return Product(product_name(live.facts, "report", kind.extension), kind.media_type, FileContent(content))

    async def _apart(
        self, live: LiveMission, order: Order, work: "Callable[[_Gathered, Asked], Made]", asked: Asked
    ) -> Made:
        """Return what is made of all that is known of a mission."""
        snapshot = await newest_map(live, self._maps)
        if snapshot.large:
            async with self._compute.process(__name__, "matplotlib.figure") as process:
                return await process.make(work, await self._gathered(live, order, snapshot), asked)
        # Not with the planning threads: vehicles may wait for a decision.
        return await asyncio.to_thread(work, await self._gathered(live, order, snapshot), asked)

    async def _gathered(self, live: LiveMission, order: Order, snapshot: MapSnapshot) -> "_Gathered":
        found = await check_of(live, snapshot)
        period, pings, tracks = await surveyed(live), await pings_of(live), await track_lines(live)
        counts = {
            state: (await soundings_page(live, [state], limit=1)).total
            for state in (
                SoundingState.REJECTED,
                SoundingState.DOUBTED,
                SoundingState.WITHDRAWN,
                SoundingState.RESTORED,
            )
        }
        async with live.database.reading() as session:
            reasons = await sounding_queries.refusals(session, live.id)
            events = await event_queries.events_of_levels(session, live.id, (Level.WARNING, Level.ALARM))
        many = live.counts.accepted + live.counts.rejected > MOST_SOUNDINGS
        material = Material(
            facts=live.facts,
            created=now(),
            map=snapshot.without_live(),
            soundings=None if many else await all_lines(live),
            tracks=tracks,
            crossovers=found.check,
        )
        views: dict[str, View | Sequence[View] | None] = {
            "mission": mission_view(live),
            "corrections": corrections_view(live),
            "casts": await casts_view(live, order),
            "adjustment": adjustment_view(live),
            "pings": pings,
            "imports": await imports_of(live),
            "reference": None if live.map.reference_m is None else await reference_of(live),
        }
        refusals = Counter(_alike(reason) for _, reason in live.builder.doubted())
        for reason, count in reasons.items():
            refusals[_alike(reason)] += count
        rest = {
            "period": {"first_time_s": period.first_time_s, "last_time_s": period.last_time_s},
            "rejected": {str(state): count for state, count in counts.items()},
            "refusals": [{"reason": reason, "count": count} for reason, count in refusals.most_common()],
        }
        incidents = [
            Incident(
                row.time.isoformat(),
                row.level,
                row.kind,
                str(row.data.get("failsafe", "")),
                str(row.data.get("response", "")),
                row.message,
            )
            for row in events
        ]
        left_off = {"soundings.csv"} if many else set()
        return _Gathered(
            at_sea=live.header.state in AT_SEA,
            travel_m=travel_depth_m(live),
            views=views,
            rest=rest,
            found=found,
            material=material,
            incidents=incidents,
            left_off=left_off,
            authority=self._authority,
        )


class _Asked:
    """The reports of a mission that somebody asked for."""

    def __init__(self, _live: LiveMission) -> None:
        self.by_options: dict[ReportOptions, Shared[Product]] = {}


@dataclass(frozen=True)
class _Gathered:
    """All that a report is computed from."""

    at_sea: bool
    travel_m: float
    views: Mapping[str, View | Sequence[View] | None]
    rest: Mapping[str, Any]
    found: FoundCheck
    material: Material
    incidents: Sequence[Incident]
    left_off: set[str]
    authority: str


def _report(gathered: _Gathered, options: ReportOptions) -> bytes:
    return options.kind.make(document_of(_answers(gathered, options.order), Texts(options.language)))


def _answers(gathered: _Gathered, order: Order) -> Answers:
    material = gathered.material
    snapshot = material.snapshot
    views: dict[str, Any] = dict(gathered.views)
    views |= {"quality": quality_of(snapshot), "crosslines": crossovers_view(gathered.found, snapshot, order)}
    is_swath = snapshot.ensonified() is not None
    if is_swath:
        views["uncertainty_budget"] = budget_from(snapshot, gathered.travel_m)
    rest = {name: _plain(view) for name, view in views.items()} | dict(gathered.rest)
    rest |= {"map": snapshot.header() | {"corners": [list(corner) for corner in snapshot.header()["corners"]]}}
    if is_swath:
        rest["holidays"] = orjson.loads(snapshot_holidays(snapshot))
    summed = [
        name for name in SUMMED if name not in gathered.left_off and (is_swath or SWATHS not in PRODUCTS[name].needs)
    ]
    if gathered.at_sea:
        summed = []  # they are others as soon as a vehicle has measured again
    rest["files"] = [_summed(make_product(name, material, ProductOptions(order)), name) for name in summed]
    return Answers(
        rest,
        order,
        snapshot,
        made_s=int(material.created.timestamp()),
        authority=gathered.authority,
        incidents=gathered.incidents,
        tracks_m={track.vehicle: _local(snapshot, track) for track in material.tracks if track.points},
        files_left_off=sorted(gathered.left_off),
        versions=versions(),
    )


def _plain(view: View | Sequence[View] | None) -> Any:
    """Return what REST answers, as its JSON is read."""
    if view is None:
        return None
    if isinstance(view, View):
        return orjson.loads(view.model_dump_json())
    return [orjson.loads(one.model_dump_json()) for one in view]


def _summed(product: Product, name: str) -> dict[str, Any]:
    digest = hashlib.sha256()
    for piece in product.content.pieces():
        digest.update(piece)
    return {
        "format": name,
        "name": product.filename,
        "title": PRODUCTS[name].title,
        "size_bytes": product.content.size_bytes,
        "sha256": digest.hexdigest(),
    }


def _local(snapshot: MapSnapshot, track: Track) -> FloatArray:
    lat, lon = np.array([(point.lat_deg, point.lon_deg) for point in track.points]).T
    return np.column_stack(snapshot.facts.frame.to_local(lat, lon))


def _alike(reason: str) -> str:
    """Return a reason without its numbers, which are others for every sounding."""
    return NUMBER.sub("#", reason)


def versions() -> dict[str, str]:
    """Return what the survey was computed with, by name."""
    import h5py
    import pyproj
    import rasterio

    return {
        "bathyfleet": __version__,
        "Python": platform.python_version(),
        "numpy": version("numpy"),
        "scipy": version("scipy"),
        "GDAL": rasterio.__gdal_version__,
        "PROJ": pyproj.proj_version_str,
        "HDF5": h5py.version.hdf5_version,
    }
