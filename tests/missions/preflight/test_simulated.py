"""What the checklist says of simulated vehicles, whose sea floor is a file that settings name."""

from pathlib import Path

import numpy as np

from app.missions.preflight.survey import preflight
from app.missions.settings import SimulationSettings
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import save_npz
from tests.support.missions.harbour import Harbour, sim_spec


async def test_it_names_the_terrain_file_that_keeps_them_from_starting_until_it_is_put_right(
    harbour_closed: Harbour, tmp_path: Path
) -> None:
    file = tmp_path / "bank.npz"
    service = await harbour_closed.open(simulation=SimulationSettings(terrain=file))
    live = await service.get((await service.create(sim_spec("a"))).id)
    for written, reason in ((None, "no such file"), (b"none", "bank.npz: ")):
        if written is not None:
            file.write_bytes(written)
        found = preflight(live)
        [check] = [one for one in found.checks if one.id == "link.a"]
        assert (check.status, found.ready) == ("problem", False)
        assert reason in check.message
        assert "simulation.terrain" in check.remedy
    save_npz(Terrain(np.full((200, 200), 9.0), 1.0), file)
    found = preflight(live)
    assert [one.status for one in found.checks if one.id == "link.a"] == ["ok"]
    assert found.ready
