"""One file with everything that a computer without internet needs: all wheels, their checksums, a script."""

import hashlib
import io
import platform
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from email.parser import HeaderParser
from pathlib import Path
from zipfile import ZipFile

MACHINES = ("x86_64", "aarch64")
NEWEST_GLIBC = 28
"""Wheels for a newer C library than 2.28 (Debian 10, RHEL 8) are not taken."""
ONLY_SOURCES = ("pyftpdlib",)
"""Dependencies that are published without wheels. What is built of them has to be the same for every computer."""
LIMIT_BYTES = 600 * 2**20
SCRIPT = Path(__file__).with_name("install.sh")


class BundleError(Exception):
    """The file cannot be made."""


@dataclass(frozen=True)
class Wheel:
    """A wheel that is a file."""

    path: Path
    name: str
    version: str
    sha256: str

    @classmethod
    def of(cls, path: Path) -> "Wheel":
        """Read a wheel's name and version from its own metadata. Raises BundleError when it has none."""
        with ZipFile(path) as archive:
            try:
                (metadata,) = (n for n in archive.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", n))
            except ValueError:
                raise BundleError(f"{path} is no wheel: it has no METADATA") from None
            about = HeaderParser().parsestr(archive.read(metadata).decode())
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return cls(path, about["Name"], about["Version"], digest)


def machine() -> str:
    """Return this computer's kind."""
    return platform.machine()


def python_version() -> str:
    """Return the version that runs this; wheels of dependencies are chosen for it."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"


def bundle(
    wheel: Path,
    machine: str,
    folder: Path,
    *,
    command: str,
    check: str = "",
    extras: Sequence[str] = (),
    packages: Sequence[str] = (),
    pip_options: Sequence[str] = (),
) -> Path:
    """Write the file and return its path; the same wheels give the same bytes.

    Parameters
    ----------
    wheel : path
        The program's own.
    machine : str
        One of ``MACHINES``: the computer that it is for.
    folder : path
        Where the file goes.
    command : str
        The program that tells by ``--version`` whether it was installed well.
    check : str
        Its arguments by which it tells whether it can use its settings; empty: it has none.
    extras : sequence of str
        Of the wheel, for example ``cluster``.
    packages : sequence of str
        What is put in beside it: names with or without versions, or files of wheels.
    pip_options : sequence of str
        For pip, for example where else to look for wheels.

    Raises
    ------
    BundleError
        When a dependency has no wheel for that computer, or the file would be too large.
    """
    if machine not in MACHINES:
        raise BundleError(f"machine: {machine!r} is not one of {', '.join(MACHINES)}")
    own = Wheel.of(wheel)
    with tempfile.TemporaryDirectory() as place:
        own_extras = f"[{','.join(extras)}]" if extras else ""
        wanted = [f"{wheel.resolve()}{own_extras}", *packages]
        _download(wanted, machine, Path(place), [*pip_options, *_built(wheel, Path(place), pip_options)])
        wheels = sorted(map(Wheel.of, Path(place).glob("*.whl")), key=lambda w: w.path.name)
        size = sum(w.path.stat().st_size for w in wheels)
        if size > LIMIT_BYTES:
            raise BundleError(f"the wheels have {size / 2**20:.0f} MiB, more than {LIMIT_BYTES / 2**20:.0f}")
        stem = f"{own.name}-{own.version}-python{python_version()}-linux-{machine}"
        target = folder / f"{stem}.tar"
        folder.mkdir(parents=True, exist_ok=True)
        _write(target, stem, own, wheels, {"MACHINE": machine, "COMMAND": command, "CHECK": check})
    return target


def _built(wheel: Path, place: Path, options: Sequence[str]) -> list[str]:
    """Build wheels of what is published as sources only; returns pip's options to find them."""
    with ZipFile(wheel) as archive:
        (metadata,) = (n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        needs = HeaderParser().parsestr(archive.read(metadata).decode()).get_all("Requires-Dist") or []
    named = [need for need in needs if re.split(r"[^A-Za-z0-9._-]", need)[0] in ONLY_SOURCES and "extra ==" not in need]
    if not named:
        return []
    folder = place / "built"
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-deps", *options]
    done = subprocess.run([*command, "--wheel-dir", str(folder), *named], capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        raise BundleError(f"{', '.join(named)} could not be built: {done.stderr.strip()}")
    for path in folder.iterdir():
        if not path.name.endswith("-none-any.whl"):
            raise BundleError(f"{path.name} is for this kind of computer only")
    return ["--find-links", str(folder)]


def _download(wanted: Sequence[str], machine: str, place: Path, options: Sequence[str]) -> None:
    platforms = [f"manylinux_2_{minor}_{machine}" for minor in range(NEWEST_GLIBC, 16, -1)]
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", *options]
    command += ["--only-binary", ":all:", "--dest", str(place), "--implementation", "cp"]
    command += ["--python-version", python_version(), "--abi", f"cp{python_version().replace('.', '')}"]
    for name in (*platforms, f"manylinux2014_{machine}"):
        command += ["--platform", name]
    done = subprocess.run([*command, *wanted, "pip"], capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
        raise BundleError("pip finds no wheels for it: " + " ".join(lines or done.stderr.splitlines()[-3:]))


def _write(target: Path, stem: str, own: Wheel, wheels: Sequence[Wheel], given: Mapping[str, str]) -> None:
    values = {"NAME": own.name, "VERSION": own.version, "PYTHON": python_version(), **given}
    script = re.sub(r"@([A-Z]+)@", lambda match: values[match[1]], SCRIPT.read_text())
    texts = {
        "install.sh": script,
        "requirements.txt": "".join(f"{w.name}=={w.version} --hash=sha256:{w.sha256}\n" for w in wheels),
    }
    sums = {f"wheels/{w.path.name}": w.sha256 for w in wheels}
    sums |= {name: hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items()}
    texts["SHA256SUMS"] = "".join(f"{digest}  {name}\n" for name, digest in sorted(sums.items()))
    hidden = target.with_name(f".{target.name}")
    with tarfile.open(hidden, "w", format=tarfile.PAX_FORMAT) as archive:
        for name, text in sorted(texts.items()):
            member = _member(f"{stem}/{name}", len(text.encode()), 0o755 if name == "install.sh" else 0o644)
            archive.addfile(member, io.BytesIO(text.encode()))
        for one in wheels:
            with one.path.open("rb") as file:
                archive.addfile(_member(f"{stem}/wheels/{one.path.name}", one.path.stat().st_size, 0o644), file)
    hidden.replace(target)


def _member(name: str, size: int, mode: int) -> tarfile.TarInfo:
    """Return an entry that holds nothing of when and by whom it was made."""
    member = tarfile.TarInfo(name)
    member.size, member.mode = size, mode
    return member
