"""The client beside a real service, over real sockets."""

import json
import threading
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
import rasterio

from app.main import Server
from app.missions.settings import ImcSettings
from app.settings import Settings
from bathyfleet.client import (
    AsyncClient,
    Client,
    ConflictError,
    EndedError,
    InvalidRequestError,
    NotFoundError,
    ProblemError,
    UnreachableError,
    models,
)
from tests.support.api.relay import Relay, relay_to
from tests.support.api.rest import mission_spec, running_in_thread, soundings
from tests.support.ports import free_ports
from tests.support.storage.databases import Databases

SIMULATED = [{"name": "a", "kind": "sim"}]


@pytest.fixture
def relay(server: Server) -> Iterator[Relay]:
    with relay_to(server.url) as relay:
        yield relay


@pytest.fixture(scope="module")
def survey(server: Server) -> str:
    """A survey that was flown, by its id."""
    with Client(server.url) as client:
        mission = client.create_mission(mission_spec(vehicles=SIMULATED, steps=3, name="Flown"))
        client.start_mission(mission.id, {"note": "by a program"})
        assert client.wait_for(mission.id, timeout_s=240, every_s=0.05).state == "finished"
        return mission.id


def test_a_mission_can_be_described_with_classes_and_as_in_json(client: Client) -> None:
    described = mission_spec(name="By classes")
    spec = models.MissionSpec(
        name=described["name"],
        area=models.PolygonGeometry(**described["area"]),
        steps=3,
        cell_m=2.0,
        vehicles=[models.VehicleSpec(name="rover", kind="rest", depth_m=3.0)],
        planner=models.PlannerSpec(name="random"),
    )
    made = client.create_mission(spec)
    assert made.state == "ready"
    assert made.spec.vehicles is not None
    assert made.spec.vehicles[0].depth_m == 3.0
    same = client.create_mission(described | {"vehicles": [models.VehicleSpec(name="rover", kind="rest", depth_m=3.0)]})
    assert same.spec == made.spec
    assert {made.id, same.id} <= {mission.id for mission in client.list_missions()}
    client.delete_mission(made.id)
    with pytest.raises(NotFoundError) as refused:
        client.get_mission(made.id)
    assert (refused.value.kind, refused.value.status) == ("mission-not-found", 404)


def test_wrong_fields_are_in_the_exception(client: Client) -> None:
    with pytest.raises(InvalidRequestError) as refused:
        client.create_mission(mission_spec(steps=0, limits={"max_step": 3.0}))
    wrong = {error.field: error for error in refused.value.errors}
    assert wrong["steps"].value == 0
    assert wrong["steps"].expected in str(refused.value)
    assert "limits.max_step" in wrong
    assert "steps: " in str(refused.value)


def test_what_the_state_does_not_allow_is_a_conflict(client: Client) -> None:
    mission = client.create_mission(mission_spec())
    with pytest.raises(ConflictError, match="ready") as refused:
        client.resume_mission(mission.id)
    assert refused.value.kind == "move-refused"
    client.delete_mission(mission.id)


def test_an_answer_that_is_no_document_is_raised_all_the_same(client: Client, server: Server) -> None:
    other = httpx.Response(502, text="<h1>Bad gateway</h1>", request=httpx.Request("GET", server.url))
    with Client(server.url, patience_s=0) as impatient:
        impatient._http = httpx.Client(transport=httpx.MockTransport(lambda _: other), base_url=server.url)
        with pytest.raises(ProblemError, match="Bad Gateway: <h1>Bad gateway</h1>") as refused:
            impatient.get_health()
    assert refused.value.status == 502


def test_a_wait_ends_when_it_cannot_come_or_takes_too_long(client: Client) -> None:
    mission = client.create_mission(mission_spec())
    assert client.wait_for(mission.id, "ready", "running").id == mission.id
    with pytest.raises(TimeoutError, match="is still ready after 0"):
        client.wait_for(mission.id, timeout_s=0.05, every_s=0.02)
    client.abort_mission(mission.id)
    assert client.wait_for(mission.id).state == "aborted"
    with pytest.raises(EndedError, match="is aborted, not finished"):
        client.wait_for(mission.id, "finished")


