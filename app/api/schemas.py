"""Bodies and parameters that only the HTTP edge knows; everything else is the missions' own models."""

import re
from contextvars import ContextVar
from functools import partial
from typing import Annotated, ClassVar, TypeVar

from fastapi import Path
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

from app.api.http.field_problems import MAX_ERRORS, SUGGESTION, field_problem
from app.api.http.json_text import Bounds, Unreadable
from app.api.http.problems import FieldProblem
from app.missions.operations.measurements import MAX_BATCH
from app.missions.operations.scans import MAX_SCANS
from app.missions.search.scan_schema import Scan
from app.missions.soundings.measurement import Measurement
from app.missions.spec.base import NOT_BLANK, Name
from app.missions.spec.site import SiteId

API = "/api/v1"

MAX_FAULTS = 5
"""At most so many faults of one item are explained."""

_suggestions = ContextVar("suggestions", default=MAX_ERRORS)
"""For how many more faults of a batch a field is looked for that may have been meant."""

MissionId = Annotated[
    str,
    Path(
        min_length=1,
        max_length=64,
        pattern=r"^[A-Za-z0-9_-]+$",
        description="The mission's id",
        examples=["0197a3c8-6f2e-7c41-9d0f-5b2f6f0c1a2b"],
    ),
]


def is_mission_id(text: str) -> bool:
    """Tell whether a text may be a mission's id, where nobody else has looked; databases take no NUL in a text."""
    return re.fullmatch(r"[A-Za-z0-9_-]{1,64}", text) is not None


VehicleName = Annotated[Name, Path(description="The vehicle's name", examples=["lauv-xplore-1"])]


class ActionRequest(BaseModel):
    """What an operator adds to an action."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"note": "Ferry passes at 14:10"}]})

    note: str = Field(default="", max_length=2000, description="Kept in the mission's log beside the action")


class StartRequest(ActionRequest):
    """What an operator adds when a mission is started."""

    confirmed: list[Annotated[str, Field(max_length=200)]] = Field(
        default_factory=list,
        max_length=40,
        description="Which of the checklist's `questions` the operator has looked at. The mission's log keeps them, "
        "and those that nobody confirmed",
    )


class EndRequest(ActionRequest):
    """What an operator adds when a mission is ended."""

    return_home: bool | None = Field(
        default=None,
        alias="return",
        description="true: vehicles go home to their recovery points, and the mission ends when they are there; false: "
        "they stop where they are. null: as recovery.on_finish says, and never with abort",
    )


class SiteChoice(BaseModel):
    """Which site a mission belongs to."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"site": None}]})

    site: SiteId | None = Field(description="The site; null: none")


class NoteRequest(BaseModel):
    """What the next watch should know."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"text": "Ferry passes at 14:10"}]})

    text: str = Field(min_length=1, max_length=2000, pattern=NOT_BLANK, description="Kept in the mission's log")


Item = TypeVar("Item", Measurement, Scan)


def _item(kind: type[Item], value: object) -> Item | str:
    """Return the item, or in words why ``value`` is none: of the first faults, whatever their number."""
    if isinstance(value, Unreadable):
        return str(value)
    if excess := _excess(value, kind):
        return excess
    try:
        return kind.model_validate(value)
    except ValidationError as error:
        entries = error.errors(include_url=False)[:MAX_FAULTS]
        # What a name may have been meant for is looked for in the first ones only: it takes far longer than the rest.
        left = _suggestions.get()
        _suggestions.set(left - len(entries))
        model = kind if left >= len(entries) else None
        faults = [field_problem(entry, location="body", path=entry["loc"], model=model) for entry in entries]
        return "; ".join(f"{f.field}: {f.message}; {_what_is_right(f)}" for f in faults)


def _what_is_right(fault: FieldProblem) -> str:
    return fault.expected if fault.expected.startswith(SUGGESTION) else f"expected {fault.expected}"


def _each_item(items: object, check: ValidatorFunctionWrapHandler) -> object:
    token = _suggestions.set(MAX_ERRORS)
    try:
        return check(items)
    finally:
        _suggestions.reset(token)


def _excess(value: object, model: type[BaseModel]) -> str:
    """Return in words that an object has far more fields than its model; nothing is made of it then."""
    known = len(model.model_fields)
    if not isinstance(value, dict) or len(value) <= known + MAX_FAULTS:
        return ""
    return f"{len(value)} fields: there are no more than {known}; expected one of {', '.join(model.model_fields)}"


# One after the other: in one go they would hold up every other thread.
BatchItem = Annotated[
    Measurement | str, PlainValidator(partial(_item, Measurement), json_schema_input_type=Measurement)
]
BatchScan = Annotated[Scan | str, PlainValidator(partial(_item, Scan), json_schema_input_type=Scan)]


class MeasurementBatch(BaseModel):
    """Measurements in the order in which they were made. Each item has its own verdict."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "items": [
                        {
                            "vehicle": "lauv-xplore-1",
                            "time_s": 1795225140.5,
                            "lat_deg": 41.1852,
                            "lon_deg": -8.7046,
                            "depth_m": 2.0,
                            "range_m": 11.4,
                        }
                    ]
                }
            ]
        },
    )

    json_bounds: ClassVar = Bounds(values=800_000, texts=250_000)

    judges_items: ClassVar = True

    items: Annotated[list[BatchItem], WrapValidator(_each_item)] = Field(min_length=1, max_length=MAX_BATCH)


class ScanBatch(BaseModel):
    """Scans in the order in which they were made."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "items": [
                        {
                            "vehicle": "boat-1",
                            "time_s": 1795225140.5,
                            "lat_deg": 41.1852,
                            "lon_deg": -8.7046,
                            "bearing_step_deg": 90.0,
                            "reach_m": 12.0,
                            "ranges_m": [7.2, None, 3.1, None],
                        }
                    ]
                }
            ]
        },
    )

    json_bounds: ClassVar = Bounds(values=3_000_000, texts=20_000)

    judges_items: ClassVar = True

    items: Annotated[list[BatchScan], WrapValidator(_each_item)] = Field(min_length=1, max_length=MAX_SCANS)


class ComponentHealth(BaseModel):
    """Whether the service can do its work."""

    status: str = Field(description="ok, or failing when a component is not ok", examples=["ok"])
    version: str = Field(description="Version of bathyfleet")
    components: dict[str, str] = Field(
        description="Each component: ok, or what is wrong with it", examples=[{"database": "ok", "imc": "ok"}]
    )
    compiling: bool = Field(
        description="Whether what decisions and maps are computed with is still being compiled, as after the first "
        "start on a machine: decisions are slow until then"
    )


class Liveness(BaseModel):
    """The process answers."""

    status: str = Field(default="ok", examples=["ok"])
