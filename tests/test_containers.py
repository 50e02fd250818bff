"""The image and the compose file say what the program understands. Building them takes a container engine."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
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
from tests.support.paths import PROJECT

IMAGE = (PROJECT / "Dockerfile").read_text().replace("\\\n", " ")
COMPOSE = yaml.safe_load((PROJECT / "compose.yaml").read_text())
KNOWN = _variable_names(Settings, PREFIX)


def environment_of_the_image() -> dict[str, str]:
    (line,) = re.findall(r"^ENV (PATH=.*)$", IMAGE, re.MULTILINE)
    return dict(word.split("=", 1) for word in shlex.split(line))


def filled_in(value: str, given: dict[str, str]) -> str:
    """Fill in variables as compose does."""
    return re.sub(r"\$\{(\w+)(?::[-?]([^}]*))?\}", lambda m: given.get(m[1], m[2] or ""), value)


def test_every_variable_is_a_setting_with_a_value_that_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    service = COMPOSE["services"]["bathyfleet"]["environment"]
    image = {name: value for name, value in environment_of_the_image().items() if name.startswith(PREFIX)}
    together = image | {name: filled_in(value, {"POSTGRES_PASSWORD": "x"}) for name, value in service.items()}
    assert set(together) <= KNOWN
    for name in list(os.environ):
        if name.startswith(PREFIX):
            monkeypatch.delenv(name)
    for name, value in together.items():
        monkeypatch.setenv(name, value)
    settings = load_settings()
    assert settings.loopback
    assert settings.migrates_itself
    assert settings.database_url == "postgresql+asyncpg://bathyfleet:x@127.0.0.1:5432/bathyfleet"
    assert (settings.port, settings.log_format) == (8080, "json")


def test_ports_of_the_image_are_those_of_the_settings() -> None:
    (line,) = re.findall(r"^EXPOSE (.*)$", IMAGE, re.MULTILINE)
    imc = Settings().imc
    announces = f"{imc.announce_ports[0]}-{imc.announce_ports[-1]}/udp"
    assert line.split() == [f"{Settings().port}/tcp", f"{imc.port}/udp", announces]


def test_the_health_check_asks_what_there_is(database_url: str) -> None:
    (line,) = re.findall(r"^HEALTHCHECK .* CMD (\[.*\])$", IMAGE, re.MULTILINE)
    command = [sys.executable, *json.loads(line)[1:]]
    settings = Settings(port=0, database_url=database_url, imc=ImcSettings(enabled=False))
    with running_in_thread(settings) as server:
        for port, code in ((server.url.rpartition(":")[2], 0), ("9", 1)):
            variables = {"BATHYFLEET_PORT": port, "PATH": os.environ["PATH"]}
            assert subprocess.run(command, env=variables, capture_output=True, check=False).returncode == code


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


def test_the_service_has_no_rights_that_it_does_not_need() -> None:
    service: dict[str, Any] = COMPOSE["services"]["bathyfleet"]
    assert service["cap_drop"] == ["ALL"]
    assert service["read_only"] is True
    assert re.search(r"^USER bathyfleet$", IMAGE, re.MULTILINE)
    assert COMPOSE["services"]["database"]["ports"][0].startswith("127.0.0.1:")
