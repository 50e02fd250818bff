"""What was just sounded is in the picture at once; the considered map takes it over."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from app.mapping.gaussian import GaussianInterpolator
from app.mapping.layers import ACCURATE, SOUNDED
from app.mapping.types import BathymetricMap, Soundings
from app.missions.maps.builder import MapBuilder, make_grid
from app.missions.maps.live_grid import SHOWN_CELLS, LiveGrid
from app.missions.maps.tiles import TileCache
from tests.support.missions.maps import AREA, put_together, read, snapshot, soundings
from tests.support.missions.specs import make_spec

DEEPER = np.array([0.0, 0.0, 0.5, 0.0])


def builder_with_live_grid() -> MapBuilder:
    return MapBuilder(AREA, 1.0, 0.25, live=True)


def live_of(builder: MapBuilder) -> LiveGrid:
    assert builder.live is not None
    return builder.live


def test_a_sounding_is_there_before_any_map_is_made() -> None:
    builder = builder_with_live_grid()
    assert live_of(builder).fresh() is None
    builder.add(np.array([[10.5, 20.5, 7.0, 0.05]]))
    fresh = live_of(builder).fresh()
    assert fresh is not None
    centres = builder.grid.centres_m.reshape(30, 30, 2)[fresh.cells]
    assert (np.hypot(*(centres - [10.5, 20.5]).T) <= SHOWN_CELLS * 1.0).all()
    assert len(centres) == 9
    np.testing.assert_allclose(fresh.depth_m, 7.0)
    assert fresh.count.sum() == 1


def test_nothing_is_shown_outside_the_area_or_where_nobody_sounded() -> None:
    builder = builder_with_live_grid()
    builder.add(np.array([[0.2, 0.2, 7.0, 0.05], [400.0, 400.0, 9.0, 0.05]]))
    fresh = live_of(builder).fresh()
    assert fresh is not None
    assert fresh.cells.sum() == 4
    assert fresh.count.sum() == 1


def test_the_map_takes_over_what_it_holds() -> None:
    builder = builder_with_live_grid()
    builder.add(soundings(80))
    builder.build()
    assert live_of(builder).fresh() is None
    builder.add(np.array([[3.5, 3.5, 6.0, 0.05]]))
    fresh = live_of(builder).fresh()
    assert fresh is not None
    assert fresh.cells[3, 3]
    assert fresh.cells.sum() == 9
    builder.build()
    assert live_of(builder).fresh() is None


def test_it_is_the_interpolation_of_all_soundings_whenever_they_came() -> None:
    rows = soundings(300)
    builder = builder_with_live_grid()
    for part in np.array_split(rows, 7):
        builder.add(part)
        builder.build()
    builder.add(DEEPER + rows[:20])
    found = live_of(builder).map()
    assert found is not None
    expected = GaussianInterpolator(builder.grid, found.correlation_length_m)
    expected.add(Soundings.of_rows(np.concatenate([rows, DEEPER + rows[:20]])))
    np.testing.assert_allclose(found.depth_m, expected.to_map(builder.mask).depth_m, rtol=1e-9)
    np.testing.assert_array_equal(found.count, expected.to_map(builder.mask).count)


def test_soundings_that_took_the_place_of_others_are_the_ones_that_count() -> None:
    builder = builder_with_live_grid()
    builder.add(soundings(60))
    builder.build()
    corrected = 4 * DEEPER + soundings(60)
    builder.arrivals.replace(corrected, np.zeros((0, 4)))
    late = np.array([[15.5, 15.5, 30.0, 0.05]])
    builder.add(late)
    builder.build()
    found = live_of(builder).map()
    assert found is not None
    expected = GaussianInterpolator(builder.grid, found.correlation_length_m)
    expected.add(Soundings.of_rows(np.concatenate([corrected, late])))
    np.testing.assert_allclose(found.depth_m, expected.to_map(builder.mask).depth_m, rtol=1e-9)


def test_what_comes_while_a_map_is_made_stays_new(monkeypatch: pytest.MonkeyPatch) -> None:
    builder = builder_with_live_grid()
    builder.add(soundings(60))
    late = np.array([[3.5, 3.5, 6.0, 0.05]])
    make = MapBuilder._build

    def slow(self: MapBuilder, own: BathymetricMap | None, *, thorough: bool) -> object:
        built = make(self, own, thorough=thorough)
        self.add(late)
        return built

    monkeypatch.setattr(MapBuilder, "_build", slow)
    builder.build()
    fresh = live_of(builder).fresh()
    assert fresh is not None
    assert fresh.count.sum() >= 1
    assert fresh.cells[3, 3]
    assert fresh.cells.sum() == 9


def test_tiles_show_it_over_the_map_and_claim_nothing_by_it() -> None:
    spec = make_spec(side_m=70.0, cell_m=1.0)
    places = [(5.0 + 6 * i, 5.0 + 6 * j, 8.0 + 0.02 * i * j) for i in range(11) for j in range(11)]
    considered = snapshot(1, *places)
    live = LiveGrid(*make_grid(spec.local_area(), 1.0))
    live.note(np.array([[50.5, 2.5, 3.0, 0.05]]))
    cache = TileCache()
    _, tiles = read(cache.changes(considered, "a.1.0", ""))
    shape = considered.built.map.depth_m.shape
    whole = put_together({"cols": shape[1]}, tiles, np.zeros(shape, dtype=np.int32))
    with_live = replace(considered, live=live.fresh())
    header, tiles = read(cache.changes(with_live, f"a.{with_live.tag}", "a.1.0"))
    assert header["base"] == "a.1.0"
    assert header["tiles"] == [1]
    put_together(header, tiles, whole)
    assert whole[2, 50] == 300
    flags = tiles[1]["flags"]
    assert flags[2, 50 - 32] & SOUNDED
    before = considered.built.map.known(spec.accuracy_m)
    assert bool(flags[2, 50 - 32] & ACCURATE) == bool(before[2, 50])
    # Once the considered map is shown again, nothing is left of it.
    _, tiles = read(cache.changes(considered, "a.1.0", f"a.{with_live.tag}"))
    assert put_together({"cols": shape[1]}, tiles, whole)[2, 50] != 300


async def test_adding_while_maps_are_made_loses_nothing() -> None:
    builder = builder_with_live_grid()
    rows = soundings(400)

    async def add() -> None:
        for part in np.array_split(rows, 50):
            builder.add(part)
            await asyncio.sleep(0)

    async def build() -> None:
        for _ in range(6):
            await asyncio.to_thread(builder.build)

    await asyncio.gather(add(), build())
    found = live_of(builder).map()
    assert found is not None
    assert found.count.sum() == len(rows)
