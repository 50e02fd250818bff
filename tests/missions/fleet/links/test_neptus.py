"""Neptus' ConvCAO panel against the gateway: real FTP and HTTP, spoken as the unmodified panel does."""

import asyncio
import ftplib
import io
import json
import math
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.missions.fleet.links.neptus import GATHER_S, NeptusFleetLink, gateway_settings
from app.missions.operations.history import events_after
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.settings import NeptusSettings
from app.missions.spec.vehicle import VehicleKind
from app.missions.states import MissionState
from tests.support.missions.harbour import act, view_of
from tests.support.missions.stored_soundings import soundings_of
from tests.support.neptus.gateway import COLS, ROWS, SESSION, Gateway
from tests.support.waiting import until

MAX_DEPTH_M = 50.0
FIRST_DEPTH_M, SEPARATION_M = 1.5, 1.5


def bottom_m(row: float, col: float) -> float:
    return 12.0 + 0.05 * row + math.sin(col / 8.0)


@dataclass
class Panel:
    """The panel's side of the exchange, blocking as the panel is."""

    ftp_port: int
    http_port: int
    session: str = SESSION
    user: str = "FTPUser"
    password: str = "FTPUser123"  # noqa: S105 - what the panel's field is filled with
    places: list[tuple[float, float]] = field(default_factory=lambda: [(10.0, 10.0), (40.0, 30.0)])
    time_step: int = 1
    replies: list[str] = field(default_factory=list)
    flown: list[list[tuple[float, float]]] = field(default_factory=list)

    def ftp(self) -> ftplib.FTP:
        client = ftplib.FTP(timeout=20)  # noqa: S321 - the panel speaks nothing safer
        client.connect("127.0.0.1", self.ftp_port)
        try:
            client.login(self.user, self.password)
        except ftplib.Error:
            client.close()
            raise
        return client

    def upload(self, folder: str, name: str, content: bytes | dict[str, Any]) -> str:
        """One connection per file; what the server said in the end, which the panel never looks at."""
        data = content if isinstance(content, bytes) else json.dumps(content).encode()
        client = self.ftp()
        try:
            client.cwd(folder)
            return client.storbinary(f"STOR {name}", io.BytesIO(data))
        except ftplib.Error as error:
            return str(error)
        finally:
            client.close()

    def connect(self, sparse_map: bytes = b"2 2 0.5 0 0\n\n-1 -1 \n-1 19.5 \n") -> None:
        client = self.ftp()
        client.mkd(f"/NEPTUS/{self.session}")
        client.quit()
        self.replies.append(
            self.upload(
                "/NEPTUS",
                f"{self.session}.txt",
                {
                    "DateTime": "21/11/2026 10:00:00",
                    "SessionID": self.session,
                    "DemoMode": "1",
                    "AUVs": str(len(self.places)),
                },
            )
        )
        self.replies.append(self.upload(f"/NEPTUS/{self.session}", "mapPortoSparse.txt", sparse_map))

    def state(self, **changes: Any) -> dict[str, Any]:
        depths = [FIRST_DEPTH_M + SEPARATION_M * index for index in range(len(self.places))]
        heights = [MAX_DEPTH_M - depth for depth in depths]
        bottoms = [bottom_m(row, col) for row, col in self.places]
        samples = [
            (row + dr, col + dc, depth)
            for (row, col), depth in zip(self.places, depths, strict=True)
            for dr, dc in ((2, 0), (0, 2), (-2, 0), (0, -2))
            if 1 < row + dr < ROWS - 2 and 1 < col + dc < COLS - 2
        ]
        record = {
            "SessionID": self.session,
            "timeStep": self.time_step,
            "Bathymeter": [height - bottom for height, bottom in zip(heights, bottoms, strict=True)],
            "Location": [
                [float(round(row)), float(round(col)), float(int(height))]
                for (row, col), height in zip(self.places, heights, strict=True)
            ],
            "MBSamples": [bottom_m(row, col) for row, col, _ in samples],
            "SampleLocations": [list(sample) for sample in samples],
        }
        return record | changes

    def send(self, **changes: Any) -> str:
        return self.upload("/NEPTUS", f"{self.session}_Data.txt", self.state(**changes))

    def read(self) -> dict[str, Any] | None:
        url = f"http://127.0.0.1:{self.http_port}/caoagile/FilesFromAgent/NEPTUS/{self.session}_NewActions.txt"
        try:
            with urllib.request.urlopen(url, timeout=20) as answer:
                return json.loads(answer.readline())
        except urllib.error.HTTPError:
            return None

    async def fly(self) -> list[list[float]]:
        """Upload a step, poll for its answer as the panel does, go there."""
        reply = await asyncio.to_thread(self.send)
        assert reply.startswith("226"), reply
        return await self.await_answer()

    async def await_answer(self) -> list[list[float]]:
        answer: dict[str, Any] | None = None

        async def caught_up() -> bool:
            nonlocal answer
            answer = await asyncio.to_thread(self.read)
            return answer is not None and answer["timeStep"] >= self.time_step

        await until(caught_up, f"step {self.time_step} is answered")
        assert answer is not None
        assert answer["timeStep"] == self.time_step
        assert answer["SessionID"] == self.session
        self.time_step += 1
        self.places = [(place[0], place[1]) for place in answer["Location"]]
        self.flown.append(self.places)
        return answer["Location"]


