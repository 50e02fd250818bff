"""Commands to a service that is running, over REST."""

from typing import Any

from app.commands.command import CommandError


def ask_service(url: str, token: str | None, begin: str, method: str, path: str, **content: Any) -> Any:
    """Send something for the one mission whose id begins so to a running service; returns its answer."""
    import httpx

    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    try:
        with httpx.Client(base_url=url.rstrip("/") + "/api/v1", headers=headers, timeout=300.0) as client:
            listed = client.get("/missions")
            meant = [m["id"] for m in _answer(listed) if m["id"].startswith(begin)]
            if len(meant) != 1:
                raise CommandError(f"{len(meant)} missions have ids that begin with {begin!r}")
            return _answer(client.request(method, f"/missions/{meant[0]}/{path}", **content))
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise CommandError(f"{url} does not answer: {error}", "Is the service running there?") from None


def _answer(response: Any) -> Any:
    """Return a service's answer. Raises CommandError with what it refused."""
    try:
        said = response.json()
    except ValueError:
        raise CommandError(f"{response.url} answers, but not as bathyfleet does") from None
    if response.is_success:
        return said
    faults = "; ".join(f"{fault['field']}: {fault['message']}" for fault in said.get("errors", []))
    raise CommandError(faults or said.get("detail", "the service refused it"), said.get("remedy", ""))
