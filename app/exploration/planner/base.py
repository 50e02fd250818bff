"""What all planners share: order of vehicles, the bottom, cruise depths, and making sure that an answer is feasible."""

import zlib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from app.arrays import FloatArray
from app.estimation import RangeSensor, Sensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints, Limit
from app.exploration.core.errands import Errand, Errands, errand_move
from app.exploration.core.problem import Proposal, Situation
from app.exploration.core.snapshot_codec import pack, unpack
from app.exploration.planner.options import PlannerOptions

PASSES = 2
OF_TWO = (Limit.COM_RANGE, Limit.SEPARATION)
"""Limits that others' places decide about, too."""
FRACTIONS = (1.0, 0.75, 0.5, 0.25, 0.1)


class PlannerBase(ABC):
    """Sorts the vehicles by name, so that their order never matters, and falls back when a wish is not feasible."""

    name: ClassVar[str]

    own_options: ClassVar[frozenset[str] | None] = None
    """Options that it reads beside those that every planner does; None: it does not say, and takes them all."""

    runs_errands: ClassVar[bool] = True
    """Whether single vehicles leave the plan for targets and the surface; see :mod:`app.exploration.core.errands`."""

    plans_for_all: bool = False
    """Whether its plan needs to know of vehicles that get no leg now."""

    decides_apart: bool = False
    """Whether legs may be decided for some of the vehicles while the others fly on."""

    flies_lines: bool = False
    """Whether vehicles fly lines, the rest of which can be left out."""

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        self.options = options
        self.sensor = sensor
        self._cruise: dict[str, float] = {}
        self._errands = Errands()
        self._whole: Situation | None = None

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Return a configuration that obeys ``situation.constraints``; hold when none is found."""
        if not situation.vehicles:
            return Proposal(np.zeros((0, 3)), 0.0)
        order = sorted(range(len(situation.vehicles)), key=lambda i: situation.vehicles[i])
        inverse = np.argsort(order)
        team = situation.of(np.array(order))
        for name, depth in zip(team.vehicles, team.positions[:, 2], strict=True):
            wish = self.options.cruise_depth_m
            self._cruise.setdefault(name, float(depth if wish is None else wish))
        belief = situation.belief
        bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m) if belief.on_floor else Bottom.unknown()
        proposal = self._with_errands(team, bottom, int(rng.integers(2**63)))
        return replace(proposal, positions=proposal.positions[inverse])

    def _with_errands(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        """Decide for the vehicles that follow the plan, then for those on errands."""
        self._whole = team
        # Bathymeter missions rise along their legs instead; see app.missions.flight.decisions.decision.
        localization = None if self._surveys else team.localization
        if not self.runs_errands or (team.targets is None and localization is None):
            return self._decide_for_moving(team, bottom, seed)
        errands = self._errands.assign(team.vehicles, team.positions, team.targets, localization)
        if not errands:
            return self._decide_for_moving(team, bottom, seed)
        rows = {errand.vehicle: team.vehicles.index(errand.vehicle) for errand in errands}
        positions, objective, terms = team.positions.copy(), 0.0, {}
        if np.isfinite(team.constraints.com_range_m):  # no vehicle may go alone
            first = errands[0]
            move = self._go(team, bottom, positions, rows[first.vehicle], first) - positions[rows[first.vehicle]]
            positions, _ = settle(team, bottom, (team.positions + move)[None])
        else:
            rest = np.array([i for i in range(len(team.vehicles)) if i not in rows.values()], dtype=np.int64)
            if len(rest):
                proposal = self._decide_for_moving(team.of(rest), bottom, seed)
                positions[rest], objective, terms = proposal.positions, proposal.objective, proposal.terms
            for errand in errands:
                row = rows[errand.vehicle]
                if team.moves[row]:
                    positions[row] = self._go(team, bottom, positions, row, errand)
        named = {errand.vehicle: errand.target for errand in errands}
        return Proposal(positions, objective, {**terms, "errands": float(len(errands))}, named)

    def _go(self, team: Situation, bottom: Bottom, positions: FloatArray, row: int, errand: Errand) -> FloatArray:
        def at_cruise(configurations: FloatArray) -> FloatArray:
            return self._at_cruise(team, bottom, configurations[..., :2])

        return errand_move(
            row,
            errand,
            team.positions,
            positions,
            team.constraints,
            bottom,
            team.targets,
            team.localization,
            at_cruise if self._surveys else None,
        )

    def _decide_for_moving(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        """Decide for the vehicles that get a leg; the others stay where theirs end."""
        moves = team.moves
        if not moves.any():
            return Proposal(team.positions.copy(), 0.0)
        if moves.all() or self.plans_for_all:
            return self._decide(team, bottom, seed)
        proposal = self._decide(team.of(np.flatnonzero(moves)), bottom, seed)
        wish = team.positions.copy()
        wish[moves] = proposal.positions
        return replace(proposal, positions=settle(team, bottom, wish[None])[0])

    def stand_in(self, other: "PlannerBase", team: Situation, bottom: Bottom, seed: int) -> Proposal:
        """Decide in place of another planner, which keeps errands and cruise depths."""
        self._cruise, self._whole = other._cruise, other._whole
        return self._decide(team, bottom, seed)

    @abstractmethod
    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        """Decide for vehicles in the order of their names."""

    def take_back(self, legs: Mapping[str, int]) -> bool:
        """Take back so many of the last legs of some vehicles: they are not flown, and will be decided anew.

        Returns False, and nothing is changed, where the planner does not know any more what it planned before them.
        """
        return not any(legs.values())

    def put_back(self, vehicle: str, ends_m: FloatArray, resume_at_m: FloatArray | None) -> None:
        """Learn that a vehicle does not fly its last legs, which were to end at ``ends_m`` (n, 2).

        Where it comes back it goes on from ``resume_at_m`` (2,); None: from wherever it is then.
        """
        return

    def skip_line(self, vehicle: str, begin_m: FloatArray, here_m: FloatArray) -> bool:
        """Leave out the rest of the line that a vehicle is on; returns False where it flies none.

        Parameters
        ----------
        begin_m, here_m : (2,)
            Where the line began, and where the vehicle is.
        """
        return False

    def leave_out(self, vehicle: str, count: int, here_m: FloatArray) -> bool:
        """Leave out the next via points of a vehicle's plan; returns False where it has no such plan.

        Parameters
        ----------
        count
            How many of what :meth:`ways_ahead_m` tells of it.
        here_m : (2,)
            Where the vehicle is.
        """
        return False

    def ways_ahead_m(self) -> dict[str, FloatArray]:
        """Return where vehicles go after what was proposed last, as planned now, (k, 2) by name.

        Empty where only the next step is planned.
        """
        return {}

    def lines_left_m(self) -> float:
        """Return how long those lines are that nobody has been given, or can reach.

        Of lines at a distance that was asked for, or of a plan that was given; 0 without such.
        """
        return 0.0

    def lines_left(self) -> dict[str, float]:
        """Return how much is left of each of those lines that has a name, metres."""
        return {}

    def snapshot(self) -> bytes:
        """Return the planner's memory."""
        errands = self._errands.remember()
        return pack(
            self.name, {"cruise": self._cruise, **({"errands": errands} if errands else {}), **self._remember()}
        )

    def restore(self, memory: bytes) -> None:
        """Take up a memory made by ``snapshot``. Raises ValueError when it is not one."""
        state = unpack(self.name, memory)
        try:
            self._cruise = {str(k): float(v) for k, v in state.pop("cruise").items()}
            self._errands.recall(state.pop("errands", {}))
            self._recall(state)
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"planner memory of {self.name!r} lacks or garbles a field: {error}") from error

    def _remember(self) -> dict[str, Any]:
        return {}

    def _recall(self, state: dict[str, Any]) -> None:
        return None

    @property
    def _surveys(self) -> bool:
        """Whether this is a bathymeter mission: soundings along horizontal legs, no landmarks seen from afar."""
        return not isinstance(self.sensor, RangeSensor)

    def _at_cruise(self, team: Situation, bottom: Bottom, en_m: FloatArray) -> FloatArray:
        """Give targets (..., n_vehicles, 2) the vehicles' cruise depths, clear of the bottom: (..., n_vehicles, 3)."""
        wish = np.array([self._cruise[name] for name in team.vehicles])
        return at_depth(team.constraints, bottom, team.positions, en_m, wish)


