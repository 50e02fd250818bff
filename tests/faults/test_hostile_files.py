"""Files that mean harm are refused in words, whatever they claim to hold, and leave nothing behind."""

import contextlib
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from app.mapping.readers.reader_choice import read_file
from app.mapping.readers.types import ReadError
from app.missions.views.measurements.imports import ImportOptions
from simulator.floors.terrain import Terrain, TerrainError
from simulator.floors.terrain_files import load_terrain, save_npz
from tests.support.faults.hostile import PLACE, npy, npz
from tests.support.paths import PROJECT


@pytest.mark.slow
@pytest.mark.parametrize("reader", ["terrain", "soundings"])
def test_each_is_refused_in_little_memory_with_what_is_wrong(reader: str, tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "tests.support.faults.hostile", reader, str(tmp_path)],
        cwd=PROJECT,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-3000:]
    refused = json.loads(ended.stdout)
    assert len(refused) > 20
    taken = [name for name, words in refused.items() if not words]
    assert not taken, "none of them can be used"
    for name, words in refused.items():
        assert 10 < len(words) < 500, (name, words)
        assert "Traceback" not in words


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("good")
    save_npz(Terrain(np.arange(30.0).reshape(5, 6), 2.0, 41.0, -8.0), folder / "a.npz")
    depths = "\n".join(" ".join(str(r + c) for c in range(6)) for r in range(5))
    return {
        "a.npz": (folder / "a.npz").read_bytes(),
        "b.npz": npz(z=npy(np.ones((5, 6), np.float32)), cell_m=npy(np.array(1.0))),
        "a.asc": f"ncols 6\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 2\n{depths}\n".encode(),
        "a.xyz": b"0 0 1\n10 0 2\n0 10 3\n10 10 4\n5 5 3\n",
        "a.csv": b"lat,lon,depth_m\n41,-8,1\n41.001,-8,2\n41,-8.001,3\n41.001,-8.001,4\n",
    }


mutations = st.lists(
    st.tuples(
        st.integers(0, 600), st.integers(0, 8), st.binary(max_size=8) | st.sampled_from([b"1e999", b"-", b"nan"])
    ),
    min_size=1,
    max_size=4,
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.sampled_from(["a.npz", "b.npz", "a.asc", "a.xyz", "a.csv"]), changes=mutations)
def test_a_damaged_terrain_is_read_or_refused(
    good: dict[str, bytes], tmp_path: Path, name: str, changes: list[tuple[int, int, bytes]]
) -> None:
    content = bytearray(good[name])
    for place, length, other in changes:
        at = place % (len(content) + 1)
        content[at : at + length] = other
    (tmp_path / name).write_bytes(content)
    with contextlib.suppress(TerrainError):
        terrain = load_terrain(tmp_path / name)
        assert np.isfinite(terrain.z_m).any()
        assert terrain.cell_m > 0
    if not name.endswith(".npz"):
        with contextlib.suppress(ReadError):
            read_file(io.BytesIO(bytes(content)), Path(name).suffix, PLACE)


@pytest.mark.parametrize(
    "name",
    [
        "../../../escaped.xyz",
        "/escaped.xyz",
        "..\\escaped.xyz",
        "a\0b.xyz",
        "a" * 300 + ".xyz",
        ".xyz/../b.xyz",
        "",
    ],
    ids=["up", "absolute", "windows", "nul", "long", "folder", "empty"],
)
def test_names_that_lead_elsewhere_are_refused(name: str) -> None:
    with pytest.raises(ValidationError):
        ImportOptions(filename=name)
