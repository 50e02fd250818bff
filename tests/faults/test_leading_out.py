"""What an operator sends never brings anything back of what else lies on the service's machine."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.faults.leading_out import grids, told
from tests.support.paths import PROJECT

SAMPLES = ["external.nc", "external_relative.nc", "external_link.nc", "soft_link.nc", "virtual.nc"]
TASK = {
    "kind": ".nc",
    "what": "soundings",
    "origin": (41.1850, -8.7050),
    "grid": {"west_m": 0.0, "south_m": 0.0, "cell_m": 2.0, "rows": 10, "cols": 10},
    "margin_m": 50.0,
    "options": {"sd_m": 0.3, "positive": "down"},
    "unconfined": True,
}
PROCESS = """
import sys
import app.mapping.readers.netcdf as reader
if sys.argv[3] == "uninspected":
    reader.check_contained = lambda content: None
from app.mapping.readers.__main__ import main
sys.exit(main(tuple(filter(None, sys.argv[4].split(",")))))
"""


def read(folder: Path, name: str, inspection: str, layers: str) -> tuple[int, dict[str, Any], np.ndarray]:
    with (folder / name).open("rb") as file, (folder / "result").open("w+b") as result:
        ended = subprocess.run(
            [sys.executable, "-P", "-c", PROCESS, json.dumps(TASK), str(result.fileno()), inspection, layers],
            stdin=file,
            capture_output=True,
            pass_fds=[result.fileno()],
            env={"PYTHONPATH": str(PROJECT), "OPENBLAS_NUM_THREADS": "1", "LANG": "C.UTF-8"},
            cwd=folder,
            check=False,
        )
        assert ended.stdout, ended.stderr.decode()[-2000:]
        return ended.returncode, json.loads(ended.stdout), np.fromfile(folder / "result", "<f8")


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_confinement_holds_where_inspection_misses_something(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(grids(tmp_path)[name])
    code, said, values = read(tmp_path, name, "uninspected", "")
    assert code == 0, "the attack itself works"
    depths = values.reshape(said["shape"])[2]
    assert np.any(depths > 30.0), "the private file's letters"
    for layers in ("landlock", "seccomp", "namespaces,landlock,seccomp"):
        code, said, values = read(tmp_path, name, "uninspected", layers)
        assert code == 3 or not np.any(values.reshape(said["shape"])[2] != 0.0), (layers, said)
        assert not told(json.dumps(said))
    code, said, values = read(tmp_path, name, "inspected", "")
    assert (code, len(values)) == (3, 0)
    assert not told(json.dumps(said))


@pytest.mark.parametrize(
    ("beginning", "repeated", "times"),
    [
        (b"", b"\n", 60 * 2**20),
        (b"lon,lat,depth\n", b",", 30 * 10**6),
        (b"lon,lat,depth,verdict\n", b"," * 4000 + b"\n", 7500),
        (b"", b"1 2 3\r\n\r\n\r\n", 3 * 10**6),
    ],
    ids=["line ends", "one line of commas", "lines of commas", "empty lines between"],
)
def test_text_of_whatever_length_takes_little_memory(
    beginning: bytes, repeated: bytes, times: int, tmp_path: Path
) -> None:
    with (tmp_path / "long.csv").open("wb") as file:
        file.write(beginning)
        for _ in range(100):
            file.write(repeated * (times // 100))
    code = (
        "import resource, sys, io; from app.mapping.readers.text import read_text\n"
        "from app.mapping.readers.types import ReadError\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "try:\n    read_text(open(sys.argv[1], 'rb'))\nexcept ReadError as error:\n    sys.stderr.write(str(error))\n"
        "sys.stdout.write(str(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before))"
    )
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code, str(tmp_path / "long.csv")],
        env={"PYTHONPATH": str(PROJECT), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "more than" in ended.stderr or "no sounding" in ended.stderr, ended.stderr
    assert int(ended.stdout) < 150 * 1024, "KiB more than before"
