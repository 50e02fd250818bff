"""The description of the feature service as OpenAPI 3.0, which its clients read for parameters and limits."""

from collections.abc import Sequence
from typing import Any

from app import __version__
from app.api.maps.ogc.collections import COLLECTIONS, Collection
from app.api.maps.ogc.crs import CRS84
from app.api.maps.ogc.parameters import MOST_LIMIT, USUAL_LIMIT

OPENAPI = "application/vnd.oai.openapi+json;version=3.0"
JSON, GEOJSON, SCHEMA, PROBLEM = (
    "application/json",
    "application/geo+json",
    "application/schema+json",
    "application/problem+json",
)

_FORMAT = {
    "name": "f",
    "in": "query",
    "description": "The format: there is only JSON",
    "schema": {"type": "string", "enum": ["json", "geojson"]},
}


def document(root: str, title: str, crs: Sequence[str]) -> dict[str, Any]:
    """Return the description of the service at ``root``, whose features can be had in the given systems."""
    paths: dict[str, Any] = {
        "/": _read("getLandingPage", "What there is", JSON),
        "/conformance": _read("getConformance", "What the service conforms to", JSON),
        "/collections": _read("getCollections", "The collections of features", JSON),
        "/api": _read("getDescription", "This description", OPENAPI),
    }
    for name, collection in COLLECTIONS.items():
        path, suffix = f"/collections/{name}", name.capitalize()
        paths[path] = _read(f"describe{suffix}", collection.title, JSON)
        paths[f"{path}/queryables"] = _read(f"getQueryables{suffix}", "What can be asked by", SCHEMA)
        paths[f"{path}/items"] = _read(
            f"get{suffix}", collection.description, GEOJSON, _of_items(collection, crs), collection
        )
        paths[f"{path}/items/{{featureId}}"] = _read(
            f"getOneOf{suffix}",
            "One feature",
            GEOJSON,
            [
                {
                    "name": "featureId",
                    "in": "path",
                    "required": True,
                    "description": "Its id",
                    "schema": {"type": "string"},
                },
                _crs("crs", "System of the coordinates", crs),
            ],
        )
    return {
        "openapi": "3.0.3",
        "info": {
            "title": title,
            "version": __version__,
            "description": "Missions of bathyfleet as features. Depths are metres, positive down.",
            "license": {"name": "Apache-2.0", "url": "https://www.apache.org/licenses/LICENSE-2.0"},
        },
        "servers": [{"url": root}],
        "paths": paths,
        "components": {
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
            "schemas": {
                "Problem": {
                    "type": "object",
                    "required": ["type", "title", "status"],
                    "properties": {
                        "type": {"type": "string"},
                        "title": {"type": "string"},
                        "status": {"type": "integer"},
                        "detail": {"type": "string"},
                        "remedy": {"type": "string"},
                    },
                }
            },
        },
        "security": [{}, {"token": []}],
    }


def _read(
    operation_id: str,
    summary: str,
    media_type: str,
    parameters: Sequence[dict[str, Any]] = (),
    collection: Collection | None = None,
) -> dict[str, Any]:
    schema: dict[str, Any] = {"type": "object"}
    if collection is not None:
        feature = {
            "type": "object",
            "properties": {"properties": {"type": "object", "properties": collection.properties}},
        }
        schema["properties"] = {"features": {"type": "array", "items": feature}}
    wrong = {"description": "It cannot be answered", "content": {PROBLEM: {"schema": _problem()}}}
    return {
        "get": {
            "operationId": operation_id,
            "summary": summary,
            "parameters": [*parameters, _FORMAT],
            "responses": {
                "200": {"description": summary, "content": {media_type: {"schema": schema}}},
                "400": wrong,
                "401": wrong,
                "404": wrong,
            },
        }
    }


def _problem() -> dict[str, Any]:
    return {"$ref": "#/components/schemas/Problem"}


def _of_items(collection: Collection, crs: Sequence[str]) -> list[dict[str, Any]]:
    return [
        {
            "name": "limit",
            "in": "query",
            "description": "Most features of a page; of more than the maximum it is the maximum",
            "schema": {"type": "integer", "minimum": 1, "maximum": MOST_LIMIT, "default": USUAL_LIMIT},
            "style": "form",
            "explode": False,
        },
        {
            "name": "bbox",
            "in": "query",
            "description": "Lower corner, upper corner, in the order of the axes of bbox-crs; heights are ignored",
            "schema": {
                "type": "array",
                "oneOf": [{"minItems": 4, "maxItems": 4}, {"minItems": 6, "maxItems": 6}],
                "items": {"type": "number"},
            },
            "style": "form",
            "explode": False,
        },
        {
            "name": "datetime",
            "in": "query",
            "description": "A time (RFC 3339), or two with a slash between; .. where there is no end",
            "schema": {"type": "string"},
            "style": "form",
            "explode": False,
        },
        {
            "name": "after",
            "in": "query",
            "description": "Only features after this one; links of pages have it",
            "schema": {"type": "string"},
        },
        _crs("crs", "System of the coordinates", crs),
        _crs("bbox-crs", "System of bbox", crs),
        *(
            {
                "name": name,
                "in": "query",
                "description": f"Only features whose {name} is this",
                "schema": collection.properties[name],
                "style": "form",
                "explode": False,
            }
            for name in collection.queryables
        ),
    ]


def _crs(name: str, description: str, crs: Sequence[str]) -> dict[str, Any]:
    return {
        "name": name,
        "in": "query",
        "description": description,
        "schema": {"type": "string", "format": "uri", "enum": list(crs), "default": CRS84},
        "style": "form",
        "explode": False,
    }
