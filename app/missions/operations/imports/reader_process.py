"""Files from elsewhere are read by a process of their own, locked in, a few at a time; what it says is checked."""

import asyncio
import json
import math
import os
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import asdict
from typing import IO, Annotated, Any, Literal

import numpy as np
import structlog
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from app.mapping.readers.confinement import FORBIDDEN, LOCKING_CALLS
from app.mapping.readers.types import (
    MAX_CORNERS,
    MAX_DEPTH_M,
    MAX_DRAWINGS,
    MAX_DRAWN_CORNERS,
    MAX_SOUNDINGS,
    MAX_ZONES,
    MIN_DEPTH_M,
    UNCONFINED,
    UNUSABLE,
    MapExtent,
    ReadOptions,
)
from app.mapping.types import MAX_SD_M
from app.missions.errors import ImportUnavailableError, InvalidRequestError
from app.missions.operations import child_process
from app.missions.operations.imports.uploads import Upload
from app.missions.spec.base import SHOWN_PATTERN
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.unnamed_file import unnamed_file

log = structlog.get_logger(__name__)

READING_TIMEOUT_S = 180.0
WAITING_TIMEOUT_S = 60.0
AT_ONCE = 1
"""Each takes a core and memory, which vehicles' decisions need."""
MAX_ANSWER_BYTES = 1 << 21
"""Names of as many lines as are read, each of their characters escaped, take so much."""
FEWEST_CORNERS = 3
FEWEST_ON_LINE = 2

_ENVIRONMENT = ("LD_LIBRARY_PATH", "PROJ_DATA", "GDAL_DATA", "TMPDIR", "TZDIR")
"""What the reading process gets of ours: where libraries and their tables lie, and nothing that is secret."""

Text = Annotated[str, Field(max_length=500)]


class _Zone(BaseModel):
    """What the reading process says of something to keep out of."""

    model_config = ConfigDict(extra="forbid", strict=True)

    # fmt: off
    kind: Literal[
        "LNDARE", "OBSTRN", "WRECKS", "UWTROC", "RESARE", "SLCONS", "PONTON", "PILPNT", "OFSPLF", "MORFAC", "MARCUL",
        "FSHFAC", "HULKES", "FLODOC", "DAMCON", "GATCON",
    ]
    # fmt: on
    name: Annotated[str, Field(max_length=60)]
    depth_m: Annotated[float, Field(ge=MIN_DEPTH_M, le=MAX_DEPTH_M)] | None
    position_m: Annotated[float, Field(ge=0, le=1000)]


class _Drawing(BaseModel):
    """What the reading process says of a line or an area."""

    model_config = ConfigDict(extra="forbid", strict=True)

    kind: Literal["line", "area"]
    name: Annotated[str, Field(min_length=1, max_length=64, pattern=SHOWN_PATTERN)]


class _Answer(BaseModel):
    """What the reading process says. It has read what nobody vouches for, so nobody vouches for what it says."""

    model_config = ConfigDict(extra="forbid", strict=True)

    confined: dict[Text, Text] = Field(max_length=10)
    shape: list[int] = Field(default=[], max_length=2)
    notes: list[Text] = Field(default=[], max_length=20)
    found: int = Field(default=0, ge=0)
    zones: list[_Zone] = Field(default=[], max_length=MAX_ZONES)
    drawings: list[_Drawing] = Field(default=[], max_length=MAX_DRAWINGS)
    field: Text = "file"
    message: Text = ""
    remedy: Text = ""


class ChartedZone(BaseModel):
    """Something on a chart to keep out of; ``ring`` is longitude and latitude, and ends where it began."""

    model_config = ConfigDict(frozen=True)

    kind: str
    name: str
    depth_m: float | None
    position_m: float
    ring: list[tuple[float, float]]


class DrawnShape(BaseModel):
    """A line, or the outline of an area, which ends where it began; ``places`` are longitude and latitude."""

    model_config = ConfigDict(frozen=True)

    kind: Literal["line", "area"]
    name: str
    places: list[tuple[float, float]]


