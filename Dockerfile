# syntax=docker/dockerfile:1

FROM python:3.12-slim-bookworm AS build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1
RUN python -m venv /opt/bathyfleet
WORKDIR /src
COPY . .
# The build hook makes the dashboard; Node comes as a build requirement from a wheel.
RUN --mount=type=cache,target=/root/.cache/pip --mount=type=cache,target=/root/.npm \
    /opt/bathyfleet/bin/pip install . && cd / && \
    test -s "$(/opt/bathyfleet/bin/python -c 'from app.dashboard.serve import STATIC; print(STATIC / "index.html")')"


FROM python:3.12-slim-bookworm
# libexpat: rasterio's wheels expect it from the system.
RUN apt-get update && \
    apt-get install --yes --no-install-recommends libexpat1 && \
    rm -rf /var/lib/apt/lists/* && \
    useradd --system --uid 10001 --user-group --create-home --home-dir /var/lib/bathyfleet bathyfleet
COPY --from=build /opt/bathyfleet /opt/bathyfleet
# Compiled numerical code and matplotlib's caches go to the home directory, which is the volume: they outlive the container.
ENV PATH=/opt/bathyfleet/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    BATHYFLEET_HOST=0.0.0.0 \
    BATHYFLEET_PORT=8080 \
    BATHYFLEET_LOG_FORMAT=json
USER bathyfleet
WORKDIR /var/lib/bathyfleet
VOLUME /var/lib/bathyfleet
EXPOSE 8080/tcp 6101/udp 30100-30104/udp
# With HTTPS the certificate is another name's than localhost.
HEALTHCHECK --interval=15s --timeout=5s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import os, ssl, urllib.request as r; s = 'https' if os.environ.get('BATHYFLEET_TLS_CERTIFICATE') else 'http'; r.urlopen(f\"{s}://127.0.0.1:{os.environ['BATHYFLEET_PORT']}/health/live\", timeout=4, context=ssl._create_unverified_context())"]
ENTRYPOINT ["bathyfleet"]
CMD ["serve"]
