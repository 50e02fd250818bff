"""Depth contours as DXF of AutoCAD R12, which every program for drawing reads."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.mapping.products.contours import Contour

RELEASE_12 = "AC1009"
INDEX_EVERY = 5
"""Of so many contours one is an index contour, which is drawn stronger."""

ORDINARY, INDEX = "CONTOURS", "CONTOURS_INDEX"
LAYERS = {ORDINARY: 4, INDEX: 5}
"""Layers with the number of their colour: cyan and blue."""

CLOSED = 1

Group = tuple[int, object]
"""A code and its value, each on a line of its own."""


def contours_dxf(
    contours: Sequence[Contour], interval_m: float, *, title: str, positions: str, vertical_datum: str
) -> bytes:
    """Return one polyline per line of contours in metres, at its elevation: minus the depth.

    The format knows no reference systems: comments at its begin say what ``positions`` and depths are in.
    """
    told = (title, f"positions: {positions}", f"elevations: minus the depth below {vertical_datum}")
    groups = [
        *((999, " ".join(text.split())) for text in told),
        *_section("HEADER", _header(contours)),
        *_section("TABLES", _tables()),
        *_section("ENTITIES", _entities(contours, interval_m)),
        (0, "EOF"),
    ]
    return "".join(f"{code:3}\n{value}\n" for code, value in groups).encode("ascii", "replace")


def _section(name: str, groups: Iterator[Group]) -> Iterator[Group]:
    yield from ((0, "SECTION"), (2, name))
    yield from groups
    yield (0, "ENDSEC")


def _header(contours: Sequence[Contour]) -> Iterator[Group]:
    yield from ((9, "$ACADVER"), (1, RELEASE_12))
    points = [point for contour in contours for line in contour.lines for point in line]
    if points:
        for name, corner, depth_m in (
            ("$EXTMIN", np.min(points, axis=0), contours[-1].depth_m),
            ("$EXTMAX", np.max(points, axis=0), contours[0].depth_m),
        ):
            yield (9, name)
            yield from _place(float(corner[0]), float(corner[1]), depth_m)


def _tables() -> Iterator[Group]:
    yield from ((0, "TABLE"), (2, "LTYPE"), (70, 1))
    yield from ((0, "LTYPE"), (2, "CONTINUOUS"), (70, 0), (3, "Solid line"), (72, 65), (73, 0), (40, "0.0"))
    yield from ((0, "ENDTAB"), (0, "TABLE"), (2, "LAYER"), (70, len(LAYERS)))
    for name, colour in LAYERS.items():
        yield from ((0, "LAYER"), (2, name), (70, 0), (62, colour), (6, "CONTINUOUS"))
    yield (0, "ENDTAB")


def _entities(contours: Sequence[Contour], interval_m: float) -> Iterator[Group]:
    for contour in contours:
        layer = INDEX if round(contour.depth_m / interval_m) % INDEX_EVERY == 0 else ORDINARY
        for line in contour.lines:
            closed = len(line) > 3 and line[0] == line[-1]
            yield from ((0, "POLYLINE"), (8, layer), (66, 1))
            yield from _place(0.0, 0.0, contour.depth_m)
            yield (70, CLOSED if closed else 0)
            for east_m, north_m in line[:-1] if closed else line:
                yield from ((0, "VERTEX"), (8, layer))
                yield from _place(east_m, north_m, contour.depth_m)
            yield from ((0, "SEQEND"), (8, layer))


def _place(east_m: float, north_m: float, depth_m: float) -> Iterator[Group]:
    for code, value in ((10, east_m), (20, north_m), (30, -depth_m)):
        yield (code, f"{value + 0.0:.3f}")
