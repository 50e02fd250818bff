"""Makes the file for computers without internet: ``python -m app.deploy --machine aarch64 --out dist``."""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated
from zipfile import ZipFile

import typer

from app.deploy.bundle import MACHINES, BundleError, bundle, machine

PAGE = "app/dashboard/static/index.html"
ROOT = Path(__file__).resolve().parents[2]


def main(
    machines: Annotated[
        list[str] | None,
        typer.Option("--machine", help=f"{' or '.join(MACHINES)}, as often as needed.", show_default="this one"),
    ] = None,
    wheel: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="bathyfleet's wheel.", show_default="built from here"),
    ] = None,
    extras: Annotated[
        list[str] | None, typer.Option("--extra", help="An extra that is put in, such as cluster, as often as needed")
    ] = None,
    packages: Annotated[
        list[str] | None,
        typer.Option("--with", help="A package beside it, such as s3fs, or a wheel's file, as often as needed"),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("dist"),
) -> None:
    """Put bathyfleet and all that it needs into one file for each kind of computer.

    It is for the Python that runs this: 3.12 makes files for 3.12.
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            own = wheel if wheel is not None else _built(Path(folder))
            with ZipFile(own) as archive:
                if PAGE not in archive.namelist():
                    raise BundleError(f"{own.name} has no dashboard: build it without BATHYFLEET_SKIP_DASHBOARD")
            for name in machines or [machine()]:
                path = bundle(
                    own,
                    name,
                    out,
                    command="bathyfleet",
                    check="serve --check",
                    extras=extras or [],
                    packages=packages or [],
                )
                typer.echo(f"{path}: {path.stat().st_size / 2**20:.0f} MiB")
        except BundleError as error:
            typer.echo(f"Error: {error}", err=True)
            raise typer.Exit(1) from None


def _built(folder: Path) -> Path:
    if not (ROOT / "pyproject.toml").is_file():
        raise BundleError("this is no checkout of bathyfleet: name its wheel by --wheel")
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-deps"]
    if subprocess.run([*command, "--wheel-dir", str(folder), str(ROOT)], check=False).returncode:  # noqa: S603
        raise BundleError("bathyfleet's wheel could not be built, see above")
    (built,) = folder.glob("*.whl")
    return built


if __name__ == "__main__":
    typer.run(main)