def test_the_log_comes_whole_over_a_line_that_is_cut(client: Client, relay: Relay, survey: str) -> None:
    with Client(relay.url) as distant:
        read = []
        for entry in distant.events(survey, until_ended=True):
            read.append(entry)
            if len(read) % 3 == 0:
                relay.cut()
    stored = client.get_events(survey)
    assert any(entry.message.endswith("by a program") for entry in stored)
    ended = next(i for i, entry in enumerate(stored) if entry.data.get("state") == "finished")
    assert read == stored[: ended + 1]
    assert next(iter(client.events(survey, after=stored[-2].id))) == stored[-1]
    before, end = stored[ended - 1].id, stored[ended]
    assert list(client.events(survey, after=before, until_ended=True)) == [end]
    assert list(client.events(survey, after=end.id, until_ended=True)) == stored[ended + 1 :]


def test_what_is_posted_over_a_line_that_loses_answers_is_stored_once(client: Client, relay: Relay) -> None:
    mission = client.create_mission(mission_spec())
    relay.answers_to_lose = 2
    with Client(relay.url) as distant:
        verdict = distant.send_measurements(mission.id, soundings(12), batch=5)
    assert [item.index for item in verdict.items] == list(range(12))
    assert (verdict.accepted, verdict.duplicate, verdict.replayed) == (12, 0, True)
    assert client.get_mission(mission.id).progress.soundings == 12
    client.abort_mission(mission.id)


def test_what_is_no_number_is_refused_and_not_sent_as_if_it_were_left_out(client: Client) -> None:
    mission = client.create_mission(mission_spec())
    slanted = soundings(1)[0] | {"beam_off_nadir_deg": float("nan")}
    for item in (slanted, models.Measurement(**slanted)):
        (verdict,) = client.send_measurements(mission.id, [item]).items
        assert (verdict.verdict, verdict.reason.partition(":")[0]) == ("rejected", "beam_off_nadir_deg")
    with pytest.raises(InvalidRequestError, match="finite"):
        client.create_mission(models.MissionSpec(**mission_spec(), accuracy_m=float("nan")))
    client.abort_mission(mission.id)


def test_what_may_have_been_done_is_not_done_again(client: Client, relay: Relay) -> None:
    relay.answers_to_lose = 1
    with Client(relay.url) as distant, pytest.raises(UnreachableError, match="has to be looked up"):
        distant.create_mission(mission_spec(name="Only once"))
    made = [mission.id for mission in client.list_missions() if mission.name == "Only once"]
    assert len(made) == 1
    client.delete_mission(made[0])


def test_where_nobody_answers_patience_ends() -> None:
    (port,) = free_ports(1)
    with (
        Client(f"http://127.0.0.1:{port}", patience_s=0.3) as client,
        pytest.raises(UnreachableError, match=r"in 0\.3 s"),
    ):
        client.list_missions()


def test_batches_have_a_size_that_is_taken(client: Client) -> None:
    with pytest.raises(ValueError, match="0 is not from 1 to 10000"):
        client.send_measurements("m", soundings(1), batch=0)


