"""What is kept of the survey: what was refused, what happened, its files, and how to repeat it."""

from app.missions.report.document import Block, Facts, Listing, Paragraph, Table, Text
from app.missions.report.listing import listing
from app.missions.report.texts import NONE
from app.missions.report.writer import Writer
from imc_bridge.printable import printable

MOST_INCIDENTS, MOST_PARTS, MOST_REASONS = 150, 60, 25
"""Rows that tables have place for."""


def rejected(w: Writer) -> list[Block]:
    """Return what was refused, and why."""
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


def incidents(w: Writer) -> list[Block]:
    """Return what happened that somebody had to know."""
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


def files(w: Writer) -> list[Block]:
    """Return the files of the survey with their checksums."""
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


def repeat(w: Writer) -> list[Block]:
    """Return what is needed to do the same again."""
    t = w.t
    versions = [(name, version) for name, version in w.answers.versions.items()]
    return [
        Facts([*versions, (t("fact_seed"), w.number("mission.spec.seed"))]),
        Paragraph(t("repeat_words")),
        Listing(listing(w.answers.at("mission.spec"))),
    ]
