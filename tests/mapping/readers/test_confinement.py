"""A process that locked itself in can do nothing but compute, by each layer alone."""

import errno
import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from app.mapping.readers.confinement.system_calls import make_filter
from tests.support.paths import PROJECT

PROCESS = r"""
import ctypes, json, os, socket, sys, threading
from pathlib import Path
from app.mapping.readers.confinement import ResourceLimits, confine, limit

layers, folder, ordinary = sys.argv[1].split(","), Path(sys.argv[2]), sys.argv[3] == "ordinary"
secret, table = folder / "secret", folder / "tables" / "table"
kept = os.open(secret.with_name("own"), os.O_RDONLY)
inherited = os.open(secret, os.O_RDONLY)
os.set_inheritable(inherited, True)
listening = socket.create_server(("127.0.0.1", 0))
port = listening.getsockname()[1]
limit(ResourceLimits(2 << 30, 60, 1 << 16))
if ordinary and os.geteuid() == 0:
    os.setresgid(65534, 65534, 65534)
    os.setresuid(65534, 65534, 65534)
held = confine([kept, listening.fileno()], [table.parent], layers)
libc = ctypes.CDLL(None, use_errno=True)

def connect():
    with socket.socket() as own:
        own.connect(("127.0.0.1", port))

def trace():
    if libc.ptrace(0, 0, 0, 0) < 0:
        raise OSError(ctypes.get_errno(), "ptrace")

def write():
    with open(folder / "new", "w") as file:
        file.write("x")

def fork():
    if os.fork() == 0:
        os._exit(0)

attempts = {
    "own": lambda: os.read(kept, 3),
    "compute": lambda: sum(bytearray(1 << 20)),
    "passwd": lambda: open("/etc/passwd").read(),
    "secret": lambda: secret.read_text(),
    "inherited": lambda: os.read(inherited, 1),
    "table": lambda: table.read_text(),
    "list": lambda: os.listdir(folder),
    "write": write,
    "remove": lambda: os.remove(secret),
    "connect": connect,
    "unix": lambda: socket.socketpair(),
    "fork": fork,
    "thread": lambda: threading.Thread(target=int).start(),
    "execute": lambda: os.execv("/bin/true", ["true"]),
    "signal": lambda: os.kill(os.getppid(), 0),
    "trace": trace,
    "raise": lambda: __import__("resource").setrlimit(6, (100, 100)),
    "own memory": lambda: open("/proc/self/mem", "rb"),
}
only = sys.argv[4].split(",")
outcome = {}
for name in only:
    try:
        attempts[name]()
        outcome[name] = ""
    except (OSError, RuntimeError, ValueError) as error:
        outcome[name] = type(error).__name__
sys.stdout.write(json.dumps({"held": held, "outcome": outcome}))
sys.stdout.flush()
os._exit(0)
"""
FILES = ("passwd", "secret", "list", "write", "remove", "inherited", "own memory")
EVERYTHING = (*FILES, "connect", "unix", "fork", "thread", "execute", "signal", "trace", "raise")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for folder in (tmp_path, *tmp_path.parents[:2]):
        folder.chmod(0o755)
    (tmp_path / "tables").mkdir()
    for name in ("own", "secret", "tables/table"):
        (tmp_path / name).write_text("abc")
    return tmp_path


