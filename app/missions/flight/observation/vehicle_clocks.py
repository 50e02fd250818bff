"""Tells of vehicles whose clocks are wrong: soundings get the water level of their vehicle's time."""

import asyncio

import structlog

from app.missions.live.mission import LiveMission
from app.missions.team import Member
from app.missions.views.mission import Level
from imc_bridge.doctor.doctor import CLOCK_WRONG_S

PERIOD_S = 5.0

log = structlog.get_logger(__name__)


class VehicleClocks:
    """Holds the clocks of one running mission's vehicles against this machine's, where a tide table goes by them.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live: only clocks that run like ours can be compared.
    """

    def __init__(self, live: LiveMission, time_scale: float) -> None:
        self._live = live
        self._comparable = time_scale == 1.0
        self._told: set[str] = set()

    async def keep(self) -> None:
        """Compare vehicles' clocks with this machine's again and again, until cancelled."""
        while True:
            await asyncio.sleep(PERIOD_S)
            await self.look()

    async def look(self) -> None:
        """Compare them once; a wrong one is told of once, and again when it was right meanwhile."""
        if not self._comparable or self._live.gate.corrections.table is None:
            return
        for member in self._live.team:
            ahead_s = _ahead_s(member)
            if abs(ahead_s) <= CLOCK_WRONG_S:
                self._told.discard(member.name)
            elif member.name not in self._told:
                self._told.add(member.name)
                off = f"{abs(ahead_s) / 60.0:.0f} min {'ahead of' if ahead_s > 0 else 'behind'} this machine's"
                words = (
                    f"by what {member.name} told last its clock is {off}: its soundings get the water level of that "
                    "time. See that both are right"
                )
                facts = {"vehicle": member.name, "seconds": round(ahead_s)}
                await self._live.journal.log(Level.WARNING, "clock", words, **facts)


def _ahead_s(member: Member) -> float:
    if member.report is None or member.heard_s is None or member.capabilities.simulated:
        return 0.0
    return member.report.time_s - member.heard_s
