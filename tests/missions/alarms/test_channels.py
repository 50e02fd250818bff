"""E-mail and MQTT, against a real mail server and a real broker; what errors and the log show of webhooks."""

import asyncio
import io
import ssl
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiomqtt
import orjson
import pytest

from app.api import logs
from app.missions.alarm_kinds import AlarmKind
from app.missions.alarm_settings import AlarmSettings
from app.missions.alarms import channels
from app.missions.views.alarms import DeliveryState
from tests.support.missions.alarms import (
    PASSWORD,
    SECRET,
    Clock,
    Watch,
    broker,
    hook,
    mail_server,
    make_certificate,
)

pytestmark = pytest.mark.filterwarnings("ignore:Session.login_data is deprecated")

Keep = Callable[[AlarmSettings], Awaitable[Watch]]


def by_mail(port: int, certificate: Path | None, **server: Any) -> AlarmSettings:
    return AlarmSettings.model_validate(
        {
            "routes": [{"to": ["captain"]}],
            "emails": [{"name": "captain", "to": ["captain@ship.example", "mate@ship.example"]}],
            "smtp": {
                "host": "127.0.0.1",
                "port": port,
                "user": "ship",
                "password": PASSWORD,
                "sender": "survey@ship.example",
            }
            | server,
            "ca_file": certificate,
        }
    )


async def test_an_email_goes_by_starttls_with_a_login(keep_watch: Keep, tmp_path: Path) -> None:
    certificate = make_certificate(tmp_path)
    with mail_server(certificate) as (box, port):
        watch = await keep_watch(by_mail(port, certificate))
        alarm = await watch.raise_alarm(AlarmKind.LEAK)
        await watch.look()
        [delivery] = (await watch.report(alarm)).deliveries
        assert (delivery.state, delivery.error) == (DeliveryState.DELIVERED, "")
        await watch.dispatcher.acknowledge(alarm.id, "Ana")
        await watch.look()
    first, second = box.mails
    assert box.encrypted == [True, True]
    assert str(first["Subject"]).startswith("[CRITICAL] a is lost: silent (")
    assert first["To"] == "captain@ship.example, mate@ship.example"
    assert first["Message-ID"] == f"<{delivery.id}@bathyfleet.invalid>"
    assert "To do:     recover it where it comes up" in first.get_payload()
    assert "acknowledged: a is lost" in second["Subject"]
    assert "Acknowledged by Ana" in second.get_payload()


async def test_whose_address_was_refused_is_mailed_again_and_nobody_else(
    keep_watch: Keep, clock: Clock, tmp_path: Path
) -> None:
    certificate = make_certificate(tmp_path)
    with mail_server(certificate) as (box, port):
        box.refused = {"mate@ship.example"}
        watch = await keep_watch(by_mail(port, certificate))
        alarm = await watch.raise_alarm(AlarmKind.LEAK)
        await watch.look()
        [delivery] = (await watch.report(alarm)).deliveries
        assert delivery.state is DeliveryState.WAITING
        assert delivery.error == "the mail server refused mate@ship.example: 550 5.1.1 no such mailbox"
        box.refused = set()
        clock.advance(10)
        await watch.look()
        [delivery] = (await watch.report(alarm)).deliveries
        assert (delivery.state, delivery.attempts) == (DeliveryState.DELIVERED, 2)
    assert [mail["X-RcptTo"] for mail in box.mails] == ["captain@ship.example", "mate@ship.example"]


async def test_no_email_goes_to_a_server_that_nobody_vouches_for_or_with_a_wrong_password(
    keep_watch: Keep, tmp_path: Path
) -> None:
    certificate = make_certificate(tmp_path)
    with mail_server(certificate) as (box, port):
        for settings, why in (
            (by_mail(port, None), "certificate verify failed"),
            (by_mail(port, certificate, password="a wrong one"), "5.7.8"),  # noqa: S106
        ):
            watch = await keep_watch(settings)
            alarm = await watch.raise_alarm(vehicle=why)
            await watch.look()
            [delivery] = (await watch.report(alarm)).deliveries
            assert delivery.state is DeliveryState.WAITING
            assert why in delivery.error
            assert "a wrong one" not in delivery.error
    assert box.mails == []


