"""Where a sonar's beam really met the bottom, when the sound was faster or slower than the sonar assumed.

The sonar measured a time and multiplied it with the speed that is set in it. The same time is followed here along the
beam through the measured profile: between two depths of it the speed changes linearly and the ray is an arc of a circle
(Medwin & Clay 1998, section 3.3): with v = speed, g = its gradient, theta = angle from vertical,

    tan(theta / 2) grows as exp(g t),    v = v0 sin(theta) / sin(theta0)   (Snell).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray

LEAST_TURN = 1e-7
"""Where the speed changes by less than this fraction of itself the ray is straight to a micrometre per ten metres."""


@dataclass(frozen=True)
class SoundSpeedProfile:
    """Sound speed over depth, linear between the entries and constant beyond them.

    Attributes
    ----------
    depths_m, speeds_mps
        Shape (n,), depths strictly ascending.
    assumed_mps
        Speed that the sonars' ranges were computed with.
    """

    depths_m: FloatArray
    speeds_mps: FloatArray
    assumed_mps: float

    def trace(self, depth_m: FloatArray, across_m: FloatArray, down_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return horizontal and vertical distance from sonar to bottom, corrected; all arrays have shape (n,).

        Parameters
        ----------
        depth_m
            Of the sonar.
        across_m, down_m
            Horizontal and vertical distance to the bottom with the assumed speed.
        """
        time = np.hypot(across_m, down_m) / self.assumed_mps
        angle = np.arctan2(across_m, down_m)
        depth, across = depth_m.astype(float).copy(), np.zeros_like(time)
        edges = np.concatenate([[-np.inf], self.depths_m, [np.inf]])
        for top, bottom in pairwise(edges):
            # Beams point down: every ray crosses the layers from top to bottom.
            rays = np.flatnonzero((time > 0.0) & (depth < bottom) & (depth >= top))
            if rays.size:
                gone, sideways, turned, used = self._cross(depth[rays], angle[rays], time[rays], float(bottom))
                depth[rays] += gone
                across[rays] += sideways
                angle[rays] = turned
                time[rays] -= used
        return across, depth - depth_m

    def _cross(
        self, depth: FloatArray, angle: FloatArray, time: FloatArray, bottom: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Follow rays to the layer's lower edge or to the end of their time.

        Returns
        -------
        Depth and horizontal distance gone, angle at the end, time used.
        """
        speed = np.interp(depth, self.depths_m, self.speeds_mps)
        inside = np.isfinite(bottom) & (depth >= self.depths_m[0])
        room = bottom - depth
        end_speed = np.interp(bottom, self.depths_m, self.speeds_mps)
        with np.errstate(invalid="ignore", divide="ignore"):
            gradient = np.where(inside, (end_speed - speed) / room, 0.0)
        straight = np.abs(gradient) * time < LEAST_TURN
        slope = np.where(straight, 1.0, gradient)
        tangent = np.tan(0.5 * angle)
        # To the layer's edge: Snell gives the angle there (or the ray turns back before), the arc its time.
        sine_edge = np.sin(angle) * np.where(straight, 1.0, end_speed / speed)
        reaches = sine_edge < 1.0
        edge_angle = np.where(straight, angle, np.arcsin(np.minimum(sine_edge, 1.0)))
        vertical = tangent < 1e-9
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(vertical, end_speed / speed, np.tan(0.5 * edge_angle) / tangent)
            edge_time = np.where(straight, room / (speed * np.cos(angle)), np.log(ratio) / slope)
        used = np.where(reaches, np.minimum(time, edge_time), time)
        growth = np.exp(np.where(straight, 0.0, slope * used))
        turned = 2.0 * np.arctan(tangent * growth)
        with np.errstate(invalid="ignore", divide="ignore"):
            speed_change = np.where(vertical, growth, np.sin(turned) / np.sin(angle)) - 1.0
            gone = np.where(straight, speed * used * np.cos(angle), speed * speed_change / slope)
            arc = speed * (np.cos(angle) - np.cos(turned)) / (np.sin(angle) * slope)
            sideways = np.where(straight, speed * used * np.sin(angle), np.where(vertical, 0.0, arc))
        ends_at_edge = reaches & (time >= edge_time)
        # Exactly on the edge, so that the next layer takes the ray over.
        return np.where(ends_at_edge, room, gone), sideways, turned, used
