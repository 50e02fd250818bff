"""Where and how a simulated vehicle comes into the world, and the sea floor that it comes to."""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from app.missions.settings import SimulationSettings
from app.missions.spec.mission import MissionSpec
from app.missions.spec.targets import TargetSpec
from app.missions.spec.vehicle import Sensor
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain, TerrainError
from simulator.floors.terrain_files import load_terrain
from simulator.obstacles.obstacles import ObstacleWorld
from simulator.sonars.mounting import SonarMounting
from simulator.sonars.swath import SwathSonar
from simulator.targets import RangingNoise
from simulator.targets import TargetSpec as SimulatedTarget
from simulator.vehicles.battery import BatterySpec

MOST_CELLS = 4_000_000
"""Of a generated sea floor: its cells are 1 m wide, over larger areas wider."""


@dataclass(frozen=True)
class Lookout:
    """What a vehicle that searches meets, in the frame of the area's south-western corner, and how it looks round."""

    world: ObstacleWorld
    reach_m: float
    resolution_deg: float


@dataclass(frozen=True)
class FinalState:
    """Where a mission left a vehicle (latitude, longitude), and what its battery held."""

    mission_id: str
    place: tuple[float, float]
    battery_pct: float


@dataclass(frozen=True)
class FloorPatch:
    """Where the sea floor of a mission lies: latitude and longitude of its south-western corner, and its extent."""

    south_west: tuple[float, float]
    width_m: float
    height_m: float

    @classmethod
    def under(cls, mission: MissionSpec) -> "FloorPatch":
        """Return that of a mission's area."""
        frame, size = mission.frame(), mission.local_area().max(axis=0)
        return cls((frame.origin_lat_deg, frame.origin_lon_deg), float(size[0]), float(size[1]))


@dataclass(frozen=True)
class Launch:
    """Where and how a simulated vehicle comes into the world.

    Attributes
    ----------
    vehicle, sensor
        Its name and its sonar.
    mission_id
        Whose it is.
    floor
        Where the sea floor lies.
    start
        Latitude and longitude; None: in the south-western corner, beside those already there.
    noise
        Standard deviation of a range as a fraction of it; 0: without any error.
    swath
        What its sonar can do when that is a multibeam.
    mounting
        How its sonar really is mounted.
    targets, ranging
        What moves about there, and how well it ranges to that.
    lookout
        For a search: then it is a boat that can stop and turn on the spot.
    battery
    goes_on_from
        Where the mission before left it, or another process, when it goes on from there.
    """

    vehicle: str
    mission_id: str
    sensor: Sensor
    floor: FloorPatch
    start: tuple[float, float] | None
    noise: float
    swath: SwathSonar = SwathSonar()  # noqa: RUF009 - frozen
    mounting: SonarMounting = SonarMounting()  # noqa: RUF009 - frozen
    targets: tuple[TargetSpec, ...] = ()
    ranging: RangingNoise = RangingNoise()  # noqa: RUF009 - frozen
    lookout: Lookout | None = None
    battery: BatterySpec = BatterySpec()  # noqa: RUF009 - frozen
    goes_on_from: FinalState | None = None


def terrain_of(file: Path) -> Terrain:
    """Return what a terrain file holds, which is read once and again when it has changed. Raises TerrainError."""
    try:
        there = file.stat()
        found = _read(file, (there.st_ino, there.st_size, there.st_ctime_ns))
    except OSError:
        found = _read(file, None)
    if isinstance(found, TerrainError):
        raise TerrainError(str(found))
    return found


@lru_cache(maxsize=1)
def _read(file: Path, _version: tuple[int, int, int] | None) -> Terrain | TerrainError:
    try:
        return load_terrain(file)
    except TerrainError as error:
        return error


def lay(settings: SimulationSettings, patch: FloorPatch) -> Terrain:
    """Return a sea floor: the file that settings name, or a generated one that covers the patch.

    Raises TerrainError.
    """
    if settings.terrain is not None:
        terrain = terrain_of(settings.terrain)
        return terrain if terrain.origin_lat_deg is not None else terrain.placed_at(*patch.south_west)
    cell_m = max(1, math.ceil(math.sqrt(patch.width_m * patch.height_m / MOST_CELLS)))
    # Whole cells that cover the area to its border and a little more.
    return generate(
        settings.family,
        settings.seed,
        width_m=cell_m * max(2, math.ceil((patch.width_m + 1e-3) / cell_m)),
        height_m=cell_m * max(2, math.ceil((patch.height_m + 1e-3) / cell_m)),
        cell_m=cell_m,
        origin=patch.south_west,
    )


def target_in(target: TargetSpec, terrain: Terrain) -> SimulatedTarget:
    """Return a moving target as it is simulated over a sea floor."""
    asked = target.simulated
    if asked is None:
        raise ValueError(f"target {target.name} is a real one")
    lon, lat = asked.start
    place = (*terrain.frame.to_local(lat, lon), asked.depth_m)
    return SimulatedTarget(target.called, place, math.radians(asked.course_deg), asked.speed_mps)
