"""Soundings that arrive late are put into the sessions they belong to, in many small parts, too."""

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.arrays import FloatArray, IntArray
from app.mapping.quality import clock_sessions
from app.mapping.quality.clock_sessions import sessions
from tests.support.mapping.tracks import flown, lawnmower

WAY = flown(lawnmower(100, 200, 10))[:, :3]


def in_whole_arrays(time_s: FloatArray, place_m: FloatArray) -> list[IntArray]:
    """Return sessions as they were found when each late run sorted all rows after it."""
    found: list[IntArray] = []
    for run in np.split(np.arange(len(time_s)), clock_sessions._set_back(time_s)):
        run = run[np.argsort(time_s[run], kind="stable")]
        for number in range(len(found) - 1, max(len(found) - clock_sessions.MOST, 0) - 1, -1):
            if continues(found[number], run, time_s, place_m, newest=number == len(found) - 1):
                rows = np.concatenate([found[number], run])
                found[number] = rows[np.argsort(time_s[rows], kind="stable")]
                break
        else:
            found.append(run)
    return found


def continues(rows: IntArray, run: IntArray, time_s: FloatArray, place_m: FloatArray, *, newest: bool) -> bool:
    times, of_run = time_s[rows], time_s[run]
    if of_run[0] >= times[-1]:
        return newest or follows(rows[-clock_sessions.MOST :], run[: clock_sessions.MOST], time_s, place_m)
    if of_run[-1] <= times[0]:
        return follows(run[-clock_sessions.MOST :], rows[: clock_sessions.MOST], time_s, place_m)
    known = rows[
        max(int(np.searchsorted(times, of_run[0])) - 1, 0) : int(np.searchsorted(times, of_run[-1], "right")) + 1
    ]
    low, high = int(np.searchsorted(of_run, times[0])), int(np.searchsorted(of_run, times[-1], "right"))
    new = run[max(low - 1, 0) : high + 1]
    _, one, other = np.intersect1d(time_s[known], time_s[new], return_indices=True)
    if 2 * len(one) >= len(new):
        return bool(np.median(np.hypot(*(place_m[known[one]] - place_m[new[other]]).T)) <= clock_sessions.SAME_MOMENT_M)
    both = np.concatenate([known, new])
    both = both[np.argsort(time_s[both], kind="stable")]
    apart = length_m(place_m[known]) + length_m(place_m[new])
    return length_m(place_m[both]) <= clock_sessions.ZIGZAG * apart + clock_sessions.TOLERANCE_M


def follows(before: IntArray, after: IntArray, time_s: FloatArray, place_m: FloatArray) -> bool:
    steps_s = np.concatenate([np.diff(time_s[before]), np.diff(time_s[after])])
    usual_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    gap_s = time_s[after[0]] - time_s[before[-1]]
    gap_m = np.hypot(*(place_m[after[0]] - place_m[before[-1]]))
    usual = gap_s <= clock_sessions.NEXT_OF_USUAL * usual_s
    return bool(usual and gap_m <= clock_sessions.FASTEST_MPS * gap_s + clock_sessions.UNCERTAIN_M)


def length_m(places_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(places_m, axis=0).T).sum())


@given(
    st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 60), st.sampled_from([0.0, 37.0, 400.0]),
    st.sampled_from([1, 4, 64]),
)  # fmt: skip
def test_parts_change_no_session(seed: int, streams: int, batch: int, set_back_s: float, part: int) -> None:
    """Several stretches of a way arrive side by side, some twice, some by a clock that was set back."""
    random = np.random.default_rng(seed)
    begins = random.integers(0, len(WAY) - 300, streams)
    sent = [WAY[begin : begin + random.integers(20, 300)].copy() for begin in begins]
    for stretch in sent[1:]:
        stretch[:, 0] -= random.choice([0.0, set_back_s])
    batches = [b for stretch in sent for b in np.split(stretch, range(batch, len(stretch), batch))]
    # In turn, as a vehicle sends what is new beside what is old.
    order = np.argsort(
        np.concatenate([np.arange(len(s) // batch + 1)[: -(-len(s) // batch)] for s in sent]), kind="stable"
    )
    time_s, *place = np.concatenate([batches[i] for i in order]).T
    with patch.object(clock_sessions, "PART", part):
        found = sessions(time_s, *place)
    expected = in_whole_arrays(time_s, np.column_stack(place))
    assert [rows.tolist() for rows in found] == [rows.tolist() for rows in expected]


def test_what_arrives_beside_a_backlog_is_not_measured_against_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of many late soundings was compared with every sounding after it."""
    measured = 0
    real = clock_sessions._length_m

    def counted(places_m: FloatArray) -> float:
        nonlocal measured
        measured += len(places_m)
        return real(places_m)

    def cost(count: int) -> int:
        nonlocal measured
        measured = 0
        old = np.arange(float(count))
        time_s = np.column_stack([old + count + 3600.0, old]).ravel()
        (found,) = sessions(time_s, time_s, np.zeros(2 * count))
        np.testing.assert_array_equal(time_s[found], np.sort(time_s))
        return measured

    monkeypatch.setattr(clock_sessions, "_length_m", counted)
    monkeypatch.setattr(clock_sessions, "PART", 32, raising=False)
    assert cost(2000) < 3 * cost(1000)


def test_many_sessions_that_nothing_continues_stay_apart() -> None:
    time_s = 11.0 * np.arange(500.0)[::-1]
    assert [rows.tolist() for rows in sessions(time_s, time_s, 0.0 * time_s)] == [[i] for i in range(500)]
