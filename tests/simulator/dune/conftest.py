import pytest

from tests.support.imc.dune_bench import Bench


@pytest.fixture
def bench() -> Bench:
    """A node in service with a console that it talks to."""
    return Bench().ready()
