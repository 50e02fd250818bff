"""QGIS itself opens tiles and features, and sees what changes."""

import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image

from app.missions.settings import ImcSettings
from app.settings import Settings
from tests.api.maps.conftest import START_S, Gis, depth_m
from tests.support.api.rest import mission_spec, running_in_thread
from tests.support.missions.specs import lon_lat
from tests.support.qgis import Qgis, installed

pytestmark = [
    pytest.mark.skipif(not installed(), reason="no QGIS here: apt-get install qgis python3-qgis"),
    pytest.mark.timeout(200),
]

MAX_ZOOM = 24
LOOKS = 200
"""At most so many reloads until a change is to be seen, however slow the machine is."""


@pytest.fixture(scope="module")
def qgis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Qgis]:
    with Qgis(tmp_path_factory.mktemp("qgis")) as running:
        yield running


def coloured(picture: Path) -> float:
    """The share of a picture that is not white."""
    return float((np.asarray(Image.open(picture).convert("RGB")) < 250).any(axis=2).mean())


def maps(gis: Gis, mission: str = "") -> str:
    """The address of a WMS, as it is typed into QGIS."""
    return f"{gis.url}/key/{gis.key}/wms" + (f"/missions/{mission}" if mission else "")


def tiles(gis: Gis, mission: str, layer: str = "depth") -> str:
    return f"{gis.url}/key/{gis.key}/api/v1/missions/{mission}/tiles/{layer}/{{z}}/{{x}}/{{y}}.png"


def test_qgis_opens_all_that_a_mission_offers(gis: Gis, qgis: Qgis, tmp_path: Path) -> None:
    features = f"{gis.url}/key/{gis.key}/ogc"
    for name in ("areas", "tracks", "soundings", "contours", "holidays"):
        qgis.add_features(name, features, name)
        assert qgis.count(name) == len(gis.everything(name)), name
    qgis.add_features("area", f"{features}/missions/{gis.single}", "areas")
    extent = qgis.extent("area")
    for layer in ("depth", "uncertainty", "density", "coverage"):
        qgis.add_tiles(f"{layer} tiles", tiles(gis, gis.single, layer), MAX_ZOOM)
        qgis.add_map(layer, maps(gis, gis.single), [layer])
        for name in (layer, f"{layer} tiles"):
            qgis.picture(tmp_path / f"{name}.png", [name], extent)
            assert 0.03 < coloured(tmp_path / f"{name}.png") < 0.9, name
    qgis.picture(tmp_path / "both.png", ["soundings", "depth"], extent)
    pictures = [np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB")) for name in ("both", "depth")]
    assert 0.001 < (pictures[0] != pictures[1]).any(axis=2).mean() < 0.3


def test_qgis_shows_the_same_place_in_every_system(gis: Gis, qgis: Qgis, tmp_path: Path) -> None:
    """A WMS asked for in one system and drawn in another one: axes in the wrong order would show nothing."""
    qgis.add_features("ground", f"{gis.url}/key/{gis.key}/ogc/missions/{gis.single}", "areas")
    extent = qgis.extent("ground")
    shares = []
    for crs in ("EPSG:3857", "EPSG:4326", "EPSG:32629"):
        qgis.add_map(crs, maps(gis, gis.single), ["depth", "coverage"], crs)
        within = qgis.extent(crs)
        assert within == pytest.approx(extent, abs=4.0), crs
        qgis.picture(tmp_path / "shown.png", [crs], extent)
        shares.append(coloured(tmp_path / "shown.png"))
    assert shares == pytest.approx([shares[0]] * 3, rel=0.03)
    assert 0.2 < shares[0] < 0.9


def test_qgis_is_told_what_lies_under_the_mouse(gis: Gis, qgis: Qgis) -> None:
    qgis.add_map("asked", maps(gis), ["depth"])
    qgis.add_features("where", f"{gis.url}/key/{gis.key}/ogc/missions/{gis.single}", "soundings")
    said = qgis.identify("asked", qgis.extent("where"))
    assert "Single beam" in said
    depth = re.search(r"Depth</th><td>([0-9.]+) m", said)
    assert depth is not None
    # The middle of the lines: 26 m to the east, 22 m to the north.
    assert float(depth[1]) == pytest.approx(depth_m(26.0, 22.0), abs=0.3)


def test_qgis_says_what_a_revoked_key_means(gis: Gis, qgis: Qgis) -> None:
    wrong = gis.key[:-1] + "_"
    with pytest.raises(RuntimeError, match=r"not valid.*requires authentication"):
        qgis.add_features("refused", f"{gis.url}/key/{wrong}/ogc", "areas")
    with pytest.raises(RuntimeError, match="not valid"):
        qgis.add_map("refused", maps(gis).replace(gis.key, wrong), ["depth"])
    assert qgis.count("where") > 0


@pytest.fixture
def service(tmp_path: Path) -> Iterator[str]:
    """The address of a service of its own: a mission in which something was measured stays."""
    settings = Settings(port=0, database_url=f"sqlite:///{tmp_path}/own.db", imc=ImcSettings(enabled=False))
    with running_in_thread(settings) as server:
        yield server.url


def test_qgis_sees_new_soundings_at_its_next_reload(service: str, qgis: Qgis, tmp_path: Path) -> None:
    with httpx.Client(base_url=f"{service}/api/v1", timeout=60) as client:
        mission = client.post("/missions", json=mission_spec()).raise_for_status().json()["id"]

        def sound(number: int) -> None:
            lon, lat = lon_lat(10.0 + 2.0 * number, 20.0)
            place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "range_m": 6.0}
            item = {"vehicle": "rover", "time_s": START_S + 4.0 * number, **place}
            answer = client.post(f"/missions/{mission}/measurements", json={"items": [item]})
            assert answer.raise_for_status().json()["accepted"] == 1

        sound(0)
        qgis.add_features("ground of it", f"{service}/ogc/missions/{mission}", "areas")
        qgis.add_features("soundings of it", f"{service}/ogc/missions/{mission}", "soundings")
        qgis.add_map("density of it", f"{service}/wms/missions/{mission}", ["density"])
        picture, extent = tmp_path / "density.png", qgis.extent("ground of it")

        def shown() -> float:
            qgis.picture(picture, ["density of it"], extent)
            return coloured(picture)

        assert any(shown() > 0 for _ in range(LOOKS))
        before = coloured(picture)
        for number in range(1, 6):
            sound(number)
        assert any(qgis.count("soundings of it") == 6 for _ in range(LOOKS))
        assert any(shown() > 2 * before for _ in range(LOOKS))
