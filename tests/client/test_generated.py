"""The generated half is what the service's document says, and nothing else is needed for it."""

import inspect
import subprocess
import sys

import pytest

from app.client.__main__ import TARGET, main, sources
from app.client.classes import TypeNames
from app.client.operations import python_name
from bathyfleet.client import AsyncClient, Client, models
from tests.support.api.contract import CONTRACT


def test_models_and_operations_are_up_to_date(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--check"]) == 0, capsys.readouterr().err


def test_what_is_out_of_date_is_named(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    written = sources()
    monkeypatch.setattr("app.client.__main__.sources", lambda: written | {"models.py": "other"})
    before = (TARGET / "models.py").read_text()
    assert main(["--check"]) == 1
    assert capsys.readouterr().err == "out of date: models.py; run python -m app.client\n"
    assert (TARGET / "models.py").read_text() == before


def test_every_operation_is_a_method_of_both_clients() -> None:
    for operation in CONTRACT.values():
        name = python_name(operation)
        assert inspect.isfunction(getattr(Client, name))
        assert inspect.iscoroutinefunction(getattr(AsyncClient, name))


def test_what_can_be_asked_for_is_told_with_bounds_and_defaults() -> None:
    for kind in (Client, AsyncClient):
        about = inspect.getdoc(kind.get_events) or ""
        assert "limit : int, 1 to 1000, default 1000\n    Most entries in a list" in about
        assert "interval_m : float, at most 1000\n    Between contours" in (inspect.getdoc(kind.get_map_file) or "")


def test_no_operation_takes_an_empty_id() -> None:
    with Client() as client:
        for operation in CONTRACT.values():
            method = getattr(client, python_name(operation))
            parameters = [
                p for p in inspect.signature(method).parameters.values() if p.default is p.empty and p.name != "query"
            ]
            ids = [p for p in parameters if p.name.endswith("_id")]
            if ids:
                given = {p.name: "" if p in ids else "x" for p in parameters}
                with pytest.raises(ValueError, match="'' is no id and no name"):
                    method(**given)


def test_both_clients_take_the_same_arguments() -> None:
    names = [name for name, value in inspect.getmembers(Client, inspect.isfunction) if not name.startswith("_")]
    for name in sorted({*names} - {"close"}):
        ours, theirs = inspect.signature(getattr(Client, name)), inspect.signature(getattr(AsyncClient, name))
        assert ours.parameters == theirs.parameters, name
        # Both are asked for the same; that of a stream has one type more.
        kinds = [signature.return_annotation.removeprefix("Async").split(",")[0] for signature in (ours, theirs)]
        assert kinds[0] == kinds[1], name


def test_importing_the_client_imports_nothing_of_the_service_and_no_arrays() -> None:
    code = "import sys, bathyfleet.client; print(*{name.split('.')[0] for name in sys.modules})"
    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "bathyfleet" in imported
    assert not {"app", "imc_bridge", "simulator", "numpy", "xarray", "fastapi", "sqlalchemy"} & set(imported)


def test_a_word_and_a_field_of_a_newer_service_are_kept() -> None:
    entry = models.EventView.model_validate(
        {
            "id": 1, "mission_id": "m", "time": "2026-01-01T00:00:00Z", "level": "panic", "kind": "state",
            "message": "", "data": {}, "shift": "night",
        }
    )  # fmt: skip
    assert entry.level == "panic"
    assert entry.model_dump()["shift"] == "night"
    with pytest.raises(ValueError, match="level"):
        models.EventView.model_validate(entry.model_dump() | {"level": 3})


def test_a_field_that_is_a_word_of_the_language_is_sent_under_its_own_name() -> None:
    assert models.EndRequest(return_=True).model_dump_json(exclude_unset=True) == '{"return":true}'


def test_a_schema_that_no_type_is_known_for_is_refused() -> None:
    with pytest.raises(ValueError, match="no Python type is known for"):
        TypeNames({}).of({"type": "quaternion"})
