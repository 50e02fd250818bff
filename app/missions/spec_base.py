"""What all parts of a mission's description share."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Latitude = Annotated[float, Field(ge=-90, le=90, description="Latitude, WGS84 degrees")]
Longitude = Annotated[float, Field(ge=-180, le=180, description="Longitude, WGS84 degrees")]
Name = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]


class Model(BaseModel):
    """Base: unknown fields are refused, so that a misspelt limit is an error and not a default."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
