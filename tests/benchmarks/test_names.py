"""Benchmarks fly what was named, or say what there is."""

import argparse

import pytest

from benchmarks.common.names import named

PARSER = argparse.ArgumentParser()


def test_names_are_separated_by_commas() -> None:
    assert named(PARSER, "--only", "reef, canyon,", ["canyon", "reef", "ridge"]) == ["reef", "canyon"]
    assert named(PARSER, "--only", None, ["canyon"]) == []


def test_a_name_that_is_not_there_ends_the_command_and_lists_those_that_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        named(PARSER, "--only", "reef,nope", iter(["canyon", "reef", "reef"]))
    assert "argument --only: there is no 'nope' (choose from 'canyon', 'reef')" in capsys.readouterr().err
