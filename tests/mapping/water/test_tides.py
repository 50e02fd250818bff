"""Levels from a table of high and low waters."""

import math
import re
from contextlib import suppress
from datetime import UTC, date, datetime, timedelta
from datetime import time as clock_time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from app.mapping.water.tide_files import MAX_LEVEL_M, TideTableError, parse_tid
from app.mapping.water.tides import MAX_GAP_S

TABLE = """# Tides Data
# Time zone: UTC
# Harbor: Leixoes
2019/01/01 05:20:00.000 1.1
2019/01/01 11:38:00.000 2.9
2019/01/01 17:55:00.000 1.1

2019/01/02 00:08:00.000 3.0
"""


def at(*when: int) -> float:
    return datetime(*when, tzinfo=UTC).timestamp()  # type: ignore[arg-type, misc]


def test_the_table_is_met_at_its_entries_and_half_way_between() -> None:
    table = parse_tid(TABLE)
    assert (table.name, len(table.times_s)) == ("Leixoes", 4)
    np.testing.assert_allclose(table.levels_at(table.times_s), [1.1, 2.9, 1.1, 3.0])
    assert table.levels_at(at(2019, 1, 1, 8, 29)) == pytest.approx(2.0)
    quarter = at(2019, 1, 1, 5, 20) + 0.25 * 378 * 60
    assert table.levels_at(quarter) == pytest.approx(2.0 - 0.9 * math.cos(math.pi / 4))


@given(st.floats(0, 1))
def test_between_two_extremes_the_level_never_leaves_them(part: float) -> None:
    table = parse_tid(TABLE)
    span = table.times_s[-1] - table.times_s[0]
    assert 1.1 - 1e-9 <= table.levels_at(table.times_s[0] + part * span) <= 3.0 + 1e-9


