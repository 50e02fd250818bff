"""What the service is made of: complete, compatible, free of known weaknesses, under licences that go together."""

import importlib.metadata
import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests.support.paths import PROJECT

DECLARED = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
ADVISORIES = tomllib.loads((PROJECT / "tests" / "advisories.toml").read_text())["advisory"]

COMPATIBLE = re.compile(r"MIT|BSD|Apache|ISC|Zlib|CC0|HPND|MPL.2|Mozilla|PSF|Python Software Foundation", re.IGNORECASE)
RECIPROCAL = re.compile(
    r"\b(A?GPL|LGPL|SSPL|EUPL|CDDL|EPL)\b|Commons Clause|Business Source|Non.?Commercial", re.IGNORECASE
)
SAID_ELSEWHERE = {"cmocean": "MIT", "pyftpdlib": "MIT"}
"""Licences that stand in the library's files and not in its metadata."""


def needed() -> dict[str, list[Requirement]]:
    """Everything that is installed with the service, by name, with what is asked of it."""
    found: dict[str, list[Requirement]] = {}
    pending = [Requirement(text) for text in DECLARED["dependencies"]]
    seen = set()
    while pending:
        requirement = pending.pop()
        name = canonicalize_name(requirement.name)
        found.setdefault(name, []).append(requirement)
        if (name, frozenset(requirement.extras)) in seen:
            continue
        seen.add((name, frozenset(requirement.extras)))
        for text in importlib.metadata.requires(name) or ():
            inner = Requirement(text)
            extras = requirement.extras or {""}
            if inner.marker is None or any(inner.marker.evaluate({"extra": extra}) for extra in extras):
                pending.append(inner)
    return found


NEEDED = needed()


def version(name: str) -> str:
    return importlib.metadata.version(name)


@pytest.mark.parametrize("name", sorted(NEEDED))
def test_what_is_installed_is_what_everybody_asks_for(name: str) -> None:
    for requirement in NEEDED[name]:
        assert requirement.specifier.contains(version(name), prereleases=True), f"{name} {version(name)}: {requirement}"


@pytest.mark.parametrize("advisory", ADVISORIES, ids=lambda advisory: advisory["id"])
def test_no_version_with_a_known_weakness_is_installed_or_asked_for(advisory: dict[str, str]) -> None:
    name, affected = canonicalize_name(advisory["library"]), SpecifierSet(advisory["versions"])
    assert name in NEEDED, f"{name} is not used any more: remove {advisory['id']}"
    assert not affected.contains(version(name), prereleases=True), advisory
    for text in DECLARED["dependencies"]:
        requirement = Requirement(text)
        if canonicalize_name(requirement.name) == name:
            lowest = [s.version for s in requirement.specifier if s.operator == ">="]
            assert lowest, f"{name} has no lowest version"
            assert not affected.contains(lowest[0]), f"{text} allows a version with {advisory['id']}"


def _chosen(expression: str) -> str:
    """Return of licences that a library leaves the choice of (SPDX: OR) those that ask nothing of our own."""
    choices = re.split(r"\s+OR\s+", expression.strip("()"))
    return " OR ".join([text for text in choices if not RECIPROCAL.search(text)] or choices)


@pytest.mark.parametrize("name", sorted(NEEDED))
def test_licences_go_together_with_ours(name: str) -> None:
    about = importlib.metadata.metadata(name)
    classifiers = [text for text in about.get_all("Classifier", []) if text.startswith("License")]
    said = [
        *(_chosen(text) for text in about.get_all("License-Expression", [])),
        *(text[:200] for text in about.get_all("License", [])),
        *classifiers,
        SAID_ELSEWHERE.get(name),
    ]
    words = " ".join(text for text in said if text)
    assert COMPATIBLE.search(words), f"{name}: {words or 'no licence'}"
    assert not RECIPROCAL.search(words), f"{name}: {words}"


def test_every_direct_dependency_is_explained() -> None:
    told = (PROJECT / "docs" / "libraries.md").read_text().lower()
    for text in DECLARED["dependencies"]:
        name = Requirement(text).name.lower()
        assert re.search(rf"\b{re.escape(name)}\b", told), name
