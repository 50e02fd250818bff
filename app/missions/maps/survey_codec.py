"""What a mission found of its site as bytes, to the precision of half a millimetre at the sea's greatest depth."""

import io
import json
import zlib

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.sites import Survey
from app.mapping.types import Grid

FASTEST = 1


def pack_survey(survey: Survey, frame: LocalFrame) -> bytes:
    """Return a survey on its mission's grid, in its frame, as bytes."""
    grid = survey.grid
    facts = {
        "origin": [frame.origin_lat_deg, frame.origin_lon_deg],
        "grid": [grid.west_m, grid.south_m, grid.cell_m, grid.rows, grid.cols],
        "time_s": survey.time_s,
        "shared_sd_m": survey.shared_sd_m,
        "correlation_length_m": survey.correlation_length_m,
    }
    content = io.BytesIO()
    np.savez(
        content,
        allow_pickle=False,
        depth_m=survey.depth_m.astype("<f4"),
        sd_m=survey.sd_m.astype("<f4"),
        sounded=survey.sounded,
        facts=np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8),
    )
    return zlib.compress(content.getbuffer(), FASTEST)


def unpack_survey(content: bytes) -> tuple[Survey, LocalFrame]:
    """Return a survey and the frame of its grid. Raises ValueError for bytes that are none."""
    try:
        with np.load(io.BytesIO(zlib.decompress(content)), allow_pickle=False) as stored:
            facts = json.loads(stored["facts"].tobytes())
            depth, sd, sounded = stored["depth_m"].astype(float), stored["sd_m"].astype(float), stored["sounded"]
        survey = Survey(
            Grid(*facts["grid"]),
            depth,
            sd,
            sounded,
            facts["time_s"],
            facts["shared_sd_m"],
            facts["correlation_length_m"],
        )
        return survey, LocalFrame(*facts["origin"])
    except (zlib.error, KeyError, TypeError, OSError) as error:
        raise ValueError(f"this is no stored survey: {error}") from error
