"""Structured logs: one line per event, readable in a console or as JSON, with the request's id."""

import logging
import sys
from typing import Any, TextIO

import structlog

from app.log_choices import LogFormat
from imc_bridge.printable import printable

_OF_SEVERAL_LINES = frozenset(("exception", "stack"))


def _without_repetition(_logger: Any, _method: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
    """Drop what uvicorn and other handlers add: the message again."""
    event.pop("color_message", None)
    event.pop("message", None)
    return event


def _made_printable(_logger: Any, _method: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
    """Escape what a terminal would obey: paths, names and errors hold what strangers sent."""
    return {
        printable(key): printable(value, keep="\n\t" if key in _OF_SEVERAL_LINES else "")
        if isinstance(value, str)
        else value
        for key, value in event.items()
    }


class _Handler(logging.Handler):
    """Writes to ``stream``, or to whatever stderr is at the time."""

    def __init__(self, stream: TextIO | None) -> None:
        super().__init__()
        self._stream = stream

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record."""
        try:
            print(self.format(record), file=self._stream or sys.stderr, flush=True)
        except Exception:
            self.handleError(record)


def configure(level: str = "info", form: LogFormat = "console", stream: TextIO | None = None) -> None:
    """Send structlog's and the standard library's logs (uvicorn, SQLAlchemy, …) through one formatter.

    They go to ``stream``, by default to stderr.
    """
    shared: list[Any] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_logger_name,
        structlog.stdlib.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    final: list[Any]
    if form == "json":
        final = [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
    else:
        final = [
            structlog.processors.format_exc_info,
            _made_printable,
            structlog.dev.ConsoleRenderer(
                colors=(stream or sys.stderr).isatty(),
                pad_event_to=0,
                exception_formatter=structlog.dev.plain_traceback,
            ),
        ]
    handler = _Handler(stream)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[*shared, structlog.stdlib.ExtraAdder(), _without_repetition],
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *final],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [*(other for other in root.handlers if not isinstance(other, _Handler)), handler]
    root.setLevel(level.upper())
    # At their info level uvicorn's loggers write out addresses, with the keys and tokens in them.
    for name in ("uvicorn.error", "uvicorn.access"):
        logging.getLogger(name).setLevel(logging.WARNING)
    for name in ("uvicorn", "uvicorn.error", "uvicorn.access"):
        logger = logging.getLogger(name)
        logger.handlers.clear()
        logger.propagate = True
    for noisy in ("asyncio", "aiosqlite", "alembic", "matplotlib", "PIL", "rasterio", "numba", "httpx", "httpcore"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *shared,
            structlog.processors.StackInfoRenderer(),
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=True,
    )
