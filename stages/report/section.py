"""Sections of the page, found by place: every folder `sections/<name>/` with a `section.py` is one.

So is every package that an installed distribution names in the entry points of `scenewright.sections`.

`section.py` declares it as SECTION and is cheap to import; `view.py` has `view(page)`, which returns the values of
`section.html.j2`, or None when there is nothing to show. `tiles` among them (name and value) stand on top of the page;
`scripts` are digests of the only scripts that may run in it.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from types import ModuleType
from typing import Any

import scenewright.stages.report.sections
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.plugins import taken


@dataclass(frozen=True)
class Section:
    """What a section says about itself."""

    name: str
    """Its folder, and its anchor on the page."""
    title: str
    """In the bar of sections."""
    order: int
    """Its place on the page: small numbers first."""
    reads: Mapping[str, type[Artifact]] = field(default_factory=dict)
    """Role -> kind: inputs of the step `report`, each may be left out. The section is asked when one of them is given,
    and is of that kind; a section that reads nothing is always asked."""
    became: Mapping[str, str | Callable[[Any], str]] = field(default_factory=dict)
    """Role -> what the first lines call it (`a labelled map`), or a function of the artifact that says it."""
    alone: str = ""
    """Title of a page that shows nothing but what this section reads; empty: a room."""


@cache
def _found() -> dict[str, tuple[Section, str]]:
    """Return the sections and their packages by name."""
    found: dict[str, tuple[Section, str]] = {}

    def take(package: str) -> Section:
        section: Section = importlib.import_module(f"{package}.section").SECTION
        if section.name in found:
            raise RuntimeError(f"section {section.name!r} is declared twice: {package}")
        found[section.name] = section, package
        return section

    for entry in pkgutil.iter_modules(scenewright.stages.report.sections.__path__):
        section = take(f"{scenewright.stages.report.sections.__name__}.{entry.name}")
        if section.name != entry.name:
            raise RuntimeError(f"section {section.name!r} is declared in the folder {entry.name!r}")
    taken("scenewright.sections", lambda module: take(module.__name__))
    return found


@cache
def all_sections() -> tuple[Section, ...]:
    """Return every section by its place on the page. Imports declarations only."""
    sections = [section for section, _ in _found().values()]
    return tuple(sorted(sections, key=lambda section: (section.order, section.name)))


def package_of(section: Section) -> ModuleType:
    """Return the package with its `view.py` and `section.html.j2`."""
    return importlib.import_module(_found()[section.name][1])


def all_roles() -> dict[str, type[Artifact]]:
    """Return role -> kind of everything that some section reads, the more general one where two differ.

    Raises RuntimeError when neither can be read as the other.
    """
    roles: dict[str, type[Artifact]] = {}
    for section in all_sections():
        for role, kind in section.reads.items():
            earlier_kind = roles.get(role, kind)
            if not issubclass(kind, earlier_kind) and not issubclass(earlier_kind, kind):
                raise RuntimeError(
                    f"{role!r} is {kind.kind!r} to section {section.name!r}, {earlier_kind.kind!r} to another"
                )
            roles[role] = earlier_kind if issubclass(kind, earlier_kind) else kind
    return roles