@pytest.mark.parametrize("address", ["boat:8080", "ftp://boat", "", "http://"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(ValueError, match="address"):
        Client(address)


@pytest.mark.parametrize("token", ["secret\n", "", "two secrets", "secreté"])
def test_a_token_that_no_header_can_show_is_refused_without_telling_it(token: str) -> None:
    for kind in (Client, AsyncClient):
        with pytest.raises(ValueError, match=r"^token: ") as refused:
            kind(token=token)
        assert "secret" not in str(refused.value)


@pytest.mark.slow
def test_a_command_that_was_one_too_many_is_given_again_when_there_is_room(databases: Databases) -> None:
    settings = Settings(port=0, database_url=databases.fresh(), imc=ImcSettings(enabled=False), max_requests_per_s=0.5)
    with running_in_thread(settings) as server, Client(server.url) as client:
        mission = client.create_mission(mission_spec())
        for number in range(2):
            client.write_note(mission.id, {"text": f"buoy {number}"})
        told = [entry.message for entry in client.get_events(mission.id) if "buoy" in entry.message]
    assert [message.rpartition(" ")[2] for message in told] == ["0", "1"]


def test_an_address_is_taken_with_the_interface_s_path_too(server: Server) -> None:
    for path in ("/", "/api/v1", "/api/v1/"):
        with Client(f"{server.url}{path}") as client:
            assert client.get_health().status
            with pytest.raises(NotFoundError, match="mission"):
                next(iter(client.live("nowhere")))


def test_pages_of_a_listing_come_one_after_the_other(client: Client) -> None:
    mission = client.create_mission(mission_spec())
    client.send_measurements(mission.id, soundings(5))
    client.write_note(mission.id, {"text": "buoy in sight"})
    entries = client.get_events(mission.id)
    by_one = [entry for page in client.pages(client.get_events, mission.id, limit=1) for entry in page]
    assert (len(entries) > 1, by_one) == (True, entries)
    pages = list(client.pages(client.list_soundings, mission.id, state=["used"], limit=2))
    assert [len(page.items) for page in pages] == [2, 2, 1]
    assert [len(page.id) for page in client.pages(client.list_sounding_points, mission.id, limit=3)] == [3, 2]
    audit = [entry.id for page in client.pages(client.list_audit, mission=mission.id, limit=1) for entry in page]
    assert audit == [entry.id for entry in client.list_audit(mission=mission.id)]
    assert list(client.pages(client.list_steps, mission.id)) == [[]]
    client.create_mission(mission_spec())
    listed = [found.id for page in client.pages(client.list_missions, limit=1) for found in page]
    assert (len(listed) > 1, listed) == (True, [found.id for found in client.list_missions()])
    client.abort_mission(mission.id)


def test_the_map_is_an_array_with_places(client: Client, survey: str) -> None:
    answer = client.get_map(survey)
    with client.map(survey, order="special") as found:
        depth = np.array(answer.depth_m, dtype=float)
        assert found["depth"].dims == ("y", "x")
        np.testing.assert_allclose(found["depth"].values, depth, atol=0.01)
        assert found["depth"].attrs["units"] == "m"
        assert found.x.values[0] == pytest.approx(answer.west_m + answer.cell_m / 2)
        north_west = answer.corners[0]
        assert float(found.lat.max()) == pytest.approx(north_west[1], abs=3e-5)


def test_a_map_that_is_not_there_yet_is_said_so(client: Client) -> None:
    mission = client.create_mission(mission_spec())
    with pytest.raises(NotFoundError) as refused:
        client.map(mission.id)
    assert refused.value.kind == "map-not-ready"
    client.delete_mission(mission.id)


def test_a_file_is_there_when_it_is_complete(client: Client, survey: str, tmp_path: Path) -> None:
    path = client.download(survey, "map.tif", tmp_path / "map.tif", order="special")
    with rasterio.open(path) as picture:
        assert picture.width == client.get_map(survey).cols
    before = path.read_bytes()
    with pytest.raises(NotFoundError):
        client.download(survey, "map.wav", path)
    assert path.read_bytes() == before
    client.download(survey, "tracks.geojson", str(tmp_path / "tracks.geojson"))
    assert json.loads((tmp_path / "tracks.geojson").read_text())["type"] == "FeatureCollection"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["map.tif", "tracks.geojson"]


def test_live_messages_come_typed_and_begin_anew_after_a_cut(client: Client, relay: Relay) -> None:
    mission = client.create_mission(mission_spec())
    with Client(relay.url) as distant:
        messages = distant.live(mission.id)
        first = next(messages)
        assert isinstance(first, models.SnapshotMessage)
        assert first.mission.id == mission.id
        relay.cut()
        assert isinstance(next(message for message in messages if message.type == "snapshot"), models.SnapshotMessage)
        noted = threading.Thread(target=client.write_note, args=(mission.id, {"text": "buoy in sight"}))
        noted.start()
        event = next(message for message in messages if isinstance(message, models.EventMessage))
        noted.join()
        assert event.event.message.endswith("buoy in sight")
        messages.close()


def test_live_messages_of_no_mission_are_refused(client: Client) -> None:
    with pytest.raises(NotFoundError) as refused:
        next(iter(client.live("nowhere")))
    assert refused.value.kind == "mission-not-found"


def test_small_answers_are_as_typed(client: Client, survey: str) -> None:
    assert {planner.name for planner in client.list_planners()} >= {"cao", "random"}
    assert client.get_map_overlay(survey, layer="depth").startswith(b"\x89PNG")
    assert client.get_metrics().startswith("#")
    assert isinstance(client.get_health(), models.ComponentHealth)
    assert client.get_quality(survey).tvu[0].statement