@pytest.mark.parametrize(("minutes", "most_m"), [(6, 0.001), (30, 0.005), (60, 0.02)])
def test_observed_levels_are_no_staircase_of_extremes(minutes: int, most_m: float) -> None:
    """Half cosines between the levels of each hour are up to 0.09 m off half way up a tide of 3 m."""
    begin, period_s = datetime(2026, 1, 1, tzinfo=UTC), 12.42 * 3600

    def level(seconds: float) -> float:
        return 2.0 + 1.5 * math.sin(2 * math.pi * seconds / period_s)

    entries = [60.0 * minutes * i for i in range(48 * 60 // minutes + 1)]
    table = parse_tid("\n".join(f"{begin + timedelta(seconds=s):%Y/%m/%d %H:%M:%S} {level(s):.4f}" for s in entries))
    np.testing.assert_allclose(table.levels_at(table.times_s), table.levels_m)
    between = np.arange(0.0, entries[-1], 60.0)
    off = table.levels_at(begin.timestamp() + between) - [level(s) for s in between]
    assert np.abs(off).max() < most_m


@pytest.mark.parametrize("seconds", [-1.0, 67_681.0, 1e9, math.nan])
def test_beyond_the_table_there_is_no_level_and_a_reason(seconds: float) -> None:
    table = parse_tid(TABLE)
    time = table.times_s[0] + seconds
    assert np.isnan(table.levels_at(time))
    assert "2019-01-01 05:20 UTC to 2019-01-02 00:08 UTC" in table.why_not(time)


def test_a_hole_in_the_table_is_no_half_tide() -> None:
    late = datetime(2019, 1, 2, 0, 8, tzinfo=UTC) + timedelta(seconds=MAX_GAP_S + 60)
    table = parse_tid(TABLE + f"{late:%Y/%m/%d %H:%M:%S}.000 0.9\n")
    assert np.isnan(table.levels_at(table.times_s[-1] - 3600))
    assert "hole" in table.why_not(table.times_s[-1] - 3600)
    assert table.levels_at(table.times_s[-1]) == pytest.approx(0.9)
    assert table.why_not(table.times_s[-1]) == ""


def test_while_a_gauge_told_nothing_there_is_no_level() -> None:
    """A half cosine over six hours without its levels is up to 0.8 m off in a tide of 3 m."""
    begin = datetime(2026, 1, 1, tzinfo=UTC)
    hours = [h for h in range(48) if not 20 < h < 26]
    table = parse_tid(
        "\n".join(
            f"{begin + timedelta(hours=h):%Y/%m/%d %H:%M:%S} {1.5 + 1.5 * math.cos(2 * math.pi * h / 12.42):.3f}"
            for h in hours
        )
    )
    silent = begin.timestamp() + 3600.0 * np.array([20.5, 23.0, 25.5])
    assert np.isnan(table.levels_at(silent)).all()
    assert "hole" in table.why_not(silent[0])
    assert np.isfinite(table.levels_at(begin.timestamp() + 3600.0 * np.array([19.5, 20.0, 26.0, 26.5]))).all()


@given(st.sets(st.integers(1, 30), min_size=1, max_size=2), st.floats(0.2, 4.0), st.floats(0.0, 0.4))
def test_what_a_table_without_some_of_its_extremes_still_tells_is_right(
    missing: set[int], range_m: float, uneven: float
) -> None:
    """From one high water to the next, over a missing low water, levels were a whole tide off."""
    begin = datetime(2026, 1, 1, tzinfo=UTC)
    hours = 6.21 * np.arange(32) + 0.3 * np.sin(np.arange(32))
    levels = 2.0 + 0.5 * range_m * (-1.0) ** np.arange(32) * (1.0 + uneven * np.sin(0.9 * np.arange(32)))
    lines = [f"{begin + timedelta(hours=h):%Y/%m/%d %H:%M:%S} {z:.3f}" for h, z in zip(hours, levels, strict=True)]
    whole = parse_tid("\n".join(lines))
    table = parse_tid("\n".join(line for i, line in enumerate(lines) if i not in missing))
    times = np.arange(whole.times_s[0], whole.times_s[-1], 600.0)
    told = table.levels_at(times)
    known = np.isfinite(told)
    np.testing.assert_allclose(told[known], whole.levels_at(times)[known], atol=0.01)
    # What is beside a missing extreme is untold, and no more than one time from an extreme to the next besides.
    assert known.sum() >= len(times) - 6.6 * 6 * (3 * len(missing) + 1)
    for i in missing:
        assert "hole" in table.why_not(whole.times_s[i])
        assert table.hole_between(whole.times_s[i] - 60.0, whole.times_s[i] + 60.0)
    assert not whole.hole_between(whole.times_s[0], whole.times_s[-1])


@pytest.mark.parametrize("every_h", [2.5, 3.0, 4.0, 5.0])
def test_levels_too_far_apart_to_tell_the_tide_are_not_taken_for_extremes(every_h: float) -> None:
    begin, hours = datetime(2026, 1, 1, tzinfo=UTC), np.arange(0.0, 240.0, every_h)

    def level(hour: np.ndarray) -> np.ndarray:
        return 2.0 * np.cos(2 * np.pi * hour / 12.42)

    entries = zip(hours, level(hours), strict=True)
    table = parse_tid("\n".join(f"{begin + timedelta(hours=h):%Y/%m/%d %H:%M:%S} {z:.3f}" for h, z in entries))
    between = np.arange(0.0, hours[-1], 0.1)
    off = table.levels_at(begin.timestamp() + 3600.0 * between) - level(between)
    assert np.isnan(off).mean() > 0.5
    assert table.hole_between(table.times_s[0], table.times_s[-1])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "0 entries"),
        ("2019/01/01 05:20 1.1", "1 entries"),
        (TABLE + "2019/01/02 06:08 high", "line 9: '2019/01/02 06:08 high' is not of the form"),
        (TABLE + "2019/02/30 06:08 1.0", "line 9: .* is no date and time"),
        (TABLE + "2019/01/02 00:08 1.0", "line 9: .* is not later"),
        (TABLE + "2019/01/02 06:08 110", "line 9: the level 110 is not between"),
        (TABLE.replace("UTC", "local"), "line 2: the time zone is 'local'"),
        (TABLE + "2019-01/02 06:08 1.0", "line 9: .* is not of the form"),
        ("30/11/2026 11:00 1.0\n30/11/2026 11:06 1.1", "line 1: '30/11/2026 11:00 1.0' .* write the year first"),
        ("2026-11-30T11:00:00+25:00 1.0", "line 1: .* is no date and time"),
        ("0001-01-01T00:00:00+14:00 1.0", "line 1: .* is no date and time"),
        ("9999-12-31T23:59:59-14:00 1.0", "line 1: .* is no date and time"),
        ("2026-11-30 11:00,1,0\n", "line 1: '2026-11-30 11:00,1,0' is not of the form"),
        ("time (UTC+1);level\n", "line 1: the table states the time zone 'UTC\\+1'; times must be UTC"),
        ("# of a gauge\nlocal time;level\n", "line 2: the table states the time zone 'local'"),
        ("time,level (cm)\n", "line 1: the table states levels in 'cm'; they must be in metres"),
        ("Time (JST),level\n", "line 1: the table states the time zone 'JST'"),
        ("Time (+09:00),level\n", "line 1: the table states the time zone"),
        ("time_local,level_m\n", "line 1: the table states the time zone 'local'"),
        ("Date Time,LST,Level\n", "line 1: the table states the time zone 'LST'"),
        ("# units: ft\n", "line 1: the table states levels in 'ft'"),
        ("# time [LST], level [ft]\n", "line 1: the table states the time zone 'LST'"),
        ("# times are local\n", "line 1: the table states the time zone 'local'"),
        ("# times at WEST POINT are WEST\n", "line 1: the table states the time zone 'WEST'"),
        ("2026-11-30T11:00:00+0190 1.0", "line 1: .* is no date and time .*is no offset"),
        ("2026-11-30 11:00:00 +0190 1.0", "line 1: .* is no date and time .*is no offset"),
        ("2026-11-30 11:00:00 +01,5\n", "line 1: .* is not of the form"),
        ("2021/01/31 05:20" + 1_000_000 * " " + "x", "line 1: .* is not of the form"),
        ("time,level\ntime,level\n", "line 2: 'time,level' is not of the form"),
        ("\x00\x01", "line 1"),
    ],
)
def test_a_bad_table_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(TideTableError, match=message):
        parse_tid(text)


