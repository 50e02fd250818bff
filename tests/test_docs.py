"""The documentation says what is true: commands, options, paths, settings, examples and links exist as written."""

import inspect
import json
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args
from urllib.parse import unquote

import httpx
import numpy as np
import pytest
import typer
from pydantic import BaseModel

from app.api.http.problems import TITLES
from app.api.schemas import API, MeasurementBatch, ScanBatch
from app.cli import app as command_line
from app.cli import evaluations
from app.estimation import SingleBeam
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.main import create_app
from app.missions.fleet.interface import FleetEvent, FleetLink
from app.missions.spec.limits import Limits
from app.missions.spec.mission import MissionSpec
from app.settings import Settings
from simulator.__main__ import app as simulator_app
from tests.support.commands import environment, serving
from tests.support.paths import PROJECT

PAGES = sorted([*PROJECT.glob("*.md"), *PROJECT.glob("docs/*.md")])

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"!?\[[^\]\n]*\]\(([^)\s]+)\)")
METHODS = ("GET", "POST", "DELETE", "PUT", "PATCH")
PATH = re.compile(r"(?:\b(" + "|".join(METHODS) + r") )?((?:\$API|/api/v1|/health|/metrics)(?:/[\w${}.-]+)*)")
UNLISTED = {
    "/health": {"GET"},
    "/health/live": {"GET"},
    "/health/ready": {"GET"},
    "/metrics": {"GET"},
    f"{API}/missions/{{mission_id}}/live": {"GET"},
    API: set(METHODS),
}
"""Paths that exist beside the OpenAPI document: the same routes at the root, the WebSocket, the prefix itself."""

by_page = pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(PROJECT).as_posix() for page in PAGES])


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    text: str


def blocks(page: Path, *languages: str) -> list[Block]:
    return [Block(m[1], m[2]) for m in FENCE.finditer(page.read_text()) if not languages or m[1] in languages]


def commands(page: Path) -> Iterator[list[str]]:
    """Yield every command line of a page's shell blocks and code spans, split into words."""
    prose = FENCE.sub("", page.read_text())
    spans = [span for span in INLINE.findall(prose) if re.match(r"(bathyfleet|python -m simulator) ", span)]
    for text in [*(block.text for block in blocks(page, "sh", "bash", "console")), *spans]:
        joined = text.replace("\\\n", " ")
        for line in joined.splitlines():
            for part in re.split(r"&&|\|\||[|;&]", re.sub(r"^\s*\$ ", "", line)):
                try:
                    words = shlex.split(part, comments=True)
                except ValueError:
                    continue  # a quotation that goes on over several lines is no command of ours
                while words and re.match(r"^\w+=", words[0]):
                    words = words[1:]
                yield words


def check_words(command: Any, words: list[str]) -> None:
    """Follow subcommands and compare the options with those that exist."""
    while words and words[0] in getattr(command, "commands", {}):
        command, words = command.commands[words[0]], words[1:]
        if command.name == "evaluate":
            command = typer.main.get_command(evaluations())
    assert not (getattr(command, "commands", {}) and words and not words[0].startswith("-")), (
        f"{command.name} has no subcommand {words[0]!r}, only {sorted(command.commands)}"
    )
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    known |= {"--help", "-h"}
    used = {word.partition("=")[0] for word in words if re.match(r"^--?[a-z]", word)}
    assert used <= known, f"{command.name} has no option {sorted(used - known)}, only {sorted(known)}"


@by_page
def test_commands_and_their_options_exist(page: Path) -> None:
    ours = typer.main.get_command(command_line)
    simulator = typer.main.get_command(simulator_app)
    for words in commands(page):
        if words[:1] == ["bathyfleet"]:
            check_words(ours, words[1:])
        elif words[:3] == ["python", "-m", "simulator"]:
            check_words(simulator, words[3:])


@pytest.fixture(scope="module")
def routes() -> list[tuple[re.Pattern[str], set[str]]]:
    documented: dict[str, set[str]] = {
        path: {method.upper() for method in methods}
        for path, methods in create_app(Settings()).openapi()["paths"].items()
    }
    return [
        (re.compile(re.sub(r"\\\{\w+\\\}", "[^/]+", re.escape(path))), methods)
        for path, methods in (documented | UNLISTED).items()
    ]


@by_page
def test_paths_and_their_methods_exist(page: Path, routes: list[tuple[re.Pattern[str], set[str]]]) -> None:
    for method, written in PATH.findall(page.read_text()):
        path = written.replace("$API", API).rstrip(".")
        allowed = set().union(*(methods for pattern, methods in routes if pattern.fullmatch(path)))
        assert allowed, f"there is no path {path}"
        assert not method or method in allowed, f"{path} takes {sorted(allowed)}, not {method}"


@by_page
def test_links_lead_somewhere(page: Path) -> None:
    for target in LINK.findall(FENCE.sub("", page.read_text())):
        if re.match(r"[a-z]+:", target):
            continue
        place, _, anchor = unquote(target).partition("#")
        file = (page.parent / place).resolve() if place else page
        assert file.exists(), f"{target} leads nowhere"
        if anchor:
            assert anchor in anchors(file), f"{file.name} has no heading for #{anchor}"


