"""Commands to a service that is running, over REST."""

import ipaddress
from types import TracebackType
from typing import TYPE_CHECKING, Any

from app.commands.command import CommandError, id_with_prefix

if TYPE_CHECKING:
    import ssl
    from pathlib import Path

    import httpx

    from app.settings import Settings


UNKNOWN_AUTHORITY = "SSL_CERT_FILE=FILE names a file with the certificate (PEM) of the authority that signed it"
OTHER_NAME = "Call the service in --url as its certificate does"
REMEDIES = {10: "Renew it and restart the service", 62: OTHER_NAME, 64: OTHER_NAME}
"""By OpenSSL's codes: it has expired, or is for another name or another address."""
RENEWED = (
    "Was the file renewed since the service was started? Restart it, or call it by its name: --url https://NAME:PORT"
)


class RunningService:
    """A service that answers at a URL; closes its connections at the end of a ``with`` block.

    Parameters
    ----------
    url : str
        Such as ``http://127.0.0.1:8080``, with or without ``/api/v1``.
    token : str or None
        Access token, where it asks for one.
    certificate : Path or None
        The certificate that it has, whatever name it is reached by; None: one that this machine trusts, of its name.
    on_this_machine : bool
        Whether it is reached without the proxy that the environment may name: it would be told the token.
    """

    def __init__(
        self, url: str, token: str | None, certificate: "Path | None" = None, *, on_this_machine: bool = False
    ) -> None:
        import httpx

        from bathyfleet.client.connection import trust

        self._pinned = certificate is not None
        self.url = url.rstrip("/").removesuffix("/api/v1")
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        try:
            self._client = httpx.Client(
                base_url=f"{self.url}/api/v1",
                headers=headers,
                timeout=300.0,
                trust_env=not on_this_machine,
                verify=(trust(self.url, verify=True) if certificate is None else _trust(certificate)) or False,
            )
        except httpx.InvalidURL as error:
            raise CommandError(f"{url!r} is no URL: {error}", "Such as http://127.0.0.1:8080") from None

    def __enter__(self) -> "RunningService":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def missions(self, before: str = "") -> list[Any]:
        """Return its missions as it lists them, or those after the one whose id begins so. Raises CommandError."""
        asked = {"before": self._meant(before)} if before else {}
        return list(self._answer("GET", "/missions", params=asked))

    def ask(self, begin: str, method: str, path: str, **content: Any) -> Any:
        """Send something for the one mission whose id begins so; returns the answer. Raises CommandError."""
        return self._answer(method, f"/missions/{self._meant(begin)}/{path}", **content)

    def _meant(self, begin: str) -> str:
        return id_with_prefix(begin, {one["id"]: one["name"] for one in self.missions()}, "missions", f"at {self.url}")

    def _answer(self, method: str, path: str, **content: Any) -> Any:
        import httpx

        from bathyfleet.client.retry import certificate_refusal

        try:
            return _content(self._client.request(method, path, **content))
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            refused = certificate_refusal(error)
            if refused is not None:
                remedy = RENEWED if self._pinned else REMEDIES.get(refused.verify_code, UNKNOWN_AUTHORITY)
                raise CommandError(
                    f"{self.url}: its certificate is not trusted: {refused.verify_message}", remedy
                ) from None
            raise CommandError(f"{self.url} does not answer: {error}", "Is the service running there?") from None


def ask_service(url: str, token: str | None, begin: str, method: str, path: str, **content: Any) -> Any:
    """Send something for the one mission whose id begins so to a running service; returns its answer."""
    with RunningService(url, token) as service:
        return service.ask(begin, method, path, **content)


def own_url(settings: "Settings") -> str:
    """Return where the service of these settings is reached from its own machine.

    Raises CommandError where it takes any free port, which nobody knows beforehand.
    """
    if settings.port == 0:
        raise CommandError("port is 0: any free one, which is not known here", "Name it with --url, or --port")
    host = settings.host
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        pass  # a name
    else:
        if address.is_unspecified:
            address = ipaddress.ip_address("::1" if address.version == 6 else "127.0.0.1")
        host = f"[{address}]" if address.version == 6 else str(address)
    return f"{'http' if settings.tls_certificate is None else 'https'}://{host}:{settings.port}"


def _trust(file: "Path") -> "ssl.SSLContext":
    """Return what trusts the certificate in this file and no other. Raises CommandError where it cannot be read."""
    from app.certificates import trusting

    try:
        return trusting(file.read_text())
    except (OSError, ValueError) as error:
        raise CommandError(f"{file} cannot be read: {error}", "tls_certificate names it") from None


def own_token(settings: "Settings") -> str | None:
    """Return the token that the service's first start left in a file, where there is one that this user may read."""
    from app.storage.upkeep.prepare import FIRST_TOKEN_FILE, folder_of

    try:
        return (folder_of(settings.database_url) / FIRST_TOKEN_FILE).read_text().strip()
    except (OSError, UnicodeDecodeError):
        return None


def _content(response: "httpx.Response") -> Any:
    """Return a service's answer. Raises CommandError with what it refused."""
    try:
        said = response.json()
    except ValueError:
        raise CommandError(f"{response.url} answers, but not as bathyfleet does") from None
    if response.is_success:
        return said
    faults = "; ".join(f"{fault['field']}: {fault['message']}" for fault in said.get("errors", []))
    raise CommandError(faults or said.get("detail", "the service refused it"), said.get("remedy", ""))
