"""The vehicles of one mission as its flight sees them: who takes part, and who of them is at what."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from app.missions.errors import VehicleNotFoundError
from app.missions.fleet.interface import LinkCapabilities
from app.missions.recovery.energy import Energy
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleKind, VehicleSpec
from app.missions.team.member import Member


@dataclass
class Team:
    """All vehicles of a mission, by name, in the order of their slots."""

    capabilities_of: Callable[[VehicleKind], LinkCapabilities] = lambda _kind: LinkCapabilities()
    """Returns what vehicles of a kind can do."""
    energy_of: Callable[[VehicleSpec], Energy] = lambda _spec: Energy(1.0)
    """Returns the count of what a vehicle uses, which has seen nothing yet."""
    members: dict[str, Member] = field(default_factory=dict)
    departed: dict[str, Member] = field(default_factory=dict)
    """Those that took part and do not any more, as they were last."""

    def join(self, spec: VehicleSpec, slot: int) -> Member:
        """Add a vehicle, or take one back."""
        before = self.departed.pop(spec.name, None)
        member = Member(spec, slot, self.capabilities_of(spec.kind), energy=self.energy_of(spec))
        if before is not None and before.key == member.key:
            member.take_over(before)
        self.members[spec.name] = member
        return member

    def leave(self, name: str, at: datetime) -> None:
        """Take a vehicle out; what was last known of it stays."""
        member = self.members.pop(name, None)
        if member is not None:
            member.leave(at)
            self.departed[name] = member

    def __iter__(self) -> Iterator[Member]:
        return iter(list(self.members.values()))

    def get(self, name: str) -> Member | None:
        """Return the vehicle of this name, if it takes part."""
        return self.members.get(name)

    def named(self, name: str) -> Member:
        """Return the vehicle of this name. Raises VehicleNotFoundError when it takes no part."""
        member = self.members.get(name)
        if member is None:
            those = ", ".join(self.members) or "none"
            raise VehicleNotFoundError(f"vehicle {name!r} takes no part in this mission", f"those that do: {those}")
        return member

    @property
    def specs(self) -> list[VehicleSpec]:
        """How those that take part are described."""
        return [member.spec for member in self.members.values()]

    @property
    def told_current_mps(self) -> tuple[float, float] | None:
        """Velocity of the water, east and north: what vehicles tell of it, on average; None: none tells of it."""
        told = [m.report.current_mps for m in self if m.report is not None and m.report.current_mps is not None]
        if not told:
            return None
        east, north = np.mean(told, axis=0)
        return float(east), float(north)

    @property
    def current_mps(self) -> tuple[float, float]:
        """The same as it is counted with: none while no vehicle tells of one."""
        return self.told_current_mps or (0.0, 0.0)

    @property
    def plannable(self) -> list[Member]:
        """Those that the survey can be planned for: controllable, and not withdrawn."""
        return [m for m in self.members.values() if m.plannable]

    @property
    def surveying(self) -> list[Member]:
        """Those that take part in the survey, whether or not they can be reached now."""
        return [m for m in self.members.values() if m.withdrawal is None]

    @property
    def going_on(self) -> list[Member]:
        """Those that survey, or may again when they are not held any more."""
        return [*self.surveying, *self.held]

    @property
    def at_rest(self) -> list[Member]:
        """Those that lie where they were to be in the end: home, up or stopped."""
        return [
            m for m in self.members.values() if m.withdrawal is not None and m.withdrawal.over and m.report is not None
        ]

    def awaits_batteries(self, spec: MissionSpec) -> bool:
        """Whether nobody surveys, and who is home with some of its way left, or goes there, is waited for."""
        if spec.recovery is None or not spec.recovery.wait_for_batteries or spec.search is not None or self.going_on:
            return False
        called = [m.withdrawal for m in self.members.values() if m.withdrawal is not None]
        return any(one.response is Response.RETURN and not one.done for one in called)

    def missed_words(self, besides: Collection[str] = ()) -> str:
        """Return who missed legs, as words after a reason; '' where nobody did. ``besides``: who was named before."""
        missed = [
            f"{m.name} missed {m.flown.legs_missed} of its {m.flown.legs_missed + m.flown.legs_reached} legs"
            for m in self.members.values()
            if m.flown.legs_missed and m.name not in besides
        ]
        return f", {'' if besides else 'but '}{', '.join(missed)}" if missed else ""

    @property
    def held(self) -> list[Member]:
        """Those that wait where they are, for a person or for something to be over, and may survey again."""
        return [m for m in self.members.values() if m.withdrawal is not None and m.withdrawal.response is Response.HOLD]
