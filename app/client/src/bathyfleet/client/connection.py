"""Where the service is and who asks: what both clients are opened with."""

from __future__ import annotations

import os
import re
import ssl
import uuid
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import httpx

from bathyfleet.client.call import as_json
from bathyfleet.client.models import BatchVerdict, ItemVerdict, Measurement

ADDRESS = "http://127.0.0.1:8080"
PATIENCE_S = 30.0
TIMEOUT_S = 75.0
"""A little more than the longest that the service lets a vehicle wait for its waypoint."""
BATCH = 1000
BATCH_BYTES = 1 << 20
"""Whatever is in so much JSON: since a value takes two bytes, it is within the service's limits of values and beams."""

TOKEN = re.compile(r"[!-~]+")

Item = Measurement | Mapping[str, Any]


def root(address: str) -> str:
    """Return where a service answers, without ``/api/v1``. Raises ValueError for an address that is none."""
    url = httpx.URL(address)
    if url.scheme not in ("http", "https") or not url.host:
        raise ValueError(f"address: {address!r} is not like {ADDRESS} or https://host:port")
    return str(url).rstrip("/").removesuffix("/api/v1")


def trust(address: str, verify: bool | ssl.SSLContext) -> ssl.SSLContext | None:
    """Return how the certificate at an address is checked, by requests and by live sockets; None without HTTPS.

    Reading what is trusted takes longer than most requests; plain HTTP has no use for it.
    """
    if httpx.URL(address).scheme != "https":
        return None
    if isinstance(verify, ssl.SSLContext):
        return verify
    context = httpx.create_ssl_context(verify)
    if verify and not os.environ.keys() & {"SSL_CERT_FILE", "SSL_CERT_DIR"}:
        context.load_default_certs()  # what this machine trusts beside the public authorities
    return context


def settings(address: str, token: str | None, timeout_s: float, tls: ssl.SSLContext | None) -> dict[str, Any]:
    """Return the settings of an HTTP connection to the service at an address that :func:`root` returned."""
    return {
        "base_url": address,
        "headers": authorization(token) | {"Accept": "*/*"},
        "timeout": httpx.Timeout(timeout_s, connect=10.0),
        "verify": tls or False,
    }


def authorization(token: str | None) -> dict[str, str]:
    """Return the header that shows a token. Raises ValueError, which does not tell it, for what no token can be."""
    if token is not None and not TOKEN.fullmatch(token):
        raise ValueError(
            "token: it is empty or has a blank, a line end or a letter that none has; strip what is read from a file"
        )
    return {} if token is None else {"Authorization": f"Bearer {token}"}


def new_key() -> str:
    """Return a new idempotency key."""
    return str(uuid.uuid4())


def batches(items: Iterable[Item], size: int) -> Iterator[list[Item]]:
    """Yield the items in lists of at most ``size`` and ``BATCH_BYTES`` of JSON, one that is longer by itself.

    Raises ValueError unless the size is 1 to 10 000, TypeError for an item that cannot be sent.
    """
    if not 1 <= size <= 10_000:
        raise ValueError(f"batch: {size} is not from 1 to 10000")
    batch: list[Item] = []
    held = 0
    for index, item in enumerate(items):
        length = len(as_json(item, f"items.{index}"))
        if len(batch) == size or (batch and held + length > BATCH_BYTES):
            yield batch
            batch, held = [], 0
        batch.append(item)
        held += length
    if batch:
        yield batch


def together(verdicts: Iterable[BatchVerdict]) -> BatchVerdict:
    """Return the verdicts on batches as one, its items numbered through."""
    parts = list(verdicts)
    items: list[ItemVerdict] = []
    for part in parts:
        start = len(items)
        items += [item.model_copy(update={"index": start + item.index}) for item in part.items]
    return BatchVerdict(
        accepted=sum(part.accepted for part in parts),
        rejected=sum(part.rejected for part in parts),
        duplicate=sum(part.duplicate for part in parts),
        items=items,
        replayed=any(part.replayed for part in parts),
    )
