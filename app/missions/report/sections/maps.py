"""What was found: the map, and how densely it was sounded."""

from typing import Any

import numpy as np

from app.mapping.layers import LAYERS, Fit, Layer, LayerKind
from app.mapping.products.contours import usual_interval_m
from app.mapping.products.pictures.colours import depth_range
from app.mapping.products.pictures.hillshade import exaggeration, hillshade
from app.mapping.products.pictures.sheet import Sheet, sheet_png
from app.missions.report.document import PNG, Block, Facts, Figure, Paragraph, Table, Text
from app.missions.report.writer import Writer

MOST_HOLIDAYS = 100
"""Rows that the table has place for."""
LEAST_COUNTED = 5.0
"""Colours of numbers of soundings reach at least so far."""


def depths(w: Writer) -> list[Block]:
    """Return the map of depths and what it is."""
    t, snapshot = w.t, w.answers.snapshot
    bathymetry = snapshot.built.map
    grid, depth_m = bathymetry.grid, bathymetry.depth_m
    interval_m, exaggerated = usual_interval_m(depth_m), exaggeration(depth_m, grid.cell_m)
    sheet = Sheet(
        grid,
        depth_m,
        LAYERS["depth"].palette,
        depth_range(bathymetry),
        t("axis_depth"),
        (t("axis_east"), t("axis_north")),
        shaded=hillshade(depth_m, grid.cell_m, exaggerated),
        depth_m=depth_m,
        interval_m=interval_m,
        interpolated=np.isfinite(depth_m) & ~bathymetry.sounded if not w.is_swath else None,
    )
    caption = t("caption_depth", interval=t.number(interval_m, 1 if interval_m < 1 else 0), exaggerated=exaggerated)
    facts: list[tuple[str, Text]] = [
        (t("fact_cell"), w.number("map.cell_m", 2, "m")),
        (t("fact_rows"), w.number("map.rows")),
        (t("fact_cols"), w.number("map.cols")),
        (t("fact_least_depth"), w.number("map.min_depth_m", 2, "m")),
        (t("fact_greatest_depth"), w.number("map.max_depth_m", 2, "m")),
        (t("fact_model"), w.string("map.model")),
    ]
    if w.answers.at("quality.difference") is not None:
        own = "quality.difference"
        facts += [
            (t("fact_reference"), w.string("reference.filename")),
            (t("fact_rmse"), w.number(f"{own}.rmse_m", 3, "m")),
            (t("fact_bias"), w.number(f"{own}.bias_m", 3, "m", signed=True)),
            (t("fact_p95"), w.number(f"{own}.p95_m", 3, "m")),
        ]
    note = [] if w.is_swath else [Paragraph(t("pale"))]
    return [Figure(sheet_png(sheet), PNG, caption), *note, Facts(facts)]


def layer_sheet(w: Writer, kind: LayerKind, layer: Layer, words: str, holidays: Any = ()) -> bytes:
    """Return a layer as a picture, PNG."""
    known = layer.values[np.isfinite(layer.values)]
    low, high = kind.range or (float(known.min()) if kind.fit is Fit.DATA else 0.0, float(np.percentile(known, 99)))
    if kind.name == "count":
        low, high = 0.0, max(high, LEAST_COUNTED)
    classes = [w.t(f"class_density_{number}") for number in range(len(kind.classes))]
    return sheet_png(
        Sheet(
            w.answers.snapshot.built.map.grid,
            layer.values,
            kind.palette,
            (low, high if high > low else low + 1.0),
            words,
            (w.t("axis_east"), w.t("axis_north")),
            classes=classes,
            holidays=holidays,
        )
    )


def density(w: Writer) -> list[Block]:
    """Return how much of the area was sounded, and how densely."""
    t, snapshot = w.t, w.answers.snapshot
    kind = LAYERS["density" if w.is_swath else "count"]
    layer = kind.of(snapshot.source(w.answers.order))
    swept = snapshot.ensonified()
    facts: list[tuple[str, Text]]
    if w.is_swath:
        facts = [
            (t("fact_ensonified"), w.share("mission.progress.ensonified_pct")),
            (t("fact_dense"), w.share("mission.progress.dense_pct")),
            (t("fact_holidays"), w.number("mission.progress.holidays")),
        ]
    else:
        facts = [
            (t("fact_coverage"), w.share("mission.progress.coverage_pct")),
            (t("fact_accuracy"), w.number("mission.spec.accuracy_m", 2, "m")),
        ]
    blocks: list[Block] = [Facts(facts), Paragraph(t("coverage_swath" if w.is_swath else "coverage_single"))]
    if layer is not None:
        picture = layer_sheet(w, kind, layer, t("axis_count"), () if swept is None else swept.holidays)
        blocks.append(Figure(picture, PNG, t("caption_density" if w.is_swath else "caption_count")))
    return blocks


def holidays(w: Writer) -> list[Block]:
    """Return the places that swaths left out."""
    if not w.answers.has("holidays"):
        return []
    t = w.t
    found = w.answers.at("holidays.features")
    ensonified_pct = w.answers.at("mission.progress.ensonified_pct")
    whole = ensonified_pct is not None and ensonified_pct >= 100.0
    beside = [] if whole else [Paragraph(t("holidays_beside"))]
    if not found:
        return [Paragraph(t("holidays_none")), *beside]
    rows: list[list[Text]] = []
    for index in range(min(len(found), MOST_HOLIDAYS)):
        own = f"holidays.features.{index}.properties"
        rows.append(
            [
                w.number(f"{own}.number"),
                w.number(f"{own}.area_m2", 1, "m²"),
                w.number(f"{own}.lat_deg", 6, "°"),
                w.number(f"{own}.lon_deg", 6, "°"),
            ]
        )
    columns = [t(f"column_{name}") for name in ("number", "area", "latitude", "longitude")]
    left_off = w.left_off(len(rows), len(found), "holidays.geojson")
    return [Table(columns, rows, numbers=(0, 1, 2, 3), caption=t("caption_holidays"), left_off=left_off), *beside]
