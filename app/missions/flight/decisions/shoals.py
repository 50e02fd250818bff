"""Vehicles that shoals cut off: the legs by which they leave, and how the others are planned for."""

from dataclasses import replace

import numpy as np

from app.exploration.core.constraints import Constraints
from app.exploration.core.open_ground import OpenGround
from app.missions.flight.decisions.leg import Leg, Place
from app.missions.safety.tide_and_bottom import BottomNow
from app.missions.safety.way_off_shoals import way_off
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import arrival_room_m

POND = 2.0
"""Who is cut off by shoals on less ground than a square of so many steps leaves it: little can be flown there."""


def sent_off_shoals(
    team: list[Place], spec: MissionSpec, constraints: Constraints, floor: BottomNow
) -> tuple[list[Place], list[Leg], list[str]]:
    """Return the vehicles as they are planned for, the legs of those that shoals cut off, and what is to be said.

    A planner finds no way off a shoal: each begins over ground that it may not go over. It plans for the others as if
    who is there had left already, for that one would keep all of them from their legs.
    """
    ground = OpenGround(floor.likely, constraints)
    planned: list[Place] = []
    legs: list[Leg] = []
    notes: list[str] = []
    for place in team:
        if place.keeps_depth or not ground.is_cut_off(place.en_m, (POND * constraints.max_step_m) ** 2):
            planned.append(place)
            continue
        others = (
            [p.en_m for p in team if p is not place] + [p.en_m for p in planned] + [leg.target_m[:2] for leg in legs]
        )
        goal = way_off(place.en_m, ground, floor.likely, constraints, others, arrival_room_m(spec))
        # Its lines stay its own.
        planned.append(replace(place, en_m=ground.nearest_m(place.en_m) if goal is None else goal, moving=False))
        if not place.moving:
            continue
        depth_m, least_m = float(floor.likely.at(place.en_m)), constraints.min_altitude_m
        where = f"the bottom is {depth_m:.1f} m below the surface there, and {least_m:g} m are needed"
        if depth_m >= least_m:
            where = "shoals cut it off there"
        refusal = "" if goal is not None else f"{where}; every way off leads over dry ground or is barred"
        end_m = place.en_m if goal is None else goal
        legs.append(Leg(place.vehicle, np.append(end_m, 0.0), refusal, unplanned=True))
        notes.append(f"{place.vehicle}: {refusal or f'{where}; it leaves for deeper ground at the surface'}")
    return planned, legs, notes
