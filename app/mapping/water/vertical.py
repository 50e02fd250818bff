"""What depths are counted from, as a coordinate reference system and in words."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import pyproj
from pyproj.crs import CompoundCRS
from pyproj.exceptions import CRSError

INSTANTANEOUS_WATER_LEVEL = 5831
LOWEST_ASTRONOMICAL_TIDE = 5861

S100_DATUMS = (
    {5865: 1, 5864: 2, 5867: 5, 5863: 8, 5866: 12, 5873: 13, 5862: 27, 10678: 44}
    | dict.fromkeys((5715, 9288, 10150, 10547, 10549, 10551, 10649), 3)
    | dict.fromkeys((LOWEST_ASTRONOMICAL_TIDE, 9287, 10548, 10550, 10552, 10650), 23)
)
"""Numbers of vertical datums in the IHO's register for S-100, by the EPSG code of depths below them."""


EPSG_OF_S100 = {number: epsg for epsg, number in S100_DATUMS.items() if number not in (3, 23)} | {
    3: 5715,
    23: LOWEST_ASTRONOMICAL_TIDE,
}
"""The other way round; where several realizations have one number, the code of what they all realize."""


@dataclass(frozen=True)
class VerticalDatum:
    """A depth datum: its EPSG code, and a sentence that also says how depths were brought to it."""

    epsg: int
    statement: str

    @property
    def crs(self) -> pyproj.CRS:
        """The vertical coordinate reference system, depth positive down."""
        return pyproj.CRS.from_epsg(self.epsg)

    @property
    def heights(self) -> pyproj.CRS:
        """The vertical coordinate reference system of heights above the same datum, positive up."""
        made = self.crs.to_json_dict()
        made["name"] = made["name"].strip().removesuffix("depth") + "height"
        if self.crs.datum is not None:  # what is none is an ensemble of several realizations
            made["datum"] = self.crs.datum.to_json_dict()
        (axis,) = made["coordinate_system"]["axis"]
        axis |= {"name": "Gravity-related height", "abbreviation": "H", "direction": "up"}
        for of_depths in ("id", "scope", "area", "bbox", "usages"):
            made.pop(of_depths, None)
        found = pyproj.CRS.from_json_dict(made)
        registered = found.to_epsg()
        return found if registered is None else pyproj.CRS.from_epsg(registered)

    @property
    def s100(self) -> int | None:
        """Its number in the IHO's register for S-100; None where that has none for it."""
        return S100_DATUMS.get(self.epsg)

    def compound_with(self, horizontal: pyproj.CRS) -> pyproj.CRS:
        """Return the horizontal system with this datum as its third axis."""
        return CompoundCRS(f"{horizontal.name} + {self.crs.name}", [horizontal, self.crs])


def vertical_part(crs: pyproj.CRS | None) -> pyproj.CRS | None:
    """Return the vertical system in a coordinate reference system, of one in space that one itself.

    None where it states none, an unknown one, or the water level of the moment, which is no datum. PROJ takes a
    vertical unit alone for heights above the ellipsoid, in a system that it has no name for: that states no datum.
    """
    parts = [] if crs is None else list(_parts(crs))
    found = next((part for part in parts if part.is_vertical), None)
    if found is None:
        in_space = len(parts) == 1 and len(parts[0].axis_info) == 3 and parts[0].name.lower() != "unknown"
        return parts[0] if in_space else None
    name = _datum_name(found)
    none = name in _NO_DATUM_NAMES or name.startswith(_NO_DATUM)
    return None if none or name == _datum_name(_INSTANTANEOUS) else found


def vertical_unit(crs: pyproj.CRS | None) -> tuple[float, str]:
    """Return how many metres the unit of the vertical axis has, and its name; metres where there is no such axis."""
    for part in [] if crs is None else _parts(crs):
        if part.is_vertical or len(part.axis_info) == 3:
            axis = part.axis_info[-1]
            return float(axis.unit_conversion_factor), str(axis.unit_name)
    return 1.0, "metre"


