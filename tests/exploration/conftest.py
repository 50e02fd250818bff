from typing import Any

import pytest

from tests.support.situations import SQUARE


@pytest.fixture
def square() -> Any:
    return SQUARE
