"""The base of everything that the mission service answers."""

from pydantic import BaseModel, ConfigDict


class View(BaseModel):
    """Base of everything that is sent out."""

    # Every field is always sent; generated clients need not ask whether it is there.
    model_config = ConfigDict(frozen=True, json_schema_serialization_defaults_required=True)
