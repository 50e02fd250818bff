"""What is added to the table of layers is offered everywhere, in Chromium against the real service."""

from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Browser, expect

from .service import Service
from .steps import by_id, show

ADDED = """
from app.mapping.layers import LAYERS, LayerKind, Palette

LAYERS["roughness"] = LayerKind(
    "roughness",
    "Roughness",
    "variability of the sea floor, mean about 1",
    "1",
    lambda source: source.map.roughness,
    Palette.MATTER,
    scale=100,
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


def test_an_added_layer_is_in_rest_and_its_document(extended: Service, measured: str) -> None:
    assert "roughness" in {layer["name"] for layer in extended.get("/layers")}
    assert "roughness" in extended.get(f"/missions/{measured}/map?layer=roughness")["layers"]
    schemas = httpx.get(f"{extended.url}/api/openapi.json").json()["components"]["schemas"]
    for name in ("LayerName", "OverlayLayer", "FurtherLayer"):
        assert "roughness" in schemas[name]["enum"]


def test_an_added_layer_can_be_chosen_on_the_page(extended: Service, measured: str, browser: Browser) -> None:
    page = browser.new_page(base_url=extended.url)
    show(page, measured)
    by_id(page, "layer").select_option(label="Roughness")
    expect(by_id(page, "layer")).to_have_attribute("title", "Variability of the sea floor, mean about 1")
    expect(page.get_by_role("img", name="Roughness from 0")).to_be_visible()
    page.close()
