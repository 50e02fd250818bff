"""``bathyfleet export``, ``report``, ``import`` and ``tide``: what goes into a mission and what comes out of it."""

import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.command import CommandError, Database, checked, command_settings
from app.commands.running_service import ask_service
from app.commands.stored_missions import meant_mission, resting_mission, with_missions

if TYPE_CHECKING:
    from app.missions.maps.products import Product
    from app.missions.service import MissionService


def _list_formats(wanted: bool) -> None:
    if wanted:
        from app.missions.maps.products import PRODUCTS

        for name, kind in PRODUCTS.items():
            typer.echo(f"{name:20} {kind.title}")
        raise typer.Exit


def export(
    mission: Annotated[str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.")],
    format: Annotated[  # noqa: A002 - the option's name
        str | None, typer.Option("--format", "-f", help="Kind of file; --formats lists them.", show_default="tif")
    ] = None,
    formats: Annotated[
        bool, typer.Option("--formats", help="List the kinds of files.", callback=_list_formats, is_eager=True)
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; '-' is stdout.", show_default="in output_dir")
    ] = None,
    order: Annotated[
        str | None,
        typer.Option(
            help="IHO S-44 order that the TVU is compared with: exclusive, special, 1a, 1b or 2.", show_default="1a"
        ),
    ] = None,
    interval: Annotated[
        float | None,
        typer.Option(min=0.01, max=1000, help="Metres between contours.", show_default="about ten contours"),
    ] = None,
    vehicle: Annotated[
        str | None, typer.Option(help="Whose soundings, for soundings.geojson.", show_default="the only vehicle's")
    ] = None,
    crs: Annotated[
        str | None,
        typer.Option(help="System of positions: utm or EPSG:32629, ….", show_default="the mission's own, or degrees"),
    ] = None,
    database: Database = None,
) -> None:
    """Write a mission's map, soundings or tracks to a file, from the database; no service has to run."""
    settings = command_settings(database_url=database)
    from app.mapping.s44 import Order
    from app.missions.maps.products import PRODUCTS, Product, ProductOptions
    from app.missions.operations.maps import mission_maps
    from app.missions.service import MissionService
    from app.missions.views.maps.map import FileOption

    wanted = format or "tif"
    if wanted not in PRODUCTS:
        raise typer.BadParameter(f"{wanted!r} is not one of {', '.join(PRODUCTS)}", param_hint="--format")
    if order is not None and order not in list(Order):
        raise typer.BadParameter(f"{order!r} is not one of {', '.join(Order)}", param_hint="--order")
    endings = {f".{kind.extension.rpartition('.')[2]}" for kind in PRODUCTS.values()} - {".tif"}
    if format is None and out is not None and out.suffix.lower() in endings:
        raise typer.BadParameter(f"{out} would be a GeoTIFF: say the kind of file by --format", param_hint="--out")
    for option, given, meant in (
        ("--order", order, FileOption.ORDER),
        ("--interval", interval, FileOption.INTERVAL),
        ("--vehicle", vehicle, FileOption.VEHICLE),
        ("--crs", crs, FileOption.CRS),
    ):
        if given is not None and meant not in PRODUCTS[wanted].options:
            heeding = ", ".join(name for name, kind in PRODUCTS.items() if meant in kind.options)
            raise typer.BadParameter(f"{wanted} does not depend on it, {heeding} do", param_hint=option)
    options = ProductOptions(Order(order or "1a"), interval, vehicle=vehicle, crs=crs)

    async def run(service: MissionService) -> Product:
        live = await meant_mission(service, mission)
        return await mission_maps.export(
            live, service.maps, service.settings.provider, service.compute, wanted, options
        )

    product = with_missions(settings, run)
    if out == Path("-"):
        sys.stdout.buffer.writelines(product.content.pieces())
        return
    write_product(product, out, settings.output_dir)


def report(
    mission: Annotated[str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="File to write, .pdf or .html.", show_default="a .pdf in output_dir"),
    ] = None,
    lang: Annotated[str, typer.Option(help="Language that it is written in: en or pt.")] = "en",
    order: Annotated[
        str, typer.Option(help="IHO S-44 order that crossings are compared with: exclusive, special, 1a, 1b or 2.")
    ] = "1a",
    database: Database = None,
) -> None:
    """Write a survey's report, from the database; no service has to run."""
    settings = command_settings(database_url=database)
    from app.mapping.s44 import Order
    from app.missions.maps.products import Product
    from app.missions.operations.reports import ReportOptions
    from app.missions.report.kinds import REPORTS
    from app.missions.report.texts import Language
    from app.missions.service import MissionService

    extension = "pdf" if out is None else out.suffix.lower().removeprefix(".")
    if extension not in REPORTS:
        raise typer.BadParameter(f"{out} ends in none of .{', .'.join(REPORTS)}", param_hint="--out")
    for value, known, option in ((order, Order, "--order"), (lang, Language, "--lang")):
        if value not in list(known):
            raise typer.BadParameter(f"{value!r} is not one of {', '.join(known)}", param_hint=option)
    options = ReportOptions(REPORTS[extension], Language(lang), Order(order))

    async def run(service: MissionService) -> Product:
        return await service.reports.report(await meant_mission(service, mission), options)

    write_product(with_missions(settings, run), out, settings.output_dir)


