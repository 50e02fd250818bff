"""Installs on a computer without internet and lets systemd run it: ``python -m benchmarks.installation.ship``.

A root file system of Debian's packages is booted by systemd-nspawn in a network of its own, where it reaches nobody.
There the file for computers without internet is installed and the units are enabled as the guide says. Then a mission
with simulated vehicles is started, the service is made to hang until the watchdog ends it, a backup is made and
checked, the service is stopped while vehicles are under way, upgraded, and taken back. Printed is one line for each
step. Exit code 1 when one fails.

Needs root, mmdebstrap, systemd-nspawn (Debian: systemd-container) and the registry of Debian; the file for this kind of
computer and the root's Python is made by ``python -m app.deploy``.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from benchmarks.installation.rooted import base, missing
from benchmarks.installation.steps import Step, StepError

SUITE = "bookworm"
"""The oldest Debian that the units are for, with the oldest Python that the service runs on."""
PATIENCE_S = 600.0
PROGRAM = "/opt/bathyfleet/bin/bathyfleet"
UNITS = "/opt/bathyfleet/lib/systemd/system"
STATE = "/var/lib/bathyfleet"
WATCHDOG = "[Service]\nWatchdogSec=20\n"
"""Sooner than the unit's own, for the sake of whoever waits."""
MISSION = {
    "name": "Trial",
    "area": {
        "type": "Polygon",
        "coordinates": [
            [[-8.7050, 41.1850], [-8.7038, 41.1850], [-8.7038, 41.1859], [-8.7050, 41.1859], [-8.705, 41.185]]
        ],
    },
    "vehicles": [{"name": "first", "kind": "sim"}, {"name": "second", "kind": "sim"}],
    "limits": {"max_step_m": 10, "min_depth_m": 1, "max_depth_m": 8},
}
ASK = """
import json, sys, urllib.request
method, path, body = sys.argv[1:]
token = open("/var/lib/bathyfleet/operator.token").read().split()[-1]
headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
asked = urllib.request.Request("http://127.0.0.1:8080" + path, body.encode() or None, headers, method=method)
with urllib.request.urlopen(asked, timeout=60) as answer:
    print(answer.read().decode())
"""


