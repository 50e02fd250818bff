"""A place that is surveyed again and again, as an operator describes it."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.spec.base import HALF_ROUND_DEG, FieldError, Model, PolygonGeometry, ShownName, cell_count

MAX_SITE_CELLS = 4_000_000
"""Of a site's grid: several surveys are taken together in memory."""

SiteId = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_-]+$")]
SiteCell = Annotated[float, Field(gt=0, le=1000, description="Cell of the site's grid, metres")]
YearlyChange = Annotated[
    float,
    Field(
        ge=0,
        le=100,
        description="By how much the floor may change in a year, standard deviation in metres: what was known grows as "
        "uncertain, after four years by twice as much. 0: surveys count the same however old",
    ),
]


class SiteSpec(Model):
    """A site as an operator describes it."""

    name: ShownName = Field(examples=["Leixoes, harbour mouth"])
    area: PolygonGeometry = Field(description="What belongs to the site")
    cell_m: SiteCell = 1.0
    yearly_change_m: YearlyChange = 0.0

    @model_validator(mode="after")
    def _area_is_of_a_sensible_size(self) -> "SiteSpec":
        lons, _ = zip(*self.area.ring, strict=True)
        if max(lons) - min(lons) > HALF_ROUND_DEG:
            raise FieldError(
                "area",
                f"it reaches from longitude {min(lons)} to {max(lons)}, and none that crosses 180 degrees is taken: "
                "give the part on each side as a site of its own",
            )
        try:
            size = self.local_area().max(axis=0)
        except ValueError as error:
            raise FieldError("area", f"{str(error).rpartition(': ')[0]}: choose a smaller one") from None
        cells = cell_count(size, self.cell_m)
        if min(size) < 2 * self.cell_m:
            raise FieldError(
                "cell_m",
                f"the area is {size[0]:.1f} m x {size[1]:.1f} m, less than two cells of {self.cell_m} m: "
                "enlarge it or make cell_m smaller",
            )
        if cells > MAX_SITE_CELLS:
            raise FieldError(
                "cell_m",
                f"the area of {size[0]:.0f} m x {size[1]:.0f} m has {cells:.0f} cells of {self.cell_m} m, at most "
                f"{MAX_SITE_CELLS} are taken: make cell_m larger or the area smaller",
            )
        return self

    def frame(self) -> LocalFrame:
        """Return the site's local frame; its origin is the south-western corner of the area's bounding box."""
        lons, lats = zip(*self.area.ring, strict=True)
        return LocalFrame(min(lats), min(lons))

    def local_area(self) -> FloatArray:
        """Return the area's vertices in the local frame, counter-clockwise, shape (n, 2): east, north in metres."""
        return in_frame(self.area, self.frame())


class SiteChanges(Model):
    """What may be changed of a site; what is left out stays."""

    name: ShownName | None = None
    area: PolygonGeometry | None = None
    cell_m: SiteCell | None = None
    yearly_change_m: YearlyChange | None = None


def in_frame(area: PolygonGeometry, frame: LocalFrame) -> FloatArray:
    """Return a polygon's vertices in a frame, counter-clockwise, shape (n, 2). Raises ValueError far away from it."""
    lons, lats = zip(*area.ring, strict=True)
    east, north = frame.to_local(np.array(lats), np.array(lons))
    return np.asarray(orient(Polygon(np.column_stack([east, north]))).exterior.coords)[:-1]
