"""The service that runs while a demonstration uses it."""

import os
import signal
from pathlib import Path

import httpx
import pytest
from rich.console import Console

from app.demo.service import DemoError, claimed, client, get, serve_during
from app.missions.settings import ImcSettings
from app.settings import Settings, StartupError


def settings(folder: Path) -> Settings:
    return Settings(port=0, database_url=f"sqlite+aiosqlite:///{folder / 'demo.db'}", imc=ImcSettings(enabled=False))


async def test_a_signal_ends_the_work_without_a_complaint_about_the_request_under_way(tmp_path: Path) -> None:
    answered = 0

    async def work(url: str) -> None:
        nonlocal answered
        async with httpx.AsyncClient(base_url=url) as api:
            while True:
                (await api.get("/health/live")).raise_for_status()
                answered += 1
                if answered == 3:
                    os.kill(os.getpid(), signal.SIGTERM)

    assert await serve_during(settings(tmp_path), work, keep_serving=True, console=Console(quiet=True)) is False
    assert answered >= 3


async def test_what_goes_wrong_with_the_work_is_told(tmp_path: Path) -> None:
    async def work(url: str) -> None:
        raise ValueError(url)

    with pytest.raises(ValueError, match="http://127"):
        await serve_during(settings(tmp_path), work, keep_serving=True, console=Console(quiet=True))


async def test_no_request_goes_over_a_connection_that_the_service_may_be_closing(tmp_path: Path) -> None:
    kept: list[int] = []

    async def work(url: str) -> None:
        async with client(url) as api:
            for _ in range(3):
                assert (await get(api, "/health/ready"))["status"] == "ok"
                kept.append(len(api._transport._pool.connections))  # type: ignore[attr-defined]

    assert await serve_during(settings(tmp_path), work, keep_serving=False, console=Console(quiet=True)) is True
    assert kept == [0, 0, 0]


async def test_a_second_demonstration_leaves_the_database_of_the_one_that_is_running(tmp_path: Path) -> None:
    database = tmp_path / "demo.db"

    async def work(url: str) -> None:
        taken = settings(tmp_path).model_copy(update={"port": httpx.URL(url).port})
        with pytest.raises(StartupError, match="cannot listen on"), claimed(taken, database):
            pass
        with pytest.raises(DemoError, match="in use by another demonstration"), claimed(settings(tmp_path), database):
            pass
        assert database.exists()

    with claimed(settings(tmp_path), database), pytest.raises(DemoError), claimed(settings(tmp_path), database):
        pass
    assert await serve_during(settings(tmp_path), work, keep_serving=False, console=Console(quiet=True)) is True
    with claimed(settings(tmp_path), database):
        assert not database.exists()
