"""A mission's map as it leaves the service: where it lies, what its depths mean, how good it is, and its JSON."""

from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.mapping.compare import difference
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.layers import Layer, LayerSource
from app.mapping.products.pictures.overlay import overlay_corners
from app.mapping.s44 import Order, conformity
from app.mapping.swath.ensonified import Ensonified, ensonified
from app.mapping.water.vertical import VerticalDatum
from app.missions.maps.builder import BuiltMap
from app.missions.maps.live_grid import LiveCells, LiveGrid
from app.missions.spec.mission import MissionSpec
from app.missions.views.maps.map import ConformityView, DifferenceView, MapView, QualityView
from imc_bridge.printable import printable

NOT_MADE = 0
"""Version of a map that holds nothing but live cells: the first considered map is still being made."""

LARGE_CELLS = 50_000
"""Libraries hold the interpreter's lock for a tenth of a second and longer to write files of larger maps."""


@dataclass(frozen=True)
class MissionFacts:
    """What every product of a mission states."""

    mission_id: str
    spec: MissionSpec
    frame: LocalFrame
    vertical_datum: VerticalDatum

    @property
    def title(self) -> str:
        """Return the mission's name as it may stand in every file."""
        return printable(self.spec.name).strip()

    @property
    def common_sd_m(self) -> float:
        """Standard deviation of what all soundings share."""
        return self.spec.tide.sd_m


@dataclass(frozen=True)
class MapSnapshot:
    """A mission's map at one moment.

    Attributes
    ----------
    reference_m
        A reference grid's depths at its cells, if one was given.
    revision
        Grows when what the map is shown with changes: the reference grid, the datum.
    live
        What was sounded since the map was made.
    interpolation
        The papers' interpolation of every sounding so far, while the mission's soundings are in memory.
    """

    facts: MissionFacts
    built: BuiltMap
    step: int
    reference_m: FloatArray | None = None
    revision: int = 0
    live: LiveCells | None = None
    interpolation: LiveGrid | None = None

    @property
    def version(self) -> int:
        """Grows with every new map of the mission."""
        return self.built.version

    @property
    def tag(self) -> str:
        """Changes with everything that the map shows."""
        return f"{self.version}.{self.revision}" + ("" if self.live is None else f"@{self.live.version}")

    @property
    def large(self) -> bool:
        """Whether a process of its own makes files of the map."""
        return self.built.map.depth_m.size >= LARGE_CELLS

    def without_live(self) -> "MapSnapshot":
        """Return the map without what changes while soundings come."""
        return replace(self, live=None, interpolation=None)

    def source(self, order: Order = Order.ORDER_1A) -> LayerSource:
        """Return what the map's layers are computed from."""
        return LayerSource(
            self.built.map,
            order,
            self.facts.common_sd_m,
            self.facts.spec.accuracy_m,
            self.reference_m,
            lambda: None if self.interpolation is None else self.interpolation.map(),
            self.facts.spec.coverage.cell_of_depth,
            self.facts.spec.shoal_depth_m,
        )

    def ensonified(self) -> Ensonified | None:
        """Return how far the survey has come; None where the map is not one of swaths."""
        return ensonified(self.built.map, self.facts.spec.coverage.cell_of_depth)

    def header(self) -> dict[str, Any]:
        """Return which map it is, where it lies, and what its depths mean and are between."""
        bathymetry = self.built.map
        grid = bathymetry.grid
        depths = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
        return {
            "version": self.version,
            "step": self.step,
            "west_m": grid.west_m,
            "south_m": grid.south_m,
            "cell_m": grid.cell_m,
            "rows": grid.rows,
            "cols": grid.cols,
            "corners": overlay_corners(grid, self.facts.frame),
            "vertical_datum": self.facts.vertical_datum.statement,
            "min_depth_m": round(float(depths.min()), 3) if depths.size else None,
            "max_depth_m": round(float(depths.max()), 3) if depths.size else None,
            "model": bathymetry.model,
        }

    def view(self, layers: Collection[Layer] = ()) -> MapView:
        """Return the map as JSON shows it, with the values of further layers."""
        bathymetry = self.built.map
        return MapView.model_construct(
            mission_id=self.facts.mission_id,
            **self.header(),
            depth_m=nullable(bathymetry.depth_m),
            sd_m=nullable(bathymetry.sd_m),
            count=bathymetry.count.tolist(),
            sounded=bathymetry.sounded.tolist(),
            layers={layer.name: nullable(layer.values) for layer in layers},
        )


def nullable(layer: FloatArray) -> list[list[float | None]]:
    """Return a layer (rows, cols) in metres as JSON has it: to the millimetre, null where nothing is known."""
    rounded = np.round(layer, 3).astype(object)
    rounded[~np.isfinite(layer)] = None
    return rounded.tolist()  # type: ignore[no-any-return]


def quality_of(snapshot: MapSnapshot) -> QualityView:
    """Return every order's share of cells; ``difference`` is null without a reference grid that the map meets."""
    bathymetry = snapshot.built.map
    common_sd_m = snapshot.facts.common_sd_m
    found = [
        conformity(
            bathymetry.depth_m,
            bathymetry.sd_m,
            bathymetry.sounded,
            order,
            common_sd_m=common_sd_m,
            horizontal_sd_m=bathymetry.horizontal_sd_m,
        )
        for order in Order
    ]
    return QualityView(
        version=snapshot.version,
        vertical_datum=snapshot.facts.vertical_datum.statement,
        common_sd_m=common_sd_m,
        tvu=[ConformityView(**asdict(one)) for one in found],
        difference=_difference(snapshot),
    )


def _difference(snapshot: MapSnapshot) -> DifferenceView | None:
    if snapshot.reference_m is None:
        return None
    try:
        found = difference(snapshot.built.map.depth_m, snapshot.reference_m)
    except ValueError:
        return None
    return DifferenceView(**asdict(found))
