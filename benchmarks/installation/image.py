"""Builds the image without a container engine and runs it: ``python -m benchmarks.installation.image``.

The steps of the Dockerfile are carried out one by one in root file systems made of Debian's packages, which stand in
for the image of Python: its version is Debian's. Then the service runs as the compose file has it (no rights, nothing
writable but its volume and /tmp, no network), as process 1; the health check is asked, the page is fetched, a token is
made, and SIGTERM ends it. Printed is one line for each step. Exit code 1 when one fails.

Needs root, mmdebstrap, and the registries of Debian, Python and npm. Where these are reached through settings of this
machine, name them: ``--bind FILE`` for what programs read, ``--pass NAME`` for variables.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import yaml

from benchmarks.installation.dockerfile import Stage, context_of, options_of, stages_of, variables_of, words_of
from benchmarks.installation.rooted import NEEDS, Root, base, missing, serving
from benchmarks.installation.steps import Step, StepError

PROJECT = Path(__file__).resolve().parents[2]
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
PATIENCE_S = 600.0
SHOWS_THE_PAGE = """
import sys, urllib.request
answer = urllib.request.urlopen("http://127.0.0.1:8080/", timeout=20)
text = answer.read().decode()
assert answer.status == 200 and "<script" in text, text[:500]
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bind", type=Path, action="append", default=[Path("/etc/resolv.conf")])
    parser.add_argument("--pass", dest="names", action="append", default=[])
    parser.add_argument("--base", type=Path, help="a root that was made before, in place of a new one")
    options = parser.parse_args(arguments)
    if lacking := missing(*NEEDS):
        print(f"this machine lacks: {', '.join(lacking)}", file=sys.stderr)
        return 2
    passed = {name: os.environ[name] for name in options.names if name in os.environ}
    with tempfile.TemporaryDirectory(prefix="bathyfleet-image-") as folder:
        try:
            made = Image(Path(folder), passed, options.bind, options.base).build()
            run_it(*made)
        except StepError as error:
            print(f"failed: {error}", file=sys.stderr)
            return 1
    return 0


class Image:
    """The image that a Dockerfile describes, in the making."""

    def __init__(self, folder: Path, passed: dict[str, str], binds: Sequence[Path], ready: Path | None) -> None:
        self._folder = folder
        self._passed = passed
        self._binds = binds
        self._base = ready
        self._roots: dict[str, Root] = {}
        self.user = "root"
        self.directory = "/"
        self.said: dict[str, str] = {}

    def build(self) -> tuple[Root, "Image"]:
        """Carry out every step; returns the last stage's root. Raises StepError."""
        stages = stages_of((PROJECT / "Dockerfile").read_text())
        if self._base is None:
            self._base = self._folder / "base"
            with Step("a root of Debian's packages"):
                base(self._base, stages[-1].debian)
        for stage in stages:
            self._stage(stage)
        return self._roots[stage.name], self

    def _stage(self, stage: Stage) -> None:
        assert self._base is not None  # noqa: S101 - it was made before
        with Step(f"FROM {stage.image}"):
            folder = self._folder / stage.name
            subprocess.run(["cp", "--archive", "--reflink=auto", str(self._base), str(folder)], check=True)
        root = self._roots[stage.name] = Root(folder, {"PATH": PATH, "HOME": "/root"})
        self.user, self.directory, self.said = "root", "/", {}
        for word, value in stage.instructions:
            with Step(f"{word} {value}"):
                match word:
                    case "ENV" | "ARG":  # with the value that it has where the build is told none
                        root.variables |= variables_of(value, root.variables)
                    case "WORKDIR":
                        self.directory = value
                        (root.folder / value.lstrip("/")).mkdir(parents=True, exist_ok=True)
                    case "USER":
                        self.user = value
                    case "COPY":
                        self._copy(root, value)
                    case "RUN":
                        self._run(root, value)
                    case _:
                        self.said[word] = value

    def _copy(self, root: Root, value: str) -> None:
        options, rest = options_of(value)
        source, target = rest.split()
        to = root.folder / (target if target.startswith("/") else f"{self.directory}/{target}").lstrip("/")
        if chosen := dict(options).get("from"):
            place = self._roots[chosen].folder / source.lstrip("/")
            subprocess.run(["cp", "--archive", str(place), str(to)], check=True)
            return
        for name in context_of(PROJECT):
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(PROJECT / name, to / name)

    def _run(self, root: Root, value: str) -> None:
        _, line = options_of(value)  # caches are empty
        there = Root(root.folder, root.variables | self._passed, self._binds)
        done = there.run(["sh", "-c", line], user=self.user, directory=self.directory)
        if done.returncode:
            raise StepError(f"exit code {done.returncode}\n{(done.stdout + done.stderr)[-4000:]}")


def run_it(root: Root, image: Image) -> None:
    """Run the service as the compose file has it. Raises StepError."""
    compose = yaml.safe_load((PROJECT / "compose.yaml").read_text())["services"]["bathyfleet"]
    root.variables |= {"HOME": f"/{image.directory.lstrip('/')}", "BATHYFLEET_HOST": "127.0.0.1"}
    root.variables |= {"BATHYFLEET_AUTO_MIGRATE": compose["environment"]["BATHYFLEET_AUTO_MIGRATE"]}
    volume = root.folder.with_name("volume")
    # A new volume is as the image has its folder.
    subprocess.run(["cp", "--archive", f"{root.folder}{image.said['VOLUME']}", str(volume)], check=True)
    sealed = ["mount -o remount,bind,ro $root", *(f"mount -t tmpfs tmpfs $root{place}" for place in compose["tmpfs"])]
    sealed.append(f"mount --bind {volume} $root{image.said['VOLUME']}")
    entry, words = words_of(image.said["ENTRYPOINT"]), words_of(image.said["CMD"])

    def command(*words: str) -> list[str]:
        return root.command(
            [*entry, *words], user=image.user, directory=image.directory, mounts=sealed, offline=True, unprivileged=True
        )

    log = root.folder.with_name("log")
    check = words_of(image.said["HEALTHCHECK"].partition("CMD ")[2])
    with serving(command(*words), log) as service:
        with Step(f"{' '.join([*entry, *words])}, until its health check passes"):
            end = time.monotonic() + PATIENCE_S
            while (asked := service.beside(check, root.variables)).returncode:
                if service.process.poll() is not None or time.monotonic() > end:
                    raise StepError(f"{asked.stderr[-500:]}\n{log.read_text()[-4000:]}")
                time.sleep(1.0)
        for what, asked_for in {
            "the page is there": ["python", "-c", SHOWS_THE_PAGE],
            "the first start made a token": ["cat", "operator.token"],
        }.items():
            _check(what, service.beside, asked_for, root.variables)
        with Step("SIGTERM ends it well"):
            grace_s = float(compose["stop_grace_period"].rstrip("s"))
            if code := service.end(grace_s):
                raise StepError(f"exit code {code}\n{log.read_text()[-4000:]}")
    for line in (["--version"], ["token", "create", "laptop"], ["backup"]):
        _check(" ".join([*entry, *line]), _kept, command(*line))


def _kept(command: Sequence[str]) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command, capture_output=True, text=True, check=False)


def _check(what: str, do: Callable[..., "subprocess.CompletedProcess[str]"], *arguments: object) -> None:
    with Step(what):
        done = do(*arguments)
        if done.returncode:
            raise StepError(f"exit code {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}")


if __name__ == "__main__":
    sys.exit(main())
