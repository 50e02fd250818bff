"""What all classes of messages share."""

from collections.abc import Callable
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, WrapValidator


class Model(BaseModel):
    """Something that the service is told or answers. Fields of a newer service are kept under their names."""

    model_config = ConfigDict(
        extra="allow",
        populate_by_name=True,
        serialize_by_alias=True,
        protected_namespaces=(),
        defer_build=True,
        # Else NaN would be sent as null, which says that there is no such value; the service refuses NaN.
        ser_json_inf_nan="constants",
    )


def _known_or_text(value: Any, known: Callable[[Any], Any]) -> Any:
    try:
        return known(value)
    except ValidationError:
        if isinstance(value, str):
            return value
        raise


Open = WrapValidator(_known_or_text)
"""A choice of words that a newer service may have more of: what is not known stays text."""
