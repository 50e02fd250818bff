"""All subcommands of ``bathyfleet evaluate``: planners against each other, without a network."""

from app.evaluation.adjust import cli as adjust_cli
from app.evaluation.coverage import cli as coverage_cli
from app.evaluation.explore import cli as explore_cli
from app.evaluation.generalize import cli as generalize_cli
from app.evaluation.pcao import cli as pcao_cli
from app.evaluation.runs.command import evaluate_app
from app.evaluation.search import cli as search_cli
from app.evaluation.survey import cli as survey_cli
from app.evaluation.track import cli as track_cli

__all__ = [
    "adjust_cli",
    "coverage_cli",
    "evaluate_app",
    "explore_cli",
    "generalize_cli",
    "pcao_cli",
    "search_cli",
    "survey_cli",
    "track_cli",
]
