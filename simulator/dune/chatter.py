"""What a real vehicle sends that nobody asked for: attitude, servos and states of entities at full rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import imcpy

from simulator.dune.entities import SIMULATION
from simulator.vehicles.vehicle import STEP_S, Motion

CHATTER_HZ = 94.0
OTHER_CHATTER = tuple(SIMULATION)[:32]
"""Entities whose states make up the rest of some 710 packets a second."""


class Chatter:
    """Attitude of an AHRS at 94 Hz and four servos each as often: 660 packets a second, unless they are limited.

    ``entities`` are ids by name.
    """

    def __init__(self, entities: Mapping[str, int]) -> None:
        self._entities = entities
        self._owed = 0.0

    def step(self, motion: Motion, send: Callable[[imcpy.Message, int], None]) -> None:
        """Send what a step of the simulation brings, each message with its entity."""
        self._owed += CHATTER_HZ * STEP_S
        while self._owed >= 1.0:
            self._owed -= 1.0
            euler = imcpy.EulerAngles()
            euler.phi, euler.theta, euler.psi = motion.roll_rad, motion.pitch_rad, motion.heading_rad
            rates = imcpy.AngularVelocity()
            rates.z = motion.turn_rate_radps
            for message in (euler, rates, imcpy.Acceleration()):
                send(message, self._entities["AHRS"])
            for servo in range(4):
                position = imcpy.ServoPosition()
                position.id = servo
                send(position, self._entities["Servos"])
        for label in OTHER_CHATTER:
            send(imcpy.EntityState(), self._entities[label])
