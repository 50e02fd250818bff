"""Where and when a report was made: machine, versions, date."""

import datetime as dt
import os
import platform
from importlib.metadata import version
from pathlib import Path

from app import __version__

CPU_FILE = Path("/proc/cpuinfo")


def made(command: str, processes: int) -> dict[str, str]:
    """Return the facts of the report's head."""
    now = dt.datetime.now(dt.UTC)
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    return {
        "command": f"`{command}`",
        "date": f"{now:%Y-%m-%d %H:%M} UTC",
        "machine": f"{_cpu()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}; {processes} processes",
        "versions": f"bathyfleet {__version__}, Python {platform.python_version()}, {libraries}",
    }


def _cpu() -> str:
    if CPU_FILE.is_file():
        for line in CPU_FILE.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown processor"
