"""JSON is read in pieces to the same value, and what it may hold is bounded before that."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.api.http import json_text
from app.api.http.json_text import (
    Bounds,
    EntryTooLongError,
    NameTwiceError,
    may_be_unstorable,
    parse,
    unstorable,
)

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=40,
)


@given(st.dictionaries(st.text(max_size=4), VALUES, max_size=5), st.booleans(), st.sampled_from([None, 1]))
def test_text_longer_than_a_window_means_the_same(value: dict[str, Any], ascii_only: bool, indent: int | None) -> None:
    text = json.dumps(value, ensure_ascii=ascii_only, indent=indent)
    text = text.encode(errors="surrogatepass").decode(errors="replace")
    whole = json.loads(text)
    with pytest.MonkeyPatch.context() as patch:
        for window in (40, 200):
            patch.setattr(json_text, "WINDOW", window)
            try:
                assert parse(text.encode()) == whole
            except EntryTooLongError:
                assert len(text) > window


@given(st.lists(st.floats(-1e9, 1e9) | st.integers() | st.text(max_size=3), min_size=30, max_size=60), st.data())
def test_wrong_text_is_refused_at_the_same_place(entries: list[Any], data: st.DataObject) -> None:
    text = json.dumps({"items": entries})
    at = data.draw(st.integers(0, len(text) - 1))
    text = text[:at] + data.draw(st.sampled_from(["", "]", "}", ",", "x", '"', "\\"])) + text[at + 1 :]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(json_text, "WINDOW", 120)
        try:
            expected = json.loads(text)
        except json.JSONDecodeError:
            with pytest.raises((json.JSONDecodeError, EntryTooLongError)):
                parse(text.encode())
        else:
            assert parse(text.encode()) == expected


def test_a_name_that_stands_twice_is_refused_instead_of_taken_by_its_last_value() -> None:
    with pytest.raises(NameTwiceError, match="max_depth_m"):
        parse(b'{"limits": {"max_depth_m": 4, "min_depth_m": 1, "max_depth_m": 40}}')
    assert parse(b'[{"a": 1}, {"a": 2}]') == [{"a": 1}, {"a": 2}]


def test_an_entry_longer_than_a_window_is_refused() -> None:
    with pytest.raises(EntryTooLongError):
        parse(json.dumps({"items": [[1.5] * json_text.WINDOW]}).encode())


def test_depth_without_end_is_refused() -> None:
    for text in (b"[" * 500_000, b'{"a":' * 500_000):
        with pytest.raises((RecursionError, json.JSONDecodeError, EntryTooLongError)):
            parse(text)


@given(
    st.lists(st.sampled_from(["\0", "\ud800", "\udc00", "\U0001f30a", "\\u0000", "\\", "é", '"', "u0000"]), max_size=8)
)
def test_text_that_no_database_can_store_is_noticed_in_every_spelling(parts: list[str]) -> None:
    text = "".join(parts)
    body = json.dumps({"a": [{"b": text}]}).encode()
    # Two halves that came from two texts are a pair once they are side by side.
    read = json.loads(body)["a"][0]["b"]
    bad = "\0" in read or any("\ud800" <= c <= "\udfff" for c in read)
    assert may_be_unstorable(body) == bad
    assert [(path, found) for path, found in unstorable(json.loads(body))] == ([(("a", "0", "b"), read)] if bad else [])


def test_names_are_looked_at_too() -> None:
    assert [path for path, _ in unstorable({"a": {"b\0": 1}})] == [("a",)]


def test_raw_halves_of_pairs_are_no_json() -> None:
    with pytest.raises(UnicodeDecodeError):
        parse(b'{"name": "\xed\xa0\x80"}')


def test_what_is_counted_is_never_less_than_there_is() -> None:
    bounds = Bounds(values=10, texts=4)
    assert not bounds.excess(b'{"a": [1, 2, 3], "b": {"c": "d"}}')
    assert bounds.excess(b'{"a": 1, "b": 2, "c": 3, "d": 4, "e": 5}') == "more than 4 names and texts"
    assert bounds.excess(b"[" + b"1," * 20 + b"1]") == "more than 10 values"
