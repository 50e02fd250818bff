"""The guide to alarms says what is so: its table, its settings, and how a signature is verified."""

import re
import time
import tomllib
from datetime import UTC, datetime, timedelta
from typing import Any

from pydantic import SecretStr

from app.missions.alarm_kinds import alarms_text
from app.missions.alarm_settings import AlarmSettings
from app.missions.alarms.channels import signature
from tests.support.missions.alarms import SECRET
from tests.support.paths import PROJECT

GUIDE = (PROJECT / "docs" / "alarms.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


def test_the_guide_has_the_table() -> None:
    assert alarms_text() in GUIDE


def test_the_settings_of_the_guide_are_taken() -> None:
    settings = AlarmSettings.model_validate(tomllib.loads(block("toml"))["alarms"])
    assert list(settings.recipients) == ["bridge", "captain", "shore", "wall"]


def test_the_program_of_the_guide_tells_signed_from_forged_and_old() -> None:
    program: dict[str, Any] = {}
    exec(block("python"), program)  # noqa: S102 - our own guide
    verified, body = program["verified"], b'{"type":"alarm.raised"}'
    now = datetime.fromtimestamp(time.time(), UTC)
    for secret in (SECRET, "not base64, but long enough"):
        signed = dict(signature(SecretStr(secret), "d1", now, body))
        assert verified(signed, body, secret)
        assert not verified(signed, body + b" ", secret)
        assert not verified(signed, body, "another secret of some length")
        old = dict(signature(SecretStr(secret), "d1", now - timedelta(hours=1), body))
        assert not verified(old, body, secret)
