"""The FTP side: a server that has no files, only the three that the panel uploads, handed over as they come."""

from __future__ import annotations

import io
import logging
import re
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pyftpdlib.authorizers import AuthenticationFailed
from pyftpdlib.filesystems import AbstractedFS, FilesystemError
from pyftpdlib.handlers import DTPHandler, FTPHandler
from pyftpdlib.ioloop import IOLoop
from pyftpdlib.servers import FTPServer

from imc_bridge.neptus.protocol import SESSION_NAME

FOLDER = "/NEPTUS"
MAX_FILE_BYTES = 16 << 20
MAX_CONNECTIONS = 32
MAX_CONNECTIONS_PER_HOST = 8
POLL_S = 0.25
COMMANDS = (
    *("USER", "PASS", "REIN", "QUIT", "NOOP", "HELP", "FEAT", "OPTS", "SYST", "STAT"),
    *("CWD", "PWD", "MKD", "TYPE", "MODE", "STRU", "ALLO", "STOR", "ABOR"),
    *("PASV", "EPSV", "PORT", "EPRT"),
)
"""Nothing that reads, lists, deletes or renames."""
NOT_LET_IN = "Not let in: the password must be an access token of role operator"
FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}\.txt")

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class FtpUpload:
    """A file as it came. ``folder`` is a session's name for what lies in its folder, else empty."""

    user: str
    host: str
    folder: str
    name: str
    content: bytes


class LogInRefusedError(Exception):
    """Somebody is not let in; ``str()`` says why."""


@dataclass(frozen=True, slots=True)
class FtpCalls:
    """What the server asks; called from its thread.

    ``is_own_user(connection)``: whether it was made by the user who runs this process, asked when it is accepted.
    ``log_in(user, password, host, own_user)``: who that is, None when not let in; raises :class:`LogInRefusedError`
    to say why. ``make(user, host, session)`` and
    ``receive(upload)``: why not, empty when done. ``knows(session)``: whether there is such a session.
    """

    is_own_user: Callable[[socket.socket], bool]
    log_in: Callable[[str, str, str, bool], str | None]
    make: Callable[[str, str, str], str]
    receive: Callable[[FtpUpload], str]
    knows: Callable[[str], bool]


