"""The schemas of an OpenAPI document as pydantic classes.

Only names, types and meanings are taken over, no bounds: the service checks what it is sent and says what would be
right, and a client of an older version must not refuse what a newer service takes or answers.
"""

import keyword
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

Schema = Mapping[str, Any]

WIDTH = 120
SIMPLE = {"string": "str", "number": "float", "integer": "int", "boolean": "bool", "null": "None"}
REFERENCE = "#/components/schemas/"

HEADER = '''\
"""{about}

Written by ``python -m app.client`` from the service's OpenAPI document: changed there, not here.
"""
'''

HEAD = (
    HEADER
    + """
from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from bathyfleet.client.model import Model, Open
"""
)


def classes(schemas: Mapping[str, Schema]) -> str:
    """Return the source of a module with one class for each schema, and one name for each choice of words."""
    types = TypeNames(schemas)
    words, objects, unions = [], [], []
    for name, schema in schemas.items():
        if "enum" in schema:
            choice = f"Annotated[Literal[{', '.join(map(quoted, schema['enum']))}], Open]"
            words.append(_alias(name, choice, schema))
        elif "properties" in schema:
            objects.append("\n".join(_class(name, schema, types)))
        else:
            unions.append(_alias(name, types.of(schema), schema))
    head = HEAD.format(about="What the service is told and what it answers.")
    paragraphs = ["\n\n".join([head.rstrip(), *words]), *objects, "\n\n".join(unions)]
    return "\n\n\n".join(paragraphs) + "\n"


class TypeNames:
    """The Python types of schemas that refer to each other by their names.

    Parameters
    ----------
    schemas : mapping
        Those of the document, by name.
    prefix : str
        Before the names of classes, where they are in another module.
    """

    def __init__(self, schemas: Mapping[str, Schema], prefix: str = "") -> None:
        self._schemas = schemas
        self._prefix = prefix

    def of(self, schema: Schema) -> str:
        """Return the type's source. Raises ValueError for what no schema of this service has."""
        if "$ref" in schema:
            return self._prefix + str(schema["$ref"]).removeprefix(REFERENCE)
        if "const" in schema:
            return f"Literal[{quoted(schema['const'])}]"
        if "enum" in schema:
            return f"Literal[{', '.join(map(quoted, schema['enum']))}]"
        if "anyOf" in schema:
            return " | ".join(dict.fromkeys(self.of(branch) for branch in schema["anyOf"]))
        kind = schema.get("type")
        if kind is None:
            return "Any"
        if kind == "array":
            if "prefixItems" in schema:
                return f"tuple[{', '.join(map(self.of, schema['prefixItems']))}]"
            return f"list[{self.of(schema.get('items', {}))}]"
        if kind == "object":
            return self._object(schema)
        if schema.get("format") == "date-time":
            return "datetime"
        if kind not in SIMPLE:
            raise ValueError(f"no Python type is known for {schema}")
        return SIMPLE[kind]

    def _object(self, schema: Schema) -> str:
        if schema.get("title") in self._schemas:
            # A copy that the document holds where fields are read only.
            return f"{self._prefix}{schema['title']}"
        values = schema.get("additionalProperties", True)
        keys = self.of(schema["propertyNames"]) if "$ref" in schema.get("propertyNames", {}) else "str"
        return f"dict[{keys}, {self.of(values) if isinstance(values, Mapping) else 'Any'}]"


def quoted(value: Any) -> str:
    """Return a constant's source, text in double quotes."""
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"' if isinstance(value, str) else repr(value)


def attribute(name: str) -> str:
    """Return a field's name in Python: words of the language get an underscore."""
    return f"{name}_" if keyword.iskeyword(name) else name


def docstring(text: str, indent: str, parameters: Mapping[str, str] | None = None) -> list[str]:
    """Return a text as the lines of a docstring, with what parameters mean by how each is declared."""
    lines = _wrapped(text, indent)
    if parameters:
        lines += ["", "Parameters", "----------"]
        for declared, meaning in parameters.items():
            lines += [declared, *(f"    {line}" for line in _wrapped(meaning, indent + "    "))]
    quotes = 'r"""' if "\\" in "".join(lines) else '"""'
    if len(lines) == 1:
        return [f'{indent}{quotes}{lines[0]}"""']
    return [f"{indent}{quotes}{lines[0]}", *(f"{indent}{line}".rstrip() for line in lines[1:]), f'{indent}"""']


def _wrapped(text: str, indent: str) -> list[str]:
    clean = " ".join(text.split()).replace("\\", "\\\\").replace('"""', "'''")
    return textwrap.wrap(clean, WIDTH - len(indent) - 6) or [""]


def _alias(name: str, source: str, schema: Schema) -> str:
    lines = [f"{name}: TypeAlias = {source}"]
    if schema.get("description"):
        lines += docstring(schema["description"], "")
    return "\n".join(lines)


def _class(name: str, schema: Schema, types: TypeNames) -> Iterator[str]:
    yield f"class {name}(Model):"
    yield from docstring(schema.get("description") or f"{name}.", "    ")
    required = set(schema.get("required", []))
    yield ""
    # Fields without a default come first, as in any call.
    for field in sorted(schema["properties"], key=lambda field: field not in required):
        described = schema["properties"][field]
        yield "    " + _field(field, described, types, required=field in required)
        if described.get("description"):
            yield from docstring(described["description"], "    ")


def _field(name: str, schema: Schema, types: TypeNames, *, required: bool) -> str:
    kind, python = types.of(schema), attribute(name)
    alias = f", alias={quoted(name)}" if python != name else ""
    if required:
        return f"{python}: {kind}" + (f" = Field({alias[2:]})" if alias else "")
    default = schema.get("default")
    if default is None or isinstance(default, dict | list):
        # The service fills in what is left out.
        kind, default = (kind if kind.endswith("None") or kind == "Any" else f"{kind} | None"), None
    return f"{python}: {kind} = " + (f"Field({quoted(default)}{alias})" if alias else quoted(default))
