"""What was asked for: the mission, its place and time, and its vehicles."""

import numpy as np

from app.missions.report.charts import overview
from app.missions.report.document import SVG, Block, Facts, Figure, Paragraph, Shown, Table, Text
from app.missions.report.texts import NONE
from app.missions.report.writer import Writer
from app.missions.states import ENDED


def purpose(w: Writer) -> list[Block]:
    """Return what the mission was for, and its main figures."""
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
    if w.is_search:
        found = "mission.progress.search"
        facts.append((t("fact_goal_seen"), w.number(f"{found}.goal_pct", 1, "%")))
        facts.append((t("fact_site_seen"), w.number(f"{found}.explored_pct", 1, "%")))
        facts.append((t("fact_obstacles_found"), w.number(f"{found}.found_cells")))
    if answers.at("mission.progress.pings"):
        facts.append((t("fact_pings"), w.number("mission.progress.pings")))
        facts.append((t("fact_beams"), w.number("mission.progress.beams")))
    if not w.is_swath:
        facts.append((t("fact_coverage"), w.share("mission.progress.coverage_pct")))
    else:
        # What beams met says nothing of how well it is known.
        facts.append((t("fact_ensonified"), w.share("mission.progress.ensonified_pct")))
        facts.append((t("fact_dense"), w.share("mission.progress.dense_pct")))
        facts.append((t("fact_holidays"), w.number("mission.progress.holidays")))
    return [*blocks, Facts(facts)]


def _range(w: Writer, low: str, high: str, decimals: int, unit: str) -> Shown:
    values = [w.answers.at(low), w.answers.at(high)]
    text = " – ".join(w.t.number(value, decimals) for value in values)
    return Shown(f"{text}\u00a0{unit}")


def place(w: Writer) -> list[Block]:
    """Return where it was, with an overview."""
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


def times(w: Writer) -> list[Block]:
    """Return when it was, and how long."""
    t = w.t
    return [
        Facts(
            [
                (t("fact_created"), w.moment("mission.created_at")),
                (t("fact_first"), w.moment("period.first_time_s")),
                (t("fact_last"), w.moment("period.last_time_s")),
                (t("fact_running"), w.number("mission.progress.elapsed_s", 0, "s")),
                *_length(w),
                (t("fact_steps"), w.number("mission.progress.step")),
                (t("fact_distance"), w.number("mission.progress.distance_m", 0, "m")),
            ]
        ),
        Paragraph(t("clocks")),
    ]


def _length(w: Writer) -> list[tuple[str, Text]]:
    """Return how long it was to be: by its budget, a search by its time window."""
    if w.is_search:
        return [
            (w.t("fact_window"), w.number("mission.spec.search.window_s", 0, "s")),
            (w.t("fact_window_left"), w.number("mission.progress.search.left_s", 0, "s")),
        ]
    budget = w.answers.at("mission.progress.budget")
    (name,) = [name for name in ("minutes", "km_per_vehicle", "steps") if budget.get(name) is not None]
    shown = w.number(f"mission.progress.budget.{name}", 0 if float(budget[name]).is_integer() else 1)
    return [(w.t(f"fact_budget_{name}"), shown)]


def vehicles(w: Writer) -> list[Block]:
    """Return who took part, with which sonars."""
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
            ]
        )
        place = described.get(vehicle["name"])
        if vehicle["sensor"] == "multibeam":
            sonar = None if place is None else f"mission.spec.vehicles.{place}.sonar"
            known = sonar is not None and answers.at(sonar) is not None
            # Nothing tells the sonar of a vehicle that joined later.
            otherwise = NONE if place is None else t("usual")
            columns = (("aperture_deg", 0, "°"), ("beams", 0, ""), ("rate_hz", 1, "Hz"), ("range_m", 0, "m"))
            cells: list[Text] = [
                w.number(f"{sonar}.{field}", decimals, unit) if known else otherwise
                for field, decimals, unit in columns
            ]
            sonars.append([w.string(f"{own}.name"), *cells])
    blocks: list[Block] = [
        Table(
            [t(f"column_{name}") for name in ("vehicle", "kind", "sensor", "flown", "on_plan", "risings")],
            rows,
            numbers=(3, 4, 5),
            caption=t("caption_vehicles"),
        )
    ]
    if sonars:
        columns_of = [t(f"column_{name}") for name in ("vehicle", "aperture", "beams", "rate", "range")]
        blocks.append(Table(columns_of, sonars, numbers=(1, 2, 3, 4), caption=t("caption_sonars")))
    return blocks
