"""``bathyfleet demo --search``: boats look for something in a harbour of which only the quays are known."""

import asyncio
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from app.demo.service import DemoError, check, claimed, client, get, post, serve_during
from app.missions.search.examples import example
from app.settings import Settings
from app.storage import private

POLL_S = 0.4
ENDED = ("finished", "failed", "aborted")


@dataclass(frozen=True)
class SearchDemoOptions:
    """What can be chosen on the command line; see ``bathyfleet demo --help``."""

    site: str
    vehicles: int
    window_s: float
    speed: float
    seed: int
    port: int
    keep_serving: bool
    output: Path


def run_search_demo(options: SearchDemoOptions, console: Console | None = None) -> int:
    """Run the search; returns the exit code. Raises DemoError when something it needs is missing."""
    return asyncio.run(_SearchDemo(options, console or Console()).run())


class _SearchDemo:
    def __init__(self, options: SearchDemoOptions, console: Console) -> None:
        self._options = options
        self._console = console
        self._state = ""

    async def run(self) -> int:
        from app.api import logs
        from app.missions.settings import ImcSettings

        options, folder = self._options, self._options.output
        private.make_folder(folder)
        settings = Settings(
            port=options.port,
            database_url=f"sqlite+aiosqlite:///{folder / 'search.db'}",
            time_scale=options.speed,
            output_dir=folder,
            imc=ImcSettings(enabled=False),
        )
        with claimed(settings, folder / "search.db"):
            logs.configure("info", "json", private.open_new(folder / "service.log"))
            done = await serve_during(settings, self._search, keep_serving=options.keep_serving, console=self._console)
        if not done:
            self._console.print(f"Stopped. What was seen is kept in [bold]{folder / 'search.db'}[/].")
            return 130
        return 0 if self._state == "finished" else 1

    async def _search(self, url: str) -> None:
        options, folder = self._options, self._options.output
        spec = example(options.site, seed=options.seed, vehicles=options.vehicles, window_s=options.window_s)
        private.write(folder / "mission.json", json.dumps(spec, indent=1))
        async with client(url) as api:
            mission = await post(api, "/missions", spec)
            path = f"/missions/{mission['id']}"
            self._console.print(f"Dashboard: [bold]{url}/#{path}[/]", soft_wrap=True)
            await post(api, f"{path}/start")
            last = await self._watch(api, path)
            if self._state != "finished":
                raise DemoError(f"the mission is {self._state}: {last['reason']}")
            answer = await api.get(f"{path}/search/obstacles.geojson")
            check(answer)
            private.write(folder / "obstacles.geojson", answer.content)
        found = last["progress"]["search"]
        result = {key: found[key] for key in ("goal_pct", "explored_pct", "found_cells", "left_s", "back")}
        private.write(folder / "result.json", json.dumps(result, indent=2))
        self._console.print(
            f"Goal area seen: {found['goal_pct']:.1f} %, site: {found['explored_pct']:.1f} %. "
            f"Back at the entry: {', '.join(found['back']) or 'nobody'}, {found['left_s']:.0f} s before the end.\n"
            f"Files in [bold]{folder}[/]: mission.json (what was posted), obstacles.geojson, result.json"
        )

    async def _watch(self, api: httpx.AsyncClient, path: str) -> dict[str, Any]:
        """Show how the search stands until it has ended; returns the mission as it is then."""
        bar = Progress(
            TextColumn("goal area"),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[goal]:5.1f} %  site {task.fields[site]:5.1f} %  left {task.fields[left]:5.0f} s"),
            TimeElapsedColumn(),
            console=self._console,
        )
        with bar:
            task = bar.add_task("", total=100.0, goal=0.0, site=0.0, left=self._options.window_s)
            while True:
                mission: dict[str, Any] = await get(api, path)
                search = mission["progress"]["search"]
                fields = {"goal": search["goal_pct"], "site": search["explored_pct"], "left": search["left_s"]}
                bar.update(task, completed=search["goal_pct"], **fields)
                self._state = mission["state"]
                if self._state in ENDED:
                    return mission
                await asyncio.sleep(POLL_S)
