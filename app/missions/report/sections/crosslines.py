"""How well lines agree where they cross."""

from app.missions.report.charts import by_angle, histogram
from app.missions.report.document import SVG, Block, Facts, Figure, Paragraph, Table, Text
from app.missions.report.writer import Writer
from imc_bridge.printable import printable

MOST_LINES, MOST_OUTLIERS, MOST_PAIRS = 15, 15, 30
"""Rows that tables have place for."""


_AGREEMENT = (
    ("count", 0, False),
    ("mean_m", 3, True),
    ("median_m", 3, True),
    ("sd_m", 3, False),
    ("rms_m", 3, False),
    ("p95_m", 3, False),
    ("max_m", 3, False),
)


def _agreement(w: Writer, source: str) -> list[Text]:
    told: list[Text] = [w.number(f"{source}.{name}", decimals, signed=signed) for name, decimals, signed in _AGREEMENT]
    return [*told, w.share(f"{source}.within_pct", "")]


def crosslines(w: Writer) -> list[Block]:
    """Return how depths differ where lines cross: all together, by vehicles, by line, the worst, by angle."""
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
    columns = [t(f"column_{name}") for name, *_ in _AGREEMENT] + [t("column_within", order=order)]
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
