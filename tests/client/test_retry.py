import httpx
import pytest

from app.api.http.problems import make_problem
from bathyfleet.client.call import Call
from bathyfleet.client.problems import MEDIA_TYPE, BusyError, ConflictError, UnreachableError
from bathyfleet.client.retry import LONGEST_S, NEVER_DONE, Attempts

LOST = httpx.ReadError("lost")


class Clock:
    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


@pytest.fixture
def clock() -> Clock:
    return Clock()


def answer(status: int, **headers: str) -> httpx.Response:
    return httpx.Response(status, headers=headers, request=httpx.Request("GET", "http://service/x"))


def refusal(kind: str, wait_s: float = 1.0) -> httpx.Response:
    """An answer with the service's own problem document."""
    document = make_problem(kind, "", instance="/x")
    return httpx.Response(
        document.status,
        content=document.model_dump_json(),
        headers={"content-type": MEDIA_TYPE, "retry-after": f"{wait_s:g}"},
        request=httpx.Request("POST", "http://service/x"),
    )


def test_waits_grow_up_to_a_limit_and_end_with_patience(clock: Clock) -> None:
    attempts = Attempts("x", 60.0, repeatable=True, now=clock)
    waits: list[float] = []

    def go_on() -> None:
        while True:
            waits.append(attempts.after_error(LOST))
            clock.s += waits[-1]

    with pytest.raises(UnreachableError, match="x: nobody answered in 60 s"):
        go_on()
    assert waits[:4] == [0.2, 0.4, 0.8, 1.6]
    assert max(waits) == LONGEST_S
    assert 60.0 - LONGEST_S < clock.s <= 60.0


def test_an_answer_renews_patience(clock: Clock) -> None:
    attempts = Attempts("x", 1.0, repeatable=True, now=clock)
    for _ in range(20):
        clock.s += attempts.after_error(LOST)
        attempts.reached()
        clock.s += 100.0
    assert attempts.after_error(LOST) == 0.2


def test_what_may_have_been_done_is_not_repeated(clock: Clock) -> None:
    attempts = Attempts("POST /missions", 60.0, repeatable=False, now=clock)
    assert attempts.after_error(httpx.ConnectError("refused")) == 0.2
    with pytest.raises(UnreachableError, match="whether it was done has to be looked up"):
        attempts.after_error(LOST)
    assert attempts.after_answer(answer(503)) is None
    for kind in ("mission-elsewhere", "product-unavailable"):
        with pytest.raises(BusyError):
            attempts.after_refusal(refusal(kind))


@pytest.mark.parametrize("kind", sorted(NEVER_DONE))
def test_what_the_service_says_was_not_done_is_asked_for_again(clock: Clock, kind: str) -> None:
    attempts = Attempts("POST /missions", 60.0, repeatable=False, now=clock)
    assert attempts.after_refusal(refusal(kind, 5.0)) == 5.0
    clock.s += 5.0
    with pytest.raises(BusyError) as refused:
        attempts.after_refusal(refusal(kind, 56.0))
    assert refused.value.kind == kind


def test_what_cannot_be_sent_is_not_tried_again(clock: Clock) -> None:
    with pytest.raises(ValueError, match="it cannot be sent"):
        Attempts("x", 60.0, repeatable=True, now=clock).after_error(httpx.LocalProtocolError("illegal"))


def test_the_service_says_how_long_to_wait(clock: Clock) -> None:
    attempts = Attempts("x", 60.0, repeatable=True, now=clock)
    assert attempts.after_answer(answer(503, **{"retry-after": "5"})) == 5.0
    assert attempts.after_answer(answer(429, **{"retry-after": "soon"})) == 0.4
    assert attempts.after_answer(answer(200)) is None
    with pytest.raises(BusyError):
        attempts.after_refusal(answer(429, **{"retry-after": "61"}))
    with pytest.raises(ConflictError):
        attempts.after_refusal(answer(409))


def test_a_time_that_was_given_ends_before_patience(clock: Clock) -> None:
    attempts = Attempts("x", 60.0, repeatable=True, within_s=3.0, now=clock)
    assert attempts.left_s == 3.0
    clock.s += attempts.after_error(LOST)
    assert attempts.left_s == pytest.approx(2.8)
    with pytest.raises(TimeoutError, match="no answer came in the time that was given"):
        attempts.after_refusal(answer(503, **{"retry-after": "5"}))


def test_no_answer_is_waited_for_longer_than_the_time_that_was_given() -> None:
    with httpx.Client(base_url="http://service", timeout=75.0) as client:
        call: Call[None] = Call("GET", "/health", None)
        assert call.request(client).extensions["timeout"]["read"] == 75.0
        assert call.request(client, 5.0).extensions["timeout"]["read"] == 5.0
