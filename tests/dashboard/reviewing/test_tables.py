"""What is added to the tables of layers and files is offered everywhere, in Chromium against the real service."""

from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Browser, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, show

ADDED = """
from app.mapping.layers import LAYERS, LayerKind, Palette
from app.missions.maps.products import PRODUCTS, TRACKS, ProductKind

LAYERS["roughness"] = LayerKind(
    "roughness",
    "Roughness",
    "variability of the sea floor, mean about 1",
    "1",
    lambda source: source.map.roughness,
    Palette.MATTER,
    scale=100,
)
PRODUCTS["tracks.txt"] = ProductKind(
    TRACKS, "txt", "text/plain", "names of the vehicles", lambda *_: b"these", {TRACKS}
)
"""


@pytest.fixture(scope="module")
def extended(built: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    running = Service(tmp_path_factory.mktemp("extended"), ADDED)
    running.start()
    yield running
    running.kill()


@pytest.fixture(scope="module")
def measured(extended: Service) -> str:
    """A mission with a map."""
    mission = extended.create(vehicles=[{"name": "rover", "kind": "rest"}])
    items = [
        {"vehicle": "rover", "time_s": 1.79e9 + i, "lat_deg": 41.1851 + 1e-5 * i, "lon_deg": -8.7049 + 2e-5 * i}
        | {"depth_m": 2.0, "range_m": 8.0 + 0.1 * i}
        for i in range(12)
    ]
    extended.post(f"/missions/{mission}/measurements", {"items": items})
    return mission


@pytest.mark.slow
def test_an_added_layer_is_in_rest_and_its_document(extended: Service, measured: str) -> None:
    assert "roughness" in {layer["name"] for layer in extended.get("/layers")}
    assert "roughness" in extended.get(f"/missions/{measured}/map?layer=roughness")["layers"]
    schemas = httpx.get(f"{extended.url}/api/openapi.json", timeout=60).json()["components"]["schemas"]
    for name in ("LayerName", "OverlayLayer", "FurtherLayer"):
        assert "roughness" in schemas[name]["enum"]


@pytest.mark.slow
def test_an_added_layer_can_be_chosen_on_the_page(extended: Service, measured: str, browser: Browser) -> None:
    page = browser.new_page(base_url=extended.url)
    show(page, measured)
    by_id(page, "layer").select_option(label="Roughness")
    expect(by_id(page, "layer")).to_have_attribute("title", "Variability of the sea floor, mean about 1")
    expect(page.get_by_role("img", name="Roughness from 0")).to_be_visible()
    page.close()


@pytest.mark.slow
def test_an_added_kind_of_file_is_made_on_the_command_line(extended: Service, measured: str) -> None:
    assert "names of the vehicles" in extended.command("export", "--formats")
    assert extended.command("export", measured, "--format", "tracks.txt", "--out", "-") == "these"


@pytest.mark.slow
def test_an_added_kind_of_file_is_downloaded_from_the_list(extended: Service, measured: str, browser: Browser) -> None:
    page = browser.new_page(base_url=extended.url)
    show(page, measured)
    by_id(page, "toggle-files").click()
    with page.expect_download() as waited:
        by_id(page, "file-tracks.txt").click()
    assert waited.value.suggested_filename == "harbour-basin-tracks.txt"
    assert waited.value.path().read_bytes() == b"these"
    page.close()