class Found(BaseModel):
    """What is in a file.

    Attributes
    ----------
    values
        Soundings (n, 4) of east, north, depth and standard deviation in metres, or depths at the map's cells.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True, frozen=True)

    values: NDArray[np.float64]
    notes: list[str]
    found: int


class Reader:
    """Reads uploads.

    Parameters
    ----------
    unconfined
        Read them even where the system has nothing to lock the reading process in with.
    """

    def __init__(self, *, unconfined: bool = False) -> None:
        self._unconfined = unconfined
        self._turn = asyncio.Semaphore(AT_ONCE)
        self._lacking: dict[str, str] = {}

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Wait until a file may be read. Raises ImportUnavailableError when that takes long."""
        try:
            async with asyncio.timeout(WAITING_TIMEOUT_S):
                await self._turn.acquire()
        except TimeoutError:
            raise ImportUnavailableError(
                f"other files are being read, and none was finished within {WAITING_TIMEOUT_S:g} s",
                "send it again in a while",
            ) from None
        try:
            yield
        finally:
            self._turn.release()

    async def read(
        self, upload: Upload, kind: str, what: Literal["soundings", "reference"], place: MapExtent, options: ReadOptions
    ) -> Found:
        """Read a file, within a :meth:`turn`.

        Parameters
        ----------
        kind
            The ending of its name, see ``app.mapping.readers.reader_choice.ending``.

        Raises
        ------
        InvalidRequestError
            When the file cannot be used.
        ImportUnavailableError
            When nothing here keeps the process that reads it from other files.
        """
        task = self._task(kind, what, place) | {"options": asdict(options)}
        with await asyncio.to_thread(unnamed_file) as result:
            answer = await self._ask(upload, task, result)
            expected = None if what == "soundings" else (place.grid.rows, place.grid.cols)
            values = await to_the_end(asyncio.to_thread(_values, result, tuple(answer.shape), expected))
            return Found(values=values, notes=answer.notes, found=answer.found)

    async def read_zones(
        self, upload: Upload, place: MapExtent, around_m: float
    ) -> tuple[list[ChartedZone], list[str]]:
        """Return what an ENC cell shows near a place to keep out of, enlarged, and notes; within a :meth:`turn`.

        Raises
        ------
        InvalidRequestError, ImportUnavailableError
            As ``read`` does.
        """
        task = self._task(".000", "zones", place) | {"around_m": around_m}
        with await asyncio.to_thread(unnamed_file) as result:
            answer = await self._ask(upload, task, result)
            corners = await to_the_end(
                asyncio.to_thread(
                    _corners, result, tuple(answer.shape), [FEWEST_CORNERS] * len(answer.zones), MAX_CORNERS
                )
            )
        zones = []
        for zone, ring in zip(answer.zones, _by_number(corners, len(answer.zones)), strict=True):
            closed = [(float(lon), float(lat)) for lon, lat in np.vstack([ring, ring[:1]])]
            zones.append(ChartedZone(**zone.model_dump(), ring=closed))
        return zones, answer.notes

    async def read_drawings(self, upload: Upload, kind: str, crs: str | None) -> tuple[list[DrawnShape], list[str]]:
        """Return the lines and areas of a file, and notes; within a :meth:`turn`.

        Raises
        ------
        InvalidRequestError, ImportUnavailableError
            As ``read`` does.
        """
        task = {"kind": kind, "what": "drawings", "crs": crs, "unconfined": self._unconfined}
        with await asyncio.to_thread(unnamed_file) as result:
            answer = await self._ask(upload, task, result)
            fewest = [FEWEST_CORNERS if one.kind == "area" else FEWEST_ON_LINE for one in answer.drawings]
            shape = tuple(answer.shape)
            corners = await to_the_end(asyncio.to_thread(_corners, result, shape, fewest, MAX_DRAWN_CORNERS))
        shapes = []
        for one, places in zip(answer.drawings, _by_number(corners, len(answer.drawings)), strict=True):
            closed = np.vstack([places, places[:1]]) if one.kind == "area" else places
            shapes.append(DrawnShape(kind=one.kind, name=one.name, places=[(float(a), float(b)) for a, b in closed]))
        return shapes, answer.notes

    def _task(self, kind: str, what: str, place: MapExtent) -> dict[str, Any]:
        grid = place.grid
        return {
            "kind": kind,
            "what": what,
            "origin": (place.frame.origin_lat_deg, place.frame.origin_lon_deg),
            "grid": {name: getattr(grid, name) for name in ("west_m", "south_m", "cell_m", "rows", "cols")},
            "margin_m": place.margin_m,
            "datum_epsg": place.datum_epsg,
            "unconfined": self._unconfined,
        }

    async def _ask(self, upload: Upload, task: dict[str, Any], result: IO[bytes]) -> _Answer:
        """Return what the reading process says when it is done. Raises InvalidRequestError, ImportUnavailableError."""
        code, said = await _run(upload.file, json.dumps(task), result)
        answer = _answer(said) if code in (0, UNUSABLE, UNCONFINED) else None
        if answer is None:
            raise _broken_off()
        self._note(answer.confined)
        if code == UNCONFINED:
            raise not_confined(answer.confined)
        if code == UNUSABLE:
            raise InvalidRequestError(answer.field, answer.message, answer.remedy)
        return answer

    def _note(self, confined: dict[str, str]) -> None:
        """Log once what this system lacks to lock readers in."""
        lacking = {layer: why for layer, why in confined.items() if why}
        if lacking != self._lacking:
            self._lacking = lacking
            log.warning("files from elsewhere are read with less confinement than there could be", lacking=lacking)


