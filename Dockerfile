# syntax=docker/dockerfile:1

FROM python:3.12-slim-trixie AS build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1
# What not everyone needs: extras such as "cluster", packages such as "s3fs gcsfs" or a planner's.
ARG EXTRAS=""
ARG PACKAGES=""
RUN python -m venv /opt/bathyfleet
WORKDIR /src
COPY . .
# The build hook makes the dashboard; Node comes as a build requirement from a wheel.
RUN --mount=type=cache,target=/root/.cache/pip --mount=type=cache,target=/root/.npm \
    /opt/bathyfleet/bin/pip install ".${EXTRAS:+[$EXTRAS]}" $PACKAGES && cd / && \
    test -s "$(/opt/bathyfleet/bin/python -c 'from app.dashboard.serve import STATIC; print(STATIC / "index.html")')"


FROM python:3.12-slim-trixie
# libexpat: rasterio's wheels expect it from the system. postgresql-client: backups, of version 17 as compose.yaml's server.
RUN apt-get update && \
    apt-get install --yes --no-install-recommends libexpat1 postgresql-client && \
    rm -rf /var/lib/apt/lists/* && \
    useradd --system --uid 10001 --user-group --create-home --home-dir /var/lib/bathyfleet bathyfleet
COPY --from=build /opt/bathyfleet /opt/bathyfleet
# Compiled numerical code and matplotlib's caches go to the home directory, which is the volume: they outlive the container.
# No setting but what collects logs: bathyfleet.toml in the volume would be overruled. What is served to others says so.
ENV PATH=/opt/bathyfleet/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    BATHYFLEET_LOG_FORMAT=json
USER bathyfleet
WORKDIR /var/lib/bathyfleet
VOLUME /var/lib/bathyfleet
EXPOSE 8080/tcp 6101/udp 30100-30104/udp
# It asks where the settings say, over HTTPS where they say so.
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s --retries=3 CMD ["bathyfleet", "health"]
ENTRYPOINT ["bathyfleet"]
CMD ["serve"]
