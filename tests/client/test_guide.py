"""The examples of the guide work, one after the other, as they are written."""

import re
from pathlib import Path
from typing import Any

import pytest

from app.main import Server
from tests.support.paths import PROJECT

GUIDE = (PROJECT / "docs" / "client.md").read_text()


def test_the_examples_of_the_guide_work(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "guide"}
    examples = re.findall(r"^```python\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)
    for number, example in enumerate(examples):
        source = example.replace("http://127.0.0.1:8080", server.url)
        exec(compile(source, f"example {number} of docs/client.md", "exec"), names)  # noqa: S102
    shown = capsys.readouterr().out.splitlines()
    assert any(line.startswith("steps 0 ") for line in shown)
    assert "30 0 0" in shown
    assert "aborted" in shown
    assert any("'rover'" in line for line in shown)
    assert (tmp_path / "map.tif").exists()
