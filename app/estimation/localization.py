"""Where the vehicles are: dead reckoning whose error grows with the distance travelled, and what ends it (NGCUV12).

Under water there is no GPS. A vehicle measures its legs with an error that is a fraction of their length, its *drift*,
which wanders slowly: over short ways the position's error grows in proportion to the distance, as NGCUV12 has it, over
long ways with its square root. Depth is measured by pressure and taken as known. One extended Kalman filter holds the
horizontal positions and drifts of the whole team, so that a range between two vehicles informs about both, and a fix of
one about all that ranged to it. Positions become good again by a fix at the surface, or by ranges to a surface vehicle
that knows where it is.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.arrays import FloatArray

AXES = 4
"""States of one vehicle: east, north, drift along east and north."""

HOPS = 8
"""Parts into which a way ahead is cut, because the drift wanders on the way."""


@dataclass(frozen=True)
class Fading:
    """How localization fades.

    Attributes
    ----------
    drift : float
        Standard deviation of the error of a leg along each axis, as a fraction of its length.
    memory_m : float
        Distance over which the drift wanders to another value; inf: it never changes.
    fix_sd_m : float
        Standard deviation of a GPS fix along each axis.
    range_noise : float
        Relative noise of ranges between vehicles, acoustic times of flight.
    """

    drift: float = 0.015
    memory_m: float = 1.0
    fix_sd_m: float = 0.002
    range_noise: float = 0.01

    def kept(self, distance: FloatArray) -> FloatArray:
        """Return which part of the drift is left after some distance."""
        return np.asarray(np.exp(-np.asarray(distance) / self.memory_m))


@dataclass(frozen=True)
class TeamPosition:
    """What is known of the team's positions; every update returns a new object.

    Attributes
    ----------
    depth_m : (n_vehicles,)
        Depths by pressure.
    mean : (4 * n_vehicles,)
        Per vehicle east, north and drift along both.
    covariance : (4 * n_vehicles, 4 * n_vehicles)
        Of ``mean``.
    """

    depth_m: FloatArray
    mean: FloatArray
    covariance: FloatArray

    @property
    def vehicles(self) -> int:
        """How many vehicles there are."""
        return len(self.depth_m)

    @property
    def positions_m(self) -> FloatArray:
        """Estimated positions, (n_vehicles, 3)."""
        return np.column_stack([self.mean.reshape(-1, AXES)[:, :2], self.depth_m])

    @property
    def variance_m2(self) -> FloatArray:
        """Variances of each vehicle's position along east, north and depth, (n_vehicles, 3)."""
        diagonal = np.diagonal(self.covariance).reshape(-1, AXES)
        return np.column_stack([diagonal[:, :2], np.zeros(self.vehicles)])

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviation of each vehicle's horizontal position along its worst direction, (n_vehicles,)."""
        blocks = np.array([self.covariance[k : k + 2, k : k + 2] for k in range(0, len(self.mean), AXES)])
        return np.sqrt(np.maximum(np.linalg.eigvalsh(blocks)[:, -1], 0.0))


def radius(sd_m: FloatArray, probability: float) -> FloatArray:
    """Return within which horizontal distance a vehicle is with at least this probability."""
    return np.asarray(np.sqrt(-2.0 * np.log(1.0 - probability)) * np.asarray(sd_m))


