"""The examples of the guide work, one after the other, as they are written."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.main import Server
from tests.support.paths import PROJECT

GUIDE = (PROJECT / "docs" / "client.md").read_text()
EXAMPLES = re.findall(r"^```python\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_the_examples_of_the_guide_work(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "guide"}
    for number, example in enumerate(EXAMPLES):
        source = example.replace("http://127.0.0.1:8080", server.url)
        exec(compile(source, f"example {number} of docs/client.md", "exec"), names)  # noqa: S102
    shown = capsys.readouterr().out.splitlines()
    assert any(line.startswith("steps 0 ") for line in shown)
    assert "30 0 0" in shown
    assert "aborted" in shown
    assert any("'rover'" in line for line in shown)
    assert (tmp_path / "map.tif").exists()


def test_the_examples_of_the_guide_are_typed(tmp_path: Path) -> None:
    (tmp_path / "guide.py").write_text("\n".join(EXAMPLES))
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", PROJECT / "pyproject.toml", tmp_path / "guide.py"],
        cwd=PROJECT,
        capture_output=True,
        text=True,
    )
    assert checked.returncode == 0, checked.stdout
