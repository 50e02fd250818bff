"""A survey as it is stored."""

import zlib

import numpy as np
import pytest

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.sites import Survey
from app.mapping.types import Grid
from app.missions.maps.survey_codec import pack_survey, unpack_survey


def test_a_survey_comes_back_as_it_was_stored() -> None:
    rng = np.random.default_rng(0)
    depth = rng.uniform(1, 11_000, (20, 30))
    depth[3:5] = np.nan
    survey = Survey(Grid(1.0, -2.0, 0.5, 20, 30), depth, 0.1 + 0.0 * depth, np.isfinite(depth), 5.5, 0.2, 7.0)
    found, frame = unpack_survey(pack_survey(survey, LocalFrame(41.1, -8.7)))
    assert (found.grid, found.time_s, found.shared_sd_m, found.correlation_length_m) == (survey.grid, 5.5, 0.2, 7.0)
    assert (frame.origin_lat_deg, frame.origin_lon_deg) == (41.1, -8.7)
    np.testing.assert_allclose(found.depth_m, depth, atol=5e-4)
    np.testing.assert_allclose(found.sd_m, survey.sd_m, rtol=1e-6)
    np.testing.assert_array_equal(found.sounded, survey.sounded)


@pytest.mark.parametrize("content", [b"", b"nothing", zlib.compress(b"nothing")])
def test_other_bytes_are_refused(content: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - numpy's own words
        unpack_survey(content)