ELEVEN_S, NOON_S = 1_796_036_400.0, 1_796_040_000.0


@pytest.mark.parametrize(
    "text",
    [
        "2026-11-30T11:00:00Z 1.0\n2026-11-30T12:00:00Z 1.25\n",
        "2026-11-30T12:00+01:00 1.0\n2026-11-30T13:00+01:00 1.25\n",
        "2026-11-30T06:30:00.000-0430\t1.0\n2026-11-30T07:30:00.000-0430\t1.25\n",
        "2026-11-30 11:00Z,1.0\n2026-11-30 12:00Z, 1.25\n",
        "# of a gauge\ntime (UTC);level (m)\n2026-11-30 11:00;1,0\n2026-11-30 12:00;1,25\n",
        "2026-11-30 12:00:00 +01:00 1.0\n2026-11-30 13:00:00 +01:00 1.25\n",
        "2026-11-30 12:00:00 +0100,1.0\n2026-11-30 13:00:00 +0100,1.25\n",
        "Key West, time UTC, level m\n2026-11-30 11:00,1.0\n2026-11-30 12:00,1.25\n",
        "Station BST 12, UTC\n2026-11-30 11:00,1.0\n2026-11-30 12:00,1.25\n",
        "# time [UTC], level [m]\n2026-11-30 11:00,1.0\n2026-11-30 12:00,1.25\n",
        "\ufeffdate;time;level\r\n2026-11-30;11:00 UTC;1.0\r\n2026-11-30;12:00 UTC;1.25\r\n",
    ],
)
def test_what_gauges_export_is_read_with_its_zone(text: str) -> None:
    table = parse_tid(text)
    assert (table.times_s.tolist(), table.levels_m.tolist()) == ([ELEVEN_S, NOON_S], [1.0, 1.25])
    assert not table.utc_assumed


@pytest.mark.parametrize("separator", [" ", "\t", ",", ";", " ; "])
@pytest.mark.parametrize("seconds", ["", ":00"])
def test_times_without_a_zone_are_utc_and_the_table_says_so(separator: str, seconds: str) -> None:
    lines = [f"2026-11-30 {hour}:00{seconds}{separator}{level}" for hour, level in ((11, 1.0), (12, 1.25))]
    table = parse_tid("\n".join(lines))
    assert (table.times_s.tolist(), table.levels_m.tolist()) == ([ELEVEN_S, NOON_S], [1.0, 1.25])
    assert table.utc_assumed
    assert not parse_tid("\n".join(["# Time zone: UTC", *lines])).utc_assumed


