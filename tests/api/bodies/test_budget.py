"""Room for bodies is shared: all of it is nobody's."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.api.bodies.budget import BodyBudget
from app.api.http.problems import ProblemError


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers(1, 60)), max_size=40), st.integers(20, 100))
def test_what_is_held_never_exceeds_the_whole_nor_one_the_share(asked: list[tuple[str, int]], total: int) -> None:
    budget = BodyBudget(total)
    held = dict.fromkeys("abc", 0)
    for client, count in asked:
        first = held[client] == 0
        try:
            budget.take(client, count, True)
        except ProblemError:
            assert budget.held == sum(held.values())
            continue
        held[client] += count
        assert budget.held == sum(held.values()) <= total
        others = sum(held.values()) - held[client]
        assert first or held[client] <= (total - others) / 2


def test_room_is_given_back_however_a_request_ends() -> None:
    budget = BodyBudget(100)
    with budget.lease("a") as lease:
        for count, held in ((30, 30), (20, 30), (40, 40)):
            lease.cover(count)
            assert budget.held == held
        with pytest.raises(ProblemError, match="share"), budget.lease("a") as second:
            second.cover(20)
        assert budget.held == 40
    assert budget.held == 0


def test_the_second_request_of_one_client_leaves_room_for_others() -> None:
    budget = BodyBudget(100)
    with budget.lease("a") as one, budget.lease("a") as two, budget.lease("b") as other:
        one.cover(45)
        with pytest.raises(ProblemError) as refused:
            two.cover(10)
        assert refused.value.kind == "too-many-bytes"
        assert refused.value.headers["Retry-After"]
        other.cover(50)
        with pytest.raises(ProblemError) as full, budget.lease("c") as late:
            late.cover(10)
        assert full.value.kind == "overloaded"
