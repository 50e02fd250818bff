"""The file for computers without internet, with small packages in place of the large ones."""

import hashlib
import platform
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from app.deploy import bundle as module
from app.deploy.__main__ import main
from app.deploy.bundle import BundleError, bundle

MACHINE = platform.machine()
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"
PLAIN = "py3-none-any"


def make_wheel(folder: Path, name: str, version: str, tag: str = PLAIN, *, needs: str = "", code: str = "") -> Path:
    path, info = folder / f"{name}-{version}-{tag}.whl", f"{name}-{version}.dist-info"
    metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    with zipfile.ZipFile(path, "w") as wheel:
        wheel.writestr(f"{name}.py", code)
        wheel.writestr(f"{name}-{version}.data/data/lib/systemd/system/{name}.service", "ExecStart=/opt/bathyfleet/x")
        wheel.writestr(f"{info}/METADATA", metadata + (f"Requires-Dist: {needs}\n" if needs else ""))
        wheel.writestr(f"{info}/WHEEL", f"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: {tag}\n")
        wheel.writestr(f"{info}/entry_points.txt", f"[console_scripts]\n{name} = {name}:main\n" if needs else "")
        wheel.writestr(f"{info}/RECORD", "")
    return path


@pytest.fixture
def index(tmp_path: Path) -> Path:
    """Packages to choose from: pip itself, and a dependency for two kinds of computers."""
    folder = tmp_path / "index"
    folder.mkdir()
    for machine in ("x86_64", "aarch64"):
        code = f"def told() -> str:\n    return 'depth on {machine}'\n"
        make_wheel(folder, "sounder", "2.0", f"py3-none-manylinux_2_24_{machine}", code=code)
    make_wheel(folder, "sounder", "3.0", "py3-none-manylinux_2_40_x86_64", code="too new a C library")
    make_wheel(folder, "sounder", "3.0", "py3-none-manylinux_2_40_aarch64", code="too new a C library")
    _pack_pip(folder)
    return folder


def _pack_pip(folder: Path) -> None:
    """Make pip's wheel again from what is installed of it."""
    import pip

    here = Path(pip.__file__).parent
    with zipfile.ZipFile(folder / f"pip-{pip.__version__}-{PLAIN}.whl", "w") as wheel:
        (info,) = here.parent.glob("pip-*.dist-info")
        for path in [*here.rglob("*.py"), *here.rglob("*.pem"), *here.rglob("*.txt"), *info.rglob("*")]:
            if path.is_file() and path.name not in ("RECORD", "INSTALLER", "REQUESTED"):
                wheel.write(path, path.relative_to(here.parent))
        wheel.writestr(f"{info.name}/RECORD", "")


@pytest.fixture
def boat(tmp_path: Path) -> Path:
    code = "import sounder\ndef main() -> None:\n    print('boat 1.0:', sounder.told())\n"
    return make_wheel(tmp_path, "boat", "1.0", needs="sounder>=2", code=code)


def made(boat: Path, index: Path, machine: str = MACHINE, **more: Any) -> Path:
    options = ["--no-index", "--find-links", str(index)]
    return bundle(boat, machine, boat.parent / "dist", command="boat", pip_options=options, **more)


def unpacked(file: Path, folder: Path) -> Path:
    with tarfile.open(file) as archive:
        archive.extractall(folder, filter="data")
    return folder / file.name.removesuffix(".tar")


