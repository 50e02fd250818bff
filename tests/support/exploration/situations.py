import numpy as np

from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation

SQUARE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])


def make_belief(seed: int = 0, *, known: bool = True, cell: float = 4.0) -> Belief:
    """Nodes on the square, with depths and roughness drawn at random."""
    axis = np.arange(cell / 2, 100.0, cell)
    east, north = np.meshgrid(axis, axis)
    xy = np.column_stack([east.ravel(), north.ravel()])
    rng = np.random.default_rng(seed)
    n = len(xy)
    if not known:
        return Belief(xy, np.full(n, np.nan), np.full(n, np.inf), np.zeros(n, dtype=bool), np.ones(n), 20.0)
    depth = 9.0 + 3.0 * np.sin(xy[:, 0] / 17.0) + rng.normal(0.0, 0.3, n)
    weight = rng.gamma(2.0, 0.5, n)
    return Belief(xy, depth, rng.uniform(0.05, 0.8, n), rng.random(n) < 0.2, weight, 20.0)


def make_situation(
    step: int = 1,
    *,
    steps: int = 60,
    vehicles: tuple[str, ...] = ("a", "b"),
    positions: np.ndarray | None = None,
    belief: Belief | None = None,
    soundings: np.ndarray | None = None,
    constraints: Constraints | None = None,
) -> Situation:
    """A survey situation in the square; vehicles side by side at 2 m depth unless told otherwise."""
    n = len(vehicles)
    at = (
        np.column_stack([3.0 + 6.0 * np.arange(n), np.full(n, 3.0), np.full(n, 2.0)])
        if positions is None
        else positions
    )
    return Situation(
        step,
        steps,
        vehicles,
        at,
        np.full(n, np.nan),
        make_belief() if belief is None else belief,
        np.zeros((0, 2)) if soundings is None else soundings,
        Constraints(SQUARE, max_step_m=10.0, max_depth_m=20.0) if constraints is None else constraints,
    )
