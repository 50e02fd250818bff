"""The gateway against a panel that behaves as the real one did in the first trials."""

import asyncio
import ftplib
import logging
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from app.missions.maps.builder import make_grid
from app.missions.states import MissionState
from app.missions.views.measurements.soundings import Verdict
from imc_bridge.neptus import SessionRefusedError, protocol
from tests.support.missions.harbour import act
from tests.support.missions.stored_soundings import soundings_of
from tests.support.neptus.gateway import COLS, ROWS, SESSION, Gateway
from tests.support.neptus.panel import ALTIMETER, DVL, FORWARD, NEAR_M, Auv, RealPanel
from tests.support.waiting import until

SOON_S = 0.3


def floor_m(row: float, col: float) -> float:
    return 12.0 + 0.05 * row + math.sin(col / 8.0)


def two(**changes: Any) -> list[Auv]:
    return [Auv(20.0, 20.0, 1.5, **changes), Auv(40.0, 30.0, 3.0, **changes)]


@contextmanager
def flying(panel: RealPanel, steps: int) -> Iterator[threading.Thread]:
    """The panel's thread, as START begins it; ended whatever happens."""
    thread = threading.Thread(target=panel.start, args=(steps,), name="panel")
    thread.start()
    try:
        yield thread
    finally:
        panel.stop()
        thread.join(60)
        panel.close()


async def fly(gateway: Gateway, panel: RealPanel, steps: int) -> None:
    """Connect, START, and so many answers."""
    await asyncio.to_thread(panel.connect)
    with flying(panel, steps) as thread:
        await until(lambda: not thread.is_alive(), f"{steps} answers came")
    assert len(panel.answers) == steps


async def soundings(gateway: Gateway) -> list[tuple[Any, float]]:
    """Every sounding of the mission with its error."""
    mission = await gateway.mission()
    area = gateway.service_area()
    rows = await soundings_of(await gateway.service.get(mission.id))
    return [(row, row.depth_m - floor_m(*area.to_cells(row.lat_deg, row.lon_deg))) for row in rows]


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 5.0])
async def test_two_vehicles_are_led_through_an_area(make_gateway: Callable[..., Gateway], scale: float) -> None:
    gateway = make_gateway()
    await gateway.open()
    try:
        await fly(gateway, gateway.real(floor_m, two(), scale=scale), 12)
        mission = await gateway.mission()
        assert mission.state is MissionState.RUNNING
        assert mission.progress.step >= 2
        accepted = [(row, error) for row, error in await soundings(gateway) if row.verdict == Verdict.ACCEPTED]
        errors = [error for _, error in accepted]
        assert len(errors) > 100
        assert abs(sum(errors) / len(errors)) < 0.05
        # The panel sends whole metres of a vehicle's depth and whole cells of its place beside its Bathymeter.
        rounded = [row.source == "neptus bathymeter" for row, _ in accepted]
        assert max(abs(error) for error, whole in zip(errors, rounded, strict=True) if not whole) < 0.5
        assert max(abs(error) for error, whole in zip(errors, rounded, strict=True) if whole) < 1.2
        refused = {row.reason for row, _ in await soundings(gateway) if row.verdict != Verdict.ACCEPTED}
        assert refused == set()
    finally:
        await gateway.close()


async def test_after_start_nobody_is_asked_to_press_it(gateway: Gateway) -> None:
    await fly(gateway, gateway.real(floor_m, two()), 2)
    said = await gateway.log("vehicle")
    assert sorted(said) == [f"{SESSION}-1 follows", f"{SESSION}-2 follows"]


async def test_distances_of_other_sensors_are_no_soundings(gateway: Gateway) -> None:
    panel = gateway.real(floor_m, two(sensors=(*DVL, FORWARD)))
    await fly(gateway, panel, 8)
    found = await soundings(gateway)
    assert max(abs(error) for _, error in found) < 1.0, "a forward echo sounder's range is no depth"
    assert {row.verdict for row, _ in found} == {Verdict.ACCEPTED}, "and takes no true sounding with it"
    lines = await gateway.log("neptus")
    assert any("other than the Bathymeter" in line for line in lines), lines


