"""AIS sentences (NMEA 0183, IEC 61993-2): what each tells of a ship. pyais decodes them.

Anybody near enough may send them, so nothing in one is believed to be well-formed.
"""

import string
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

MOST_BYTES = 1024
"""A line of NMEA has 82 characters, with a tag block before it about twice as many."""
MOST_FRAGMENTS, MOST_UNFINISHED = 5, 64
FRAGMENT_S = 30.0
"""Parts of one message come within so long, or never."""

CLASS_A, CLASS_B, STATIC, LONG_RANGE = (1, 2, 3), (18, 19), (5, 24), 27

KNOT_MPS = 1852.0 / 3600.0
NO_SPEED_KN, NO_COURSE_DEG, NO_HEADING_DEG = 102.3, 360.0, 511
LONG_RANGE_NO_SPEED_KN, LONG_RANGE_NO_COURSE_DEG = 63.0, 511.0
NO_STATUS = 15
_PLAIN = frozenset(string.ascii_letters + string.digits + string.punctuation + " ")


class SentenceError(ValueError):
    """A sentence that is not one, is damaged, or says what cannot be."""


@dataclass(frozen=True, slots=True)
class ShipPosition:
    """Where a ship is, its speed and course over ground, where its bow points and what it does; None: not told."""

    mmsi: int
    own: bool
    lat_deg: float
    lon_deg: float
    sog_mps: float | None = None
    cog_deg: float | None = None
    heading_deg: float | None = None
    status: str | None = None

    @property
    def lat_lon(self) -> tuple[float, float]:
        """Latitude and longitude, degrees."""
        return self.lat_deg, self.lon_deg


@dataclass(frozen=True, slots=True)
class ShipParticulars:
    """What a ship is. Lengths are from where its position is taken; None, and empty text: not told."""

    mmsi: int
    own: bool
    name: str = ""
    call_sign: str = ""
    type: str = ""
    to_bow_m: float | None = None
    to_stern_m: float | None = None
    to_port_m: float | None = None
    to_starboard_m: float | None = None
    draught_m: float | None = None


Told = ShipPosition | ShipParticulars


@dataclass
class SentenceReader:
    """Puts messages of several sentences together; keeps few that are not whole."""

    _parts: OrderedDict[tuple[str, int, str, int], tuple[float, list[Any]]] = field(default_factory=OrderedDict)

    def read(self, line: bytes, source: str, now_s: float) -> list[Told] | None:
        """Return what a line tells; nothing for what is of no interest, or not whole yet; None for what is no AIS.

        Parameters
        ----------
        source
            Whose line it is: parts of two receivers do not belong together.
        now_s
            A clock that only grows.

        Raises
        ------
        SentenceError
            For what is no sentence of AIS.
        """
        from pyais.exceptions import UnknownMessageException
        from pyais.messages import NMEASentenceFactory

        if len(line) > MOST_BYTES:
            raise SentenceError("it is too long")
        try:
            sentence = NMEASentenceFactory.produce(line)
            if sentence.TYPE != "AIS":
                return None  # other receivers' sentences, as of GPS, come on the same wire
            if not sentence.is_valid:
                raise SentenceError("its checksum is wrong")
            whole = self._whole(sentence, source, now_s)
            return [] if whole is None else _told(whole)
        except SentenceError:
            raise
        except UnknownMessageException:
            if line.lstrip()[:1] == b"$":
                return None
            raise SentenceError("it is not known") from None
        except Exception as error:  # whatever a decoder stumbles over
            raise SentenceError(type(error).__name__) from None

    def _whole(self, sentence: Any, source: str, now_s: float) -> Any:
        if sentence.is_single:
            return sentence
        if sentence.frag_cnt > MOST_FRAGMENTS:
            raise SentenceError("it has too many parts")
        for key in [key for key, (since_s, _) in self._parts.items() if now_s - since_s > FRAGMENT_S]:
            del self._parts[key]
        key = (source, -1 if sentence.seq_id is None else sentence.seq_id, sentence.channel, sentence.frag_cnt)
        if sentence.frag_num == 1:
            self._parts.pop(key, None)
            while len(self._parts) >= MOST_UNFINISHED:
                self._parts.popitem(last=False)
            self._parts[key] = (now_s, [sentence])
            return None
        begun = self._parts.get(key)
        if begun is None or sentence.frag_num != len(begun[1]) + 1:
            raise SentenceError("a part of it is missing")
        begun[1].append(sentence)
        if len(begun[1]) < sentence.frag_cnt:
            return None
        del self._parts[key]
        return type(sentence).assemble_from_iterable(begun[1])


