"""Settings of alarms: what does not fit together is refused by name, and no secret is shown."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from app.missions.alarm_settings import AlarmSettings
from app.settings import SettingsError, load_settings

SECRET = "a secret of 16 bytes"  # noqa: S105 - the test's own
HOOK = {"name": "a", "url": "https://hooks.example/key-in-it", "secret": SECRET}
MAIL = {"host": "mail.example", "sender": "survey@ship.example"}


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"webhooks": [HOOK, HOOK]}, "'a' is the name of two recipients"),
        (
            {"webhooks": [HOOK], "routes": [{"to": ["b"]}]},
            r"routes\.0\.to names 'b', which is no recipient",
        ),
        ({"routes": [{"to": ["b"]}]}, "none: describe it in webhooks, emails or topics"),
        ({"webhooks": [HOOK | {"url": "ftp://hooks.example"}]}, "write a whole address"),
        ({"webhooks": [HOOK | {"url": "https://"}]}, "write a whole address"),
        ({"webhooks": [HOOK | {"url": "https://ex ample/alarms"}]}, "write a whole address"),
        ({"webhooks": [HOOK | {"url": "https://exämple..com/alarms"}]}, "write a whole address"),
        ({"webhooks": [HOOK | {"url": "https://hooks.example/\x7f"}]}, "write a whole address"),
        ({"webhooks": [HOOK | {"secret": "short"}]}, "it has 5 bytes, and 16 are the least"),
        ({"webhooks": [HOOK | {"secret": "whsec_***"}]}, "is not base64"),
        ({"emails": [{"name": "m", "to": ["a@b"]}]}, r"set smtp\.host and smtp\.sender"),
        ({"emails": [{"name": "m", "to": ["a@b\r\nBcc: c@d"]}], "smtp": MAIL}, "pattern"),
        ({"smtp": {"host": "mail.example"}}, r"smtp\.sender is missing"),
        ({"smtp": MAIL | {"user": "u", "security": "none"}}, "would be sent unprotected"),
        ({"smtp": MAIL | {"host": "smtp://mail.example"}}, "only the name or the address"),
        ({"smtp": MAIL | {"host": "mail.example:587"}}, "only the name or the address"),
        ({"mqtt": {"host": "mqtts://broker.example"}}, "only the name or the address"),
        ({"topics": [{"name": "t", "topic": "a/{vehicle}"}], "mqtt": {"host": "b"}}, r"there is no \{vehicle\}"),
        ({"topics": [{"name": "t", "topic": "$SYS/alarms"}], "mqtt": {"host": "b"}}, "broker's own"),
        ({"topics": [{"name": "t"}]}, r"set mqtt\.host"),
        ({"topics": [{"name": "t", "topic": "a/#"}], "mqtt": {"host": "b"}}, "pattern"),
        ({"ca_file": "/nowhere.pem"}, "No such file"),
    ],
)
def test_what_does_not_fit_together_is_refused(values: dict[str, Any], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        AlarmSettings.model_validate(values)


@pytest.mark.parametrize("host", ["mail.example", "192.0.2.7", "::1", "2001:db8::7", "mail"])
def test_servers_are_called_by_name_or_address(host: str) -> None:
    assert AlarmSettings.model_validate({"mqtt": {"host": host}}).mqtt.host == host


def test_no_secret_is_shown() -> None:
    settings = AlarmSettings.model_validate({"webhooks": [HOOK], "smtp": MAIL | {"user": "u", "password": "hidden"}})
    for shown in (repr(settings), str(settings.model_dump()), settings.model_dump_json()):
        assert SECRET not in shown
        assert "key-in-it" not in shown
        assert "hidden" not in shown
    assert settings.secrets == ["https://hooks.example/key-in-it", SECRET, "hidden"]


def test_a_file_with_a_fault_is_refused_without_showing_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "bathyfleet.toml"
    file.write_text(f'[[alarms.webhooks]]\nname = "a"\nurl = "nonsense-with-key"\nsecret = "{SECRET}"\nextra = 1\n')
    monkeypatch.setenv("BATHYFLEET_CONFIG", str(file))
    with pytest.raises(SettingsError) as caught:
        load_settings()
    said = "\n".join(caught.value.problems)
    assert "alarms.webhooks.0.url" in said
    assert "nonsense" not in said
    assert SECRET not in said
