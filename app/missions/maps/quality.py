"""How good a mission's map is: its TVU estimate beside IHO S-44, and its difference to a reference grid."""

from dataclasses import asdict

from app.mapping.compare import difference
from app.mapping.s44 import Order, conformity
from app.missions.maps.snapshot import MapSnapshot
from app.missions.views.map import ConformityView, DifferenceView, QualityView


def quality_of(snapshot: MapSnapshot) -> QualityView:
    """Return every order's share of cells; ``difference`` is null without a reference grid that the map meets."""
    bathymetry = snapshot.built.map
    common_sd_m = snapshot.facts.common_sd_m
    found = [
        conformity(bathymetry.depth_m, bathymetry.sd_m, bathymetry.sounded, order, common_sd_m=common_sd_m)
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
