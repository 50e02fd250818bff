"""Pictures that lie over each other as one, and what is known of a place in words."""

import hashlib
import html
from collections.abc import Sequence

import orjson
from starlette.responses import Response

from app.api.maps.wms.parameters import HTML, PNG, TEXT, MapRequest
from app.api.maps.wms.sources import FeatureInfo
from app.missions.operations.maps.map_pictures import MapPicture, MapPictures
from imc_bridge.printable import printable

_HEADERS = {"Cache-Control": "private, no-cache"}
"""Programs ask each time whether what they have is still right, which costs little: see ``ETag``."""


async def map_answer(
    made: MapPictures, wanted: MapRequest, found: Sequence[MapPicture], if_none_match: str | None
) -> Response:
    """Return one picture of all."""
    alone = len(found) == 1 and wanted.background is None
    tag = f'"{found[0].tag if alone else _digest(wanted, found)}"'
    headers = {**_HEADERS, "ETag": tag}
    if if_none_match is not None and (tag in if_none_match or if_none_match.strip() == "*"):
        return Response(status_code=304, headers=headers)
    contents = [picture.content for picture in found]
    content = contents[0] if alone else await made.together(contents, wanted.window, wanted.background)
    return Response(content, media_type=PNG, headers=headers)


def _digest(wanted: MapRequest, found: Sequence[MapPicture]) -> str:
    shown = f"{wanted.background} {wanted.window} " + " ".join(picture.tag for picture in found)
    return hashlib.blake2b(shown.encode(), digest_size=12).hexdigest()


def info_answer(media_type: str, found: Sequence[FeatureInfo], lat_deg: float, lon_deg: float) -> Response:
    """Return what is known of a place."""
    if media_type == TEXT:
        content = "\n\n".join(_text(one) for one in found) or "nothing is known here"
    elif media_type == HTML:
        content = _page(found)
    else:
        content = orjson.dumps(_collection(found, lat_deg, lon_deg)).decode()
    return Response(content, media_type=media_type, headers=_HEADERS)


def _rows(one: FeatureInfo) -> list[tuple[str, str]]:
    values = one.values
    soundings = str(values.soundings) if values.soundings else "0 (estimated from those around)"
    return [
        ("Depth", f"{values.depth_m:.2f} m"),
        ("Standard deviation", f"{values.sd_m:.2f} m"),
        ("Soundings in the cell", soundings),
        ("Vertical datum", values.vertical_datum),
    ]


def _text(one: FeatureInfo) -> str:
    return "\n".join([printable(one.name), *(f"{name}: {value}" for name, value in _rows(one))])


def _page(found: Sequence[FeatureInfo]) -> str:
    tables = []
    for one in found:
        rows = "".join(f"<tr><th>{name}</th><td>{html.escape(value)}</td></tr>" for name, value in _rows(one))
        tables.append(f"<table><caption>{html.escape(printable(one.name))}</caption>{rows}</table>")
    head = '<head><meta charset="utf-8"><title>bathyfleet</title></head>'
    return f"<!DOCTYPE html><html>{head}<body>{''.join(tables) or '<p>nothing is known here</p>'}</body></html>"


def _collection(found: Sequence[FeatureInfo], lat_deg: float, lon_deg: float) -> dict[str, object]:
    features = [
        {
            "type": "Feature",
            "id": one.mission_id,
            "geometry": {"type": "Point", "coordinates": [round(lon_deg, 8), round(lat_deg, 8)]},
            "properties": {
                "mission": one.mission_id,
                "name": one.name,
                "depth_m": round(one.values.depth_m, 3),
                "sd_m": round(one.values.sd_m, 3),
                "soundings": one.values.soundings,
                "vertical_datum": one.values.vertical_datum,
            },
        }
        for one in found
    ]
    return {"type": "FeatureCollection", "features": features}