async def test_where_every_sample_is_refused_the_bathymeter_counts(gateway: Gateway) -> None:
    panel = gateway.real(floor_m, [Auv(20.0, 20.0, 1.5, sensors=(FORWARD,)), Auv(40.0, 30.0, 3.0)])
    await fly(gateway, panel, 4)
    found = await soundings(gateway)
    sources = {(row.vehicle, row.source) for row, _ in found}
    assert (f"{SESSION}-1", "neptus bathymeter") in sources
    assert (f"{SESSION}-2", "neptus DVL") in sources
    # Whose a sample is follows from where it lies: vehicles that pass each other may be mixed up, depths may not.
    assert max(abs(error) for _, error in found) < 1.2


async def test_a_setting_leaves_all_samples_out(make_gateway: Callable[..., Gateway]) -> None:
    gateway = make_gateway(samples="off")
    await gateway.open()
    try:
        await fly(gateway, gateway.real(floor_m, two(sensors=(ALTIMETER,))), 4)
        found = await soundings(gateway)
        assert {row.source for row, _ in found} == {"neptus bathymeter"}
        assert max(abs(error) for _, error in found) < 1.0
    finally:
        await gateway.close()


async def test_samples_that_are_all_short_as_an_altimeters_are_warned_of(gateway: Gateway) -> None:
    panel = gateway.real(floor_m, two(sensors=(ALTIMETER,)))
    await fly(gateway, panel, 14)  # five of them with samples are enough
    warnings = await gateway.log("neptus-samples")
    assert len(warnings) == 2, "once for each vehicle"
    assert "neptus.samples" in warnings[0]


@pytest.mark.slow
async def test_where_no_depth_is_safe_the_vehicles_stay_and_the_panel_is_answered(
    make_gateway: Callable[..., Gateway],
) -> None:
    gateway = make_gateway(first_depth_m=4.0, min_altitude_m=2.0)
    await gateway.open()
    try:
        auvs = [Auv(30.0, 25.0, 4.0)]
        panel = gateway.real(lambda _row, _col: 5.0, auvs, pace=20.0)
        await fly(gateway, panel, 4)
        assert max(math.dist(place[:2], (30.0, 25.0)) for answer in panel.answers for place in answer) < NEAR_M
        assert any("sends it at 4 m whatever it is told" in line for line in await gateway.log("waiting"))
        assert (await gateway.mission()).progress.step == 0, "nobody flew a step"
    finally:
        await gateway.close()


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 5.0])
async def test_a_lost_or_refused_upload_does_not_hang_the_panel(
    make_gateway: Callable[..., Gateway], scale: float
) -> None:
    gateway = make_gateway(repeat_after_s=SOON_S)
    await gateway.open()
    try:
        panel = gateway.real(floor_m, two(), scale=scale, lost=frozenset({1, 4, 5}), spoilt=frozenset({7}))
        await fly(gateway, panel, 10)
        assert panel.answers[0] == [], "without any place of theirs vehicles stay where they are"
        assert panel.answers[3] == panel.answers[4] == panel.answers[2]
        assert panel.answers[6] == panel.answers[5]
        assert (await gateway.mission()).state is MissionState.RUNNING
        lines = await gateway.log("neptus-repeat")
        assert [line.split(",")[0].rsplit(" ", 1)[1] for line in lines] == ["1", "4", "5", "7"]
    finally:
        await gateway.close()


