"""Settings: where they come from, and what a mistake in them is answered with."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import BaseModel

from app.cli import app as command_line
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import PLANNERS
from app.missions.fleet.links.imc import bridge_settings
from app.missions.settings import ImcSettings
from app.missions.spec.mission import MissionSpec
from app.settings import Settings, SettingsError, is_loopback, load_settings, overridden
from imc_bridge.settings import DEFAULT_RATE_LIMITERS, BridgeSettings, ConsoleSettings
from tests.support.paths import PROJECT


@pytest.fixture(autouse=True)
def _alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No settings of the machine that runs the tests."""
    import os

    for name in list(os.environ):
        if name.startswith("BATHYFLEET_"):
            monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)


def test_the_defaults_are_safe() -> None:
    settings = load_settings()
    assert settings.loopback
    assert not settings.insecure
    assert settings.migrates_itself
    assert settings.database_url == "sqlite+aiosqlite:///bathyfleet.db"


def test_the_command_line_beats_the_environment_beats_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bathyfleet.toml").write_text('port = 1\nhost = "localhost"\ntime_scale = 2.5\n[imc]\nport = 7001\n')
    monkeypatch.setenv("BATHYFLEET_PORT", "2")
    monkeypatch.setenv("BATHYFLEET_HOST", "127.0.0.2")
    monkeypatch.setenv("BATHYFLEET_IMC__NAME", "quay")
    settings = load_settings(port=3, host=None)
    assert (settings.port, settings.host, settings.time_scale) == (3, "127.0.0.2", 2.5)
    assert (settings.imc.name, settings.imc.port) == ("quay", 7001)


def test_what_the_environment_overrules_in_the_file_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bathyfleet.toml").write_text('port = 8443\nhost = "127.0.0.1"\ninsecure = false\n[imc]\nport = 7001\n')
    assert overridden() == {}
    for name, value in {
        "PORT": "8080",
        "HOST": "127.0.0.1",
        "INSECURE": "False",
        "IMC__PORT": "1",
        "AUDIT_DAYS": "99",
    }.items():
        monkeypatch.setenv(f"BATHYFLEET_{name}", value)
    assert overridden() == {"port": "BATHYFLEET_PORT", "imc.port": "BATHYFLEET_IMC__PORT"}


def test_one_value_written_in_two_ways_is_not_overruled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = 'time_scale = 2.0\nlog_level = "INFO"\n[imc]\nid = 16385\nallowed_ids = [21, 22]\n'
    (tmp_path / "bathyfleet.toml").write_text(written)
    for name, value in {"TIME_SCALE": "2", "IMC__ID": "0x4001", "IMC__ALLOWED_IDS": '["0x15", 22]'}.items():
        monkeypatch.setenv(f"BATHYFLEET_{name}", value)
    assert overridden() == {}
    monkeypatch.setenv("BATHYFLEET_IMC__ID", "0x4002")
    assert overridden() == {"imc.id": "BATHYFLEET_IMC__ID"}


