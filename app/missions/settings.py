"""Settings of the mission service. ``app.settings`` composes them with those of the HTTP edge."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    from app.mapping.products.crowdsourced import Provider


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


class SimulationSettings(Section):
    """The sea floor under vehicles of kind ``sim``, which are simulated inside the service."""

    terrain: Path | None = Field(default=None, description="Terrain file; without one a sea floor is generated")
    family: str = Field(default="harbour", description="Kind of the generated sea floor")
    seed: int = Field(default=0, description="Seed of the generated sea floor and of the vehicles' noise")


class ProviderSettings(Section):
    """Who hands soundings in as crowdsourced bathymetry (IHO B-12)."""

    organization: str = Field(default="", max_length=200, description="Name of the organization; B-12 asks for it")
    email: str = Field(
        default="",
        max_length=200,
        pattern=r"^([A-Za-z0-9._%+-]+@[A-Za-z0-9.-]+\.[A-Za-z]{2,6})?$",
        description="Where users of the data can ask; B-12 asks for it",
    )
    node: str = Field(
        default="BATHYFLEET",
        pattern=r"^[a-zA-Z][a-zA-Z0-9]{0,63}$",
        description="Prefix of the vehicles' identities, given by the data centre (DCDB)",
    )
    license: str = Field(default="CC0 1.0", max_length=200, description="Under what the soundings are given")

    def named(self) -> "Provider | None":
        """Return the provider; None while organization or e-mail address is missing."""
        from app.mapping.products.crowdsourced import Provider  # settings are read without the mathematics

        if not (self.organization and self.email):
            return None
        return Provider(self.organization, self.email, self.node, self.license)


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
    provider: ProviderSettings = ProviderSettings()
