"""Files with lines and areas as other programs write them: fastkml, gpxpy, GDAL, and formats that are plain text."""

import io
import json
import warnings
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fastkml
import gpxpy.gpx
import numpy as np
import pyogrio.raw
import pyproj
import shapely

Line = Sequence[tuple[float, float]]

UTM = "EPSG:32629"
_TO_UTM = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True)


def in_utm(line: Line) -> list[tuple[float, float]]:
    return [tuple(map(float, _TO_UTM.transform(lon, lat))) for lon, lat in line]  # type: ignore[misc]


def geojson(lines: Mapping[str, Line]) -> bytes:
    features = [
        {
            "type": "Feature",
            "properties": {"name": name},
            "geometry": {"type": "LineString", "coordinates": [list(place) for place in line]},
        }
        for name, line in lines.items()
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


def kml(lines: Mapping[str, Line], areas: Mapping[str, Line] | None = None) -> bytes:
    folder = fastkml.Folder(name="Plan")
    shapes: dict[str, Any] = {name: shapely.LineString(line) for name, line in lines.items()}
    shapes |= {name: shapely.Polygon(line) for name, line in (areas or {}).items()}
    for name, shape in shapes.items():
        mark = fastkml.Placemark(name=name, kml_geometry=fastkml.geometry.create_kml_geometry(shape))
        folder.append(mark)
    document = fastkml.KML(features=[fastkml.Document(features=[folder])])
    return document.to_string().encode()


def kmz(lines: Mapping[str, Line]) -> bytes:
    return zipped({"doc.kml": kml(lines), "files/picture.png": b"\x89PNG"})


def gpx(lines: Mapping[str, Line]) -> bytes:
    """The first line as a route, the others as tracks."""
    document = gpxpy.gpx.GPX()
    for number, (name, line) in enumerate(lines.items()):
        if number == 0:
            places = [gpxpy.gpx.GPXRoutePoint(lat, lon) for lon, lat in line]
            route = gpxpy.gpx.GPXRoute(name=name)
            route.points.extend(places)
            document.routes.append(route)
            continue
        track = gpxpy.gpx.GPXTrack(name=name)
        track.segments.append(gpxpy.gpx.GPXTrackSegment([gpxpy.gpx.GPXTrackPoint(lat, lon) for lon, lat in line]))
        document.tracks.append(track)
    return str(document.to_xml()).encode()


def dxf(lines: Mapping[str, Line], *, closed: bool = False) -> bytes:
    """Each on a layer of its name: straight ones as LINE, others as LWPOLYLINE and as POLYLINE by turns."""
    pairs: list[tuple[int, object]] = [(0, "SECTION"), (2, "ENTITIES")]
    for number, (name, line) in enumerate(lines.items()):
        places = in_utm(line)
        if len(places) == 2:
            (x, y), (u, v) = places
            pairs += [(0, "LINE"), (8, name), (10, x), (20, y), (11, u), (21, v)]
        elif number % 2 == 0:
            pairs += [(0, "LWPOLYLINE"), (8, name), (90, len(places)), (70, int(closed))]
            pairs += [pair for x, y in places for pair in ((10, x), (20, y))]
        else:
            pairs += [(0, "POLYLINE"), (8, name), (66, 1), (70, int(closed))]
            for x, y in places:
                pairs += [(0, "VERTEX"), (8, name), (10, x), (20, y)]
            pairs += [(0, "SEQEND")]
    return "".join(f"{code}\n{value}\n" for code, value in [*pairs, (0, "ENDSEC"), (0, "EOF")]).encode("cp1252")


def shapefile(lines: Mapping[str, Line], folder: Path, *, crs: str | None = UTM) -> bytes:
    """As GDAL writes it, in a folder of the archive."""
    made = folder / "shape"
    made.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # some are to be without a system
        pyogrio.raw.write(
            made / "plan.shp",
            shapely.to_wkb(np.array([shapely.LineString(in_utm(line)) for line in lines.values()])),
            [np.array(list(lines), dtype=object)],
            ["LINE_NAME"],
            geometry_type="LineString",
            crs=crs,
            driver="ESRI Shapefile",
        )
    return zipped({f"Plan 2026/{path.name}": path.read_bytes() for path in made.iterdir()})


def table(lines: Mapping[str, Line]) -> bytes:
    rows = [f"{name},{lon!r},{lat!r}" for name, line in lines.items() for lon, lat in line]
    return "\r\n".join(["Name,Lon,Lat", *rows]).encode("utf-8-sig")


def lnw(lines: Mapping[str, Line]) -> bytes:
    rows = [f"LNS {len(lines)}"]
    for name, line in lines.items():
        rows += [f"LIN {len(line)}", *(f"PTS {x:.4f} {y:.4f}" for x, y in in_utm(line)), f"LNN {name}", "EOL"]
    return "\r\n".join(rows).encode()


def zipped(files: Mapping[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return packed.getvalue()
