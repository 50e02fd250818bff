"""The proxy that the administrator's guide describes, as it stands there."""

import json
import os
import re
import shutil
import ssl
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, contextmanager
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import connect

from app.api.soundings.measurements import MAX_WAIT_S
from app.settings import Settings
from tests.support.api.rest import mission_spec, running
from tests.support.paths import PROJECT
from tests.support.ports import free_ports

(GUIDED,) = re.findall(r"```nginx\n(.*?)```", (PROJECT / "docs" / "administration.md").read_text(), re.DOTALL)
NGINX = shutil.which("nginx", path="/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin")
PAGE_WAITS_MS = r"const STORED: Patience = \{ limit_ms: ([\d_]+),"


def test_the_proxy_of_the_guide_takes_what_the_service_takes() -> None:
    (most,) = re.findall(r"client_max_body_size (\d+)m;", GUIDED)
    assert int(most) * 2**20 >= max(Settings().max_import_bytes, Settings().max_body_bytes)


def test_the_proxy_of_the_guide_waits_longer_than_vehicles_and_the_page() -> None:
    (patience,) = re.findall(r"proxy_read_timeout (\d+)s;", GUIDED)
    page = (PROJECT / "app" / "dashboard" / "web" / "src" / "api" / "client.ts").read_text()
    (waits,) = re.findall(PAGE_WAITS_MS, page)
    assert int(patience) > max(MAX_WAIT_S, int(waits) / 1000)


@contextmanager
def proxy(folder: Path, service: str, certificate: tuple[Path, Path]) -> Iterator[str]:
    """Nginx as the guide has it, on a free port; yields its address."""
    assert NGINX is not None
    (port,) = free_ports(1)
    server = GUIDED.replace("listen 443", f"listen 127.0.0.1:{port}").replace("http://127.0.0.1:8080", service)
    for name, file in zip(("fullchain", "privkey"), certificate, strict=True):
        server = server.replace(f"/etc/bathyfleet/{name}.pem", str(file))
    kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    places = "".join(f"{kind}_temp_path {folder / kind};\n" for kind in kinds)
    (folder / "nginx.conf").write_text(
        f"{'user root;' if os.geteuid() == 0 else ''}\npid {folder / 'pid'};\nerror_log {folder / 'log'};\n"
        f"events {{}}\nhttp {{\naccess_log off;\n{places}{server}}}\n"
    )
    command = [NGINX, "-p", f"{folder}/", "-e", str(folder / "log"), "-c", str(folder / "nginx.conf")]
    subprocess.run(command, check=True)  # it returns when it listens
    try:
        yield f"https://127.0.0.1:{port}"
    finally:
        subprocess.run([*command, "-s", "stop"], check=True)


@pytest.mark.skipif(NGINX is None, reason="needs nginx")
async def test_everything_passes_the_proxy_of_the_guide(
    make_settings: Callable[..., Settings], certificate: tuple[Path, Path], tmp_path: Path
) -> None:
    trusting = ssl.create_default_context(cafile=str(certificate[0]))
    trusting.check_hostname = False
    # From 127.0.0.2, so that who is believed as a proxy and who asks are not one address.
    own = httpx.AsyncHTTPTransport(verify=trusting, local_address="127.0.0.2")
    async with (
        running(make_settings(trusted_proxies=("127.0.0.1",), insecure=True)) as server,
        AsyncExitStack() as stack,
    ):
        url = stack.enter_context(proxy(tmp_path, server.url, certificate))
        headers = {"Origin": url}
        client = await stack.enter_async_context(
            httpx.AsyncClient(base_url=url, transport=own, headers=headers, timeout=60)
        )
        assert "max-age" in (await client.get("/api/v1/missions")).headers["strict-transport-security"]
        text = json.dumps(mission_spec()).ljust(2 * 2**20)
        made = await client.post("/api/v1/missions", content=text, headers={"Content-Type": "application/json"})
        assert made.status_code == 201, made.text
        written = await server._app.state.edge.audit.newest(limit=1)
        assert written[0].origin == "127.0.0.2"
        place = made.headers["location"]
        asked = {"Accept": "text/event-stream"}
        async with client.stream("GET", f"{place}/events", headers=asked) as stream:
            first = await anext(stream.aiter_lines())
            assert first.startswith("id: ")
        async with connect(url.replace("https", "wss") + f"{place}/live", ssl=trusting, origin=url) as view:  # type: ignore[arg-type]
            assert json.loads(await view.recv())
