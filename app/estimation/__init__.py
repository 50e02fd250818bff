"""What is known: sensor models and the landmark estimators. Pure: numpy in, numpy out."""

from app.estimation.beams import Attitude, BeamSonar, Dvl, Echoes, Multibeam
from app.estimation.landmarks import LandmarkEstimator, Landmarks, LandmarkSets, landmark_sets
from app.estimation.landmarks_3d import Landmark3DEstimator, Landmarks3D
from app.estimation.line_of_sight import in_sight
from app.estimation.sensors import RangeSensor, Sensor, SingleBeam
from app.estimation.team import SensorTeam

__all__ = [
    "Attitude",
    "BeamSonar",
    "Dvl",
    "Echoes",
    "Landmark3DEstimator",
    "LandmarkEstimator",
    "LandmarkSets",
    "Landmarks",
    "Landmarks3D",
    "Multibeam",
    "RangeSensor",
    "Sensor",
    "SensorTeam",
    "SingleBeam",
    "in_sight",
    "landmark_sets",
]
