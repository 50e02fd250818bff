from typing import Any

import pytest

from tests.support.imc.dune_bench import Bench


@pytest.fixture
def bench() -> Any:
    """A node in service with a console that it talks to."""
    return Bench().ready()
