"""OGC API – Features, of all missions at ``/ogc`` and of one at ``/ogc/missions/{id}``.

What is there is described by a document of its own, OpenAPI 3.0, as clients of the standard expect it.
"""

import asyncio
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Annotated, Any
from urllib.parse import quote, urlencode

import orjson
from fastapi import APIRouter, Depends
from starlette.requests import Request
from starlette.responses import Response

from app.api.access.auth import Reader
from app.api.http.problems import ProblemError
from app.api.maps.ogc.collections import COLLECTIONS, Collection
from app.api.maps.ogc.crs import CRS84, transformed
from app.api.maps.ogc.dataset import Dataset, dataset_of
from app.api.maps.ogc.document import GEOJSON, JSON, OPENAPI, SCHEMA, document
from app.api.maps.ogc.parameters import check_names, crs_of, items_query
from app.api.maps.ogc.sources import enlarged, extent, extent_of_ways, feature, page
from app.api.state import State
from app.missions.operations.maps.features import Feature, Kind, period_of
from app.missions.traffic.ship_list import NEAR_M

OGC = "/ogc"

CONFORMS_TO = [
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/oas30",
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/geojson",
    "http://www.opengis.net/spec/ogcapi-features-2/1.0/conf/crs",
    "http://www.opengis.net/spec/ogcapi-features-3/1.0/conf/queryables",
    "http://www.opengis.net/spec/ogcapi-features-3/1.0/conf/queryables-query-parameters",
]
QUERYABLES = "http://www.opengis.net/def/rel/ogc/1.0/queryables"


async def _dataset(request: Request, reader: Reader, state: State) -> Dataset:
    """Return what is asked for; nobody is told who may not even look. Raises MissionNotFoundError."""
    return await dataset_of(request, state, OGC)


Data = Annotated[Dataset, Depends(_dataset)]
router = APIRouter(prefix=OGC, include_in_schema=False)


