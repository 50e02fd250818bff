"""Random candidate moves of a team (AURO15 eq. 22)."""

import numpy as np

from app.arrays import FloatArray
from app.exploration.planner.base import vehicle_rng


def team_moves(seed: int, vehicles: tuple[str, ...], n: int, dims: int, step: float, alpha: float) -> FloatArray:
    """Return candidate moves (n, n_vehicles, dims), none longer than ``step``.

    Each mixes one direction that the whole team shares with the vehicles' own ones, from all own to all shared: under a
    communication limit vehicles that move each its own way hold each other back. Three of four are whole steps, the
    others have the size ``alpha * step * zeta``.
    """
    own = [vehicle_rng(seed, name).standard_normal((n, dims)) for name in vehicles]
    common = np.random.default_rng([seed, 2]).standard_normal((n, 1, dims))
    mix = np.linspace(0.0, 1.0, n)[:, None, None]
    zeta = mix * common + (1.0 - mix) * np.stack(own, axis=1)
    length = np.maximum(np.linalg.norm(zeta, axis=2, keepdims=True), 1e-12)
    whole = (np.arange(n) % 4 != 3)[:, None, None]
    moves = np.where(whole, step * zeta / length, alpha * step * zeta)
    moves *= np.minimum(1.0, step / np.maximum(np.linalg.norm(moves, axis=2, keepdims=True), 1e-12))
    return np.asarray(moves, dtype=np.float64)
