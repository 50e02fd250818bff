"""HTTPS, proxies, other users of the machine, and what browsers are told."""

import asyncio
import os
import sqlite3
import ssl
import subprocess
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.main import create_app, serve
from app.settings import Settings, SettingsError, StartupError, load_settings
from app.storage.upkeep.backup import back_up
from app.storage.upkeep.prepare import prepare_database
from tests.support.api.rest import make_client, running

HTTPS_ONLY = "strict-transport-security"


async def test_https_is_served_with_the_certificate_and_asked_for_from_then_on(
    make_settings: Callable[..., Settings], certificate: tuple[Path, Path]
) -> None:
    cert, key = certificate
    async with running(make_settings(tls_certificate=cert, tls_key=key)) as server:
        assert server.url.startswith("https://")
        trusting = ssl.create_default_context(cafile=str(cert))
        async with httpx.AsyncClient(base_url=server.url, verify=trusting) as client:
            answer = await client.get("/api/v1/missions", headers={"Origin": server.url})
            assert answer.status_code == 200
            assert "max-age" in answer.headers[HTTPS_ONLY]
            with pytest.raises(httpx.TransportError):
                await client.get(server.url.replace("https", "http"))
        old = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        old.check_hostname, old.verify_mode = False, ssl.CERT_NONE
        with pytest.warns(DeprecationWarning, match="TLSv1_1"):
            old.minimum_version = old.maximum_version = ssl.TLSVersion.TLSv1_1
        async with httpx.AsyncClient(base_url=server.url, verify=old) as client:
            with pytest.raises(httpx.TransportError):
                await client.get("/health/live")


async def test_the_private_key_comes_neither_into_the_database_nor_into_backups(
    make_settings: Callable[..., Settings], certificate: tuple[Path, Path], tmp_path: Path
) -> None:
    cert, key = certificate
    both = tmp_path / "both.pem"
    both.write_text(key.read_text() + cert.read_text())
    settings = make_settings(tls_certificate=both, database_url=f"sqlite+aiosqlite:///{tmp_path / 'fleet.db'}")
    await prepare_database(settings.database_url, may_upgrade=True)
    with closing(sqlite3.connect(tmp_path / "fleet.db")) as connection:  # as a process that was killed left it
        words = "INSERT INTO processes (id, url, secret, certificate, began_at) VALUES (99, '', '', ?, '2026-01-01')"
        connection.execute(words, [both.read_text()])
        connection.commit()
    async with running(settings) as server, make_client(server) as client:
        assert (await client.get("/missions")).status_code == 200
        with closing(sqlite3.connect(tmp_path / "fleet.db")) as connection:
            assert connection.execute("SELECT certificate FROM processes").fetchall() == [(cert.read_text(),)]
        copy, _ = await asyncio.to_thread(back_up, settings.database_url, tmp_path / "copy.db")
    with closing(sqlite3.connect(copy)) as connection:
        assert connection.execute("SELECT secret, certificate FROM processes").fetchall() == [("", None)]


@pytest.mark.usefixtures("no_settings_around")
async def test_files_that_make_no_certificate_are_named(
    make_settings: Callable[..., Settings], certificate: tuple[Path, Path], tmp_path: Path
) -> None:
    cert, _ = certificate
    other = tmp_path / "other.pem"
    other.write_text("no key")
    for given, said in (
        ({"tls_certificate": cert}, "tls_certificate"),
        ({"tls_certificate": cert, "tls_key": other}, "tls_key"),
        ({"tls_certificate": tmp_path / "absent.pem"}, "absent.pem"),
    ):
        with pytest.raises(StartupError, match=said):
            await serve(make_settings(**given))
    with pytest.raises(SettingsError, match="tls_certificate"):
        load_settings(tls_key=other)
    with pytest.raises(SettingsError, match=r"trusted_proxies.*neither an address nor a network"):
        load_settings(trusted_proxies=("proxy.example",))


async def _ask(settings: Settings, headers: dict[str, str], client: str = "127.0.0.1") -> httpx.Response:
    async with running(settings) as server, make_client(server) as asking:
        return await asking.get("/missions", headers=headers)


