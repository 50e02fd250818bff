"""Content of files that leave the service: the same in memory and on disk, however many read it at once."""

import errno
import pickle
from itertools import zip_longest

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.missions.maps import file_content
from app.missions.maps.file_content import FileContent


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_content, "MEMORY_BYTES", 40)
    monkeypatch.setattr(file_content, "PIECE_BYTES", 7)


def filled(parts: list[bytes]) -> FileContent:
    content = FileContent(*parts[:1])
    for part in parts[1:]:
        content.add(part)
    return content


@pytest.mark.usefixtures("small")
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.binary(max_size=30), max_size=8), st.lists(st.binary(max_size=30), max_size=3))
def test_it_holds_what_it_was_given_and_goes_on_growing(parts: list[bytes], further: list[bytes]) -> None:
    content = filled(parts)
    assert content.whole() == b"".join(parts)
    for part in further:
        content.add(part)
    assert content.whole() == pickle.loads(pickle.dumps(content)).whole() == b"".join([*parts, *further])  # noqa: S301 - ours
    assert content.size_bytes == len(b"".join([*parts, *further]))


@pytest.mark.usefixtures("small")
def test_two_who_read_it_in_turn_do_not_disturb_each_other() -> None:
    whole = bytes(range(200))
    content = filled([whole[:50], whole[50:]])
    read = list(zip_longest(content.pieces(), content.pieces()))
    assert b"".join(a for a, _ in read) == b"".join(b for _, b in read) == whole


@pytest.mark.usefixtures("small")
def test_a_disk_that_is_full_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(file_content, "unnamed_file", full)
    content = filled([b"a" * 40])
    with pytest.raises(OSError, match="No space left"):
        content.add(b"b")
