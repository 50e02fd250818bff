from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from app.exploration.communication import reachable
from app.exploration.communication.selection import fill


@given(seed=st.integers(0, 10_000))
@settings(max_examples=50, deadline=None)
def test_the_reachable_exploration_area_is_as_the_paper_words_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions, xy = rng.uniform(-1, 1, (4, 3)), rng.uniform(-1, 1, (15, 2))
    visible_by = rng.random((4, 15)) < 0.3
    got = reachable(positions, visible_by, xy, 0.4)
    for j in range(4):
        for k in range(4):
            seen = xy[visible_by[j]]
            closest = min((np.hypot(*(p - positions[k, :2])) for p in seen), default=np.inf)
            assert got[j, k] == (j != k and closest <= 0.4)


@given(seed=st.integers(0, 10_000), capacity=st.integers(0, 12))
@settings(max_examples=50, deadline=None)
def test_a_message_holds_the_most_wanted_that_are_no_near_duplicates(seed: int, capacity: int) -> None:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 1, (20, 2))
    order = rng.permutation(20)[:15]
    chosen = fill(order, xy, capacity, 0.2).tolist()
    assert len(chosen) == min(capacity, 15)
    assert len(set(chosen)) == len(chosen)
    distinct: list[Any] = []
    for m in order:
        if all(np.hypot(*(xy[m] - xy[c])) >= 0.2 for c in distinct):
            distinct.append(m)
    rest = [m for m in order if m not in distinct]
    assert chosen == (distinct + rest)[:capacity]