async def test_mqtt_takes_it_at_least_once_and_no_broker_is_tried_again(
    keep_watch: Keep, caplog: pytest.LogCaptureFixture
) -> None:
    def by_broker(port: int) -> AlarmSettings:
        return AlarmSettings.model_validate(
            {
                "routes": [{"to": ["wall"]}],
                "topics": [{"name": "wall", "topic": "ship/alarms/{severity}/{kind}"}],
                "mqtt": {"host": "127.0.0.1", "port": port, "tls": False},
            }
        )

    async with broker() as port:
        watch = await keep_watch(by_broker(port))
        async with aiomqtt.Client("127.0.0.1", port) as screen:
            await screen.subscribe("ship/alarms/#", qos=1)
            alarm = await watch.raise_alarm(AlarmKind.LEAK)
            await watch.look()
            message = await anext(screen.messages)
    [delivery] = (await watch.report(alarm)).deliveries
    assert delivery.state is DeliveryState.DELIVERED
    assert (str(message.topic), message.qos) == ("ship/alarms/critical/leak", 1)
    content = orjson.loads(bytes(message.payload))
    assert (content["type"], content["id"], content["data"]["id"]) == ("alarm.raised", delivery.id, alarm.id)

    later = await watch.raise_alarm(AlarmKind.TOO_DEEP)
    await watch.look()
    [delivery] = (await watch.report(later)).deliveries
    assert delivery.state is DeliveryState.WAITING
    assert "refused" in delivery.error
    assert [record for record in caplog.records if record.name == "mqtt"] == [], "the error says it"


@pytest.mark.parametrize("way", ["mqtt", "https"])
async def test_who_does_not_answer_is_not_left_with_an_open_connection(
    keep_watch: Keep, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    """A broker that answers late would keep one for each attempt, and so would this process."""
    monkeypatch.setattr(channels, "STEP_S", 0.2)
    left = asyncio.Event()

    async def silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read()  # to the end
        left.set()
        writer.close()

    async with await asyncio.start_server(silent, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        ways: dict[str, dict[str, Any]] = {
            "mqtt": {"topics": [{"name": "a"}], "mqtt": {"host": "127.0.0.1", "port": port, "tls": False}},
            "https": {"webhooks": [{"name": "a", "url": f"https://127.0.0.1:{port}", "secret": SECRET}]},
        }
        watch = await keep_watch(AlarmSettings.model_validate(ways[way] | {"routes": [{"to": ["a"]}]}))
        alarm = await watch.raise_alarm(AlarmKind.LEAK)
        await watch.look()
        [delivery] = (await watch.report(alarm)).deliveries
        assert delivery.state is DeliveryState.WAITING
        assert delivery.error
        async with asyncio.timeout(10):
            await left.wait()


async def test_a_mail_server_that_falls_silent_does_not_keep_the_service_from_ending(keep_watch: Keep) -> None:
    asked, over = asyncio.Event(), asyncio.Event()

    async def silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"220 mail.example\r\n")
        await reader.readline()
        asked.set()
        await over.wait()
        writer.close()

    async with await asyncio.start_server(silent, "127.0.0.1", 0) as server:
        watch = await keep_watch(by_mail(server.sockets[0].getsockname()[1], None, security="none", user=""))
        await watch.raise_alarm(AlarmKind.LEAK)
        await watch.dispatcher.look()
        await asked.wait()
        async with asyncio.timeout(10):  # less than a command to the server may take
            await watch.dispatcher.close()
        assert not over.is_set(), "it ended while the server was still silent"
        over.set()


async def test_neither_errors_nor_the_log_show_parts_of_a_webhooks_address(keep_watch: Keep, tmp_path: Path) -> None:
    certificate = make_certificate(tmp_path)  # for 127.0.0.1
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate)
    stream = io.StringIO()
    logs.configure("debug", "console", stream)
    try:
        server = await asyncio.start_server(lambda _reader, writer: writer.close(), "127.0.0.1", 0, ssl=context)
        async with server:
            port = server.sockets[0].getsockname()[1]
            with hook(307) as elsewhere:
                addresses = f"https://Key:word@LocalHost:{port}/in/it?token=7", elsewhere.url
                for address in addresses:
                    settings = {
                        "webhooks": [{"name": "a", "url": address, "secret": SECRET}],
                        "routes": [{"to": ["a"]}],
                        "ca_file": certificate,
                    }
                    watch = await keep_watch(AlarmSettings.model_validate(settings))
                    alarm = await watch.raise_alarm(vehicle=address[:5])
                    await watch.look()
                    [delivery] = (await watch.report(alarm)).deliveries
                    assert ("Hostname mismatch" if address == addresses[0] else "answered HTTP 307") in delivery.error
                    stream.write(delivery.error)
            said = stream.getvalue().lower()
    finally:
        logs.configure()
    assert "alarm not delivered" in said
    for part in ("localhost", "127.0.0.1", str(port), str(elsewhere.port), "key:", "word@", "/in/it", "token=7"):
        assert part not in said, part
