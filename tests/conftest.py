import os
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def terrains() -> Path:
    """Folder of real terrains: what BATHYFLEET_TERRAINS names, else ``../shared/terrains`` beside the project."""
    named = os.environ.get("BATHYFLEET_TERRAINS")
    folder = Path(named) if named else PROJECT.parent / "shared" / "terrains"
    if not folder.is_dir():
        pytest.skip(f"no real terrains in {folder}: set BATHYFLEET_TERRAINS to a folder of terrain files")
    return folder
