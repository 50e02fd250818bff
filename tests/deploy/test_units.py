"""The units for systemd: understood by systemd itself, and they name what there is."""

import configparser
import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from app.main import GRACE_S
from app.mapping.readers.confinement import LOCKING_CALLS
from tests.support.paths import PROJECT

UNITS = PROJECT / "app" / "deploy" / "systemd"
PROGRAM = "/opt/bathyfleet/bin/bathyfleet"


def unit(name: str) -> configparser.ConfigParser:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment]
    parser.read(UNITS / name)
    return parser


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_understands_them(tmp_path: Path) -> None:
    for file in UNITS.glob("*.service"):
        (tmp_path / file.name).write_text(file.read_text().replace(PROGRAM, "/bin/true"))
    for file in UNITS.glob("*.timer"):
        shutil.copy(file, tmp_path)
    units = sorted(str(path) for path in tmp_path.iterdir())
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", *units], capture_output=True, text=True, check=False
    )
    assert [line for line in done.stderr.splitlines() if "bathyfleet" in line] == []
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
@pytest.mark.parametrize("name", ["bathyfleet.service", "bathyfleet-backup.service"])
def test_they_give_little_away(tmp_path: Path, name: str) -> None:
    """As systemd itself reckons: 0 is sealed, 10 is what a service without any of this has."""
    (tmp_path / name).write_text((UNITS / name).read_text().replace(PROGRAM, "/bin/true"))
    words = ["systemd-analyze", "security", "--offline=true", "--no-pager", "--threshold=20", str(tmp_path / name)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if "unrecognized option" in done.stderr:
        pytest.skip("this systemd judges only what is installed")
    assert done.returncode == 0, done.stdout[-300:] + done.stderr


def test_the_service_is_watched_and_has_time_to_stop_its_vehicles() -> None:
    service = unit("bathyfleet.service")["Service"]
    assert (service["Type"], service["Restart"], service["KillMode"]) == ("notify", "always", "mixed")
    assert shlex.split(service["ExecStart"]) == [PROGRAM, "serve"]
    assert float(service["WatchdogSec"]) >= 30
    assert float(service["TimeoutStopSec"]) > GRACE_S + 20
    assert service["WorkingDirectory"] == "/var/lib/" + service["StateDirectory"]
    assert service["CapabilityBoundingSet"] == ""
    assert service["LimitCORE"] == "0"
    cache = unit("bathyfleet-backup.service")["Service"]["CacheDirectory"]
    assert f"XDG_CACHE_HOME=/var/cache/{cache}" in (UNITS / "bathyfleet.service").read_text()
    assert service["CacheDirectory"] == cache


def test_the_service_may_lock_in_what_reads_files_under_systemd_of_any_age() -> None:
    """Sets of system calls of systemd 252 (Debian 12) know neither."""
    lines = (UNITS / "bathyfleet.service").read_text().splitlines()
    allowed = " ".join(line.partition("=")[2] for line in lines if line.startswith("SystemCallFilter=")).split()
    assert {*LOCKING_CALLS} <= {*allowed}
    assert lines.index("SystemCallFilter=@system-service") < lines.index("SystemCallFilter=" + " ".join(LOCKING_CALLS))


def test_copies_are_made_daily_by_a_command_that_there_is() -> None:
    service, timer = unit("bathyfleet-backup.service")["Service"], unit("bathyfleet-backup.timer")["Timer"]
    words = shlex.split(service["ExecStart"])
    assert words[:2] == [PROGRAM, "backup"]
    # A folder: its name ends so, and it is there before the command begins.
    assert words[2].endswith("/")
    assert words[2].rstrip("/").removeprefix("/var/lib/") in service["StateDirectory"].split()
    assert service["WorkingDirectory"] == unit("bathyfleet.service")["Service"]["WorkingDirectory"]
    assert timer["Persistent"] == "yes"
    assert re.fullmatch(r"\*-\*-\* \d\d:\d\d:00", timer["OnCalendar"])


def test_they_are_in_the_wheel_where_systemd_files_go() -> None:
    shared = tomllib.loads((PROJECT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"][
        "shared-data"
    ]
    assert {PROJECT / source for source in shared} == set(UNITS.iterdir())
    assert {Path(target).parent.as_posix() for target in shared.values()} == {"lib/systemd/system", "lib/sysusers.d"}