@dataclass(frozen=True)
class CooperativeLocalizer:
    """The filter; see the module's text."""

    fading: Fading = Fading()

    def begin(self, positions: FloatArray) -> TeamPosition:
        """Return a team that has just had a fix at ``positions`` (n_vehicles, 3)."""
        n = len(positions)
        variance = np.tile([self.fading.fix_sd_m**2] * 2 + [self.fading.drift**2] * 2, n)
        mean = np.zeros((n, AXES))
        mean[:, :2] = positions[:, :2]
        return TeamPosition(positions[:, 2].copy(), mean.ravel(), np.diag(variance))

    def move(self, team: TeamPosition, legs: FloatArray) -> TeamPosition:
        """Let every vehicle go a leg (n_vehicles, 3) as it measured it itself."""
        n = team.vehicles
        distance = np.linalg.norm(legs, axis=1)
        kept = self.fading.kept(distance)
        F, Q = np.eye(AXES * n), np.zeros(AXES * n)
        mean = team.mean.reshape(n, AXES).copy()
        mean[:, :2] += legs[:, :2] + distance[:, None] * mean[:, 2:]
        mean[:, 2:] *= kept[:, None]
        for i in range(n):
            k = AXES * i
            F[k, k + 2] = F[k + 1, k + 3] = distance[i]
            F[k + 2, k + 2] = F[k + 3, k + 3] = kept[i]
            Q[k + 2 : k + 4] = (1.0 - kept[i] ** 2) * self.fading.drift**2
        covariance = F @ team.covariance @ F.T + np.diag(Q)
        return TeamPosition(team.depth_m + legs[:, 2], mean.ravel(), covariance)

    def fix(self, team: TeamPosition, vehicle: int, en_m: FloatArray) -> TeamPosition:
        """Take in a GPS fix (2,) of the vehicle in this row."""
        H = np.zeros((2, len(team.mean)))
        H[0, AXES * vehicle] = H[1, AXES * vehicle + 1] = 1.0
        innovation = np.asarray(en_m) - team.mean[AXES * vehicle : AXES * vehicle + 2]
        return _joseph(team, H, innovation, self.fading.fix_sd_m**2 * np.eye(2))

    def meet(self, team: TeamPosition, first: int, second: int, distance_m: float) -> TeamPosition:
        """Take in a range between the vehicles in two rows."""
        where = team.positions_m
        d = where[first] - where[second]
        r = max(float(np.linalg.norm(d)), 1e-9)
        H = np.zeros((1, len(team.mean)))
        for k in range(2):
            H[0, AXES * first + k], H[0, AXES * second + k] = d[k] / r, -d[k] / r
        return self._take_range(team, H, d, r, distance_m, self._relative_covariance(team, first, second))

    def _take_range(
        self, team: TeamPosition, H: FloatArray, d: FloatArray, r: float, y: float, relative: FloatArray
    ) -> TeamPosition:
        """Update by a range whose ends' horizontal difference has the covariance ``relative`` (2, 2)."""
        u = d[:2] / r
        hessian = (np.eye(2) - np.outer(u, u)) / r
        curved = hessian @ relative
        predicted = r + 0.5 * float(np.trace(curved))
        # What the range sees beyond the joint filter's own states: second order and noise.
        along = float(u @ relative @ u)
        rest = 0.5 * float(np.trace(curved @ curved)) + self.fading.range_noise**2 * (predicted**2 + along)
        rest += max(0.0, along - float((H @ team.covariance @ H.T)[0, 0]))
        return _joseph(team, H, np.array([y - predicted]), np.array([[rest]]))

    def _relative_covariance(self, team: TeamPosition, first: int, second: int) -> FloatArray:
        a, b, P = AXES * first, AXES * second, team.covariance
        both = P[a : a + 2, a : a + 2] + P[b : b + 2, b : b + 2]
        return np.asarray(both - P[a : a + 2, b : b + 2] - P[b : b + 2, a : a + 2])

    def foretold_sd_m(self, team: TeamPosition, ahead_m: float) -> FloatArray:
        """Return what :attr:`TeamPosition.sd_m` will be after everyone went so far without a fix, (n_vehicles,)."""
        hop = np.zeros((team.vehicles, 3))
        hop[:, 2] = ahead_m / HOPS
        for _ in range(HOPS):
            team = self.move(team, hop)
        return team.sd_m


def _joseph(team: TeamPosition, H: FloatArray, innovation: FloatArray, R: FloatArray) -> TeamPosition:
    """Update in Joseph form."""
    P = team.covariance
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    A = np.eye(len(P)) - K @ H
    covariance = A @ P @ A.T + K @ R @ K.T
    return replace(team, mean=team.mean + K @ innovation, covariance=0.5 * (covariance + covariance.T))