@by_page
def test_files_that_are_named_exist(page: Path) -> None:
    for span in INLINE.findall(FENCE.sub("", page.read_text())):
        if re.fullmatch(r"(app|imc_bridge|simulator|tests|migrations|benchmarks)/[\w/.-]+", span):
            assert (PROJECT / span).exists() or span.startswith("app/dashboard/static"), f"{span} does not exist"


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, made as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text()), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@by_page
def test_examples_are_taken_by_the_service(page: Path) -> None:
    for block in blocks(page, "json", "toml", "python"):
        if block.language == "toml" and "[build-system]" in block.text:
            tomllib.loads(block.text)  # of a package; tests/test_planner_package.py builds it
        elif block.language == "toml":
            Settings.model_validate(tomllib.loads(block.text))
        elif block.language == "python":
            compile(block.text, page.name, "exec")
        else:
            document = json.loads(block.text)
            if "area" in document:
                MissionSpec.model_validate(document)
            elif isinstance(document.get("items"), list) and "ranges_m" in document["items"][0]:
                scans = ScanBatch.model_validate(document)
                assert not [item for item in scans.items if isinstance(item, str)]
            elif isinstance(document.get("items"), list) and "accepted" not in document:
                taken = MeasurementBatch.model_validate(document)
                assert not [item for item in taken.items if isinstance(item, str)]
    for written in re.findall(r"<<'?EOF'?[^\n]*\n(.*?)^EOF$", page.read_text(), re.MULTILINE | re.DOTALL):
        MissionSpec.model_validate_json(written)


def settings_rows(model: type[BaseModel] = Settings, prefix: str = "") -> Iterator[str]:
    """Yield the rows of the table of settings as docs/settings.md has to show them."""
    schema = _without_references(model.model_json_schema())
    kinds = {name: field.annotation for name, field in model.model_fields.items()}
    sections = {name: kind for name, kind in kinds.items() if isinstance(kind, type) and issubclass(kind, BaseModel)}
    lists = {name: kind for name, kind in ((n, get_args(k)[:1]) for n, k in kinds.items()) if _are_sections(kind)}
    for name, field in model.model_fields.items():
        if name in sections:
            continue
        default = json.dumps(schema["properties"][name].get("default"))
        shown = "–" if default == "null" else f"`{default}`"
        yield f"| `{prefix}{name}` | {shown} | {values_of(schema['properties'][name])} | {field.description} |"
    for name, (section,) in lists.items():
        yield from settings_rows(section, f"{prefix}{name}[].")
    for name, section in sections.items():
        yield from settings_rows(section, f"{prefix}{name}.")


def _are_sections(kinds: tuple[Any, ...]) -> bool:
    return any(isinstance(kind, type) and issubclass(kind, BaseModel) for kind in kinds)


