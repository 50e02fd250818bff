"""Tables of water levels as text: ``.tid`` files as of Neptus and DUNE, and what gauges export.

A line has a time of ISO 8601 and a level. Headers and comments may say that these are not what they are taken for.
"""

import hashlib
import re
from datetime import UTC, datetime, timedelta, timezone

import numpy as np

from app.mapping.water.tides import TideTable

MAX_LEVEL_M = 20.0
MAX_LINES = 200_000
MAX_OFFSET_H = 14
_SEPARATOR = r"(?: ?[,;] ?| )"
_LINE = re.compile(
    r"(?P<year>\d{4})(?P<mark>[-/])(?P<month>\d{2})(?P=mark)(?P<day>\d{2})"
    rf"(?:T|{_SEPARATOR})"
    r"(?P<hour>\d{2}):(?P<minute>\d{2})(?::(?P<second>\d{2})(?:\.(?P<fraction>\d{1,6}))?)?"
    r"(?P<zone> ?(?:Z|UTC|GMT)|[-+]\d{2}(?::?\d{2})?| [-+]\d{2}:?\d{2})?"
    rf"(?P<separator>{_SEPARATOR})(?P<level>[-+]?\d+(?:[.,]\d*)?)\Z",
    re.IGNORECASE,
)
"""A line without blanks at its ends, and with one where there are several."""

_DAY_OR_MONTH = re.compile(r"\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}\b")
_FORMS = "'2021-01-31T05:20:00Z 1.1' or '2021/01/31 05:20:00.000 1.1'"

UTC_NAMES = frozenset({"UTC", "GMT", "Z", "UTC+0"})
OTHER_ZONES = frozenset({
    "local", "lt", "lst", "ldt", "wet", "west", "cet", "cest", "mez", "mesz", "eet", "eest", "msk", "bst",
    "ist", "jst", "kst", "hkt", "sgt", "sast", "hst", "akst", "akdt", "pst", "pdt", "mst", "mdt", "cst",
    "cdt", "est", "edt", "ast", "adt", "nst", "ndt", "brt", "aest", "aedt", "acst", "acdt", "awst", "nzst",
    "nzdt",
})  # fmt: skip
OTHER_UNITS = frozenset({"mm", "cm", "dm", "ft", "feet", "foot"})
"""Words of a header or comment, in lower case, that say that times or levels are not what they are taken for."""

TIME_WORDS = frozenset({
    "time", "times", "timestamp", "date", "datetime", "hour", "hours", "clock", "zone", "timezone", "tz",
    "zeit", "uhrzeit", "hora",
})  # fmt: skip
LEVEL_WORDS = frozenset({
    "level", "levels", "height", "heights", "elevation", "stage", "tide", "water", "waterlevel", "value",
    "values", "unit", "units", "depth", "wl", "pegel",
})  # fmt: skip
"""In a column's name or a sentence without one of these such a word is part of a name, as in Key West."""

_PLACES = re.compile(r"\b(?:key west|west (?:dock|haven|point|port))\b", re.IGNORECASE)
"""What harbours are called, also in capitals, whose names hold one of those words where no zone is written so."""

_SHIFT = r"[-+\u2212]\s?(?=[0:]*[1-9])(?:1[0-4]|0?\d)(?::?\d\d)?(?!\d)"
_SHIFTED = re.compile(rf"\b(?:UTC|GMT)\s?{_SHIFT}", re.IGNORECASE)
_IS_UTC = re.compile(r"(?<![^\W_])(?:UTC|GMT)(?![^\W_])|[(\[]\s?Z\s?[)\]]|\btime Z\b", re.IGNORECASE)
_BRACKETS = re.compile(r"[(\[]([^()\[\]]*)[)\]]")
_IS_ZONE = re.compile(rf"[A-Z]{{1,4}}T|[A-Z][a-z]+/[A-Z]\w+|{_SHIFT}")
_CLOCK_TIME = re.compile(r"(?<![-+\u2212\d])\d{1,2}:\d\d")
_FORM_OF_TIME = re.compile(r"\b(?:y+|m+|d+|h+|s+)(?:[-:/.T](?:y+|m+|d+|h+|s+))+\b", re.IGNORECASE)
JUDGED_LINES, JUDGED_CHARACTERS = 500, 500
"""So much of headers and comments may say what a table holds."""


