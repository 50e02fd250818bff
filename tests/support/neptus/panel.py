"""Neptus' ConvCAO panel with its vehicles, as the real one behaved: it looks at no reply and forgives nothing.

It makes a sounding of every `Distance` of every system, uploads each step once, ignores what came of it, polls every
100 ms, moves places outside of the area to its border without a word, keeps the connection of an answer 404 open, and
takes a vehicle for arrived for good when it was once within 12.5 m.
"""

import ftplib
import http.client
import io
import json
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

NEAR_M = 12.5
LOITER_M = 7.5
SPEED_MPS = 1.3
DIVE_MPS = 0.3
SLANT_RAD = math.radians(22.5)
DVL = ("DVL Beam 0", "DVL Beam 1", "DVL Beam 2", "DVL Beam 3", "DVL Filtered")
FORWARD = "Forward Echo Sounder"
FORWARD_RANGE_M = 30.0
ALTIMETER = "Altimeter"

Floor = Callable[[float, float], float]
"""Depth of the sea floor at a row and a column, metres (cells of 1 m)."""


@dataclass
class Auv:
    """A vehicle that follows the panel's references: straight to the place, then in circles about it."""

    row: float
    col: float
    layer_m: float
    sensors: tuple[str, ...] = DVL
    depth_m: float = 0.0
    heading_rad: float = 0.0
    to: tuple[float, float] = (0.0, 0.0)
    arrived: bool = True
    legs_m: float = 0.0

    def __post_init__(self) -> None:
        self.to = (self.row, self.col)

    @property
    def off_m(self) -> float:
        """How far it is from where it is sent."""
        return math.dist((self.row, self.col), self.to)

    def advance(self, dt_s: float) -> None:
        """Fly on for a while."""
        bearing = math.atan2(self.to[1] - self.col, self.to[0] - self.row)
        # Near its place it turns about it, a little outwards or inwards so that the circle keeps its radius.
        turn = math.pi / 2 + 0.5 * math.tanh((LOITER_M - self.off_m) / 3.0) if self.off_m < 2 * LOITER_M else 0.0
        self.heading_rad = bearing + turn
        self.row += SPEED_MPS * dt_s * math.cos(self.heading_rad)
        self.col += SPEED_MPS * dt_s * math.sin(self.heading_rad)
        self.legs_m += SPEED_MPS * dt_s
        self.depth_m += float(np.clip(self.layer_m - self.depth_m, -DIVE_MPS * dt_s, DIVE_MPS * dt_s))


