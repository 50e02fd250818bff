"""Search of a partly known site under a time window (ACCESS13): what is sought, what counts, where one may go."""

from app.exploration.core.search_task import SearchTask

__all__ = ["SearchTask"]
