"""Pages in Chromium."""

from playwright.sync_api import ConsoleMessage, Page, Request

FONT = "DejaVu Sans"
"""The only one that the browser is shown, where it is installed: in others lines break elsewhere."""


PATIENCE_MS = 90_000
"""Only how long a missing thing is waited for: the first map waits for numba to compile."""


class Watched:
    """A page together with what it complained about and whom it asked."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.addresses: list[str] = []
        page.on("console", self._note)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", self._ask)

    def _note(self, message: ConsoleMessage) -> None:
        # What the driver says of software rendering is no fault of the page.
        if message.type in ("error", "warning") and "GL Driver Message" not in message.text:
            self.complaints.append(message.text)

    def _ask(self, request: Request) -> None:
        self.addresses.append(request.url)