def test_imc_ids_are_taken_as_the_doctor_tells_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the file they always were, in which 0x4001 is a number."""
    monkeypatch.setenv("BATHYFLEET_IMC__ID", "0x4001")
    monkeypatch.setenv("BATHYFLEET_IMC__ALLOWED_IDS", '["0x15", 22]')
    imc = load_settings().imc
    assert (imc.id, imc.allowed_ids) == (0x4001, (0x15, 22))
    monkeypatch.setenv("BATHYFLEET_IMC__ID", "0xFFFF")
    with pytest.raises(SettingsError, match=r"imc\.id is 65535"):
        load_settings()


def test_the_file_may_lie_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "elsewhere.toml"
    file.write_text("port = 4711\n")
    monkeypatch.setenv("BATHYFLEET_CONFIG", str(file))
    assert load_settings().port == 4711


@pytest.mark.parametrize(
    ("given", "used"),
    [
        ("sqlite:///a.db", "sqlite+aiosqlite:///a.db"),
        ("sqlite+aiosqlite:///a.db", "sqlite+aiosqlite:///a.db"),
        ("postgresql://u:p@h/n", "postgresql+asyncpg://u:p@h/n"),
        ("postgres://h/n", "postgresql+asyncpg://h/n"),
    ],
)
def test_usual_spellings_of_database_urls_are_understood(given: str, used: str) -> None:
    assert load_settings(database_url=given).database_url == used


def test_only_sqlite_is_migrated_without_being_asked() -> None:
    assert not load_settings(database_url="postgresql://h/n").migrates_itself
    assert load_settings(database_url="postgresql://h/n", auto_migrate=True).migrates_itself
    assert not load_settings(auto_migrate=False).migrates_itself


@pytest.mark.parametrize(
    ("toml", "environment", "overrides", "message"),
    [
        ("prot = 1", {}, {}, "prot (from bathyfleet.toml) is not a setting: did you mean port?"),
        ("[imc]\nprot = 1", {}, {}, "imc.prot (from bathyfleet.toml) is not a setting: did you mean port?"),
        ("port = 70000", {}, {}, "port is 70000 (from bathyfleet.toml): input should be less than or equal to 65535"),
        ('imc = "on"', {}, {}, "imc is 'on' (from bathyfleet.toml): input should be"),
        ("port = ", {}, {}, "bathyfleet.toml is not TOML"),
        (
            '[simulation]\nfamily = "harbor"',
            {},
            {},
            "simulation.family is 'harbor' (from bathyfleet.toml): use one of ",
        ),
        ('peer_url = "10.0.0.5:8080"', {}, {}, "needs another form: where other processes on the same database reach"),
        (
            '[compute]\nscheduler = "deck:8786"',
            {},
            {},
            "(from bathyfleet.toml): needs another form: dask",
        ),
        (
            '[alarms.smtp]\nhost = "mail"\nsender = "us"',
            {},
            {},
            "alarms.smtp.sender (from bathyfleet.toml): needs another form: address that the e-mails come",
        ),
        (
            '[[alarms.topics]]\nname = "wall"\ntopc = "ship/alarms"\n[alarms.mqtt]\nhost = "broker"',
            {},
            {},
            "alarms.topics.0.topc (from bathyfleet.toml) is not a setting: did you mean topic?",
        ),
        ("[simulation]\nseed = -1", {}, {}, "simulation.seed is -1 (from bathyfleet.toml): input should be greater"),
        ("[simulation]\ncurrent_mps = [nan, 0]", {}, {}, "simulation.current_mps.0 is nan"),
        ('[neptus]\npublic_address = "ship.example"', {}, {}, "neptus.public_address is 'ship.example'"),
        ("[neptus]\nftp_port = 8021\nhttp_port = 8021", {}, {}, "ftp_port and http_port are both 8021"),
        ("[neptus]\nfirst_depth_m = 60", {}, {}, "first_depth_m 60 is below max_depth_m 50"),
        ('[neptus]\nplanner = "coa"', {}, {}, "neptus.planner is 'coa' (from bathyfleet.toml): there is no"),
        ('[neptus]\nplanner = "swath"', {}, {}, "is 'swath' (from bathyfleet.toml): it is for swath sonars"),
        ('[neptus]\nplanner = "osarses"', {}, {}, "osarses really tries its moves"),
        (
            "",
            {"BATHYFLEET_PROT": "1"},
            {},
            "variable BATHYFLEET_PROT is not a setting: did you mean BATHYFLEET_PORT?",
        ),
        ("", {"BATHYFLEET_IMC__PROT": "1"}, {}, "did you mean BATHYFLEET_IMC__PORT?"),
        (
            "",
            {"BATHYFLEET_ALARMS__CA_FILE": "/nope", "BATHYFLEET_ALARMS__GIVE_UP_AFTER_S": "60"},
            {},
            "alarms (from BATHYFLEET_ALARMS__CA_FILE): ca_file '/nope' cannot be used: No such file",
        ),
        (
            '[alarms]\nca_file = "/nope"',
            {"BATHYFLEET_ALARMS__GIVE_UP_AFTER_S": "60"},
            {},
            "alarms (from BATHYFLEET_ALARMS__GIVE_UP_AFTER_S, bathyfleet.toml): ca_file '/nope' cannot be used: No",
        ),
        (
            "",
            {"BATHYFLEET_ALARMS__WEBHOOKS": '[{"name": "a", "url": "nonsense", "secret": "0123456789abcdef"}]'},
            {},
            "alarms.webhooks.0.url (from BATHYFLEET_ALARMS__WEBHOOKS): write a whole address",
        ),
        ("", {"BATHYFLEET_IMC__PORT": "x"}, {}, "imc.port is 'x' (from BATHYFLEET_IMC__PORT): input should be a valid"),
        ("", {"BATHYFLEET_ALLOWED_ORIGINS": "a"}, {}, "lists and tables are written as JSON"),
        (
            "",
            {"BATHYFLEET_CONFIG": "/no/file.toml"},
            {},
            "names '/no/file.toml', which is not a file",
        ),
        ("", {}, {"time_scale": 0.0}, "time_scale is 0.0 (from the command line): input should be greater than 0"),
        (
            "",
            {},
            {"database_url": "mysql://h"},
            "database_url (from the command line): use sqlite+",
        ),
    ],
)
def test_a_mistake_names_the_setting_its_source_and_what_would_be_right(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    toml: str,
    environment: dict[str, str],
    overrides: dict[str, Any],
    message: str,
) -> None:
    (tmp_path / "bathyfleet.toml").write_text(toml)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(SettingsError) as caught:
        load_settings(**overrides)
    assert len(caught.value.problems) == 1
    assert message in caught.value.problems[0]


@pytest.mark.usefixtures("no_settings_around")
def test_a_file_that_is_named_by_nothing_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a line like BATHYFLEET_TLS_KEY= has it; the folder that the service runs in is meant by nobody."""
    (tmp_path / "bathyfleet.toml").write_text(
        'tls_certificate = "both.pem"\ntls_key = ""\n[ais]\nfile = ""\n[alarms]\nca_file = ""\n'
        '[compute]\ntls_ca_file = ""\ntls_certificate = ""\ntls_key = ""\n'
    )
    monkeypatch.setenv("BATHYFLEET_SIMULATION__TERRAIN", "")
    settings = load_settings()
    assert settings.tls_key is settings.ais.file is settings.alarms.ca_file is settings.simulation.terrain is None
    assert settings.compute.tls_ca_file is settings.compute.tls_certificate is settings.compute.tls_key is None
    monkeypatch.setenv("BATHYFLEET_TLS_CERTIFICATE", "")
    assert load_settings().tls_certificate is None


