"""What a Dockerfile says: its stages and their instructions, as far as ours goes."""

import json
import os
import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

import pathspec

KNOWN = ("ARG", "ENV", "WORKDIR", "COPY", "RUN", "USER", "VOLUME", "EXPOSE", "HEALTHCHECK", "ENTRYPOINT", "CMD")


class DockerfileError(Exception):
    """An instruction that is not understood here."""


@dataclass
class Stage:
    """One ``FROM`` and what follows it."""

    image: str
    name: str
    instructions: list[tuple[str, str]] = field(default_factory=list)

    @property
    def debian(self) -> str:
        """Of which Debian the image is, as in ``python:3.12-slim-trixie``."""
        return self.image.rpartition("-")[2]


def stages_of(text: str) -> list[Stage]:
    """Return the stages in their order. Raises DockerfileError."""
    lines = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("#"))
    stages: list[Stage] = []
    for line in filter(str.strip, lines.replace("\\\n", " ").splitlines()):
        word, _, rest = line.strip().partition(" ")
        if word == "FROM":
            image, *name = re.split(r"\s+AS\s+", rest.strip())
            stages.append(Stage(image, name[0] if name else str(len(stages))))
        elif word in KNOWN and stages:
            stages[-1].instructions.append((word, re.sub(r"\s+", " ", rest.strip())))
        else:
            raise DockerfileError(f"{word}: not understood here")
    return stages


def words_of(value: str) -> list[str]:
    """Return the words of ``["a", "b"]``; a plain line is one for the shell."""
    return [str(word) for word in json.loads(value)] if value.startswith("[") else ["sh", "-c", value]


def variables_of(value: str, known: dict[str, str]) -> dict[str, str]:
    """Return what an ``ENV`` sets, with ``$NAME`` filled in."""
    pairs = (word.split("=", 1) for word in shlex.split(value))
    return {name: re.sub(r"\$\{?(\w+)\}?", lambda m: known.get(m[1], ""), text) for name, text in pairs}


def options_of(value: str) -> tuple[list[tuple[str, str]], str]:
    """Split ``--from=build a b`` into its options and the rest."""
    options = []
    while found := re.match(r"--([a-z-]+)=(\S+)\s+", value):
        options.append((found[1], found[2]))
        value = value[found.end() :]
    return options, value


def context_of(folder: Path) -> list[Path]:
    """Return the files of a folder that ``.dockerignore`` lets through, relative to it."""
    ignored = pathspec.PathSpec.from_lines("gitignore", (folder / ".dockerignore").read_text().splitlines())
    found = []
    for here, folders, files in os.walk(folder):
        relative = Path(here).relative_to(folder)
        folders[:] = [name for name in folders if name not in ("node_modules", ".git") and not name.startswith(".venv")]
        found += [relative / name for name in files if not ignored.match_file(relative / name)]
    return sorted(found)
