import pytest

from tests.support.situations import SQUARE


@pytest.fixture
def square():
    return SQUARE