def install(files: Path, folder: Path, **more: str) -> "subprocess.CompletedProcess[str]":
    variables = {
        "PATH": "/usr/bin:/bin",
        "PYTHON": sys.executable,
        "HOME": str(folder.parent),
        "PIP_INDEX_URL": "http://none.invalid",
    } | more
    return subprocess.run(
        ["sh", files / "install.sh", folder], env=variables, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_it_installs_upgrades_and_keeps_the_version_before(boat: Path, index: Path, tmp_path: Path) -> None:
    file = made(boat, index)
    assert file.name == f"boat-1.0-python{PYTHON}-linux-{MACHINE}.tar"
    files, folder = unpacked(file, tmp_path / "stick"), tmp_path / "opt" / "boat"
    first = install(files, folder)
    assert (first.returncode, first.stderr) == (0, "")
    told = subprocess.run([folder / "bin" / "boat"], capture_output=True, text=True, check=True).stdout
    assert told == f"boat 1.0: depth on {MACHINE}\n"
    assert (folder / "lib/systemd/system/boat.service").read_text() == f"ExecStart={folder}/x"
    second = install(files, folder)
    assert second.stdout == f"boat 1.0 is in {folder}, the version before in {folder}.old\n"
    subprocess.run([folder / "bin" / "boat"], check=True)


NEEDS = 'sounder>=2\nProvides-Extra: deck\nRequires-Dist: sail; extra == "deck"'
THAT_HAS_SETTINGS = """
import os, pathlib, sys
def main() -> None:
    if sys.argv[1:] == ["serve", "--check"]:
        import sail
        sys.exit(pathlib.Path("boat.toml").read_text() + os.environ.get("BOAT_SAILS", ""))
"""


@pytest.mark.slow
def test_an_upgrade_that_lacks_what_was_put_in_is_refused(index: Path, tmp_path: Path) -> None:
    boat = make_wheel(tmp_path, "boat", "1.0", needs=NEEDS, code="def main() -> None: ...")
    make_wheel(index, "sail", "1.0", needs="rope")
    make_wheel(index, "anchor", "4.0")
    make_wheel(index, "rope", "1.0")
    folder = tmp_path / "opt" / "boat"
    full = unpacked(made(boat, index, extras=["deck"], packages=["anchor"]), tmp_path / "full")
    assert install(full, folder).returncode == 0
    assert {path.name.partition("-")[0] for path in (full / "wheels").iterdir()} == {
        *("boat", "sounder", "sail", "rope", "anchor", "pip")
    }
    bare = unpacked(made(boat, index), tmp_path / "bare")
    refused = install(bare, folder)
    assert refused.returncode == 1
    assert f"{folder} has packages that these files lack: anchor rope sail. Nothing was changed" in refused.stderr
    subprocess.run([folder / "bin" / "python", "-c", "import anchor, sail"], check=True)
    assert not folder.with_name("boat.old").exists()
    assert install(full, folder).returncode == 0
    left_out = install(bare, folder, WITHOUT="anchor rope sail")
    assert left_out.returncode == 0, left_out.stderr


@pytest.mark.slow
def test_what_a_version_no_longer_needs_itself_is_not_missed(boat: Path, index: Path, tmp_path: Path) -> None:
    folder = tmp_path / "opt" / "boat"
    assert install(unpacked(made(boat, index), tmp_path / "one"), folder).returncode == 0
    light = make_wheel(tmp_path, "boat", "2.0", needs="pip", code="def main() -> None: ...")
    done = install(unpacked(made(light, index), tmp_path / "two"), folder)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_an_upgrade_that_cannot_use_the_settings_is_refused(boat: Path, index: Path, tmp_path: Path) -> None:
    folder, state, defaults = tmp_path / "opt" / "boat", tmp_path / "state", tmp_path / "defaults"
    assert install(unpacked(made(boat, index), tmp_path / "one"), folder).returncode == 0
    state.mkdir()
    (state / "boat.toml").write_text("no sail; ")
    defaults.write_text('# of the service\nBOAT_SAILS=["main", "jib"]\n')
    make_wheel(index, "sail", "1.0")
    newer = make_wheel(tmp_path, "boat", "2.0", needs=NEEDS, code=THAT_HAS_SETTINGS)
    files = unpacked(made(newer, index, check="serve --check", extras=["deck"]), tmp_path / "two")
    refused = install(files, folder, STATE=str(state), DEFAULTS=str(defaults))
    assert refused.returncode == 1
    assert 'no sail; ["main", "jib"]' in refused.stderr
    assert "the new version cannot use the settings, see above. Nothing was changed" in refused.stderr
    told = subprocess.run([folder / "bin" / "boat"], capture_output=True, text=True, check=True).stdout
    assert told == f"boat 1.0: depth on {MACHINE}\n"


@pytest.mark.parametrize("victim", ["wheels/sounder-2.0", "requirements.txt", "install.sh"])
def test_a_damaged_file_is_not_installed(boat: Path, index: Path, tmp_path: Path, victim: str) -> None:
    files, folder = unpacked(made(boat, index), tmp_path / "stick"), tmp_path / "boat"
    (path,) = (path for path in files.rglob("*") if str(path.relative_to(files)).startswith(victim))
    path.write_bytes(path.read_bytes() + b"\n# x")
    done = install(files, folder)
    assert done.returncode == 1
    assert "a file is damaged or missing: copy the whole file again" in done.stderr
    assert not folder.exists()


@pytest.mark.slow
def test_a_wheel_that_was_added_is_not_taken(boat: Path, index: Path, tmp_path: Path) -> None:
    files, folder = unpacked(made(boat, index), tmp_path / "stick"), tmp_path / "boat"
    make_wheel(files / "wheels", "sounder", "2.0", PLAIN, code="def told() -> str:\n    return 'a lie'\n")
    if install(files, folder).returncode == 0:
        told = subprocess.run([folder / "bin" / "boat"], capture_output=True, text=True, check=True).stdout
        assert "a lie" not in told


def test_another_kind_of_computer_gets_its_own_wheels_and_refuses_others(
    boat: Path, index: Path, tmp_path: Path
) -> None:
    (other,) = {"x86_64", "aarch64"} - {MACHINE}
    files = unpacked(made(boat, index, other), tmp_path / "stick")
    assert [path.name for path in files.glob("wheels/sounder*")] == [f"sounder-2.0-py3-none-manylinux_2_24_{other}.whl"]
    done = install(files, tmp_path / "boat")
    assert done.returncode == 1
    assert f"these files are for Linux on {other}, this is Linux on {MACHINE}" in done.stderr


def test_the_same_wheels_give_the_same_file(boat: Path, index: Path) -> None:
    digests = {hashlib.sha256(made(boat, index).read_bytes()).hexdigest() for _ in range(2)}
    assert len(digests) == 1


def test_a_wheel_without_the_dashboard_is_refused(boat: Path, tmp_path: Path) -> None:
    command = typer.Typer()
    command.command()(main)
    said = CliRunner().invoke(command, ["--wheel", str(boat), "--out", str(tmp_path / "dist")])
    assert (said.exit_code, "boat-1.0-py3-none-any.whl has no dashboard" in said.output) == (1, True)
    assert not (tmp_path / "dist").exists()


def test_what_cannot_be_put_in_is_said(
    boat: Path, index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BundleError, match="'riscv64' is not one of x86_64, aarch64"):
        made(boat, index, "riscv64")
    needy = make_wheel(tmp_path, "needy", "1.0", needs="oarlock", code="")
    with pytest.raises(BundleError, match="oarlock"):
        made(needy, index)
    monkeypatch.setattr(module, "LIMIT_BYTES", 1000)
    with pytest.raises(BundleError, match="more than 0"):
        made(boat, index)
    empty = tmp_path / "empty-1.0-py3-none-any.whl"
    with zipfile.ZipFile(empty, "w"):
        pass
    with pytest.raises(BundleError, match="is no wheel"):
        made(empty, index)
