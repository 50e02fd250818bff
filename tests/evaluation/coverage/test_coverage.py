"""``evaluate coverage``: all is ensonified, by a detector of its own, and the same seed gives the same survey."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.estimation.swath import SwathSonar
from app.evaluation.coverage.surveys import fly_dune_rows, fly_fixed, fly_from_edges, fly_ours
from app.evaluation.coverage.world import CoverageScenario, Fleet, cell_by_depth_m, outcome
from simulator.floors.terrain import Terrain


def inclined(shoal_m: float = 5.0, deep_m: float = 20.0, side: int = 90) -> Terrain:
    return Terrain(np.tile(np.linspace(shoal_m, deep_m, side), (side, 1)), 1.0)


def scenario(vehicles: int = 1) -> CoverageScenario:
    return CoverageScenario(inclined(), vehicles, SwathSonar(beams=128), 1.0)


def squares_missed(fleet: Fleet) -> int:
    """Squares of three by three cells of the area without any sounding, looked at one by one."""
    empty = fleet.wanted & (fleet.density.count == 0)
    rows, cols = empty.shape
    return sum(bool(empty[i : i + 3, j : j + 3].all()) for i in range(rows - 2) for j in range(cols - 2))


@pytest.mark.parametrize("vehicles", [1, 3])
def test_everything_is_ensonified_with_less_way_than_fixed_lines(vehicles: int) -> None:
    fleet = fly_ours(scenario(vehicles))
    found = outcome(fleet)
    assert found.ensonified_pct > 99.0
    assert squares_missed(fleet) == found.holidays == 0
    assert found.density_ok_pct > 95.0
    fixed = outcome(fly_fixed(scenario(vehicles)))
    assert (fixed.holidays, fixed.ensonified_pct > 99.0) == (0, True)
    assert found.km < 0.8 * fixed.km


def test_the_same_seed_flies_the_same() -> None:
    assert outcome(fly_ours(scenario(2))) == outcome(fly_ours(scenario(2)))


def test_the_other_surveys_fly_over_all_of_the_area() -> None:
    for fly in (fly_dune_rows, fly_from_edges):
        found = outcome(fly(scenario()))
        assert found.ensonified_pct > 60.0
        assert found.km > 0.3


def test_nodes_go_by_depth() -> None:
    assert cell_by_depth_m(inclined(5.0, 6.0)) == 0.5
    assert math.isclose(cell_by_depth_m(inclined(40.0, 40.0)), 2.0)


def test_the_command_prints_its_fields(tmp_path: Path) -> None:
    file = tmp_path / "floor.npz"
    np.savez(file, z=np.full((40, 40), 30.0), cell_m=1.0)
    run = CliRunner().invoke(app, ["evaluate", "coverage", "--terrain", str(file), "--beams", "64", "--json"])
    assert run.exit_code == 0, run.output
    found = json.loads(run.output)
    assert {
        "ensonified_pct",
        "holidays",
        "density_ok_pct",
        "km",
        "minutes",
        "ratio_fixed",
        "ratio_known",
    } <= found.keys()
    assert found["sonar_deg"] == 120.0
    assert found["holidays"] == 0
