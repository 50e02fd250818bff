"""Systems that announced themselves while there was no place for them: they get one as soon as they answer."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace

from imc_bridge.network.discovery import Announcement
from imc_bridge.network.transport import Address

MAX_NEWCOMERS = 16_384
MAX_NEWCOMERS_OF_HOST = 8192
"""Most announces of unknown systems at one host in some 6 s, the time that a vehicle takes to answer us."""


class Newcomers:
    """The last announces that found no place, by host and id.

    Anyone can announce any number of systems from one address. To answer from the announced one as well takes a
    system that is there, so that is what gives a right to a place. Where too many announce, the host with the most
    loses its oldest.
    """

    def __init__(self) -> None:
        self._of_host: dict[str, OrderedDict[int, Announcement]] = {}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def note(self, announcement: Announcement, host: str) -> None:
        """Keep an announce; of its addresses those on the host that it came from."""
        here = tuple(address for address in announcement.addresses if address[0] == host)
        if not here:
            return
        of_host = self._of_host.setdefault(host, OrderedDict())
        if of_host.pop(announcement.imc_id, None) is None:
            self._count += 1
        of_host[announcement.imc_id] = replace(announcement, addresses=here, streams=())
        if len(of_host) > MAX_NEWCOMERS_OF_HOST:
            self._drop_oldest(host)
        elif self._count > MAX_NEWCOMERS:
            self._drop_oldest(max(self._of_host, key=lambda name: len(self._of_host[name])))

    def answered(self, imc_id: int, address: Address) -> Announcement | None:
        """The announce of this id, when this is an address that it names; it is a newcomer no more."""
        of_host = self._of_host.get(address[0])
        announcement = of_host.get(imc_id) if of_host is not None else None
        if of_host is None or announcement is None or address not in announcement.addresses:
            return None
        del of_host[imc_id]
        self._count -= 1
        if not of_host:
            del self._of_host[address[0]]
        return announcement

    def _drop_oldest(self, host: str) -> None:
        self._of_host[host].popitem(last=False)
        self._count -= 1
        if not self._of_host[host]:
            del self._of_host[host]
