"""Certificates: how a service's own one is recognised."""

import re
import ssl
from pathlib import Path

CERTIFICATE = re.compile(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)
"""A certificate in a PEM file (RFC 7468)."""
NO_CHECK_TIME = 0x200000
"""OpenSSL's X509_V_FLAG_NO_CHECK_TIME, which the library does not name."""


def first_certificate(file: Path) -> str:
    """Return the service's certificate in its file: the first one.

    Those of the authorities that signed it follow, and its private key may be in the same file. Raises ValueError
    where there is none, OSError where it cannot be read.
    """
    return _first(file.read_text())


def trusting(certificate: str) -> ssl.SSLContext:
    """Return what trusts this very certificate (PEM) and no other, none of those that follow it either.

    Whoever shows it has its key, so its name, its authority and its time say nothing more: vehicles have to be stopped
    on the day after it has expired, too. Raises SSLError, or ValueError, for what is no certificate.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    # The certificate itself is trusted, not only who signed it.
    context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN | NO_CHECK_TIME
    context.load_verify_locations(cadata=_first(certificate))
    return context


def _first(certificates: str) -> str:
    found = CERTIFICATE.search(certificates)
    if found is None:
        raise ValueError("it holds no certificate (PEM)")
    return f"{found[0]}\n"
