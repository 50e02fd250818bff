"""Certificates as the authority of an institute signs them for its own machines."""

import subprocess
from pathlib import Path


class Authority:
    """Who signs; ``file`` holds its own certificate."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        (folder / "index.txt").touch()
        (folder / "ca.cnf").write_text(
            f"[ca]\ndefault_ca=own\n[own]\ndatabase={folder}/index.txt\nnew_certs_dir={folder}\nrand_serial=yes\n"
            "default_md=sha256\npolicy=any\nunique_subject=no\nx509_extensions=names\n[any]\ncommonName=supplied\n"
            "[names]\nsubjectAltName=DNS:localhost,IP:127.0.0.1\n"
        )
        self.file = folder / "ca.pem"
        self._openssl("req", "-x509", *self._new("ca"), "-out", self.file, "-days", "2")

    def sign(self, name: str, *, until: str = "20981231000000Z") -> tuple[Path, Path]:
        """Return a file with a certificate for this machine and its authority's, and its key."""
        request, signed, chain = (self._folder / f"{name}.{kind}" for kind in ("csr", "crt", "pem"))
        self._openssl("req", *self._new(name), "-out", request)
        of = ("-config", self._folder / "ca.cnf", "-cert", self.file, "-keyfile", self._folder / "ca.key")
        dates = ("-startdate", "20200101000000Z", "-enddate", until)
        self._openssl("ca", "-batch", "-notext", *of, "-in", request, "-out", signed, *dates)
        chain.write_text(signed.read_text() + self.file.read_text())
        return chain, self._folder / f"{name}.key"

    def _new(self, name: str) -> tuple[object, ...]:
        key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-keyout", self._folder / f"{name}.key")
        return (*key, "-nodes", "-subj", f"/CN={name}")

    def _openssl(self, *words: object) -> None:
        subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True)