def not_confined(held: Mapping[str, str]) -> ImportUnavailableError:
    """Return that no file is read by a process that nothing locks in; ``held``: why, by layer."""
    if FORBIDDEN in held.values():
        calls = " ".join(LOCKING_CALLS)
        return ImportUnavailableError(
            "the service is forbidden to use Landlock and seccomp: nothing would keep a file from reading others",
            f"allow it these system calls, in a unit of systemd by a line SystemCallFilter={calls}",
        )
    return ImportUnavailableError(
        "this system has neither Landlock nor seccomp, so nothing would keep a file from reading others",
        "use a kernel that has them, or set unconfined_imports",
    )


def _broken_off() -> InvalidRequestError:
    return InvalidRequestError(
        "file", "the reading process broke off: the file is damaged or too large", "check or divide it"
    )


def _answer(said: bytes) -> _Answer | None:
    try:
        return _Answer.model_validate_json(said)
    except ValidationError:
        return None


def _values(result: IO[bytes], shape: tuple[int, ...], expected: tuple[int, int] | None) -> NDArray[np.float64]:
    """Return the numbers that the reading process wrote, when they can be what was asked for."""
    if expected is None:
        possible = len(shape) == 2 and shape[0] == 4 and 0 < shape[1] <= MAX_SOUNDINGS
    else:
        possible = shape == expected
    result.seek(0, os.SEEK_END)
    if not possible or result.tell() != math.prod(shape) * 8:
        raise _broken_off()
    result.seek(0)
    values = np.fromfile(result, "<f8").reshape(shape)
    depth = values[2] if expected is None else values[np.isfinite(values)]
    sound = bool(np.all((depth >= MIN_DEPTH_M) & (depth <= MAX_DEPTH_M)))
    if expected is None:
        sound &= bool(np.isfinite(values).all() and np.all((values[3] > 0.0) & (values[3] <= MAX_SD_M)))
    if not sound:
        raise _broken_off()
    return values.T.copy() if expected is None else values


def _corners(result: IO[bytes], shape: tuple[int, ...], fewest: list[int], most: int) -> NDArray[np.float64]:
    """Return corners (n, 3), each with the number of what it belongs to, when they can be what was asked for.

    ``fewest`` are how many each has at least, ``most`` how many all have at most.
    """
    result.seek(0, os.SEEK_END)
    if len(shape) != 2 or shape[0] != 3 or not 0 <= shape[1] <= most or result.tell() != 24 * shape[1]:
        raise _broken_off()
    result.seek(0)
    table = np.fromfile(result, "<f8").reshape(shape).T.copy()
    number, lon, lat = table.T
    sound = bool(np.isfinite(table).all()) and bool((np.abs(lon) <= 180.0).all() and (np.abs(lat) <= 90.0).all())
    sound &= bool(np.isin(number, np.arange(len(fewest))).all()) and bool((np.diff(number) >= 0.0).all())
    if not sound or (np.bincount(number.astype(np.int64), minlength=len(fewest)) < fewest).any():
        raise _broken_off()
    return table


def _by_number(corners: NDArray[np.float64], count: int) -> list[NDArray[np.float64]]:
    """Return the positions of each thing, in order of their numbers."""
    return np.split(corners[:, 1:], np.searchsorted(corners[:, 0], np.arange(1, count))) if count else []


async def _run(file: IO[bytes], task: str, result: IO[bytes]) -> tuple[int, bytes]:
    """Return the reading process's exit code and what it said; one that takes or says too much is ended."""
    file.seek(0)
    process = await child_process.start(
        "app.mapping.readers",
        [task, str(result.fileno())],
        stdin=file,
        stdout=asyncio.subprocess.PIPE,
        # What libraries write there may quote the file.
        stderr=asyncio.subprocess.DEVNULL,
        files=[result.fileno()],
        environment=reader_environment(),
        # The service's own folder is not its business.
        folder="/",
    )
    assert process.stdout is not None  # noqa: S101 - it is a pipe
    try:
        async with asyncio.timeout(READING_TIMEOUT_S):
            said = b""
            while len(said) <= MAX_ANSWER_BYTES and (piece := await process.stdout.read(MAX_ANSWER_BYTES)):
                said += piece
            if len(said) > MAX_ANSWER_BYTES:
                return -1, b""
            return await process.wait(), said
    except TimeoutError:
        return -1, b""
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


def reader_environment() -> dict[str, str]:
    """Return what a process that will be locked in is started with: this program, and one thread for each library."""
    kept = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
    return kept | {
        "PYTHONPATH": child_process.search_path(),
        "PYTHONDONTWRITEBYTECODE": "1",
        "LANG": "C.UTF-8",
        # One thread: those that run already would not be locked in.
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
        "GDAL_NUM_THREADS": "1",
        # Nothing besides the file: no neighbouring files, plug-ins, network, locks.
        "GDAL_PAM_ENABLED": "NO",
        "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
        "GDAL_DRIVER_PATH": "disable",
        "HDF5_PLUGIN_PATH": "/nonexistent",
        "HDF5_USE_FILE_LOCKING": "FALSE",
        "PROJ_NETWORK": "OFF",
    }
