"""The image and the compose file say what the program understands. Building them takes a container engine."""

import json
import re
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from app.missions.settings import ImcSettings
from app.settings import PREFIX, Settings, _variable_names, load_settings
from benchmarks.installation.dockerfile import (
    DockerfileError,
    context_of,
    options_of,
    stages_of,
    variables_of,
    words_of,
)
from tests.support.api.rest import running_in_thread
from tests.support.commands import COMMAND, environment
from tests.support.paths import PROJECT

IMAGE = (PROJECT / "Dockerfile").read_text().replace("\\\n", " ")
COMPOSE = yaml.safe_load((PROJECT / "compose.yaml").read_text())
KNOWN = _variable_names(Settings, PREFIX)


def environment_of_the_image() -> dict[str, str]:
    (line,) = re.findall(r"^ENV (PATH=.*)$", IMAGE, re.MULTILINE)
    return dict(word.split("=", 1) for word in shlex.split(line))


def environment_of_a_container() -> dict[str, str]:
    """Settings of the image and of the compose file, without those that it only passes on."""
    service = COMPOSE["services"]["bathyfleet"]["environment"]
    image = {name: value for name, value in environment_of_the_image().items() if name.startswith(PREFIX)}
    given = {name: value for name, value in service.items() if value is not None}
    return image | {name: filled_in(value, {"POSTGRES_PASSWORD": "x"}) for name, value in given.items()}


def filled_in(value: str, given: dict[str, str]) -> str:
    """Fill in variables as compose does."""
    return re.sub(r"\$\{(\w+)(?::[-?]([^}]*))?\}", lambda m: given.get(m[1], m[2] or ""), value)


@pytest.mark.usefixtures("no_settings_around")
def test_every_variable_is_a_setting_with_a_value_that_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    together = environment_of_a_container()
    assert {*together, *COMPOSE["services"]["bathyfleet"]["environment"]} <= KNOWN
    for name, value in together.items():
        monkeypatch.setenv(name, value)
    settings = load_settings()
    assert settings.loopback
    assert settings.migrates_itself
    assert settings.database_url == "postgresql+asyncpg://bathyfleet:x@127.0.0.1:5432/bathyfleet"
    assert (settings.port, settings.log_format) == (8080, "json")


