"""QGIS itself opens tiles and features, and sees what changes."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.api.ogc.conftest import START_S, Gis
from tests.support.missions.specs import lon_lat
from tests.support.qgis import Qgis, installed
from tests.support.rest import mission_spec

pytestmark = [
    pytest.mark.skipif(not installed(), reason="no QGIS here: apt-get install qgis python3-qgis"),
    pytest.mark.timeout(200),
]

MAX_ZOOM = 24
LOOKS = 200
"""At most so many reloads until a change is to be seen: however slow the machine is, each shows what the service has."""


@pytest.fixture(scope="module")
def qgis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Qgis]:
    with Qgis(tmp_path_factory.mktemp("qgis")) as running:
        yield running


def coloured(picture: Path) -> float:
    """The share of a picture that is not white."""
    return float((np.asarray(Image.open(picture).convert("RGB")) < 250).any(axis=2).mean())


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
        qgis.add_tiles(layer, tiles(gis, gis.single, layer), MAX_ZOOM)
        qgis.picture(tmp_path / f"{layer}.png", [layer], extent)
        assert 0.03 < coloured(tmp_path / f"{layer}.png") < 0.9, layer
    qgis.picture(tmp_path / "both.png", ["soundings", "depth"], extent)
    assert coloured(tmp_path / "both.png") > coloured(tmp_path / "depth.png")


def test_qgis_says_what_a_revoked_key_means(gis: Gis, qgis: Qgis) -> None:
    with pytest.raises(RuntimeError, match="not valid"):
        qgis.add_features("refused", f"{gis.url}/key/{gis.key[:-1]}_/ogc", "areas")


def test_qgis_sees_new_soundings_at_its_next_reload(gis: Gis, qgis: Qgis, tmp_path: Path) -> None:
    api, operator = f"{gis.url}/api/v1/missions", {"Authorization": f"Bearer {gis.operator}"}
    mission = gis.client.post(api, json=mission_spec(name="Changing"), headers=operator).raise_for_status().json()["id"]

    def sound(number: int) -> None:
        lon, lat = lon_lat(10.0 + 2.0 * number, 20.0)
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "range_m": 6.0}
        item = {"vehicle": "rover", "time_s": START_S + 4.0 * number, **place}
        answer = gis.client.post(f"{api}/{mission}/measurements", json={"items": [item]}, headers=operator)
        assert answer.raise_for_status().json()["accepted"] == 1

    sound(0)
    own = f"{gis.url}/key/{gis.key}/ogc/missions/{mission}"
    qgis.add_features("ground", own, "areas")
    qgis.add_features("sounded", own, "soundings")
    qgis.add_tiles("density of it", tiles(gis, mission, "density"), MAX_ZOOM)
    picture, extent = tmp_path / "density.png", qgis.extent("ground")

    def shown() -> float:
        qgis.picture(picture, ["density of it"], extent)
        return coloured(picture)

    assert any(shown() > 0 for _ in range(LOOKS))
    before = coloured(picture)
    for number in range(1, 6):
        sound(number)
    assert any(qgis.count("sounded") == 6 for _ in range(LOOKS))
    assert any(shown() > 2 * before for _ in range(LOOKS))
    gis.client.delete(f"{api}/{mission}", headers=operator).raise_for_status()
