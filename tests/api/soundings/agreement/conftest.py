from collections.abc import Callable
from pathlib import Path

import pytest

from app.estimation import adjustment
from app.mapping.quality import crossovers
from app.settings import Settings


@pytest.fixture(autouse=True, scope="package")
def compiled() -> None:
    """Compile before requests wait for it: a service does so while it starts."""
    adjustment.warm_up()
    crossovers.warm_up()


@pytest.fixture
def settings(make_settings: Callable[..., Settings], tmp_path: Path) -> Settings:
    return make_settings(pings_url=str(tmp_path / "pings"))
