"""The patch test: how a swath sonar is mounted, from what several lines of its vehicle saw of the same ground.

:func:`passes_of` cuts a track into lines, :class:`SharedGround` chooses ground that lines share, and :func:`estimate`
finds the mounting with which they agree on it.
"""

from app.mapping.swath.patch_test.beams import PatchBeams, with_only
from app.mapping.swath.patch_test.evaluation import (
    PARAMETERS,
    Known,
    LineAgreement,
    MountingEstimate,
    NoOverlapError,
    NotWantedError,
    ParameterEstimate,
    block_size_m,
    estimate,
)
from app.mapping.swath.patch_test.ground import ChosenGround, SharedGround
from app.mapping.swath.patch_test.passes import Passes, passes_of
from app.mapping.swath.patch_test.solution import LineErrors

__all__ = [
    "PARAMETERS",
    "LineAgreement",
    "ChosenGround",
    "Known",
    "LineErrors",
    "MountingEstimate",
    "NoOverlapError",
    "NotWantedError",
    "ParameterEstimate",
    "Passes",
    "PatchBeams",
    "SharedGround",
    "block_size_m",
    "estimate",
    "passes_of",
    "with_only",
]
