"""What is known: sensor models and the landmark estimator. Pure: numpy in, numpy out."""

from app.estimation.landmarks import LandmarkEstimator, Landmarks, LandmarkSets, landmark_sets
from app.estimation.line_of_sight import in_sight
from app.estimation.sensors import RangeSensor, Sensor, SingleBeam

__all__ = [
    "LandmarkEstimator",
    "Landmarks",
    "LandmarkSets",
    "RangeSensor",
    "Sensor",
    "SingleBeam",
    "in_sight",
    "landmark_sets",
]
