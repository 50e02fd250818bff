"""QGIS without its window: what it opens, and what it shows."""

import json
import os
import subprocess
from functools import cache
from pathlib import Path
from typing import Any, Self

SYSTEM_PYTHON = "/usr/bin/python3"
"""That which distributions install QGIS's modules for."""
_PROGRAM = Path(__file__).with_name("program.py")
_WITHOUT_WINDOW = {"QT_QPA_PLATFORM": "offscreen"}


@cache
def installed() -> bool:
    """Whether QGIS with its Python modules is here (Debian: ``apt-get install qgis python3-qgis``)."""
    if not Path(SYSTEM_PYTHON).is_file():
        return False
    asked = [SYSTEM_PYTHON, "-c", "import qgis.core"]
    return subprocess.run(asked, capture_output=True, check=False).returncode == 0


def environment(home: Path) -> dict[str, str]:
    """Return what QGIS runs in: settings and caches of its own, and nothing that leads to another Python's modules."""
    clear = {name: os.environ[name] for name in ("LANG", "TMPDIR") if name in os.environ}
    return clear | {"PATH": "/usr/bin:/bin", "HOME": str(home)}


class Qgis:
    """A running QGIS. Each method is what a user does in it, and returns what it says.

    Raises RuntimeError with QGIS's own words where it cannot do what is asked.
    """

    def __init__(self, folder: Path) -> None:
        with (folder / "qgis.log").open("wb") as log:
            self._process = subprocess.Popen(
                [SYSTEM_PYTHON, "-u", str(_PROGRAM)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                env=environment(folder) | _WITHOUT_WINDOW,
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def _ask(self, command: str, **arguments: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"command": command, **arguments}) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"QGIS ended with code {self._process.wait()} at {command}")
        answer = json.loads(line)
        if "error" in answer:
            raise RuntimeError(f"QGIS at {command}: {answer['error']}")
        return answer["found"]

    def add_tiles(self, name: str, address: str, max_zoom: int) -> None:
        """*Add XYZ Layer*."""
        self._ask("add_tiles", name=name, address=address, max_zoom=max_zoom)

    def add_map(self, name: str, address: str, layers: list[str], crs: str = "EPSG:3857") -> None:
        """*Add WMS/WMTS Layer*."""
        self._ask("add_map", name=name, address=address, layers=layers, crs=crs)

    def add_features(self, name: str, address: str, collection: str) -> None:
        """*Add WFS / OGC API – Features Layer*."""
        self._ask("add_features", name=name, address=address, collection=collection)

    def count(self, name: str, extent: list[float] | None = None) -> int:
        """*Reload*, and how many features the layer has, in a view or everywhere."""
        return int(self._ask("count", name=name, extent=extent))

    def extent(self, name: str) -> list[float]:
        """Where the layer lies: west, south, east, north in EPSG:3857."""
        return [float(value) for value in self._ask("extent", name=name)]

    def identify(self, name: str, extent: list[float], width: int = 100, height: int = 100) -> str:
        """*Identify Features* in the middle of a view: what is said of it, HTML."""
        return str(self._ask("identify", name=name, extent=extent, width=width, height=height))

    def picture(
        self,
        path: Path,
        names: list[str],
        extent: list[float],
        size: tuple[int, int] = (800, 600),
        crs: str = "EPSG:3857",
    ) -> None:
        """Reload and draw layers, the topmost first, into a PNG file, in a system of the view's own."""
        width, height = size
        self._ask("picture", path=str(path), names=names, extent=extent, width=width, height=height, crs=crs)
