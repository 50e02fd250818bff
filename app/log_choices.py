"""The choices of how logs are written, as the settings and the command line offer them. Imports nothing heavy."""

from typing import Literal

LogLevel = Literal["debug", "info", "warning", "error"]
"""How much is logged."""

LogFormat = Literal["console", "json"]
"""How it is written."""
