"""Files without a name, which only the process that made them can open."""

import errno
import os
import tempfile
from typing import IO


def unnamed_file() -> IO[bytes]:
    """Return a new file without a name, which only this process can open.

    It lies where ``TMPDIR`` says, else in ``/var/tmp``, which is on disk where ``/tmp`` is memory, else in the working
    directory. Raises OSError.
    """
    given = os.environ.get("TMPDIR")
    for folder in (given,) if given else ("/var/tmp", "."):  # noqa: S108 - the file has no name
        try:
            return tempfile.TemporaryFile(dir=folder, prefix="bathyfleet-")
        except (PermissionError, FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            if error.errno != errno.EROFS:
                raise
    return tempfile.TemporaryFile(prefix="bathyfleet-")
