"""Planners' memories: what is packed comes back, whatever way it lies in the computer's memory."""

import numpy as np
import pytest

from app.exploration.core.snapshot_codec import pack, unpack


def test_arrays_come_back_exactly() -> None:
    whole = np.arange(24.0).reshape(4, 6) / 7.0
    memory = {
        "whole": whole,
        "column": whole[:, 1],
        "part": whole[::2, 1:4],
        "turned": whole.T,
        "of": {"a": whole[1:, :2]},
    }
    back = unpack("cao", pack("cao", memory))
    for name in ("whole", "column", "part", "turned"):
        np.testing.assert_array_equal(np.array(back[name]), memory[name])
    np.testing.assert_array_equal(np.array(back["of"]["a"]), whole[1:, :2])


def test_what_cannot_be_kept_is_named() -> None:
    with pytest.raises(TypeError, match="set"):
        pack("cao", {"seen": {1, 2}})


@pytest.mark.parametrize("data", [b"", b"[]", b'{"kind": "cao"}', pack("lawnmower", {})])
def test_other_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="planner memory"):
        unpack("cao", data)