def attempt(folder: Path, layers: str, only: tuple[str, ...], user: str = "ordinary") -> dict[str, str]:
    ended = subprocess.run(
        [sys.executable, "-P", "-c", PROCESS, layers, str(folder), user, ",".join(only)],
        env={"PYTHONPATH": str(PROJECT), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.stdout, ended.stderr[-2000:]
    said = json.loads(ended.stdout)
    lacking = {layer: why for layer, why in said["held"].items() if why and layer in layers.split(",")}
    if lacking:
        pytest.skip(f"this kernel lacks {lacking}")
    outcome: dict[str, str] = said["outcome"]
    return outcome


@pytest.mark.parametrize("user", ["ordinary", "whoever runs the tests"])
def test_all_layers_leave_what_is_open_and_the_tables(folder: Path, user: str) -> None:
    outcome = attempt(folder, "namespaces,landlock,seccomp", ("own", "compute", "table", *EVERYTHING), user)
    assert [name for name, refused in outcome.items() if not refused] == ["own", "compute", "table"]
    assert (folder / "secret").exists()
    assert not (folder / "new").exists()


def test_a_filter_of_system_calls_alone_opens_no_file_at_all(folder: Path) -> None:
    outcome = attempt(folder, "seccomp", ("own", "compute", "table", *EVERYTHING))
    assert [name for name, refused in outcome.items() if not refused] == ["own", "compute"]


def test_landlock_alone_opens_the_tables_only(folder: Path) -> None:
    outcome = attempt(folder, "landlock", ("own", "compute", "table", *FILES, "connect", "execute", "signal"), "root")
    assert [name for name, refused in outcome.items() if not refused] == ["own", "compute", "table"]


def test_a_network_of_its_own_reaches_nobody(folder: Path) -> None:
    outcome = attempt(folder, "namespaces", ("own", "connect"))
    assert not outcome["own"]
    assert outcome["connect"]


def test_a_process_with_threads_is_not_taken_for_confined() -> None:
    code = (
        "import threading; from app.mapping.readers.confinement import confine; done = threading.Event();"
        "threading.Thread(target=done.wait, daemon=True).start(); confine([], [])"
    )
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env={"PYTHONPATH": str(PROJECT), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "only a process with one thread" in ended.stderr


@pytest.mark.parametrize(
    ("work", "sign"),
    [
        ("bytearray(3 << 30)", "MemoryError"),
        ("open('big', 'wb').write(bytes(1 << 20))", "File too large"),
        ("[open('/dev/null') for _ in iter(int, 1)]", "Too many open files"),
    ],
)
def test_memory_files_and_descriptors_are_bounded(work: str, sign: str, tmp_path: Path) -> None:
    code = (
        "from app.mapping.readers.confinement import *; import os; limit(ResourceLimits(2 << 30, 60, 1 << 16));"
        f"assert os.nice(0) >= 10; here = os.getcwd(); confine([], [], ['none']); os.chdir(here); {work}"
    )
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env={"PYTHONPATH": str(PROJECT), "OPENBLAS_NUM_THREADS": "1"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert sign in ended.stderr


def test_the_process_ends_with_the_one_that_started_it(tmp_path: Path) -> None:
    child = (
        "import sys, time; from app.mapping.readers.confinement import *; limit(ResourceLimits(2 << 30, 60, 1 << 16));"
        "confine([], []); sys.stdout.write('ready\\n'); sys.stdout.flush(); time.sleep(100)"
    )
    parent = (
        "import subprocess, sys, os, signal;"
        f"child = subprocess.Popen([sys.executable, '-P', '-c', {child!r}], stdout=subprocess.PIPE);"
        "child.stdout.readline(); os.write(1, b'ready'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    # The pipe on standard error is the child's, too: it ends when both have.
    ended = subprocess.run(
        [sys.executable, "-P", "-c", parent],
        env={"PYTHONPATH": str(PROJECT), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert ended.stdout == b"ready"
    assert ended.returncode == -9


def judged(machine: str, number: int, *arguments: int, architecture: int, opening: bool = True) -> int | None:
    """What a filter answers: an error's number, 0 where it allows the call, None where it ends the process."""
    data = struct.pack("=iIQ6Q", number, architecture, 0, *arguments, *[0] * (6 - len(arguments)))
    program = make_filter(machine, opening=opening)
    steps = list(struct.iter_unpack("=HBBI", program))
    place, value = 0, 0
    while True:
        code, if_true, if_false, operand = steps[place]
        place += 1
        if code == 0x20:
            (value,) = struct.unpack_from("=I", data, operand)
        elif code == 0x06:
            return {0x7FFF0000: 0, 0x80000000: None}.get(operand, operand & 0xFFFF)
        else:
            met = {0x15: value == operand, 0x25: value > operand, 0x45: bool(value & operand)}[code]
            place += if_true if met else if_false


@pytest.mark.parametrize(
    ("machine", "architecture", "read", "openat", "socket", "clone", "execve", "mmap"),
    [
        ("x86_64", 0xC000003E, 0, 257, 41, 56, 59, 9),
        ("aarch64", 0xC00000B7, 63, 56, 198, 220, 221, 222),
    ],
)
def test_the_filter_judges_the_calls_of_each_machine(
    machine: str, architecture: int, read: int, openat: int, socket: int, clone: int, execve: int, mmap: int
) -> None:
    def ask(number: int, *arguments: int, **how: bool) -> int | None:
        return judged(machine, number, *arguments, architecture=architecture, **how)

    assert ask(read) == 0
    assert [ask(number) for number in (socket, clone, execve, 435, 425, 10**6)] == [errno.ENOSYS] * 6
    assert ask(openat, 0, 0, os.O_RDONLY | os.O_CLOEXEC) == 0
    assert ask(openat, 0, 0, os.O_RDONLY, opening=False) == errno.EACCES
    for writing in (os.O_WRONLY, os.O_RDWR, os.O_CREAT, os.O_TRUNC):
        assert ask(openat, 0, 0, writing) == errno.EACCES
    assert (ask(mmap, 0, 0, 3), ask(mmap, 0, 0, 5)) == (0, errno.EPERM)
    assert judged(machine, read, architecture=0x40000003) is None
