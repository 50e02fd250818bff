"""What is written is its owner's only, whatever the umask."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.storage import private


@pytest.fixture(autouse=True)
def _generous_umask() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def mode(path: Path) -> str:
    return f"{path.stat().st_mode & 0o777:o}"


def test_new_files_and_folders_are_the_owners_only(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    private.make_folder(tmp_path / "a" / "b")
    private.write(tmp_path / "a" / "map.tif", b"depths")
    private.create(tmp_path / "fleet.db")
    with private.open_new(tmp_path / "service.log") as log:
        log.write("line\n")
    assert [mode(tmp_path / name) for name in ("a", "a/b")] == ["700", "700"]
    assert [mode(tmp_path / name) for name in ("a/map.tif", "fleet.db", "service.log")] == ["600"] * 3
    assert mode(tmp_path) == "755", "a folder that was there is as its owner wants it"


def test_what_is_written_anew_is_closed_and_its_links_stay(tmp_path: Path) -> None:
    old, link = tmp_path / "old.csv", tmp_path / "link.csv"
    old.write_text("long before")
    link.symlink_to(old)
    private.write(link, "new")
    assert link.is_symlink()
    assert (old.read_text(), mode(old)) == ("new", "600")
    old.chmod(0o666)
    with private.open_new(old, "wb") as file:
        file.write(b"n")
    assert (old.read_text(), mode(old)) == ("n", "600")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.csv", "old.csv"]


def test_devices_keep_their_rights() -> None:
    before = mode(Path("/dev/null"))
    private.write(Path("/dev/null"), b"nothing")
    private.open_new(Path("/dev/null")).close()
    assert mode(Path("/dev/null")) == before


def test_what_is_open_is_mended_and_named(tmp_path: Path) -> None:
    for name, given in (("db", 0o644), ("db-wal", 0o664), ("db-process-3", 0o600), ("other", 0o644)):
        (tmp_path / name).touch()
        (tmp_path / name).chmod(given)
    found = private.mend([*private.family(tmp_path / "db"), tmp_path / "absent"])
    assert {path.name: before for path, before in found.items()} == {"db": "644", "db-wal": "664"}
    assert [mode(tmp_path / name) for name in ("db", "db-wal", "db-process-3", "other")] == ["600", "600", "600", "644"]
    assert private.still_open([tmp_path / "db", tmp_path / "other", tmp_path / "absent"]) == [tmp_path / "other"]


def test_a_folder_that_everybody_may_write_to_is_told(tmp_path: Path) -> None:
    assert not private.is_public(tmp_path)
    tmp_path.chmod(0o1777)
    assert private.is_public(tmp_path)
    assert not private.is_public(tmp_path / "absent")


def test_programs_that_are_started_write_privately_too(tmp_path: Path) -> None:
    with private.for_owner_only():
        (tmp_path / "file").touch()
    (tmp_path / "after").touch()
    assert [mode(tmp_path / name) for name in ("file", "after")] == ["600", "666"]
