"""Tiles of missions' maps for web maps and GIS: made in a thread, once for all who ask, and kept while nothing changes.

A running mission's map changes with every sounding. It is looked at once a second, or less often where many different
tiles are asked for, and a tile is only made anew when what it shows did change.
"""

import asyncio
import hashlib
import threading
import time
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from app.mapping.products.tile_pictures import Words, empty_png, tile_png, tile_words, words_of
from app.mapping.web_tiles import SIDE_PX, WebTile, pixel_cells, tile_cells
from app.missions.errors import MapNotReadyError
from app.missions.live.mission import LiveMission
from app.missions.maps.snapshot import MapSnapshot
from app.missions.maps.web_layers import WEB_LAYERS, Painted, Range, halved, painted
from app.missions.operations.mission_maps import newest_map
from app.missions.running.final_maps import FinalMaps

KEPT_TILES = 4096
"""Of all missions: 40 MB where tiles are of the usual 10 KB."""
KEPT_VIEWS = 8
"""Missions whose painted layers are kept."""
KEPT_LAYERS = 12
"""Painted layers of a mission: by layer, colours and size of cells."""

SOONEST_S, LATEST_S = 1.0, 3.5
"""How soon, and how late at most, a change of the map shows."""
SHARE = 0.15
"""While more of a core than this is spent on a mission's tiles its map is looked at less often."""


@dataclass(frozen=True)
class TileRequest:
    """A tile of a mission that is asked for; ``double``: with 512 pixels along each side."""

    mission_id: str
    layer: str
    tile: WebTile
    double: bool
    range: Range

    @property
    def side_px(self) -> int:
        """Return its pixels along each side."""
        return SIDE_PX * (2 if self.double else 1)


@dataclass(frozen=True)
class TilePicture:
    """A tile as PNG; ``tag`` is that of what it shows, the same in every process and after every restart."""

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


class WebTiles:
    """The tiles of all missions of a process."""

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="tiles")
        self._tiles: OrderedDict[TileRequest, tuple[int, TilePicture]] = OrderedDict()
        self._views: OrderedDict[str, _View] = OrderedDict()
        self._looking: dict[str, asyncio.Task[_View]] = {}
        self._making: dict[tuple[TileRequest, int], asyncio.Future[TilePicture]] = {}
        self._lock = threading.Lock()
        self._number = 0

    async def tile(self, live: LiveMission, maps: FinalMaps, wanted: TileRequest) -> TilePicture:
        """Return a tile of the newest map, transparent where nothing is known."""
        view = self._views.get(live.id)
        if view is None or time.monotonic() >= view.until_s:
            view = await self._look(live, maps)
        known = self._tiles.get(wanted)
        if known is not None and known[0] == view.number:
            return known[1]
        key = wanted, view.number
        making = self._making.get(key)
        if making is None:
            loop = asyncio.get_running_loop()
            making = loop.run_in_executor(self._executor, self._make, view, wanted)
            self._making[key] = making
            making.add_done_callback(lambda _: self._making.pop(key, None))
        # Whoever stops waiting does not end it for the others.
        return await asyncio.shield(making)

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
            snapshot = await asyncio.get_running_loop().run_in_executor(self._executor, live.live_snapshot)
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

    def _make(self, view: _View, wanted: TileRequest) -> TilePicture:
        """Return a tile; the one that there was where it shows the same. In a thread."""
        began_s = time.thread_time()
        picture = self._words(view, wanted)
        before = self._tiles.get(wanted)
        if picture is None:
            content = empty_png(wanted.side_px)
            made = TilePicture(content, _digest(content))
        else:
            tag = _digest(picture.tobytes())
            same = before is not None and before[1].tag == tag
            made = before[1] if before is not None and same else TilePicture(tile_png(picture), tag)
        with self._lock:
            self._tiles[wanted] = view.number, made
            self._tiles.move_to_end(wanted)
            while len(self._tiles) > KEPT_TILES:
                self._tiles.popitem(last=False)
        view.spent_s += time.thread_time() - began_s
        return made

    def _words(self, view: _View, wanted: TileRequest) -> Words | None:
        snapshot = view.snapshot
        if snapshot is None:
            return None
        grid, frame = snapshot.built.map.grid, snapshot.facts.frame
        cells = pixel_cells(wanted.tile, wanted.side_px, grid.cell_m, frame.origin_lat_deg)
        halvings = 0
        while cells >= 2.0 and max(grid.rows, grid.cols) >> halvings > 1:
            cells, halvings = cells / 2.0, halvings + 1
        layer, words = self._layer(view, snapshot, wanted, halvings)
        found = tile_cells(wanted.tile, wanted.side_px, layer.grid, frame)
        return None if found is None else tile_words(words, found, wanted.side_px)

    def _layer(self, view: _View, snapshot: MapSnapshot, wanted: TileRequest, halvings: int) -> tuple[Painted, Words]:
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
        """Make no more tiles."""
        self._executor.shutdown(wait=True, cancel_futures=True)


def _tag(snapshot: MapSnapshot | None) -> str:
    return "" if snapshot is None else snapshot.tag


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=12).hexdigest()
