import gc
import os
import shutil
import subprocess
from collections.abc import Generator, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import structlog
from hypothesis import settings
from hypothesis.internal.conjecture import providers

from tests.support.certificates import Authority
from tests.support.compute.numba_cache import share
from tests.support.paths import CAPTURES, TERRAINS
from tests.support.storage.databases import KINDS, Databases

share()
# Nothing is said about how fast a machine is. Examples are the same in every run; others are looked for with
# --hypothesis-profile=search.
settings.register_profile("project", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("search", deadline=None, max_examples=300)
settings.load_profile("project")
# Numbers that stand in the program would be tried, too, but only those of modules that other tests had loaded by then.
if hasattr(providers, "is_local_module_file"):
    setattr(providers, "is_local_module_file", lambda _: False)  # noqa: B010 - it is not ours
# As the service has it. Frames drawn with their variables would take longer than what fails.
structlog.get_config()["processors"][-1].exception_formatter = structlog.dev.plain_traceback


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--database",
        choices=KINDS,
        default="sqlite",
        help="What every test runs on that does not ask for one of them; PostgreSQL is started by the tests",
    )


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Modules and tests stay: looking for garbage in them, again and again, would take a tenth of their time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def databases(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Databases]:
    """Databases as many as are wanted, gone in the end."""
    with ExitStack() as stack:
        yield Databases(request.config.getoption("--database"), tmp_path_factory.mktemp("databases"), stack)


@pytest.fixture
def database_url(databases: Databases) -> str:
    """A database with every table and no row."""
    return databases.fresh()


@pytest.fixture(params=KINDS)
def either_url(request: pytest.FixtureRequest, databases: Databases) -> str:
    """A database of each kind with every table and no row."""
    return databases.fresh(request.param)


def _children() -> dict[int, str]:
    """Processes that this one started and that still run, with their command lines."""
    found = {}
    for listed in Path("/proc/self/task").glob("*/children"):
        for number in listed.read_text().split():
            try:
                command = Path(f"/proc/{number}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except OSError:
                continue  # just ended
            if command and "multiprocessing.resource_tracker" not in command:  # lives as long as its interpreter
                found[int(number)] = command
    return found


@pytest.fixture(scope="session", autouse=True)
def no_process_is_left_behind() -> Iterator[None]:
    """Every service, simulator and browser that a test started has ended when the last test has."""
    before = set(_children())
    yield
    left = {number: command for number, command in _children().items() if number not in before}
    assert not left, f"tests left processes behind: {left}"


@pytest.fixture(scope="session")
def terrains() -> Path:
    """Folder of real terrains: what BATHYFLEET_TERRAINS names, else ``../shared/terrains`` beside the project."""
    if not TERRAINS.is_dir():
        pytest.skip(f"no real terrains in {TERRAINS}: set BATHYFLEET_TERRAINS to a folder of terrain files")
    return TERRAINS


@pytest.fixture(scope="session")
def captures() -> Path:
    """Folder of the recorded sessions of real DUNE nodes."""
    if not CAPTURES.is_dir():
        pytest.skip(f"no recorded sessions in {CAPTURES}: set BATHYFLEET_CAPTURES to a folder of recorded sessions")
    return CAPTURES


@pytest.fixture(scope="session")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate for localhost, signed by itself, and its key."""
    return new_certificate(tmp_path_factory.mktemp("tls"))


@pytest.fixture
def other_certificate(tmp_path: Path) -> Path:
    """Another one, of another key."""
    return new_certificate(tmp_path)[0]


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed: no certificate can be made")
    folder = tmp_path / "authority"
    folder.mkdir()
    return Authority(folder)


def new_certificate(folder: Path) -> tuple[Path, Path]:
    """Make a certificate for localhost, signed by itself, and its key."""
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("openssl is not installed: no certificate can be made")
    cert, key = folder / "cert.pem", folder / "key.pem"
    name = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    new = [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2"]
    subprocess.run([*new, *name, "-keyout", str(key), "-out", str(cert)], check=True, capture_output=True)
    return cert, key


@pytest.fixture
def no_settings_around(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the environment nor a file sets anything."""
    for name in list(os.environ):
        if name.startswith("BATHYFLEET_"):
            monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)
