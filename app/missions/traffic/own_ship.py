"""Where the operation's own ship is, by the sentences of her GPS and compass (NMEA 0183); pynmeagps decodes them."""

import math
from dataclasses import dataclass

from app.missions.traffic.sentences import KNOT_MPS, MOST_BYTES, SentenceError, ShipPosition

OLD_S = 10.0
"""Receivers tell every second: after so long nobody knows any more where she is, or where her bow points."""

POSITIONS, COURSES, HEADING = frozenset({"GGA", "RMC"}), frozenset({"RMC", "VTG"}), "HDT"
MEASURED = frozenset({1, 2, 3, 4, 5})
"""Qualities of a GGA that are fixes; others are none, reckoned, typed in or simulated."""


@dataclass(frozen=True, slots=True)
class OwnPosition:
    """Where she was when that was told last, and what she did then; None: not told, or too long ago.

    ``heard_s`` is by the clock that :class:`OwnShip` is given.
    """

    lat_deg: float
    lon_deg: float
    sog_mps: float | None
    cog_deg: float | None
    heading_deg: float | None
    source: str
    heard_s: float


class OwnShip:
    """Puts together what sentences tell of her. What her own AIS transponder says (VDO) counts, too."""

    def __init__(self, forget_s: float) -> None:
        self._forget_s = forget_s
        self._place: tuple[float, float, str, float] | None = None
        self._way: tuple[float | None, float | None, float] = (None, None, -math.inf)
        self._heading: tuple[float | None, float] = (None, -math.inf)

    def read(self, line: bytes, source: str, now_s: float) -> bool:
        """Take a line, if it is of a GPS or compass; whether it is. Raises SentenceError for a damaged one."""
        begin = line.rfind(b"$")
        if begin < 0 or line[begin + 3 : begin + 6].decode("ascii", "replace") not in {*POSITIONS, *COURSES, HEADING}:
            return False
        if len(line) > MOST_BYTES or b"*" not in line[begin:]:
            raise SentenceError("it is too long, or has no checksum")
        from pynmeagps import NMEAReader

        try:
            message = NMEAReader.parse(line[begin:].strip() + b"\r\n")
            self._take(message, source, now_s)
        except Exception as error:  # whatever a decoder stumbles over
            raise SentenceError(type(error).__name__) from None
        return True

    def place(self, told: ShipPosition, source: str, now_s: float) -> None:
        """Take what her transponder says."""
        self._place = told.lat_deg, told.lon_deg, source, now_s
        self._way = told.sog_mps, told.cog_deg, now_s
        if told.heading_deg is not None:
            self._heading = told.heading_deg, now_s

    def at(self, now_s: float) -> OwnPosition | None:
        """Return where she was told to be last; None: that was never told, or so long ago that it is forgotten."""
        if self._place is None or now_s - self._place[3] > self._forget_s:
            return None
        lat_deg, lon_deg, source, heard_s = self._place
        sog_mps, cog_deg, way_s = self._way
        heading_deg, heading_s = self._heading
        if heard_s - way_s > OLD_S:
            sog_mps = cog_deg = None
        return OwnPosition(
            lat_deg, lon_deg, sog_mps, cog_deg, None if heard_s - heading_s > OLD_S else heading_deg, source, heard_s
        )

    def _take(self, message: object, source: str, now_s: float) -> None:
        kind = str(getattr(message, "msgID", ""))
        if kind == HEADING:
            heading_deg = _number(message, "headingT")
            self._heading = self._heading if heading_deg is None else (heading_deg % 360.0, now_s)
        if kind == "RMC" and getattr(message, "status", "V") != "A":
            return
        if kind == "GGA" and getattr(message, "quality", 0) not in MEASURED:
            return
        if kind in COURSES:
            speed_kn = _number(message, "spd" if kind == "RMC" else "sogn")
            course_deg = _number(message, "cog" if kind == "RMC" else "cogt")
            self._way = None if speed_kn is None else speed_kn * KNOT_MPS, course_deg, now_s
        lat_deg, lon_deg = _number(message, "lat"), _number(message, "lon")
        if kind in POSITIONS and lat_deg is not None and lon_deg is not None:
            if not (-90.0 <= lat_deg <= 90.0 and -180.0 <= lon_deg <= 180.0):
                raise SentenceError("its position is none")
            self._place = lat_deg, lon_deg, source, now_s


def _number(message: object, name: str) -> float | None:
    value = getattr(message, name, None)
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
