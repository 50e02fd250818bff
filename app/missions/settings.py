"""Settings of the mission service. ``app.settings`` composes them with those of the HTTP edge."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class Section(BaseModel):
    """A section of the settings; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ImcSettings(Section):
    """How this service appears to IMC vehicles. Keep id and port fixed: vehicles remember them until they restart."""

    enabled: bool = Field(default=True, description="Listen for IMC vehicles and speak to them")
    name: str = Field(default="bathyfleet", description="Name under which this service announces itself")
    id: int = Field(default=0x3F01, ge=1, le=0xFFFE, description="Our IMC id, in the range of consoles")
    port: int = Field(default=6101, ge=1, le=65535, description="UDP port on which we receive")
    announce_ports: tuple[int, ...] = Field(
        default=(30100, 30101, 30102, 30103, 30104),
        description="UDP ports to which announces go; the first free one is listened on",
    )
    altimeter: Literal["vertical", "body"] = Field(
        default="vertical",
        description="vertical: the altimeter measures straight down whatever the attitude, as DUNE's simulation does; "
        "body: it is fixed to the hull and leans with it",
    )
    loopback_only: bool = Field(default=False, description="Speak only to vehicles on this machine")
    interfaces: tuple[str, ...] = Field(
        default=(), description="IPv4 addresses of the interfaces to speak on; empty: all, also those that come later"
    )
    transport: Literal["udp", "tcp"] = Field(
        default="udp", description="tcp: by TCP with vehicles that offer it, by UDP with the others"
    )
    position: tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]] | None = Field(
        default=None,
        description="Latitude and longitude that are announced as ours; without them the first vehicle's. "
        "DUNE's simulated radio range counts from there",
    )
    vehicles: tuple[str, ...] = Field(default=(), description="Names of the vehicles to talk to; empty: all")
    rate_limiters: str = Field(
        default="Distance:5, EstimatedState:10",
        description="Rates in Hz asked of every engaged vehicle and taken back at the end; empty: as they are",
    )
    unknown_bottom_depth_m: float = Field(
        default=2.0, ge=0, le=100, description="Deepest reference where no bottom is known"
    )


class SimulationSettings(Section):
    """The sea floor under vehicles of kind ``sim``, which are simulated inside the service."""

    terrain: Path | None = Field(default=None, description="Terrain file; without one a sea floor is generated")
    family: str = Field(default="harbour", description="Kind of the generated sea floor")
    seed: int = Field(default=0, description="Seed of the generated sea floor and of the vehicles' noise")


class ServiceSettings(Section):
    """Everything the mission service needs to know."""

    database_url: str = Field(
        default="sqlite+aiosqlite:///bathyfleet.db",
        description="SQLAlchemy URL: sqlite+aiosqlite:///FILE or postgresql+asyncpg://…",
    )
    time_scale: float = Field(
        default=1.0, gt=0, le=1000, description="How much faster than wall time simulated vehicles live"
    )
    imc: ImcSettings = ImcSettings()
    simulation: SimulationSettings = SimulationSettings()