class FtpEndpoint:
    """The server in a thread of its own.

    Parameters
    ----------
    host, port
        Port 0: any free one, see ``port``.
    passive_ports
        First and last port for data connections; None: any.
    public_address
        Address given to clients for data connections, where a router stands between.
    """

    def __init__(
        self,
        host: str,
        port: int,
        calls: FtpCalls,
        *,
        passive_ports: tuple[int, int] | None = None,
        public_address: str | None = None,
    ) -> None:
        handler = type(
            "Handler",
            (_Handler,),
            {
                "calls": calls,
                "passive_ports": range(passive_ports[0], passive_ports[1] + 1) if passive_ports else None,
                "masquerade_address": public_address,
            },
        )
        self._server = FTPServer((host, port), handler, ioloop=IOLoop())
        self._server.max_cons = MAX_CONNECTIONS
        self._server.max_cons_per_ip = MAX_CONNECTIONS_PER_HOST
        self.port: int = self._server.address[1]
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="neptus-ftp", daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stop(self) -> None:
        """Close every connection; returns when the thread has ended. Safe to repeat."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        else:
            self._server.close_all()

    def _serve(self) -> None:
        while not self._stopping.is_set():
            try:
                # Its serve_forever would write into the log each time that it serves.
                self._server.ioloop.loop(POLL_S, blocking=False)
            except Exception:
                log.exception("The FTP server stumbled and goes on")
        self._server.close_all()


class _NoFiles(AbstractedFS):  # type: ignore[misc]
    """A folder that exists in name only."""

    def __init__(self, root: str, cmd_channel: Any) -> None:
        super().__init__("/", cmd_channel)
        self._channel = cmd_channel

    def ftp2fs(self, ftppath: str) -> str:
        return str(self.ftpnorm(ftppath))

    def fs2ftp(self, fspath: str) -> str:
        return fspath

    def validpath(self, path: str) -> bool:
        return True

    def realpath(self, path: str) -> str:
        return path

    def chdir(self, path: str) -> None:
        session = path.removeprefix(f"{FOLDER}/")
        if path not in ("/", FOLDER) and not (
            path.startswith(f"{FOLDER}/") and SESSION_NAME.fullmatch(session) and self._channel.calls.knows(session)
        ):
            raise FilesystemError("There is no such folder: make the session's first")
        self.cwd = path

    def mkdir(self, path: str) -> None:
        session = path.removeprefix(f"{FOLDER}/")
        if not path.startswith(f"{FOLDER}/") or not SESSION_NAME.fullmatch(session):
            raise FilesystemError(f"Only {FOLDER}/SESSION can be made, SESSION of letters, digits, _ and -")
        problem = self._channel.calls.make(self._channel.principal, self._channel.remote_ip, session)
        if problem:
            self._channel.refusal = problem
            raise FilesystemError(problem)

    def open(self, filename: str, mode: str) -> Any:
        folder, _, name = filename.rpartition("/")
        session = folder.removeprefix(FOLDER).strip("/")
        inside = folder == FOLDER or (folder == f"{FOLDER}/{session}" and self._channel.calls.knows(session))
        if mode != "wb" or not inside or not FILE_NAME.fullmatch(name):
            raise FilesystemError("Only the files of a session can be stored here")
        return _Incoming(session, name)


class _Incoming(io.BytesIO):
    """A file in the making, limited in size."""

    def __init__(self, folder: str, name: str) -> None:
        super().__init__()
        self.folder = folder
        self.name = name

    def write(self, chunk: Any) -> int:
        if self.tell() + len(chunk) > MAX_FILE_BYTES:
            raise OSError(27, f"File too large: at most {MAX_FILE_BYTES} bytes are taken")
        return super().write(chunk)


class _Transfer(DTPHandler):  # type: ignore[misc]
    """Hands a file over before the reply, so that the reply gives the result."""

    def close(self) -> None:
        file = self.file_obj
        if not self._closed and self.transfer_finished and isinstance(file, _Incoming) and not file.closed:
            channel = self.cmd_channel
            upload = FtpUpload(channel.principal, channel.remote_ip, file.folder, file.name, file.getvalue())
            problem = channel.calls.receive(upload)
            if problem:
                channel.refusal = problem
                self._resp = (f"550 {problem}", log.warning)
        super().close()


class _Doorkeeper:
    """Admits the gateway's users; they may make a folder and store, no more."""

    def validate_authentication(self, username: str, password: str, handler: Any) -> None:
        try:
            principal = handler.calls.log_in(username, password, handler.remote_ip, handler.own_user)
        except LogInRefusedError as refused:
            handler.refusal = str(refused)
            raise AuthenticationFailed(handler.refusal) from None
        if principal is None:
            handler.refusal = NOT_LET_IN
            raise AuthenticationFailed(f"{NOT_LET_IN}.")
        handler.principal, handler.refusal = principal, ""

    def get_home_dir(self, username: str) -> str:
        return "/"

    def has_user(self, username: str) -> bool:
        return True

    def has_perm(self, username: str, perm: str, path: str | None = None) -> bool:
        return perm in "emw"

    def get_perms(self, username: str) -> str:
        return "emw"

    def get_msg_login(self, username: str) -> str:
        return "Welcome."

    def get_msg_quit(self, username: str) -> str:
        return "Goodbye."

    def impersonate_user(self, username: str, password: str) -> None:
        """There is no user of the system behind it."""

    def terminate_impersonation(self, username: str) -> None:
        """There is no user of the system behind it."""


class _Handler(FTPHandler):  # type: ignore[misc]
    calls: FtpCalls
    principal = ""
    refusal = ""
    """Why something was refused on this connection, last."""
    authorizer = _Doorkeeper()
    abstracted_fs = _NoFiles
    dtp_handler = _Transfer
    banner = "bathyfleet"
    proto_cmds = {name: FTPHandler.proto_cmds[name] for name in COMMANDS} | {
        # Of the connection only, since there are no files.
        "STAT": FTPHandler.proto_cmds["STAT"] | {"arg": False, "perm": None}
    }
    use_sendfile = False
    timeout = 60
    max_login_attempts = 3
    auth_failed_timeout = 1

    def __init__(self, connection: socket.socket, *arguments: Any, **options: Any) -> None:
        # Before any wait: the owner of a connection is unknown once it is closed.
        self.own_user = self.calls.is_own_user(connection)
        super().__init__(connection, *arguments, **options)

    def ftp_QUIT(self, line: str) -> None:  # noqa: N802 - pyftpdlib's name
        """Say last what was refused: of all replies, the panel shows only this one."""
        if self.refusal:
            self.push(f"221-{self.refusal}\r\n")
        super().ftp_QUIT(line)
