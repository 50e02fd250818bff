"""All subcommands of ``bathyfleet evaluate``."""

from app.evaluation import pcao_cli, rescue_cli, track_cli  # noqa: F401 - they add their commands
from app.evaluation.cli import evaluate_app

__all__ = ["evaluate_app"]
