"""What orders of S-44 the survey meets, and what it does not show."""

from app.missions.report.document import Block, Paragraph, Statements, Table, Text
from app.missions.report.writer import Writer


def s44(w: Writer) -> list[Block]:
    """Return how much of the map meets each order of S-44, and what cannot be said."""
    t, answers = w.t, w.answers
    rows: list[list[Text]] = []
    for index, one in enumerate(answers.at("quality.tvu")):
        own = f"quality.tvu.{index}"
        rows.append(
            [
                w.order(one["order"]),
                w.share(f"{own}.cells_pct"),
                w.share(f"{own}.sounded_pct"),
                w.share(f"{own}.horizontal_pct"),
            ]
        )
    columns = [t(f"column_{name}") for name in ("order", "tvu_cells", "tvu_sounded", "thu_cells")]
    return [
        Paragraph(t("s44_words")),
        Table(columns, rows, (1, 2, 3), caption=t("caption_s44")),
        Paragraph(t("cannot_be_said"), note=True),
        Statements(_not_said(w)),
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
    said += _casts_do_not_show(w)
    if answers.at("crosslines.statistics") is None:
        said.append(t("cannot_crossings"))
    elif answers.at("crosslines.at_crosslines") is None:
        said.append(t("cannot_crosslines"))
    adjusted = w.answers.at("adjustment.applied")
    said.append(t("cannot_adjusted" if adjusted else "cannot_positions"))
    corrected = [one["vehicle"] for one in answers.at("corrections.mountings") if one["corrected"] is not None]
    named = t("cannot_calibration_corrected", vehicles=", ".join(corrected))
    said.append(named if corrected else t("cannot_calibration"))
    if answers.at("imports"):
        said.append(t("cannot_imports"))
    return said


def _casts_do_not_show(w: Writer) -> list[Text]:
    """Return where sound speed casts are too few."""
    t, answers = w.t, w.answers
    said: list[Text] = []
    far = answers.at("casts.far_soundings") + answers.at("casts.far_pings")
    if far:
        hours = t.number(answers.at("casts.far_h"))
        said.append(t("cannot_casts_far", count=t.number(far), hours=hours))
    large = [change for change in answers.at("casts.changes") if change["is_large"]]
    if large:
        most = max(change["difference_m"] for change in large)
        limit = t.number(answers.at("casts.limit_m"), 2, "m")
        count = t.number(len(large))
        order = w.order(answers.at("casts.order"))
        said.append(t("cannot_casts_differ", count=count, most=t.number(most, 2, "m"), limit=limit, order=order))
    return said
