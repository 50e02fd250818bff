"""A service whose features are read: a mission with tracks, soundings and contours, one with holidays, and a ship."""

import asyncio
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import httpx
import numpy as np
import pytest

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.missions.settings import AisSettings, ImcSettings
from app.settings import Settings
from app.storage.database import Database
from tests.support.api.rest import mission_spec, running_in_thread
from tests.support.missions.ais import position
from tests.support.missions.specs import lon_lat, rectangle
from tests.support.ports import free_ports
from tests.support.storage.databases import Databases

START_S = 1_795_225_140.0
SOUNDINGS = 60
SWATH = [{"name": "wide", "kind": "rest", "sensor": "multibeam"}]


@dataclass
class Gis:
    """A service, its two missions, and a viewer's and an operator's token."""

    client: httpx.Client
    url: str
    single: str
    swath: str
    key: str
    operator: str

    def get(self, path: str, **query: Any) -> httpx.Response:
        """The answer to a request below ``/ogc``, or for an address that was answered before."""
        address = path if path.startswith("http") else f"{self.url}/ogc{path}"
        return self.client.get(address, params=query or None)

    def json(self, path: str, **query: Any) -> Any:
        answer = self.get(path, **query)
        assert answer.status_code == httpx.codes.OK, answer.text
        return answer.json()

    def items(self, collection: str, **query: Any) -> Any:
        return self.json(f"/collections/{collection}/items", **query)

    def everything(self, collection: str, **query: Any) -> list[Any]:
        """All features, page by page."""
        page = self.items(collection, **query)
        features = page["features"]
        while following := [link["href"] for link in page["links"] if link["rel"] == "next"]:
            page = self.json(following[0])
            features += page["features"]
        return list(features)


async def _tokens(url: str) -> tuple[str, str]:
    database = Database(url)
    try:
        store = TokenStore(database)
        return (await store.create("chart room", Role.VIEWER))[1], (await store.create("op", Role.OPERATOR))[1]
    finally:
        await database.close()


def depth_m(east_m: float, north_m: float) -> float:
    return 6.0 + 0.08 * east_m + 0.02 * north_m


def along_lines() -> list[dict[str, Any]]:
    items = []
    for number in range(SOUNDINGS):
        line, along = divmod(number, 12)
        east, north = 4.0 + 4.0 * (along if line % 2 == 0 else 11 - along), 6.0 + 8.0 * line
        lon, lat = lon_lat(east, north)
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "range_m": depth_m(east, north) - 2.0}
        items.append({"vehicle": "rover", "time_s": START_S + 4.0 * number, **place})
    return items


def pings() -> list[dict[str, Any]]:
    """A ping over every cell but those of a hole of four by four."""
    items: list[dict[str, Any]] = []
    for north in np.arange(1.0, 60.0, 2.0).tolist():
        for east in np.arange(1.0, 60.0, 2.0).tolist():
            if 20 < east < 28 and 20 < north < 28:
                continue
            lon, lat = lon_lat(east + 200.0, north)
            beams = {"angles_deg": [-5.0, 0.0, 5.0], "ranges_m": [8.03, 8.0, 8.03]}
            place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "heading_deg": 90.0}
            items.append({"vehicle": "wide", "time_s": START_S + 0.2 * len(items), "beams": beams, **place})
    return items


def _show_a_ship(client: httpx.Client, url: str, port: int | None) -> None:
    """Send where a ship lies until the service has heard it."""
    lon, lat = lon_lat(30.0, 30.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        while not client.get(f"{url}/api/v1/traffic").raise_for_status().json()["ships"]:
            radio.sendto(position(123_456_789, lat, lon), ("127.0.0.1", port))
            time.sleep(0.05)  # who asks much more often is refused


@pytest.fixture(scope="package")
def gis(databases: Databases, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gis]:
    url = databases.fresh()
    key, operator = asyncio.run(_tokens(url))
    settings = Settings(
        port=0,
        database_url=url,
        max_failed_logins=1000,
        imc=ImcSettings(enabled=False),
        pings_url=str(tmp_path_factory.mktemp("pings")),
        ais=AisSettings(udp_address="127.0.0.1", udp_port=free_ports(1)[0], max_age_s=86_400),
    )
    headers = {"Authorization": f"Bearer {operator}"}
    with running_in_thread(settings) as server, httpx.Client(headers=headers, timeout=120) as client:
        api = f"{server.url}/api/v1/missions"
        made = []
        for changes, items in (
            ({"name": "Single beam", "limits": {"max_depth_m": 14.0}}, along_lines()),
            ({"name": "Swath", "area": rectangle(200, 0, 260, 60), "vehicles": SWATH}, pings()),
        ):
            made.append(client.post(api, json=mission_spec(**changes)).raise_for_status().json()["id"])
            address = f"{api}/{made[-1]}"
            here = {name: items[0][name] for name in ("vehicle", "lat_deg", "lon_deg", "depth_m")}
            client.post(f"{address}/measurements", json={"items": [here | {"time_s": START_S - 1}]})
            client.post(f"{address}/start").raise_for_status()  # from then on its vehicles' ways are kept
            answer = client.post(f"{address}/measurements", json={"items": items}).raise_for_status()
            assert answer.json()["accepted"] == len(items), answer.text
            client.post(f"{address}/pause").raise_for_status()
            client.get(f"{api}/{made[-1]}/map").raise_for_status()
        client.headers["Authorization"] = f"Bearer {key}"
        _show_a_ship(client, server.url, settings.ais.udp_port)
        yield Gis(client, server.url, made[0], made[1], key, operator)