def _parts(crs: pyproj.CRS) -> Iterator[pyproj.CRS]:
    """Yield the single systems that one is made of, without what leads from them to others."""
    if crs.is_bound and crs.source_crs is not None:
        yield from _parts(crs.source_crs)
    elif crs.sub_crs_list:
        for part in crs.sub_crs_list:
            yield from _parts(part)
    else:
        yield crs


def same_datum(one: pyproj.CRS, other: pyproj.CRS) -> bool:
    """Return whether two vertical systems count from the same, be it upwards or downwards.

    Realizations of what S-100 has one number for, as mean sea level, are the same.
    """
    one_name, other_name = _datum_name(one), _datum_name(other)
    number = _s100_by_name().get(one_name)
    return one_name == other_name or (number is not None and number == _s100_by_name().get(other_name))


def datum_words(crs: pyproj.CRS) -> str:
    """Return what a vertical system is called in EPSG's register, for an operator; nothing of a file is quoted."""
    epsg = crs.to_epsg()
    if epsg is not None:
        name = str(pyproj.CRS.from_epsg(epsg).name)
        return f"EPSG:{epsg} {name}" + (", above the ellipsoid" if len(crs.axis_info) == 3 else "")
    for known in S100_DATUMS:
        depths = pyproj.CRS.from_epsg(known)
        if _datum_name(depths) == _datum_name(crs):
            return str(VerticalDatum(known, "").heights.name)
    return "the ellipsoid" if len(crs.axis_info) == 3 else "a vertical datum that EPSG does not list"


@cache
def _s100_by_name() -> dict[str, int]:
    """Return S-100's numbers by the names of datums."""
    return {_datum_name(pyproj.CRS.from_epsg(epsg)): number for epsg, number in S100_DATUMS.items()}


def _datum_name(crs: pyproj.CRS) -> str:
    described = crs.to_json_dict()
    name = (described.get("datum") or described.get("datum_ensemble") or {}).get("name", "unknown")
    name = name.removeprefix("D_")  # as Esri begins them
    plain, short = _letters(name), re.fullmatch(r"(.*)\((.*)\)\s*", name)
    if short is not None and _ALIASES.get(_letters(short[2])) == _letters(short[1]):
        plain = _letters(short[1])
    return _ALIASES.get(plain, plain)


def _letters(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


_ALIASES = {
    "msl": "meansealevel",
    "lat": "lowestastronomicaltide",
    "mllw": "meanlowerlowwater",
    "mlw": "meanlowwater",
    "mlws": "meanlowwaterspringtides",
    "meanlowwatersprings": "meanlowwaterspringtides",
    "mllws": "meanlowerlowwaterspringtides",
    "meanlowerlowwatersprings": "meanlowerlowwaterspringtides",
    "islw": "indianspringlowwater",
    "llwlt": "lowerlowwaterlargetide",
    "bscd2000": "balticseachartdatum2000",
}
"""Names that programs give to datums for those of EPSG's register, as letters and digits."""

_INSTANTANEOUS = pyproj.CRS.from_epsg(INSTANTANEOUS_WATER_LEVEL)
_NO_DATUM = ("unknown", "unnamed", "undefined", "notspecified", "unspecified")
_NO_DATUM_NAMES = frozenset(
    {"", "none", "null", "na", "local", "localdatum", "chartdatum", "localchartdatum", "userdefined"}
)
"""A chart's datum is that of no place in particular."""


def check_depth_datum(epsg: int) -> str:
    """Return the name of a depth datum.

    Raises
    ------
    ValueError
        When the code names no vertical system, or one whose axis points up.
    """
    try:
        crs = pyproj.CRS.from_epsg(epsg)
    except CRSError:
        raise ValueError(f"there is no EPSG:{epsg}; EPSG:5861 is LAT depth, EPSG:5715 MSL depth") from None
    if not crs.is_vertical or crs.axis_info[0].direction != "down" or crs.axis_info[0].unit_name != "metre":
        raise ValueError(
            f"EPSG:{epsg} ({crs.name}) is not a depth in metres, positive down; use for example 5861 (LAT depth), "
            "5715 (MSL depth) or 5866 (MLLW depth) and state the offset to it in datum_offset_m"
        )
    return str(crs.name)
