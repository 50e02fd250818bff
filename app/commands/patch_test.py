"""``bathyfleet patch-test``: how a sonar is mounted, by lines of its vehicle that overlap."""

from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from app.commands.command import Database, checked, command_settings
from app.commands.data import Token, Url
from app.commands.running_service import ask_service
from app.commands.stored_missions import meant_mission, resting_mission, with_missions

if TYPE_CHECKING:
    from app.missions.service import MissionService
    from app.missions.views.measurements.mounting_estimate import MountingEstimateView

UNITS = {"roll_deg": "degrees", "pitch_deg": "degrees", "heading_deg": "degrees", "latency_s": "s"}


def patch_test(
    mission: Annotated[str, typer.Argument(metavar="MISSION", help="Its id, or the begin of it.")],
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Whose sonar.")],
    position_sd: Annotated[
        float, typer.Option(help="How far a line may lie aside of another one as a whole, metres.")
    ] = 0.3,
    level_sd: Annotated[float, typer.Option(help="How far it may lie too deep as a whole, metres.")] = 0.05,
    apply: Annotated[bool, typer.Option("--apply", help="Correct the mounting by what is proposed.")] = False,
    url: Url = None,
    token: Token = None,
    database: Database = None,
) -> None:
    """Estimate how a sonar is mounted from lines of its vehicle that overlap; changes nothing unless told to."""
    from app.missions.operations.corrections.patch_test import estimate_mounting
    from app.missions.operations.corrections.recorrection import set_mounting
    from app.missions.views.measurements.mounting_estimate import MountingEstimateRequest, MountingEstimateView

    request = checked(MountingEstimateRequest, {"position_sd_m": position_sd, "level_sd_m": level_sd})
    if url is not None:
        path = f"mountings/{quote(vehicle, safe='')}"
        answer = ask_service(url, token, mission, "POST", f"{path}/estimate", json=request.model_dump(mode="json"))
        view = MountingEstimateView.model_validate(answer)
        if apply and view.proposal is not None:
            ask_service(url, token, mission, "PUT", path, json=view.proposal.model_dump(mode="json"))
    else:

        async def run(service: "MissionService") -> MountingEstimateView:
            live = await (resting_mission if apply else meant_mission)(service, mission)
            found = await estimate_mounting(live, vehicle, request)
            if apply and found.proposal is not None:
                await set_mounting(live, vehicle, found.proposal, "command line")
            return found

        settings = command_settings(database_url=database)
        view = with_missions(settings, run, changing="patch-test" if apply else "", mission=mission)
    _tell(view, applied=apply)


def _tell(view: "MountingEstimateView", *, applied: bool) -> None:
    for one in view.parameters:
        name, _, _ = one.name.value.partition("_")
        if one.value is None:
            typer.echo(f"{name:8} {one.known.value}: {one.why}")
        else:
            mark = ", proposed" if one.proposed else ""
            typer.echo(f"{name:8} {one.value:+.3f} ± {one.sd:.3f} {UNITS[one.name.value]}{mark}")
    typer.echo(
        f"{len(view.lines)} lines share {view.cells} cells; their depths differ by {view.before_m:.3f} m RMS, with "
        f"the estimates by {view.after_m:.3f} m"
    )
    if view.proposal is None:
        typer.echo("nothing is proposed: lines agree no better with it")
    elif applied:
        typer.echo(f"the mounting of {view.vehicle} is corrected: {view.proposal.statement}")
