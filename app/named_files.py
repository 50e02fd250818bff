"""Files that the settings name: whether they can be used."""

from collections.abc import Iterator
from datetime import UTC, datetime

from app.certificates import when_not_valid, wrong_with_authorities, wrong_with_pair
from app.settings import Settings


def unusable_certificate(settings: Settings) -> str:
    """Return what keeps the service from serving HTTPS as it is set up; empty for nothing."""
    certificate, key = settings.tls_certificate, settings.tls_key
    if certificate is None:
        return ""
    wrong = wrong_with_pair(certificate, key)
    where = f"and tls_key {key}" if key is not None else "(where the key has to be, too)"
    return f"tls_certificate {certificate} {where} cannot be used: {wrong}" if wrong else ""


def unusable_files(settings: Settings) -> Iterator[str]:
    """Yield a line for each file that cannot be used: one that keeps the service from starting, or is needed later."""
    if wrong := unusable_certificate(settings):
        yield wrong
    compute = settings.compute
    if compute.tls_ca_file is not None and (wrong := wrong_with_authorities(compute.tls_ca_file)):
        yield f"compute.tls_ca_file {compute.tls_ca_file} cannot be used: {wrong}"
    if compute.tls_certificate is not None and (wrong := wrong_with_pair(compute.tls_certificate, compute.tls_key)):
        yield f"compute.tls_certificate {compute.tls_certificate} and tls_key {compute.tls_key} cannot be used: {wrong}"
    if settings.simulation.terrain is not None:
        from simulator.floors.terrain import TerrainError
        from simulator.floors.terrain_files import load_terrain

        try:
            load_terrain(settings.simulation.terrain)
        except TerrainError as error:
            yield f"simulation.terrain: {error}"


def certificates_out_of_time(settings: Settings) -> Iterator[str]:
    """Yield a line for each file, of those that can be used, with a certificate that is not valid now."""
    at = datetime.now(UTC)
    own = {"tls_certificate": settings.tls_certificate, "compute.tls_certificate": settings.compute.tls_certificate}
    authorities = {"alarms.ca_file": settings.alarms.ca_file, "compute.tls_ca_file": settings.compute.tls_ca_file}
    for name, file in (own | authorities).items():
        if file is not None and (when := when_not_valid(file, at, any_will_do=name in authorities)):
            yield f"{name} {file} {when}"
