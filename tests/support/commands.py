"""The command line in a process of its own."""

import contextlib
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from tests.support.paths import PROJECT

COMMAND = [sys.executable, "-c", "import sys; sys.argv[0] = 'bathyfleet'; from app.cli import main; main()"]


def environment(**variables: str) -> dict[str, str]:
    """Variables for a process that runs this tree: settings of whoever runs the tests are not its own."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("BATHYFLEET_")}
    path = os.pathsep.join([str(PROJECT), *filter(None, [os.environ.get("PYTHONPATH")])])
    return kept | {"PYTHONPATH": path, "BATHYFLEET_IMC__ENABLED": "false"} | variables


@contextlib.contextmanager
def serving(
    folder: Path, environment: dict[str, str], *arguments: str, command: Sequence[str] = COMMAND
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """``bathyfleet serve`` on a free port, and its address."""
    process = subprocess.Popen(
        [*command, "serve", "--port", "0", *arguments],
        cwd=folder,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    try:
        seen = ""
        for line in process.stderr:
            seen += line
            if found := re.search(r"bathyfleet answers at (\S+)", line):
                yield process, found[1]
                return
        pytest.fail(f"it did not start: {seen}")
    finally:
        process.kill()
        process.communicate()
