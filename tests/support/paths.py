"""Where the project is, and what lies beside it."""

import os
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
TERRAINS = Path(os.environ.get("BATHYFLEET_TERRAINS") or PROJECT.parent / "shared" / "terrains")
CAPTURES = Path(os.environ.get("BATHYFLEET_CAPTURES") or PROJECT.parent / "shared" / "captures")