def vehicle_rng(seed: int, vehicle: str) -> np.random.Generator:
    """Return a vehicle's own generator for this step, the same whatever row it stands in."""
    return np.random.default_rng([seed, zlib.crc32(vehicle.encode())])


def at_depth(
    constraints: Constraints, bottom: Bottom, origin: FloatArray, en_m: FloatArray, wish_m: FloatArray
) -> FloatArray:
    """Complete horizontal targets by depths; legs that would become longer than a step are shortened horizontally.

    Parameters
    ----------
    origin : (n_vehicles, 3)
        Where the legs begin.
    en_m : (..., n_vehicles, 2)
        Where they should end.
    wish_m : (..., n_vehicles)
        Wanted depths; clipped to the band and to the clearance above the estimated bottom along the leg.
    """
    leg = en_m - origin[:, :2]
    reach = constraints.max_step_m * (1.0 - 1e-9)
    drop = np.zeros(leg.shape[:-1])
    for _ in range(PASSES):  # a shortened leg lies over other ground
        room = bottom.deepest_end_m(origin, leg, constraints.min_altitude_m, constraints.climb)
        deepest = np.minimum(constraints.max_depth_m, room)
        depth = np.maximum(np.minimum(wish_m, deepest), constraints.min_depth_m)
        drop = np.clip(depth - origin[:, 2], -reach, reach)
        length = np.hypot(leg[..., 0], leg[..., 1])
        allowed = np.sqrt(np.maximum(0.0, reach**2 - drop**2))
        leg = leg * np.minimum(1.0, allowed / np.maximum(length, 1e-12))[..., None]
    return np.concatenate([origin[:, :2] + leg, (origin[:, 2] + drop)[..., None]], axis=-1)


