"""``python -m simulator`` as its users start it."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from signal import Signals

import pytest
from typer.testing import CliRunner

from simulator.__main__ import app
from simulator.floors import seafloors
from simulator.floors.terrain_files import save_npz
from tests.support.paths import PROJECT
from tests.support.ports import free_ports


def launch(*arguments: str) -> subprocess.Popen[str]:
    announce, port = free_ports(2)
    return subprocess.Popen(  # the interpreter and arguments are ours
        [
            sys.executable,
            "-m",
            "simulator",
            "--json-ready",
            "--base-port",
            str(port),
            "--announce-ports",
            f"{announce}-{announce + 4}",
            *arguments,
        ],
        cwd=PROJECT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_tells_when_it_is_ready_and_stops_cleanly(tmp_path: Path, number: Signals) -> None:
    save_npz(seafloors.generate("slope", 1, origin=(41.2, -8.6)), tmp_path / "floor.npz")
    with launch("--vehicles", "3", "--terrain", str(tmp_path / "floor.npz"), "--speed", "20") as process:
        told = json.loads(process.stdout.readline())
        assert [v["name"] for v in told["vehicles"]] == ["lauv-sim-1", "lauv-sim-2", "lauv-sim-3"]
        assert told["terrain"]["origin_lat"] == 41.2
        assert told["speed"] == 20.0
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "", "")


def test_vehicles_can_be_named_numbered_and_placed() -> None:
    with launch(
        *("--names", "rex,max", "--ids", "0x1e,31", "--origin", "40.0,-9.0", "--sensor", "dvl"),
        *("--start", "10,20", "--start", "30,40,1"),
    ) as process:
        told = json.loads(process.stdout.readline())
        process.terminate()
        process.communicate(timeout=30)
    assert [(v["name"], v["imc_id"], v["depth_m"]) for v in told["vehicles"]] == [("rex", 30, 0.0), ("max", 31, 1.0)]
    assert told["vehicles"][0]["lat"] == pytest.approx(40.0 + 20 / 111_035, abs=1e-6)


def test_a_multibeam_can_be_described() -> None:
    with launch("--sensor", "multibeam", "--swath", "90,64,2,50") as process:
        told = json.loads(process.stdout.readline())
        process.terminate()
        out, err = process.communicate(timeout=30)
    assert len(told["vehicles"]) == 2
    assert (process.returncode, out, err) == (0, "", "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--terrain", "nowhere.npz"], "nowhere.npz: no such file"),
        (["--family", "moon"], "canyon, flat, harbour"),
        (["--origin", "41"], "--origin is '41'"),
        (["--origin", "95,0"], "origin_lat is 95"),
        (["--current", "a,b"], "--current is 'a,b'"),
        (["--start", "500,0"], "outside of the terrain"),
        (["--start", "1"], "2 or 3 numbers"),
        (["--ids", "x"], "0x0101"),
        (["--ids", "1,1"], "ids holds a value twice"),
        (["--speed", "0"], "speed is 0"),
        (["--noise", "-1"], "relative_sd is -1"),
        (["--dropouts", "2"], "dropout_rate is 2"),
        (["--loss", "2"], "loss is 2"),
        (["--swath", "120,256"], "--swath is '120,256'; it must be 4 numbers"),
        (["--swath", "120,1,5,100"], "beams is 1"),
        (["--drift", "-1"], "drift is -1"),
        (["--announce-ports", "x"], "--announce-ports is 'x'"),
        (["--bind", "0.0.0.0"], "bind address"),
        (["--size", "0"], "width_m is 0"),
        (["--endurance", "0"], "endurance_min is 0"),
        (["--battery", "120"], "level_pct is 120"),
        (["--consumption-factor", "-1"], "consumption_factor is -1"),
        (["--sound-speed", "0:1520,1500"], "'1500'; each entry must be DEPTH:SPEED"),
        (["--sound-speed", "0:152"], "sound speed 152 m/s must be 1350 to 1650 m/s"),
    ],
)
def test_wrong_options_say_what_would_be_right(arguments: list[str], message: str) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert message in result.output.replace("\n", " ")


def test_help_lists_every_option() -> None:
    result = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    for option in (
        "--terrain",
        "--family",
        "--loss",
        "--duplicate",
        "--drift",
        "--names",
        "--json-ready",
        "--chatter",
        "--endurance",
        "--battery",
        "--consumption-factor",
        "--lost-comms",
    ):
        assert option in result.output