MARKS_OF_PROXIES = (
    *("X-Forwarded-For", "Forwarded", "X-Real-IP", "Via", "x-forwarded-server", "X-FORWARDED-PORT"),
    *("X-Forwarded-Prefix", "X-Client-IP", "X-Cluster-Client-IP", "True-Client-IP", "CF-Connecting-IP"),
    *("Forwarded-For", "X-Original-Host", "X-Scheme", "X-Envoy-External-Address", "X-Amzn-Trace-Id", "X-ARR-SSL"),
)


async def test_what_a_proxy_passes_on_is_not_the_local_users_word(make_settings: Callable[..., Settings]) -> None:
    """A proxy on the same machine speaks from loopback for whoever reaches it."""
    async with running(make_settings()) as server, make_client(server) as asking:
        answers = {name: await asking.get("/missions", headers={name: "127.0.0.1"}) for name in MARKS_OF_PROXIES}
        assert {name: answer.status_code for name, answer in answers.items()} == dict.fromkeys(MARKS_OF_PROXIES, 403)
        assert (await asking.get("/missions")).status_code == 200


async def test_nobody_but_a_trusted_proxy_says_for_whom_it_speaks(make_settings: Callable[..., Settings]) -> None:
    claimed = {"X-Forwarded-For": "192.0.2.7", "X-Forwarded-Proto": "https"}
    assert HTTPS_ONLY not in (await _ask(make_settings(), claimed)).headers
    trusted = make_settings(trusted_proxies=("127.0.0.0/8",), insecure=True)
    assert HTTPS_ONLY in (await _ask(trusted, claimed)).headers
    bare = await _ask(make_settings(trusted_proxies=("127.0.0.1",)), {})
    assert bare.status_code == 403  # a proxy that tells nothing is still not the local user


async def test_a_proxy_that_comes_by_ipv4_is_trusted_where_both_are_listened_on(
    make_settings: Callable[..., Settings],
) -> None:
    """Such a socket sees it as ::ffff:127.0.0.1."""
    settings = make_settings(host="::", trusted_proxies=("127.0.0.1",), insecure=True)
    async with running(settings) as server, make_client(server) as asking:
        port = server.url.rpartition(":")[2]
        claimed = {"X-Forwarded-For": "192.0.2.7", "X-Forwarded-Proto": "https"}
        answer = await asking.post(f"http://127.0.0.1:{port}/api/v1/missions/none/abort", headers=claimed)
        assert HTTPS_ONLY in answer.headers
        await asking.post(f"http://127.0.0.1:{port}/api/v1/missions/none/abort")
        written = await server._app.state.edge.audit.newest(limit=2)
        assert [entry.origin for entry in written] == ["127.0.0.1", "192.0.2.7"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can speak as another user")
async def test_another_user_of_this_machine_is_not_the_local_operator(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings()) as server:
        port = server.url.rpartition(":")[2]
        request = "GET /api/v1/missions HTTP/1.1\\r\\nHost: localhost\\r\\nConnection: close\\r\\n\\r\\n"
        script = f"exec 3<>/dev/tcp/127.0.0.1/{port}; printf '{request}' >&3; read -r line <&3; echo \"$line\""
        done = await asyncio.to_thread(
            subprocess.run, ["/bin/bash", "-c", script], user=65534, capture_output=True, text=True, cwd="/"
        )
        assert " 403 " in done.stdout, done


@pytest.mark.slow
async def test_every_answer_tells_browsers_to_be_careful(make_settings: Callable[..., Settings]) -> None:
    app = create_app(make_settings())
    wanted: dict[str, Any] = {
        "x-content-type-options": "nosniff",
        "x-frame-options": "DENY",
        "referrer-policy": "no-referrer",
        "cross-origin-opener-policy": "same-origin",
        "cross-origin-resource-policy": "same-origin",
    }
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as client,
    ):
        for path in ("/", "/api/docs", "/api/openapi.json", "/api/v1/missions", "/health", "/assets/none.js", "/none"):
            answer = await client.get(path)
            assert wanted.items() <= dict(answer.headers).items(), path
            policy = answer.headers["content-security-policy"]
            assert "default-src 'none'" in policy, path
            assert "frame-ancestors 'none'" in policy, path
            assert ("'unsafe-inline'" in policy) == (path == "/api/docs"), path
            assert "access-control-allow-origin" not in answer.headers
            assert HTTPS_ONLY not in answer.headers
