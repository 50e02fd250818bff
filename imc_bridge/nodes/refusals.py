"""Why packets are not taken in."""

from __future__ import annotations

from enum import StrEnum


class Refused(StrEnum):
    """What is wrong with a packet that could be read."""

    ADDRESS = "from an address outside allowed_addresses"
    ID = "under an id outside allowed_ids"
    FLOOD = "more than max_packets_per_s from one source"
    MOVED = "an announce of a vehicle from an address that is not its own"
    OLD = "older than what the vehicle sent before: a repetition or a recording"
    PLACE = "a position that the vehicle cannot have reached"
    CROWDED = "of systems for which there is no place, as nothing shows that they exist"
