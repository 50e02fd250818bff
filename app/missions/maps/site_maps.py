"""A site's model and its changes, as JSON and as the layers of its files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.layers import Layer
from app.mapping.products.pictures.overlay import overlay_corners
from app.mapping.sites import Change, SiteModel, Survey, Volume
from app.mapping.types import BathymetricMap, Grid
from app.mapping.water.vertical import INSTANTANEOUS_WATER_LEVEL, VerticalDatum
from app.missions.maps.snapshot import nullable
from app.missions.spec.base import PolygonGeometry
from app.missions.views.maps.sites import ChangesView, SiteMapView, SurveyName, VolumeView

DAY_S = 86_400.0

LEAST_COLOUR_M = 0.01
"""Differences below this are not worth all colours of a picture."""


@dataclass(frozen=True)
class SiteFacts:
    """What every product of a site states; ``inside`` (rows, cols) are the cells that belong to it."""

    id: str
    name: str
    area: PolygonGeometry
    frame: LocalFrame
    grid: Grid
    inside: BoolArray


@dataclass(frozen=True)
class SiteSurvey:
    """A survey of a site: by which mission, and until when, Unix seconds."""

    mission_id: str
    name: str
    last_time_s: float
    vertical_datum: VerticalDatum

    @property
    def view(self) -> SurveyName:
        """Return it in short."""
        return SurveyName(mission_id=self.mission_id, name=self.name, at=moment(self.last_time_s))


@dataclass(frozen=True)
class SiteMap:
    """A site's model; ``surveys`` are what ``model.newest`` counts in."""

    facts: SiteFacts
    model: SiteModel
    surveys: Sequence[SiteSurvey]

    @property
    def datum(self) -> VerticalDatum:
        """Return what depths are counted from."""
        return self.surveys[-1].vertical_datum

    @property
    def known_pct(self) -> float:
        """Return the share of the site's cells that are known."""
        return 100.0 * float(self.model.known[self.facts.inside].mean())

    @property
    def age_days(self) -> FloatArray:
        """Return how old the newest survey of each cell is, (rows, cols); NaN without one."""
        times = np.array([survey.last_time_s for survey in self.surveys])
        known = self.model.known
        age = (self.model.at_s - times[np.where(known, self.model.newest, 0)]) / DAY_S
        return np.where(known, age, np.nan)

    @property
    def bathymetry(self) -> BathymetricMap:
        """Return it as a map; ``count`` are surveys."""
        model = self.model
        return BathymetricMap(
            grid=model.grid,
            depth_m=model.depth_m,
            sd_m=model.sd_m,
            count=model.surveys,
            sounded=model.sounded,
            roughness=np.where(self.facts.inside, 1.0, np.nan),
            correlation_length_m=0.0,
            model=f"surveys: {len(self.surveys)}, each cell from the last time that it changed",
        )

    def view(self) -> SiteMapView:
        """Return it as JSON shows it."""
        model, grid = self.model, self.model.grid
        known = model.known
        newest = model.newest.astype(object)
        newest[~known] = None
        return SiteMapView.model_construct(
            site_id=self.facts.id,
            at=moment(model.at_s),
            west_m=grid.west_m,
            south_m=grid.south_m,
            cell_m=grid.cell_m,
            rows=grid.rows,
            cols=grid.cols,
            corners=overlay_corners(grid, self.facts.frame),
            vertical_datum=self.datum.statement,
            known_pct=round(self.known_pct, 2),
            min_depth_m=_rounded(np.min, model.depth_m[known]),
            max_depth_m=_rounded(np.max, model.depth_m[known]),
            surveys=[survey.view for survey in self.surveys],
            depth_m=nullable(model.depth_m),
            sd_m=nullable(model.sd_m),
            survey=newest.tolist(),
            count=model.surveys.tolist(),
            sounded=model.sounded.tolist(),
        )

    def layers(self) -> list[Layer]:
        """Return what a raster has of it."""
        model = self.model
        number = np.where(model.known, model.newest + 1.0, np.nan)
        names = "; ".join(f"{i}: {one.mission_id}" for i, one in enumerate(self.surveys, start=1))
        return [
            Layer("depth", "depth from all surveys, positive down", "metre", model.depth_m),
            Layer("sd", "standard deviation of the depth, grown with its age", "metre", model.sd_m),
            Layer("age", "since the newest survey that counts", "day", self.age_days),
            Layer("survey", f"number of the newest survey that counts: {names}", "1", number),
            Layer("surveys", "surveys that count", "1", np.where(model.known, model.surveys, np.nan)),
        ]


