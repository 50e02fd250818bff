"""Pictures of missions' maps for web maps and GIS: made in a thread, once for all who ask, kept while nothing changes.

A running mission's map changes with every sounding. It is looked at once a second, or less often where many different
pictures are asked for, and a picture is only made anew when what it shows did change.
"""

import asyncio
import contextlib
import hashlib
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from app.mapping.coordinates.map_windows import MapWindow, window_cells, window_pixel_cells
from app.mapping.products.pictures.tile_pictures import Words, empty_png, stacked, window_png, window_words, words_of
from app.missions.errors import MapNotReadyError
from app.missions.live.mission import LiveMission
from app.missions.maps.gis_layers import WEB_LAYERS, CellValues, Painted, Range, halved, painted, values_at
from app.missions.maps.snapshot import MapSnapshot
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.running.final_maps import FinalMaps

KEPT_PICTURES, KEPT_BYTES = 4096, 50_000_000
"""Of all missions: tiles are of 10 KB as a rule."""
KEPT_VIEWS = 8
"""Missions whose painted layers are kept."""
KEPT_LAYERS = 12
"""Painted layers of a mission: by layer, colours and size of cells."""

SOONEST_S, LATEST_S = 1.0, 3.5
"""How soon, and how late at most, a change of the map shows."""
SHARE = 0.15
"""While more of a core than this is spent on a mission's pictures its map is looked at less often."""

SMALL_PX = 512 * 512
"""Pictures of more pixels take turns, so that tiles come between them."""
LARGE_AT_ONCE = 2
STRIP_PX = 512
"""So many rows of a large picture are worked out at a time."""


@dataclass(frozen=True)
class PictureRequest:
    """A picture of a layer of a mission's map that is asked for."""

    mission_id: str
    layer: str
    range: Range
    window: MapWindow


@dataclass(frozen=True)
class MapPicture:
    """A picture as PNG; ``tag`` is that of what it shows, the same in every process and after every restart."""

    content: bytes
    tag: str


@dataclass
class _View:
    """A mission's map as it was last looked at; ``snapshot`` None: there was none."""

    snapshot: MapSnapshot | None
    number: int
    until_s: float
    began_s: float
    spent_s: float = 0.0
    layers: "OrderedDict[tuple[str, Range, int], tuple[Painted, Words]]" = field(default_factory=OrderedDict)


