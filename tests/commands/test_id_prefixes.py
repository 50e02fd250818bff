"""Ids that commands are given in part."""

import pytest

from app.commands.command import CommandError, id_with_prefix

NAMED = {"4f0a11-1": "Quay", "4f0a11-2": "Dunes\x1b[2J", "4f0a": "Bar", "93d7c2": "Channel"}


def test_an_id_is_known_by_its_begin_where_no_other_begins_so() -> None:
    assert id_with_prefix("93d7", NAMED, "missions", "here") == "93d7c2"
    assert id_with_prefix("4f0a11-1", NAMED, "missions", "here") == "4f0a11-1"
    assert id_with_prefix("4f0a", NAMED, "missions", "here") == "4f0a", "a whole one"


@pytest.mark.parametrize(
    ("begin", "message", "remedy"),
    [
        (
            "4f0a1",
            "2 missions have ids that begin with '4f0a1'",
            "There are: 4f0a11-1 Quay; 4f0a11-2 Dunes\\x1b[2J, here",
        ),
        ("93d", "'93d' is too short", "Give at least 4 characters"),
        ("beef", "0 missions", "93d7c2 Channel, here"),
    ],
)
def test_candidates_are_told_where_one_is_not_meant_alone(begin: str, message: str, remedy: str) -> None:
    with pytest.raises(CommandError) as refused:
        id_with_prefix(begin, NAMED, "missions", "here")
    assert message in str(refused.value)
    assert remedy in refused.value.remedy


def test_of_many_candidates_the_newest_are_told() -> None:
    many = {f"abcd-{number}": "Quay" for number in range(9)}
    with pytest.raises(CommandError) as refused:
        id_with_prefix("abcd", many, "missions", "here")
    assert refused.value.remedy.endswith("abcd-4 Quay; and 4 more, here")