def panel_of(gateway: Gateway, **changes: Any) -> Panel:
    ftp_port, http_port = gateway.ports
    return Panel(ftp_port, http_port, **changes)


async def test_an_unmodified_panel_maps_an_area_step_by_step(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    assert [reply[:3] for reply in panel.replies] == ["226", "226"]
    mission = await gateway.mission()
    assert mission.state is MissionState.READY
    assert [vehicle.name for vehicle in mission.vehicles] == [f"{SESSION}-1", f"{SESSION}-2"]
    before = panel.places
    for _ in range(6):
        answer = await panel.fly()
        assert all(0 <= row <= ROWS and 0 <= col <= COLS for row, col, _ in answer)
        assert [place[2] for place in answer] == pytest.approx([48.5, 47.0]), "heights, one layer for each vehicle"
        legs = [math.dist(a, b) for a, b in zip(before, panel.places, strict=True)]
        assert max(legs) <= 8.0 + 1.0, "within the largest step and the rounding of places"
        before = panel.places
    mission = await gateway.mission()
    assert mission.state is MissionState.RUNNING
    assert mission.progress.step == 6
    assert mission.progress.soundings >= 6 * 4
    assert mission.progress.rejected == 0
    built = (await newest_map(await gateway.service.get(mission.id), gateway.service.maps)).built.map
    area = gateway_settings(gateway.settings.neptus).conventions.area
    for row in await soundings_of(await gateway.service.get(mission.id)):
        cell = area.to_cells(row.lat_deg, row.lon_deg)
        assert row.depth_m == pytest.approx(bottom_m(*cell), abs=1e-3)
    assert np.nanmin(built.depth_m) > 8.0
    stops = (await act(gateway.service, mission.id, "finish", actor="tester")).stops
    assert not any(stop.acknowledged for stop in stops), "the panel cannot be stopped from here, and that is said"
    assert "press STOP" in stops[0].detail
    late = await asyncio.to_thread(panel.send)
    assert late.startswith("550"), late
    assert "the session's mission is finished: press STOP" in late


async def test_a_paused_mission_answers_nothing_and_a_resumed_one_goes_on(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    mission = await gateway.mission()
    await act(gateway.service, mission.id, "pause", actor="tester")
    there = panel.places
    assert (await asyncio.to_thread(panel.send)).startswith("226")
    await asyncio.sleep(GATHER_S * 2)
    answer = await asyncio.to_thread(panel.read)
    assert answer is not None
    assert answer["timeStep"] < panel.time_step, "the panel waits, and its vehicles stay where they are"
    await act(gateway.service, mission.id, "resume", actor="tester")
    await panel.await_answer()
    await panel.fly()
    assert panel.places != there


async def test_waypoints_are_sent_fetched_and_reached_in_that_order(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    mission = await gateway.mission()
    await until(lambda: _statuses(gateway, mission.id, {"acknowledged"}), "the answer counts as acknowledged")
    await asyncio.to_thread(panel.send)
    await panel.await_answer()
    rows = await _settled(gateway, mission.id, 1)
    assert rows == {"reached"}


async def _statuses(gateway: Gateway, mission_id: str, wanted: set[str]) -> bool:
    view = await view_of(gateway.service, mission_id)
    return {str(waypoint.status) for waypoint in view.waypoints} == wanted


async def _settled(gateway: Gateway, mission_id: str, step: int) -> set[str]:
    from app.storage.queries import missions as queries

    found: set[str] = set()

    async def there() -> bool:
        async with gateway.database.reading() as session:
            rows = await queries.waypoints_between(session, mission_id, step, step)
            found.clear()
            found.update(row.status for row in rows)
        return found == {"reached"}

    await until(there, f"step {step} is settled")
    return found


BAD: dict[str, Any] = {
    "no JSON": b"{",
    "other session": {"SessionID": "Neptus_User_1"},
    "a vehicle too few": {"Location": [[10.0, 10.0, 48.0]]},
    "a place outside": {"Location": [[10.0, 10.0, 48.0], [61.0, 10.0, 47.0]]},
    "no number": {"Location": [[10.0, 10.0, 48.0], [None, 10.0, 47.0]]},
    "step zero": {"timeStep": 0},
    "a step before": {"timeStep": 1},
    "samples without places": {"MBSamples": [1.0, 2.0], "SampleLocations": []},
}


async def test_bad_uploads_move_no_vehicle_and_say_why(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    await panel.fly()
    mission = await gateway.mission()
    answer, soundings = await asyncio.to_thread(panel.read), mission.progress.soundings
    for what, change in BAD.items():
        if isinstance(change, bytes):
            reply = await asyncio.to_thread(panel.upload, "/NEPTUS", f"{SESSION}_Data.txt", change)
        else:
            reply = await asyncio.to_thread(panel.send, **change)
        assert reply.startswith("550 "), (what, reply)
        assert await asyncio.to_thread(panel.read) == answer, what
    view = await gateway.mission()
    assert (view.progress.step, view.progress.soundings) == (2, soundings)
    assert len(await gateway.log("neptus-refused")) == len(BAD)
    # And a good one goes on.
    await panel.fly()
    assert (await gateway.mission()).progress.step == 3


async def test_a_start_in_the_panel_confirms_no_question_and_the_log_says_so(gateway: Gateway) -> None:
    gateway.service.settings = gateway.service.settings.model_copy(update={"checklist": ("Hatches closed",)})
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    mission = await gateway.service.get((await gateway.mission()).id)
    said = [line.message for line in await events_after(mission) if "before the start" in line.message]
    assert said == ["nobody confirmed before the start: Hatches closed"]


async def test_the_same_step_uploaded_twice_is_one_step(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    panel.time_step -= 1
    first = await asyncio.to_thread(panel.read)
    assert (await asyncio.to_thread(panel.send)).startswith("226")
    assert await asyncio.to_thread(panel.read) == first
    assert (await gateway.mission()).progress.step == 1


async def test_a_clock_that_is_set_loses_no_panel(gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    link, true_time = gateway.service.hub._links[VehicleKind.NEPTUS], time.time
    assert isinstance(link, NeptusFleetLink)
    monkeypatch.setattr(time, "time", lambda: true_time() + 100_000.0)
    assert not list(link._silent())
    assert max(info.age_s for info in link.vehicles() if info.age_s is not None) < 60.0
    mission = await gateway.mission()
    monkeypatch.undo()
    await act(gateway.service, mission.id, "abort")


OTHER_FILES = [
    ("/NEPTUS", "../../etc/passwd"),
    ("/NEPTUS", "..%2f..%2fetc.txt"),
    ("/NEPTUS", "/etc/cron.d/evil.txt"),
    ("/NEPTUS", "evil.sh"),
    ("/NEPTUS", "a" * 200 + ".txt"),
    ("/", f"{SESSION}.txt"),
    (f"/NEPTUS/{SESSION}", "sub/dir.txt"),
    ("/NEPTUS", "Neptus_User_9999_Data.txt"),
    ("/NEPTUS", "x\x00.txt"),
]


async def test_no_other_files_can_be_stored(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    for folder, name in OTHER_FILES:
        reply = await asyncio.to_thread(panel.upload, folder, name, b"{}")
        assert reply.startswith("55"), (name, reply)
    assert (await gateway.mission()).state is MissionState.READY


async def test_nothing_can_be_read_listed_or_deleted_and_no_folder_is_real(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)

    def try_everything() -> list[str]:
        client = panel.ftp()
        replies = []
        for command in (
            *(
                "LIST",
                "NLST",
                f"RETR /NEPTUS/{SESSION}.txt",
                f"DELE /NEPTUS/{SESSION}.txt",
                "RMD /NEPTUS",
                "APPE x.txt",
            ),
            *(
                "CWD /etc",
                "CWD /NEPTUS/../..",
                "MKD /NEPTUS/a/b",
                "MKD /etc/x",
                f"MKD /NEPTUS/{SESSION}",
                "SITE CHMOD 777 x",
            ),
            *("CWD /NEPTUS/Neptus_User_9", "MKD /NEPTUS/..", "STOU", "RNFR a"),
        ):
            try:
                replies.append(client.sendcmd(command))
            except ftplib.Error as error:
                replies.append(str(error))
        client.close()
        return replies

    replies = await asyncio.to_thread(try_everything)
    # "/NEPTUS/../.." is the root of a server that has nothing.
    assert [reply[0] for reply in replies] == ["2" if reply.startswith('250 "/"') else "5" for reply in replies]
    assert sum(reply.startswith("2") for reply in replies) <= 1


async def test_a_file_that_is_too_large_is_cut_off(gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("imc_bridge.neptus.ftp.MAX_FILE_BYTES", 100_000)
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)

    def too_much() -> str:
        try:
            return panel.upload("/NEPTUS", f"{SESSION}_Data.txt", b" " * 5_000_000)
        except OSError as error:
            return str(error)

    assert not (await asyncio.to_thread(too_much)).startswith("2")
    await panel.fly()


@pytest.mark.slow
async def test_with_tokens_only_an_operators_token_lets_a_panel_in(make_gateway: Callable[..., Gateway]) -> None:
    gateway = make_gateway()
    await gateway.open()
    try:
        store = TokenStore(gateway.database)
        _, operator = await store.create("deck", Role.OPERATOR)
        _, viewer = await store.create("shore", Role.VIEWER)
        other_id, other = await store.create("other", Role.OPERATOR)
        for password in ("FTPUser123", viewer, ""):
            with pytest.raises(ftplib.error_perm, match="530"):
                await asyncio.to_thread(panel_of(gateway, password=password).connect)
        panel = panel_of(gateway, password=operator)
        await asyncio.to_thread(panel.connect)
        stranger = panel_of(gateway, password=other)
        reply = await asyncio.to_thread(stranger.send)
        assert "belongs to someone else" in reply
        await panel.fly()
        await store.revoke(other_id)
        with pytest.raises(ftplib.error_perm, match="530"):
            await asyncio.to_thread(stranger.ftp)
        assert any("deck connected" in line for line in await gateway.log("neptus"))
    finally:
        await gateway.close()


async def test_answers_are_only_for_the_host_that_logged_in(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    url = f"http://127.0.0.1:{gateway.ports[1]}/caoagile/FilesFromAgent/NEPTUS/{SESSION}_NewActions.txt"

    def from_another_host() -> int:
        connection = socket.create_connection(("127.0.0.1", gateway.ports[1]), 10, source_address=("127.0.0.2", 0))
        with connection:
            connection.sendall(
                f"GET {url.removeprefix('http://127.0.0.1:' + str(gateway.ports[1]))} HTTP/1.1\r\n"
                "Host: x\r\nConnection: close\r\n\r\n".encode()
            )
            return int(connection.recv(4096).split()[1])

    assert await asyncio.to_thread(from_another_host) == 404
    assert await asyncio.to_thread(panel.read) is not None
    for path in ("/", "/caoagile/FilesFromAgent/NEPTUS/..%2F_NewActions.txt", "/caoagile/FilesFromAgent/NEPTUS/a.txt"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            await asyncio.to_thread(urllib.request.urlopen, f"http://127.0.0.1:{gateway.ports[1]}{path}")


@pytest.mark.slow
async def test_a_panel_that_waits_is_answered_after_a_restart(gateway: Gateway) -> None:
    panel = panel_of(gateway)
    await asyncio.to_thread(panel.connect)
    await panel.fly()
    await panel.fly()
    reply = await asyncio.to_thread(panel.send)
    assert reply.startswith("226")
    await gateway.close()
    await gateway.open()
    # It polls on: nobody pressed anything.
    await panel.await_answer()
    await panel.fly()
    mission = await gateway.mission()
    assert mission.state is MissionState.RUNNING
    assert mission.progress.step >= 3


@pytest.mark.slow
async def test_where_the_depth_the_panel_flies_at_is_not_safe_the_answer_is_to_stay(
    make_gateway: Callable[..., Gateway], monkeypatch: pytest.MonkeyPatch
) -> None:
    gateway = make_gateway(min_altitude_m=2.0, first_depth_m=4.0)
    await gateway.open()
    monkeypatch.setattr(f"{__name__}.FIRST_DEPTH_M", 4.0)
    try:
        panel = panel_of(gateway, places=[(30.0, 25.0)])
        await asyncio.to_thread(panel.connect)
        # 5 m of water everywhere: under a vehicle that flies at 4 m only 1 m is left.
        heights = [MAX_DEPTH_M - 4.0 - 5.0]
        cells = [[32.0, 25.0, 4.0], [28.0, 25.0, 4.0], [30.0, 27.0, 4.0], [30.0, 23.0, 4.0]]
        reply = await asyncio.to_thread(
            lambda: panel.send(Bathymeter=heights, MBSamples=[5.0] * 4, SampleLocations=cells)
        )
        assert reply.startswith("226")

        async def said() -> bool:
            return any("sends it at 4 m whatever it is told" in line for line in await gateway.log("waiting"))

        await until(said, "the log says why")
        assert (await panel.await_answer())[0][:2] == [30.0, 25.0], "it stays where it is"
        assert (await gateway.mission()).progress.step == 0, "which is no step"
    finally:
        await gateway.close()


@pytest.mark.parametrize(("use", "value", "depth"), [("depth", 19.5, 19.5), ("height", 38.0, 12.0)])
async def test_the_panels_sparse_map_is_used_as_it_was_set_up(
    make_gateway: Callable[..., Gateway], use: str, value: float, depth: float
) -> None:
    gateway = make_gateway(prior_map=use)
    await gateway.open()
    try:
        panel = panel_of(gateway)
        line = " ".join(["-1"] * (COLS - 2) + [str(value), "-1"])
        await asyncio.to_thread(panel.connect, f"{ROWS} {COLS} 1 0 0\n\n{chr(10).join([line] * ROWS)}\n".encode())
        await panel.fly()
        mission = await gateway.mission()
        rows = [r for r in await soundings_of(await gateway.service.get(mission.id)) if r.source == "neptus prior map"]
        assert len(rows) == ROWS
        assert {row.depth_m for row in rows} == {depth}
        assert {row.verdict for row in rows} == {"accepted"}
    finally:
        await gateway.close()


def test_the_gateway_is_off_and_needs_its_area_to_be_on() -> None:
    assert not NeptusSettings().enabled
    assert NeptusSettings().host == "127.0.0.1"
    with pytest.raises(ValueError, match="centre_lat_deg and centre_lon_deg"):
        NeptusSettings(enabled=True)


async def test_a_port_that_is_taken_stops_the_start_in_words(make_gateway: Callable[..., Gateway]) -> None:
    from imc_bridge import PortInUseError

    gateway = make_gateway()
    for index, kind in enumerate(("FTP", "HTTP")):
        with socket.create_server(("127.0.0.1", gateway.ports[index])):
            with pytest.raises(PortInUseError, match=f"cannot listen for {kind}"):
                await gateway.open()
            await gateway.close()
