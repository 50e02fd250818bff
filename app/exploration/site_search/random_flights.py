"""ACCESS13's other baseline: random flights of Levy's kind (its reference 38)."""

from typing import Any, ClassVar

import numpy as np

from app.arrays import FloatArray
from app.exploration.planner.base import vehicle_rng
from app.exploration.site_search.base import SearchPlanner, hold
from app.exploration.site_search.scene import Scene

EXPONENT = 2.0
"""Of the distribution of flights' lengths: the one that finds most where targets are sparse."""
TRIES = 32


class RandomFlights(SearchPlanner):
    """Goes straight for a length drawn from a power law, or until something is ahead, then in another direction."""

    name: ClassVar[str] = "random"
    own_options: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._flights: dict[str, tuple[float, float]] = {}

    def _seek(self, scene: Scene, seed: int) -> FloatArray:
        wishes = hold(scene)
        for i, name in enumerate(scene.team.vehicles):
            rng, here = vehicle_rng(seed, name), wishes[i].copy()
            bearing, left = self._flights.get(name, (0.0, 0.0))
            for _ in range(TRIES):
                if left > 0.0:
                    end = here + scene.step_m * np.array([np.sin(bearing), np.cos(bearing)])
                    if scene.ground.clear(here, end[None])[0]:
                        wishes[i] = end
                        break
                bearing = float(rng.uniform(0.0, 2.0 * np.pi))
                left = scene.step_m * float((1.0 - rng.random()) ** (-1.0 / (EXPONENT - 1.0)))
            self._flights[name] = (bearing, left - scene.step_m)
        return wishes

    def _remember(self) -> dict[str, Any]:
        return {"flights": {name: list(flight) for name, flight in self._flights.items()}}

    def _recall(self, state: dict[str, Any]) -> None:
        self._flights = {str(name): (float(b), float(left)) for name, (b, left) in state["flights"].items()}
