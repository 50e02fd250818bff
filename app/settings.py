"""The service's settings: declared once, read from the environment and from ``bathyfleet.toml``."""

import difflib
import ipaddress
import json
import os
import tomllib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, get_args
from urllib.parse import urlsplit

from pydantic import BaseModel, Field, TypeAdapter, ValidationError, ValidationInfo, field_validator
from pydantic.fields import FieldInfo
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    TomlConfigSettingsSource,
)

from app.log_choices import LogFormat, LogLevel
from app.missions.settings import ServiceSettings
from app.optional_file import OptionalFile

PREFIX = "BATHYFLEET_"
CONFIG_VARIABLE = "BATHYFLEET_CONFIG"
DEFAULT_CONFIG = Path("bathyfleet.toml")

# Carry the prefix without being settings: the file's place, where the tests find real sea floors, the build's switch.
_OTHER_VARIABLES = {
    CONFIG_VARIABLE,
    *(PREFIX + name for name in ("TOKEN", "TERRAINS", "CAPTURES", "SKIP_DASHBOARD")),
}

_SECRET = {"database_url", "pings_url", "alarms"}
"""Settings with passwords in them: a value that is wrong is not shown."""

_DRIVERS = {"sqlite": "sqlite+aiosqlite", "postgresql": "postgresql+asyncpg", "postgres": "postgresql+asyncpg"}


class SettingsError(Exception):
    """The settings cannot be used; ``problems`` has one line for each thing that is wrong."""

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = list(problems)
        super().__init__("; ".join(self.problems))


class StartupError(Exception):
    """The service cannot start as it is set up; ``str()`` says why and what to do."""


class Settings(BaseSettings, ServiceSettings):
    """Everything that can be set. Sources, strongest first: command line, environment, ``bathyfleet.toml``.

    The environment uses the prefix ``BATHYFLEET_`` and two underscores between levels:
    ``BATHYFLEET_PORT=9000``, ``BATHYFLEET_IMC__PORT=6102``. The file is ``bathyfleet.toml`` in the working
    directory, or the one that ``BATHYFLEET_CONFIG`` names. Use :func:`load_settings` for helpful errors.
    """

    model_config = SettingsConfigDict(
        env_prefix=PREFIX, env_nested_delimiter="__", extra="forbid", frozen=True, validate_default=True
    )

    host: str = Field(
        default="127.0.0.1",
        description="Address to listen on; others than loopback need an access token or --insecure",
    )
    port: int = Field(default=8080, ge=0, le=65535, description="TCP port to listen on; 0: any free one")
    insecure: bool = Field(
        default=False, description="Serve without access tokens even to other machines: anyone may command"
    )
    allowed_origins: tuple[str, ...] = Field(
        default=(),
        description="Origins of other web pages that may use the API, for example https://console.example; never *",
    )
    peer_url: str = Field(
        default="",
        pattern=r"^$|^https?://[^\s/]+$",
        description="Where other processes on the same database reach this one, for example http://10.0.0.5:8080; "
        "empty: host and port",
    )
    tls_certificate: OptionalFile = Field(
        default=None, description="File with the certificate and its chain (PEM): serve HTTPS instead of HTTP"
    )
    tls_key: OptionalFile = Field(
        default=None, description="File with the certificate's private key (PEM); empty: in the same file"
    )
    trusted_proxies: tuple[str, ...] = Field(
        default=(),
        description="Addresses or networks of reverse proxies whose X-Forwarded-For and X-Forwarded-Proto are believed",
    )
    max_requests_per_s: float = Field(
        default=1000.0,
        ge=0,
        le=1_000_000,
        description="Most requests a second by one token, or by one address without; 0: any number",
    )
    max_failed_logins: int = Field(
        default=10, ge=1, le=10_000, description="Most wrong tokens a minute from one address"
    )
    max_connections: int = Field(
        default=1000,
        ge=16,
        le=100_000,
        description="Most open HTTP connections. One user, or one address without a token, has at most a quarter of "
        "them busy, one operator half; an eighth is for operators alone. Idle ones of strangers are closed first",
    )
    slow_client_s: float = Field(
        default=30.0, ge=1, le=3600, description="A client that takes longer to send on is not waited for"
    )
    audit_days: int = Field(
        default=400, ge=30, le=36_500, description="Days that the audit log is kept; never less than 30"
    )
    auto_migrate: bool | None = Field(
        default=None,
        description="Bring the database's tables up to date at the start; without a value: only for SQLite",
    )
    log_level: LogLevel = Field(default="info", description="How much is logged")
    log_format: LogFormat = Field(
        default="console", description="Lines for people, or one JSON object per line for log collectors"
    )
    charts: str = Field(
        default="",
        pattern=r"^$|\.pmtiles$|^https?://[^\s;,'\"]+\{z\}[^\s;,'\"]*$",
        description="What the dashboard draws under the map: a .pmtiles file with raster tiles, or the address of a "
        "tile server with {z}, {x} and {y}; empty: nothing, which works without internet",
    )
    output_dir: Path = Field(default=Path("output"), description="Folder for exported files")
    max_body_bytes: int = Field(default=8 * 2**20, ge=1024, le=2**30, description="Largest request body that is taken")
    max_import_bytes: int = Field(
        default=128 * 2**20, ge=1024, le=2**30, description="Largest file of soundings, of a map or log that is taken"
    )
    max_bytes_in_flight: int = Field(
        default=256 * 2**20,
        ge=1024,
        le=2**40,
        description="Most bytes of request bodies and files under way at the same time, of which nobody gets all; at "
        "least twice the largest of them",
    )
    max_streams: int = Field(
        default=200,
        ge=1,
        le=100_000,
        description="Most live views and event streams at the same time, shared out as max_connections is",
    )

    @field_validator("log_level", "log_format", mode="before")
    @classmethod
    def _lower_case(cls, value: object) -> object:
        return value.lower() if isinstance(value, str) else value

    @field_validator("database_url")
    @classmethod
    def _names_a_supported_driver(cls, url: str) -> str:
        scheme, separator, rest = url.partition("://")
        scheme = _DRIVERS.get(scheme, scheme)
        if not separator or scheme not in _DRIVERS.values():
            raise ValueError("use sqlite+aiosqlite:///FILE or postgresql+asyncpg://USER:PASSWORD@HOST/NAME")
        return f"{scheme}://{rest}"

    @field_validator("pings_url")
    @classmethod
    def _can_be_reached(cls, url: str) -> str:
        if "://" in url:
            from app.storage.ping_files import check_place  # with the database's library: few need it here

            check_place(url)
        return url

    @field_validator("trusted_proxies")
    @classmethod
    def _are_networks(cls, proxies: tuple[str, ...]) -> tuple[str, ...]:
        for proxy in proxies:
            try:
                ipaddress.ip_network(proxy)
            except ValueError:
                raise ValueError(
                    f"{proxy!r} is neither an address nor a network such as 10.0.0.0/24, without host bits"
                ) from None
        return proxies

    @field_validator("allowed_origins")
    @classmethod
    def _are_origins(cls, origins: tuple[str, ...]) -> tuple[str, ...]:
        for origin in origins:
            wrong = _wrong_with_origin(origin)
            if wrong:
                raise ValueError(
                    f"{origin!r} {wrong}; an origin is what browsers send: scheme and host, and a port that is not the "
                    "usual one, such as https://console.example or http://10.0.0.5:8080"
                )
        return origins

    @field_validator("tls_key")
    @classmethod
    def _has_a_certificate(cls, key: Path | None, given: ValidationInfo) -> Path | None:
        if key is not None and given.data.get("tls_certificate") is None:
            raise ValueError("a key needs a certificate: set tls_certificate, too")
        return key

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Arguments, then the environment, then the file."""
        return init_settings, env_settings, TomlConfigSettingsSource(settings_cls, toml_file=config_file())

    @property
    def loopback(self) -> bool:
        """Whether only this machine can connect."""
        return is_loopback(self.host)

    @property
    def bytes_in_flight(self) -> int:
        """Most bytes of requests under way at the same time: room for two of the largest, whatever is set."""
        return max(self.max_bytes_in_flight, 2 * self.max_body_bytes, 2 * self.max_import_bytes)

    @property
    def migrates_itself(self) -> bool:
        """Whether the service brings the database's tables up to date when it starts."""
        if self.auto_migrate is not None:
            return self.auto_migrate
        return self.database_url.startswith("sqlite")


