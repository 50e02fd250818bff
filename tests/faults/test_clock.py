"""The clock of the service's machine is set while a mission runs."""

from pathlib import Path

from tests.faults.scenes import clock_jumps


async def test_a_clock_that_is_set_forward_and_back_is_told_of_and_changes_nothing(tmp_path: Path) -> None:
    await clock_jumps(tmp_path, [86_400.0, -172_800.0])
