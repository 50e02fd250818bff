"""Commands to a service that serves HTTPS: whose certificate is trusted, and what is said where it is not."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.commands.command import CommandError
from app.commands.running_service import RunningService
from app.main import Server
from app.missions.settings import ImcSettings
from app.settings import Settings
from tests.support.api.rest import running_in_thread
from tests.support.certificates import Authority

EXPIRED = "20210101000000Z"


@pytest.fixture(params=["20981231000000Z", EXPIRED], ids=["valid", "expired"])
def until(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def chain_and_key(authority: Authority, until: str) -> tuple[Path, Path]:
    return authority.sign("auv.example", until=until)


@pytest.fixture
def server(database_url: str, chain_and_key: tuple[Path, Path]) -> Iterator[Server]:
    chain, key = chain_and_key
    imc = ImcSettings(enabled=False)
    settings = Settings(port=0, database_url=database_url, imc=imc, tls_certificate=chain, tls_key=key)
    with running_in_thread(settings) as server:
        yield server


def test_a_service_is_commanded_on_its_own_machine_also_when_its_certificate_has_expired(
    server: Server, chain_and_key: tuple[Path, Path], authority: Authority
) -> None:
    with RunningService(server.url, None, chain_and_key[0], on_this_machine=True) as service:
        assert service.missions() == []
    renewed, _ = authority.sign("auv.example")
    with RunningService(server.url, None, renewed, on_this_machine=True) as service:
        with pytest.raises(CommandError, match="certificate is not trusted") as refused:
            service.missions()
        assert "renewed since the service was started" in refused.value.remedy


def test_another_machine_s_certificate_is_trusted_by_its_authority(
    server: Server, authority: Authority, until: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with RunningService(server.url, None) as service:
        with pytest.raises(CommandError, match="certificate is not trusted: self-signed certificate") as refused:
            service.missions()
        assert "SSL_CERT_FILE" in refused.value.remedy
    monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
    with RunningService(server.url, None) as service:
        if until == EXPIRED:
            with pytest.raises(CommandError, match="has expired") as refused:
                service.missions()
            assert "Renew it" in refused.value.remedy
        else:
            assert service.missions() == []
