"""Mutated packets, by the command that throws a million of them."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_mutated_packets_neither_break_anything_nor_get_through():
    ended = subprocess.run(
        [sys.executable, "benchmarks/imc_fuzz.py", "--packets", "20000", "--seed", "7"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
    result = json.loads(ended.stdout)
    assert result["handler_errors"] == {}
    assert result["impossible_events"] == 0
    assert result["decoded"] > 5000
    assert result["events"] > 100
    assert result["nodes"] <= 256