def settle(team: Situation, bottom: Bottom, wishes: FloatArray) -> tuple[FloatArray, int]:
    """Return the first feasible of some team configurations, or of gentler versions of them, and the wish it came from.

    Tries, in this order: the wishes (k, n_vehicles, 3) as they are; for those that the first one moves, where others
    are to stay and may not be where they are; each shortened for the whole team; each for all vehicles but some that
    hold; hold; straight back towards the middle of the area. When nothing is feasible the answer is to hold, which the
    safety check then refuses with the reason.
    """
    constraints, origin = team.constraints, team.positions
    n = len(origin)
    ok = constraints.feasible(origin, wishes, bottom)
    if ok.any():
        first = int(np.argmax(ok))
        return wishes[first], first
    going = (wishes[0, :, :2] != origin[:, :2]).any(axis=1)
    if going.any() and not going.all():
        rows = np.flatnonzero(going)
        some = origin.copy()
        some[rows], first = settle(team.of(rows), bottom, wishes[:, rows])
        broken = constraints.violations(team.vehicles, origin, some, bottom)
        # What a vehicle breaks by staying, and by that alone, is nobody else's.
        if not any(going[team.vehicles.index(one.vehicle)] or one.limit in OF_TWO for one in broken):
            return some, first
    best = wishes[: min(len(wishes), 8)]
    tries = [origin + f * (best - origin) for f in FRACTIONS]
    for i in range(n):
        others = np.repeat(best, 2 * len(FRACTIONS), axis=0)
        scale = np.tile([*FRACTIONS, *(-f for f in FRACTIONS)], len(best))[:, None]
        alone = np.broadcast_to(origin, others.shape).copy()
        alone[:, i] = origin[i] + scale * (others[:, i] - origin[i])
        others[:, i] = origin[i]
        tries += [others[:: 2 * len(FRACTIONS)], alone]
    tries.append(origin[None])
    middle = constraints.area.mean(axis=0)
    inward = np.broadcast_to(origin, (len(FRACTIONS), n, 3)).copy()
    for k, f in enumerate(FRACTIONS):
        way = middle - origin[:, :2]
        length = np.maximum(np.hypot(*way.T), 1e-12)
        inward[k, :, :2] += way / length[:, None] * np.minimum(length, f * constraints.max_step_m)[:, None]
    depths = np.clip(origin[:, 2], constraints.min_depth_m, constraints.max_depth_m)
    tries.append(at_depth(constraints, bottom, origin, inward[..., :2], depths))
    pool = np.concatenate(tries)
    ok = constraints.feasible(origin, pool, bottom)
    return (pool[int(np.argmax(ok))], 0) if ok.any() else (origin.copy(), 0)
