"""The state of a mission as it is stored, and what is read of one before it is taken into memory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.mapping.water.tides import TideTable
from app.missions.live.journals.journal import Counts
from app.missions.soundings.adjustment import TrackAdjustment
from app.missions.soundings.beam_edits import BeamEdit
from app.missions.spec.mission import MissionSpec
from app.missions.spec.mounting import MountingSpec
from app.missions.states import MissionState
from app.storage.models import MissionRow


@dataclass
class MissionHeader:
    """A mission's state as last committed."""

    state: MissionState
    reason: str
    created_at: Any
    updated_at: Any
    elapsed_s: float
    step: int = 0
    objective: float | None = None
    terms: dict[str, float] | None = None


@dataclass(frozen=True, slots=True)
class Ending:
    """What a mission becomes once all its vehicles are home, and by whose word."""

    state: MissionState
    reason: str
    actor: str

    def remember(self) -> dict[str, str]:
        """Return what is stored."""
        return {"state": self.state, "reason": self.reason, "actor": self.actor}

    @classmethod
    def recall(cls, stored: dict[str, Any] | None) -> "Ending | None":
        """Return what was stored."""
        return None if not stored else cls(MissionState(stored["state"]), stored["reason"], stored["actor"])


@dataclass(frozen=True)
class StoredMission:
    """What the database has of a mission, read and checked before it is taken into memory."""

    row: MissionRow
    spec: MissionSpec
    """What is in its row, checked."""
    counts: Counts
    """Of its soundings."""
    tide_table: TideTable | None = None
    """Measured water levels; None: there are none."""
    adjustment: TrackAdjustment | None = None
    """How far tracks are moved; None: they stay as they were reported."""
    mountings: Mapping[str, MountingSpec] = field(default_factory=dict)
    """How its vehicles, also those that left, say that their sonars are mounted."""
    beam_edits: Mapping[int, BeamEdit] = field(default_factory=dict)
    """What operators said of beams, by number, in the order in which they said it."""
