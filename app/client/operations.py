"""The operations of an OpenAPI document as methods, once for programs that wait and once for asyncio."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from app.client.classes import HEADER, WIDTH, Schema, TypeNames, attribute, docstring

PREFIX = "/api/v1"
JSON = "application/json"
SENT_HEADERS = ("idempotency-key",)
"""Others (caches, streams) are the business of who makes the requests."""

HEAD = (
    HEADER
    + """
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Literal, TypeVar

from bathyfleet.client import models
from bathyfleet.client.call import Call, part

T = TypeVar("T")
"""
)

SYNC = '''

class Operations(ABC):
    """Every operation of the service as a method that returns its answer."""

    @abstractmethod
    def _call(self, call: Call[T]) -> T:
        """Make a request and return its answer."""
'''

ASYNC = '''

class AsyncOperations(ABC):
    """Every operation of the service as a coroutine that returns its answer."""

    @abstractmethod
    async def _call(self, call: Call[T]) -> T:
        """Make a request and return its answer."""
'''


@dataclass(frozen=True)
class Answer:
    """What an operation answers: its type, and how that is read (a type, ``bytes``, ``str`` or ``None``)."""

    kind: str
    reading: str


def operations(document: Mapping[str, Any]) -> str:
    """Return the source of a module with a class of methods and one of coroutines, a method for each operation."""
    types = TypeNames(document["components"]["schemas"], prefix="models.")
    found = [
        (path.removeprefix(PREFIX), method, operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    lines = [HEAD.format(about="The operations of the service's REST interface.").rstrip(), SYNC.rstrip()]
    for path, method, operation in found:
        lines += ["", *_method(path, method, operation, types, asynchronous=False)]
    lines.append(ASYNC.rstrip())
    for path, method, operation in found:
        lines += ["", *_method(path, method, operation, types, asynchronous=True)]
    return "\n".join(lines) + "\n"


def python_name(operation_id: str) -> str:
    """Return an operation's name in Python: ``createMission`` is ``create_mission``."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", operation_id).lower()


def _method(path: str, method: str, operation: Schema, types: TypeNames, *, asynchronous: bool) -> Iterator[str]:
    in_path = re.findall(r"{(\w+)}", path)
    described = {parameter["name"]: parameter for parameter in operation.get("parameters", [])}
    given = ["self"] + [f"{name}: {_path_type(described[name]['schema'])}" for name in in_path]
    passed = []
    if (content := operation.get("requestBody", {}).get("content")) is not None:
        body, argument = _body(content, types)
        given.append(body)
        passed.append(argument)
    query = {name: p for name, p in described.items() if p["in"] == "query"}
    headers = {name: p for name, p in described.items() if p["in"] == "header" and name in SENT_HEADERS}
    named = {attribute(name.replace("-", "_")): parameter for name, parameter in (query | headers).items()}
    if named:
        given.append("*")
    for name, parameter in named.items():
        kind = types.of(parameter["schema"])
        optional = "" if parameter.get("required") else " | None = None"
        given.append(f"{name}: {kind}{optional}")
    if query:
        passed.append("query={" + ", ".join(f'"{name}": {attribute(name)}' for name in query) + "}")
    if headers:
        passed.append("headers={" + ", ".join(f'"{name}": {name.replace("-", "_")}' for name in headers) + "}")
    answer = _answer(operation["responses"], types)
    start = "async def" if asynchronous else "def"
    yield from _wrapped(f"    {start} {python_name(operation['operationId'])}(", given, f") -> {answer.kind}:")
    note = operation["summary"].rstrip(".")
    about = f"{note}: ``{method.upper()} {path}``."
    meanings = {_declared(name, parameter, types): parameter["description"] for name, parameter in named.items()}
    yield from docstring(about, "        ", meanings)
    filled = re.sub(r"{(\w+)}", r"{part(\1)}", path)
    address = f'{"f" if in_path else ""}"{filled}"'
    call = f"Call[{answer.kind}]"
    returned = "return await" if asynchronous else "return"
    yield from _wrapped(
        f"        {returned} self._call({call}(", [f'"{method.upper()}"', address, answer.reading, *passed], "))"
    )


def _declared(name: str, parameter: Schema, types: TypeNames) -> str:
    """Return how a parameter is declared in a docstring: its type, bounds, and what is taken where it is left out."""
    schema = parameter["schema"]
    told = [types.of(schema)]
    if "maximum" in schema:
        least = f"{schema['minimum']} to " if "minimum" in schema else "at most "
        told.append(f"{least}{schema['maximum']}")
    if schema.get("default") not in (None, ""):
        told.append(f"default {schema['default']}")
    return f"{name} : {', '.join(told)}"


def _path_type(schema: Schema) -> str:
    return {"integer": "int"}.get(schema.get("type", ""), "str")


def _body(content: Schema, types: TypeNames) -> tuple[str, str]:
    """Return how a request's body is declared and how it is passed on."""
    if JSON not in content:
        return "content: bytes", "content=content"
    kind = types.of(content[JSON]["schema"])
    names = [name for name in kind.split(" | ") if name != "None"]
    optional = " | None = None" if "None" in kind.split(" | ") else ""
    return f"body: {' | '.join(names)} | Mapping[str, Any]{optional}", "body=body"


def _answer(responses: Schema, types: TypeNames) -> Answer:
    contents = [response.get("content") or {} for status, response in responses.items() if status.startswith("2")]
    filled = [content for content in contents if content]
    if not filled:
        return Answer("None", "None")
    kind = reading = _of_content(filled[0], types)
    return Answer(f"{kind} | None" if len(filled) < len(contents) else kind, reading)


def _of_content(content: Schema, types: TypeNames) -> str:
    """Return the type of an answer: JSON where there is, else text, or a file's bytes."""
    if JSON in content:
        return types.of(content[JSON].get("schema", {}))
    if len(content) > 1:
        return "bytes"
    ((media, described),) = content.items()
    if media.endswith("+json"):
        return "dict[str, Any]"
    binary = (described.get("schema") or {}).get("format") == "binary"
    return "str" if media.startswith("text/") and not binary else "bytes"


def _wrapped(start: str, parts: list[str], end: str) -> Iterator[str]:
    """Yield a call on one line where it fits, else one part a line."""
    line = start + ", ".join(parts) + end
    if len(line) <= WIDTH:
        yield line
        return
    indent = " " * (len(start) - len(start.lstrip()))
    yield start
    for each in parts:
        yield f"{indent}    {each},"
    yield indent + end