def _wrong_with_origin(origin: str) -> str:
    """Return what keeps a text from being an origin; empty for nothing."""
    if "*" in origin:
        return "stands for every page there is, which could then command vehicles through an operator's browser"
    if origin == "null":
        return "is what any page in a sandbox, and any file, sends"
    try:
        parts = urlsplit(origin)
        port = parts.port
    except ValueError as error:
        return f"cannot be taken apart ({error})"
    if parts.scheme not in ("http", "https") or "://" not in origin:
        return "has no scheme, http or https"
    if not parts.hostname:
        return "names no host"
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    usual = port == {"http": 80, "https": 443}[parts.scheme]
    sent = f"{parts.scheme}://{host}" + (f":{port}" if port is not None and not usual else "")
    return "" if origin == sent else f"is not what browsers send, which would be {sent}"


def is_loopback(host: str) -> bool:
    """Tell whether a host name or address means this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.split("%")[0]).is_loopback
    except ValueError:
        return False


def config_file() -> Path:
    """The settings file: what ``BATHYFLEET_CONFIG`` names, else ``bathyfleet.toml`` here (it need not exist)."""
    return Path(os.environ.get(CONFIG_VARIABLE) or DEFAULT_CONFIG)


def load_settings(**overrides: Any) -> Settings:
    """Read the settings; arguments that are None are left to the other sources.

    Raises
    ------
    SettingsError
        With one line per wrong value, unknown name or unreadable file, each naming its source.
    """
    file = config_file()
    if os.environ.get(CONFIG_VARIABLE) and not file.is_file():
        raise SettingsError([f"{CONFIG_VARIABLE} names {str(file)!r}, which is not a file"])
    unknown = [
        _unknown(f"environment variable {name}", name, _variable_names(Settings, PREFIX))
        for name in sorted(os.environ)
        if name.startswith(PREFIX) and name not in _OTHER_VARIABLES and name not in _variable_names(Settings, PREFIX)
    ]
    if unknown:
        raise SettingsError(unknown)
    try:
        return Settings(**{name: value for name, value in overrides.items() if value is not None})
    except ValidationError as error:
        raise SettingsError(_describe(error, overrides)) from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError([f"{file} is not TOML: {error}"]) from None
    except UnicodeDecodeError as error:
        wrong = f"byte {error.start} is {error.object[error.start]:#04x}"
        raise SettingsError([f"{file} is not UTF-8, as TOML has to be: {wrong}; save it as UTF-8"]) from None
    except OSError as error:
        raise SettingsError([f"{file} cannot be read: {error.strerror}"]) from None
    except Exception as error:
        # pydantic-settings wraps what it cannot parse in an exception of its own that names the field only.
        if type(error).__name__ == "SettingsError":
            raise SettingsError([f"{error}; lists and tables are written as JSON in the environment"]) from None
        raise


def overridden() -> dict[str, str]:
    """Return the settings of the file that environment variables overrule, each with its variable."""
    file = config_file()
    if not file.is_file():
        return {}
    written = tomllib.loads(file.read_text(encoding="utf-8"))
    found = {}
    for variable in sorted(_variable_names(Settings, PREFIX) & set(os.environ)):
        path = variable.removeprefix(PREFIX).lower().split("__")
        value: Any = written
        for part in path:
            value = value.get(part) if isinstance(value, dict) else None
        if value is not None and not _are_the_same(path, value, os.environ[variable]):
            found[".".join(path)] = variable
    return found


def _are_the_same(path: Sequence[str], written: object, variable: str) -> bool:
    """Whether what the file has of a setting and what a variable has are one value, as in 16385 and 0x4001."""
    model: type[BaseModel] = Settings
    for part in path[:-1]:
        below = model.model_fields[part].annotation
        if not (isinstance(below, type) and issubclass(below, BaseModel)):
            return False
        model = below
    field = model.model_fields[path[-1]]
    kind: Any = Annotated[field.annotation, field]
    adapter: TypeAdapter[object] = TypeAdapter(kind)
    given: object = variable
    with suppress(ValueError):
        given = json.loads(variable) if variable[:1] in "[{" else variable
    try:
        return adapter.validate_python(written) == adapter.validate_python(given)
    except ValidationError:
        return False


def _variable_names(model: type[BaseModel], prefix: str) -> set[str]:
    names: set[str] = set()
    for name, field in model.model_fields.items():
        variable = prefix + name.upper()
        names.add(variable)
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            names |= _variable_names(field.annotation, variable + "__")
    return names


def _source(path: Sequence[str], message: str) -> str:
    """Return the variables that a wrong value comes from, or else the file.

    A section that does not fit together comes from all that is set of it, unless the message names what is wrong.
    """
    variables = [PREFIX + "__".join(path[: k + 1]).upper() for k in range(len(path))]
    above = [variable for variable in variables if variable in os.environ]
    if above:
        return above[-1]
    below = sorted(name for name in os.environ if name.startswith(variables[-1] + "__"))
    named = [name for name in below if name.rpartition("__")[2].lower() in message]
    if named:
        return ", ".join(named)
    file = config_file()
    return ", ".join([*below, *([str(file)] if file.is_file() or not below else [])])


def _unknown(what: str, name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]}?" if close else "known are " + ", ".join(sorted(known))
    return f"{what} is not a setting: {hint}"


def _declared(path: Sequence[str]) -> tuple[type[BaseModel], FieldInfo | None]:
    """Return the section that a path leads into, and the setting of its last name; None where there is none."""
    section: type[BaseModel] = Settings
    field: FieldInfo | None = None
    for name in path:
        if name.isdecimal():  # an element of a list
            continue
        within = () if field is None else (field.annotation, *get_args(field.annotation))
        sections = [kind for kind in within if isinstance(kind, type) and issubclass(kind, BaseModel)]
        section = sections[0] if sections else section
        field = section.model_fields.get(name)
    return section, field


def _describe(error: ValidationError, overrides: dict[str, Any]) -> Iterable[str]:
    for entry in error.errors(include_url=False):
        path = [str(part) for part in entry["loc"]]
        name = ".".join(path)
        source = "the command line" if overrides.get(path[0]) is not None else _source(path, entry["msg"])
        section, field = _declared(path)
        if entry["type"] == "extra_forbidden":
            yield _unknown(f"{name} (from {source})", path[-1], section.model_fields)
        else:
            message = entry["msg"].removeprefix("Value error, ")
            if entry["type"] == "string_pattern_mismatch" and field is not None and field.description:
                message = f"needs another form: {field.description[0].lower()}{field.description[1:]}"
            shown = "" if path[0] in _SECRET else f" is {entry['input']!r}"
            yield f"{name}{shown} (from {source}): {message[0].lower()}{message[1:]}"
