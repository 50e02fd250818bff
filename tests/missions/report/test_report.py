"""Reports of missions as they come: flown, under way, with more than there is room for, in many at the same time."""

import asyncio
import copy
import json
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from html import unescape

import numpy as np
import pypdfium2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.missions.clock import now
from app.missions.errors import MapNotReadyError
from app.missions.live.mission import LiveMission
from app.missions.operations import reports
from app.missions.operations.corrections.recorrection import set_mounting
from app.missions.operations.measurements import measure
from app.missions.operations.reports import ReportOptions
from app.missions.report import contents
from app.missions.report.answers import Incident
from app.missions.report.charts import ticks
from app.missions.report.kinds import REPORTS
from app.missions.report.listing import listing
from app.missions.report.page import html
from app.missions.report.print import pdf
from app.missions.report.sections.maps import MOST_HOLIDAYS
from app.missions.report.texts import Language, Texts
from app.missions.settings import ServiceSettings
from app.missions.soundings.measurement import Measurement
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.vehicle import VehicleSpec
from tests.support.mapping.tracks import flown, lawnmower, measured
from tests.support.missions.harbour import Harbour, act, sim_spec
from tests.support.missions.searches import search_spec
from tests.support.missions.specs import make_spec
from tests.support.waiting import until

JAPANESE = "港湾測量 — порт \u202egnp.exe"


@pytest.fixture
async def harbour(make_settings: Callable[..., ServiceSettings]) -> AsyncIterator[Harbour]:
    harbour = Harbour(lambda **changes: make_settings(**({"time_scale": 20.0} | changes)))
    await harbour.open()
    yield harbour
    await harbour.close()


@pytest.fixture
async def live(harbour: Harbour) -> LiveMission:
    """Some lines of one vehicle."""
    mission = await harbour.service.create(make_spec(name=JAPANESE))
    live = await harbour.service.get(mission.id)
    way = flown([(east + 3, north + 3) for east, north in lawnmower(24, 24, 8)], start_s=1_795_225_140.0, spacing_m=2.0)
    await measure(live, [Measurement.model_validate(item) for item in measured("a", way)])
    return live


def text_of(content: bytes) -> str:
    document = pypdfium2.PdfDocument(content)
    return "".join(document[number].get_textpage().get_text_bounded() for number in range(len(document)))


@pytest.mark.slow
async def test_what_there_is_no_room_for_is_counted(harbour: Harbour, live: LiveMission) -> None:
    answers = await harbour.service.reports.answers(live)
    place = {"number": 1, "area_m2": 9.0, "lat_deg": 41.0, "lon_deg": -8.0}
    rest = copy.deepcopy(dict(answers.rest))
    rest["holidays"] = {"features": [{"properties": place | {"number": n + 1}} for n in range(500)]}
    rest["refusals"] = [{"reason": "why " * 200, "count": 3}] * 60
    storm = Incident(
        "2026-11-21T03:39:00+00:00", "alarm", "failsafe", "leak", "surface", "a: it reports: " + "w" * 2000
    )
    many = replace(answers, rest=rest, incidents=[storm] * 400)
    document = contents.document_of(many, Texts(Language.EN))
    page = html(document).decode()
    assert page.count('data-of="holidays.features.') == 4 * MOST_HOLIDAYS
    assert "400 more are in holidays.geojson." in page
    assert "250 more are not listed." in page
    printed = text_of(pdf(document))
    assert "400 more are in holidays.geojson." in printed.replace("\r\n", " ")


@pytest.mark.slow
async def test_the_sonar_of_a_vehicle_that_joined_later_is_not_said_to_be_the_usual_one(
    harbour: Harbour, live: LiveMission
) -> None:
    sonar = {"name": "later", "kind": "rest", "sensor": "multibeam", "sonar": {"aperture_deg": 60}}
    await harbour.service.team_changes.join(live, VehicleSpec.model_validate(sonar), actor="operator")
    answers = await harbour.service.reports.answers(live)
    page = html(contents.document_of(answers, Texts(Language.PT))).decode()
    assert "later" in page
    assert "predefinido" not in page


async def test_a_report_tells_of_a_mounting_that_was_corrected_and_does_not_say_that_vehicles_state_it(
    harbour: Harbour, live: LiveMission
) -> None:
    async def page(language: Language) -> str:
        answers = await harbour.service.reports.answers(live)
        return unescape(html(contents.document_of(answers, Texts(language))).decode())

    as_stated = {Language.EN: "no patch test is part of this report", Language.PT: "nenhum teste de calibração"}
    before = await page(Language.EN)
    assert as_stated[Language.EN] in before
    assert "Mounting of a" not in before
    mounting = MountingSpec(roll_deg=-0.42, latency_s=0.15, offset_m=(0.6, 0.0, 0.12), source="patch test")
    await set_mounting(live, "a", mounting, "Ana")
    for language, roll in ((Language.EN, "Mounting of a: roll (starboard down)"), (Language.PT, "Montagem de a")):
        after = await page(language)
        assert roll in after
        assert as_stated[language] not in after
    after = await page(Language.EN)
    for value in ("\u22120.42°", "+0.150\u00a0s", "+0.60\u00a0m", "+0.12\u00a0m"):
        assert f">{value}<" in after
    assert "Mounting of a: pitch" not in after
    assert "were corrected by the operator for a" in after