@pytest.mark.usefixtures("no_settings_around")
def test_the_settings_file_says_where_a_container_listens(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bathyfleet.toml").write_text('host = "192.0.2.7"\nport = 8443\n')
    for name, value in environment_of_a_container().items():
        monkeypatch.setenv(name, value)
    settings = load_settings()
    assert (settings.host, settings.port) == ("192.0.2.7", 8443)


def test_vehicles_have_time_to_be_stopped() -> None:
    """As under systemd, however a container is begun."""
    unit = (PROJECT / "app" / "deploy" / "systemd" / "bathyfleet.service").read_text()
    (seconds,) = re.findall(r"^TimeoutStopSec=(\d+)$", unit, re.MULTILINE)
    assert COMPOSE["services"]["bathyfleet"]["stop_grace_period"] == f"{seconds}s"
    guide = (PROJECT / "docs" / "administration.md").read_text()
    begun = [line for line in guide.splitlines() if line.startswith("docker run -d")]
    assert begun
    assert all(f"--stop-timeout {seconds}" in line for line in begun)


def test_ports_of_the_image_are_those_of_the_settings() -> None:
    (line,) = re.findall(r"^EXPOSE (.*)$", IMAGE, re.MULTILINE)
    imc = Settings().imc
    announces = f"{imc.announce_ports[0]}-{imc.announce_ports[-1]}/udp"
    assert line.split() == [f"{Settings().port}/tcp", f"{imc.port}/udp", announces]


@pytest.mark.slow
@pytest.mark.parametrize("encrypted", [False, True])
def test_the_health_check_asks_what_there_is(
    database_url: str, tmp_path: Path, certificate: tuple[Path, Path], encrypted: bool
) -> None:
    (line,) = re.findall(r"^HEALTHCHECK .* CMD (\[.*\])$", IMAGE, re.MULTILINE)
    program, *words = json.loads(line)
    assert program == "bathyfleet"
    tls: dict[str, Any] = {"tls_certificate": certificate[0], "tls_key": certificate[1]} if encrypted else {}
    # One address of the machine's own, as where others than its users are to be kept out.
    settings = Settings(host="127.0.0.2", port=0, database_url=database_url, imc=ImcSettings(enabled=False), **tls)
    with running_in_thread(settings) as server:
        for port, code in ((server.url.rpartition(":")[2], 0), ("9", 1)):
            given = {"host": settings.host, "port": int(port)} | {name: str(file) for name, file in tls.items()}
            text = "".join(f"{name} = {json.dumps(value)}\n" for name, value in given.items())
            (tmp_path / "bathyfleet.toml").write_text(text)
            done = subprocess.run(
                [*COMMAND, *words], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False
            )
            assert done.returncode == code, done.stdout + done.stderr


def test_the_image_has_what_the_guides_offer_on_top() -> None:
    build, last = stages_of((PROJECT / "Dockerfile").read_text())
    arguments = [value.partition("=")[0] for word, value in build.instructions if word == "ARG"]
    assert {*arguments} == {*COMPOSE["services"]["bathyfleet"]["build"]["args"]} == {"EXTRAS", "PACKAGES"}
    (install,) = (value for word, value in build.instructions if word == "RUN" and "pip install" in value)
    assert '".${EXTRAS:+[$EXTRAS]}" $PACKAGES' in install
    for extras, packages, expected in (("", "", ["."]), ("cluster", "s3fs gcsfs", [".[cluster]", "s3fs", "gcsfs"])):
        script = 'printf "%s\\n" ".${EXTRAS:+[$EXTRAS]}" $PACKAGES'
        given = {"EXTRAS": extras, "PACKAGES": packages}
        said = subprocess.run(["sh", "-c", script], env=given, capture_output=True, text=True, check=True).stdout
        assert said.split() == expected
    # Debian 13 has the programs of PostgreSQL 17; older ones refuse a newer server.
    server = re.fullmatch(r"postgres:(\d+)-\w+", COMPOSE["services"]["database"]["image"])
    assert server is not None
    assert {"trixie": 17}[last.debian] >= int(server[1])
    assert any("postgresql-client" in value for word, value in last.instructions if word == "RUN")


def test_what_the_image_copies_is_what_the_package_is_made_of() -> None:
    allowed = {line[1:] for line in (PROJECT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    assert {"app", "imc_bridge", "simulator", "migrations", "hatch_build.py", "pyproject.toml"} <= allowed
    assert all((PROJECT / name).exists() for name in allowed)
    assert "operator.token" not in allowed


def test_a_stand_in_for_a_container_engine_understands_every_step() -> None:
    """``python -m benchmarks.installation.image`` carries them out; here is looked at what it would do."""
    build, last = stages_of((PROJECT / "Dockerfile").read_text())
    assert (build.name, [word for word, _ in last.instructions][-2:]) == ("build", ["ENTRYPOINT", "CMD"])
    said = dict(last.instructions)
    assert build.debian == last.debian == "trixie"
    assert words_of(said["ENTRYPOINT"]) + words_of(said["CMD"]) == ["bathyfleet", "serve"]
    assert ("from", "build") in options_of(said["COPY"])[0]
    assert variables_of("PATH=/opt/x:$PATH A=1", {"PATH": "/bin"}) == {"PATH": "/opt/x:/bin", "A": "1"}
    with pytest.raises(DockerfileError, match="ADD"):
        stages_of("FROM x\nADD a b\n")


def test_what_the_image_is_built_from_is_the_source_and_nothing_that_was_built(tmp_path: Path) -> None:
    shutil.copy(PROJECT / ".dockerignore", tmp_path)
    kept = ["app/main.py", "app/dashboard/web/package.json", "migrations/env.py", "pyproject.toml", "README.md"]
    left = ["app/dashboard/static/index.html", "app/dashboard/web/node_modules/x.js", "bathyfleet.db", "docs/a.md"]
    left += ["app/__pycache__/main.pyc", "operator.token", "app/fleet.db-wal"]
    for name in kept + left:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert [str(path) for path in context_of(tmp_path)] == sorted(kept, key=Path)


def test_the_service_waits_until_the_database_is_reached_as_it_reaches_it() -> None:
    """While the server's image sets its data up a server is there that listens on its socket only."""
    (_, asked) = COMPOSE["services"]["database"]["healthcheck"]["test"]
    assert shlex.split(asked)[:3] == ["pg_isready", "--host", "127.0.0.1"]
    assert COMPOSE["services"]["bathyfleet"]["depends_on"]["database"]["condition"] == "service_healthy"


def test_the_service_has_no_rights_that_it_does_not_need() -> None:
    service: dict[str, Any] = COMPOSE["services"]["bathyfleet"]
    assert service["cap_drop"] == ["ALL"]
    assert service["read_only"] is True
    assert re.search(r"^USER bathyfleet$", IMAGE, re.MULTILINE)
    assert COMPOSE["services"]["database"]["ports"][0].startswith("127.0.0.1:")
