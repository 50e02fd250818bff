"""Functions stay such that a reader can hold them: few parameters, few lines, or a reason."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.paths import PROJECT

MOST_PARAMETERS, MOST_LINES = 10, 80
REASON = "One function because"
"""What a docstring says of a function that is long with good reason."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions() -> Iterator[tuple[Path, Function]]:
    for package in ("app", "imc_bridge", "simulator"):
        for path in sorted((PROJECT / package).rglob("*.py")):
            if "node_modules" not in path.parts:
                found = (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, Function))
                yield from ((path, node) for node in found)


def is_command(function: Function) -> bool:
    """Whether its parameters are the options of a command."""
    said = [*function.decorator_list, *(one.annotation for one in function.args.args if one.annotation is not None)]
    return any("typer." in ast.unparse(one) or ".command" in ast.unparse(one) for one in said)


def parameters(function: Function) -> int:
    of = function.args
    names = [one.arg for one in (*of.posonlyargs, *of.args, *of.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def lines(function: Function) -> int:
    first, *_ = function.body
    documented = ast.get_docstring(function) is not None
    said = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
    return (function.end_lineno or 0) - function.lineno + 1 - said


@pytest.fixture(scope="module")
def ours() -> list[tuple[Path, Function]]:
    return [(path, function) for path, function in functions() if not is_command(function)]


def named(found: list[tuple[Path, Function]]) -> list[str]:
    return [f"{path.relative_to(PROJECT)}:{one.lineno} {one.name}" for path, one in found]


def test_no_function_has_more_parameters_than_can_be_remembered(ours: list[tuple[Path, Function]]) -> None:
    assert len(ours) > 3000
    assert named([(path, one) for path, one in ours if parameters(one) > MOST_PARAMETERS]) == []


def test_a_function_that_is_longer_than_a_screen_says_why(ours: list[tuple[Path, Function]]) -> None:
    long = [(path, one) for path, one in ours if lines(one) > MOST_LINES]
    assert named([found for found in long if REASON not in " ".join((ast.get_docstring(found[1]) or "").split())]) == []
