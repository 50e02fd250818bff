"""Reports of surveys over REST: every number is that of the other answers, and names are shown as they are."""

import asyncio
import hashlib
import html.parser
import json
import math
import re
from collections import Counter
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import pypdfium2
import pytest

from app.main import Server
from app.mapping.quality.crossovers import warm_up
from app.missions.maps import snapshot
from app.missions.report.texts import DECIMAL_POINTS, Language
from app.settings import Settings
from tests.support.api.rest import mission_spec, running, soundings
from tests.support.children import new_children
from tests.support.mapping.tracks import flown, lawnmower, pinged
from tests.support.missions.specs import rectangle
from tests.support.waiting import until

START_S = 1_795_225_140.0
HOSTILE = '</title><script>alert(1)</script>{{7*7}} #eval("1") $x$ @a *b* \\ Ωж ' + "W" * 40
PROVIDER = {"organization": "<b>Instituto</b>", "email": "survey@example.org"}


@pytest.fixture(autouse=True, scope="module")
def compiled() -> None:
    warm_up()


@pytest.fixture
async def server(make_settings: Callable[..., Settings], tmp_path: Path) -> AsyncIterator[Server]:
    async with running(make_settings(pings_url=str(tmp_path / "pings"), provider=PROVIDER)) as server:
        yield server


