"""Mutated packets, by the command that throws millions of them, and a corpus of those that once led somewhere new."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.commands import environment
from tests.support.paths import PROJECT

CORPUS = Path(__file__).parent / "corpus" / "outcomes.jsonl"

REPLAY = """
import asyncio, json, sys
from collections import Counter
from pathlib import Path
from benchmarks.imc.fuzz import replay
targets = asyncio.run(replay(Path(sys.argv[1]).read_text().splitlines()))
bridges = [target.bridge for target in targets]
print(json.dumps({
    "handler_errors": sum((bridge.handler_errors for bridge in bridges), Counter()),
    "impossible_events": sum(target.impossible for target in targets),
    "decoded": sum((bridge.decoder.decoded for bridge in bridges), Counter()),
    "faults": sum((bridge.decoder.faults for bridge in bridges), Counter()),
    "gate": sum((target.gated for target in targets), Counter()),
    "refused": sum((bridge.admission.refused for bridge in bridges), Counter()),
}))
"""


def run(*arguments: str) -> dict[str, Any]:
    ended = subprocess.run(
        [sys.executable, *arguments],
        cwd=PROJECT,
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
    return json.loads(ended.stdout)


@pytest.mark.slow
def test_mutated_packets_neither_break_anything_nor_get_through() -> None:
    result = run("-m", "benchmarks.imc.fuzz", "--packets", "20000", "--seeds", "7")
    assert result["handler_errors"] == {}
    assert result["impossible_events"] == 0
    assert result["decoded"] > 5000
    assert result["events"] > 100
    assert result["gate"]["accepted"] > 20
    assert result["nodes"] <= 256


@pytest.mark.slow
def test_what_once_led_somewhere_new_does_no_harm() -> None:
    result = run("-c", REPLAY, str(CORPUS))
    assert result["handler_errors"] == {}
    assert result["impossible_events"] == 0
    # The corpus still reaches what it was kept for.
    assert len(result["decoded"]) > 15
    assert len(result["faults"]) >= 3
    assert result["gate"]["accepted"] > 200
    assert result["refused"]  # what gets past a bridge would be the gate's to refuse