@dataclass
class RealPanel:
    """The panel; everything blocks, as there.

    ``pace`` is how much faster than the wall clock the panel lives, ``scale`` how much faster than the panel its
    simulated vehicles do. ``lost`` are steps whose upload never arrives, ``spoilt`` those that arrive as rubbish.
    """

    ftp_port: int
    http_port: int
    floor: Floor
    rows: int
    cols: int
    auvs: list[Auv]
    session: str = "Neptus_User_4711"
    password: str = "FTPUser123"  # noqa: S105 - what the panel's field is filled with
    source: str = "127.0.0.1"
    max_depth_m: float = 50.0
    noise_m: float = 0.05
    pace: float = 50.0
    scale: float = 1.0
    lost: frozenset[int] = frozenset()
    spoilt: frozenset[int] = frozenset()
    seed: int = 0
    time_step: int = 1
    label: str = "---"
    samples: list[list[float]] = field(default_factory=list)
    polls: int = 0
    held: list[http.client.HTTPConnection] = field(default_factory=list)
    answers: list[list[list[float]]] = field(default_factory=list)
    """`Location` of every answer that was taken."""
    waited_s: list[float] = field(default_factory=list)
    """How long each answer was waited for, seconds of the wall clock."""
    uploads: list[dict[str, Any]] = field(default_factory=list)
    cancel: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)
        self._connection: http.client.HTTPConnection | None = None

    # The buttons

    def connect(self) -> None:
        """Press Connect; what the label says then is the only thing of a reply that the panel ever shows."""
        client = self._ftp()
        try:
            self._log_in(client)
            made = _try(client, f"MKD /NEPTUS/{self.session}").startswith("2")
            farewell = _try(client, "QUIT")
        finally:
            client.close()
        if not made:
            self.label = farewell
            return
        self.label = "Connection Established"
        record = {"DateTime": "", "SessionID": self.session, "DemoMode": "1", "AUVs": str(len(self.auvs))}
        self._upload("NEPTUS", f"{self.session}.txt", json.dumps(record).encode())
        self._upload(f"NEPTUS/{self.session}", "mapPortoSparse.txt", b"2 2 0.5 0 0\n\n-1 -1 \n-1 19.5 \n")

    def start(self, steps: int) -> None:
        """Press START and fly until so many answers came, or until STOP."""
        while not self.cancel.is_set() and len(self.answers) < steps:
            for auv in self.auvs:
                auv.arrived = auv.arrived or auv.off_m < NEAR_M
            if all(auv.arrived for auv in self.auvs):
                self._control()
            else:
                self._live(1.0)

    def stop(self) -> None:
        """Press STOP: nobody is told."""
        self.cancel.set()

    def close(self) -> None:
        """Close Neptus."""
        for connection in (*self.held, *filter(None, [self._connection])):
            connection.close()

    def drift(self, seconds: float) -> None:
        """Let the console listen for a while before anything is pressed."""
        for _ in range(int(seconds)):
            self._live(1.0, wait=False)

    # What it does

    def _control(self) -> None:
        state = json.dumps(self._state()).encode()
        if self.time_step not in self.lost:
            self._upload("NEPTUS", f"{self.session}_Data.txt", b"{" if self.time_step in self.spoilt else state)
        began = time.monotonic()
        answer = self._await()
        if answer is None:
            return
        self.waited_s.append(time.monotonic() - began)
        self.answers.append(answer)
        self.time_step += 1
        for auv, place in zip(self.auvs, answer, strict=False):
            auv.to = (_clamped(place[0], self.rows), _clamped(place[1], self.cols))
        for auv in self.auvs:
            auv.arrived = False

    def _await(self) -> list[list[float]] | None:
        while not self.cancel.is_set():
            self._live(0.1)
            line = self._poll()
            if line is None:
                continue
            # Whatever is no such record ends the panel's thread for good.
            answer = json.loads(line)
            if answer["timeStep"] >= self.time_step:
                return list(answer["Location"])
        return None

    def _poll(self) -> bytes | None:
        path = f"/caoagile/FilesFromAgent/NEPTUS/{self.session}_NewActions.txt"
        connection = self._connection or http.client.HTTPConnection(
            "127.0.0.1", self.http_port, 20, source_address=(self.source, 0)
        )
        self._connection = None
        self.polls += 1
        try:
            connection.request("GET", path)
            response = connection.getresponse()
        except (OSError, http.client.HTTPException):
            connection.close()
            return None
        if response.status != 200:
            self.held.append(connection)
            return None
        line = response.readline()
        response.read()
        self._connection = connection
        return line

    def _state(self) -> dict[str, Any]:
        places = [self._cells(auv.row, auv.col) for auv in self.auvs]
        heights = [self.max_depth_m - auv.depth_m for auv in self.auvs]
        samples, self.samples = self.samples, []
        record = {
            "timeStep": self.time_step,
            "SessionID": self.session,
            "Bathymeter": [
                height - self.floor(auv.row, auv.col) for height, auv in zip(heights, self.auvs, strict=True)
            ],
            "Location": [
                [float(math.floor(row + 0.5)), float(math.floor(col + 0.5)), float(int(height))]
                for (row, col), height in zip(places, heights, strict=True)
            ],
            "MBSamples": [sample[3] for sample in samples],
            "SampleLocations": [sample[:3] for sample in samples],
        }
        self.uploads.append(record)
        return record

    def _live(self, seconds: float, *, wait: bool = True) -> None:
        """Let the panel's time pass; the vehicles fly and measure meanwhile."""
        left_s = seconds * self.scale
        while left_s > 1e-9:
            dt_s = min(left_s, 0.5)
            left_s -= dt_s
            for auv in self.auvs:
                auv.advance(dt_s)
                for sensor in auv.sensors if self._rng.random() < dt_s else ():
                    self._measure(auv, sensor)
        if wait:
            time.sleep(seconds / self.pace)

    def _measure(self, auv: Auv, sensor: str) -> None:
        """A `Distance`: what the sensor met, and the sounding that the panel makes of it."""
        beam = int(sensor[-1]) if sensor[-1].isdigit() else 0
        azimuth_rad, slant_rad = auv.heading_rad + math.radians(90 * beam), SLANT_RAD
        if sensor == "DVL Filtered":
            slant_rad = 0.0
        measured = self._met(auv, azimuth_rad, slant_rad)
        if sensor == ALTIMETER:
            measured = self._met(auv, azimuth_rad, 0.0)
        elif sensor == FORWARD:
            measured = FORWARD_RANGE_M
        measured += self.noise_m * float(self._rng.standard_normal())
        beside_m = math.sin(slant_rad) * measured
        row, col = self._cells(auv.row + beside_m * math.cos(azimuth_rad), auv.col + beside_m * math.sin(azimuth_rad))
        self.samples.append([row, col, auv.depth_m, math.cos(slant_rad) * measured + auv.depth_m])

    def _met(self, auv: Auv, azimuth_rad: float, slant_rad: float) -> float:
        """Range along a beam to the sea floor."""
        reach_m = self.floor(auv.row, auv.col) - auv.depth_m
        for _ in range(3):
            beside_m = reach_m * math.tan(slant_rad)
            row, col = auv.row + beside_m * math.cos(azimuth_rad), auv.col + beside_m * math.sin(azimuth_rad)
            reach_m = self.floor(row, col) - auv.depth_m
        return reach_m / math.cos(slant_rad)

    def _cells(self, row: float, col: float) -> tuple[float, float]:
        return min(max(row, 0.0), self.rows - 1.0), min(max(col, 0.0), self.cols - 1.0)

    def _ftp(self) -> ftplib.FTP:
        client = ftplib.FTP(timeout=30, source_address=(self.source, 0))  # noqa: S321 - it speaks nothing safer
        client.connect("127.0.0.1", self.ftp_port)
        return client

    def _log_in(self, client: ftplib.FTP) -> None:
        _try(client, "USER FTPUser")
        _try(client, f"PASS {self.password}")

    def _upload(self, folder: str, name: str, content: bytes) -> None:
        """One connection for each file; what the server says is not looked at."""
        client = None
        try:
            client = self._ftp()
            self._log_in(client)
            _try(client, "TYPE I")
            _try(client, f"CWD /{folder}")
            client.storbinary(f"STOR {name}", io.BytesIO(content))
            _try(client, "QUIT")
        except (OSError, ftplib.Error, EOFError):
            self.label = "Server Error"
        finally:
            if client is not None:
                client.close()

    def still_held(self) -> int:
        """How many connections of answers 404 the server left open."""
        return sum(not _ended(connection) for connection in self.held)


def _try(client: ftplib.FTP, command: str) -> str:
    """Send a command; its reply whatever it is."""
    try:
        return client.sendcmd(command)
    except ftplib.Error as error:
        return str(error)


def _clamped(value: float, count: int) -> float:
    return count - 0.1 if value >= count else max(value, 0.0)


def _ended(connection: http.client.HTTPConnection) -> bool:
    sock = connection.sock
    if sock is None:
        return True
    sock.settimeout(5.0)
    try:
        while sock.recv(4096):
            pass
    except TimeoutError:
        return False
    except OSError:
        return True
    return True
