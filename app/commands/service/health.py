"""The command that asks the service of these settings how it is, for whoever watches over it."""

from typing import Annotated

import typer

from app.commands.command import CommandError, command_settings
from app.commands.running_service import own_url

PATIENCE_S = 4.0


def health(
    ready: Annotated[
        bool, typer.Option("--ready", help="Ask whether it can do its work, not only whether it lives.")
    ] = False,
    host: Annotated[str | None, typer.Option(help="Address that it listens on.", show_default="as for serve")] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Its TCP port.", show_default="as for serve")
    ] = None,
) -> None:
    """Ask the service that runs here with these settings how it is.

    Exit code 1 when it does not answer, or is not well.
    """
    settings = command_settings(host=host, port=port)
    import httpx

    url = own_url(settings)
    try:
        # Nothing secret is told, so any certificate will do: it is for another name, and its file may be newer than the
        # service's start. A proxy has no part in this.
        with httpx.Client(verify=False, trust_env=False, timeout=PATIENCE_S) as client:  # noqa: S501
            answer = client.get(f"{url}/health/{'ready' if ready else 'live'}")
            said = answer.json()
    except httpx.HTTPError as error:
        raise CommandError(f"{url} does not answer: {error}", "Is the service running with these settings?") from None
    except ValueError:
        raise CommandError(f"{url} answers, but not as bathyfleet does", "Is the port another program's?") from None
    if not isinstance(said, dict) or "status" not in said:
        raise CommandError(f"{url} answers, but not as bathyfleet does", "Is the port another program's?")
    components = ", ".join(f"{name} {state}" for name, state in said.get("components", {}).items())
    if not answer.is_success:
        raise CommandError(f"{url} is not well: {components or answer.status_code}")
    typer.echo(f"{url} is well{f': {components}' if components else ''}")