@pytest.mark.slow
@pytest.mark.parametrize("lost", [frozenset[int](), frozenset({4})], ids=["taken", "lost"])
async def test_a_panel_that_waits_goes_on_after_our_restart(
    make_gateway: Callable[..., Gateway], lost: frozenset[int]
) -> None:
    gateway = make_gateway(repeat_after_s=2.0)
    await gateway.open()
    panel = gateway.real(floor_m, two(), lost=lost)
    await asyncio.to_thread(panel.connect)
    try:
        with flying(panel, 8) as thread:
            await until(
                lambda: panel.time_step >= 4 and len(panel.uploads) >= 4, "the fourth step was uploaded or lost"
            )
            await gateway.close()
            polls = panel.polls
            await until(lambda: panel.polls > polls + 20, "it polls a dead service")
            await gateway.open()
            await until(lambda: not thread.is_alive(), "the panel goes on")
        assert len(panel.answers) == 8
        mission = await gateway.mission()
        assert mission.state is MissionState.RUNNING
        assert mission.progress.rejected == 0
    finally:
        await gateway.close()


@pytest.mark.slow
async def test_nobody_is_led_on_after_the_mission(make_gateway: Callable[..., Gateway]) -> None:
    gateway = make_gateway(repeat_after_s=SOON_S)
    await gateway.open()
    try:
        panel = gateway.real(floor_m, two())
        await asyncio.to_thread(panel.connect)
        with flying(panel, 100):
            await until(lambda: len(panel.answers) >= 2, "two answers came")
            await act(gateway.service, (await gateway.mission()).id, "finish", actor="tester")
            answers = len(panel.answers)
            polls = panel.polls
            await until(lambda: panel.polls > polls + 100, "it polled on")
            assert len(panel.answers) <= answers + 1, "the answer that lay there"
        assert (await gateway.mission()).state is MissionState.FINISHED
    finally:
        await gateway.close()


async def test_soundings_at_the_surface_are_of_the_vehicle_that_took_them(gateway: Gateway) -> None:
    auvs = [Auv(15.0, 15.0, 1.5), Auv(45.0, 38.0, 3.0)]
    panel = gateway.real(floor_m, auvs)
    panel.drift(6)
    for auv in auvs:
        auv.depth_m = 0.0
    for sample in panel.samples:
        sample[3], sample[2] = sample[3] - sample[2] + 0.0, 0.0
    panel.samples = [[row, col, 0.0, floor_m(row, col)] for row, col, _, _ in panel.samples]
    await fly(gateway, panel, 1)
    area = gateway.service_area()
    found = await soundings(gateway)
    assert {row.verdict for row, _ in found} == {Verdict.ACCEPTED}
    for row, _ in found:
        first = area.to_cells(row.lat_deg, row.lon_deg)[0] < 30
        assert row.vehicle == f"{SESSION}-{1 if first else 2}"


@pytest.mark.slow
async def test_no_vehicle_is_sent_to_the_border(gateway: Gateway) -> None:
    panel = gateway.real(floor_m, [Auv(2.0, 2.0, 1.5), Auv(58.0, 47.0, 3.0)])
    await fly(gateway, panel, 20)
    for index in range(2):
        places = [answer[index][:2] for answer in panel.answers]
        away_m = [min(row, ROWS - row, col, COLS - col) for row, col in places]
        inside = next(k for k, distance_m in enumerate(away_m) if distance_m > NEAR_M - 0.5)
        assert min(away_m[inside:]) > NEAR_M - 0.5, "never back to it"


