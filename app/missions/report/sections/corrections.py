"""What soundings were corrected by, and what was taken in from elsewhere."""

from app.mapping.water.casts import CastRule
from app.missions.report.answers import Answers
from app.missions.report.document import Block, Facts, Paragraph, Table, Text
from app.missions.report.texts import NONE
from app.missions.report.writer import Writer
from app.missions.spec.water import Tide


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


def _is_unnamed(answers: Answers) -> bool:
    """Whether a water level was applied of which nobody said where it comes from."""
    tide = Tide.model_validate(answers.at("corrections.tide"))
    return tide.is_unnamed and (tide.is_applied or answers.at("corrections.tide_table") is not None)


def has_several_casts(w: Writer) -> bool:
    """Whether several sound speed casts correct what was sounded."""
    return bool(w.answers.at("corrections.sound_speed") and w.answers.at("corrections.sound_speed.further"))


def _sound_speed(w: Writer) -> list[tuple[str, Text]]:
    """Return what ranges were corrected by."""
    t, answers, speed = w.t, w.answers, "corrections.sound_speed"
    if answers.at(speed) is None:
        return [(t("fact_sound_speed"), t("sound_speed_none"))]
    assumed = (t("fact_assumed"), w.number(f"{speed}.assumed_mps", 1, "m/s"))
    if has_several_casts(w):
        facts: list[tuple[str, Text]] = [
            (t("fact_sound_speed"), t("casts_of", count=t.number(len(answers.at("casts.casts"))))),
            (t("fact_cast_rule"), w.word("cast_rule", f"{speed}.rule")),
        ]
        if answers.at(f"{speed}.rule") == CastRule.NEAREST_IN_DISTANCE:
            facts.append((t("fact_within_h"), w.number(f"{speed}.within_h", 1, "h")))
        return [*facts, assumed]
    profile = answers.at(f"{speed}.profile")
    facts = [
        (t("fact_sound_speed"), w.string(f"{speed}.source") if answers.at(f"{speed}.source") else t("profile")),
        (t("fact_profile"), t("profile_of", count=t.number(len(profile)))),
        (t("fact_profile_top"), w.number(f"{speed}.profile.0.1", 1, "m/s")),
        (t("fact_profile_bottom"), w.number(f"{speed}.profile.{len(profile) - 1}.1", 1, "m/s")),
        assumed,
    ]
    if answers.at(f"{speed}.time") is not None:
        facts.insert(1, (t("fact_cast_time"), w.moment(f"{speed}.time")))
    return facts


def _casts(w: Writer) -> list[Block]:
    """Return what each of several casts corrected, and by how much neighbours differ."""
    t, casts = w.t, "casts.casts"
    rows = []
    for index, cast in enumerate(w.answers.at(casts)):
        own = f"{casts}.{index}"
        rows.append(
            [
                w.string(f"{own}.name"),
                w.moment(f"{own}.time"),
                w.number(f"{own}.position.1", 5) if cast["position"] else NONE,
                w.number(f"{own}.position.0", 5) if cast["position"] else NONE,
                w.number(f"{own}.profile.{len(cast['profile']) - 1}.0", 1, "m"),
                w.number(f"{own}.soundings"),
                w.number(f"{own}.pings"),
                w.number(f"{own}.farthest_h", 1, "h"),
            ]
        )
    names = ("cast", "taken_at", "cast_lat", "cast_lon", "cast_bottom", "cast_soundings", "cast_pings", "cast_farthest")
    blocks: list[Block] = [
        Table([t(f"column_{name}") for name in names], rows, numbers=(2, 3, 4, 5, 6, 7), caption=t("caption_casts"))
    ]
    if w.answers.at("casts.changes"):
        rows = [
            [
                w.string(f"casts.changes.{index}.before"),
                w.string(f"casts.changes.{index}.after"),
                w.number(f"casts.changes.{index}.difference_m", 2, "m"),
            ]
            for index in range(len(w.answers.at("casts.changes")))
        ]
        columns = [t(f"column_{name}") for name in ("cast_before", "cast_after", "cast_difference")]
        blocks.append(Table(columns, rows, numbers=(2,), caption=t("caption_cast_changes")))
    return blocks


def _mountings(w: Writer) -> list[tuple[str, Text]]:
    """Return how sonars are mounted that are not simply along their vehicles."""
    facts: list[tuple[str, Text]] = []
    for index, one in enumerate(w.answers.at("corrections.mountings")):
        counted = "corrected" if one["corrected"] is not None else "stated"
        at, mounting = f"corrections.mountings.{index}.{counted}", one[counted]
        values = [
            *((name, f"{at}.{name}", mounting[name], 2, "°") for name in ("roll_deg", "pitch_deg", "heading_deg")),
            ("latency_s", f"{at}.latency_s", mounting["latency_s"], 3, "s"),
            *(
                (f"offset_{name}", f"{at}.offset_m.{axis}", mounting["offset_m"][axis], 2, "m")
                for axis, name in enumerate(("forward", "starboard", "down"))
            ),
        ]
        facts += [
            (w.t(f"fact_mounting_{name}", vehicle=one["vehicle"]), w.number(source, digits, unit, signed=True))
            for name, source, value, digits, unit in values
            if value
        ]
    return facts


def corrections(w: Writer) -> list[Block]:
    """Return water level, sound speed, systematic errors, mountings, the adjustment of tracks, and imports."""
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
        (t("fact_tide_source"), NONE if _is_unnamed(answers) else w.string(f"{tide}.source")),
        (t("fact_tide_sd"), w.number(f"{tide}.sd_m", 2, "m")),
        (t("fact_datum"), w.string("corrections.vertical_datum")),
        (t("fact_datum_offset"), w.number(f"{tide}.datum_offset_m", 2, "m", signed=True)),
    ]
    facts += _sound_speed(w)
    systematic = "corrections.systematic_errors"
    for name, errors in answers.at(f"{systematic}.vehicles").items():
        for key, digits, unit in (("depth_m", 3, "m"), ("roll_offset_deg", 2, "°"), ("sound_speed_mps", 1, "m/s")):
            if errors[key]:
                value = w.number(f"{systematic}.vehicles.{name}.{key}", digits, unit, signed=True)
                facts.append((t(f"fact_{key}", vehicle=name), value))
    if answers.at(f"{systematic}.water_level"):
        facts.append((t("fact_residual"), t("residual", count=t.number(len(answers.at(f"{systematic}.water_level"))))))
    facts += _mountings(w)
    for name in ("rejected_beams", "restored_beams"):
        if answers.at(f"corrections.{name}"):
            facts.append((t(f"fact_{name}"), w.number(f"corrections.{name}")))
    facts += [
        (t("fact_draught"), t("draught")),
        (t("fact_waterline"), w.number("mission.spec.uncertainty.waterline_m", 3, "m")),
        (t("fact_attitude"), t("attitude")),
    ]
    adjusted = bool(answers.at("adjustment.applied"))
    facts += _adjustment(w) if adjusted else [(t("fact_adjustment"), t("adjustment_none"))]
    blocks: list[Block] = [Facts(facts), Paragraph(t("raw_stays"))]
    if has_several_casts(w):
        blocks += _casts(w)
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
