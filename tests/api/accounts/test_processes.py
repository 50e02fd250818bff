"""What one process sends on to another carries who asked, and is worth nothing to anybody else."""

from typing import Any

import pytest

from app.api.accounts.processes import (
    FOR,
    HOST,
    PEER,
    PRINCIPAL,
    Deliveries,
    PeerClients,
    comes_from_peer,
    recognise,
    target_without_token,
    vouched_for,
)
from app.api.accounts.roles import Role
from app.api.accounts.tokens import Principal
from app.missions.running.ownership import Peer

SECRET = "s3cret of the one that is asked"  # noqa: S105 - the test's own
PEER_ASKED = Peer(2, "http://127.0.0.1:8081", SECRET, None)
VIEWER = Principal("Ana's screen ä", Role.VIEWER)
MISSION = "/api/v1/missions/1"


def asked(target: str = MISSION, method: str = "POST", principal: Principal = VIEWER, **changes: Any) -> dict[str, Any]:
    """A request as the first process got it."""
    path, _, query = target.partition("?")
    headers = [(b"host", b"fleet.example"), (b"authorization", b"Bearer bf_token"), (b"cookie", b"a=b"), (b"x-a", b"b")]
    return {
        "type": "http",
        "method": method,
        "path": path,
        "raw_path": path.encode(),
        "query_string": query.encode(),
        "headers": headers,
        "client": ("192.0.2.7", 4711),
        "state": {"principal": principal, "request_id": "r1"},
    } | changes


def arriving(sender: PeerClients, scope: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """The same as the second one gets it."""
    request = sender.request(PEER_ASKED, scope, target_without_token(scope))
    path, _, query = request.url.raw_path.partition(b"?")
    return {
        "type": "http",
        "method": scope["method"],
        "path": path.decode(),
        "raw_path": path,
        "query_string": query,
        "headers": [(name.lower(), value) for name, value in request.headers.raw],
        "client": ("127.0.0.1", 5),
    } | changes


def with_header(scope: dict[str, Any], name: str, value: str) -> dict[str, Any]:
    others = [(key, old) for key, old in scope["headers"] if key != name.encode()]
    return scope | {"headers": [*others, (name.encode(), value.encode())]}


@pytest.mark.parametrize(
    "principal", [VIEWER, Principal("rover", Role.VEHICLE, "rover"), Principal("local operator", Role.ADMIN)]
)
def test_it_is_the_one_who_asked_and_no_more(principal: Principal) -> None:
    scope = arriving(PeerClients(), asked(principal=principal))
    assert recognise(scope, SECRET, Deliveries())
    assert vouched_for(scope) == principal
    assert comes_from_peer(scope)
    assert scope["client"] == ("192.0.2.7", 0)
    headers = dict(scope["headers"])
    assert headers[b"host"] == b"fleet.example"
    assert not {PEER.encode(), PRINCIPAL.encode(), FOR.encode(), HOST.encode()} & headers.keys()
    assert not {b"authorization", b"cookie"} & headers.keys(), "a token is nobody else's business"
    assert headers[b"x-a"] == b"b"


def test_the_secret_is_not_sent() -> None:
    scope = arriving(PeerClients(), asked())
    assert not any(SECRET.encode() in value for _, value in scope["headers"])


def test_what_was_sent_once_counts_once() -> None:
    sender, deliveries = PeerClients(), Deliveries()
    first, again = (arriving(sender, asked()) for _ in range(2))
    assert recognise({**first, "headers": [*first["headers"]]}, SECRET, deliveries)
    assert not recognise({**first, "headers": [*first["headers"]]}, SECRET, deliveries)
    assert recognise(again, SECRET, deliveries)


@pytest.mark.parametrize(
    "change",
    [
        lambda scope: scope | {"method": "DELETE"},
        lambda scope: scope | {"raw_path": b"/api/v1/missions/2", "path": "/api/v1/missions/2"},
        lambda scope: scope | {"query_string": b"a=b"},
        lambda scope: with_header(scope, PRINCIPAL, '["Ana", "admin", null]'),
        lambda scope: with_header(scope, FOR, "127.0.0.1"),
        lambda scope: with_header(scope, HOST, "localhost"),
        lambda scope: with_header(scope, PEER, SECRET),
        lambda scope: with_header(scope, PEER, "ü.1.2"),
        lambda scope: with_header(scope, PEER, ""),
    ],
    ids=["method", "path", "query", "principal", "address", "host", "bare secret", "not ascii", "empty"],
)
def test_nothing_of_it_can_be_changed(change: Any) -> None:
    scope = change(arriving(PeerClients(), asked()))
    assert not recognise(scope, SECRET, Deliveries())
    assert vouched_for(scope) is None
    assert scope["client"] == ("127.0.0.1", 5)


def test_another_process_does_not_believe_it() -> None:
    assert not recognise(arriving(PeerClients(), asked()), "another secret", Deliveries())


def test_who_claims_nothing_is_taken_for_what_he_is() -> None:
    scope = asked() | {"state": {}}
    scope = with_header(scope, PRINCIPAL, '["Ana", "admin", null]')
    assert recognise(scope, SECRET, Deliveries())
    assert vouched_for(scope) is None
    assert PRINCIPAL.encode() not in dict(scope["headers"])


def test_targets_arrive_as_they_were_signed() -> None:
    for target in (f"{MISSION}/map.tif?order=1a&note=%C3%A9%20x", f"{MISSION}/vehicles/a%2Fb", f"{MISSION}?a=b+c&d"):
        assert recognise(arriving(PeerClients(), asked(target, "GET")), SECRET, Deliveries()), target


def test_a_token_in_the_query_is_not_sent_on() -> None:
    assert target_without_token(asked(f"{MISSION}/live?token=bf_x&since=3&tok%65n=bf_y")) == f"{MISSION}/live?since=3"
    assert target_without_token(asked(f"{MISSION}/live?token=bf_x")) == f"{MISSION}/live"


def test_numbers_may_overtake_each_other_but_not_come_twice_or_far_too_late() -> None:
    deliveries = Deliveries()
    assert [deliveries.first("a", number) for number in (2, 1, 3, 1, 2)] == [True, True, True, False, False]
    assert deliveries.first("b", 1)
    for number in range(4, 20_000):
        assert deliveries.first("a", number)
    assert not deliveries.first("a", 1)
    assert not deliveries.first("a", 10_000)
