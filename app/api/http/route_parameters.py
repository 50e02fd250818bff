"""What a route takes in its query, with everything that it depends on."""

from collections.abc import Iterator

from fastapi.dependencies.models import Dependant
from pydantic import BaseModel


def parts_of(dependant: Dependant) -> Iterator[Dependant]:
    """Return an endpoint's own parameters and those of everything that it depends on."""
    yield dependant
    for part in dependant.dependencies:
        yield from parts_of(part)


def query_names(dependant: Dependant) -> set[str]:
    """Return the names of the parameters in the query."""
    return {name for part in parts_of(dependant) for name in _own(part)}


def _own(dependant: Dependant) -> Iterator[str]:
    for field in dependant.query_params:
        annotation = field.field_info.annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield from (one.alias or name for name, one in annotation.model_fields.items())
        else:
            yield field.alias