def _told(sentence: Any) -> list[Told]:
    # Which message it is, is known before all of it is decoded: most others are of no interest.
    kind = sentence.ais_id
    if kind not in (*CLASS_A, *CLASS_B, *STATIC, LONG_RANGE):
        return []
    message = sentence.decode()
    mmsi, own = int(message.mmsi), sentence.type == "VDO"
    if not 0 < mmsi <= 999_999_999:
        raise SentenceError("its MMSI is none")
    found: list[Told] = []
    if kind not in STATIC:
        position = _position(message, mmsi, own, long_range=kind == LONG_RANGE)
        found += [] if position is None else [position]
    if kind in (*STATIC, 19):
        found.append(_particulars(message, mmsi, own))
    return found


def _position(message: Any, mmsi: int, own: bool, *, long_range: bool) -> ShipPosition | None:
    """Return where a ship says it is; None where it does not know (181 and 91 degrees)."""
    lat_deg, lon_deg = float(message.lat), float(message.lon)
    if lat_deg == 91.0 or lon_deg == 181.0:
        return None
    if not (-90.0 <= lat_deg <= 90.0 and -180.0 <= lon_deg <= 180.0):
        raise SentenceError("its position is none")
    speed_kn, course_deg = float(message.speed), float(message.course)
    no_speed, no_course = (
        (LONG_RANGE_NO_SPEED_KN, LONG_RANGE_NO_COURSE_DEG) if long_range else (NO_SPEED_KN, NO_COURSE_DEG)
    )
    heading_deg = float(getattr(message, "heading", NO_HEADING_DEG))
    status = getattr(message, "status", None)
    return ShipPosition(
        mmsi,
        own,
        lat_deg,
        lon_deg,
        None if speed_kn >= no_speed else speed_kn * KNOT_MPS,
        None if course_deg >= min(no_course, 360.0) else course_deg,
        None if heading_deg >= 360.0 else heading_deg,
        None if status is None or int(status) == NO_STATUS else _words(status.name),
    )


def _particulars(message: Any, mmsi: int, own: bool) -> ShipParticulars:
    bow, stern, port, starboard = (_metres(message, side) for side in ("bow", "stern", "port", "starboard"))
    # Zero and zero is what ships send that never entered it.
    long, wide = bow + stern > 0.0, port + starboard > 0.0
    kind, draught = getattr(message, "ship_type", None), getattr(message, "draught", None)
    return ShipParticulars(
        mmsi,
        own,
        name=_text(getattr(message, "shipname", "")),
        call_sign=_text(getattr(message, "callsign", "")),
        type=_words(kind.name) if kind is not None and int(kind) and hasattr(kind, "name") else "",
        to_bow_m=bow if long else None,
        to_stern_m=stern if long else None,
        to_port_m=port if wide else None,
        to_starboard_m=starboard if wide else None,
        draught_m=float(draught) if draught else None,
    )


def _metres(message: Any, side: str) -> float:
    return float(getattr(message, f"to_{side}", 0) or 0)


def _text(said: Any) -> str:
    return "".join(letter for letter in str(said or "")[:40] if letter in _PLAIN).strip("@ ")


def _words(name: str) -> str:
    """Return an enumeration's name as words: UnderWayUsingEngine is under way using engine."""
    spaced = "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name.replace("_", " "))
    return " ".join(spaced.split())