async def test_of_too_many_samples_the_newest_are_taken(gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(protocol, "MAX_SAMPLES", 500)
    panel = gateway.real(floor_m, two())
    old = [[21.0, 21.0, 1.0, 13.0]] * 500
    panel.samples = [*old, *([row, 20.0, 1.0, floor_m(row, 20.0)] for row in (18.0, 19.0, 20.0))]
    await fly(gateway, panel, 1)
    found = await soundings(gateway)
    assert len([row for row, _ in found if row.source == "neptus DVL"]) == 500
    assert any("3 beyond the newest 500" in line for line in await gateway.log("neptus"))


async def test_the_servers_log_does_not_grow_while_nothing_happens(
    gateway: Gateway, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    await asyncio.sleep(1.0)
    assert [record.message for record in caplog.records if record.name.startswith("pyftpdlib")] == []


@pytest.mark.slow
async def test_answers_404_hold_no_connections(gateway: Gateway) -> None:
    panel = gateway.real(floor_m, two(), session="Neptus_User_404")
    with flying(panel, 1):
        await until(lambda: len(panel.held) >= 70, "it polled for what is not there")
        panel.stop()
        assert await asyncio.to_thread(panel.still_held) == 0


async def test_status_is_told_and_breaks_no_connection(gateway: Gateway) -> None:
    panel = gateway.real(floor_m, two())

    def ask() -> list[str]:
        client = panel._ftp()
        with client:
            before = client.sendcmd("STAT")
            panel._log_in(client)
            after = client.sendcmd("STAT")
            with pytest.raises(ftplib.error_perm, match="50"):
                client.sendcmd("STAT /")
            return [before, after, client.sendcmd("NOOP")]

    assert [reply[:3] for reply in await asyncio.to_thread(ask)] == ["211", "211", "200"]


async def test_the_panel_shows_why_it_is_not_let_in(make_gateway: Callable[..., Gateway]) -> None:
    gateway = make_gateway()
    await gateway.open()
    try:
        panel = gateway.real(floor_m, two())
        await asyncio.to_thread(panel.connect)
        assert panel.label == "Connection Established"
        again = gateway.real(floor_m, two())
        await asyncio.to_thread(again.connect)
        assert f"session {SESSION} exists already: press RENEW" in again.label
        await gateway.token("deck")
        stranger = gateway.real(floor_m, two(), session="Neptus_User_5")
        await asyncio.to_thread(stranger.connect)
        assert "the password must be an access token of role operator" in stranger.label

        async def refuse(*_: Any, **__: Any) -> str:
            raise SessionRefusedError("Too many wrong tokens came from here: wait 60 s")

        gateway.door = refuse
        await asyncio.to_thread(stranger.connect)
        assert "Too many wrong tokens came from here: wait 60 s" in stranger.label
    finally:
        await gateway.close()


@pytest.mark.slow
async def test_two_consoles_at_one_address_do_not_end_each_other(gateway: Gateway) -> None:
    first = gateway.real(floor_m, two(), pace=20.0)
    await asyncio.to_thread(first.connect)
    with flying(first, 12) as thread:
        await until(lambda: len(first.answers) >= 2, "the first is led")
        second = gateway.real(floor_m, two(), session="Neptus_User_12")
        await asyncio.to_thread(second.connect)
        with flying(second, 4) as other:
            await until(lambda: not (thread.is_alive() or other.is_alive()), "both are led")
    assert (len(first.answers), len(second.answers)) == (12, 4)
    for session in (SESSION, "Neptus_User_12"):
        assert (await gateway.mission(session)).state is MissionState.RUNNING


@pytest.mark.slow
async def test_a_console_that_began_anew_ends_what_it_does_not_fly_any_more(
    make_gateway: Callable[..., Gateway],
) -> None:
    gateway = make_gateway(lost_after_s=3.0)
    await gateway.open()
    try:
        panel = gateway.real(floor_m, two())
        await fly(gateway, panel, 3)
        again = gateway.real(floor_m, two(), session="Neptus_User_12")
        await asyncio.to_thread(again.connect)

        async def ended() -> bool:
            return (await gateway.mission()).state is MissionState.FINISHED

        await until(ended, "the former session's mission is over")
        assert "began session Neptus_User_12" in (await gateway.mission()).reason
    finally:
        await gateway.close()


async def test_the_map_has_the_panels_rows_and_columns(make_gateway: Callable[..., Gateway]) -> None:
    from app.missions.fleet.links.neptus import gateway_settings
    from app.missions.neptus_sessions import session_spec

    for rows, cols, cell_m in ((240, 240, 1.0), (60, 50, 1.0), (37, 400, 2.5), (1500, 2000, 1.0)):
        settings = make_gateway(rows=rows, cols=cols, cell_m=cell_m).settings.neptus
        area = gateway_settings(settings).conventions.area
        spec = session_spec(settings, area, SESSION, 2)
        grid, mask = make_grid(spec.local_area(), spec.cell_m)
        assert (grid.rows, grid.cols) == (rows, cols)
        assert mask.all()
