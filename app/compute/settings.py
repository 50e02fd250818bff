"""What can be set about the cluster; ``app.missions.settings`` composes it."""

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.optional_file import OptionalFile


class ComputeSettings(BaseModel):
    """Where heavy work is done. Without a scheduler: on this machine."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scheduler: str = Field(
        default="",
        pattern=r"^$|^(tcp|tls)://(\[[0-9a-fA-F:.]+\]|[^\s/:@\[\]]+):[0-9]{1,5}$",
        description="Dask scheduler whose workers do heavy work, tcp://HOST:PORT or tls://HOST:PORT; empty: this "
        "machine does",
    )
    timeout_s: float = Field(
        default=600.0,
        ge=10,
        le=86_400,
        description="What the cluster has not done after so long is done on this machine",
    )
    map_pause_s: float = Field(
        default=0.2,
        ge=0,
        le=600,
        description="How long no map of a running mission is begun after one; never shorter than that one took",
    )
    tls_ca_file: OptionalFile = Field(
        default=None, description="File with the certificate (PEM) of the authority that the cluster's are signed by"
    )
    tls_certificate: OptionalFile = Field(
        default=None, description="File with the certificate (PEM) that this service shows the cluster"
    )
    tls_key: OptionalFile = Field(default=None, description="File with its private key (PEM)")

    @model_validator(mode="after")
    def _encrypts_as_the_address_says(self) -> Self:
        files = {
            "tls_ca_file": self.tls_ca_file,
            "tls_certificate": self.tls_certificate,
            "tls_key": self.tls_key,
        }
        missing = [name for name, file in files.items() if file is None]
        if self.encrypted and missing:
            raise ValueError(f"a scheduler at tls:// needs {', '.join(missing)}, too")
        if not self.encrypted and len(missing) < len(files):
            raise ValueError("the certificate is for a scheduler at tls://HOST:PORT; set compute.scheduler to one")
        return self

    @property
    def encrypted(self) -> bool:
        """Whether what goes to the cluster and comes back is encrypted, and both sides show who they are."""
        return self.scheduler.startswith("tls://")
