"""One row of every table."""

import hashlib
from datetime import UTC, datetime
from typing import Any

import numpy as np

from app.storage.models import (
    AdjustmentRow,
    AlarmDeliveryRow,
    AlarmRow,
    AuditRow,
    BatchRow,
    BeamEditRow,
    ConsoleRow,
    EventRow,
    ImportRow,
    LogRow,
    MissionOwnerRow,
    MissionRow,
    MissionVehicleRow,
    PingBlockRow,
    PingChunkRow,
    PositionRow,
    ProcessRow,
    ReferenceRow,
    ScanRow,
    SessionRow,
    SiteMissionRow,
    SiteRow,
    SiteSurveyRow,
    SoundingRow,
    SoundSpeedRow,
    StepRow,
    StoredMapRow,
    TargetRangeRow,
    TelemetryRow,
    TideTableRow,
    TokenRow,
    VehicleOrderRow,
    WaypointRow,
)
from app.storage.ping_files import file_name
from app.storage.queries.scans import pack_ranges
from app.storage.queries.soundings import pack

TIME = datetime(2026, 6, 1, 12, 30, 15, 250_000, tzinfo=UTC)


def mission(mission_id: str = "m1", **changes: Any) -> MissionRow:
    values: dict[str, Any] = {
        "id": mission_id,
        "name": "Harbour",
        "state": "ready",
        "reason": "",
        "spec": {"steps": 3, "area": [[-8.7, 41.18]]},
        "created_at": TIME,
        "updated_at": TIME,
        "elapsed_s": 1.5,
    }
    return MissionRow(**(values | changes))


def vehicle(mission_id: str = "m1", name: str = "a", slot: int = 0) -> MissionVehicleRow:
    return MissionVehicleRow(
        mission_id=mission_id, name=name, slot=slot, spec={"name": name}, joined_at=TIME, left_at=None
    )


def step(mission_id: str = "m1", number: int = 1) -> StepRow:
    return StepRow(
        mission_id=mission_id,
        number=number,
        committed_at=TIME,
        objective=0.25,
        terms={"gain": 1.0},
        soundings=7,
        map_digest="0" * 64,
        memory=b"\x00memory",
    )


def waypoint(mission_id: str = "m1", number: int = 1, name: str = "a", **changes: Any) -> WaypointRow:
    values: dict[str, Any] = {
        "mission_id": mission_id,
        "step": number,
        "vehicle": name,
        "lat_deg": 41.18,
        "lon_deg": -8.7,
        "east_m": 1.0,
        "north_m": 2.0,
        "depth_m": 3.0,
        "status": "planned",
        "reason": "",
        "changed_at": TIME,
    }
    return WaypointRow(**(values | changes))


def sounding(
    mission_id: str = "m1", name: str = "a", time_s: float = 1.0, beam: int = 0, **changes: Any
) -> dict[str, Any]:
    values: dict[str, Any] = {
        "mission_id": mission_id,
        "vehicle": name,
        "time_s": time_s,
        "beam": beam,
        "received_at": TIME,
        "step": 0,
        "source": "rest",
        "lat_deg": 41.18,
        "lon_deg": -8.7,
        "east_m": 1.0,
        "north_m": 2.0,
        "vehicle_depth_m": 2.0,
        "range_m": 8.0,
        "raw_depth_m": 10.0,
        "depth_m": 10.0,
        "sd_m": 0.08,
        "position_sd_m": None,
        "verdict": "accepted",
        "reason": "",
    }
    return values | changes


def position(mission_id: str = "m1", name: str = "a", time_s: float = 1.0, lat_deg: float = 41.18) -> dict[str, Any]:
    return {
        "mission_id": mission_id,
        "vehicle": name,
        "time_s": time_s,
        "lat_deg": lat_deg,
        "lon_deg": -8.7,
        "depth_m": 2.0,
    }


def target_range(mission_id: str = "m1", target: str = "tag-1", time_s: float = 1.0) -> dict[str, Any]:
    return {
        "mission_id": mission_id,
        "target": target,
        "vehicle": "a",
        "time_s": time_s,
        "at_s": time_s,
        "received_at": TIME,
        "step": 0,
        "source": "rest",
        "range_m": 42.0,
        "lat_deg": 41.18,
        "lon_deg": -8.7,
        "depth_m": 2.0,
        "position_sd_m": None,
        "verdict": "accepted",
        "reason": "",
    }


def scan(mission_id: str = "m1", time_s: float = 1.0) -> dict[str, Any]:
    return {
        "mission_id": mission_id,
        "vehicle": "a",
        "time_s": time_s,
        "received_at": TIME,
        "step": 0,
        "source": "rest",
        "lat_deg": 41.18,
        "lon_deg": -8.7,
        "depth_m": 0.0,
        "first_bearing_deg": 0.0,
        "bearing_step_deg": 90.0,
        "reach_m": 12.0,
        "ranges": pack_ranges([1.5, float("inf"), 3.0, 4.0]),
        "verdict": "accepted",
        "reason": "",
    }


PING_FILE = b"a file of pings"
_PING_DIGEST = hashlib.sha256(PING_FILE).hexdigest()
PING_FILE_NAME = file_name("m1", 1, _PING_DIGEST)


def ping_block(mission_id: str = "m1", **changes: Any) -> dict[str, Any]:
    values: dict[str, Any] = {
        "mission_id": mission_id,
        "vehicle": "a",
        "step": 0,
        "received_at": TIME,
        "source": "rest",
        "first_time_s": 2.0,
        "last_time_s": 2.0,
        "pings": 1,
        "beams": 3,
        "rejected": 0,
        "times": np.array([2.0]).tobytes(),
        "content": b"pings",
    }
    return values | changes


