"""The client and certificates: requests and streams trust the same, and what is not trusted is said at once."""

import asyncio
import ssl
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.main import Server
from app.missions.settings import ImcSettings
from app.settings import Settings
from bathyfleet.client import AsyncClient, Client, UnreachableError
from tests.support.api.rest import mission_spec, running_in_thread
from tests.support.certificates import Authority


@pytest.fixture
def server(database_url: str, authority: Authority) -> Iterator[Server]:
    chain, key = authority.sign("auv.example")
    imc = ImcSettings(enabled=False)
    settings = Settings(port=0, database_url=database_url, imc=imc, tls_certificate=chain, tls_key=key)
    with running_in_thread(settings) as server:
        yield server


def seen_of(client: Client) -> tuple[str, str]:
    """What the log of a new mission and its live messages begin with."""
    mission = client.create_mission(mission_spec())
    entry, message = next(client.events(mission.id)), next(client.live(mission.id))
    return entry.kind, message.type


@pytest.mark.parametrize("how", ["a context", "SSL_CERT_FILE", "the machine's own"])
def test_an_authority_is_trusted_for_requests_and_streams_alike(
    server: Server, authority: Authority, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    for name in ("SSL_CERT_FILE", "SSL_CERT_DIR"):
        monkeypatch.delenv(name, raising=False)
    if how == "SSL_CERT_FILE":
        monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
    if how == "the machine's own":
        load = ssl.SSLContext.load_verify_locations
        monkeypatch.setattr(ssl.SSLContext, "load_default_certs", lambda own, *_: load(own, authority.file))
    verify = ssl.create_default_context(cafile=authority.file) if how == "a context" else True
    with Client(server.url, verify=verify) as client:
        assert seen_of(client) == ("state", "snapshot")


def test_a_certificate_that_is_not_trusted_is_said_at_once(server: Server) -> None:
    async def ask() -> None:
        async with AsyncClient(server.url, patience_s=1e6) as client:
            await client.get_health()

    # Asked again it would be asked for days.
    with Client(server.url, patience_s=1e6) as client:
        for attempt in (client.get_health, lambda: next(client.live("1")), lambda: asyncio.run(ask())):
            with pytest.raises(UnreachableError, match="certificate is not trusted: self-signed certificate"):
                attempt()


def test_who_names_an_authority_trusts_no_other(
    server: Server, authority: Authority, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = ssl.SSLContext.load_verify_locations
    monkeypatch.setattr(ssl.SSLContext, "load_default_certs", lambda own, *_: load(own, authority.file))
    monkeypatch.setenv("SSL_CERT_FILE", str(Authority(tmp_path).file))
    with Client(server.url) as client, pytest.raises(UnreachableError, match="certificate is not trusted"):
        client.get_health()


def test_an_address_in_capitals_is_checked_as_any_other(server: Server) -> None:
    with Client(server.url.upper()) as client, pytest.raises(UnreachableError, match="certificate is not trusted"):
        client.get_health()
