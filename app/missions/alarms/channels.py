"""How what is told travels: by HTTP, e-mail and MQTT, each one attempt at a time."""

import asyncio
import base64
import hashlib
import hmac
import logging
import re
import socket
import ssl
from collections.abc import Mapping
from datetime import datetime
from typing import assert_never

import aiomqtt
import aiosmtplib
import httpx
from pydantic import SecretStr

from app.missions.alarm_settings import TOPIC_MARKS, AlarmSettings, MailRecipient, Topic, Webhook, signing_key
from app.missions.alarms.message import Message

PATIENCE_S = 15.0
"""An attempt that takes longer has failed."""
STEP_S = PATIENCE_S / 3
"""So is one of which a step to reach the other side does: libraries that are broken off leave connections open."""
LONGEST_ERROR = 300
_UNHEARD = logging.Logger("mqtt", logging.CRITICAL + 1)
"""What the library would log is told with the attempt, once."""
MOST_MAILED = 1000
"""E-mails of which is known who has them; of others all are written to again."""


class DeliveryError(Exception):
    """An attempt failed; ``str()`` says why, without a secret in it."""


def signature(secret: SecretStr, message_id: str, at: datetime, body: bytes) -> Mapping[str, str]:
    """Return the headers that sign a body as Standard Webhooks do: HMAC-SHA256 of ``id.timestamp.body``."""
    stamp = str(int(at.timestamp()))
    signed = b".".join((message_id.encode(), stamp.encode(), body))
    digest = hmac.new(signing_key(secret), signed, hashlib.sha256).digest()
    return {
        "webhook-id": message_id,
        "webhook-timestamp": stamp,
        "webhook-signature": f"v1,{base64.b64encode(digest).decode()}",
    }


class Channels:
    """Everything that can be told by, as the settings have it."""

    def __init__(self, settings: AlarmSettings) -> None:
        self._settings = settings
        self._client: httpx.AsyncClient | None = None
        self._trust: ssl.SSLContext | None = None
        self._opening = asyncio.Lock()
        self._mailed: dict[str, set[str]] = {}
        """Addresses that have a message, by its id, while the mail server refuses others."""

    async def send(self, recipient: str, message: Message, at: datetime) -> None:
        """Make one attempt. Raises DeliveryError."""
        known = self._settings.recipients.get(recipient)
        if known is None:
            raise DeliveryError(f"the settings have no recipient {recipient!r} any more")
        try:
            async with asyncio.timeout(PATIENCE_S):
                await self._send(known, message, at)
        except DeliveryError:
            raise
        except TimeoutError:
            raise DeliveryError(f"no answer within {PATIENCE_S:g} s") from None
        except Exception as error:
            # Whatever it is, another attempt is made later, and its words are the operator's clue.
            raise DeliveryError(self._shown(error, known)) from None

    async def _send(self, recipient: Webhook | MailRecipient | Topic, message: Message, at: datetime) -> None:
        match recipient:
            case Webhook():
                await self._post(recipient, message, at)
            case MailRecipient():
                await self._mail(recipient, message, at)
            case Topic():
                await self._publish(recipient, message, at)
            case _:
                assert_never(recipient)

    async def _post(self, webhook: Webhook, message: Message, at: datetime) -> None:
        body = message.body(at)
        headers = {"content-type": "application/json", "user-agent": "bathyfleet"}
        headers |= signature(webhook.secret, message.id, at, body)
        client = await self._http()
        # The answer's body is nobody's business: it is not read, and neither is where it would send us on to.
        async with client.stream("POST", webhook.url.get_secret_value(), content=body, headers=headers) as answer:
            if not answer.is_success:
                raise DeliveryError(f"answered HTTP {answer.status_code}")

    async def _http(self) -> httpx.AsyncClient:
        trust = await self._context()
        async with self._opening:
            if self._client is None:
                timeout = httpx.Timeout(PATIENCE_S, connect=STEP_S)
                self._client = httpx.AsyncClient(verify=trust, follow_redirects=False, timeout=timeout)
            return self._client

    async def _mail(self, people: MailRecipient, message: Message, at: datetime) -> None:
        server = self._settings.smtp
        trust = None if server.security == "none" else await self._context()
        have_it = self._mailed.get(message.id, set())
        left = [address for address in people.to if address not in have_it]
        refused, _ = await aiosmtplib.send(
            message.email(server.sender, people.to, at),
            sender=server.sender,
            recipients=left,
            hostname=server.host,
            port=server.port,
            username=server.user or None,
            password=server.password.get_secret_value() or None,
            # Its own way to find a name asks the network, which at sea may not answer.
            local_hostname=socket.gethostname(),
            use_tls=server.security == "tls",
            start_tls=server.security == "starttls",
            tls_context=trust,
            timeout=PATIENCE_S,
        )
        if not refused:
            self._mailed.pop(message.id, None)
            return
        while len(self._mailed) >= MOST_MAILED:
            self._mailed.pop(next(iter(self._mailed)))
        self._mailed[message.id] = have_it | set(left) - set(refused)
        # Who has it is not written to again; whoever is to be told and was not is tried until told.
        answers = "; ".join(f"{address}: {answer.code} {answer.message}" for address, answer in refused.items())
        raise DeliveryError(f"the mail server refused {' '.join(answers.split())}"[:LONGEST_ERROR])

    async def _publish(self, topic: Topic, message: Message, at: datetime) -> None:
        broker = self._settings.mqtt
        alarm = message.alarm
        name = topic.topic
        for mark, value in zip(TOPIC_MARKS, (alarm.mission_id or "-", alarm.kind, alarm.severity), strict=True):
            name = name.replace(mark, value)
        client = aiomqtt.Client(
            broker.host,
            broker.port,
            username=broker.user or None,
            password=broker.password.get_secret_value() or None,
            tls_context=await self._context() if broker.tls else None,
            timeout=STEP_S,
            logger=_UNHEARD,
        )
        try:
            async with client:
                # Returns when the broker has acknowledged it.
                await client.publish(name, message.body(at), qos=1)
        finally:
            # Also where it was connected and not let in: a broker that lets it in later would keep it for good.
            await client.__aexit__(None, None, None)

    async def _context(self) -> ssl.SSLContext:
        """Return whose certificates are trusted; reading them takes too long for the event loop."""
        async with self._opening:
            if self._trust is None:
                self._trust = await asyncio.to_thread(self._read_trust)
            return self._trust

    def _read_trust(self) -> ssl.SSLContext:
        context = httpx.create_ssl_context()
        if self._settings.ca_file is not None:
            context.load_verify_locations(self._settings.ca_file)
        return context

    def _shown(self, error: Exception, recipient: Webhook | MailRecipient | Topic) -> str:
        words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        if isinstance(recipient, Webhook):
            for part in _parts(recipient):
                words = re.sub(re.escape(part), "***", words, flags=re.IGNORECASE)
        for secret in self._settings.secrets:
            words = words.replace(secret, "***")
        return " ".join(words.split())[:LONGEST_ERROR]

    async def close(self) -> None:
        """Close connections that are kept."""
        if self._client is not None:
            await self._client.aclose()
            self._client = None


def _parts(webhook: Webhook) -> list[str]:
    """Return what of a webhook's address libraries put into errors, longest first."""
    url = httpx.URL(webhook.url.get_secret_value())
    encoded = [url.raw_host, url.netloc, url.userinfo, url.raw_path, url.query]
    parts = [webhook.url.get_secret_value(), str(url), url.host, url.username, url.password, url.path]
    parts += [part.decode("ascii") for part in encoded]
    return sorted({part for part in parts if part.strip("/")}, key=len, reverse=True)
