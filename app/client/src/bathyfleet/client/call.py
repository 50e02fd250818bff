"""A request and how its answer is read, before anything is sent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Generic, TypeVar
from urllib.parse import quote

import httpx
from pydantic import BaseModel, ConfigDict, TypeAdapter
from pydantic_core import PydanticSerializationError

T = TypeVar("T")

JSON = "application/json"


@dataclass(frozen=True)
class Call(Generic[T]):
    """One request of the REST interface.

    Parameters
    ----------
    method, path : str
        The path without ``/api/v1``, its parts escaped by :func:`part`.
    reading : type or None
        What the answer is: ``bytes`` or ``str`` as they are, anything else is read from JSON, None is no answer.
    body : Model or mapping, optional
        Sent as JSON; of a model only what was set, the service knows its own defaults.
    content : bytes, optional
        Sent as it is.
    query, headers : mapping
        Those that are None are left out.
    within_s : float, optional
        The time within which it has to be answered, whatever the client's patience.
    """

    method: str
    path: str
    reading: Any
    body: BaseModel | Mapping[str, Any] | None = None
    content: bytes | None = None
    query: Mapping[str, Any] = field(default_factory=dict)
    headers: Mapping[str, str | None] = field(default_factory=dict)
    within_s: float | None = None

    @property
    def repeatable(self) -> bool:
        """Whether sending it twice does what sending it once does."""
        return self.method == "GET" or self.headers.get("idempotency-key") is not None

    def request(self, client: httpx.Client | httpx.AsyncClient, within_s: float | None = None) -> httpx.Request:
        """Return the request for a connection whose base is the service's address, answered within some time."""
        headers = {name: value for name, value in self.headers.items() if value is not None}
        if self.reading not in (bytes, str, None):
            headers["Accept"] = f"{JSON}, application/geo+json"
        content = self.content
        if self.body is not None:
            content = as_json(self.body)
            headers["Content-Type"] = JSON
        elif content is not None:
            headers["Content-Type"] = "application/octet-stream"
        params = {name: value for name, value in self.query.items() if value is not None}
        request = client.build_request(
            self.method, f"/api/v1{self.path}", params=params, content=content, headers=headers
        )
        if within_s is not None:
            usual: Mapping[str, float | None] = request.extensions["timeout"]
            request.extensions["timeout"] = {
                name: within_s if s is None else min(s, within_s) for name, s in usual.items()
            }
        return request

    def read(self, answer: httpx.Response) -> T:
        """Return what a successful answer says."""
        value: Any
        if answer.status_code == httpx.codes.NO_CONTENT or self.reading is None:
            value = None
        elif self.reading is bytes:
            value = answer.content
        elif self.reading is str:
            value = answer.text
        else:
            value = _adapter(self.reading).validate_json(answer.content)
        return value  # type: ignore[no-any-return]


def part(value: str | int) -> str:
    """Return a part of a path, escaped. Raises ValueError for one that would make it another path."""
    if str(value) in ("", ".", ".."):
        raise ValueError(f"{value!r} is no id and no name: an address cannot be made of it")
    return quote(str(value), safe="")


def as_json(value: BaseModel | Mapping[str, Any], place: str = "") -> bytes:
    """Return what is sent of a value; NumPy's numbers and arrays are taken as Python's.

    Raises TypeError for what cannot be sent, with where it is: ``place`` is the value's own in the whole.
    """
    try:
        if isinstance(value, BaseModel):
            return value.model_dump_json(exclude_unset=True, fallback=_plain).encode()
        return _MAPPING.dump_json(dict(value), exclude_unset=True, fallback=_plain)
    except PydanticSerializationError as error:
        raise TypeError(_unfit(value, place) or str(error)) from None


def _plain(value: Any) -> Any:
    """Return an array or a number of NumPy as Python's own, without loading NumPy."""
    return value.tolist()


def _unfit(value: Any, place: str) -> str:
    """Say which value inside another one cannot be sent; nothing where each can."""
    if isinstance(value, Mapping | BaseModel):
        inner: Iterable[tuple[Any, Any]] = dict(value).items()
    elif isinstance(value, list | tuple):
        inner = enumerate(value)
    else:
        try:
            _ANY.dump_json(value, fallback=_plain)
        except PydanticSerializationError:
            return f"{place}: {value!r} cannot be sent; numbers, texts, times, lists and dicts can"
        return ""
    return next(filter(None, (_unfit(part, f"{place}.{name}".lstrip(".")) for name, part in inner)), "")


_MAPPING = TypeAdapter(dict[str, Any], config=ConfigDict(ser_json_inf_nan="constants"))
_ANY = TypeAdapter(Any)


@cache
def _adapter(reading: Any) -> TypeAdapter[Any]:
    return TypeAdapter(reading)
