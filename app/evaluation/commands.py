"""All subcommands of ``bathyfleet evaluate``."""

from app.evaluation.cli import evaluate_app
from app.evaluation.pcao import cli as pcao_cli
from app.evaluation.search import cli as search_cli
from app.evaluation.track import cli as track_cli

__all__ = ["evaluate_app", "pcao_cli", "search_cli", "track_cli"]