def write_product(product: "Product", out: Path | None, folder: Path) -> None:
    """Write a file that leaves the service; without ``out`` into a folder. Raises CommandError."""
    from app.storage import private

    path = out or folder / product.filename
    try:
        private.make_folder(path.parent)
        private.write(path, product.content.pieces())
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}") from None
    typer.echo(f"{path}: {product.content.size_bytes} bytes")


Url = Annotated[
    str | None,
    typer.Option(
        help="A running service to send it to, for example http://127.0.0.1:8080.", show_default="the database"
    ),
]
Token = Annotated[str | None, typer.Option(envvar="BATHYFLEET_TOKEN", help="Access token for the service at --url.")]


def import_file(
    mission: Annotated[str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.")],
    file: Annotated[
        Path,
        typer.Argument(
            exists=True,
            dir_okay=False,
            readable=True,
            help="Soundings or a map: .xyz, .csv, .txt (also with .gz), .asc, .tif, .nc, .bag, .h5 (S-102), "
            ".000 (ENC cell), .gsf or .kmall (multibeam sonars).",
        ),
    ],
    reference: Annotated[
        bool, typer.Option("--reference", help="Compare the map with it, instead of beginning with it.")
    ] = False,
    source: Annotated[str, typer.Option(help="Where it comes from, kept with the mission.")] = "",
    sd: Annotated[float | None, typer.Option(help="Standard deviation of depths that state none, metres.")] = None,
    order: Annotated[
        str | None, typer.Option(help="In place of --sd: the S-44 order surveyed to, whose largest TVU is assumed.")
    ] = None,
    crs: Annotated[
        str | None, typer.Option(help="What positions are in where the file does not say: EPSG:32629, …, or local.")
    ] = None,
    positive: Annotated[
        str | None, typer.Option(help="Which way values grow: down or up.", show_default="what the file says")
    ] = None,
    datum_offset: Annotated[
        float | None,
        typer.Option(help="Metres added to every depth to bring it to the mission's datum.", show_default="0"),
    ] = None,
    url: Url = None,
    token: Token = None,
    database: Database = None,
) -> None:
    """Begin a mission with soundings or a map from elsewhere. The same file again changes nothing."""
    from app.missions.operations.imports.uploads import open_upload
    from app.missions.views.measurements.imports import ImportOptions, ImportView, ReferenceView

    given = {
        "filename": file.name,
        "source": source,
        "crs": crs,
        "positive": positive,
        "sd_m": sd,
        "order": order,
        "datum_offset_m": datum_offset,
    }
    options = checked(ImportOptions, given)
    view: ImportView | ReferenceView
    if url is not None:
        path, method = ("reference", "PUT") if reference else ("imports", "POST")
        with file.open("rb") as content:
            answer = ask_service(
                url,
                token,
                mission,
                method,
                path,
                content=content,
                params=options.model_dump(exclude_none=True, mode="json"),
            )
        view = (ReferenceView if reference else ImportView).model_validate(answer)
    else:

        async def run(service: "MissionService") -> ImportView | ReferenceView:
            live = await resting_mission(service, mission)
            upload = await asyncio.to_thread(open_upload, file)
            with upload.file:
                if reference:
                    return await service.imports.set_reference(live, upload, options, "command line")
                return await service.imports.add(live, upload, options, "command line")

        view = with_missions(
            command_settings(database_url=database), run, changing="import", mission=f"{mission} {file.name}"
        )
    from imc_bridge.printable import printable

    for note in view.notes:
        typer.echo(f"note: {printable(note)}", err=True)
    if isinstance(view, ReferenceView):
        typer.echo(f"the map is compared with {printable(view.filename)} in {view.cells} cells")
    else:
        known = ", as before" if view.replayed else ""
        typer.echo(
            f"{view.taken} of {view.found} depths imported{known}: {view.min_depth_m:.2f} to {view.max_depth_m:.2f} m, "
            f"standard deviation {view.median_sd_m:.2f} m"
        )


def tide(
    mission: Annotated[str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.")],
    table: Annotated[
        Path | None,
        typer.Argument(
            exists=True,
            dir_okay=False,
            readable=True,
            help="Table of high and low waters, or of observed levels (.tid, gauge's export); default: --level.",
        ),
    ] = None,
    level: Annotated[
        float | None, typer.Option(help="Constant water level, metres, where there is no table.", show_default="0")
    ] = None,
    source: Annotated[str | None, typer.Option(help="Where it comes from, kept with the product.")] = None,
    sd: Annotated[float, typer.Option(help="Standard deviation of the level, metres.")] = 0.0,
    datum: Annotated[int, typer.Option(help="EPSG code of the depth datum.")] = 5861,
    datum_offset: Annotated[
        float, typer.Option(help="How far that datum lies above the zero of the levels, metres.")
    ] = 0.0,
    url: Url = None,
    token: Token = None,
    database: Database = None,
) -> None:
    """Correct a mission's tide, also afterwards: every sounding is corrected anew from its raw depth."""
    from app.missions.operations.corrections.recorrection import set_tide
    from app.missions.views.measurements.corrections import CorrectionsView, TideCorrection

    if level is not None and table is not None:
        raise typer.BadParameter("the table's levels would count: give one of them", param_hint="--level")
    try:
        text = None if table is None else table.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise CommandError(f"{table} is not text", "send a table of times and levels") from None
    given: dict[str, Any] = {
        "level_m": level or 0.0,
        "sd_m": sd,
        "datum_epsg": datum,
        "datum_offset_m": datum_offset,
        "table": text,
    }
    wanted = checked(TideCorrection, given if source is None else given | {"source": source})
    if url is not None:
        answer = ask_service(url, token, mission, "PUT", "tide", json=wanted.model_dump(mode="json"))
        view = CorrectionsView.model_validate(answer)
    else:

        async def run(service: "MissionService") -> CorrectionsView:
            return await set_tide(await resting_mission(service, mission), wanted, "command line")

        view = with_missions(command_settings(database_url=database), run, changing="tide", mission=mission)
    typer.echo(f"depths are below {view.vertical_datum}; {view.accepted} soundings accepted, {view.rejected} rejected")
    if view.tide_table is not None and view.tide_table.utc_assumed:
        typer.echo("the table states no zone for its times: they are taken for UTC")


def adjust(
    mission: Annotated[str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.")],
    undo: Annotated[bool, typer.Option("--undo", help="Take positions as they came again.")] = False,
    fixes: Annotated[
        Path | None,
        typer.Option(
            exists=True, dir_okay=False, readable=True, help="JSON: a list of fixes as POST …/adjustment takes them."
        ),
    ] = None,
    url: Url = None,
    token: Token = None,
    database: Database = None,
) -> None:
    """Adjust a mission's tracks for their drift, by overlapping soundings and fixes; repeat it when logs came in."""
    import json

    from app.missions.operations.corrections import adjustment
    from app.missions.views.measurements.adjustment import AdjustmentRequest, AdjustmentView

    if undo and fixes is not None:
        raise typer.BadParameter("positions as they came have no fixes: give one of them", param_hint="--fixes")
    try:
        given = {} if fixes is None else {"fixes": json.loads(fixes.read_text(encoding="utf-8"))}
    except ValueError as error:
        raise CommandError(f"{fixes} is not JSON: {error}", "send a list of fixes") from None
    request = checked(AdjustmentRequest, given)
    if url is not None:
        content: dict[str, Any] = {} if undo else {"json": request.model_dump(mode="json")}
        answer = ask_service(url, token, mission, "DELETE" if undo else "POST", "adjustment", **content)
        view = AdjustmentView.model_validate(answer)
    else:

        async def run(service: "MissionService") -> AdjustmentView:
            live = await resting_mission(service, mission)
            if undo:
                return await adjustment.undo(live, "command line")
            return await adjustment.adjust(live, request, "command line")

        view = with_missions(command_settings(database_url=database), run, changing="adjust", mission=mission)
    if not view.applied:
        told = "" if undo else f": no fix is known, and of {view.ties_rejected} sections none tells enough"
        typer.echo(f"positions are taken as they came{told}")
        return
    how = f"{view.ties_used} ties and {view.fixes} fixes" if view.by_ties else f"{view.fixes} fixes alone"
    typer.echo(f"tracks are adjusted by {how}; {view.ties_rejected} ties were rejected")
    if view.held_out is not None:
        typer.echo(
            f"depths of {view.held_out.sections} sections that were held out, less those of others: "
            f"{view.held_out.before_m:.3f} m before, {view.held_out.by_fixes_m:.3f} m by fixes alone, "
            f"{view.held_out.after_m:.3f} m by ties too (RMS)"
        )
    for track in view.tracks:
        typer.echo(
            f"{track.vehicle}: moved by {track.mean_m:.2f} m on the mean, {track.max_m:.2f} m at most; "
            f"deviation {track.sd_m:.2f} m, before {track.before_sd_m:.2f} m"
        )
