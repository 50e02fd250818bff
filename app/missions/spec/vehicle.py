"""A vehicle that takes part in a mission: how it is reached, led and equipped."""

from enum import StrEnum
from typing import Annotated, Self

from pydantic import Field, model_validator

from app.missions.spec.base import Latitude, Longitude, Model, Name
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.swath import SwathSonarSpec

Speed = Annotated[float, Field(gt=0, le=5)]


class Sensor(StrEnum):
    """How a vehicle sounds the bottom."""

    SINGLE_BEAM = "single_beam"
    DVL = "dvl"
    MULTIBEAM = "multibeam"


class VehicleKind(StrEnum):
    """Which link reaches a vehicle."""

    IMC = "imc"
    REST = "rest"
    SIM = "sim"
    NEPTUS = "neptus"
    """Commanded by a Neptus console that asks this service where to, through the gateway."""


class Guidance(StrEnum):
    """How a vehicle of kind ``imc`` is led."""

    FOLLOW = "follow"
    LEGS = "legs"
    ACOUSTIC = "acoustic"


class VehicleSpec(Model):
    """A vehicle that takes part in a mission."""

    name: Name = Field(description="Its name; for IMC the name it announces", examples=["lauv-xplore-1"])
    kind: VehicleKind = Field(
        default=VehicleKind.IMC,
        description="imc: DUNE over UDP; rest: polls and posts by itself; sim: simulated inside the service; "
        "neptus: of a session of Neptus' ConvCAO panel, which makes its mission itself",
    )
    sensor: Sensor = Sensor.SINGLE_BEAM
    sonar: SwathSonarSpec | None = Field(
        default=None, description="With sensor multibeam: what that sonar can do; null: its defaults"
    )
    mounting: MountingSpec = Field(
        default_factory=MountingSpec,
        description="How its sonar is mounted, of whichever sensor; corrected later by `mountings` of the mission",
    )
    depth_m: float | None = Field(
        default=None,
        ge=0,
        le=6000,
        description="Depth it travels at where the bottom leaves room; null: the first vehicle of a mission at "
        "limits.min_depth_m, each further one limits.min_vertical_separation_m deeper",
    )
    altitude_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="Height above the bottom that it keeps where the bottom is known, down to limits.max_depth_m and "
        "never less than limits.min_altitude_m; elsewhere it travels at depth_m. null: it keeps its depth",
    )
    speed_mps: Speed | None = Field(default=None, description="Speed asked of it; null: the mission's speed_mps")
    turn_radius_m: float | None = Field(
        default=None,
        gt=0,
        le=200,
        description="Radius of its turning circle, by which plans pay for turns; null: what it flies in 4 s",
    )
    endurance_min: float | None = Field(
        default=None,
        gt=0,
        le=60 * 24 * 365,
        description="How long its energy lasts at its speed, minutes, from the start of the mission; counts where the "
        "vehicle tells no battery level. null: not known",
    )
    recovery_point: tuple[Longitude, Latitude] | None = Field(
        default=None,
        description="Where it is taken out of the water, [longitude, latitude]; null: at the mission's recovery.point",
    )
    guidance: Guidance = Field(
        default=Guidance.FOLLOW,
        description="How a vehicle of kind imc is led. follow: by references, one a second; legs: by a plan for each "
        "whole leg, where radio ends at the surface; acoustic: by legs, and by sound while radio is silent",
    )
    gateway: Name | None = Field(
        default=None, description="With guidance acoustic: the name that the node with the modem announces"
    )
    start: tuple[Longitude, Latitude] | None = Field(
        default=None,
        description="Where a simulated vehicle starts, [longitude, latitude]; default: a corner of the area",
    )
    simulated_mounting: MountingSpec | None = Field(
        default=None,
        description="How the sonar of a simulated vehicle really is mounted, to see what a wrong `mounting` does; "
        "null: as `mounting` says",
    )

    @model_validator(mode="after")
    def _has_the_sonar_that_is_described(self) -> Self:
        if self.sonar is not None and self.sensor is not Sensor.MULTIBEAM:
            raise ValueError(f"sonar is given but sensor is {self.sensor}: only a multibeam is described by it")
        return self

    @property
    def real_mounting(self) -> MountingSpec:
        """How the sonar of a simulated vehicle really is mounted."""
        return self.mounting if self.simulated_mounting is None else self.simulated_mounting

    @model_validator(mode="after")
    def _is_simulated_where_its_mounting_is(self) -> Self:
        if self.simulated_mounting is not None and self.kind is not VehicleKind.SIM:
            raise ValueError(
                f"simulated_mounting is given but kind is {self.kind}: state how a real sonar is mounted in mounting"
            )
        if self.kind is VehicleKind.SIM and self.real_mounting.latency_s < 0.0:
            name = "mounting" if self.simulated_mounting is None else "simulated_mounting"
            raise ValueError(
                f"{name}.latency_s is {self.real_mounting.latency_s:g}: simulated positions are late, never "
                "early; give 0 or more"
            )
        return self

    @model_validator(mode="after")
    def _is_led_as_its_kind_can_be(self) -> Self:
        if self.guidance is not Guidance.FOLLOW and self.kind is not VehicleKind.IMC:
            raise ValueError(
                f"guidance is {self.guidance} but kind is {self.kind}: only vehicles of kind imc have that"
            )
        if (self.guidance is Guidance.ACOUSTIC) != (self.gateway is not None):
            raise ValueError(
                f"guidance is {self.guidance} and gateway is {self.gateway!r}: "
                "a gateway is named with guidance acoustic, and only there"
            )
        return self
