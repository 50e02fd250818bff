"""The map as it travels: a reader written from the guide puts the tiles together again."""

from dataclasses import replace

import numpy as np
import pytest

from app.mapping.layers import ACCURATE, LAYERS, SOUNDED, VISIBLE, LayerKind, Palette
from app.missions.maps.builder import BuiltMap
from app.missions.maps.tiles import TILE, TileCache
from tests.support.missions.maps import SPEC, put_together, read, snapshot


def test_a_map_comes_whole_and_then_only_where_it_changed() -> None:
    places = [(5.0 + 6 * i, 5.0 + 6 * j, 8.0 + 0.02 * i * j) for i in range(11) for j in range(11)]
    cache = TileCache()
    first = snapshot(1, *places)
    header, tiles = read(cache.changes(first, "a.1", ""))
    depths = first.built.map.depth_m
    assert header["base"] is None
    assert (header["rows"], header["cols"]) == depths.shape
    whole = put_together(header, tiles, np.zeros(depths.shape, dtype=np.int32))
    np.testing.assert_allclose(whole / 100, depths, atol=0.0051)
    flags = np.concatenate([layers["flags"].ravel() for layers in tiles.values()])
    assert (flags & SOUNDED).astype(bool).sum() == first.built.map.sounded.sum()
    assert (flags & ACCURATE).astype(bool).sum() == (first.built.map.known(SPEC.accuracy_m)).sum()
    assert ((flags & VISIBLE).astype(bool) >= (flags & SOUNDED).astype(bool)).all()

    moved = first.built.map.depth_m.copy()
    moved[3, 40] += 1.0
    built = first.built
    second = replace(first, built=BuiltMap(2, built.soundings, replace(built.map, depth_m=moved), built.digest))
    header, tiles = read(cache.changes(second, "a.2", "a.1"))
    assert (header["base"], header["tiles"]) == ("a.1", [1])
    np.testing.assert_allclose(put_together(header, tiles, whole) / 100, moved, atol=0.0051)
    assert read(cache.changes(second, "a.2", "a.2"))[0]["tiles"] == []
    assert read(cache.changes(second, "a.2", "never"))[0]["base"] is None


def test_everyone_who_asks_the_same_gets_the_same_bytes_made_once() -> None:
    cache = TileCache()
    first = snapshot(1, (5, 5, 8), (30, 30, 9), (50, 20, 9))
    assert cache.changes(first, "a.1", "") is cache.changes(first, "a.1", "")


def test_a_difference_without_a_reference_grid_is_unknown_everywhere() -> None:
    header, tiles = read(TileCache().changes(snapshot(1, (5, 5, 8), (30, 30, 9)), "a.1", "", ("difference", "slope")))
    assert header["layers"][-2:] == ["difference", "slope"]
    assert {int(v) for layers in tiles.values() for v in np.unique(layers["difference"])} == {-(2**31)}


def test_a_layer_that_is_added_to_the_table_is_in_the_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    kind = LayerKind("rough", "Rough", "roughness", "1", lambda s: s.map.roughness, Palette.MATTER, scale=1000)
    monkeypatch.setitem(LAYERS, "rough", kind)
    shown = snapshot(1, (5, 5, 8), (30, 30, 9))
    header, tiles = read(TileCache().changes(shown, "a.1", "", ("rough",)))
    assert dict(zip(header["layers"], header["scales"], strict=True))["rough"] == 1000
    roughness = shown.built.map.roughness[:TILE, :TILE]
    np.testing.assert_allclose(tiles[0]["rough"] / 1000, roughness, atol=0.00051)
