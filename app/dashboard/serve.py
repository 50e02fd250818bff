"""Serves the built dashboard: one page and its hashed assets."""

import mimetypes
from pathlib import Path
from urllib.parse import urlsplit

import structlog
from fastapi import FastAPI
from fastapi.responses import FileResponse, HTMLResponse
from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

log = structlog.get_logger(__name__)

STATIC = Path(__file__).with_name("static")
PMTILES = b"PMTiles"
"""How such a file begins."""

# Some machines know no type for modules, and browsers run only what is called JavaScript.
mimetypes.add_type("text/javascript", ".mjs")
mimetypes.add_type("text/javascript", ".js")

CONTENT_SECURITY_POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data: blob:",
        "font-src 'self'",
        "connect-src 'self'",
        "worker-src 'self' blob:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    ]
)

PAGE_HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "Cache-Control": "no-cache",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}

NOT_BUILT = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>bathyfleet: dashboard not built</title>
<h1>The dashboard is not built</h1>
<p>The service itself is running; its API is described at <a href="/api/docs">/api/docs</a>.</p>
<p>To build the dashboard run <code>pip install .</code> in the project's folder (it fetches Node by itself where there
is none), or, while working on it:</p>
<pre>cd app/dashboard/web
npm ci
npm run build</pre>
<p>Then load this page again; the service need not be restarted.</p>
</html>
"""


class HashedFiles(StaticFiles):
    """Files whose names change with their contents, so that browsers may keep them for good."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Answer with the file, compressed where the browser takes that, and the permission to keep it."""
        packed = Path(f"{self.directory}") / f"{path}.gz"
        takes = "gzip" in Headers(scope=scope).get("accept-encoding", "")
        response = await super().get_response(f"{path}.gz" if takes and packed.is_file() else path, scope)
        if response.status_code == 200:
            if takes and packed.is_file():
                response.headers["Content-Encoding"] = "gzip"
                response.headers["Content-Type"] = mimetypes.guess_type(path)[0] or "application/octet-stream"
            response.headers["Vary"] = "Accept-Encoding"
            response.headers["Cache-Control"] = "public, max-age=31536000, immutable"
            response.headers["X-Content-Type-Options"] = "nosniff"
        return response


def _unusable(charts: Path) -> str:
    """Return why a file cannot be drawn under the map; empty where it can."""
    try:
        with charts.open("rb") as file:
            return "" if file.read(len(PMTILES)) == PMTILES else "it is no PMTiles file"
    except OSError as error:
        return error.strerror or str(error)


def mount_dashboard(app: FastAPI, static: Path = STATIC, charts: str = "") -> None:
    """Serve the dashboard at ``/`` and its assets below ``/assets``.

    Parameters
    ----------
    app
        The application; its own routes are left alone.
    static
        Folder that the front end was built into. It may be missing: then the page says how to build it.
    charts
        What is drawn under the map: a ``.pmtiles`` file, a tile server's address, or nothing.
    """
    server = urlsplit(charts) if "://" in charts else None
    if charts and server is None and (why := _unusable(Path(charts))):
        # Vehicles are not left alone for a picture.
        log.warning("no charts are drawn: name a .pmtiles file or a tile server's address", charts=charts, reason=why)
        charts = ""
    policy = CONTENT_SECURITY_POLICY
    if server is not None:
        # The page asks nobody else but this one.
        policy = policy.replace("connect-src 'self'", f"connect-src 'self' {server.scheme}://{server.netloc}")
    headers = PAGE_HEADERS | {"Content-Security-Policy": policy}

    @app.get("/charts.json", include_in_schema=False)
    def charts_address() -> dict[str, str]:
        return {"tiles": charts if server is not None else "pmtiles:///charts.pmtiles" if charts else ""}

    if charts and server is None:

        @app.get("/charts.pmtiles", include_in_schema=False)
        def charts_file() -> FileResponse:
            # Answers requests for parts of the file, which is how it is read.
            return FileResponse(charts, media_type="application/vnd.pmtiles")

    app.mount("/assets", HashedFiles(directory=static / "assets", check_dir=False), name="dashboard-assets")

    @app.api_route("/", methods=["GET", "HEAD"], include_in_schema=False)
    def dashboard() -> Response:
        index = static / "index.html"
        if not index.is_file():
            return HTMLResponse(NOT_BUILT, status_code=503, headers=PAGE_HEADERS)
        return FileResponse(index, headers=headers)
