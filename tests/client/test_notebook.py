"""The notebook of the guide is run as a user does, in a kernel of its own."""

import asyncio
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from app.main import Server
from tests.support.paths import PROJECT

NOTEBOOK = PROJECT / "docs" / "notebooks" / "first_survey.ipynb"


def texts(cell: Any) -> str:
    return "".join(output.get("text", "") for output in cell.outputs)


@pytest.fixture(scope="module")
def flown(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The notebook after it was run with fewer steps."""
    folder: Path = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.reads(NOTEBOOK.read_text(), as_version=4)  # type: ignore[no-untyped-call]
    (parameters,) = (cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", []))
    parameters.source += f'\nADDRESS, STEPS = "{server.url}", 3'
    client = NotebookClient(notebook, timeout=240, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    asyncio.run(client.async_execute())
    return notebook


@pytest.mark.slow
def test_it_ends_with_a_picture_of_the_map(flown: Any) -> None:
    pictures = [o for cell in flown.cells for o in cell.get("outputs", []) if "image/png" in o.get("data", {})]
    assert len(pictures) == 1
    assert len(pictures[0].data["image/png"]) > 10_000


def test_it_shows_what_its_words_say(flown: Any) -> None:
    shown = [texts(cell) for cell in flown.cells if cell.cell_type == "code"]
    assert any(text.startswith("cell_m: ") for text in shown)
    assert any("finished by service: every step is done" in text for text in shown)


def test_it_is_kept_without_what_it_printed() -> None:
    notebook = nbformat.reads(NOTEBOOK.read_text(), as_version=4)  # type: ignore[no-untyped-call]
    nbformat.validate(notebook)
    assert all(not cell.outputs and cell.execution_count is None for cell in notebook.cells if cell.cell_type == "code")
