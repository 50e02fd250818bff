"""bathyfleet alarms: the table, and a test of every recipient."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import app
from app.missions.alarm_kinds import alarms_text
from tests.support.missions.alarms import SECRET, hook


@pytest.fixture
def configured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    file = tmp_path / "bathyfleet.toml"
    monkeypatch.setenv("BATHYFLEET_CONFIG", str(file))
    return file


def test_the_table_is_printed() -> None:
    assert CliRunner().invoke(app, ["alarms", "kinds"]).output == alarms_text()


def test_every_recipient_is_tried_and_a_failure_is_said(configured: Path) -> None:
    with hook() as well, hook(401) as wrong:
        configured.write_text(
            "".join(
                f'[[alarms.webhooks]]\nname = "{name}"\nurl = "{one.url}"\nsecret = "{SECRET}"\n'
                for name, one in (("well", well), ("wrong", wrong))
            )
        )
        both = CliRunner().invoke(app, ["alarms", "test"])
        one = CliRunner().invoke(app, ["alarms", "test", "well"])
    assert both.output == "well: delivered\nwrong: failed: answered HTTP 401\n"
    assert (both.exit_code, one.exit_code) == (1, 0)
    assert json.loads(well.requests[0][1])["data"]["kind"] == "test"


def test_who_is_not_in_the_settings_cannot_be_tried(configured: Path) -> None:
    configured.write_text("")
    nobody = CliRunner().invoke(app, ["alarms", "test"])
    assert str(nobody.exception) == "nobody is told of alarms"
    unknown = CliRunner().invoke(app, ["alarms", "test", "captain"])
    assert str(unknown.exception) == "there is no recipient 'captain'"
