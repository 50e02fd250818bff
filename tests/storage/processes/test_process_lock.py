"""A process shows by its lock that it lives, and nobody else can."""

import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.storage.processes import process_lock
from app.storage.processes.process_lock import LockHeldError, ProcessLock, is_held

HOLDER = """
import sys
from pathlib import Path
from app.storage.processes.process_lock import ProcessLock
lock = ProcessLock(Path(sys.argv[1]), 1)
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "fleet.db-process-1"


def locked(path: Path) -> int:
    """A lock on a file that is not ours to judge: of a process that did not make the file."""
    descriptor = os.open(path, os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_SH)
    return descriptor


def test_it_is_held_until_it_is_given_up(path: Path) -> None:
    lock = ProcessLock(path, 1)
    assert path.stat().st_mode & 0o777 == 0o600
    assert is_held(path)
    with pytest.raises(LockHeldError):
        ProcessLock(path, 1)
    assert lock.is_ours
    lock.release()
    assert not is_held(path)
    assert not path.exists()


def test_who_is_killed_holds_it_no_more_even_if_another_one_has_the_file_locked(path: Path) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert holder.stdout is not None
    assert holder.stdout.readline() == b"held\n"
    assert is_held(path)
    waiting = os.open(path, os.O_RDONLY)
    holder.kill()
    holder.communicate()
    fcntl.flock(waiting, fcntl.LOCK_SH)
    assert not is_held(path), "the process that it names is gone"
    ProcessLock(path, 1).release()
    os.close(waiting)


def test_an_id_that_was_given_out_again_is_another_process(path: Path) -> None:
    lock = ProcessLock(path, 1)
    said = json.loads(path.read_text())
    path.write_text(json.dumps(said | {"began": "1"}))
    assert not is_held(path)
    path.write_text(json.dumps(said | {"boot": "an earlier one"}))
    assert not is_held(path)
    path.write_text(json.dumps(said | {"world": "another container", "pid": 2**22}))
    assert is_held(path), "of a process in another container only the lock can be seen"
    lock.release()


def test_a_lock_of_a_version_before_counts_while_a_process_of_ours_has_it(
    path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path.touch(0o644)
    descriptor = locked(path)
    assert is_held(path)
    monkeypatch.setattr(process_lock, "PROC", tmp_path)
    assert not is_held(path), "where it cannot be seen who has it, it is no reason to leave missions alone"
    monkeypatch.undo()
    os.close(descriptor)
    assert not is_held(path)


def test_what_is_no_plain_file_is_no_lock(path: Path) -> None:
    os.mkfifo(path)
    assert not is_held(path)


def test_a_lock_that_was_removed_is_noticed(path: Path) -> None:
    lock = ProcessLock(path, 1)
    path.unlink()
    assert not lock.is_ours
    other = ProcessLock(path, 1)
    lock.release()
    assert is_held(path), "what another one made in its place stays"
    other.release()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make files for other users")
def test_a_file_of_a_third_user_is_no_lock_and_the_database_owners_is(path: Path) -> None:
    lock = ProcessLock(path, 1, owner=64_001)
    assert path.stat().st_uid == 64_001, "so that the owner's processes can see that root's lives"
    assert is_held(path, owner=64_001)
    assert not is_held(path, owner=64_003)
    lock.release()