@dataclass(frozen=True)
class SiteChange:
    """What changed at a site between two surveys; ``left_out`` says in words which others were passed over, and why."""

    facts: SiteFacts
    change: Change
    earlier: Survey
    later: Survey
    surveys: tuple[SiteSurvey, SiteSurvey]
    left_out: tuple[str, ...] = ()

    @property
    def last_colour_m(self) -> float:
        """Return the difference that a picture's last colour stands for; its first one stands for the negative."""
        compared = np.abs(self.change.difference_m[self.change.compared])
        return max(float(np.quantile(compared, 0.99)) if compared.size else 0.0, LEAST_COLOUR_M)

    def view(self) -> ChangesView:
        """Return it as JSON shows it."""
        change = self.change
        difference = change.difference_m[change.compared]
        cells = max(len(difference), 1)
        share = {sign: 100.0 * float((change.significant & (sign * change.difference_m > 0)).sum()) for sign in (1, -1)}
        return ChangesView(
            site_id=self.facts.id,
            earlier=self.surveys[0].view,
            later=self.surveys[1].view,
            confidence=change.confidence,
            compared_m2=len(difference) * change.grid.cell_m**2,
            significant_pct=round(change.significant_pct, 2),
            expected_pct=round(100.0 * (1.0 - change.confidence), 4),
            deeper_pct=round(share[1] / cells, 2),
            shoaler_pct=round(share[-1] / cells, 2),
            lost=_volume(change.lost),
            gained=_volume(change.gained),
            net=_volume(change.net),
            mean_m=_rounded(np.mean, difference),
            rms_m=_rounded(lambda values: np.sqrt(np.mean(values**2)), difference),
            median_sd_m=_rounded(np.median, change.sd_m[change.compared]),
            least_m=_rounded(np.min, difference),
            largest_m=_rounded(np.max, difference),
            last_colour_m=round(self.last_colour_m, 3),
            corners=overlay_corners(change.grid, self.facts.frame),
            vertical_datum=self.surveys[1].vertical_datum.statement,
            notes=self._notes(),
        )

    def _notes(self) -> list[str]:
        notes = list(self.left_out)
        if INSTANTANEOUS_WATER_LEVEL in (survey.vertical_datum.epsg for survey in self.surveys):
            notes.append("the water level is not corrected: where it differed, every difference holds that as well")
        if not self.change.compared.any():
            notes.append("the two surveys have no ground in common")
        return notes

    def layers(self) -> list[Layer]:
        """Return what a raster has of it."""
        change = self.change
        significant = np.where(change.compared, change.significant, np.nan)
        return [
            Layer("difference", "later depth less earlier depth, positive: deeper now", "metre", change.difference_m),
            Layer("sd", "standard deviation of the difference", "metre", change.sd_m),
            Layer("significance", "|difference| over its standard deviation", "1", change.significance),
            Layer("significant", f"1: changed, at {change.confidence:g}; 0: not told from chance", "1", significant),
        ]


def moment(time_s: float) -> datetime:
    """Return Unix seconds as a time."""
    return datetime.fromtimestamp(time_s, UTC)


def _volume(volume: Volume) -> VolumeView:
    return VolumeView(m3=round(volume.m3, 3), sd_m3=round(volume.sd_m3, 3))


def _rounded(figure: Callable[[FloatArray], Any], values: FloatArray) -> float | None:
    return round(float(figure(values)), 3) if values.size else None
