"""A team whose vehicles carry different sensors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.estimation.beams import Attitude, BeamSonar
from app.estimation.landmarks import LandmarkEstimator, Landmarks
from app.estimation.sensors import RangeSensor


@dataclass(frozen=True)
class SensorTeam:
    """Which vehicle ranges to landmarks with what.

    Attributes
    ----------
    sensors : mapping of str to RangeSensor or BeamSonar
        By vehicle. A single beam is a :class:`~app.estimation.beams.Multibeam` of one beam.
    """

    sensors: Mapping[str, RangeSensor | BeamSonar]

    def visible(
        self, vehicles: Sequence[str], positions: FloatArray, attitudes: Sequence[Attitude], landmarks: FloatArray
    ) -> BoolArray:
        """Return which vehicle sees which landmark, (n_vehicles, n_landmarks).

        Parameters
        ----------
        vehicles : sequence of str
            Names, in the order of the rows of ``positions`` (n_vehicles, 3) and of ``attitudes``.
        landmarks : (n_landmarks, 3)
            Landmarks; those of unknown depth (NaN) are not visible.
        """
        rows = [
            self._sees(self.sensors[name], position, attitude, landmarks)
            for name, position, attitude in zip(vehicles, positions, attitudes, strict=True)
        ]
        return np.array(rows, dtype=np.bool_).reshape(len(vehicles), len(landmarks))

    def look(
        self,
        landmarks: Landmarks,
        truth: FloatArray,
        vehicles: Sequence[str],
        positions: FloatArray,
        attitudes: Sequence[Attitude],
        estimator: LandmarkEstimator,
        rng: np.random.Generator,
    ) -> Landmarks:
        """Return what is known after every vehicle has measured, each range weighed by its own sensor's noise.

        Parameters
        ----------
        truth : (n_landmarks, 3)
            Where the landmarks really are.
        estimator : LandmarkEstimator
            Its sensor is replaced by that of each vehicle.
        """
        visible_by = self.visible(vehicles, positions, attitudes, truth)
        for j, name in enumerate(vehicles):
            sensor, index = self.sensors[name], np.flatnonzero(visible_by[j])
            ranges = sensor.measure(positions[j], truth[index], rng)
            landmarks = replace(estimator, sensor=sensor).update(landmarks, j, positions[j], index, ranges)
        return landmarks

    @staticmethod
    def _sees(
        sensor: RangeSensor | BeamSonar, position: FloatArray, attitude: Attitude, landmarks: FloatArray
    ) -> BoolArray:
        if isinstance(sensor, RangeSensor):
            return np.asarray(sensor.visible(position[None], landmarks)[0], dtype=np.bool_)
        return sensor.meets(position, attitude, landmarks)
