import pytest
from situations import SQUARE


@pytest.fixture
def square():
    return SQUARE
