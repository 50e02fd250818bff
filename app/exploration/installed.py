"""Planners that other packages bring along: entry points of the group ``bathyfleet.planners``.

A package that cannot be loaded, or brings what is no planner, is reported by its name and left out.
"""

import inspect
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint, entry_points

from app.exploration.planner.base import PlannerBase

GROUP = "bathyfleet.planners"
NAME = re.compile(r"[a-z][a-z0-9-]{0,39}")


@dataclass(frozen=True)
class BrokenPlanner:
    """A planner that is installed and cannot be used.

    Parameters
    ----------
    name : str
        Of its entry point.
    package : str
        The package that brings it, with its version.
    reason : str
        Why it cannot be used, and what would be right.
    """

    name: str
    package: str
    reason: str


@dataclass(frozen=True)
class InstalledPlanners:
    """What other packages brought along.

    Parameters
    ----------
    planners : dict
        Classes that can be used, by their names.
    packages : dict
        The package of each, with its version.
    broken : dict
        The others, by the names of their entry points.
    """

    planners: dict[str, type[PlannerBase]] = field(default_factory=dict)
    packages: dict[str, str] = field(default_factory=dict)
    broken: dict[str, BrokenPlanner] = field(default_factory=dict)


def find_planners(taken: Collection[str], found: Iterable[EntryPoint] | None = None) -> InstalledPlanners:
    """Load the planners of other packages.

    Parameters
    ----------
    taken : collection of str
        Names of planners that there are.
    found : iterable of EntryPoint, optional
        Where they are; otherwise all that are installed.
    """
    installed = InstalledPlanners()
    entries = entry_points(group=GROUP) if found is None else found
    # One name in two packages: which of them is taken does not depend on the order of folders.
    for entry in sorted(entries, key=lambda entry: (entry.name, _package(entry))):
        name, package = entry.name, _package(entry)
        try:
            if name in installed.planners:
                raise ValueError(f"{installed.packages[name]} brings a planner of that name, too")
            planner = _loaded(entry, taken)
        except (Exception, SystemExit) as error:  # whatever a strange module does when it is imported
            reason = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
            installed.broken.setdefault(name, BrokenPlanner(name, package, reason))
            continue
        installed.planners[name] = planner
        installed.packages[name] = package
        installed.broken.pop(name, None)
    return installed


def _loaded(entry: EntryPoint, taken: Collection[str]) -> type[PlannerBase]:
    """Return an entry point's class. Raises ValueError when it is no planner, and whatever its module raises."""
    if not NAME.fullmatch(entry.name):
        raise ValueError(f"{entry.name!r} is no name for a planner: small letters, digits and hyphens")
    if entry.name in taken:
        raise ValueError(f"bathyfleet has a planner {entry.name!r} of its own: give it another name")
    loaded = entry.load()
    if not (isinstance(loaded, type) and issubclass(loaded, PlannerBase)):
        raise ValueError(f"{entry.value} is no class derived from app.exploration.planner.base.PlannerBase")
    if inspect.isabstract(loaded):
        raise ValueError(f"{entry.value} does not define {', '.join(sorted(loaded.__abstractmethods__))}")
    if getattr(loaded, "name", None) != entry.name:
        raise ValueError(
            f"its attribute name is {getattr(loaded, 'name', None)!r}, its entry point is {entry.name!r}: "
            "both have to be the same"
        )
    return loaded


def _package(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "a package without a name"
