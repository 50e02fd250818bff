"""What is known: sensor models, landmarks, targets, the vehicles' own places. Pure: numpy in, numpy out."""

import app.compiled.index  # noqa: F401 - before anything compiled is imported
from app.estimation.beams import Attitude, BeamSonar, Dvl, Echoes, Multibeam
from app.estimation.landmarks import LandmarkEstimator, Landmarks, LandmarkSets, landmark_sets
from app.estimation.landmarks_3d import Landmark3DEstimator, Landmarks3D
from app.estimation.line_of_sight import in_sight
from app.estimation.localization import CooperativeLocalizer, Fading, TeamPosition
from app.estimation.occupancy import Cell, OccupancyGrid, Scanner
from app.estimation.sensors import RangeSensor, Sensor, SingleBeam
from app.estimation.targets import TargetEstimator, TargetTrack
from app.estimation.team import SensorTeam

__all__ = [
    "Attitude",
    "BeamSonar",
    "Cell",
    "CooperativeLocalizer",
    "Dvl",
    "Echoes",
    "Fading",
    "Landmark3DEstimator",
    "LandmarkEstimator",
    "LandmarkSets",
    "Landmarks",
    "Landmarks3D",
    "Multibeam",
    "OccupancyGrid",
    "RangeSensor",
    "Scanner",
    "Sensor",
    "SensorTeam",
    "SingleBeam",
    "TargetEstimator",
    "TargetTrack",
    "TeamPosition",
    "in_sight",
    "landmark_sets",
]