@pytest.mark.parametrize(
    "words",
    [
        "# Harbor: Key West",
        "# Key West",
        "Key West, time, level",
        "# TIMES AND HEIGHTS FOR KEY WEST",
        "KEY WEST DATE,TIME,LEVEL",
        "# date and time at west point, FL",
        "# 3 ft above the pier",
        "# Local datum",
        "time,z",
        "# Made 2026-12-01 09:30 UTC+1",
        "# Foot of the mole, BST 12",
        "time (hh:mm),level (m)",
    ],
)
def test_names_are_no_zones_and_no_units(words: str) -> None:
    assert parse_tid(f"{words}\n2026-11-30 11:00,1.0\n2026-11-30 12:00,1.25\n").utc_assumed


FORMER = re.compile(
    r"(\d{4})/(\d{2})/(\d{2})\s+(\d{2}):(\d{2})(?::(\d{2})(?:\.(\d{1,6}))?)?\s+([-+]?\d+(?:\.\d*)?)\s*\Z"
)
"""Lines that were taken until other forms were, too: missions are stored with them."""

BLANKS = st.text("\t \x1f\xa0\u1680\u2003\u202f\u205f\u3000", min_size=1, max_size=4)


@given(
    st.dates(max_value=date(9999, 12, 30)),
    st.times(),
    st.lists(BLANKS, min_size=2, max_size=2),
    st.sampled_from(["{:%H:%M}", "{:%H:%M:%S}", "{:%H:%M:%S.%f}", "{:%H:%M:%S}.5"]),
    st.from_regex(r"[-+]?\d+(?:\.\d*)?", fullmatch=True),
    st.sampled_from(["0123456789", "\u0660\u0661\u0662\u0663\u0664\u0665\u0666\u0667\u0668\u0669"]),
)
@example(date(2021, 1, 31), clock_time(5, 20), ["\xa0", " "], "{:%H:%M}", "1.1", "0123456789")
def test_every_line_that_ever_was_taken_is(
    day: date, hour: clock_time, blanks: list[str], form: str, level: str, digits: str
) -> None:
    entry = f"{day.year:04}/{day:%m/%d}{blanks[0]}{form.format(hour)}{blanks[1]}{level}".translate(
        str.maketrans("0123456789", digits)
    )
    match = FORMER.match(entry)
    assert match is not None
    assume(abs(float(level)) <= MAX_LEVEL_M)
    *parts, second, fraction, told = match.groups()
    time = datetime(*map(int, parts), int(second or 0), tzinfo=UTC)  # type: ignore[arg-type, misc]
    time += timedelta(microseconds=int((fraction or "0").ljust(6, "0")))
    table = parse_tid(f"{entry}\n9999/12/31 23:59 1.0", stored=True)
    assert table.times_s[0] == pytest.approx(time.timestamp(), abs=1e-4)
    assert table.levels_m[0] == float(told)


@pytest.mark.parametrize("words", ["# units: ft", "# time [LST], level [ft]", "# local time", "# UTC+1"])
def test_a_stored_table_is_not_refused_for_its_comments(words: str) -> None:
    assert parse_tid(f"{words}\n{TABLE}", stored=True).times_s.tolist() == parse_tid(TABLE).times_s.tolist()


@given(st.text())
def test_whatever_is_sent_is_a_table_or_refused(text: str) -> None:
    with suppress(TideTableError):
        assert len(parse_tid(text).times_s) >= 2


@pytest.mark.terrains
def test_the_table_of_leixoes_is_read_to_its_end(terrains: Path) -> None:
    table = parse_tid((terrains / "leixoes_2019-2021.tid").read_text())
    assert (table.name, len(table.times_s)) == ("Leixoes", 4235)
    assert f"{table.last:%Y-%m-%d %H:%M}" == "2021-12-31 18:57"
    assert table.levels_at(at(2021, 12, 31, 12, 44)) == pytest.approx(3.2)
    assert np.isnan(table.levels_at(at(2022, 1, 1)))