def test_a_password_is_never_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BATHYFLEET_DATABASE_URL", "oracle://me:swordfish@h/n")
    with pytest.raises(SettingsError) as caught:
        load_settings()
    assert "swordfish" not in str(caught.value)


def test_every_mistake_is_reported_at_once(tmp_path: Path) -> None:
    (tmp_path / "bathyfleet.toml").write_text('port = "x"\ntime_scale = 0\ncolour = "red"\n')
    with pytest.raises(SettingsError) as caught:
        load_settings()
    assert len(caught.value.problems) == 3


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.0.2.1", False),
        ("example.org", False),
        ("", False),
    ],
)
def test_what_counts_as_this_machine(host: str, loopback: bool) -> None:
    assert is_loopback(host) is loopback
    assert Settings(host=host).loopback is loopback


def test_every_setting_is_explained() -> None:
    for name, field in Settings.model_fields.items():
        assert field.description or name in ("log_level", "log_format"), name


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        ("*", "every page there is"),
        ("https://*.example", "every page there is"),
        ("null", "sandbox"),
        ("console.example", "no scheme"),
        ("console.example:8080", "no scheme"),
        ("ftp://console.example", "no scheme"),
        ("https://", "names no host"),
        ("https://console.example/", "which would be https://console.example"),
        ("https://console.example/path", "which would be https://console.example"),
        ("https://console.example?query", "which would be https://console.example"),
        ("https://console.example:443", "which would be https://console.example"),
        ("https://user:password@console.example", "which would be https://console.example"),
        ("HTTPS://Console.Example", "which would be https://console.example"),
        ("https://console.example:port", "cannot be taken apart"),
        ("", "no scheme"),
    ],
)
def test_only_origins_may_use_the_api_from_elsewhere(origin: str, said: str) -> None:
    with pytest.raises(SettingsError) as refused:
        load_settings(allowed_origins=("https://good.example", origin))
    (problem,) = refused.value.problems
    assert said in problem
    assert "such as https://console.example" in problem