def _route(path: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Let something be had of all missions and of one."""

    def add(endpoint: Callable[..., Any]) -> Callable[..., Any]:
        for prefix in ("", "/missions/{mission_id}"):
            router.add_api_route(prefix + path, endpoint, methods=["GET", "HEAD"])
        return endpoint

    return add


@_route("/")
@_route("")
async def get_landing_page(request: Request, data: Data) -> Response:
    """Return where everything is."""
    check_names(request.query_params)
    return _answer(
        {
            "title": f"bathyfleet: {data.title}",
            "description": "Areas, tracks, soundings, contours, holidays, vehicles and ships, as they are now",
            "links": [
                _link("self", data.root, JSON, "This page"),
                _link("service-desc", f"{data.root}/api", OPENAPI, "Description (OpenAPI 3.0)"),
                _link("conformance", f"{data.root}/conformance", JSON, "What this service conforms to"),
                _link("data", f"{data.root}/collections", JSON, "The collections of features"),
            ],
        }
    )


@_route("/conformance")
async def get_conformance(request: Request, data: Data) -> Response:
    """Return what this service conforms to."""
    check_names(request.query_params)
    return _answer({"conformsTo": CONFORMS_TO})


@_route("/api")
async def get_description(request: Request, data: Data) -> Response:
    """Return the description of this service."""
    check_names(request.query_params)
    return _answer(document(data.root, f"bathyfleet: {data.title}", data.crs), OPENAPI)


@_route("/collections")
async def get_collections(request: Request, data: Data) -> Response:
    """Return the collections."""
    check_names(request.query_params)
    return _answer(
        {
            "links": [_link("self", f"{data.root}/collections", JSON, "This list")],
            "crs": data.crs,
            "collections": [_described(data, collection) for collection in COLLECTIONS.values()],
        }
    )


@_route("/collections/{collection_id}")
async def get_collection(request: Request, data: Data, collection_id: str) -> Response:
    """Return what is known of a collection."""
    check_names(request.query_params)
    return _answer(_described(data, _collection(collection_id), crs=data.crs))


@_route("/collections/{collection_id}/queryables")
async def get_queryables(request: Request, data: Data, collection_id: str) -> Response:
    """Return the properties that features of a collection can be asked by."""
    check_names(request.query_params)
    collection = _collection(collection_id)
    return _answer(
        {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "$id": f"{data.root}/collections/{collection_id}/queryables",
            "type": "object",
            "title": collection.title,
            "properties": {name: collection.properties[name] for name in collection.queryables},
            "additionalProperties": False,
        },
        SCHEMA,
    )


@_route("/collections/{collection_id}/items")
async def get_items(request: Request, data: Data, state: State, collection_id: str) -> Response:
    """Return a page of features."""
    collection = _collection(collection_id)
    query = items_query(request.query_params, collection.queryables, data.crs)
    found = await page(request, state, collection.kind, data.rows, query)
    address = f"{data.root}/collections/{collection_id}"
    links = [
        _link("self", _with_query(f"{address}/items", dict(request.query_params)), GEOJSON, "This page"),
        _link("collection", address, JSON, collection.title),
    ]
    if found.after:
        following = dict(request.query_params) | {"after": found.after}
        links.append(_link("next", _with_query(f"{address}/items", following), GEOJSON, "The next page"))

    def content() -> bytes:
        body = {
            "type": "FeatureCollection",
            "links": links,
            "timeStamp": datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "numberReturned": len(found.features),
            "features": [_written(one, query.crs) for one in found.features],
        }
        return orjson.dumps(body if found.matched is None else body | {"numberMatched": found.matched})

    headers = {"Content-Crs": f"<{query.crs}>", "Cache-Control": "no-cache"}
    return Response(await asyncio.to_thread(content), media_type=GEOJSON, headers=headers)


@_route("/collections/{collection_id}/items/{feature_id}")
async def get_feature(request: Request, data: Data, state: State, collection_id: str, feature_id: str) -> Response:
    """Return one feature."""
    collection = _collection(collection_id)
    check_names(request.query_params, ("crs",))
    crs = crs_of(request.query_params, "crs", data.crs)
    found = await feature(request, state, collection.kind, data.rows, feature_id)
    if found is None:
        raise ProblemError(
            "feature-not-found",
            f"the collection {collection_id} has no feature {feature_id[:100]!r}",
            remedy=f"GET {data.root}/collections/{collection_id}/items lists them",
        )
    address = f"{data.root}/collections/{collection_id}"
    links = [
        _link("self", f"{address}/items/{quote(feature_id, safe='')}", GEOJSON, "This feature"),
        _link("collection", address, JSON, collection.title),
    ]
    headers = {"Content-Crs": f"<{crs}>", "Cache-Control": "no-cache"}
    return Response(orjson.dumps(_written(found, crs) | {"links": links}), media_type=GEOJSON, headers=headers)


def _collection(collection_id: str) -> Collection:
    if collection_id not in COLLECTIONS:
        raise ProblemError(
            "not-found",
            f"there is no collection {collection_id[:40]!r}",
            remedy=f"Use one of {', '.join(COLLECTIONS)}",
        )
    return COLLECTIONS[collection_id]


def _described(data: Dataset, collection: Collection, crs: Sequence[str] = ("#/crs",)) -> dict[str, Any]:
    address = f"{data.root}/collections/{collection.kind}"
    described: dict[str, Any] = {
        "id": collection.kind.value,
        "title": collection.title,
        "description": collection.description,
        "itemType": "feature",
        "crs": list(crs),
        "storageCrs": CRS84,
        "links": [
            _link("self", address, JSON, "This collection"),
            _link("items", f"{address}/items", GEOJSON, collection.title),
            _link(QUERYABLES, f"{address}/queryables", SCHEMA, "What can be asked by"),
        ],
    }
    if data.rows:
        of_maps = collection.kind in (Kind.AREAS, Kind.CONTOURS, Kind.HOLIDAYS)
        ends = extent(data.rows) if of_maps else extent_of_ways(data.rows)
        if collection.kind is Kind.TRAFFIC:
            ends = enlarged(ends, NEAR_M)
        described["extent"] = {"spatial": {"bbox": [ends], "crs": CRS84}}
        if of_maps:
            periods = [period_of(row) for row in data.rows]
            last_s = [until_s for _, until_s in periods]
            ended_s = None if None in last_s else max(until_s for until_s in last_s if until_s is not None)
            interval = [_time(min(begin_s for begin_s, _ in periods)), None if ended_s is None else _time(ended_s)]
            described["extent"]["temporal"] = {"interval": [interval]}
    return described


def _time(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def _written(one: Feature, crs: str) -> dict[str, Any]:
    geometry = transformed(one.geometry, crs)
    return {"type": "Feature", "id": one.id, "geometry": geometry, "properties": one.properties}


def _with_query(address: str, query: dict[str, str]) -> str:
    return address + (f"?{urlencode(query)}" if query else "")


def _link(rel: str, href: str, media_type: str, title: str) -> dict[str, str]:
    return {"rel": rel, "href": href, "type": media_type, "title": title}


def _answer(body: dict[str, Any], media_type: str = JSON) -> Response:
    return Response(orjson.dumps(body), media_type=media_type, headers={"Cache-Control": "no-cache"})
