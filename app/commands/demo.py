"""The command that shows a whole mission, or a search, with simulated vehicles."""

from pathlib import Path
from typing import Annotated

import typer

from app.commands.command import CommandError

DEMO_FOLDER = Path("bathyfleet-demo")


def demo(
    speed: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=200,
            help="How much faster than real time.",
            show_default="5, less on a slow or busy machine",
        ),
    ] = None,
    terrain: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            dir_okay=False,
            readable=True,
            help="Sea floor: .npz, .asc, GeoTIFF, .xyz or .csv.",
            show_default="generated",
        ),
    ] = None,
    vehicles: Annotated[int, typer.Option(min=1, max=20, help="Number of simulated AUVs.")] = 2,
    steps: Annotated[
        int | None, typer.Option(min=1, max=100_000, help="Steps of the mission.", show_default="60")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.1, max=10_080, help="Instead of steps: minutes under way, of vehicle time.")
    ] = None,
    km: Annotated[
        float | None, typer.Option(min=0.01, max=1000, help="Instead of steps: kilometres that each vehicle flies.")
    ] = None,
    search: Annotated[
        str | None,
        typer.Option(
            metavar="SITE",
            help="Search a partly known site instead: harbour, car-park-1, car-park-2 or car-park-3, with boats.",
        ),
    ] = None,
    window: Annotated[
        float, typer.Option(min=30, max=86_400, help="Time for a search, seconds of vehicle time.")
    ] = 1800,
    keep_serving: Annotated[bool, typer.Option("--keep-serving", help="Go on serving after the mission.")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port of the service; 0: any free one.")] = 8080,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sea floor and every random decision.")] = 0,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder for the files.")] = DEMO_FOLDER,
) -> None:
    """Try it without a vehicle: a whole mission with simulated AUVs that speak IMC, from start to map."""
    from app.compiled.cache import compile_beside

    compile_beside()
    from app.demo.service import DemoError
    from app.demo.survey import DemoOptions, run_demo

    lengths = {"--steps": steps, "--minutes": minutes, "--km": km}
    given = [option for option, value in lengths.items() if value is not None]
    if len(given) > 1:
        raise CommandError(f"{' and '.join(given)} are given", "a mission has one length: leave out all but one")
    if search is not None and given:
        raise CommandError(f"{given[0]}: a search is as long as its time window", "give --window in seconds")
    if search is not None:
        raise typer.Exit(_search_demo(search, vehicles, window, speed, seed, port, output, keep_serving=keep_serving))
    options = DemoOptions(
        vehicles=vehicles,
        steps=steps if given else 60,
        minutes=minutes,
        km=km,
        speed=_demo_speed(speed),
        terrain=terrain,
        seed=seed,
        port=port,
        keep_serving=keep_serving,
        output=output,
    )
    try:
        code = run_demo(options)
    except DemoError as error:
        raise CommandError(str(error)) from None
    raise typer.Exit(code)


def _demo_speed(asked: float | None) -> float:
    """Return how much faster than real time a demonstration runs: as asked for, or as this machine can."""
    from app.demo.pace import FASTEST, kept_speed

    speed = kept_speed() if asked is None else asked
    if asked is None and speed < FASTEST:
        typer.echo(f"This machine is slow or busy: vehicles live {speed:g} times as fast as the clock (--speed).")
    return speed


def _search_demo(
    site: str,
    vehicles: int,
    window_s: float,
    speed: float | None,
    seed: int,
    port: int,
    output: Path,
    *,
    keep_serving: bool,
) -> int:
    from app.demo.search import SearchDemoOptions, run_search_demo
    from app.demo.service import DemoError
    from app.missions.search.examples import SITES

    if site not in SITES:
        raise CommandError(f"--search: there is no {site!r}", f"choose one of {', '.join(SITES)}")
    options = SearchDemoOptions(site, vehicles, window_s, _demo_speed(speed), seed, port, keep_serving, output)
    try:
        return run_search_demo(options)
    except DemoError as error:
        raise CommandError(str(error)) from None
