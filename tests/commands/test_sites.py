"""``bathyfleet sites`` on a database that no service has."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
import rasterio
from typer.testing import CliRunner, Result

from app.cli import app
from app.missions.operations.measurements import measure
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.spec.site import SiteSpec
from app.storage.database import Database
from tests.support.missions.harbour import act
from tests.support.missions.measured import measured
from tests.support.missions.specs import make_spec, rectangle

SITE: dict[str, Any] = {"name": "Quay", "area": rectangle(0, 0, 30, 30), "cell_m": 2.0}


async def fill(url: str) -> tuple[str, list[str]]:
    """Two surveys of a site; returns its id and theirs."""
    database = Database(url)
    service = MissionService(ServiceSettings(database_url=url, imc=ImcSettings(enabled=False)), database)
    await service.startup()
    try:
        site = (await service.sites.create(SiteSpec.model_validate(SITE))).id
        missions = []
        for _ in range(2):
            mission = (await service.create(make_spec(site=site))).id
            await measure(await service.get(mission), measured(80, wrong=None)[:80])
            await act(service, mission, "abort")
            missions.append(mission)
        assert [survey.surveyed for survey in await service.site_models.surveys(site)] == [True, True]
        return site, missions
    finally:
        await service.shutdown()
        await database.close()


@pytest.mark.slow
def test_sites_are_listed_and_written_to_files(
    database_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> Result:
        return CliRunner().invoke(app, ["sites", *words, "--database", database_url])

    assert "there are no sites" in run("list").output
    site, missions = asyncio.run(fill(database_url))
    listed = run("list")
    assert listed.exit_code == 0, listed.output
    assert "Quay, cells of 2 m, 2 surveys" in listed.output
    assert all(mission in listed.output for mission in missions)
    assert run("export", site[:8], "--out", "quay.tif").exit_code == 0
    with rasterio.open(tmp_path / "quay.tif") as raster:
        assert raster.descriptions[:3] == ("depth", "sd", "age")
    changes = run("export", site, "--format", "changes.csv", "--from", missions[1], "--to", missions[0], "-o", "c.csv")
    assert changes.exit_code == 0, changes.output
    rows = (tmp_path / "c.csv").read_text().splitlines()
    assert len(rows) > 100
    assert all(row.endswith(",0") for row in rows[2:]), "the same soundings twice are no change"
    assert run("export", site, "--format", "shp").exit_code == 2
    unknown = run("export", "nowhere")
    assert unknown.exit_code == 1
    assert "0 sites have ids that begin with 'nowhere'" in str(unknown.exception)
