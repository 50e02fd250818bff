"""The guide's planner as a wheel of its own, installed beside the service, and another one that is broken."""

import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from bathyfleet.client import Client, InvalidRequestError
from tests.support.api.rest import mission_spec
from tests.support.commands import COMMAND, environment, serving
from tests.support.paths import PROJECT

GUIDE = (PROJECT / "docs" / "adding-a-planner.md").read_text()


def block(language: str, containing: str) -> str:
    found = re.findall(rf"^```{language}\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)
    (text,) = (text for text in found if containing in text)
    return str(text)


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with both packages, as pip installs them."""
    source, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("packages")
    (source / "pyproject.toml").write_text(block("toml", "entry-points"))
    (source / "greedy_planner.py").write_text(block("python", "class GreedyPlanner"))
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel"], cwd=source, check=True)
    (greedy,) = (source / "dist").glob("*.whl")
    broken = source / "sunk_planner-0.3-py3-none-any.whl"
    with zipfile.ZipFile(broken, "w") as wheel:
        info = "sunk_planner-0.3.dist-info"
        wheel.writestr("sunk_planner.py", "import gpu_that_nobody_has\n")
        wheel.writestr(f"{info}/entry_points.txt", "[bathyfleet.planners]\nsunk = sunk_planner:SunkPlanner\n")
        wheel.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: sunk-planner\nVersion: 0.3\n")
        wheel.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        wheel.writestr(f"{info}/RECORD", "")
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "-q", "--no-index", "--no-deps", "--target", folder, greedy, broken],
        check=True,
    )
    return folder


@pytest.fixture
def variables(packages: Path, tmp_path: Path) -> dict[str, str]:
    settings = environment(
        BATHYFLEET_DATABASE_URL=f"sqlite+aiosqlite:///{tmp_path / 'fleet.db'}", BATHYFLEET_TIME_SCALE="50"
    )
    return settings | {"PYTHONPATH": f"{settings['PYTHONPATH']}:{packages}"}


@pytest.mark.slow
def test_it_is_listed_flies_a_mission_and_is_missed_by_name_when_it_is_gone(
    variables: dict[str, str], tmp_path: Path
) -> None:
    flown = mission_spec(vehicles=[{"name": "a", "kind": "sim"}], planner={"name": "greedy"}, steps=2)
    with serving(tmp_path, variables) as (process, url), Client(url) as client:
        planners = {planner.name: planner for planner in client.list_planners()}
        assert (planners["greedy"].package, planners["greedy"].problem) == ("greedy-planner 1.0", "")
        assert planners["greedy"].summary.startswith("Sends every vehicle towards the landmark")
        assert planners["cao"].package.startswith("bathyfleet ")
        assert (planners["sunk"].package, planners["sunk"].options) == ("sunk-planner 0.3", {})
        assert planners["sunk"].problem == "ModuleNotFoundError: No module named 'gpu_that_nobody_has'"
        with pytest.raises(InvalidRequestError) as refused:
            client.create_mission(flown | {"planner": {"name": "sunk"}})
        assert "'sunk' of sunk-planner 0.3 cannot be used: ModuleNotFoundError" in refused.value.errors[0].message
        mission = client.create_mission(flown)
        client.start_mission(mission.id)
        assert client.wait_for(mission.id, "finished", timeout_s=240, every_s=0.1).progress.step == 2
        running = client.create_mission(flown | {"steps": 10_000, "name": "Goes on"})
        client.start_mission(running.id)
        process.terminate()
        process.wait()
    gone = variables | {"PYTHONPATH": variables["PYTHONPATH"].rpartition(":")[0]}
    with serving(tmp_path, gone) as (_, url), Client(url) as client:
        ended = client.wait_for(running.id, timeout_s=240, every_s=0.1)
        assert ended.state == "failed"
        assert "there is no planner 'greedy'" in ended.reason
        assert client.get_mission(mission.id).state == "finished"


@pytest.mark.slow
def test_it_can_be_compared_with_others(variables: dict[str, str], tmp_path: Path) -> None:
    terrain = tmp_path / "floor.npz"
    np.savez(terrain, z=np.add.outer(np.linspace(8.0, 10.0, 30), np.linspace(0.0, 3.0, 30)), cell_m=1.0)
    command = [*COMMAND, "evaluate", "explore", "--terrain", str(terrain), "--steps", "2", "--landmarks", "40"]
    runs = subprocess.run(
        [*command, "--planner", "greedy,random", "--json"], env=variables, capture_output=True, text=True, check=True
    )
    assert [run["planner"] for run in json.loads(runs.stdout)["runs"]] == ["greedy", "random"]
    refused = subprocess.run(
        [*command, "--planner", "sunk"], env=variables, capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2
    words = re.sub(r"[\s│]+", " ", refused.stderr)
    assert "'sunk' of sunk-planner 0.3 cannot be used: ModuleNotFoundError" in words
