"""Maps of a few soundings, and a reader of their tiles written from the guide."""

import json
import struct
import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from app.missions.maps.builder import MapBuilder
from app.missions.maps.snapshot import MapSnapshot, MissionFacts
from app.missions.maps.tiles import TILE
from tests.support.missions.specs import make_spec

AREA = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 30.0], [0.0, 30.0]])


def soundings(count: int, seed: int = 0) -> np.ndarray:
    """Rows of east, north, depth, deviation over a slope."""
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(0, 30, (2, count))
    return np.column_stack([east, north, 6.0 + 0.1 * east, np.full(count, 0.05)])


def built_of(*batches: np.ndarray) -> MapBuilder:
    builder = MapBuilder(AREA, 1.0, 0.25)
    for batch in batches:
        builder.add(batch)
    builder.build()
    return builder


SPEC = make_spec(side_m=70.0, cell_m=1.0)


def snapshot(version: int, *soundings: tuple[float, float, float]) -> MapSnapshot:
    builder = MapBuilder(SPEC.local_area(), SPEC.cell_m, SPEC.accuracy_m)
    builder.add(np.array([(east, north, depth, 0.05) for east, north, depth in soundings]))
    built = builder.build()
    assert built is not None
    from app.missions.soundings.corrections import Corrections

    facts = MissionFacts("m", SPEC, SPEC.frame(), Corrections(SPEC.frame(), SPEC.tide).vertical_datum)
    return MapSnapshot(facts, replace(built, version=version), step=1)


def read(answer: bytes) -> tuple[dict[str, Any], dict[int, dict[str, np.ndarray]]]:
    content = zlib.decompress(answer)
    assert content[:4] == b"BFM1"
    (length,) = struct.unpack_from("<I", content, 4)
    header = json.loads(content[8 : 8 + length])
    at = 8 + length + -length % 4
    across = -(-header["cols"] // header["tile"])
    tiles: dict[int, dict[str, np.ndarray]] = {}
    for number in header["tiles"]:
        rows = min(header["tile"], header["rows"] - number // across * header["tile"])
        cols = min(header["tile"], header["cols"] - number % across * header["tile"])
        for name in header["layers"]:
            cells = np.frombuffer(content, "<i4", rows * cols, at).reshape(rows, cols)
            tiles.setdefault(number, {})[name] = cells
            at += 4 * rows * cols
    assert at == len(content)
    return header, tiles


def put_together(header: dict[str, Any], tiles: dict[int, dict[str, np.ndarray]], into: np.ndarray) -> np.ndarray:
    across = -(-header["cols"] // TILE)
    for number, layers in tiles.items():
        row, col = number // across * TILE, number % across * TILE
        cells = layers["depth"]
        into[row : row + cells.shape[0], col : col + cells.shape[1]] = cells
    return into
