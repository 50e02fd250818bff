"""Who is told of alarms, and by which way. Addresses come from here only, never from a request."""

import base64
import binascii
import ipaddress
import re
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, SecretStr, field_validator, model_validator

from app.certificates import wrong_with_authorities
from app.missions.alarm_kinds import AlarmKind, AlarmSeverity
from app.optional_file import OptionalFile

SECRET_PREFIX = "whsec_"  # noqa: S105 - of the standard, before the secret
LEAST_SECRET_BYTES = 16
TOPIC_MARKS = ("{mission}", "{kind}", "{severity}")
"""What in a topic is filled in."""

RecipientName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}$")]
MailAddress = Annotated[str, Field(max_length=254, pattern=r"^[^@\s<>,;]+@[^@\s<>,;]+$")]


def _server(host: str) -> str:
    try:
        is_plain = not host or ":" not in host or bool(ipaddress.IPv6Address(host))
    except ValueError:
        is_plain = False
    if not is_plain or re.search(r"[\s/@]", host):
        raise ValueError("write only the name or the address, such as server.ship.example, and the port as port")
    return host


Server = Annotated[str, AfterValidator(_server)]


class _Section(BaseModel):
    """A section of the settings; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)


class Webhook(_Section):
    """A program that is told by HTTP."""

    name: RecipientName = Field(description="What routes call it: letters, digits, blanks and . _ -")
    url: SecretStr = Field(description="Where alarms are posted to, http or https; never shown, as it may hold keys")
    secret: SecretStr = Field(
        description="What it is signed with: at least 16 bytes, or whsec_ and base64 as Standard Webhooks have it"
    )

    @field_validator("url")
    @classmethod
    def _is_an_address(cls, url: SecretStr) -> SecretStr:
        import httpx  # what posts there has to understand it; few settings have one

        text = url.get_secret_value()
        try:
            parts = httpx.URL(text)
            whole = parts.scheme in ("http", "https") and bool(parts.host) and not re.search(r"\s", text)
        except httpx.InvalidURL:
            whole = False
        if not whole:
            raise ValueError("write a whole address, such as https://hooks.example/alarms")
        return url

    @field_validator("secret")
    @classmethod
    def _is_long_enough(cls, secret: SecretStr) -> SecretStr:
        try:
            key = signing_key(secret)
        except ValueError:
            raise ValueError("what follows whsec_ is not base64") from None
        if len(key) < LEAST_SECRET_BYTES:
            raise ValueError(f"it has {len(key)} bytes, and {LEAST_SECRET_BYTES} are the least")
        return secret


class MailRecipient(_Section):
    """People who are told by e-mail."""

    name: RecipientName = Field(description="What routes call them: letters, digits, blanks and . _ -")
    to: tuple[MailAddress, ...] = Field(
        min_length=1, max_length=50, description="Their addresses, each such as duty@institute.example"
    )


class Topic(_Section):
    """A topic on the MQTT broker."""

    name: RecipientName = Field(description="What routes call it: letters, digits, blanks and . _ -")
    topic: str = Field(
        default="bathyfleet/alarms",
        pattern=r"^[^+#\x00]{1,200}$",
        description="What is published to, without + and #; {mission}, {kind} and {severity} in it are filled in",
    )

    @field_validator("topic")
    @classmethod
    def _can_be_filled_in(cls, topic: str) -> str:
        unknown = set(re.findall(r"\{[^{}]*\}", topic)) - set(TOPIC_MARKS)
        if unknown:
            raise ValueError(f"there is no {min(unknown)}: {', '.join(TOPIC_MARKS)} are filled in")
        if topic.startswith("$"):
            raise ValueError("topics that begin with $ are the broker's own")
        return topic


class Route(_Section):
    """Who is told of which alarms, and when."""

    to: tuple[RecipientName, ...] = Field(min_length=1, description="Names of webhooks, e-mail recipients and topics")
    severity: AlarmSeverity = Field(default=AlarmSeverity.MINOR, description="Least severity that is told of")
    kinds: tuple[AlarmKind, ...] = Field(default=(), description="Kinds that are told of; empty: all")
    missions: tuple[str, ...] = Field(
        default=(), description="Names or ids of missions, * and ? stand for anything; empty: all"
    )
    after_s: float = Field(
        default=0.0,
        ge=0,
        le=86_400,
        description="Told when nobody has acknowledged the alarm for so long; 0: at once",
    )
    acknowledgements: bool = Field(
        default=True, description="Whether they are told, too, who acknowledged it, and that it is over"
    )


class MailServer(_Section):
    """The mail server that e-mails are given to."""

    host: Server = Field(default="", description="Name or address of the mail server; empty: no e-mail is sent")
    port: int = Field(default=587, ge=1, le=65535, description="Its TCP port; usual are 587 (starttls) and 465 (tls)")
    security: Literal["starttls", "tls", "none"] = Field(
        default="starttls", description="How the connection is protected; a password is never sent over none"
    )
    user: str = Field(default="", description="Who logs in; empty: nobody does")
    password: SecretStr = Field(default=SecretStr(""), description="The user's password")
    sender: str = Field(
        default="",
        pattern=r"^$|^[^@\s<>,;]+@[^@\s<>,;]+$",
        description="Address that the e-mails come from, such as survey@ship.example",
    )

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> Self:
        if self.host and not self.sender:
            raise ValueError("smtp.sender is missing: e-mails need an address that they come from")
        if self.user and self.security == "none":
            raise ValueError("smtp.user is set and smtp.security is none: the password would be sent unprotected")
        return self


class Broker(_Section):
    """The MQTT broker that alarms are published on."""

    host: Server = Field(default="", description="Name or address of the MQTT broker; empty: nothing is published")
    port: int = Field(default=8883, ge=1, le=65535, description="Its TCP port; usual are 8883 (TLS) and 1883")
    tls: bool = Field(default=True, description="Whether the connection is protected by TLS")
    user: str = Field(default="", description="Who logs in; empty: nobody does")
    password: SecretStr = Field(default=SecretStr(""), description="The user's password")

    @property
    def sends_password_openly(self) -> bool:
        """Whether the password can be read on the network on its way to the broker."""
        return bool(self.host and self.user) and not self.tls and self.host not in ("localhost", "127.0.0.1", "::1")


class AlarmSettings(_Section):
    """How alarms leave the page."""

    routes: tuple[Route, ...] = Field(default=(), description="Who is told of what; without any nobody is")
    webhooks: tuple[Webhook, ...] = Field(default=(), description="Programs that are told by HTTP")
    emails: tuple[MailRecipient, ...] = Field(default=(), description="People who are told by e-mail")
    topics: tuple[Topic, ...] = Field(default=(), description="Topics of the MQTT broker")
    repeat_after_s: float = Field(
        default=300.0,
        ge=0,
        le=86_400,
        description="An alarm like one that was told less than this ago, goes on and is not acknowledged is shown, but "
        "told to nobody before",
    )
    give_up_after_s: float = Field(
        default=86_400.0, ge=60, le=2_592_000, description="A delivery that fails is tried again for so long"
    )
    ca_file: OptionalFile = Field(
        default=None, description="File with certificates (PEM) of authorities that are trusted beside the usual ones"
    )
    smtp: MailServer = Field(default=MailServer(), description="The mail server")
    mqtt: Broker = Field(default=Broker(), description="The MQTT broker")

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        names = [one.name for one in self._everybody]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{twice[0]!r} is the name of two recipients: give each its own")
        for number, route in enumerate(self.routes):
            for name in route.to:
                if name not in names:
                    known = ", ".join(sorted(names)) or "none: describe it in webhooks, emails or topics"
                    raise ValueError(f"routes.{number}.to names {name!r}, which is no recipient; there are {known}")
        if self.emails and not self.smtp.host:
            raise ValueError("emails need a mail server: set smtp.host and smtp.sender")
        if self.topics and not self.mqtt.host:
            raise ValueError("topics need a broker: set mqtt.host")
        if self.ca_file is not None and (wrong := wrong_with_authorities(self.ca_file)):
            raise ValueError(f"ca_file {str(self.ca_file)!r} cannot be used: {wrong}")
        return self

    @property
    def recipients(self) -> dict[str, Webhook | MailRecipient | Topic]:
        """Everybody who can be told, by name."""
        return {one.name: one for one in self._everybody}

    @property
    def _everybody(self) -> list[Webhook | MailRecipient | Topic]:
        return [*self.webhooks, *self.emails, *self.topics]

    @property
    def secrets(self) -> list[str]:
        """What must not be shown anywhere, longest first."""
        held = [self.smtp.password, self.mqtt.password]
        for webhook in self.webhooks:
            held += [webhook.url, webhook.secret]
        shown = (secret.get_secret_value() for secret in held)
        return sorted((secret for secret in shown if secret), key=len, reverse=True)


def signing_key(secret: SecretStr) -> bytes:
    """Return the bytes that a webhook is signed with. Raises ValueError where base64 is not base64."""
    text = secret.get_secret_value()
    if not text.startswith(SECRET_PREFIX):
        return text.encode()
    try:
        return base64.b64decode(text.removeprefix(SECRET_PREFIX), validate=True)
    except binascii.Error as error:
        raise ValueError(str(error)) from None
