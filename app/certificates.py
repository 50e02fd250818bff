"""Certificates: how a service's own one is recognised, and what keeps one from being used."""

import re
import ssl
from datetime import UTC, datetime
from pathlib import Path

CERTIFICATE = re.compile(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)
"""A certificate in a PEM file (RFC 7468)."""
NO_CHECK_TIME = 0x200000
"""OpenSSL's X509_V_FLAG_NO_CHECK_TIME, which the library does not name."""
VERSION = 0xA0
"""Tag of a certificate's version, which the first one had not."""
UTC_TIME = 0x17
"""Tag of a time with two digits for the year, of 1950 to 2049."""


def first_certificate(file: Path) -> str:
    """Return the service's certificate in its file: the first one.

    Those of the authorities that signed it follow, and its private key may be in the same file. Raises ValueError
    where there is none, OSError where it cannot be read.
    """
    return _first(_text(file))


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


def wrong_with_pair(certificate: Path, key: Path | None) -> str:
    """Return what keeps a certificate and its private key from being used; empty for nothing.

    None: the key is in the certificate's file.
    """
    try:
        # Without a password the library would ask for one at the terminal.
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, lambda: "")
    except OSError as error:
        mismatch = getattr(error, "reason", "") == "KEY_VALUES_MISMATCH"
        reason = "the key belongs to another certificate" if mismatch else error.strerror or str(error)
        return f"{reason}; both are PEM files, the key without a password"
    return ""


def wrong_with_authorities(file: Path) -> str:
    """Return what keeps certificates of authorities from being used; empty for nothing."""
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(file)
    except ssl.SSLError:
        return "it holds no certificate (PEM)"
    except OSError as error:
        return error.strerror or str(error)
    return ""


def when_not_valid(file: Path, at: datetime, *, any_will_do: bool = False) -> str:
    """Return in words when the first certificate of a file is valid that is not at a time; empty where all are.

    ``any_will_do``: of authorities one that is valid is enough, since bundles keep old ones.
    """
    found = [_words(*_validity(certificate), at) for certificate in CERTIFICATE.findall(_text(file))]
    wrong = [words for words in found if words]
    return wrong[0] if wrong and (len(wrong) == len(found) or not any_will_do) else ""


def _words(begin: datetime, end: datetime, at: datetime) -> str:
    if at > end:
        return f"is valid until {end:%Y-%m-%d %H:%M} UTC: renew it"
    return "" if at >= begin else f"is valid from {begin:%Y-%m-%d %H:%M} UTC on: is this machine's clock right?"


def _text(file: Path) -> str:
    """Return what a PEM file holds: what stands around certificates is in any encoding."""
    return file.read_text(encoding="ascii", errors="replace")


def _validity(certificate: str) -> tuple[datetime, datetime]:
    """Return from when until when a certificate (PEM) is valid (RFC 5280, section 4.1), which the library keeps."""
    ((_, whole),) = _elements(ssl.PEM_cert_to_DER_cert(certificate))
    fields = [element for element in _elements(_elements(whole)[0][1]) if element[0] != VERSION]
    _serial_number, _algorithm, _issuer, (_, validity) = fields[:4]
    begin, end = _elements(validity)
    return _time(*begin), _time(*end)


def _elements(der: bytes) -> list[tuple[int, bytes]]:
    """Return the tags and contents of what stands one after the other in DER (X.690)."""
    found = []
    while der:
        begin, length = 2, der[1]
        if length & 0x80:
            begin += length & 0x7F
            length = int.from_bytes(der[2:begin])
        found.append((der[0], der[begin : begin + length]))
        der = der[begin + length :]
    return found


def _time(tag: int, written: bytes) -> datetime:
    text = written.decode()
    if tag == UTC_TIME:
        text = ("20" if text < "50" else "19") + text
    return datetime.strptime(text, "%Y%m%d%H%M%SZ").replace(tzinfo=UTC)