def sound_speed(mission_id: str = "m1", time_s: float = 1.0, **changes: Any) -> dict[str, Any]:
    values: dict[str, Any] = {
        "mission_id": mission_id,
        "vehicle": "a",
        "source": "CTD",
        "time_s": time_s,
        "lat_deg": 41.18,
        "lon_deg": -8.7,
        "depth_m": 2.0,
        "speed_mps": 1507.5,
    }
    return values | changes


def ping_chunk(mission_id: str = "m1") -> PingChunkRow:
    """What the database knows of the file :data:`PING_FILE`."""
    return PingChunkRow(
        mission_id=mission_id,
        vehicle="a",
        name=PING_FILE_NAME,
        first_block=1,
        last_block=1,
        first_time_s=1.0,
        last_time_s=1.0,
        pings=1,
        beams=3,
        rejected=0,
        times=np.array([1.0]).tobytes(),
        digest=_PING_DIGEST,
        size=len(PING_FILE),
    )


def alarm(**changes: Any) -> AlarmRow:
    values = {
        "id": "a1",
        "mission_id": "m1",
        "event_id": None,
        "kind": "vehicle_lost",
        "severity": "major",
        "vehicle": "a",
        "message": "a is lost: silent",
        "raised_at": TIME,
        "acknowledged_at": None,
        "acknowledged_by": None,
        "told_after_s": None,
        "next_at": TIME,
    }
    return AlarmRow(**(values | changes))


def one_of_each() -> list[list[Any]]:
    """Rows in the order in which foreign keys allow them."""
    return [
        [
            mission(),
            ProcessRow(id=1, url="http://10.0.0.5", secret="e" * 64, certificate=None, began_at=TIME),
            ConsoleRow(imc_id=0x3F01),
        ],
        [vehicle(), step(), MissionOwnerRow(mission_id="m1", process_id=1, since=TIME)],
        [waypoint()],
        [
            SoundingRow(**sounding()),
            PositionRow(**position()),
            LogRow(
                mission_id="m1",
                vehicle="a",
                digest="e" * 64,
                altimeter="vertical",
                file="Data.lsf",
                created_at=TIME,
                taken_back_at=TIME,
                taken_back_by="me",
            ),
            BeamEditRow(mission_id="m1", made_at=TIME, actor="me", ruling="rejected", note="fish", content=b"beams"),
            TargetRangeRow(**target_range()),
            SoundSpeedRow(**sound_speed()),
            ScanRow(**scan()),
            VehicleOrderRow(
                mission_id="m1",
                vehicle="a",
                kind="go",
                state="flying",
                way={"corners": [[-8.7, 41.18]]},
                asked_by="Ana",
                asked_at=TIME,
                changed_at=TIME,
                reason="",
            ),
            PingBlockRow(**ping_block()),
            ping_chunk(),
            TelemetryRow(
                mission_id="m1", vehicle="a", at_s=5.0, depth_m=2.0, altitude_m=None, battery_pct=80.0, age_s=0.1
            ),
            BatchRow(mission_id="m1", key="k", digest="d", answer={"accepted": 1}, created_at=TIME),
            EventRow(mission_id="m1", time=TIME, level="info", kind="state", message="made", data={"by": "me"}),
            alarm(),
            StoredMapRow(
                mission_id="m1",
                made_at=TIME,
                step=1,
                last_sounding=1,
                last_import=0,
                accepted=1,
                rejected=0,
                soundings=1,
                thorough=True,
                digest="0" * 64,
                content=b"map",
            ),
            SiteRow(id="s1", name="Harbour mouth", spec={"cell_m": 1.0}, created_at=TIME, updated_at=TIME),
            AdjustmentRow(mission_id="m1", made_at=TIME, actor="me", content=b"offsets"),
            TideTableRow(mission_id="m1", name="Leixoes", text="2026/01/01 00:00 1.0"),
            ImportRow(
                id="i1",
                mission_id="m1",
                digest="d" * 64,
                filename="old.xyz",
                created_at=TIME,
                count=1,
                summary={"source": "survey of 2019"},
                soundings=pack(np.array([[1.0, 2.0, 3.0, 0.5]])),
            ),
            ReferenceRow(
                mission_id="m1",
                filename="truth.tif",
                created_at=TIME,
                rows=1,
                cols=2,
                summary={},
                depths=pack(np.array([[3.0, np.nan]])),
            ),
            AuditRow(
                time=TIME,
                actor="Ana",
                role="operator",
                origin="192.0.2.7",
                action="startMission",
                target="/api/v1/missions/m1/start",
                mission_id="m1",
                result="done",
                status=200,
                detail="",
                request_id="5e1f",
            ),
            TokenRow(
                id="t1",
                name="Ana",
                role="operator",
                vehicle=None,
                token_hash="f" * 64,
                created_at=TIME,
                expires_at=None,
                revoked_at=None,
            ),
        ],
        [
            AlarmDeliveryRow(
                id="d1",
                alarm_id="a1",
                recipient="bridge",
                notice="raised",
                state="waiting",
                attempts=0,
                created_at=TIME,
                next_try_at=TIME,
                done_at=None,
                error="",
                process_id=1,
            )
        ],
        [
            SessionRow(secret_hash="e" * 64, token_hash="f" * 64, created_at=TIME, expires_at=TIME),
            SiteMissionRow(mission_id="m1", site_id="s1"),
            SiteSurveyRow(
                mission_id="m1",
                site_id="s1",
                mission_name="Harbour",
                made_at=TIME,
                first_time_s=5.0,
                last_time_s=6.0,
                last_sounding=1,
                last_import=0,
                last_block=0,
                summary={"cells": 1},
                digest="0" * 64,
                content=b"survey",
            ),
        ],
    ]
