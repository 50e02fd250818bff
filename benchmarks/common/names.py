"""Names that are given on the command line, separated by commas."""

import argparse
from collections.abc import Iterable


def named(parser: argparse.ArgumentParser, option: str, given: str | None, known: Iterable[str]) -> list[str]:
    """Return the given names; ends the command where one is not among the known ones, which it lists."""
    names, choices = [name.strip() for name in (given or "").split(",") if name.strip()], list(dict.fromkeys(known))
    for name in names:
        if name not in choices:
            parser.error(f"argument {option}: there is no {name!r} (choose from {', '.join(map(repr, choices))})")
    return names