class TideTableError(ValueError):
    """A table that cannot be used; the message names the line, the value and what would be right."""


def parse_tid(text: str, *, name: str = "", stored: bool = False) -> TideTable:
    """Read a table: a time and a level in metres per line, ``#`` before comments, a header line where there is one.

    Times are ``YYYY/MM/DD hh:mm[:ss.sss]`` as in ``.tid`` files or ISO 8601, with ``Z`` or an offset such as ``+01:00``
    or without: then they are UTC. Blanks, a tab, a comma or a semicolon lie between time and level; after a semicolon
    a level may have a decimal comma.

    Parameters
    ----------
    name
        What it is called in messages; by default the harbour that its comments name.
    stored
        Whether the table was taken before: its mission is not lost for what is asked of comments and headers since.

    Raises
    ------
    TideTableError
        For a line that cannot be read, is out of order or has an impossible level, for a comment or header that states
        another time zone than UTC or another unit than metres, and for fewer than two entries.
    """
    times: list[float] = []
    levels: list[float] = []
    harbour = ""
    zone_named, zone_missing, header_seen = False, False, False
    for number, line in enumerate(text.splitlines(), start=1):
        if number > MAX_LINES:
            raise TideTableError(f"the table has more than {MAX_LINES} lines; send the years that are needed")
        entry = line.strip().removeprefix("\ufeff")
        if not entry:
            continue
        if entry.startswith("#"):
            key, _, value = entry.lstrip("# ").partition(":")
            if key.strip().lower() == "harbor":
                harbour = value.strip()[:100]
            elif key.strip().lower() == "time zone":
                if value.strip().upper() not in UTC_NAMES:
                    raise TideTableError(f"line {number}: the time zone is {value.strip()[:40]!r}; times must be UTC")
                zone_named = True
            else:
                zone_named |= _states_utc(entry.lstrip("# "), number, judge=not stored)
            continue
        if not times and not header_seen and entry.lstrip("\"'(")[:1].isalpha():
            header_seen = True
            zone_named |= _states_utc(entry, number, judge=not stored)
            continue
        time_s, level, has_zone = _entry(entry, number)
        if times and time_s <= times[-1]:
            raise TideTableError(f"line {number}: {entry[:40]!r} is not later than the entry before it")
        times.append(time_s)
        levels.append(level)
        zone_missing |= not has_zone
    if len(times) < 2:
        raise TideTableError(f"the table has {len(times)} entries; a level lies between two, so at least 2 are needed")
    digest = hashlib.sha256(text.encode()).hexdigest()
    utc_assumed = zone_missing and not zone_named
    return TideTable(name or harbour or "unnamed", np.array(times), np.array(levels), digest, utc_assumed)


def _states_utc(words: str, number: int, *, judge: bool) -> bool:
    """Return whether a header or a comment says that times are UTC.

    Raises
    ------
    TideTableError
        Where it states another zone or unit and is to be judged.
    """
    if number > JUDGED_LINES:
        return False
    words = _PLACES.sub("", " ".join(words[:JUDGED_CHARACTERS].split()))
    # When a file was made is not the zone of its times.
    zone = "" if _CLOCK_TIME.search(_SHIFTED.sub("", words)) else _other_zone(words)
    if judge and zone:
        raise TideTableError(
            f"line {number}: the table states the time zone {zone[:40]!r}; times must be UTC, or state their offset "
            "as in 2021-01-31T05:20+01:00"
        )
    unit = _other_unit(words)
    if judge and unit:
        raise TideTableError(f"line {number}: the table states levels in {unit!r}; they must be in metres")
    return not zone and not _CLOCK_TIME.search(words) and _IS_UTC.search(words) is not None