def test_origins_with_and_without_a_port_are_taken() -> None:
    good = ("https://console.example", "http://10.0.0.5:8080", "http://[::1]:8080", "http://localhost:5173")
    assert load_settings(allowed_origins=good).allowed_origins == good


def test_a_setting_of_the_bridge_is_declared_once_and_set_as_the_services() -> None:
    offered = set(ImcSettings.model_fields) - {"enabled"}
    assert offered == set(ConsoleSettings.model_fields)
    assert bridge_settings(ImcSettings(id=7, interfaces=("10.0.0.1",)), 2.0) == BridgeSettings(
        id=7, interfaces=("10.0.0.1",), time_scale=2.0
    )


def test_a_wrong_setting_of_the_bridge_stops_the_start_and_is_named() -> None:
    with pytest.raises(SettingsError, match=r"imc\.interfaces\.0 is 'eth0' .*: use an IPv4 address such as"):
        load_settings(imc={"interfaces": ["eth0"]})
    with pytest.raises(SettingsError, match=r"imc\.allowed_addresses\.0 is '10\.0\.10\.1/24' .*, without host bits"):
        load_settings(imc={"allowed_addresses": ["10.0.10.1/24"]})


@pytest.mark.parametrize(
    ("rates", "said"),
    [
        ("Distances:5", "'Distances' is no IMC message: did you mean Distance?"),
        ("Distance=5", "'Distance=5' is no message and its rate"),
        ("Distance:often", "'Distance:often' is no message and its rate"),
        ("Distance:5 EstimatedState:10", "is no message and its rate"),
        ("Distance:0", "is no message and its rate"),
        ("Distance:inf", "is no message and its rate"),
    ],
)
def test_a_wrong_rate_is_named_before_a_vehicle_is_asked_for_it(rates: str, said: str) -> None:
    with pytest.raises(SettingsError) as refused:
        load_settings(imc={"rate_limiters": f"EstimatedState:10, {rates}"})
    (problem,) = refused.value.problems
    assert problem.startswith(f"imc.rate_limiters is 'EstimatedState:10, {rates}'")
    assert said in problem
    assert "such as Distance:5, EstimatedState:10" in problem


@pytest.mark.parametrize("rates", ["", " Distance : 0.5,EstimatedState:10 ", DEFAULT_RATE_LIMITERS])
def test_rates_are_taken_as_vehicles_list_them(rates: str) -> None:
    assert load_settings(imc={"rate_limiters": rates}).imc.rate_limiters == rates


@pytest.mark.parametrize("planner", sorted(PLANNERS))
def test_each_planner_of_surveys_may_plan_for_the_panel(planner: str) -> None:
    assert load_settings(neptus={"planner": planner}).neptus.planner == planner


def declared(model: type[BaseModel]) -> Iterator[str]:
    """Yield the names of a model's settings and of those within them."""
    for name, field in model.model_fields.items():
        yield name
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from declared(field.annotation)


def test_the_help_of_serve_tells_the_defaults_of_the_settings() -> None:
    told = 0
    for option in typer.main.get_command(command_line).commands["serve"].params:  # type: ignore[attr-defined]
        field = Settings.model_fields.get(option.name)
        if isinstance(option.show_default, str):
            told += 1
            assert type(field.default)(option.show_default) == field.default
    assert told == 5


@pytest.fixture(scope="module")
def attributes_read() -> set[str]:
    """Names of all attributes that the program reads."""
    files = [file for package in ("app", "imc_bridge", "simulator") for file in (PROJECT / package).rglob("*.py")]
    nodes = (node for file in files for node in ast.walk(ast.parse(file.read_text())))
    return {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)}


@pytest.mark.parametrize("model", [Settings, BridgeSettings, PlannerOptions, MissionSpec])
def test_every_setting_that_is_offered_is_read(model: type[BaseModel], attributes_read: set[str]) -> None:
    assert set(declared(model)) <= attributes_read
