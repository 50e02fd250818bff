import gzip
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from app.dashboard.serve import mount_dashboard


@pytest.fixture
def static(tmp_path: Path) -> Path:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<title>chart</title>")
    (tmp_path / "assets" / "index-Ab12.js").write_text("export {}")
    (tmp_path / "assets" / "worker-Cd34.mjs").write_text("export {}")
    return tmp_path


def client(static: Path, charts: str = "") -> httpx.AsyncClient:
    app = FastAPI()
    mount_dashboard(app, static, charts)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://dashboard")


async def test_the_page_is_asked_for_again_each_time_its_assets_never(static: Path) -> None:
    service = client(static)
    page = await service.get("/")
    assert page.text == "<title>chart</title>"
    assert page.headers["cache-control"] == "no-cache"
    again = await service.get("/", headers={"If-None-Match": page.headers["etag"]})
    assert again.headers["etag"] == page.headers["etag"]
    asset = await service.get("/assets/index-Ab12.js")
    assert "immutable" in asset.headers["cache-control"]


@pytest.mark.parametrize("name", ["index-Ab12.js", "worker-Cd34.mjs"])
async def test_scripts_have_a_type_that_browsers_run(static: Path, name: str) -> None:
    assert (await client(static).get(f"/assets/{name}")).headers["content-type"].startswith("text/javascript")


async def test_the_policy_allows_only_our_own_scripts(static: Path) -> None:
    policy = (await client(static).get("/")).headers["content-security-policy"]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == "'self'"
    assert rules["worker-src"] == "'self' blob:"
    assert "unsafe" not in policy


async def test_a_page_that_was_not_built_says_how_and_appears_once_built(tmp_path: Path) -> None:
    service = client(tmp_path / "static")
    missing = await service.get("/")
    assert missing.status_code == 503
    assert "pip install" in missing.text
    assert "npm run build" in missing.text
    (tmp_path / "static" / "assets").mkdir(parents=True)
    (tmp_path / "static" / "index.html").write_text("built")
    assert (await service.get("/")).text == "built"


@pytest.mark.parametrize("path", ["/assets/none.js", "/assets/../index.html", "/assets/%2e%2e/serve.py"])
async def test_nothing_else_is_served(static: Path, path: str) -> None:
    answer = await client(static).get(path)
    assert answer.status_code == 404
    assert "immutable" not in answer.headers.get("cache-control", "")


async def test_health_checks_may_ask_for_the_head_only(static: Path) -> None:
    assert (await client(static).head("/")).status_code == 200


async def test_assets_go_out_compressed_where_the_browser_takes_that(static: Path) -> None:
    packed = gzip.compress(b"export {} // packed")
    (static / "assets" / "index-Ab12.js.gz").write_bytes(packed)
    service = client(static)
    small = await service.get("/assets/index-Ab12.js", headers={"Accept-Encoding": "br, gzip"})
    assert small.text == "export {} // packed"
    assert small.headers["content-encoding"] == "gzip"
    assert small.headers["content-type"].startswith("text/javascript")
    plain = await service.get("/assets/index-Ab12.js", headers={"Accept-Encoding": "identity"})
    assert (plain.text, plain.headers.get("content-encoding")) == ("export {}", None)
    assert small.headers["vary"] == plain.headers["vary"] == "Accept-Encoding"


async def test_charts_come_from_a_file_in_parts_from_one_server_or_not_at_all(static: Path, tmp_path: Path) -> None:
    assert (await client(static).get("/charts.json")).json() == {"tiles": ""}
    assert (await client(static).get("/charts.pmtiles")).status_code == 404
    file = tmp_path / "harbour.pmtiles"
    file.write_bytes(b"PMTiles" + bytes(range(7, 200)))
    own = client(static, str(file))
    assert (await own.get("/charts.json")).json() == {"tiles": "pmtiles:///charts.pmtiles"}
    part = await own.get("/charts.pmtiles", headers={"Range": "bytes=10-19"})
    assert (part.status_code, part.content) == (206, bytes(range(10, 20)))
    for unusable in (tmp_path / "nowhere.pmtiles", static / "index.html"):
        none = client(static, str(unusable))
        assert (await none.get("/charts.json")).json() == {"tiles": ""}
        assert (await none.get("/charts.pmtiles")).status_code == 404
    server = client(static, "https://tiles.example:8443/{z}/{x}/{y}.png")
    policy = (await server.get("/")).headers["content-security-policy"]
    assert "connect-src 'self' https://tiles.example:8443;" in policy
