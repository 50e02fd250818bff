"""Functions stay such that a reader can hold them: few parameters, few lines, or a reason."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.support.paths import PROJECT

MOST_PARAMETERS, MOST_LINES = 10, 80
REASON = "One function because"
"""What a docstring says of a function that is long with good reason."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Facts:
    """What is held against a function."""

    name: str
    parameters: int
    lines: int
    reasoned: bool


def functions() -> Iterator[Facts]:
    """Facts only: with the trees of all modules at hand, looking for garbage would take most of the time."""
    for package in ("app", "imc_bridge", "simulator"):
        for path in sorted((PROJECT / package).rglob("*.py")):
            if "node_modules" not in path.parts:
                found = (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, Function))
                yield from (facts(path, node) for node in found if not is_command(node))


def facts(path: Path, function: Function) -> Facts:
    said = " ".join((ast.get_docstring(function) or "").split())
    name = f"{path.relative_to(PROJECT)}:{function.lineno} {function.name}"
    return Facts(name, parameters(function), lines(function), REASON in said)


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
def ours() -> list[Facts]:
    return list(functions())


@pytest.mark.slow
def test_no_function_has_more_parameters_than_can_be_remembered(ours: list[Facts]) -> None:
    assert len(ours) > 3000
    assert [one.name for one in ours if one.parameters > MOST_PARAMETERS] == []


def test_a_function_that_is_longer_than_a_screen_says_why(ours: list[Facts]) -> None:
    assert [one.name for one in ours if one.lines > MOST_LINES and not one.reasoned] == []
