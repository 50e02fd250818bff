"""A site's depths from several surveys, and what changed between two of them.

``Survey`` is what one survey alone found, ``SiteFusion`` makes the site's model of several, ``compare`` says what
changed between two.
"""

from app.mapping.sites.change import Change, Volume, compare
from app.mapping.sites.model import SiteFusion, SiteModel, fuse_surveys
from app.mapping.sites.survey import Survey, resample, survey_of

__all__ = ["Change", "SiteFusion", "SiteModel", "Survey", "Volume", "compare", "fuse_surveys", "resample", "survey_of"]
