import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.estimation import in_sight
from simulator.floors.terrain import Terrain


def place(terrain: Terrain, rng: np.random.Generator, n: int, height: float) -> FloatArray:
    en = rng.uniform(0.0, [terrain.width_m, terrain.height_m], (n, 2))
    return np.column_stack([en, terrain.depth_at(en[:, 0], en[:, 1]) - height])


def deepest_below_floor(terrain: Terrain, a: FloatArray, b: FloatArray, samples: int = 4000) -> float:
    """How far the ray from a to b runs below the floor, looked at very closely."""
    t = np.linspace(0.0, 1.0, samples)[1:-1, None]
    ray = a + t * (b - a)
    return (ray[:, 2] - terrain.depth_at(ray[:, 0], ray[:, 1])).max()


@given(seed=st.integers(0, 1000))
@settings(max_examples=15, deadline=None)
def test_sight_agrees_with_a_close_look_at_every_ray(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terrain = Terrain(rng.uniform(5.0, 12.0, (9, 13)), 2.0)
    vehicles, landmarks = place(terrain, rng, 4, 1.0), place(terrain, rng, 25, 0.0)
    seen = in_sight(vehicles, landmarks, terrain.z_m, 0.0, 0.0, 2.0)
    for i, vehicle in enumerate(vehicles):
        for m, landmark in enumerate(landmarks):
            below = deepest_below_floor(terrain, vehicle, landmark)
            # Between two samples a ray may pass below a small hump; the other way round there is no doubt.
            assert below > 0.0 if not seen[i, m] else below < 2.0


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_a_plane_hides_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    east, north = np.meshgrid(np.arange(8) + 0.5, np.arange(8) + 0.5)
    a, b = rng.uniform(-1, 1, 2)
    plane = 20.0 + a * east + b * north
    at = rng.uniform(1.0, 7.0, (10, 2))
    landmarks = np.column_stack([at, 20.0 + at @ [a, b]])
    vehicles = landmarks[:3] - [0.0, 0.0, 0.3]
    assert in_sight(vehicles, landmarks, plane, 0.0, 0.0, 1.0).all()


def test_a_wall_hides_what_lies_behind_until_the_vehicle_rises_above_it() -> None:
    floor = np.full((5, 20), 10.0)
    floor[:, 10] = 4.0
    landmarks = np.array([[5.0, 2.5, 10.0], [15.0, 2.5, 10.0]])
    low, high = np.array([[2.0, 2.5, 9.0]]), np.array([[9.0, 2.5, -8.0]])
    assert in_sight(low, landmarks, floor, 0.0, 0.0, 1.0).tolist() == [[True, False]]
    assert in_sight(high, landmarks, floor, 0.0, 0.0, 1.0).tolist() == [[True, True]]


def test_an_unknown_floor_blocks_nothing_and_an_unknown_landmark_is_not_seen() -> None:
    landmarks = np.array([[8.0, 2.0, 9.0], [9.0, 2.0, np.nan]])
    assert in_sight(np.array([[1.0, 2.0, 8.0]]), landmarks, np.full((4, 10), np.nan), 0.0, 0.0, 1.0).tolist() == [
        [True, False]
    ]
    assert in_sight(np.array([[101.0, 2.0, 8.0]]), landmarks, np.full((4, 10), 1.0), 200.0, 0.0, 1.0)[0, 0]
