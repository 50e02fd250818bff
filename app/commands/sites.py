"""``bathyfleet sites``: places that are surveyed again and again."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.command import Database, command_settings, id_with_prefix
from app.commands.data import write_product
from app.commands.stored_missions import with_missions

if TYPE_CHECKING:
    from app.missions.maps.products import Product
    from app.missions.service import MissionService
    from app.missions.views.maps.sites import SiteView, SurveyView

sites_app = typer.Typer(help="List sites, and write their maps and what changed to files.", no_args_is_help=True)

Site = Annotated[str, typer.Argument(metavar="SITE", help="Its id, or the begin of it.")]
CHANGES = "changes."


async def _meant(service: "MissionService", begin: str) -> "SiteView":
    known = {site.id: site for site in await service.sites.all()}
    named = {site.id: site.name for site in known.values()}
    return known[id_with_prefix(begin, named, "sites", "in this database")]


@sites_app.command("list")
def list_sites(database: Database = None) -> None:
    """List the sites, newest first, with their surveys."""
    from imc_bridge.printable import printable

    async def run(service: "MissionService") -> "list[tuple[SiteView, list[SurveyView]]]":
        return [(site, await service.site_models.surveys(site.id)) for site in await service.sites.all()]

    found = with_missions(command_settings(database_url=database), run)
    if not found:
        typer.echo("there are no sites; POST /api/v1/sites describes one")
    for site, surveys in found:
        typer.echo(f"{site.id}  {printable(site.name)}, cells of {site.cell_m:g} m, {site.surveys} surveys")
        for survey in surveys:
            what = "no survey yet"
            if survey.ended_at is not None:
                what = f"{survey.ended_at:%Y-%m-%d %H:%M}, {survey.share_pct:.0f} % of the site"
                what += f", sd {survey.median_sd_m:.2f} m" if survey.median_sd_m is not None else ""
            why = f" ({survey.left_out})" if survey.left_out else ""
            typer.echo(f"    {survey.mission_id}  {printable(survey.name)}: {what}{why}")


@sites_app.command("export")
def export_site(
    site: Site,
    format: Annotated[  # noqa: A002 - the option's name
        str,
        typer.Option(
            "--format",
            "-f",
            help="tif, png or xyz: its map; geojson, kml or dxf: contours; changes.tif, changes.csv or changes.png.",
        ),
    ] = "tif",
    earlier: Annotated[
        str | None,
        typer.Option("--from", help="Mission of the earlier survey.", show_default="the one before the other"),
    ] = None,
    later: Annotated[
        str | None,
        typer.Option("--to", help="Mission of the later survey.", show_default="the newest that can be compared"),
    ] = None,
    confidence: Annotated[
        float, typer.Option(min=0.5, max=0.9999, help="Of unchanged ground this share is not called changed.")
    ] = 0.95,
    crs: Annotated[
        str | None,
        typer.Option(help="System of positions in tif, xyz, dxf: utm or EPSG:32629, ….", show_default="the site's own"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; '-' is stdout.", show_default="in output_dir")
    ] = None,
    database: Database = None,
) -> None:
    """Write a site's map, or what changed between two of its surveys, to a file; no service has to run."""
    settings = command_settings(database_url=database)
    from app.missions.maps.site_files import CHANGE_FILES, MAP_FILES, changes_file, site_map_file

    formats = [*MAP_FILES, *(f"{CHANGES}{ending}" for ending in CHANGE_FILES)]
    if format not in formats:
        raise typer.BadParameter(f"{format!r} is not one of {', '.join(formats)}", param_hint="--format")
    if crs is not None and not (format in MAP_FILES and MAP_FILES[format].projected):
        heeding = ", ".join(name for name, kind in MAP_FILES.items() if kind.projected)
        raise typer.BadParameter(f"{format} does not depend on it, {heeding} do", param_hint="--crs")

    async def run(service: "MissionService") -> "Product":
        meant = (await _meant(service, site)).id
        for survey in await service.site_models.surveys(meant):
            if survey.left_out:
                typer.echo(f"note: mission {survey.mission_id} is left out: {survey.left_out}", err=True)
        if format in MAP_FILES:
            return site_map_file(format, await service.site_models.map(meant), crs)
        change = await service.site_models.changes(meant, earlier, later, confidence)
        return changes_file(format.removeprefix(CHANGES), change)

    product = with_missions(settings, run)
    if out == Path("-"):
        sys.stdout.buffer.writelines(product.content.pieces())
        return
    write_product(product, out, settings.output_dir)
