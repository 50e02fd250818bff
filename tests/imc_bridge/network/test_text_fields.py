"""Text fields of messages are read whole, and reading them costs no memory."""

import sys

import imcpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imc_bridge.network.text_fields import text


@given(st.text(st.characters(max_codepoint=127), max_size=300))
def test_a_text_is_read_as_it_was_written(words: str) -> None:
    message = imcpy.Announce()
    message.services = words
    assert text(message, "services") == text(message, "services") == words


@pytest.mark.parametrize(("message", "field"), [(imcpy.Announce(), "services"), (imcpy.VehicleState(), "last_error")])
def test_a_text_that_was_read_is_freed_when_nobody_needs_it(message: imcpy.Message, field: str) -> None:
    setattr(message, field, "long enough to be nobody else's text")
    other = "another ".replace(" ", " text that only this test holds")
    usual = sys.getrefcount(other)
    words = text(message, field)
    assert sys.getrefcount(words) == usual


def test_texts_may_be_read_for_ever() -> None:
    """Also the empty one and single letters, which Python keeps only once."""
    message = imcpy.Announce()
    for words in ("", "x", "lauv-xplore-1"):
        message.sys_name = words
        for _ in range(20_000):
            assert text(message, "sys_name") == words
