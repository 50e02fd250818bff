"""Writes the generated half of the Python client anew: ``python -m app.client``."""

import argparse
import sys
from pathlib import Path

from app.client.classes import classes
from app.client.operations import operations
from app.main import create_app
from app.settings import Settings

TARGET = Path(__file__).parent / "src" / "bathyfleet" / "client"


def sources() -> dict[str, str]:
    """Return the generated modules by their file names, from the document of the service as it is."""
    document = create_app(Settings()).openapi()
    return {"models.py": classes(document["components"]["schemas"]), "operations.py": operations(document)}


def main(arguments: list[str] | None = None) -> int:
    """Write the modules, or with ``--check`` only tell whether they are up to date."""
    parser = argparse.ArgumentParser(prog="python -m app.client", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; status 1 when a module is out of date")
    check = parser.parse_args(arguments).check
    old = [name for name, text in sources().items() if not _is(TARGET / name, text)]
    if check:
        if old:
            print(f"out of date: {', '.join(old)}; run python -m app.client", file=sys.stderr)  # noqa: T201
        return 1 if old else 0
    for name, text in sources().items():
        (TARGET / name).write_text(text, "utf-8")
    return 0


def _is(path: Path, text: str) -> bool:
    return path.is_file() and path.read_text("utf-8") == text


if __name__ == "__main__":
    sys.exit(main())
