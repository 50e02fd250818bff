"""How well depths are known: by the map itself, and by the budget of errors."""

from app.mapping.layers import LAYERS
from app.missions.report.document import PNG, Block, Facts, Figure, Table, Text
from app.missions.report.sections.maps import layer_sheet
from app.missions.report.writer import Writer


def uncertainty(w: Writer) -> list[Block]:
    """Return the uncertainty of the map's depths, and the budget of errors of swath sonars."""
    t, answers = w.t, w.answers
    kind = LAYERS["tvu"]
    layer = kind.of(answers.snapshot.source(answers.order))
    blocks: list[Block] = []
    if answers.at("mission.progress.mean_sd_m") is not None:
        blocks.append(Facts([(t("fact_mean_sd"), w.number("mission.progress.mean_sd_m", 3, "m"))]))
    if layer is not None:
        blocks.append(Figure(layer_sheet(w, kind, layer, t("axis_tvu")), PNG, t("caption_tvu")))
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