def _other_zone(text: str) -> str:
    """Return which zone but UTC is stated; '' for none, and where UTC is stated beside it."""
    shifted = _SHIFTED.search(text)
    if shifted is not None:
        return shifted.group()
    if _IS_UTC.search(text):
        return ""
    for column in re.split(r"[,;\t|]", text):
        words = _words(column)
        if TIME_WORDS.isdisjoint(word.lower() for word in words):
            alone = column.strip(" \"'()[]")
            if alone.lower() in OTHER_ZONES and not alone.istitle():
                return alone
            continue
        for inner in _BRACKETS.findall(column):
            if _IS_ZONE.fullmatch(inner.strip()) and inner.strip() != "UT":
                return str(inner.strip())
            found = [word for word in _words(inner) if word.lower() in OTHER_ZONES]
            if found:
                return found[0]
        # A zone is written in capitals, or like all else in small letters; what begins with one is a name.
        found = [w for w in words if w.lower() in OTHER_ZONES and (not w.istitle() or w == "Local")]
        if found:
            return found[0]
    return ""


def _other_unit(text: str) -> str:
    """Return which unit but metres is stated for levels; '' for none."""
    text = _FORM_OF_TIME.sub("", text)
    for column in re.split(r"[,;\t|]", text):
        inside = [word for inner in _BRACKETS.findall(column) for word in _words(inner)]
        outside = [] if LEVEL_WORDS.isdisjoint(word.lower() for word in _words(column)) else _words(column)
        alone = column.strip(" \"'").lower()
        found = [word for word in (alone, *inside, *outside) if word.lower() in OTHER_UNITS]
        if found:
            return found[0]
    return ""


def _words(text: str) -> list[str]:
    """Return words without those of a measure, as the unit in '3 ft above the pier'."""
    return re.findall(r"[^\W\d_]+", re.sub(r"\d[\d.]* ?[^\W\d_]+", "", text))


def _entry(entry: str, number: int) -> tuple[float, float, bool]:
    """Return time (Unix seconds), level (metres) and whether the time states its zone. Raises TideTableError."""
    match = _LINE.match(" ".join(entry.split()))
    if match is None or ("," in match["level"] and ";" not in match["separator"]):
        why = f"line {number}: {entry[:60]!r} is not of the form {_FORMS}"
        if _DAY_OR_MONTH.match(entry):
            why += "; which number is the day and which the month is open, write the year first"
        raise TideTableError(why)
    zone = (match["zone"] or "").strip()
    try:
        year, month, day = (int(match[part]) for part in ("year", "month", "day"))
        hour, minute, second = (int(match[part] or 0) for part in ("hour", "minute", "second"))
        time = datetime(year, month, day, hour, minute, second, tzinfo=_zone(zone))
        time.astimezone(UTC)
    except (ValueError, OverflowError) as error:
        raise TideTableError(f"line {number}: {entry[:60]!r} is no date and time ({error})") from None
    time_s = time.timestamp() + 1e-6 * int((match["fraction"] or "0").ljust(6, "0"))
    level = float(match["level"].replace(",", "."))
    if abs(level) > MAX_LEVEL_M:
        raise TideTableError(
            f"line {number}: the level {match['level'][:40]} is not between -{MAX_LEVEL_M:g} and {MAX_LEVEL_M:g} m"
        )
    return time_s, level, bool(zone)


def _zone(zone: str) -> timezone:
    """Return the zone of ``+hh``, ``+hhmm`` or ``+hh:mm``, UTC for others. Raises ValueError for what is no offset."""
    if zone[:1] not in ("+", "-"):
        return UTC
    digits = zone[1:].replace(":", "").ljust(4, "0")
    hours, minutes = int(digits[:2]), int(digits[2:])
    if hours > MAX_OFFSET_H or minutes > 59:
        raise ValueError(f"{zone} is no offset from UTC")
    size = timedelta(hours=hours, minutes=minutes)
    return timezone(-size if zone[0] == "-" else size)
