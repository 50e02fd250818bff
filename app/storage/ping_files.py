"""Files of pings, each written once and whole, below a folder on this machine or anywhere that fsspec reaches."""

import hashlib
import os
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

from sqlalchemy import make_url

from app.storage import private

FOLDER = "pings"
PART = ".part"
REMOVED = ".removed"
"""Beside the folder of a mission that was removed: a list of the files that go with it."""


class PingFileError(Exception):
    """A file of pings is missing or damaged; ``str()`` names it."""


class PingPlaceError(PingFileError):
    """Where files of pings are cannot be reached, or refuses; ``str()`` says what its library says."""


class _Remote:
    """A file system of fsspec on another machine: whatever its library raises is a PingPlaceError.

    Libraries have errors of their own, such as those of HTTP, which nobody else knows. Only a file that is not there
    is FileNotFoundError as everywhere.
    """

    def __init__(self, file_system: Any, shown: str) -> None:
        self._file_system = file_system
        self._shown = shown

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._file_system, name)
        if not callable(found):
            return found

        def call(*arguments: Any, **options: Any) -> Any:
            with _reaching(self._shown):
                return found(*arguments, **options)

        return call


@contextmanager
def _reaching(shown: str) -> Iterator[None]:
    """Tell in PingPlaceError what keeps from reaching another machine."""
    try:
        yield
    except FileNotFoundError:
        raise
    except Exception as error:
        said = str(error).partition("\n")[0] or type(error).__name__
        raise PingPlaceError(f"the files of pings at {shown} cannot be reached: {said}") from error


def check_place(url: str) -> None:
    """Raise ValueError where nothing that is installed reaches files at such a URL, one of fsspec."""
    import fsspec  # slow to import, and needed by those only who have such a URL

    for part in url.split("::"):
        protocol = part.partition("://")[0]
        try:
            fsspec.get_filesystem_class(protocol)
        except ImportError as error:
            raise ValueError(
                f"{protocol}:// needs a package that is not installed ({error}); or name a folder"
            ) from None
        except ValueError:
            raise ValueError(f"{protocol}:// is not known; use a folder, or a URL such as s3://bucket/pings") from None


def file_name(mission_id: str, first_block: int, digest: str) -> str:
    """Return what the file of some blocks with this SHA-256 is called; written again it has the same name."""
    return f"{mission_id}/{first_block:012d}-{digest}.parquet"


def digest_in(name: str) -> str:
    """Return the SHA-256 that a file's name says it has."""
    return name.rpartition("-")[2].removesuffix(".parquet")