class MapPictures:
    """The pictures of all missions of a process."""

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="pictures")
        self._pictures: OrderedDict[PictureRequest, tuple[int, MapPicture]] = OrderedDict()
        self._bytes = 0
        self._views: OrderedDict[str, _View] = OrderedDict()
        self._looking: dict[str, asyncio.Task[_View]] = {}
        self._making: dict[tuple[PictureRequest, int], asyncio.Future[MapPicture]] = {}
        self._turns = asyncio.Semaphore(LARGE_AT_ONCE)
        self._lock = threading.Lock()
        self._number = 0

    async def picture(self, live: LiveMission, maps: FinalMaps, wanted: PictureRequest) -> MapPicture:
        """Return a picture of the newest map, transparent where nothing is known."""
        view = await self._view(live, maps)
        known = self._pictures.get(wanted)
        if known is not None and known[0] == view.number:
            return known[1]
        loop = asyncio.get_running_loop()
        if wanted.window.pixels > SMALL_PX:
            async with self._turns:
                # Whoever leaves while others have their turn is not waited for.
                return await loop.run_in_executor(self._executor, self._make, view, wanted)
        key = wanted, view.number
        making = self._making.get(key)
        if making is None:
            making = loop.run_in_executor(self._executor, self._make, view, wanted)
            self._making[key] = making
            making.add_done_callback(lambda _: self._making.pop(key, None))
        # Whoever stops waiting does not end it for the others.
        return await asyncio.shield(making)

    async def together(
        self, contents: Sequence[bytes], window: MapWindow, background: tuple[int, int, int] | None
    ) -> bytes:
        """Return pictures of a window as one, the lowest first, on a ground of red, green and blue or on none."""
        loop = asyncio.get_running_loop()
        size = window.width_px, window.height_px
        async with self._turns if window.pixels > SMALL_PX else contextlib.nullcontext():
            return await loop.run_in_executor(self._executor, stacked, contents, size, background)

    async def values(self, live: LiveMission, maps: FinalMaps, lat_deg: float, lon_deg: float) -> CellValues | None:
        """Return what the newest map knows of a place; None where it knows nothing."""
        snapshot = (await self._view(live, maps)).snapshot
        if snapshot is None:
            return None
        return await asyncio.get_running_loop().run_in_executor(self._executor, values_at, snapshot, lat_deg, lon_deg)

    async def _view(self, live: LiveMission, maps: FinalMaps) -> _View:
        view = self._views.get(live.id)
        return view if view is not None and time.monotonic() < view.until_s else await self._look(live, maps)

    async def _look(self, live: LiveMission, maps: FinalMaps) -> _View:
        looking = self._looking.get(live.id)
        if looking is None:
            looking = asyncio.create_task(self._newest(live, maps))
            self._looking[live.id] = looking
            looking.add_done_callback(lambda _: self._looking.pop(live.id, None))
        return await asyncio.shield(looking)

    async def _newest(self, live: LiveMission, maps: FinalMaps) -> _View:
        snapshot = None
        if live.running:
            snapshot = await asyncio.get_running_loop().run_in_executor(self._executor, live.map.live_snapshot)
        if snapshot is None:
            try:
                snapshot = await newest_map(live, maps, patient=False)
            except MapNotReadyError:
                snapshot = None
        view, began_s = self._views.get(live.id), time.monotonic()
        if view is None or _tag(snapshot) != _tag(view.snapshot):
            self._number += 1
            period_s = SOONEST_S
            if view is not None:
                busy = view.spent_s / max(began_s - view.began_s, SOONEST_S)
                period_s = min(max(SOONEST_S * busy / SHARE, SOONEST_S), LATEST_S)
            view = self._views[live.id] = _View(snapshot, self._number, began_s + period_s, began_s)
        else:
            view.until_s = began_s + SOONEST_S
        self._views.move_to_end(live.id)
        while len(self._views) > KEPT_VIEWS:
            self._views.popitem(last=False)
        return view

    def _make(self, view: _View, wanted: PictureRequest) -> MapPicture:
        """Return a picture; the one that there was where it shows the same. In a thread."""
        before = self._pictures.get(wanted)
        if before is not None and before[0] == view.number:
            return before[1]
        began_s = time.thread_time()
        words = self._words(view, wanted)
        if words is None:
            content = empty_png(wanted.window.width_px, wanted.window.height_px)
            made = MapPicture(content, _digest(content))
        else:
            tag = _digest(words.data)
            same = before is not None and before[1].tag == tag
            made = before[1] if before is not None and same else MapPicture(window_png(words), tag)
        with self._lock:
            self._keep(wanted, view.number, made)
        view.spent_s += time.thread_time() - began_s
        return made

    def _keep(self, wanted: PictureRequest, number: int, made: MapPicture) -> None:
        before = self._pictures.pop(wanted, None)
        self._bytes += len(made.content) - (len(before[1].content) if before is not None else 0)
        self._pictures[wanted] = number, made
        while len(self._pictures) > KEPT_PICTURES or self._bytes > KEPT_BYTES:
            self._bytes -= len(self._pictures.popitem(last=False)[1][1].content)

    def _words(self, view: _View, wanted: PictureRequest) -> Words | None:
        """Return the pixels of a picture, (height, width); None where it shows nothing."""
        snapshot, window = view.snapshot, wanted.window
        if snapshot is None:
            return None
        grid, frame = snapshot.built.map.grid, snapshot.facts.frame
        cells = window_pixel_cells(window, grid.cell_m, frame.origin_lat_deg)
        halvings = 0
        while cells >= 2.0 and max(grid.rows, grid.cols) >> halvings > 1:
            cells, halvings = cells / 2.0, halvings + 1
        layer, words = self._layer(view, snapshot, wanted, halvings)
        picture: Words | None = None
        for top in range(0, window.height_px, STRIP_PX):
            rows = min(STRIP_PX, window.height_px - top)
            found = window_cells(window.part(top, rows), layer.grid, frame)
            if found is not None:
                if picture is None:
                    picture = np.zeros((window.height_px, window.width_px), dtype=np.uint32)
                window_words(words, found, picture[top : top + rows])
        return picture

    def _layer(
        self, view: _View, snapshot: MapSnapshot, wanted: PictureRequest, halvings: int
    ) -> tuple[Painted, Words]:
        key = wanted.layer, wanted.range, halvings
        known = view.layers.get(key)
        if known is None:
            if halvings:
                layer = halved(self._layer(view, snapshot, wanted, halvings - 1)[0])
            else:
                layer = painted(snapshot, WEB_LAYERS[wanted.layer], wanted.range)
            known = view.layers[key] = layer, words_of(layer.pixels)
            while len(view.layers) > KEPT_LAYERS:
                view.layers.popitem(last=False)
        return known

    def close(self) -> None:
        """Make no more pictures."""
        self._executor.shutdown(wait=True, cancel_futures=True)


def _tag(snapshot: MapSnapshot | None) -> str:
    return "" if snapshot is None else snapshot.tag


def _digest(content: bytes | memoryview) -> str:
    return hashlib.blake2b(content, digest_size=12).hexdigest()
