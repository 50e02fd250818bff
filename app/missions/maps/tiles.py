"""The map as it travels to browsers: whole once, then only the tiles that changed, each made once for all who ask."""

import asyncio
import json
import struct
import threading
import zlib
from collections import OrderedDict
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.mapping.layers import LAYERS, SOUNDED, VISIBLE
from app.missions.maps.live_grid import LiveCells
from app.missions.maps.snapshot import NOT_MADE, MapSnapshot

MAGIC = b"BFM1"
TILE = 32
UNKNOWN = np.int32(-(2**31))
"""Stands for a cell without a value."""

KEPT_VERSIONS = 12
KEPT_ANSWERS = 24


@dataclass(frozen=True)
class _Picture:
    """One version's layers as whole numbers, (rows, cols) each."""

    tag: str
    layers: dict[str, NDArray[np.int32]]


class TileCache:
    """Makes and keeps the answers to "what changed since". May be used from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pictures: OrderedDict[str, _Picture] = OrderedDict()
        self._answers: OrderedDict[tuple[str, str, tuple[str, ...]], bytes] = OrderedDict()
        self._making: dict[tuple[str, str, tuple[str, ...]], asyncio.Task[bytes]] = {}

    async def answer(self, snapshot: MapSnapshot, tag: str, since: str, further: tuple[str, ...] = ()) -> bytes:
        """Return what ``changes`` does, which works in a thread; all who ask the same while it works wait for one."""
        key = (tag, since, further)
        known = self._answers.get(key)
        if known is not None:
            return known
        making = self._making.get(key)
        if making is None:
            making = asyncio.create_task(asyncio.to_thread(self.changes, snapshot, tag, since, further))
            self._making[key] = making
            making.add_done_callback(lambda _: self._making.pop(key, None))
        # Whoever stops waiting does not end it for the others.
        return await asyncio.shield(making)

    def changes(self, snapshot: MapSnapshot, tag: str, since: str, further: tuple[str, ...] = ()) -> bytes:
        """Return what changed between the map that ``since`` names and this one, whole when that one is not known.

        The answer is compressed by zlib. Then: ``BFM1``, the header's length (uint32), the header (JSON), padding to
        four bytes, and for every tile in ``tiles`` and every layer in ``layers`` its cells (int32, little endian, row
        by row from the south-west, cut off at the grid's edges).
        """
        key = (tag, since, further)
        with self._lock:
            known = self._answers.get(key)
            if known is None:
                picture = self._picture(snapshot, tag, further)
                known = _encode(snapshot, picture, self._pictures.get(since), (*_base(), *further))
                self._answers[key] = known
                _shorten(self._answers, KEPT_ANSWERS)
            return known

    def _picture(self, snapshot: MapSnapshot, tag: str, further: tuple[str, ...]) -> _Picture:
        known = self._pictures.get(tag)
        if known is None or not set(further) <= known.layers.keys():
            if snapshot.live is None or snapshot.version == NOT_MADE:
                made = _layers(snapshot, further)
            else:
                considered = replace(snapshot, live=None)
                made = _with_live_cells(self._picture(considered, considered_tag(tag), further).layers, snapshot.live)
            known = _Picture(tag, made | (known.layers if known is not None else {}))
            self._pictures[tag] = known
            _shorten(self._pictures, KEPT_VERSIONS)
        return known


def _shorten(kept: OrderedDict, most: int) -> None:  # type: ignore[type-arg]
    while len(kept) > most:
        kept.popitem(last=False)


def _layers(snapshot: MapSnapshot, further: tuple[str, ...]) -> dict[str, NDArray[np.int32]]:
    source = snapshot.source()
    unknown = np.full(source.map.depth_m.shape, np.nan)
    found = {}
    for name in (*_base(), *further):
        # Where there is nothing to differ from, no cell has a value.
        values = LAYERS[name].compute(source)
        found[name] = _whole(name, unknown if values is None else values)
    return found


def _base() -> list[str]:
    return [kind.name for kind in LAYERS.values() if kind.in_every_tile]


def _scale(name: str) -> int:
    scale = LAYERS[name].scale
    if scale is None:
        raise ValueError(f"tiles do not hold the layer {name!r}")
    return scale


def considered_tag(tag: str) -> str:
    """Return the tag of the map below live cells."""
    return tag.rpartition("@")[0]


def _with_live_cells(layers: dict[str, NDArray[np.int32]], live: LiveCells) -> dict[str, NDArray[np.int32]]:
    """Return a map's layers with what was sounded since; the others stay as the map has them until it is made anew."""
    found = dict(layers)
    for name, values in (("depth", live.depth_m), ("uncertainty", live.sd_m)):
        found[name] = layers[name].copy()
        found[name][live.cells] = _whole(name, values)
    found["count"], found["flags"] = layers["count"].copy(), layers["flags"].copy()
    found["count"][live.cells] = np.maximum(found["count"][live.cells], live.count)
    flags = np.where(found["flags"][live.cells] == UNKNOWN, 0, found["flags"][live.cells])
    found["flags"][live.cells] = flags | np.where(live.count > 0, SOUNDED | VISIBLE, VISIBLE)
    return found


def _whole(name: str, values: NDArray[np.float64]) -> NDArray[np.int32]:
    known = np.isfinite(values)
    limits = np.clip(np.round(np.where(known, values * _scale(name), 0.0)), -(2**31) + 1, 2**31 - 1)
    return np.where(known, limits, float(UNKNOWN)).astype(np.int32)


def _encode(snapshot: MapSnapshot, now: _Picture, before: _Picture | None, names: tuple[str, ...]) -> bytes:
    grid = snapshot.built.map.grid
    if before is not None and not set(names) <= before.layers.keys():
        before = None
    across, down = -(-grid.cols // TILE), -(-grid.rows // TILE)
    places = [
        (slice(row * TILE, (row + 1) * TILE), slice(col * TILE, (col + 1) * TILE))
        for row in range(down)
        for col in range(across)
    ]
    tiles = [
        number
        for number, place in enumerate(places)
        if before is None or any(not np.array_equal(now.layers[n][place], before.layers[n][place]) for n in names)
    ]
    header = json.dumps(
        {
            "tag": now.tag,
            "base": before.tag if before is not None else None,
            **snapshot.header(),
            "accuracy_m": snapshot.facts.spec.accuracy_m,
            "tile": TILE,
            "tiles": tiles,
            "layers": names,
            "scales": [_scale(name) for name in names],
        }
    ).encode()
    parts = [MAGIC, struct.pack("<I", len(header)), header, b" " * (-(len(header)) % 4)]
    parts += [now.layers[name][places[number]].astype("<i4").tobytes() for number in tiles for name in names]
    return zlib.compress(b"".join(parts), level=3)
