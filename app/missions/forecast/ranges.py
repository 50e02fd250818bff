"""How figures that differ from floor to floor are told."""

from app.missions.views.base import View

LOW, HIGH = 0.1, 0.9


class ForecastRange(View):
    """From where to where a figure went, over floors of different roughness: 10 % were below, 10 % above."""

    low: float
    high: float
