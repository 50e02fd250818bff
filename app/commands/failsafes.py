"""The command that prints what is done when something fails."""

import json
from typing import Annotated

import typer


def failsafes(*, as_json: Annotated[bool, typer.Option("--json", help="As JSON, for programs.")] = False) -> None:
    """Print the table of failsafes: what is detected, what is done, and for how long it must last."""
    from app.missions.recovery.failsafes import TABLE, table_text

    if not as_json:
        typer.echo(table_text(), nl=False)
        return
    typer.echo(
        json.dumps(
            [
                {
                    "failsafe": failsafe,
                    "detected": rule.detected,
                    "response": rule.response,
                    "after_s": rule.after_s,
                    "over_s": rule.over_s,
                    "shown": rule.shown,
                }
                for failsafe, rule in TABLE.items()
            ],
            indent=2,
        )
    )
