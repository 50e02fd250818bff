import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from app.dashboard.serve import STATIC
from tests.support.dashboard.browser import FONT, PATIENCE_MS, Watched
from tests.support.dashboard.service import Service

BROWSERS = [Path("/usr/bin/chromium-headless-shell"), Path("/usr/bin/chromium")]
"""The same browser without windows of its own, which take most of the start, and with them."""
CHROMIUM = next((path for path in BROWSERS if path.is_file()), BROWSERS[-1])
# WebGL by SwiftShader, the page itself put together by the processor: three times quicker than all by SwiftShader.
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-background-networking"]
ALIASES = {"sans-serif": FONT, "system-ui": FONT, "monospace": f"{FONT} Mono"}


@pytest.fixture(scope="session")
def built() -> None:
    """There is a dashboard to drive."""
    if not (STATIC / "index.html").is_file():
        pytest.skip("the dashboard is not built: 'pip install -e .' builds it")


# One service for all files that a process runs: its start and the compiling of its first map are most of their time.
@pytest.fixture(scope="session")
def service(built: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    running = Service(tmp_path_factory.mktemp("service"))
    running.start()
    yield running
    running.kill()


@pytest.fixture(scope="session")
def one_font(tmp_path_factory: pytest.TempPathFactory) -> Path | None:
    """A font configuration with ``FONT`` alone; None where it is not installed."""
    if shutil.which("fc-match") is None:
        return None
    asked = ["fc-match", "--format=%{family[0]}\n%{file}", FONT]
    family, _, file = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.partition("\n")
    if family != FONT:
        return None
    folder = tmp_path_factory.mktemp("fonts")
    configuration = folder / "fonts.conf"
    aliases = "".join(
        f"<alias><family>{generic}</family><prefer><family>{font}</family></prefer></alias>"
        for generic, font in ALIASES.items()
    )
    configuration.write_text(
        f"<fontconfig><dir>{Path(file).parent}</dir><cachedir>{folder / 'cache'}</cachedir>{aliases}</fontconfig>",
        encoding="utf-8",
    )
    return configuration


# One browser per module, not per session: Playwright's own event loop would be in the way of asynchronous tests.
@pytest.fixture(scope="module")
def browser(one_font: Path | None) -> Iterator[Browser]:
    if not CHROMIUM.is_file():
        pytest.skip(f"{CHROMIUM} is missing: apt-get install chromium")
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        fonts = {} if one_font is None else {"FONTCONFIG_FILE": str(one_font)}
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, env={**os.environ, **fonts})
        yield chromium
        chromium.close()


@pytest.fixture(autouse=True)
def nothing_goes_on(request: pytest.FixtureRequest) -> Iterator[None]:
    """Vehicles are free for the next test, and nobody steers for nothing."""
    yield
    if "service" not in request.fixturenames:
        return
    service: Service = request.getfixturevalue("service")
    for mission in service.get("/missions"):
        if mission["state"] in ("running", "paused"):
            try:
                service.act(mission["id"], "abort")
            except httpx.HTTPStatusError:
                # It came to its end by itself in between.
                assert service.get(f"/missions/{mission['id']}")["state"] not in ("running", "paused")


@pytest.fixture
def watched(browser: Browser, service: Service) -> Iterator[Watched]:
    context = browser.new_context(viewport={"width": 1440, "height": 900}, base_url=service.url)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    yield Watched(page)
    context.close()


@pytest.fixture
def page(watched: Watched) -> Page:
    return watched.page