class Page(html.parser.HTMLParser):
    """What a browser would see of a report."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: Counter[str] = Counter()
        self.shown: list[tuple[str, Any, str]] = []
        """Where REST has a value, the value, and how it is shown."""
        self.text = ""
        self.listing = ""
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self._open.append(tag)
        found = dict(attributes)
        assert not any(name.startswith("on") for name in found)
        assert (found.get("src") or "data:").startswith("data:")
        if tag == "data":
            self.shown.append((str(found["data-of"]), json.loads(str(found["value"])), ""))

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if "style" in self._open:
            return
        self.text += data
        if "pre" in self._open:
            self.listing += data
        if "data" in self._open:
            source, value, before = self.shown[-1]
            self.shown[-1] = (source, value, before + data)


async def new_mission(client: httpx.AsyncClient, **fields: Any) -> str:
    answer = await client.post("/missions", json=mission_spec(**({"area": rectangle(0, 0, 60, 60)} | fields)))
    assert answer.status_code == 201, answer.text
    return f"/missions/{answer.json()['id']}"


async def post(client: httpx.AsyncClient, path: str, items: list[dict[str, Any]]) -> dict[str, Any]:
    answer = await client.post(f"{path}/measurements", json={"items": items})
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


async def swath_survey(client: httpx.AsyncClient) -> str:
    """Swaths with a hole, and a crossline with a wrong roll; some of what was sent is refused."""
    vehicles = [{"name": "rover", "kind": "rest", "sensor": "multibeam", "sonar": {"beams": 11}}]
    path = await new_mission(client, name="Barra norte", cell_m=2, vehicles=vehicles, keep_out=[rectangle(2, 2, 8, 8)])
    lines = [(east + 4, north + 2) for east, north in lawnmower(52, 56, 4)]
    way = flown(lines, spacing_m=0.5, start_s=START_S)
    hole = (abs(way[:, 1] - 30) < 18) & (abs(way[:, 2] - 16) < 10)
    await post(client, path, pinged("rover", way[~hole]))
    across = flown([(1, 40.3), (59, 40.7)], spacing_m=0.5, start_s=START_S + 50_000.0)
    await post(client, path, pinged("rover", across, wrong_roll_deg=1.0))
    tide = {"level_m": 0.75, "sd_m": 0.04, "source": "gauge of <Leixões>", "datum_epsg": 5715}
    assert (await client.put(f"{path}/tide", json=tide)).status_code == 200
    speed = {"profile": [[0.0, 1512.3], [20.0, 1506.1]], "source": "cast 7"}
    assert (await client.put(f"{path}/sound-speed", json=speed | {"time": START_S})).status_code == 200
    later = {"profile": [[0.0, 1590.3], [20.0, 1586.1]], "time": START_S + 30_000.0, "position": [-8.7046, 41.1852]}
    assert (await client.put(f"{path}/sound-speed/casts/cast 8", json=later)).status_code == 200
    return path


async def single_beam_survey(client: httpx.AsyncClient) -> str:
    """One line without crossings, one sounding that its gate refuses, and a hostile name."""
    path = await new_mission(client, name=HOSTILE)
    far = {
        "vehicle": "rover",
        "time_s": START_S + 500,
        "lat_deg": 41.3,
        "lon_deg": -8.7,
        "depth_m": 2.0,
        "range_m": 8.0,
    }
    found = await post(client, path, [*soundings(40, start_s=START_S), far])
    assert found["rejected"] == 1
    return path


async def answers_of(client: httpx.AsyncClient, path: str) -> dict[str, Any]:
    """What REST says, by the names that reports have for it."""

    async def get(what: str, **params: Any) -> Any:
        answer = await client.get(f"{path}{what}", params=params)
        return answer.json() if answer.status_code == 200 else None

    pages = {
        state: await get("/soundings", state=state, limit=1000)
        for state in ("rejected", "doubted", "withdrawn", "restored")
    }
    unused = [item for state in ("rejected", "doubted", "withdrawn") for item in pages[state]["items"]]
    reasons = Counter(re.sub(r"-?\d+(\.\d+)?([eE][+-]?\d+)?", "#", item["reason"]) for item in unused)
    pings = await get("/pings")
    used = (await get("/soundings", state="used", limit=1000))["items"]
    times = [item["time_s"] for item in used] + [
        part[end] for part in pings["parts"] for end in ("first_time_s", "last_time_s")
    ]
    files = []
    for resource in ("map.tif", "soundings.csv", "tracks.geojson", "crossovers.csv", "holidays.geojson"):
        answer = await client.get(f"{path}/{resource}")
        if answer.status_code == 200:
            name = answer.headers["content-disposition"].split('"')[1]
            digest = hashlib.sha256(answer.content).hexdigest()
            files.append({"name": name, "size_bytes": len(answer.content), "sha256": digest})
    return {
        "mission": await get(""),
        "map": await get("/map"),
        "quality": await get("/quality"),
        "corrections": await get("/corrections"),
        "casts": await get("/sound-speed/casts"),
        "adjustment": await get("/adjustment"),
        "crosslines": await get("/crosslines"),
        "holidays": await get("/holidays"),
        "uncertainty_budget": await get("/uncertainty-budget"),
        "imports": await get("/imports"),
        "reference": await get("/reference"),
        "pings": pings,
        "period": {"first_time_s": min(times), "last_time_s": max(times)},
        "rejected": {state: page["total"] for state, page in pages.items()},
        "refusals": [{"reason": reason, "count": count} for reason, count in reasons.most_common()],
        "files": files,
    }


def looked_up(answers: Any, source: str) -> Any:
    found = answers
    for step in source.split("."):
        found = found[int(step)] if isinstance(found, list) else found[step]
    return found


def check_number(source: str, shown: str, value: float, language: Language) -> None:
    """A number is the value, rounded to the decimals that it is shown with; shares of cells and crossings down."""
    text = re.sub(r"[\u00a0 ].*|°$", "", shown).replace("\u202f", "").replace("−", "-")
    text = text.replace(DECIMAL_POINTS[language], ".")
    decimals = len(text.partition(".")[2])
    if source.endswith("_pct") and source != "crosslines.crosslines_pct":
        value = math.floor(round(value * 10**decimals, 6)) / 10**decimals
    assert float(text) == pytest.approx(value, abs=0.5 * 10**-decimals + 1e-9), (shown, value)


@pytest.mark.slow
@pytest.mark.parametrize("survey", [swath_survey, single_beam_survey])
async def test_every_number_is_that_of_rest(client: httpx.AsyncClient, survey: Callable[..., Any]) -> None:
    path = await survey(client)
    for language in Language:
        answer = await client.get(f"{path}/report.html", params={"lang": language})
        assert answer.status_code == 200, answer.text
        assert answer.headers["content-type"] == "text/html; charset=utf-8"
        assert re.search(r'filename="[a-z0-9-]+-report\.html"', answer.headers["content-disposition"])
        page, answers = Page(answer.text), await answers_of(client, path)
        assert len(page.shown) > 60
        for source, value, text in page.shown:
            assert looked_up(answers, source) == value, source
            if isinstance(value, float | int) and not source.startswith("period."):
                check_number(source, text, value, language)
        assert f'lang="{language}"' in answer.text[:60]
        printed = await client.get(f"{path}/report.pdf", params={"lang": language})
        assert printed.status_code == 200, printed.text
        letters = squeezed(pdf_text(printed.content))
        missing = {text for _, _, text in page.shown if squeezed(text) not in letters}
        assert not missing


def pdf_text(content: bytes) -> str:
    document = pypdfium2.PdfDocument(content)
    return "".join(document[number].get_textpage().get_text_bounded() for number in range(len(document)))


def squeezed(text: str) -> str:
    return re.sub(r"[\s\u200b\u202f\u00a0\ufffe\x02-]", "", text)


async def test_a_report_says_what_cannot_be_said(client: httpx.AsyncClient) -> None:
    path = await single_beam_survey(client)
    text = Page((await client.get(f"{path}/report.html")).text).text
    for words in (
        "The mission has not ended",
        "No order of S-44 is claimed",
        "No lines cross",
        "No water level was applied",
        "Soundings are of single beams",
        "No failsafe and no alarm",
        "lies more than # m outside the area",
    ):
        assert words in text
    assert "Beams of crosslines" not in text


async def test_a_swath_survey_lists_holidays_crosslines_and_corrections(client: httpx.AsyncClient) -> None:
    path = await swath_survey(client)
    page = Page((await client.get(f"{path}/report.html", params={"order": "special", "lang": "pt"})).text)
    count = (await client.get(path)).json()["progress"]["holidays"]
    assert count >= 1
    assert len([1 for source, *_ in page.shown if re.fullmatch(r"holidays\..*\.number", source)]) == count
    for words in ("Ordem Especial", "gauge of <Leixões>", "cast 7", "Incerteza vertical total", "Discrepantes"):
        assert words in page.text
    assert page.tags["img"] == 6


@pytest.mark.slow
async def test_what_beams_met_is_not_told_as_known_to_an_accuracy(client: httpx.AsyncClient) -> None:
    told = {}
    for survey in (swath_survey, single_beam_survey):
        path = await survey(client)
        page = Page((await client.get(f"{path}/report.html")).text)
        told[survey] = {source for source, *_ in page.shown}, "Area known to the accuracy asked for" in page.text
    sources, known = told[swath_survey]
    assert "mission.progress.ensonified_pct" in sources
    assert not known
    sources, known = told[single_beam_survey]
    assert "mission.progress.coverage_pct" in sources
    assert known


async def test_hostile_names_are_only_names(client: httpx.AsyncClient) -> None:
    path = await single_beam_survey(client)
    answer = await client.get(f"{path}/report.html")
    page = Page(answer.text)
    assert page.tags["script"] == page.tags["b"] == 0
    assert HOSTILE in page.text
    assert "default-src 'none'" in answer.text
    assert "http-equiv" in answer.text
    printed = (await client.get(f"{path}/report.pdf")).content
    document = pypdfium2.PdfDocument(printed)
    assert document.get_metadata_dict()["Title"] == f"Survey report: {HOSTILE}"
    assert document.get_metadata_dict()["Author"] == PROVIDER["organization"]
    letters = pdf_text(printed)
    assert squeezed(HOSTILE) in squeezed(letters)
    pages = len(document)
    assert pages >= 4
    assert f"Page {pages} / {pages}" in letters
    assert printed.count(b"/FontFile") >= 2
    await client.delete(path)


async def test_the_settings_make_the_same_mission_again(client: httpx.AsyncClient) -> None:
    path = await swath_survey(client)
    listed = json.loads(Page((await client.get(f"{path}/report.html")).text).listing)
    again = await client.post("/missions", json=listed)
    assert again.status_code == 201, again.text
    assert again.json()["spec"] == (await client.get(path)).json()["spec"]


async def test_reports_are_among_the_files(client: httpx.AsyncClient) -> None:
    path = await new_mission(client)
    listed = {product["name"]: product for product in (await client.get(f"{path}/products")).json()}
    for name in ("report.pdf", "report.html"):
        assert listed[name]["href"] == f"/api/v1{path}/{name}"
        assert listed[name]["needs_map"]
        early = await client.get(f"{path}/{name}")
        assert (early.status_code, early.json()["type"]) == (404, "urn:bathyfleet:problem:map-not-ready")
        wrong = await client.get(f"{path}/{name}", params={"lang": "xx"})
        assert wrong.status_code == 422
        assert wrong.json()["errors"][0]["field"] == "lang"


@pytest.mark.slow
async def test_reports_of_large_maps_end_with_their_client_and_tell_when_they_are_broken_off(
    server: Server, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(snapshot, "LARGE_CELLS", 1)
    path, making = await swath_survey(client), new_children()
    leaving = asyncio.create_task(client.get(f"{path}/report.html"))
    await until(making, "a process makes the report")
    (process,) = making()
    leaving.cancel()
    await until(lambda: process not in making(), "it has ended")
    await until(lambda: not making(), "nothing is left of it")
    staying = asyncio.create_task(client.get(f"{path}/map.tif"))
    await until(making, "a process makes the map")
    making()[0].kill()
    answer = await staying
    assert answer.status_code == 503
    assert answer.headers["retry-after"]
    assert answer.json()["type"].endswith("product-unavailable")
    assert "memory may be short" in answer.json()["detail"]
    assert (await client.get(f"{path}/map.tif")).status_code == 200
