"""``bathyfleet health`` asks where the settings say that the service is."""

import subprocess
from pathlib import Path

import pytest

from app.missions.settings import ImcSettings
from app.settings import Settings
from tests.support.api.rest import running_in_thread
from tests.support.commands import COMMAND, environment


def asked(folder: Path, *words: str, **variables: str) -> tuple[int, str]:
    done = subprocess.run(
        [*COMMAND, "health", *words],
        cwd=folder,
        env=environment(NO_COLOR="1", **variables),
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("host", ["0.0.0.0", "::1", "localhost"])
def test_a_service_that_is_well_is_found_at_any_address(database_url: str, tmp_path: Path, host: str) -> None:
    imc = ImcSettings(enabled=False)
    settings = Settings(host=host, port=0, database_url=database_url, imc=imc, insecure=True)
    with running_in_thread(settings) as server:
        port = server.url.rpartition(":")[2]
        code, said = asked(tmp_path, BATHYFLEET_HOST=host, BATHYFLEET_PORT=port)
        assert (code, said.endswith(f":{port} is well\n")) == (0, True), said
        code, said = asked(tmp_path, "--ready", "--host", host, "--port", port)
        assert code == 0, said
        assert "database ok" in said


def test_a_service_with_https_is_found_whatever_name_its_certificate_is_for(
    database_url: str, tmp_path: Path, certificate: tuple[Path, Path]
) -> None:
    cert, key = certificate  # for localhost and 127.0.0.1
    imc = ImcSettings(enabled=False)
    settings = Settings(
        host="::1", port=0, database_url=database_url, imc=imc, insecure=True, tls_certificate=cert, tls_key=key
    )
    with running_in_thread(settings) as server:
        port = server.url.rpartition(":")[2]
        tls = {"BATHYFLEET_TLS_CERTIFICATE": str(cert), "BATHYFLEET_TLS_KEY": str(key)}
        code, said = asked(tmp_path, "--host", "::1", "--port", port, **tls)
        assert (code, said) == (0, f"https://[::1]:{port} is well\n")


@pytest.mark.slow
def test_where_no_service_answers_is_said(tmp_path: Path) -> None:
    code, said = asked(tmp_path, "--port", "9")
    assert code == 1
    assert said.startswith("error: http://127.0.0.1:9 does not answer")
    assert asked(tmp_path, "--port", "0")[0] == 1
