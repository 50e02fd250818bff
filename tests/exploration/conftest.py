import pytest

from app.arrays import FloatArray
from tests.support.exploration.situations import SQUARE


@pytest.fixture
def square() -> FloatArray:
    return SQUARE
