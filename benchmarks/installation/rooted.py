"""Programs in another root file system, with processes, mounts and, where asked, a network of their own."""

import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

PACKAGES = ("ca-certificates", "python3", "python3-venv")
NEEDS = ("unshare", "chroot", "setpriv", "ip", "mount")


@dataclass
class Root:
    """A root file system that programs run in.

    Parameters
    ----------
    folder : path
    variables : mapping
        Their environment.
    binds : sequence of path
        Files and folders of this machine that they see, too, as they are.
    """

    folder: Path
    variables: dict[str, str] = field(default_factory=dict)
    binds: Sequence[Path] = ()

    def command(
        self,
        words: Sequence[str],
        *,
        user: str = "root",
        directory: str = "/",
        mounts: Sequence[str] = (),
        offline: bool = False,
        unprivileged: bool = False,
    ) -> list[str]:
        """Return what runs something in it.

        Parameters
        ----------
        words : sequence of str
            The program and its arguments.
        mounts : sequence of str
            Commands for the shell, run before the root is entered; ``$root`` is its folder.
        offline : bool
            In a network of its own, where it reaches itself only.
        unprivileged : bool
            Without any capability, and with no way to get one.
        """
        chosen = f"--reuid={user} --regid={user} --init-groups" if user != "root" else ""
        dropped = "--no-new-privs --bounding-set=-all --inh-caps=-all" if unprivileged else ""
        environment = [f"{name}={value}" for name, value in self.variables.items()]
        inner = shlex.join(
            ["env", "-i", *environment, "sh", "-c", f'cd {shlex.quote(directory)} && exec "$@"', "sh", *words]
        )
        script = ["set -e", f"root={shlex.quote(str(self.folder))}", "mount --bind $root $root"]
        script += ["mount -t proc proc $root/proc", "mount --rbind /dev $root/dev"]
        script += [f"mount --bind -o ro {path} $root{path}" for path in map(self._place, self.binds)]
        script += [*(["ip link set lo up"] if offline else []), *mounts]
        script += [f"exec chroot $root setpriv {chosen} {dropped} {inner}"]
        apart = ["--net"] if offline else []
        return ["unshare", "--mount", "--pid", "--fork", "--kill-child", *apart, "sh", "-c", "\n".join(script)]

    def run(self, words: Sequence[str], **how: object) -> "subprocess.CompletedProcess[str]":
        """Run something to its end; what it prints is kept."""
        return subprocess.run(self.command(words, **how), capture_output=True, text=True, check=False)  # type: ignore[arg-type]

    def _place(self, path: Path) -> Path:
        inside = self.folder / path.relative_to("/")
        if path.is_dir():
            inside.mkdir(parents=True, exist_ok=True)
        elif not inside.exists():
            inside.parent.mkdir(parents=True, exist_ok=True)
            inside.touch()
        return path


@dataclass(frozen=True)
class Service:
    """A program that runs in a root, and was not waited for."""

    process: "subprocess.Popen[bytes]"
    pid: int
    """Of the program itself, as seen from here."""

    def beside(self, words: Sequence[str], variables: Mapping[str, str]) -> "subprocess.CompletedProcess[str]":
        """Run something where the service is: in its root, network and processes."""
        entered = ["nsenter", "--target", str(self.pid), "--mount", "--net", "--pid", "--root", "--wd"]
        environment = [f"{name}={value}" for name, value in variables.items()]
        return subprocess.run(
            [*entered, "env", "-i", *environment, *words], capture_output=True, text=True, check=False
        )

    def end(self, patience_s: float) -> int:
        """Send SIGTERM to the program, which is the first process of its own; returns its exit code."""
        os.kill(self.pid, signal.SIGTERM)
        return self.process.wait(patience_s)


@contextmanager
def serving(command: Sequence[str], log: Path) -> Iterator[Service]:
    """Start a program in a root; it is killed in the end when it still runs."""
    with log.open("wb") as file, subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT) as process:
        try:
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
            while process.poll() is None and not children.read_text().split():
                pass
            yield Service(process, int(children.read_text().split()[0]))
        finally:
            process.kill()


def base(folder: Path, suite: str, packages: Sequence[str] = ()) -> None:
    """Make a root of the packages of one of Debian's suites with Python, as images of Python are."""
    included = ",".join((*PACKAGES, *packages))
    words = ["mmdebstrap", "--quiet", "--variant=minbase", f"--include={included}", suite, str(folder)]
    subprocess.run(words, check=True)
    (folder / "usr/local/bin/python").symlink_to("/usr/bin/python3")


def missing(*needed: str) -> list[str]:
    """Return what this machine lacks for all this."""
    return [name for name in ("mmdebstrap", "nsenter", *needed) if shutil.which(name) is None] + (
        [] if os.geteuid() == 0 else ["root's rights"]
    )
