"""bathyfleet serve --check: files that settings name are looked at before a start, or a delivery, needs them."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import app
from app.settings import SettingsError, StartupError
from tests.support.certificates import Authority

Check = Callable[[str], tuple[list[str], str]]


@pytest.fixture
def check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_settings_around: None) -> Check:
    """Return what is wrong with a file of settings, and what is printed."""
    file = tmp_path / "bathyfleet.toml"
    monkeypatch.setenv("BATHYFLEET_CONFIG", str(file))

    def checked(toml: str) -> tuple[list[str], str]:
        file.write_text(toml)
        done = CliRunner().invoke(app, ["serve", "--check"])
        error = done.exception
        if error is None:
            return [], done.output
        assert isinstance(error, SettingsError | StartupError), error
        return (error.problems if isinstance(error, SettingsError) else [str(error)]), done.output

    return checked


def test_files_that_can_be_used_are_not_mentioned(check: Check, authority: Authority, tmp_path: Path) -> None:
    chain, key = authority.sign("auv.example")
    commented = tmp_path / "commented.pem"
    commented.write_bytes("Leixões\n".encode("latin-1") + chain.read_bytes())
    assert check(
        f'tls_certificate = "{commented}"\ntls_key = "{key}"\n[alarms]\nca_file = "{authority.file}"\n'
        f'[compute]\nscheduler = "tls://deck:8786"\ntls_ca_file = "{authority.file}"\n'
        f'tls_certificate = "{chain}"\ntls_key = "{key}"\n[simulation]\nterrain = ""\n'
    ) == ([], "the settings can be used\n")


def test_every_file_that_cannot_be_used_is_named_with_its_setting(
    check: Check, authority: Authority, tmp_path: Path
) -> None:
    chain, key = authority.sign("auv.example")
    _, another = authority.sign("other.example")
    terrain = tmp_path / "bank.npz"
    terrain.write_bytes(b"none")
    problems, _ = check(
        f'tls_certificate = "{chain}"\ntls_key = "{another}"\n'
        f'[compute]\nscheduler = "tls://deck:8786"\ntls_ca_file = "{key}"\n'
        f'tls_certificate = "{tmp_path / "absent.pem"}"\ntls_key = "{key}"\n[simulation]\nterrain = "{terrain}"\n'
    )
    server, trusted, shown, floor = problems
    assert server.startswith(
        f"tls_certificate {chain} and tls_key {another} cannot be used: the key belongs to another"
    )
    assert trusted.startswith(f"compute.tls_ca_file {key} cannot be used: it holds no certificate")
    assert shown.startswith(f"compute.tls_certificate {tmp_path / 'absent.pem'}")
    assert "No such file" in shown
    assert floor.startswith(f"simulation.terrain: {terrain}: ")


def test_a_file_that_trusts_nobody_stops_the_start(check: Check, tmp_path: Path) -> None:
    """Every alarm by TLS would fail, and be seen when the first one is raised."""
    broken = tmp_path / "ca.pem"
    broken.write_text("-----BEGIN CERTIFICATE-----\nbroken\n-----END CERTIFICATE-----\n")
    [problem], _ = check(f'[alarms]\nca_file = "{broken}"\n')
    assert f"ca_file {str(broken)!r} cannot be used: it holds no certificate (PEM)" in problem


def test_certificates_that_are_not_valid_now_are_told(check: Check, authority: Authority, tmp_path: Path) -> None:
    """The service starts with them all the same: vehicles have to be stopped on that day, too."""
    chain, key = authority.sign("auv.example", until="20210101000000Z")
    (bundle := tmp_path / "bundle.pem").write_text(chain.read_text() + authority.file.read_text())
    problems, said = check(
        f'tls_certificate = "{chain}"\ntls_key = "{key}"\n[compute]\nscheduler = "tls://deck:8786"\n'
        f'tls_ca_file = "{bundle}"\ntls_certificate = "{chain}"\ntls_key = "{key}"\n'
    )
    assert problems == []
    # Of authorities' bundles nobody takes old ones out.
    assert said == (
        f"warning: tls_certificate {chain} is valid until 2021-01-01 00:00 UTC: renew it\n"
        f"warning: compute.tls_certificate {chain} is valid until 2021-01-01 00:00 UTC: renew it\n"
        "the settings can be used\n"
    )


@pytest.mark.parametrize(
    ("broker", "is_told"),
    [
        ('host = "deck"\nuser = "fleet"\npassword = "salt"\ntls = false\n', True),
        ('host = "deck"\nuser = "fleet"\npassword = "salt"\n', False),
        ('host = "deck"\ntls = false\n', False),
        ('host = "127.0.0.1"\nuser = "fleet"\npassword = "salt"\ntls = false\n', False),
    ],
    ids=["in the clear", "by TLS", "nobody logs in", "on this machine"],
)
def test_a_password_that_is_sent_in_the_clear_is_told(check: Check, broker: str, is_told: bool) -> None:
    problems, said = check(f"[alarms.mqtt]\n{broker}")
    assert problems == []
    assert ("warning: alarms.mqtt.password is sent to deck unprotected" in said) is is_told
    assert "salt" not in said
