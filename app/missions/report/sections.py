"""What stands in a report, section by section. Every number is looked up in an answer of REST, by its place there.

A further section is a function that returns its blocks, none where there is nothing to say, and an entry of
``SECTIONS``; its title is the text ``section_`` and its name.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from app.mapping.layers import LAYERS, Fit, Layer, LayerKind
from app.mapping.products.contours import usual_interval_m
from app.mapping.products.pictures.colours import depth_range
from app.mapping.products.pictures.hillshade import exaggeration, hillshade
from app.mapping.products.pictures.sheet import Sheet, sheet_png
from app.missions.report.answers import Answers
from app.missions.report.charts import by_angle, histogram, overview
from app.missions.report.document import (
    Block,
    Document,
    Facts,
    Figure,
    Listing,
    Paragraph,
    Points,
    Section,
    Shown,
    Table,
    Text,
)
from app.missions.report.listing import listing
from app.missions.report.texts import NONE, Texts
from app.missions.report.writer import Writer
from app.missions.states import ENDED
from imc_bridge.printable import printable

PNG, SVG = "image/png", "image/svg+xml"

MOST_HOLIDAYS, MOST_INCIDENTS, MOST_LINES, MOST_OUTLIERS, MOST_PAIRS, MOST_REASONS, MOST_PARTS = (
    100,
    150,
    15,
    15,
    30,
    25,
    60,
)
"""Rows that tables have place for."""

LEAST_COUNTED = 5.0
"""Colours of numbers of soundings reach at least so far."""


def _purpose(w: Writer) -> list[Block]:
    t, answers = w.t, w.answers
    state = answers.at("mission.state")
    blocks: list[Block] = []
    if state not in ENDED:
        blocks.append(Paragraph(t("interim"), note=True))
    facts: list[tuple[str, Text]] = [
        (t("fact_name"), w.string("mission.name")),
        (t("fact_id"), w.string("mission.id", mono=True)),
        (t("fact_purpose"), w.word("purpose", "mission.spec.kind")),
        (t("fact_state"), w.word("state", "mission.state")),
    ]
    if answers.at("mission.reason"):
        facts.append((t("fact_reason"), w.string("mission.reason")))
    if answers.authority:
        facts.append((t("fact_authority"), answers.authority))
    facts += [
        (t("fact_datum"), w.string("map.vertical_datum")),
        (t("fact_depths"), _range(w, "map.min_depth_m", "map.max_depth_m", 2, "m")),
        (t("fact_soundings"), w.number("mission.progress.soundings")),
    ]
    if answers.at("mission.progress.pings"):
        facts.append((t("fact_pings"), w.number("mission.progress.pings")))
        facts.append((t("fact_beams"), w.number("mission.progress.beams")))
    facts.append((t("fact_coverage"), w.number("mission.progress.coverage_pct", 1, "%")))
    if w.is_swath:
        facts.append((t("fact_dense"), w.number("mission.progress.dense_pct", 1, "%")))
        facts.append((t("fact_holidays"), w.number("mission.progress.holidays")))
    return [*blocks, Facts(facts)]


def _range(w: Writer, low: str, high: str, decimals: int, unit: str) -> Shown:
    values = [w.answers.at(low), w.answers.at(high)]
    text = " – ".join(w.t.number(value, decimals) for value in values)
    return Shown(f"{text}\u00a0{unit}")


def _place(w: Writer) -> list[Block]:
    t, answers = w.t, w.answers
    facts_of = answers.snapshot.facts
    spec = facts_of.spec
    corners = [
        (t(name), f"{_angle(w, lat, t('north'), t('south'))}, {_angle(w, lon, t('east'), t('west'))}")
        for name, (lon, lat) in zip(
            ("fact_north_west", "fact_south_east"),
            (answers.at("map.corners.0"), answers.at("map.corners.2")),
            strict=True,
        )
    ]
    homes = [point for point in (None if spec.recovery is None else spec.recovery.point,) if point is not None]
    homes += [vehicle.recovery_point for vehicle in spec.vehicles if vehicle.recovery_point is not None]
    lon, lat = np.array(homes, dtype=float).reshape(-1, 2).T
    points = np.column_stack(facts_of.frame.to_local(lat, lon)) if homes else np.empty((0, 2))
    marked = []
    for feature in answers.at("crosslines.features.features"):
        at_lon, at_lat = feature["geometry"]["coordinates"]
        east, north = facts_of.frame.to_local(np.array(at_lat), np.array(at_lon))
        marked.append((float(east), float(north), bool(feature["properties"]["outlier"])))
    chart = overview(
        spec.local_area(), [spec.to_local(zone) for zone in spec.keep_out], points, answers.tracks_m, marked, t
    )
    origin = answers.at("mission.origin")
    return [
        Facts(
            [
                *corners,
                (
                    t("fact_origin"),
                    f"{_angle(w, origin[1], t('north'), t('south'))}, {_angle(w, origin[0], t('east'), t('west'))}",
                ),
                (t("fact_frame"), t("frame")),
                (t("fact_zones"), t.number(len(answers.at("mission.spec.keep_out")))),
            ]
        ),
        Figure(chart, SVG, t("caption_overview"), 0.7),
    ]


def _angle(w: Writer, degrees: float, positive: str, negative: str) -> str:
    """Return an angle as charts have it: degrees and minutes with four decimals."""
    minutes = round(abs(degrees) * 60.0, 4)
    whole, part = divmod(minutes, 60.0)
    return f"{int(whole)}°{w.t.number(part, 4)}′\u00a0{positive if degrees >= 0 else negative}"


def _times(w: Writer) -> list[Block]:
    t = w.t
    budget = w.answers.at("mission.progress.budget")
    (name,) = [name for name in ("minutes", "km_per_vehicle", "steps") if budget.get(name) is not None]
    shown = w.number(f"mission.progress.budget.{name}", 0 if float(budget[name]).is_integer() else 1)
    return [
        Facts(
            [
                (t("fact_created"), w.moment("mission.created_at")),
                (t("fact_first"), w.moment("period.first_time_s")),
                (t("fact_last"), w.moment("period.last_time_s")),
                (t("fact_running"), w.number("mission.progress.elapsed_s", 0, "s")),
                (t(f"fact_budget_{name}"), shown),
                (t("fact_steps"), w.number("mission.progress.step")),
                (t("fact_distance"), w.number("mission.progress.distance_m", 0, "m")),
            ]
        ),
        Paragraph(t("clocks")),
    ]


def _vehicles(w: Writer) -> list[Block]:
    t, answers = w.t, w.answers
    vehicles = answers.at("mission.vehicles")
    described = {one["name"]: index for index, one in enumerate(answers.at("mission.spec.vehicles"))}
    rows: list[list[Text]] = []
    sonars: list[list[Text]] = []
    for index, vehicle in enumerate(vehicles):
        own = f"mission.vehicles.{index}"
        rows.append(
            [
                w.string(f"{own}.name"),
                w.word("kind", f"{own}.kind"),
                w.word("sensor", f"{own}.sensor"),
                w.number(f"{own}.flown_m", 0, "m"),
                w.number(f"{own}.on_plan_m", 0, "m"),
                w.number(f"{own}.risings"),
                w.number(f"{own}.position_sd_m", 1, "m"),
            ]
        )
        place = described.get(vehicle["name"])
        if vehicle["sensor"] == "multibeam":
            sonar = None if place is None else f"mission.spec.vehicles.{place}.sonar"
            known = sonar is not None and answers.at(sonar) is not None
            columns = (("aperture_deg", 0, "°"), ("beams", 0, ""), ("rate_hz", 1, "Hz"), ("range_m", 0, "m"))
            cells: list[Text] = [
                w.number(f"{sonar}.{field}", decimals, unit) if known else t("usual")
                for field, decimals, unit in columns
            ]
            sonars.append([w.string(f"{own}.name"), *cells])
    blocks: list[Block] = [
        Table(
            [
                t(f"column_{name}")
                for name in ("vehicle", "kind", "sensor", "flown", "on_plan", "risings", "position_sd")
            ],
            rows,
            numbers=(3, 4, 5, 6),
            caption=t("caption_vehicles"),
        )
    ]
    if sonars:
        columns_of = [t(f"column_{name}") for name in ("vehicle", "aperture", "beams", "rate", "range")]
        blocks.append(Table(columns_of, sonars, numbers=(1, 2, 3, 4), caption=t("caption_sonars")))
    return blocks


def _adjustment(w: Writer) -> list[tuple[str, Text]]:
    t, source = w.t, "adjustment"
    facts: list[tuple[str, Text]] = [
        (t("fact_adjustment"), w.moment(f"{source}.made_at")),
        (t("fact_ties"), w.number(f"{source}.ties_used")),
        (t("fact_fixes"), w.number(f"{source}.fixes")),
    ]
    if w.answers.at(f"{source}.after_m") is not None:
        facts += [
            (t("fact_ties_before"), w.number(f"{source}.before_m", 2, "m")),
            (t("fact_ties_after"), w.number(f"{source}.after_m", 2, "m")),
        ]
    return facts


def _offsets(w: Writer) -> Table:
    """Return by how much the positions of each vehicle were changed."""
    tracks = [f"adjustment.tracks.{index}" for index in range(len(w.answers.at("adjustment.tracks")))]
    rows = [
        [
            w.string(f"{track}.vehicle"),
            w.number(f"{track}.mean_m", 2, "m"),
            w.number(f"{track}.max_m", 2, "m"),
            w.number(f"{track}.sd_m", 2, "m"),
        ]
        for track in tracks
    ]
    columns = [w.t(f"column_{name}") for name in ("vehicle", "moved_mean", "moved_most", "sd")]
    return Table(columns, rows, numbers=(1, 2, 3), caption=w.t("caption_offsets"))


def _corrections(w: Writer) -> list[Block]:
    t, answers = w.t, w.answers
    tide = "corrections.tide"
    facts: list[tuple[str, Text]] = []
    if answers.at("corrections.tide_table") is not None:
        table = "corrections.tide_table"
        facts += [
            (t("fact_tide_table"), w.string(f"{table}.name")),
            (t("fact_tide_from"), w.moment(f"{table}.first")),
            (t("fact_tide_until"), w.moment(f"{table}.last")),
            (t("fact_tide_entries"), w.number(f"{table}.entries")),
            (t("fact_tide_sha256"), w.string(f"{table}.sha256", mono=True)),
        ]
    else:
        facts.append((t("fact_tide_level"), w.number(f"{tide}.level_m", 2, "m", signed=True)))
    facts += [
        (t("fact_tide_source"), w.string(f"{tide}.source")),
        (t("fact_tide_sd"), w.number(f"{tide}.sd_m", 2, "m")),
        (t("fact_datum"), w.string("corrections.vertical_datum")),
        (t("fact_datum_offset"), w.number(f"{tide}.datum_offset_m", 2, "m", signed=True)),
    ]
    if answers.at("corrections.sound_speed") is None:
        facts.append((t("fact_sound_speed"), t("sound_speed_none")))
    else:
        speed = "corrections.sound_speed"
        profile = answers.at(f"{speed}.profile")
        facts += [
            (t("fact_sound_speed"), w.string(f"{speed}.source") if answers.at(f"{speed}.source") else t("profile")),
            (t("fact_profile"), t("profile_of", count=t.number(len(profile)))),
            (t("fact_profile_top"), w.number(f"{speed}.profile.0.1", 1, "m/s")),
            (t("fact_profile_bottom"), w.number(f"{speed}.profile.{len(profile) - 1}.1", 1, "m/s")),
            (t("fact_assumed"), w.number(f"{speed}.assumed_mps", 1, "m/s")),
        ]
    systematic = "corrections.systematic_errors"
    for name, errors in answers.at(f"{systematic}.vehicles").items():
        for key, digits, unit in (("depth_m", 3, "m"), ("roll_offset_deg", 2, "°"), ("sound_speed_mps", 1, "m/s")):
            if errors[key]:
                value = w.number(f"{systematic}.vehicles.{name}.{key}", digits, unit, signed=True)
                facts.append((t(f"fact_{key}", vehicle=name), value))
    if answers.at(f"{systematic}.water_level"):
        facts.append((t("fact_residual"), t("residual", count=t.number(len(answers.at(f"{systematic}.water_level"))))))
    facts += [
        (t("fact_draught"), t("draught")),
        (t("fact_waterline"), w.number("mission.spec.uncertainty.waterline_m", 3, "m")),
        (t("fact_attitude"), t("attitude")),
    ]
    adjusted = bool(answers.at("adjustment.applied"))
    facts += _adjustment(w) if adjusted else [(t("fact_adjustment"), t("adjustment_none"))]
    blocks: list[Block] = [Facts(facts), Paragraph(t("raw_stays"))]
    if adjusted:
        blocks.append(_offsets(w))
    imports = answers.at("imports")
    if imports:
        rows = [
            [
                w.string(f"imports.{index}.filename"),
                w.string(f"imports.{index}.source"),
                w.number(f"imports.{index}.taken"),
                w.number(f"imports.{index}.median_sd_m", 2, "m"),
                w.string(f"imports.{index}.sha256", mono=True),
            ]
            for index in range(len(imports))
        ]
        columns = [t(f"column_{name}") for name in ("file", "source", "taken", "median_sd", "sha256")]
        blocks.append(Table(columns, rows, numbers=(2, 3), caption=t("caption_imports")))
    return blocks


def _map(w: Writer) -> list[Block]:
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
        (t("fact_version"), w.number("map.version")),
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


def _layer_sheet(w: Writer, kind: LayerKind, layer: Layer, words: str, holidays: Any = ()) -> bytes:
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


def _density(w: Writer) -> list[Block]:
    t, snapshot = w.t, w.answers.snapshot
    kind = LAYERS["density" if w.is_swath else "count"]
    layer = kind.of(snapshot.source(w.answers.order))
    swept = snapshot.ensonified()
    facts: list[tuple[str, Text]] = [(t("fact_coverage"), w.number("mission.progress.coverage_pct", 1, "%"))]
    facts.append((t("fact_accuracy"), w.number("mission.spec.accuracy_m", 2, "m")))
    if w.is_swath:
        facts += [
            (t("fact_ensonified"), w.number("mission.progress.ensonified_pct", 1, "%")),
            (t("fact_dense"), w.number("mission.progress.dense_pct", 1, "%")),
            (t("fact_holidays"), w.number("mission.progress.holidays")),
        ]
    blocks: list[Block] = [Facts(facts), Paragraph(t("coverage_swath" if w.is_swath else "coverage_single"))]
    if layer is not None:
        picture = _layer_sheet(w, kind, layer, t("axis_count"), () if swept is None else swept.holidays)
        blocks.append(Figure(picture, PNG, t("caption_density" if w.is_swath else "caption_count")))
    return blocks


def _holidays(w: Writer) -> list[Block]:
    if not w.answers.has("holidays"):
        return []
    t = w.t
    found = w.answers.at("holidays.features")
    if not found:
        return [Paragraph(t("holidays_none"))]
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
    return [Table(columns, rows, numbers=(0, 1, 2, 3), caption=t("caption_holidays"), left_off=left_off)]


def _uncertainty(w: Writer) -> list[Block]:
    t, answers = w.t, w.answers
    kind = LAYERS["tvu"]
    layer = kind.of(answers.snapshot.source(answers.order))
    blocks: list[Block] = []
    if answers.at("mission.progress.mean_sd_m") is not None:
        blocks.append(Facts([(t("fact_mean_sd"), w.number("mission.progress.mean_sd_m", 3, "m"))]))
    if layer is not None:
        blocks.append(Figure(_layer_sheet(w, kind, layer, t("axis_tvu")), PNG, t("caption_tvu")))
    if not answers.has("uncertainty_budget"):
        return blocks
    own = "uncertainty_budget"
    angles = [share["angle_deg"] for share in answers.at(f"{own}.components.0.shares")]
    columns = [t("column_source_of_error"), t("column_sd")]
    columns += [t("column_vertical", angle=t.number(angle)) for angle in angles]
    columns += [t("column_horizontal", angle=t.number(angle)) for angle in angles]
    rows: list[list[Text]] = []
    for index, component in enumerate(answers.at(f"{own}.components")):
        one = f"{own}.components.{index}"
        unit = "°" if component["unit"] == "degree" else component["unit"]
        shares = range(len(angles))
        rows.append(
            [
                t.of("error", component["name"]),
                w.number(f"{one}.sd", 3, unit),
                *(w.number(f"{one}.shares.{k}.vertical_m", 3) for k in shares),
                *(w.number(f"{one}.shares.{k}.horizontal_m", 3) for k in shares),
            ]
        )
    totals = range(len(angles))
    rows.append(
        [
            t("total"),
            "",
            *(w.number(f"{own}.totals.{k}.tvu_m", 3) for k in totals),
            *(w.number(f"{own}.totals.{k}.thu_m", 3) for k in totals),
        ]
    )
    blocks.append(
        Table(columns, rows, numbers=tuple(range(1, 2 + 2 * len(angles))), widths=(2.2,), caption=t("caption_budget"))
    )
    blocks.append(
        Facts(
            [
                (t("fact_budget_depth"), w.number(f"{own}.depth_m", 2, "m")),
                (t("fact_below_sonar"), w.number(f"{own}.below_sonar_m", 2, "m")),
            ]
        )
    )
    return blocks


_AGREEMENT = (
    ("count", 0, False),
    ("mean_m", 3, True),
    ("median_m", 3, True),
    ("sd_m", 3, False),
    ("rms_m", 3, False),
    ("p95_m", 3, False),
    ("max_m", 3, False),
    ("within_pct", 1, False),
)


def _agreement(w: Writer, source: str) -> list[Text]:
    return [w.number(f"{source}.{name}", decimals, signed=signed) for name, decimals, signed in _AGREEMENT]


def _crosslines(w: Writer) -> list[Block]:
    t, answers = w.t, w.answers
    own = "crosslines"
    order = w.order(answers.order)
    facts: list[tuple[str, Text]] = [
        (t("fact_lines"), w.number(f"{own}.lines")),
        (t("fact_length"), w.number(f"{own}.length_km", 2, "km")),
        (t("fact_crosslines"), w.number(f"{own}.crosslines")),
        (t("fact_crosslines_km"), w.number(f"{own}.crosslines_km", 2, "km")),
        (t("fact_crosslines_pct"), w.number(f"{own}.crosslines_pct", 1, "%")),
        (t("fact_outliers"), w.number(f"{own}.outliers")),
        (t("fact_normalised"), w.number(f"{own}.normalised_rms", 2)),
    ]
    blocks: list[Block] = [Facts(facts)]
    if answers.at(f"{own}.statistics") is None:
        return [*blocks, Paragraph(t("crossings_none"), note=True)]
    columns = [t(f"column_{name}") for name, *_ in _AGREEMENT[:-1]] + [t("column_within", order=order)]
    numbers = tuple(range(1, 1 + len(columns)))
    rows: list[list[Text]] = [[t("all_crossings"), *_agreement(w, f"{own}.statistics")]]
    if answers.at(f"{own}.at_crosslines") is not None:
        rows.append([t("at_crosslines"), *_agreement(w, f"{own}.at_crosslines")])
    for index, pair in enumerate(answers.at(f"{own}.by_vehicles")[:MOST_PAIRS]):
        names = " − ".join(printable(name) for name in pair["vehicles"])
        rows.append([names, *_agreement(w, f"{own}.by_vehicles.{index}")])
    blocks.append(Paragraph(t("crossings_words", order=order)))
    blocks.append(
        Table([t("column_crossings"), *columns], rows, numbers, widths=(2.0,), caption=t("caption_crossings"))
    )
    counts = answers.at(f"{own}.histogram")
    blocks.append(Figure(histogram(counts["edges_m"], counts["counts"], t), SVG, t("caption_histogram"), 0.85))
    lines = answers.at(f"{own}.by_line")
    rows = [
        [
            w.string(f"{own}.by_line.{index}.vehicle"),
            w.number(f"{own}.by_line.{index}.line"),
            t("yes") if line["crossline"] else t("no"),
            w.number(f"{own}.by_line.{index}.length_m", 0, "m"),
            w.number(f"{own}.by_line.{index}.heading_deg", 0, "°"),
            w.number(f"{own}.by_line.{index}.count"),
            w.number(f"{own}.by_line.{index}.mean_m", 3, signed=True),
            w.number(f"{own}.by_line.{index}.rms_m", 3),
        ]
        for index, line in enumerate(lines[:MOST_LINES])
    ]
    columns = [
        t(f"column_{name}")
        for name in ("vehicle", "line", "crossline", "length", "heading", "count", "mean_m", "rms_m")
    ]
    left_off = w.left_off(len(rows), len(lines) + answers.at(f"{own}.lines_left_off"))
    blocks.append(Table(columns, rows, (1, 3, 4, 5, 6, 7), caption=t("caption_lines"), left_off=left_off))
    blocks += _outliers(w)
    bins = answers.at(f"{own}.by_angle")
    if bins:
        blocks.append(Figure(by_angle(bins, t), SVG, t("caption_by_angle"), 0.85))
    return blocks


def _outliers(w: Writer) -> list[Block]:
    t, own = w.t, "crosslines.features.features"
    features = w.answers.at(own)
    worst = [index for index, one in enumerate(features) if one["properties"]["outlier"]][:MOST_OUTLIERS]
    if not worst:
        return []
    rows: list[list[Text]] = []
    for index in worst:
        one = f"{own}.{index}.properties"
        rows.append(
            [
                w.number(f"{one}.number"),
                " − ".join(printable(name) for name in w.answers.at(f"{one}.vehicles")),
                w.number(f"{one}.depths_m.0", 2, "m"),
                w.number(f"{one}.depths_m.1", 2, "m"),
                w.number(f"{one}.difference_m", 2, "m", signed=True),
                w.number(f"{one}.lat_deg", 6, "°"),
                w.number(f"{one}.lon_deg", 6, "°"),
            ]
        )
    names = ("number", "vehicles", "first_depth", "second_depth", "difference", "latitude", "longitude")
    left_off = w.left_off(len(rows), w.answers.at("crosslines.outliers"), "crossovers.csv")
    columns = [t(f"column_{name}") for name in names]
    return [Table(columns, rows, (0, 2, 3, 4, 5, 6), caption=t("caption_outliers"), left_off=left_off)]


def _s44(w: Writer) -> list[Block]:
    t, answers = w.t, w.answers
    rows: list[list[Text]] = []
    for index, one in enumerate(answers.at("quality.tvu")):
        own = f"quality.tvu.{index}"
        rows.append(
            [
                w.order(one["order"]),
                w.number(f"{own}.cells_pct", 1, "%"),
                w.number(f"{own}.sounded_pct", 1, "%"),
                w.number(f"{own}.horizontal_pct", 1, "%"),
            ]
        )
    columns = [t(f"column_{name}") for name in ("order", "tvu_cells", "tvu_sounded", "thu_cells")]
    return [
        Paragraph(t("s44_words")),
        Table(columns, rows, (1, 2, 3), caption=t("caption_s44")),
        Paragraph(t("cannot_be_said"), note=True),
        Points(_not_said(w)),
    ]


def _not_said(w: Writer) -> list[Text]:
    """Return what the survey does not show."""
    t, answers = w.t, w.answers
    said: list[Text] = [t("cannot_order"), t("cannot_features"), t("cannot_model")]
    said.append(t("cannot_coverage_swath" if w.is_swath else "cannot_coverage_single"))
    if all(one["horizontal_pct"] is None for one in answers.at("quality.tvu")):
        said.append(t("cannot_horizontal"))
    if not answers.snapshot.facts.spec.tide.is_applied and answers.at("corrections.tide_table") is None:
        said.append(t("cannot_tide"))
    if answers.at("corrections.sound_speed") is None:
        said.append(t("cannot_sound_speed"))
    if answers.at("crosslines.statistics") is None:
        said.append(t("cannot_crossings"))
    elif answers.at("crosslines.at_crosslines") is None:
        said.append(t("cannot_crosslines"))
    adjusted = w.answers.at("adjustment.applied")
    said += [t("cannot_adjusted" if adjusted else "cannot_positions"), t("cannot_calibration")]
    if answers.at("imports"):
        said.append(t("cannot_imports"))
    return said


def _rejected(w: Writer) -> list[Block]:
    t, refusals = w.t, w.answers.at("refusals")
    facts: list[tuple[str, Text]] = [
        (t(f"fact_{state}"), w.number(f"rejected.{state}"))
        for state in ("rejected", "doubted", "withdrawn", "restored")
    ]
    if w.answers.at("mission.progress.pings") or w.answers.at("pings.rejected"):
        facts.append((t("fact_rejected_pings"), w.number("pings.rejected")))
    blocks: list[Block] = [Facts(facts)]
    if refusals:
        rows: list[list[Text]] = [
            [w.string(f"refusals.{index}.reason"), w.number(f"refusals.{index}.count")]
            for index in range(min(len(refusals), MOST_REASONS))
        ]
        left_off = w.left_off(len(rows), len(refusals), "soundings.csv")
        columns = [t("column_reason"), t("column_count")]
        blocks.append(Table(columns, rows, (1,), (5.0, 1.0), t("caption_refusals"), left_off))
    return blocks


def _incidents(w: Writer) -> list[Block]:
    t, found = w.t, w.answers.incidents
    if not found:
        return [Paragraph(t("incidents_none"))]
    rows = [
        [
            t.moment(one.time),
            t.of("level", one.level),
            t.of("failsafe", one.failsafe) if one.failsafe else NONE,
            t.of("response", one.response) if one.response else NONE,
            printable(one.message),
        ]
        for one in found[:MOST_INCIDENTS]
    ]
    columns = [t(f"column_{name}") for name in ("time", "level", "failsafe", "response", "message")]
    left_off = w.left_off(len(rows), len(found))
    return [
        Paragraph(t("incidents_words")),
        Table(columns, rows, widths=(1.6, 0.8, 1.2, 1.0, 3.2), caption=t("caption_incidents"), left_off=left_off),
    ]


def _files(w: Writer) -> list[Block]:
    t, files = w.t, w.answers.at("files")
    rows: list[list[Text]] = [
        [
            w.string(f"files.{index}.name"),
            w.number(f"files.{index}.size_bytes"),
            w.string(f"files.{index}.sha256", mono=True),
        ]
        for index in range(len(files))
    ]
    columns = [t("column_file"), t("column_bytes"), t("column_sha256")]
    blocks: list[Block] = [Paragraph(t("files_at_sea"))]
    if rows:
        blocks = [
            Paragraph(t("files_words", order=w.order(w.answers.order))),
            Table(columns, rows, (1,), (1.0, 0.0, 0.0), caption=t("caption_files")),
        ]
    if w.answers.files_left_off:
        blocks.append(Paragraph(t("files_left_off", names=", ".join(w.answers.files_left_off))))
    parts = w.answers.at("pings.parts")
    if parts:
        rows = [
            [
                w.number(f"pings.parts.{index}.number"),
                w.string(f"pings.parts.{index}.vehicle"),
                w.number(f"pings.parts.{index}.pings"),
                w.string(f"pings.parts.{index}.sha256", mono=True),
            ]
            for index in range(min(len(parts), MOST_PARTS))
        ]
        columns = [t(f"column_{name}") for name in ("number", "vehicle", "pings", "sha256")]
        left_off = w.left_off(len(rows), len(parts))
        blocks.append(Table(columns, rows, (0, 2), (0.0, 1.0, 0.0, 0.0), caption=t("caption_pings"), left_off=left_off))
    return blocks


def _repeat(w: Writer) -> list[Block]:
    t = w.t
    versions = [(name, version) for name, version in w.answers.versions.items()]
    return [
        Facts([*versions, (t("fact_seed"), w.number("mission.spec.seed"))]),
        Paragraph(t("repeat_words")),
        Listing(listing(w.answers.at("mission.spec"))),
    ]


SECTIONS: Mapping[str, Callable[[Writer], list[Block]]] = {
    "purpose": _purpose,
    "place": _place,
    "times": _times,
    "vehicles": _vehicles,
    "corrections": _corrections,
    "map": _map,
    "density": _density,
    "holidays": _holidays,
    "uncertainty": _uncertainty,
    "crosslines": _crosslines,
    "s44": _s44,
    "rejected": _rejected,
    "incidents": _incidents,
    "files": _files,
    "repeat": _repeat,
}
"""What stands in a report, in its order."""


def document_of(answers: Answers, texts: Texts) -> Document:
    """Return the report of a mission."""
    w = Writer(answers, texts)
    name = answers.snapshot.facts.title
    found = ((section, make(w)) for section, make in SECTIONS.items())
    made = texts.moment(float(answers.made_s))
    return Document(
        language=texts.language,
        title=f"{texts('title')}: {name}",
        subtitle=texts("subtitle", made=made, version=answers.versions.get("bathyfleet", "")),
        author=answers.authority or "bathyfleet",
        footer=f"{made} · {name}",
        made_s=answers.made_s,
        words={word: texts(f"word_{word}") for word in ("page", "contents", "figure", "table")},
        sections=[Section(section, texts(f"section_{section}"), blocks) for section, blocks in found if blocks],
    )
