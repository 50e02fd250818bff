"""Settings that name a file which the service does without."""

from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator

OptionalFile = Annotated[Path | None, BeforeValidator(lambda given: None if given == "" else given)]
"""An empty text, as of a line like ``BATHYFLEET_TLS_KEY=``, is none; as a path it would be the working directory."""
