"""How the service's own certificate is recognised: by itself, whoever signed it and for whatever name and time."""

import asyncio
import ssl
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

import httpx
import pytest

from app.certificates import first_certificate, trusting
from app.settings import Settings
from tests.support.api.rest import make_client, mission_spec, running
from tests.support.certificates import Authority


async def shaken_hands(shown: tuple[Path, Path], trust: ssl.SSLContext) -> bytes | None:
    """Return what is shown as by a connection that trusts it, DER. Raises SSLError where it is not trusted."""
    served = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    served.load_cert_chain(*shown)
    server = await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0, ssl=served)
    async with server:
        port = server.sockets[0].getsockname()[1]
        _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trust)
        seen: bytes | None = writer.get_extra_info("ssl_object").getpeercert(binary_form=True)
        writer.close()
        return seen


async def test_a_certificate_is_recognised_whoever_signed_it_and_when_it_has_expired(authority: Authority) -> None:
    for until in ("20981231000000Z", "20210101000000Z"):
        ours = authority.sign("auv.example", until=until)
        certificate = first_certificate(ours[0])
        assert await shaken_hands(ours, trusting(certificate)) == ssl.PEM_cert_to_DER_cert(certificate)


async def test_another_certificate_of_the_same_authority_is_not_ours(authority: Authority) -> None:
    ours, others = authority.sign("auv.example"), authority.sign("stranger.example")
    for certificates in (first_certificate(ours[0]), ours[0].read_text()):
        with pytest.raises(ssl.SSLCertVerificationError):
            await shaken_hands(others, trusting(certificates))


async def test_processes_reach_each_other_with_a_certificate_that_an_authority_signed(
    make_settings: Callable[..., Settings], authority: Authority, tmp_path: Path
) -> None:
    chain, key = authority.sign("auv.example")
    alone = tmp_path / "alone.pem"  # as from a public authority, whose own certificate is in no such file
    alone.write_text(first_certificate(chain))
    settings = make_settings(tls_certificate=alone, tls_key=key)
    async with AsyncExitStack() as stack:
        owner, other = [await stack.enter_async_context(running(settings)) for _ in range(2)]
        at_owner, at_other = [await stack.enter_async_context(make_client(server)) for server in (owner, other)]
        created = await at_owner.post("/missions", json=mission_spec())
        assert created.status_code == 201, created.text
        aborted: httpx.Response = await at_other.post(f"/missions/{created.json()['id']}/abort")
        assert aborted.status_code == 200, aborted.text
