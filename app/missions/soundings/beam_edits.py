"""What operators say of beams of swath sonars, as it is stored."""

import io
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import orjson

from app.mapping.swath.rulings import BeamRulings, BeamSet, Edit
from app.missions.views.measurements.soundings import Ruling
from app.storage.models import BeamEditRow


@dataclass(frozen=True)
class BeamEdit:
    """What was said of some beams, when, and by whom.

    ``beams`` has them by vehicle. ``selection``: what was asked for, as JSON; None where each beam was named.
    """

    ruling: Ruling
    beams: Mapping[str, BeamSet]
    selection: Mapping[str, object] | None
    made_at: datetime
    actor: str
    note: str = ""

    def row(self, mission_id: str) -> BeamEditRow:
        """Return it as it is stored."""
        return BeamEditRow(
            mission_id=mission_id,
            made_at=self.made_at,
            actor=self.actor,
            ruling=self.ruling,
            note=self.note,
            content=self._packed(),
        )

    def _packed(self) -> bytes:
        file = io.BytesIO()
        for one in self.beams.values():
            np.save(file, one.time_s.astype("<f8"), allow_pickle=False)
            np.save(file, one.bits, allow_pickle=False)
        head = orjson.dumps({"vehicles": list(self.beams), "selection": self.selection})
        return zlib.compress(len(head).to_bytes(4, "little") + head + file.getvalue())


def edit_of(row: BeamEditRow) -> BeamEdit:
    """Return what was stored."""
    content = zlib.decompress(row.content)
    begin = 4 + int.from_bytes(content[:4], "little")
    head = orjson.loads(content[4:begin])
    file = io.BytesIO(content[begin:])
    beams = {
        name: BeamSet(np.load(file, allow_pickle=False), np.load(file, allow_pickle=False)) for name in head["vehicles"]
    }
    return BeamEdit(Ruling(row.ruling), beams, head["selection"], row.made_at, row.actor, row.note)


def rulings_of(edits: Mapping[int, BeamEdit]) -> BeamRulings:
    """Return what counts of all that was said, by number, in the order in which it was."""
    return BeamRulings([Edit(edit.ruling is Ruling.REJECTED, edit.beams) for edit in edits.values()])
