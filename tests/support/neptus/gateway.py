"""A service with the gateway for Neptus' panel on, and ways to restart it."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

from app.api.access.auth import console_log_in
from app.api.accounts.peers import is_own_user
from app.api.accounts.rates import RequestLimits
from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.missions.fleet.links.neptus import gateway_settings
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.views.mission import MissionView
from app.storage.database import Database
from imc_bridge.neptus import Area
from tests.support.missions.harbour import view_of
from tests.support.neptus.panel import Auv, Floor, RealPanel

ROWS, COLS = 60, 50
SESSION = "Neptus_User_4711"


@dataclass
class Gateway:
    """A service with the gateway on, and ways to restart it."""

    settings: ServiceSettings
    ports: list[int]
    door: Callable[..., Awaitable[str | None]] | None = None
    """Who judges log-ins in place of the service."""
    service: MissionService = field(init=False)
    database: Database = field(init=False)

    async def open(self) -> None:
        self.database = Database(self.settings.database_url)
        store = TokenStore(self.database)

        async def log_in(password: str, host: str, own_user: bool) -> str | None:
            judge = self.door or console_log_in
            return await judge(store, RequestLimits(0, 1000), password, host, own_user=own_user)

        self.service = MissionService(self.settings, self.database, log_in, is_own_user=is_own_user)
        await self.service.startup()

    async def close(self) -> None:
        await self.service.shutdown()
        await self.database.close()

    async def token(self, name: str) -> str:
        """Make an operator's token."""
        _, word = await TokenStore(self.database).create(name, Role.OPERATOR)
        return word

    def service_area(self) -> Area:
        """The rectangle of the panel's cells."""
        return gateway_settings(self.settings.neptus).conventions.area

    def real(self, floor: Floor, auvs: list[Auv], **changes: Any) -> RealPanel:
        """A panel that behaves as the real one, with its vehicles."""
        settings = self.settings.neptus
        ftp_port, http_port = self.ports
        return RealPanel(ftp_port, http_port, floor, settings.rows, settings.cols, auvs, **changes)

    async def mission(self, name: str = SESSION) -> MissionView:
        found = [summary for summary in await self.service.missions() if summary.name == name]
        assert len(found) == 1
        return await view_of(self.service, found[0].id)

    async def log(self, kind: str, name: str = SESSION) -> list[str]:
        mission = await self.mission(name)
        return [event.message for event in await events_after(await self.service.get(mission.id)) if event.kind == kind]
