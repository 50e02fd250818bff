import pytest

from app.main import Server
from bathyfleet.client import Client, models
from bathyfleet.client.wait import Wait
from tests.support.api.rest import mission_spec
from tests.support.ports import free_ports


@pytest.fixture
def mission(server: Server) -> models.MissionView:
    with Client(server.url) as client:
        return client.create_mission(mission_spec())


def test_a_wait_lasts_as_long_as_is_said_however_seldom_is_asked(mission: models.MissionView) -> None:
    times = iter([0.0, 0.5, 1.5, 3.0])
    wait = Wait(mission.id, ["finished"], 3.0, 2.0, now=lambda: next(times))
    assert wait.after(mission) == 2.0
    assert wait.after(mission) == 1.5  # asked once more at the very end
    with pytest.raises(TimeoutError, match="is still ready after 3 s"):
        wait.after(mission)


def test_a_wait_ends_in_time_while_nobody_answers() -> None:
    (port,) = free_ports(1)
    with Client(f"http://127.0.0.1:{port}") as client, pytest.raises(TimeoutError, match="no answer came"):
        client.wait_for("m", timeout_s=0.1)


def test_a_word_that_is_no_state_is_refused_before_anything_is_asked() -> None:
    with Client() as client, pytest.raises(ValueError, match="states: 'runing' is not one of draft, ready, running"):
        client.wait_for("m", "runing")  # type: ignore[arg-type]
