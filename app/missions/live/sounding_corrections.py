"""What a mission's soundings are corrected by, with what vehicles and operators said that is behind it."""

from collections.abc import Mapping

from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.rulings import BeamRulings
from app.missions.live.header import StoredMission
from app.missions.soundings.beam_edits import BeamEdit, rulings_of
from app.missions.soundings.corrections import Corrections
from app.missions.soundings.gate import Gate
from app.missions.spec.mission import MissionSpec
from app.missions.spec.mounting import MountingSpec


class SoundingCorrections:
    """The corrections of one mission, which its gate applies to every sounding that comes.

    Parameters
    ----------
    area_m : (n, 2)
        The mission's area in its frame.
    margin_m
        How far outside it soundings still help the map's edge.

    Attributes
    ----------
    gate
        Judges and corrects what is measured.
    beam_edits
        What operators said of beams, by number, in the order in which they said it.
    stated_mountings
        How its vehicles, also those that left, say that their sonars are mounted.
    """

    def __init__(self, stored: StoredMission, frame: LocalFrame, area_m: FloatArray, margin_m: float) -> None:
        self._frame = frame
        self._area = Polygon(area_m)
        self._margin_m = margin_m
        self._noise = stored.spec.sounding_noise
        self.beam_edits: Mapping[int, BeamEdit] = dict(stored.beam_edits)
        self.stated_mountings = dict(stored.mountings)
        rulings = rulings_of(stored.beam_edits)
        now = Corrections.of(stored.spec, frame, stored.tide_table, stored.adjustment, stored.mountings, rulings)
        self.gate = self._gate_with(now)

    @property
    def now(self) -> Corrections:
        """Those that are in force."""
        return self.gate.corrections

    def make_gate(self) -> Gate:
        """Return a gate with these corrections, which has seen no sounding yet."""
        return self._gate_with(self.now)

    def _gate_with(self, corrections: Corrections) -> Gate:
        return Gate(corrections, self._area, margin_m=self._margin_m, noise=self._noise)

    def apply(self, corrections: Corrections) -> None:
        """Correct by others from now on."""
        self.gate.corrections = corrections

    def edit_beams(self, edits: Mapping[int, BeamEdit], rulings: BeamRulings) -> None:
        """Let operators have said this of beams; ``rulings``: what counts of it."""
        self.beam_edits = dict(edits)
        self.apply(self.now.ruled(rulings))

    def state_mounting(self, spec: MissionSpec, vehicle: str, mounting: MountingSpec) -> bool:
        """Note how a vehicle says that its sonar is mounted; returns whether that is new."""
        if mounting == self.stated_mountings.get(vehicle, MountingSpec()):
            return False
        self.stated_mountings[vehicle] = mounting
        before = self.now
        self.apply(
            Corrections.of(spec, self._frame, before.table, before.adjustment, self.stated_mountings, before.rulings)
        )
        return True
