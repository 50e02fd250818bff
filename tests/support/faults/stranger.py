"""What an ordinary user of the machine tries.

``python -m tests.support.faults.stranger UID TASK ARGUMENTS``; needs root.
Root's rights are given up before anything is tried. Prints one JSON value.
"""

import encodings.idna  # noqa: F401 - what is imported later a stranger cannot read any more
import fcntl
import ftplib
import json
import os
import socket
import struct
import sys
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import connect

NEW_MISSION = {
    "name": "a stranger's",
    "area": {
        "type": "Polygon",
        "coordinates": [[[-8.705, 41.185], [-8.7043, 41.185], [-8.7043, 41.1855], [-8.705, 41.1855], [-8.705, 41.185]]],
    },
    "vehicles": [{"name": "rover", "kind": "rest"}],
}


def give_up_rights(uid: int) -> None:
    """Be an ordinary user from now on."""
    os.setgroups([])
    os.setresgid(uid, uid, uid)
    os.setresuid(uid, uid, uid)


def request(headers: str = "") -> bytes:
    """A request for a new mission, as bytes."""
    body = json.dumps(NEW_MISSION).encode()
    head = f"POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n{headers}"
    return f"{head}Content-Length: {len(body)}\r\nConnection: close\r\n\r\n".encode() + body


def ask(port: str, host: str = "127.0.0.1", headers: str = "") -> int:
    """The status with which a command is answered."""
    with socket.create_connection((host, int(port)), timeout=30) as sock:
        sock.sendall(request(headers))
        return int(sock.makefile("rb").readline().split()[1])


def ask_and_reset(port: str) -> int:
    """Send a command and reset the connection at once."""
    sock = socket.create_connection(("127.0.0.1", int(port)), timeout=30)
    sock.sendall(request())
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    sock.close()
    return 0


def ask_and_exit(port: str) -> int:
    """Send a command and be gone."""
    if os.fork() == 0:
        sock = socket.create_connection(("127.0.0.1", int(port)), timeout=30)
        sock.sendall(request())
        os._exit(0)
    os.wait()
    return 0


def many(how: str, port: str, count: str) -> list[int]:
    """Command several times in one way."""
    ways = {"ask": ask, "reset": ask_and_reset, "exit": ask_and_exit}
    return [ways[how](port) for _ in range(int(count))]


def watch(url: str) -> int | None:
    """The code with which a live view is closed; None where it shows something."""
    try:
        with connect(url, open_timeout=30) as view:
            view.recv(timeout=30)
    except ConnectionClosed as closed:
        return closed.rcvd.code if closed.rcvd is not None else 1006
    except InvalidHandshake:
        return 0
    return None


def panel(port: str) -> str:
    """What a log-in at the gateway without a token is answered."""
    with ftplib.FTP() as ftp:  # noqa: S321 - the gateway speaks nothing else
        ftp.connect("127.0.0.1", int(port), timeout=30)
        try:
            ftp.login("anyone", "anything")
            ftp.mkd("/NEPTUS/stranger")
            return ftp.storbinary("STOR /NEPTUS/stranger.txt", BytesIO(b"SessionID: stranger"))
        except ftplib.Error as error:
            return str(error)


def files(folder: str) -> dict[str, list[str]]:
    """What can be done with everything in a folder."""
    found: dict[str, list[str]] = {"seen": [], "read": [], "written": [], "locked": []}
    for path in _below(Path(folder)):
        name = str(path.relative_to(folder))
        found["seen"].append(name)
        for what, flags in (("read", os.O_RDONLY), ("written", os.O_WRONLY)):
            try:
                descriptor = os.open(path, flags | os.O_NONBLOCK)
            except OSError:
                continue
            found[what].append(name)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                found["locked"].append(name)
            except OSError:
                found["locked"].append(name)  # it is held: he waits in line for it
            os.close(descriptor)
    return found


def _below(folder: Path) -> Iterator[Path]:
    try:
        entries = sorted(folder.iterdir())
    except OSError:
        return
    for path in entries:
        if path.is_dir():
            yield from _below(path)
        else:
            yield path


def hold(*paths: str) -> bool:
    """Keep files locked until the input ends."""
    for path in paths:
        fcntl.flock(os.open(path, os.O_RDONLY), fcntl.LOCK_SH | fcntl.LOCK_NB)
    sys.stdout.write("held\n")
    sys.stdout.flush()
    sys.stdin.read()
    return True


TASKS: dict[str, Callable[..., Any]] = {
    "many": many,
    "ask": ask,
    "watch": watch,
    "panel": panel,
    "files": files,
    "hold": hold,
}


if __name__ == "__main__":
    give_up_rights(int(sys.argv[1]))
    sys.stdout.write(json.dumps(TASKS[sys.argv[2]](*sys.argv[3:])) + "\n")
