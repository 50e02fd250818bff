"""Steps that are told while they are made."""

import time


class StepError(Exception):
    """A step failed."""


class Step:
    """A line about something that is done, and how long it took."""

    def __init__(self, what: str) -> None:
        self._what = what if len(what) <= 100 else f"{what[:99]}…"

    def __enter__(self) -> None:
        self._begun = time.monotonic()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        outcome = "ok" if kind is None else "FAILED"
        print(f"{outcome:6} {time.monotonic() - self._begun:6.1f} s  {self._what}", flush=True)
