"""Soundings as crowdsourced bathymetry: the GeoJSON of IHO B-12, edition 3.1, as the DCDB takes it."""

import json
import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime

from app.mapping.products.tracks import utc_text

CONVENTION = "GeoJSON CSB 3.1"


@dataclass(frozen=True)
class Provider:
    """Who hands the soundings in ("trusted node")."""

    organization: str
    email: str
    node: str
    license: str


@dataclass(frozen=True, slots=True)
class RawSounding:
    """A sounding as it was taken: WGS 84 degrees, depth below the water level of that moment, no tide applied.

    ``sd_m`` and ``position_sd_m`` are standard deviations of the depth and of each horizontal coordinate.
    """

    lon_deg: float
    lat_deg: float
    depth_m: float
    sd_m: float
    time_s: float
    position_sd_m: float | None


def vessel_id(provider: Provider, vehicle: str) -> str:
    """Return the same identity for the same provider's vehicle, always."""
    return f"{provider.node}-{uuid.uuid5(uuid.NAMESPACE_URL, f'bathyfleet:{provider.organization}:{vehicle}')}"


@dataclass(frozen=True)
class CrowdsourcedFile:
    """A file of one vehicle's raw soundings, part by part; the format knows one vessel per file.

    Attributes
    ----------
    version
        Of the program that logged them.
    uncertain
        Whether any sounding states its position's deviation.
    """

    vehicle: str
    provider: Provider
    version: str
    created: datetime
    uncertain: bool

    def begin(self) -> bytes:
        """Return everything before the first sounding."""
        provider, identity = self.provider, vessel_id(self.provider, self.vehicle)
        document = {
            "type": "FeatureCollection",
            "crs": {"type": "name", "properties": {"name": "EPSG:4326"}},
            "properties": {
                "trustedNode": {
                    "providerOrganizationName": provider.organization,
                    "providerEmail": provider.email,
                    "uniqueVesselID": identity,
                    "convention": CONVENTION,
                    "dataLicense": provider.license,
                    "providerLogger": "bathyfleet",
                    "providerLoggerVersion": self.version,
                    "navigationCRS": "EPSG:4326",
                    "verticalReferenceOfDepth": "Waterline",
                    "vesselPositionReferencePoint": "Transducer",
                },
                "platform": {
                    "uniqueID": identity,
                    "type": "Autonomous underwater vehicle",
                    "name": self.vehicle,
                    "soundSpeedDocumented": False,
                    "positionOffsetsDocumented": False,
                    # The format counts the estimate of an uncertainty as processing; depths are raw either way.
                    "dataProcessed": self.uncertain,
                    "contributorComments": "Depths are the vehicle's depth plus the vertical part of the sonar's "
                    "range, without tide; positions are those of the footprints, from the vehicle's navigation under "
                    "water.",
                },
                **({"processing": [_uncertainty_step(self.version, self.created)]} if self.uncertain else {}),
            },
            "features": [],
        }
        return json.dumps(document).removesuffix("]}").encode()

    def part(self, soundings: Iterable[RawSounding], *, first: bool) -> bytes:
        """Return soundings as features; ``first``: no other ones are before them."""
        features = ", ".join(json.dumps(_feature(sounding)) for sounding in soundings)
        return (features if first or not features else f", {features}").encode()

    def end(self) -> bytes:
        """Return everything after the last sounding."""
        return b"]}"


def _feature(sounding: RawSounding) -> dict[str, object]:
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [round(sounding.lon_deg, 8), round(sounding.lat_deg, 8)]},
        "properties": {
            "depth": round(sounding.depth_m, 3),
            "time": utc_text(sounding.time_s),
            **_uncertainty(sounding),
        },
    }


def _uncertainty_step(version: str, created: datetime) -> dict[str, object]:
    return {
        "type": "Uncertainty",
        "timestamp": f"{created:%Y-%m-%dT%H:%M:%SZ}",
        "name": "stated by the sensor, or a fraction of the range",
        "parameters": {},
        "version": version,
        "comment": "Standard deviations of east, north and depth, metres, where the navigation states one",
        "reference": "bathyfleet",
    }


def _uncertainty(sounding: RawSounding) -> dict[str, list[float]]:
    """Return the uncertainty of position and depth; the format has no place for one without the other."""
    if sounding.position_sd_m is None:
        return {}
    across = round(sounding.position_sd_m, 3)
    return {"uncertainty": [across, across, round(sounding.sd_m, 3)]}
