"""Sound speed casts that vehicles measured, as they are answered."""

from collections.abc import Sequence
from datetime import UTC, datetime

from pydantic import ValidationError

from app.mapping.water.measured_casts import MeasuredCast
from app.missions.views.measurements.soundings import MeasuredCastView


def shown_casts(casts: Sequence[MeasuredCast]) -> list[MeasuredCastView]:
    """Return casts as they are shown, without those that cannot be: nobody vouches for what vehicles tell."""
    found = []
    for cast in casts:
        try:
            found.append(
                MeasuredCastView(
                    time=datetime.fromtimestamp(cast.time_s, UTC),
                    position=(cast.lon_deg, cast.lat_deg),
                    profile=cast.profile,
                    sd_mps=cast.sd_mps,
                    samples=cast.samples,
                    bins=cast.bins,
                    lag_mps=cast.lag_mps,
                )
            )
        except (ValidationError, ValueError, OverflowError, OSError):
            continue
    return found
