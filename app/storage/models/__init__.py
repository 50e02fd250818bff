"""The tables. Every change here needs a migration; a test compares the two.

Others import from here: whoever has one table has them all, which foreign keys and migrations need.
"""

from app.storage.models.access import AuditRow, SessionRow, TokenRow
from app.storage.models.alarms import AlarmDeliveryRow, AlarmRow
from app.storage.models.base import Base
from app.storage.models.maps import AdjustmentRow, ImportRow, ReferenceRow, StoredMapRow, TideTableRow
from app.storage.models.measurements import (
    BeamEditRow,
    LogRow,
    PositionRow,
    ScanRow,
    SoundingRow,
    SoundSpeedRow,
    TargetRangeRow,
    TelemetryRow,
)
from app.storage.models.missions import (
    BatchRow,
    EventRow,
    MissionRow,
    MissionVehicleRow,
    StepRow,
    VehicleOrderRow,
    WaypointRow,
)
from app.storage.models.pings import PingBlockRow, PingChunkRow
from app.storage.models.processes import ConsoleRow, MissionOwnerRow, ProcessRow
from app.storage.models.sites import SiteMissionRow, SiteRow, SiteSurveyRow

__all__ = [
    "AdjustmentRow",
    "AlarmDeliveryRow",
    "AlarmRow",
    "AuditRow",
    "Base",
    "BatchRow",
    "BeamEditRow",
    "ConsoleRow",
    "EventRow",
    "ImportRow",
    "LogRow",
    "MissionOwnerRow",
    "MissionRow",
    "MissionVehicleRow",
    "PingBlockRow",
    "PingChunkRow",
    "PositionRow",
    "ProcessRow",
    "ReferenceRow",
    "ScanRow",
    "SessionRow",
    "SiteMissionRow",
    "SiteRow",
    "SiteSurveyRow",
    "SoundSpeedRow",
    "SoundingRow",
    "StepRow",
    "StoredMapRow",
    "TargetRangeRow",
    "TelemetryRow",
    "TideTableRow",
    "TokenRow",
    "VehicleOrderRow",
    "WaypointRow",
]
