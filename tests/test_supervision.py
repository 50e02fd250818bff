"""What systemd is told, over a real socket, by the real service."""

import os
import signal
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from queue import Queue
from threading import Thread

import pytest

from app.supervision import SystemdNotifier
from tests.support.commands import environment, serving
from tests.support.waiting import until


@pytest.fixture
def listening(tmp_path: Path) -> Iterator[socket.socket]:
    """The supervisor's end."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.bind(str(tmp_path / "notify"))
        sock.settimeout(240)
        yield sock


def waiting(sock: socket.socket) -> list[str]:
    """What was sent and not read yet."""
    sock.setblocking(False)
    found = []
    while True:
        try:
            found.append(sock.recv(4096).decode())
        except BlockingIOError:
            return found


@pytest.mark.slow
def test_the_service_is_ready_lives_and_ends(listening: socket.socket, tmp_path: Path) -> None:
    words: Queue[str] = Queue()

    def read() -> None:
        while (word := listening.recv(4096).decode()) != "enough":
            words.put(word)

    def told() -> str:
        return words.get(timeout=240)

    reading = Thread(target=read)
    reading.start()
    try:
        supervised = environment(NOTIFY_SOCKET=str(tmp_path / "notify"), WATCHDOG_USEC="300000")
        with serving(tmp_path, supervised) as (process, url):
            while (word := told()) == "WATCHDOG=1":
                pass
            assert word == f"READY=1\nSTATUS=answers at {url}"
            assert [told() for _ in range(3)] == ["WATCHDOG=1"] * 3
            process.send_signal(signal.SIGTERM)
            while (word := told()) == "WATCHDOG=1":
                pass
            assert word == "STOPPING=1\nSTATUS=stops the vehicles"
            assert process.wait(240) == 0
    finally:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
            sock.sendto(b"enough", str(tmp_path / "notify"))
        reading.join()


THAT_CAN_HANG = """
import signal, sys
sys.argv[0] = "bathyfleet"

def hang(*_):
    print("it hangs", file=sys.stderr, flush=True)
    while True:
        signal.pause()

signal.signal(signal.SIGUSR1, hang)
from app.cli import main
main()
"""


@pytest.mark.slow
def test_a_service_whose_loop_hangs_is_silent_and_says_where_it_hung_when_it_is_ended(
    listening: socket.socket, tmp_path: Path
) -> None:
    supervised = environment(NOTIFY_SOCKET=str(tmp_path / "notify"), WATCHDOG_USEC="150000")
    with serving(tmp_path, supervised, command=[sys.executable, "-c", THAT_CAN_HANG]) as (process, _):
        waiting(listening)
        listening.settimeout(240)
        assert listening.recv(100).startswith(b"WATCHDOG=1")
        process.send_signal(signal.SIGUSR1)
        assert process.stderr is not None
        assert any(line == "it hangs\n" for line in process.stderr)
        waiting(listening)
        # Other threads go on meanwhile, of several signs of life that were due comes none.
        listening.settimeout(0.5)
        with pytest.raises(TimeoutError):
            listening.recv(100)
        process.send_signal(signal.SIGABRT)  # as systemd does
        said = process.stderr.read()
        assert process.wait(240) == -signal.SIGABRT
        assert "Fatal Python error: Aborted" in said
        assert "in hang" in said
        # Reading the frames of threads that go on ends now and then in a fault of its own.
        assert "Thread 0x" not in said


async def test_who_hangs_gives_no_sign_of_life(listening: socket.socket, tmp_path: Path) -> None:
    supervisor = SystemdNotifier(str(tmp_path / "notify"), patience_s=0.03)
    async with supervisor.watching():
        await until(lambda: waiting(listening), "it lives")
        waiting(listening)
        end = time.monotonic() + 0.1
        while time.monotonic() < end:  # the loop does not turn
            pass
        assert waiting(listening) == []
        await until(lambda: waiting(listening), "it lives again")


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({}, SystemdNotifier()),
        ({"NOTIFY_SOCKET": "relative/path", "WATCHDOG_USEC": "1000"}, SystemdNotifier()),
        ({"NOTIFY_SOCKET": "/run/notify"}, SystemdNotifier("/run/notify")),
        ({"NOTIFY_SOCKET": "@name", "WATCHDOG_USEC": "60000000"}, SystemdNotifier("@name", 60.0)),
        ({"NOTIFY_SOCKET": "/n", "WATCHDOG_USEC": "1000", "WATCHDOG_PID": "1"}, SystemdNotifier("/n")),
        (
            {"NOTIFY_SOCKET": "/n", "WATCHDOG_USEC": "1000", "WATCHDOG_PID": str(os.getpid())},
            SystemdNotifier("/n", 0.001),
        ),
        ({"NOTIFY_SOCKET": "/n", "WATCHDOG_USEC": "soon"}, SystemdNotifier("/n")),
        ({"NOTIFY_SOCKET": "/n", "WATCHDOG_USEC": "0"}, SystemdNotifier("/n")),
    ],
)
def test_the_environment_names_the_supervisor(variables: dict[str, str], expected: SystemdNotifier) -> None:
    assert SystemdNotifier.of(variables) == expected


def test_a_name_that_is_no_file_is_reached_too(tmp_path: Path) -> None:
    name = f"bathyfleet-{os.getpid()}-{tmp_path.name}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.bind(f"\0{name}")
        sock.settimeout(240)
        SystemdNotifier(f"@{name}").tell(READY="1")
        assert sock.recv(100) == b"READY=1"


def test_a_supervisor_that_does_not_listen_is_no_reason_to_end(tmp_path: Path) -> None:
    supervisor = SystemdNotifier(str(tmp_path / "notify"))
    supervisor.tell(READY="1")
    assert list(tmp_path.iterdir()) == [], "nothing is made in its place"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.bind(str(tmp_path / "notify"))
        supervisor.tell(STATUS="it listens now")
        SystemdNotifier().tell(STATUS="to nobody")
        assert waiting(sock) == ["STATUS=it listens now"]