class Ship:
    """The computer, as somebody at its keyboard sees it."""

    def __init__(self, leader: int) -> None:
        self._enter = ["nsenter", "--target", str(leader), "--all", "env", "-i", "HOME=/root"]
        self._enter.append("PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin")

    def run(self, *words: str) -> str:
        """Run something; returns what it prints. Raises StepError."""
        done = subprocess.run([*self._enter, *words], capture_output=True, text=True, check=False)
        if done.returncode:
            raise StepError(
                f"{' '.join(words)[:200]}: exit code {done.returncode}\n{(done.stdout + done.stderr)[-4000:]}"
            )
        return done.stdout.strip()

    def shows(self, name: str, unit: str = "bathyfleet.service") -> str:
        """Return a property of a unit."""
        return self.run("systemctl", "show", "--value", f"--property={name}", unit)

    def asks(self, method: str, path: str, body: object = "") -> Any:
        """Ask the service as somebody on that computer; returns its answer."""
        text = body if isinstance(body, str) else json.dumps(body)
        said = self.run("/opt/bathyfleet/bin/python", "-c", ASK, method, path, text)
        return json.loads(said) if said.startswith(("{", "[")) else said

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for something. Raises StepError with the service's log when it does not come."""
        end = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > end:
                log = self.run("journalctl", "--no-pager", "--lines=60", "--unit=bathyfleet.service")
                raise StepError(f"waited in vain until {what}\n{log}")
            time.sleep(0.5)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, help="what python -m app.deploy made")
    parser.add_argument("--base", type=Path, help="a root with systemd that was made before; it is copied")
    options = parser.parse_args(arguments)
    if lacking := missing("systemd-nspawn"):
        print(f"this machine lacks: {', '.join(lacking)}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="bathyfleet-ship-") as folder:
        root = Path(folder, "root")
        try:
            with Step("a root of Debian's packages, with systemd"):
                if options.base is None:
                    base(root, SUITE, packages=("systemd", "systemd-sysv", "dbus"))
                else:
                    subprocess.run(["cp", "--archive", "--reflink=auto", str(options.base), str(root)], check=True)
            shutil.copy(options.file, root / "root")
            with booted(root, Path(folder, "console")) as ship:
                try_it(ship, options.file.name)
        except StepError as error:
            print(f"failed: {error}", file=sys.stderr)
            return 1
    return 0


@contextmanager
def booted(root: Path, console: Path) -> Iterator[Ship]:
    """Boot a root; it is powered off in the end."""
    words = ["systemd-nspawn", "--quiet", f"--directory={root}", "--machine=bathyfleet-ship", "--private-network"]
    words += ["--register=no", "--keep-unit", "--console=pipe", "--boot"]
    with (
        console.open("wb") as file,
        subprocess.Popen(words, stdout=file, stderr=file, stdin=subprocess.DEVNULL) as nspawn,
    ):
        try:
            with Step("it boots"):
                children = Path(f"/proc/{nspawn.pid}/task/{nspawn.pid}/children")
                end = time.monotonic() + PATIENCE_S
                while True:
                    if nspawn.poll() is not None or time.monotonic() > end:
                        raise StepError(console.read_text()[-2000:])
                    # Its first process is not at once where it belongs.
                    with suppress(StepError, IndexError):
                        ship = Ship(int(children.read_text().split()[0]))
                        ship.run("sh", "-c", 'systemctl is-system-running | grep -E "running|degraded"')
                        break
                    time.sleep(0.5)
            yield ship
        finally:
            nspawn.send_signal(signal.SIGTERM)
            try:
                nspawn.wait(60)
            except subprocess.TimeoutExpired:
                nspawn.kill()


def try_it(ship: Ship, file: str) -> None:
    """Install, run, hang, back up, stop, upgrade and take back. Raises StepError."""
    install = f"cd /root && tar -xf {file} && sh {file.removesuffix('.tar')}/install.sh"
    with Step("install.sh, without a network"):
        ship.run("sh", "-c", install)
    with Step("the units are enabled"):
        ship.run("systemd-sysusers", "/opt/bathyfleet/lib/sysusers.d/bathyfleet.conf")
        ship.run("sh", "-c", f"systemd-analyze verify {UNITS}/bathyfleet*")
        ship.run("mkdir", "-p", "/etc/systemd/system/bathyfleet.service.d")
        ship.run("sh", "-c", f"printf '{WATCHDOG}' > /etc/systemd/system/bathyfleet.service.d/sooner.conf")
        ship.run("systemctl", "link", f"{UNITS}/bathyfleet-backup.service")
        ship.run("systemctl", "enable", "--now", f"{UNITS}/bathyfleet-backup.timer")
    with Step("the service starts, says where it answers, as a user of its own"):
        ship.run("systemctl", "enable", "--now", f"{UNITS}/bathyfleet.service")
        _expect(ship.shows("StatusText"), "answers at http://127.0.0.1:8080")
        _expect(ship.run("stat", "--format=%U %a", STATE), "bathyfleet 700")
        _expect(
            ship.run("sh", "-c", "stat --format=%U /proc/$(systemctl show --value -p MainPID bathyfleet)"), "bathyfleet"
        )
    with Step("the page is there"):
        _expect("<script" in str(ship.asks("GET", "/")), True)
    with Step("a mission with simulated vehicles is under way"):
        mission = ship.asks("POST", "/api/v1/missions", MISSION)["id"]
        ship.asks("POST", f"/api/v1/missions/{mission}/start")

        def told() -> tuple[str, int]:
            said = ship.asks("GET", f"/api/v1/missions/{mission}")
            return said["state"], said["progress"]["soundings"]

        ship.until(lambda: told()[1] > 20, "there are soundings")
        if ship.run("find", "/var/cache/bathyfleet", "-name", "*.nbc") == "":
            raise StepError("nothing compiled is kept in /var/cache/bathyfleet")
    with Step("it hangs: the watchdog ends it, it says where it hung, it starts again and goes on"):
        before = told()[1]
        ship.run("sh", "-c", "kill -STOP $(systemctl show --value -p MainPID bathyfleet)")
        ship.until(
            lambda: ship.shows("NRestarts") == "1" and ship.shows("ActiveState") == "active", "it is started again"
        )
        log = ship.run("journalctl", "--no-pager", "--unit=bathyfleet.service")
        _expect("Watchdog timeout" in log and "Fatal Python error: Aborted" in log, True)
        ship.until(lambda: told()[0] == "running" and told()[1] > before, "the mission goes on")
    with Step("a backup by the timer's service; it is sound"):
        ship.run("systemctl", "start", "bathyfleet-backup.service")
        copy = ship.run("sh", "-c", f"ls {STATE}/backups/*.db")
        ship.run(PROGRAM, "backup", "--verify", copy)
        _expect(ship.run("stat", "--format=%U %a", copy), "bathyfleet 600")
        _expect(ship.shows("ActiveState", "bathyfleet-backup.timer"), "active")
    with Step("it stops well while vehicles are under way"):
        ship.run("systemctl", "stop", "bathyfleet")
        _expect((ship.shows("Result"), ship.shows("ExecMainStatus")), ("success", "0"))
        log = ship.run("journalctl", "--no-pager", "--unit=bathyfleet.service")
        _expect(
            [name for name in ("first", "second") if f"the service ends: {name} acknowledged the stop" in log],
            ["first", "second"],
        )
    with Step("upgraded: install.sh again, the version before stays, the mission goes on"):
        ship.run("sh", "-c", install)
        ship.run("test", "-x", "/opt/bathyfleet.old/bin/bathyfleet")
        ship.run("systemctl", "start", "bathyfleet")
        ship.until(lambda: told()[0] == "running", "the mission is taken up")
    with Step("the way back: folders swapped, the backup restored"):
        ship.run("systemctl", "stop", "bathyfleet")
        swap = "cd /opt && mv bathyfleet bathyfleet.new && mv bathyfleet.old bathyfleet"
        ship.run("sh", "-c", swap)
        as_service = f"cd {STATE} && setpriv --reuid=bathyfleet --regid=bathyfleet --clear-groups {PROGRAM}"
        ship.run("sh", "-c", f"{as_service} restore {copy} --replace")
        ship.run("systemctl", "start", "bathyfleet")
        ship.until(lambda: told()[0] == "running", "the mission is taken up")
    with Step("everything stops with the computer"):
        os.sync()


def _expect(found: object, wanted: object) -> None:
    if found != wanted:
        raise StepError(f"found {found!r}, not {wanted!r}")


if __name__ == "__main__":
    sys.exit(main())
