"""Small ENC cells, written by GDAL's S-57 writer, which pyogrio's library has; pyogrio itself writes one layer only."""

import ctypes
from collections.abc import Sequence
from pathlib import Path

import pyogrio

Place = tuple[float, float]

ISOLATED, CONNECTED, EDGE = 110, 120, 130
POINT, LINE, AREA = 1, 2, 3
_PRIMITIVES = {ISOLATED: b"IsolatedNode", CONNECTED: b"ConnectedNode", EDGE: b"Edge"}


class Cell:
    """A cell that is being made; ``write`` returns what is in its file."""

    def __init__(self) -> None:
        here = Path(pyogrio.__file__).parent
        [library] = (here.parent / "pyogrio.libs").glob("libgdal*")
        self._lib = ctypes.CDLL(str(library))
        text, number, real, thing = ctypes.c_char_p, ctypes.c_int, ctypes.c_double, ctypes.c_void_p
        for name, result, *arguments in (
            ("GDALAllRegister", None),
            ("CPLSetConfigOption", None, text, text),
            ("GDALGetDriverByName", thing, text),
            ("GDALCreate", thing, thing, text, number, number, number, number, thing),
            ("GDALDatasetGetLayerByName", thing, thing, text),
            ("GDALClose", number, thing),
            ("OGR_L_GetLayerDefn", thing, thing),
            ("OGR_L_CreateFeature", number, thing, thing),
            ("OGR_F_Create", thing, thing),
            ("OGR_F_Destroy", None, thing),
            ("OGR_F_GetFieldIndex", number, thing, text),
            ("OGR_F_SetFieldInteger", None, thing, number, number),
            ("OGR_F_SetFieldDouble", None, thing, number, real),
            ("OGR_F_SetFieldString", None, thing, number, text),
            ("OGR_F_SetFieldIntegerList", None, thing, number, number, thing),
            ("OGR_F_SetGeometryDirectly", number, thing, thing),
            ("OGR_G_CreateGeometry", thing, number),
            ("OGR_G_AddPoint", None, thing, real, real, real),
            ("OGR_G_AddPoint_2D", None, thing, real, real),
            ("OGR_G_AddGeometryDirectly", number, thing, thing),
        ):
            call = getattr(self._lib, name)
            call.restype, call.argtypes = result, arguments
        self._lib.CPLSetConfigOption(b"GDAL_DATA", str(here / "gdal_data").encode())
        self._lib.GDALAllRegister()
        self._last = {ISOLATED: 0, CONNECTED: 0, EDGE: 0, 0: 0}
        self._made: list[tuple[str, dict[str, object]]] = []
        self._primitives: list[tuple[int, int, list[tuple[float, ...]], list[int]]] = []

    def point(self, kind: str, place: Place, **attributes: object) -> None:
        """Add an object at a place, longitude and latitude."""
        self._object(kind, POINT, [(ISOLATED, self._node(ISOLATED, [place]))], attributes)

    def soundings(self, places: list[tuple[float, float, float]], **attributes: object) -> None:
        """Add soundings: longitude, latitude, depth."""
        self._object("SOUNDG", POINT, [(ISOLATED, self._node(ISOLATED, places))], attributes)

    def line(self, kind: str, places: list[Place], **attributes: object) -> None:
        """Add a line."""
        self._object(kind, LINE, [(EDGE, self._edge(places))], attributes)

    def area(self, kind: str, ring: list[Place], **attributes: object) -> None:
        """Add an area; the ring's first place is not repeated."""
        self._object(kind, AREA, [(EDGE, self._edge([*ring, ring[0]]))], attributes)

    def write(self, file: Path) -> bytes:
        """Write the cell and return it."""
        lib = self._lib
        data = lib.GDALCreate(lib.GDALGetDriverByName(b"S57"), str(file).encode(), 0, 0, 0, 0, None)
        for kind, number, places, ends in self._primitives:
            fields: dict[str, object] = {"RCNM": kind, "RCID": number, "RVER": 1, "RUIN": 1}
            for i, end in enumerate(ends):
                fields |= {f"NAME_RCNM_{i}": CONNECTED, f"NAME_RCID_{i}": end, f"ORNT_{i}": 255, f"USAG_{i}": 255}
                fields |= {f"TOPI_{i}": i + 1, f"MASK_{i}": 255}
            self._feature(data, _PRIMITIVES[kind], fields, self._geometry(kind, places))
        for name, attributes in self._made:
            self._feature(data, name.encode(), attributes, None)
        lib.GDALClose(data)
        return file.read_bytes()

    def _node(self, kind: int, places: Sequence[tuple[float, ...]]) -> int:
        self._last[kind] += 1
        self._primitives.append((kind, self._last[kind], [tuple(place) for place in places], []))
        return self._last[kind]

    def _edge(self, places: list[Place]) -> int:
        first = self._node(CONNECTED, [places[0]])
        last = first if places[0] == places[-1] else self._node(CONNECTED, [places[-1]])
        self._last[EDGE] += 1
        inner: list[tuple[float, ...]] = list(places[1:-1])
        self._primitives.append((EDGE, self._last[EDGE], inner, [first, last]))
        return self._last[EDGE]

    def _object(self, kind: str, shape: int, of: list[tuple[int, int]], attributes: dict[str, object]) -> None:
        self._last[0] += 1
        number = self._last[0]
        fields: dict[str, object] = {"RCID": number, "PRIM": shape, "GRUP": 2, "RVER": 1, "AGEN": 1, "FIDN": number}
        fields |= {"FIDS": 1, "NAME_RCNM": [node for node, _ in of], "NAME_RCID": [one for _, one in of]}
        fields |= {"ORNT": [1 if shape == AREA else 255], "USAG": [1 if shape == AREA else 255], "MASK": [255]}
        self._made.append((kind, fields | attributes))

    def _geometry(self, kind: int, places: list[tuple[float, ...]]) -> int:
        lib = self._lib
        if kind == EDGE:
            line = lib.OGR_G_CreateGeometry(2)
            for place in places:
                lib.OGR_G_AddPoint_2D(line, place[0], place[1])
            return int(line)
        if len(places[0]) == 2:
            point = lib.OGR_G_CreateGeometry(1)
            lib.OGR_G_AddPoint_2D(point, *places[0])
            return int(point)
        many = lib.OGR_G_CreateGeometry(-2147483644)  # wkbMultiPoint25D
        for place in places:
            point = lib.OGR_G_CreateGeometry(-2147483647)  # wkbPoint25D
            lib.OGR_G_AddPoint(point, *place)
            lib.OGR_G_AddGeometryDirectly(many, point)
        return int(many)

    def _feature(self, data: int, layer_name: bytes, fields: dict[str, object], geometry: int | None) -> None:
        lib = self._lib
        layer = lib.GDALDatasetGetLayerByName(data, layer_name)
        feature = lib.OGR_F_Create(lib.OGR_L_GetLayerDefn(layer))
        for name, value in fields.items():
            index = lib.OGR_F_GetFieldIndex(feature, name.encode())
            assert index >= 0, (layer_name, name)
            if isinstance(value, list):
                lib.OGR_F_SetFieldIntegerList(feature, index, len(value), (ctypes.c_int * len(value))(*value))
            elif isinstance(value, int):
                lib.OGR_F_SetFieldInteger(feature, index, value)
            elif isinstance(value, float):
                lib.OGR_F_SetFieldDouble(feature, index, value)
            else:
                lib.OGR_F_SetFieldString(feature, index, str(value).encode())
        if geometry is not None:
            lib.OGR_F_SetGeometryDirectly(feature, geometry)
        assert lib.OGR_L_CreateFeature(layer, feature) == 0, layer_name
        lib.OGR_F_Destroy(feature)
