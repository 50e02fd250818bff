"""Signing in from a browser: a cookie in place of the token."""

from http.cookies import SimpleCookie

import httpx
import pytest
import websockets
from websockets.typing import Origin

from app.api.access import auth
from app.main import Server
from tests.support.api.rest import Guarded, mission_spec, new_mission


def own_page(guarded: Guarded) -> dict[str, str]:
    return {"Origin": guarded.server.url}


async def sign_in(guarded: Guarded, name: str) -> str:
    """The cookie that the browser keeps, as it is sent back."""
    answer = await guarded.client.post("/session", headers=guarded.as_(name) | own_page(guarded))
    assert answer.status_code == 201, answer.text
    guarded.client.cookies.clear()
    return str(answer.headers["set-cookie"].split(";")[0])


async def test_a_token_is_exchanged_for_a_cookie_that_no_script_reads_and_no_other_site_uses(guarded: Guarded) -> None:
    answer = await guarded.client.post("/session", headers=guarded.as_("operator"))
    assert answer.json() == {
        "name": "the operator",
        "role": "operator",
        "vehicle": None,
        "local": False,
        "signed_in": True,
    }
    [cookie] = SimpleCookie(answer.headers["set-cookie"]).values()
    assert (cookie["httponly"], cookie["samesite"], cookie["path"], cookie["secure"]) == (True, "strict", "/", "")
    assert guarded.tokens["operator"] not in answer.headers["set-cookie"]
    seen = await guarded.client.get("/session", headers={"Cookie": f"{cookie.key}={cookie.value}"})
    assert (seen.json()["name"], seen.json()["signed_in"]) == ("the operator", True)


async def test_a_session_has_the_role_of_its_token(guarded: Guarded) -> None:
    viewer = {"Cookie": await sign_in(guarded, "viewer")} | own_page(guarded)
    operator = {"Cookie": await sign_in(guarded, "operator")} | own_page(guarded)
    assert (await guarded.client.get("/missions", headers=viewer)).status_code == 200
    refused = await guarded.client.post("/missions", json=mission_spec(), headers=viewer)
    assert (refused.status_code, "role viewer" in refused.json()["detail"]) == (403, True)
    assert (await guarded.client.post("/missions", json=mission_spec(), headers=operator)).status_code == 201


@pytest.mark.parametrize(
    "sent",
    [{}, {"Origin": "https://evil.example"}, {"Origin": "null"}, {"Sec-Fetch-Site": "same-site"}],
    ids=["nothing", "another site", "a sandboxed page", "another port"],
)
async def test_a_cookie_commands_only_from_the_services_own_page(guarded: Guarded, sent: dict[str, str]) -> None:
    cookie = {"Cookie": await sign_in(guarded, "operator")}
    answer = await guarded.client.post("/missions", json=mission_spec(), headers=cookie | sent)
    assert (answer.status_code, answer.json()["type"]) == (403, "urn:bathyfleet:problem:forbidden")
    own = cookie | {"Sec-Fetch-Site": "same-origin"}
    assert (await guarded.client.post("/missions", json=mission_spec(), headers=own)).status_code == 201


async def test_a_session_ends_with_its_token(guarded: Guarded) -> None:
    cookie = {"Cookie": await sign_in(guarded, "viewer")}
    assert (await guarded.client.get("/missions", headers=cookie)).status_code == 200
    row = next(row for row in await guarded.store.all() if row.role == "viewer")
    await guarded.store.revoke(row.id)
    answer = await guarded.client.get("/missions", headers=cookie)
    assert (answer.status_code, answer.json()["detail"]) == (401, "the browser's session has ended")


async def test_signing_out_ends_the_session_and_not_the_token(guarded: Guarded) -> None:
    cookie = {"Cookie": await sign_in(guarded, "viewer")}
    answer = await guarded.client.delete("/session", headers=cookie | own_page(guarded))
    assert answer.status_code == 204
    [forgotten] = SimpleCookie(answer.headers["set-cookie"]).values()
    assert (forgotten.value, forgotten["max-age"]) == ("", "0")
    assert (await guarded.client.get("/missions", headers=cookie)).status_code == 401
    assert (await guarded.client.get("/missions", headers=guarded.as_("viewer"))).status_code == 200


async def test_a_wrong_token_gets_no_session(guarded: Guarded) -> None:
    answer = await guarded.client.post("/session", headers={"Authorization": "Bearer bf_guess"})
    assert (answer.status_code, "set-cookie" in answer.headers) == (401, False)


async def test_without_tokens_the_user_of_the_machine_is_the_local_operator(client: httpx.AsyncClient) -> None:
    seen = (await client.get("/session")).json()
    assert (seen["name"], seen["role"], seen["local"], seen["signed_in"]) == ("local operator", "admin", True, False)
    assert "set-cookie" not in (await client.post("/session")).headers


async def test_the_socket_takes_a_session_from_the_own_page_only(guarded: Guarded, path: str) -> None:
    cookie = {"Cookie": await sign_in(guarded, "viewer")}
    url = socket_url(guarded.server, path)
    async with websockets.connect(url, additional_headers=cookie, origin=Origin(guarded.server.url)) as socket:
        assert "snapshot" in str(await socket.recv())
    for headers, origin in ((cookie, None), (cookie, Origin("https://evil.example"))):
        async with websockets.connect(
            url, additional_headers=headers, origin=None if origin is None else Origin(origin)
        ) as socket:
            with pytest.raises(websockets.ConnectionClosedError) as closed:
                await socket.recv()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4403


async def test_a_live_view_ends_when_its_browser_signs_out(
    guarded: Guarded, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(auth, "RECHECK_S", 0.05)
    cookie = {"Cookie": await sign_in(guarded, "viewer")}
    url = socket_url(guarded.server, path)
    async with websockets.connect(url, additional_headers=cookie, origin=Origin(guarded.server.url)) as socket:
        await socket.recv()
        await guarded.client.delete("/session", headers=cookie | own_page(guarded))
        await socket.wait_closed()
        assert socket.close_code == 4401


async def test_the_audit_log_names_who_signed_in_and_commanded(guarded: Guarded) -> None:
    cookie = {"Cookie": await sign_in(guarded, "operator")}
    await guarded.client.post("/missions", json=mission_spec(), headers=cookie | own_page(guarded))
    lines = (await guarded.client.get("/audit", headers=guarded.as_("admin"))).json()
    done = [(line["action"], line["actor"], line["result"]) for line in lines]
    assert ("signIn", "the operator", "done") in done
    assert ("createMission", "the operator", "done") in done


async def test_services_on_other_ports_of_the_host_have_cookies_of_their_own(guarded: Guarded) -> None:
    name = (await sign_in(guarded, "viewer")).partition("=")[0]
    assert name == f"bathyfleet-session-{guarded.server.url.rpartition(':')[2]}"
    await new_mission(guarded)


def socket_url(server: Server, path: str) -> str:
    return f"{server.url.replace('http', 'ws', 1)}/api/v1{path}/live"