def _without_references(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema with its definitions in the places that name them."""
    definitions = schema.get("$defs", {})

    def whole(part: Any) -> Any:
        if isinstance(part, list):
            return [whole(item) for item in part]
        if not isinstance(part, dict):
            return part
        if "$ref" in part:
            own = {key: value for key, value in part.items() if key != "$ref"}
            return whole(definitions[part["$ref"].rpartition("/")[2]]) | whole(own)
        return {key: whole(value) for key, value in part.items() if key != "$defs"}

    return dict(whole(schema))


def values_of(schema: dict[str, Any]) -> str:
    """Describe in words what a property may be."""
    if "anyOf" in schema:
        return values_of(next(option for option in schema["anyOf"] if option["type"] != "null"))
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if "prefixItems" in schema:
        return "list of " + " and ".join(values_of(item) for item in schema["prefixItems"])
    if schema["type"] == "array":
        kinds = {"array": "lists", "integer": "whole numbers", "string": "texts", "object": "tables"}
        return "list of " + (
            "any of " + values_of(schema["items"]) if "enum" in schema["items"] else kinds[schema["items"]["type"]]
        )
    words = {"boolean": "`true`, `false`", "integer": "whole number", "number": "number", "string": "text"}
    bounds = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    limits = [
        f"{sign} {schema[key]:g}" if schema[key] < 1e5 else f"{sign} {schema[key]:.0f}"
        for key, sign in bounds.items()
        if key in schema
    ]
    if schema.get("format") == "path":
        return "path"
    return " ".join([words[schema["type"]], *([", ".join(limits)] if limits else [])])


def test_the_runbook_quotes_alarms_as_they_are_raised() -> None:
    runbook = (PROJECT / "docs" / "runbook.md").read_text()
    cells = re.findall(r"^\| (.*?\*\*.*?) \|", runbook, re.MULTILINE)
    quoted = [
        part.strip() for cell in cells for words in re.findall(r"\*\*(.+?)\*\*", cell) for part in words.split("…")
    ]
    source = "".join(file.read_text() for name in ("app", "imc_bridge") for file in (PROJECT / name).rglob("*.py"))
    assert len(quoted) > 10
    assert [words for words in quoted if words not in source] == []


def test_the_table_of_settings_is_complete_and_true() -> None:
    rows = [line for line in (PROJECT / "docs" / "settings.md").read_text().splitlines() if line.startswith("| `")]
    assert rows == list(settings_rows())


@pytest.mark.slow
def test_the_polling_vehicle_of_the_guide_completes_a_mission(tmp_path: Path) -> None:
    guide = PROJECT / "docs" / "rest.md"
    [program] = [block.text for block in blocks(guide, "python") if "def post(" in block.text]
    mission = next(json.loads(b.text) for b in blocks(guide, "json") if '"kind": "rest"' in b.text)
    script = tmp_path / "vehicle.py"
    script.write_text(program)

    with (
        serving(tmp_path, environment(), "--log-level", "warning") as (_, url),
        httpx.Client(base_url=f"{url}{API}", timeout=60.0) as api,
    ):
        mission_id = api.post("/missions", json=mission | {"steps": 4}).json()["id"]
        api.post(f"/missions/{mission_id}/start").raise_for_status()

        def swim(vehicle: dict[str, Any], lat: str) -> int:
            command = [sys.executable, str(script), f"{url}{API}", mission_id, vehicle["name"], lat, "-8.7048"]
            return subprocess.run(command, env=environment(), check=False).returncode

        with ThreadPoolExecutor() as pool:
            codes = list(pool.map(swim, mission["vehicles"], ["41.1851", "41.1852"]))
        ended = api.get(f"/missions/{mission_id}").json()

    assert codes == [0, 0]
    assert ended["state"] == "finished"
    assert ended["progress"]["step"] == 4
    assert ended["progress"]["soundings"] > 0


def test_the_planner_of_the_guide_keeps_the_contract(tmp_path: Path) -> None:
    [program] = [block.text for block in blocks(PROJECT / "docs" / "adding-a-planner.md", "python")]
    (tmp_path / "greedy.py").write_text(program)
    kind = runpy.run_path(str(tmp_path / "greedy.py"))["GreedyPlanner"]
    planner, restored = (kind(PlannerOptions(), SingleBeam()) for _ in range(2))

    axis = np.arange(2.0, 100.0, 4.0)
    xy = np.column_stack([grid.ravel() for grid in np.meshgrid(axis, axis)])
    n = len(xy)
    depth = 8.0 + xy[:, 0] / 20.0
    belief = Belief(xy, depth, np.linspace(0.1, 1.0, n), np.zeros(n, dtype=bool), np.ones(n), 15.0)
    square = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
    constraints = Constraints(square, max_step_m=10.0, max_depth_m=20.0, min_separation_m=3.0)
    start = positions = np.array([[3.0, 3.0, 2.0], [9.0, 3.0, 2.0]])
    for step in range(1, 6):
        heading = np.full(2, np.nan)
        situation = Situation(step, 5, ("b", "a"), positions, heading, belief, np.zeros((0, 2)), constraints)
        restored.restore(planner.snapshot())
        positions = planner.propose(situation, np.random.default_rng(step)).positions
        bottom = Bottom.from_landmarks(xy, depth)
        assert constraints.violations(situation.vehicles, situation.positions, positions, bottom) == ()
        assert np.array_equal(restored.propose(situation, np.random.default_rng(step)).positions, positions)
    assert (np.linalg.norm(positions - start, axis=1) > 1.0).all()


def test_the_guides_name_every_problem_limit_and_field() -> None:
    rest = (PROJECT / "docs" / "rest.md").read_text()
    assert set(re.findall(r"`([a-z-]+)`", rest.partition("Last part of `type`")[2].partition("\n\n")[0])) == set(TITLES)
    guide = (PROJECT / "docs" / "operating.md").read_text()
    named = set(re.findall(r"`(\w+)`", guide))
    assert set(Limits.model_fields) <= named
    assert set(re.findall(r"^\| `(\w+)` \|", guide.partition("## Describing")[2].partition("## Limits")[0], re.M)) <= (
        set(MissionSpec.model_fields)
    )


def test_the_guide_to_vehicle_types_tells_of_every_method_and_event() -> None:
    text = (PROJECT / "docs/adding-a-vehicle-type.md").read_text()
    rows = re.findall(r"^\| (`[^|]*`) \|", text, re.MULTILINE)
    told = [call for row in rows for call in re.findall(r"`(\w+)(?:\(([^)]*)\))?`", row)]
    methods = {name: member for name, member in vars(FleetLink).items() if not name.startswith("_")}
    for name, given in told:
        member = methods.pop(name, None)
        if inspect.isfunction(member):
            parameters = list(inspect.signature(member).parameters)[1:]
            assert [one.split("=")[0].strip() for one in given.split(",") if one.strip()] == parameters
    assert not methods
    assert {event.__name__ for event in get_args(FleetEvent)} <= {name for name, _ in told}