async def test_nearly_all_is_not_said_to_be_all(harbour: Harbour, live: LiveMission) -> None:
    answers = await harbour.service.reports.answers(live)
    rest = copy.deepcopy(dict(answers.rest))
    rest["mission"]["progress"]["coverage_pct"] = 94.97
    for share in rest["quality"]["tvu"]:
        share["cells_pct"] = share["sounded_pct"] = 99.96
    page = html(contents.document_of(replace(answers, rest=rest), Texts(Language.EN))).decode()
    assert [page.count(text) for text in ("94.9\u00a0%", "95.0\u00a0%")] == [2, 0]
    assert page.count("99.9\u00a0%") == 2 * len(rest["quality"]["tvu"])
    assert "100.0\u00a0%" not in page


async def test_letters_of_other_languages_stay_and_marks_that_turn_the_writing_are_shown(
    harbour: Harbour, live: LiveMission
) -> None:
    for kind in REPORTS.values():
        product = await harbour.service.reports.report(live, ReportOptions(kind, Language.PT))
        text = (
            text_of(product.content.whole()) if kind.extension == "pdf" else unescape(product.content.whole().decode())
        )
        assert "港湾測量 — порт \\u202egnp.exe" in text
        assert "\u202e" not in text


@pytest.mark.slow
async def test_a_report_is_made_once_for_all_who_ask_and_is_the_same_for_the_same_answers(
    harbour: Harbour, live: LiveMission
) -> None:
    made: list[int] = []
    kind = replace(REPORTS["pdf"], make=lambda document: _counted(made, pdf(document)))
    options = ReportOptions(kind)
    found = await asyncio.gather(*(harbour.service.reports.report(live, options) for _ in range(5)))
    assert len(made) == 1
    assert len({product.content.whole() for product in found}) == 1
    answers = await harbour.service.reports.answers(live)
    one, other = (pdf(contents.document_of(answers, Texts(Language.EN))) for _ in range(2))
    assert one == other


async def test_a_report_is_the_same_after_a_restart(
    harbour: Harbour, live: LiveMission, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It showed how sure positions were last, and how many maps were made, which the service that ran alone knew."""
    moment = now()
    monkeypatch.setattr(reports, "now", lambda: moment)
    more = measured("a", flown([(3, 12.3), (27, 12.6)], start_s=1_795_235_140.0, spacing_m=2.0))
    await measure(live, [Measurement.model_validate(item | {"position_sd_m": 0.7}) for item in more])
    options = ReportOptions(REPORTS["html"])
    before = (await harbour.service.reports.report(live, options)).content.whole()
    service = await harbour.reopen()
    again = await service.get(live.id)
    assert (await service.reports.report(again, options)).content.whole() == before


@pytest.mark.slow
async def test_a_mission_under_way_has_a_report_of_what_is_known(harbour: Harbour) -> None:
    mission = await harbour.service.create(sim_spec("a", steps=40))
    live = await harbour.service.get(mission.id)
    with pytest.raises(MapNotReadyError):
        await harbour.service.reports.report(live, ReportOptions(REPORTS["html"]))
    await act(harbour.service, mission.id, "start")

    async def sounded() -> bool:
        return live.journal.counts.accepted > 20

    await until(sounded, "something was sounded")
    page = (await harbour.service.reports.report(live, ReportOptions(REPORTS["html"]))).content.whole().decode()
    assert "The mission has not ended" in page
    assert "Files are not summed" in page
    assert "data:image/svg+xml" in page
    await act(harbour.service, mission.id, "abort")


async def test_a_report_of_a_search_tells_what_was_looked_at_and_by_when_all_had_to_be_back(harbour: Harbour) -> None:
    mission = await harbour.service.create(search_spec(vehicles=[{"name": "a", "kind": "rest", "depth_m": 0}]))
    live = await harbour.service.get(mission.id)
    way = flown([(5.0, 5.0), (20.0, 5.0)], start_s=1_795_225_140.0, spacing_m=1.0)
    await measure(live, [Measurement.model_validate(item) for item in measured("a", way)])
    answers = await harbour.service.reports.answers(live)
    page = html(contents.document_of(answers, Texts(Language.EN))).decode()
    for figure in ("goal_pct", "explored_pct", "found_cells", "left_s"):
        assert f'data-of="mission.progress.search.{figure}"' in page
    assert "4000" in page.split("Time window")[1][:200]
    # Nobody asked for a number of steps: a search is as long as its time window.
    assert "Length asked for" not in page


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
        lambda inner: st.lists(inner, max_size=30) | st.dictionaries(st.text(), inner, max_size=5),
        max_leaves=60,
    )
)
def test_a_listing_is_the_json_that_it_lists(value: object) -> None:
    assert json.loads(listing(value)) == value


@given(st.floats(-1e5, 1e5), st.floats(1e-3, 1e5), st.integers(2, 9))
def test_ticks_are_few_round_and_within(low: float, span: float, most: int) -> None:
    found = ticks(low, low + span, most)
    assert len(found) <= most + 1
    assert np.all((found >= low - 1e-6 * span) & (found <= low + span + 1e-6 * span))


def _counted(made: list[int], content: bytes) -> bytes:
    made.append(1)
    return content