class PingFiles:
    """The files of all missions.

    Parameters
    ----------
    url
        A folder, or a URL of fsspec such as ``s3://bucket/pings``.
    """

    def __init__(self, url: str) -> None:
        self.url = url

    @classmethod
    def beside(cls, database_url: str, url: str = "") -> "PingFiles":
        """Return those at ``url``; where none is given in a folder beside SQLite's file, or else here."""
        parsed = make_url(database_url)
        on_disk = parsed.get_backend_name() == "sqlite" and parsed.database and parsed.database != ":memory:"
        return cls(url or str((Path(parsed.database).parent if on_disk and parsed.database else Path()) / FOLDER))

    @cached_property
    def _place(self) -> tuple[Any, str]:
        import fsspec  # slow to import, and needed by those only who have pings

        if "://" not in self.url:
            file_system, root = fsspec.core.url_to_fs(self.url)
            return file_system, str(root).rstrip("/")
        with _reaching(self._shown):
            file_system, root = fsspec.core.url_to_fs(self.url)
        return _Remote(file_system, self._shown), str(root).rstrip("/")

    @property
    def _shown(self) -> str:
        """The URL without a user's name and password."""
        return re.sub(r"://[^/]*@", "://", self.url).rstrip("/")

    @property
    def folder(self) -> Path | None:
        """The folder, if it is one of this machine."""
        file_system, root = self._place
        kinds = file_system.protocol if isinstance(file_system.protocol, tuple) else (file_system.protocol,)
        return Path(root) if "file" in kinds else None

    def where(self, name: str) -> str:
        """Return where a file is, for people: without a user's name and password in a URL."""
        return f"{self.folder / name}" if self.folder else f"{self._shown}/{name}".rstrip("/")

    def write(self, name: str, content: bytes) -> None:
        """Write a file; it has its name only when all of it is on the disk."""
        file_system, root = self._place
        path = f"{root}/{name}"
        if self.folder is None:
            file_system.makedirs(path.rpartition("/")[0], exist_ok=True)
            file_system.pipe_file(path + PART, content)
            file_system.mv(path + PART, path)
            return
        file = Path(path)
        private.make_folder(file.parent)
        part = file.with_name(file.name + PART)
        try:
            with private.open_new(part, "wb") as out:
                out.write(content)
                out.flush()
                os.fsync(out.fileno())
            part.rename(file)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        for place in (file.parent, file.parent.parent):
            descriptor = os.open(place, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)

    def read(self, name: str, digest: str) -> bytes:
        """Return a file's content. Raises PingFileError when it is missing or not what was written."""
        file_system, root = self._place
        try:
            content: bytes = file_system.cat_file(f"{root}/{name}")
        except FileNotFoundError:
            raise PingFileError(f"the file of pings {self.where(name)} is missing") from None
        except OSError as error:
            raise PingFileError(f"the file of pings {self.where(name)} cannot be read: {error}") from None
        found = hashlib.sha256(content).hexdigest()
        if found != digest:
            raise PingFileError(
                f"the file of pings {self.where(name)} is damaged: its SHA-256 is {found}, {digest} was written"
            )
        return content

    def names(self, mission_id: str | None = None) -> list[str]:
        """Return the names of a mission's files, or of all; of none that was not written to its end."""
        return [name for name in self._found(mission_id) if not name.endswith((PART, REMOVED))]

    def _found(self, mission_id: str | None) -> list[str]:
        file_system, root = self._place
        file_system.invalidate_cache()
        below = root if mission_id is None else f"{root}/{mission_id}"
        return sorted(str(path).removeprefix(f"{root}/") for path in file_system.find(below))

    def unfinished(self, mission_id: str) -> list[str]:
        """Return what is left of a mission's files that were not written to their end."""
        return [name for name in self._found(mission_id) if name.endswith(PART)]

    def remove_unfinished(self, names: Iterable[str]) -> None:
        """Remove what :meth:`unfinished` returned.

        A whole file is never removed because a database does not list it: another one may, whose only copy it is.
        """
        file_system, root = self._place
        for name in names:
            with suppress(FileNotFoundError):  # it has been finished since
                file_system.rm_file(f"{root}/{name}")

    def remove(self, mission_id: str, names: Iterable[str]) -> None:
        """Remove files of a mission that was removed from its database, and no others.

        They are noted before: :meth:`finish_removing` removes the rest where this process is killed.
        """
        listed = sorted(names)
        if listed:
            with suppress(OSError):  # a full disk is why missions are removed
                self.write(f"{mission_id}{REMOVED}", "\n".join(listed).encode())
        self._remove(mission_id, listed)

    def finish_removing(self, mission_id: str) -> None:
        """Remove what is left of files that were noted to go with a mission."""
        file_system, root = self._place
        try:
            listed = file_system.cat_file(f"{root}/{mission_id}{REMOVED}").decode().splitlines()
        except FileNotFoundError:
            return  # another process was faster
        self._remove(mission_id, listed)

    def _remove(self, mission_id: str, listed: Collection[str]) -> None:
        file_system, root = self._place
        for name in self._found(mission_id):
            if name in listed or name.endswith(PART):
                with suppress(FileNotFoundError):  # by another process that finishes the same
                    file_system.rm_file(f"{root}/{name}")
        if self.folder is not None:
            with suppress(OSError):  # it is not empty, or was never made
                (self.folder / mission_id).rmdir()
        self.spare(mission_id)

    def spare(self, mission_id: str) -> None:
        """Forget that files of a mission were to be removed: it is there, or they are gone."""
        file_system, root = self._place
        with suppress(FileNotFoundError):
            file_system.rm_file(f"{root}/{mission_id}{REMOVED}")

    def condemned(self) -> list[str]:
        """Return the missions that were removed, but not all of their files, when a process ended."""
        if "://" not in self.url and not Path(self.url).is_dir():
            return []
        file_system, root = self._place
        if not file_system.isdir(root):
            return []
        names = [str(path).rpartition("/")[2] for path in file_system.ls(root, detail=False)]
        return [name.removesuffix(REMOVED) for name in names if name.endswith(REMOVED)]

    def copy_to(self, other: "PingFiles", names: Iterable[str]) -> int:
        """Copy files, each checked by the digest in its name; returns how many the other place has of them now.

        Those that are there whole are not written again. What was written goes when the rest fails.

        Raises
        ------
        PingFileError
            When a file is missing or damaged here.
        OSError
            When one cannot be written there.
        """
        there, written, count = set(other.names()), list[str](), 0
        try:
            for name in names:
                count += 1
                if name not in there or not other.is_whole(name):
                    other.write(name, self.read(name, digest_in(name)))
                    written.append(name)
        except BaseException:
            file_system, root = other._place
            for name in written:
                file_system.rm_file(f"{root}/{name}")
            raise
        return count

    def is_whole(self, name: str) -> bool:
        """Tell whether a file is there and has the digest in its name."""
        try:
            self.read(name, digest_in(name))
        except PingFileError:
            return False
        return True
