"""Settings of the mission service. ``app.settings`` composes them with those of the HTTP edge."""

import ipaddress
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from app.compute.settings import ComputeSettings
from app.missions.alarm_settings import AlarmSettings
from app.optional_file import OptionalFile
from imc_bridge.settings import Address, ConsoleSettings

if TYPE_CHECKING:
    from app.mapping.products.crowdsourced import Provider


Current = Annotated[float, Field(ge=-10, le=10)]


class SettingsSection(BaseModel):
    """A section of the settings; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ImcSettings(ConsoleSettings):
    """How this service appears to IMC vehicles: what the bridge lets be set."""

    enabled: bool = Field(default=True, description="Listen for IMC vehicles and speak to them")


class NeptusSettings(SettingsSection):
    """The gateway for Neptus' ConvCAO panel. Area and depths have to be the same as in the panel's own settings."""

    enabled: bool = Field(default=False, description="Answer Neptus' ConvCAO panel in place of the original service")
    host: str = Field(default="127.0.0.1", description="Address on which the panel is answered")
    ftp_port: int = Field(default=21, ge=0, le=65535, description="TCP port for its uploads; the panel uses 21")
    http_port: int = Field(default=80, ge=0, le=65535, description="TCP port for its polls; the panel uses 80")
    passive_ports: tuple[int, ...] = Field(
        default=(), description="First and last TCP port of FTP data connections; empty: any"
    )
    public_address: Address | None = Field(
        default=None, description="IPv4 address told for FTP data connections where a router stands between"
    )
    centre_lat_deg: float | None = Field(default=None, ge=-90, le=90, description="Area Center, latitude")
    centre_lon_deg: float | None = Field(default=None, ge=-180, le=180, description="Area Center, longitude")
    rows: int = Field(default=240, ge=4, le=2000, description="Number of Rows")
    cols: int = Field(default=240, ge=4, le=2000, description="Number of Columns")
    cell_m: float = Field(default=1.0, gt=0, le=100, description="Cell size")
    max_depth_m: float = Field(default=50.0, gt=0, le=6000, description="Maximum Depth, from which heights are counted")
    first_depth_m: float = Field(default=1.5, ge=0, le=1000, description="First Depth, of the first vehicle")
    depth_separation_m: float = Field(default=1.5, gt=0, le=100, description="Depth separation between vehicles")
    bathymeter: Literal["twice", "once", "off"] = Field(
        default="twice",
        description="Bathymeter figures, which samples are held against and which count where a vehicle has none; "
        "twice: the vehicle's depth was subtracted twice, as the unmodified panel does; once: by a corrected panel; "
        "off: not used",
    )
    samples: Literal["checked", "off"] = Field(
        default="checked",
        description="The panel's samples, one for every range of every sensor; checked: those that agree with the "
        "nearest vehicle's Bathymeter are used; off: none, for vehicles without a DVL",
    )
    prior_map: Literal["ignore", "depth", "height"] = Field(
        default="ignore",
        description="The sparse map that the panel sends with a session: ignore: not used; depth: taken in as depths; "
        "height: as heights above max_depth_m",
    )
    prior_map_sd_m: float = Field(default=1.0, gt=0, le=100, description="Standard deviation of the sparse map")
    planner: str = Field(default="cao", description="Planner of the sessions' missions")
    steps: int = Field(default=500, ge=1, le=100_000, description="Steps of a session's mission")
    max_step_m: float = Field(default=20.0, gt=0, le=2000, description="Largest distance of one step")
    min_altitude_m: float = Field(default=2.0, ge=0, le=1000, description="Least clearance above the sea floor")
    border_m: float = Field(
        default=12.5,
        ge=0,
        le=1000,
        description="Waypoints stay this far inside the area, at most a quarter of its side: the panel takes a vehicle "
        "for arrived from 12.5 m on, and moves what is beyond the border onto it",
    )
    repeat_after_s: float = Field(
        default=5.0,
        gt=0,
        le=3600,
        description="A panel that polls this long for the answer to an upload that was lost or refused is told to stay",
    )
    lost_after_s: float = Field(
        default=300.0, gt=0, le=86_400, description="A panel that was silent for this long is not waited for"
    )

    @field_validator("planner")
    @classmethod
    def _is_a_planner(cls, planner: str) -> str:
        from app.exploration.planners import COVERERS, PLANNERS, missing  # they take a second, and few set it

        if planner not in PLANNERS:
            what = "it is for swath sonars" if planner in COVERERS else missing(planner)
            raise ValueError(f"{what}; use one of {', '.join(sorted(PLANNERS))}")
        return planner

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> Self:
        if self.enabled and (self.centre_lat_deg is None or self.centre_lon_deg is None):
            raise ValueError(
                "the gateway needs centre_lat_deg and centre_lon_deg: the Area Center of conf/noptcoords.properties"
            )
        ports = self.passive_ports
        if ports and not (len(ports) == 2 and 0 < ports[0] <= ports[1] <= 65535):
            raise ValueError(f"passive_ports {list(ports)} must be a first and a last port, 1 to 65535, or empty")
        if self.ftp_port == self.http_port != 0:
            raise ValueError(f"ftp_port and http_port are both {self.ftp_port}: each needs a port of its own")
        if self.first_depth_m > self.max_depth_m:
            raise ValueError(f"first_depth_m {self.first_depth_m:g} is below max_depth_m {self.max_depth_m:g}")
        return self


class SimulationSettings(SettingsSection):
    """The sea floor under vehicles of kind ``sim``, which are simulated inside the service."""

    terrain: OptionalFile = Field(default=None, description="Terrain file; without one a sea floor is generated")
    family: str = Field(default="harbour", description="Kind of the generated sea floor")
    seed: int = Field(default=0, ge=0, description="Seed of the generated sea floor and of the vehicles' noise")
    drift_m2ps: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="Growth of the variance of a submerged vehicle's position, m2/s; LAUVs report 0.02; 0: none",
    )
    current_mps: tuple[Current, Current] = Field(
        default=(0.0, 0.0), description="Velocity of the water over ground, [east, north], m/s"
    )
    sound_speed: tuple[tuple[float, float], ...] = Field(
        default=(),
        description="Sound speed over depth, [[m, m/s], ...], linear between; vehicles then have a probe. Empty: "
        "1500 m/s, as sonars assume",
    )
    consumption_factor: float = Field(
        default=1.0, gt=0, le=10, description="How much more energy vehicles use than their endurance says"
    )

    @field_validator("sound_speed")
    @classmethod
    def _is_a_water_column(cls, entries: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if entries:
            from simulator.water_column import WaterColumn  # as for families

            WaterColumn.of(entries)
        return entries

    @field_validator("family")
    @classmethod
    def _is_a_family(cls, family: str) -> str:
        from simulator.floors.seafloors import FAMILIES  # few set it, and settings are read without the mathematics

        if family not in FAMILIES:
            raise ValueError(f"use one of {', '.join(sorted(FAMILIES))}")
        return family


class AisSettings(SettingsSection):
    """Ships about, by AIS. Without udp_port, tcp_host and file nothing is listened for."""

    udp_address: str = Field(
        default="0.0.0.0",  # noqa: S104 - receivers on the ship's network send there
        description="Address on which sentences are taken; a group's address (as in IEC 61162-450) is joined",
    )
    udp_port: int | None = Field(
        default=None, ge=0, le=65535, description="UDP port that a receiver sends NMEA sentences to, often 10110"
    )
    tcp_host: str = Field(default="", max_length=253, description="Server that sends NMEA sentences; empty: none")
    tcp_port: int = Field(default=10110, ge=1, le=65535, description="Its TCP port")
    file: OptionalFile = Field(
        default=None,
        description="File that a receiver's program adds NMEA sentences to, or a serial device that is set up",
    )
    max_age_s: float = Field(
        default=600.0, ge=10, le=86_400, description="A ship that is silent for so long is forgotten"
    )
    own_mmsi: tuple[int, ...] = Field(
        default=(), max_length=100, description="Ships of the operation itself: shown, and no cause for an alarm"
    )
    cpa_m: float = Field(
        default=200.0, gt=0, le=20_000, description="Alarm where a ship's hull comes closer to a vehicle than this"
    )
    cpa_s: float = Field(default=300.0, gt=0, le=7200, description="Alarm so long before it does")
    near_surface_m: float = Field(
        default=5.0,
        ge=0,
        le=100,
        description="Vehicles that are deeper are out of ships' way; of a ship that tells its draught, 2 m more than "
        "that where it is deeper",
    )
    hold_s: float = Field(
        default=900.0,
        gt=0,
        le=86_400,
        description="Where missions hold vehicles below because of ships: no longer than this, vehicles' time",
    )

    @field_validator("udp_address")
    @classmethod
    def _is_an_address(cls, address: str) -> str:
        try:
            ipaddress.ip_address(address)
        except ValueError:
            raise ValueError(f"{address!r} is no IP address, such as 0.0.0.0 or 239.192.0.4") from None
        return address


class ProviderSettings(SettingsSection):
    """Who hands soundings in as crowdsourced bathymetry (IHO B-12)."""

    organization: str = Field(default="", max_length=200, description="Name of the organization; B-12 asks for it")
    email: str = Field(
        default="",
        max_length=200,
        pattern=r"^([A-Za-z0-9._%+-]+@[A-Za-z0-9.-]+\.[A-Za-z]{2,6})?$",
        description="E-mail address where users of the data can ask; B-12 asks for it",
    )
    node: str = Field(
        default="BATHYFLEET",
        pattern=r"^[a-zA-Z][a-zA-Z0-9]{0,63}$",
        description="Prefix of the vehicles' identities, given by the data centre (DCDB): letters and digits",
    )
    license: str = Field(default="CC0 1.0", max_length=200, description="Under what the soundings are given")

    def named(self) -> "Provider | None":
        """Return the provider; None while organization or e-mail address is missing."""
        from app.mapping.products.crowdsourced import Provider  # settings are read without the mathematics

        if not (self.organization and self.email):
            return None
        return Provider(self.organization, self.email, self.node, self.license)


Question = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\r\n]*\S[^\r\n]*$")]


class ServiceSettings(SettingsSection):
    """Everything the mission service needs to know."""

    database_url: str = Field(
        default="sqlite+aiosqlite:///bathyfleet.db",
        description="SQLAlchemy URL: sqlite+aiosqlite:///FILE or postgresql+asyncpg://USER:PASSWORD@HOST/NAME",
    )
    pings_url: str = Field(
        default="",
        description="Where files of swath sonars' pings are kept: a folder, or a URL of fsspec such as "
        "s3://bucket/pings; empty: the folder pings beside SQLite's file, with PostgreSQL in the working directory",
    )
    time_scale: float = Field(
        default=1.0, gt=0, le=1000, description="How much faster than wall time simulated vehicles live"
    )
    unconfined_imports: bool = Field(
        default=False,
        description="Read imported files also where the kernel has neither Landlock nor seccomp, which keep them from "
        "reading other files",
    )
    checklist: tuple[Question, ...] = Field(
        default=(),
        max_length=40,
        description="What somebody has to have looked at before each start, for example Hatches closed: the page asks "
        "for it, and the mission's log keeps who confirmed it",
    )
    imc: ImcSettings = Field(default=ImcSettings(), description="The link to IMC vehicles")
    neptus: NeptusSettings = Field(default=NeptusSettings(), description="The gateway for Neptus' ConvCAO panel")
    ais: AisSettings = Field(default=AisSettings(), description="Ships about, by AIS")
    simulation: SimulationSettings = Field(
        default=SimulationSettings(), description="The world of vehicles of kind sim"
    )
    compute: ComputeSettings = Field(default=ComputeSettings(), description="Where heavy work is done")
    provider: ProviderSettings = Field(
        default=ProviderSettings(), description="Who hands soundings in as crowdsourced bathymetry"
    )
    alarms: AlarmSettings = Field(default=AlarmSettings(), description="Who is told of alarms, and by which way")

    @field_validator("checklist")
    @classmethod
    def _asks_nothing_twice(cls, checklist: tuple[str, ...]) -> tuple[str, ...]:
        twice = sorted({question for question in checklist if checklist.count(question) > 1})
        if twice:
            raise ValueError(f"{twice[0]!r} is asked twice: leave one of them out")
        return checklist
