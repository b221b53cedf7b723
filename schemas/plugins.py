"""What installed packages add: their entry points in groups `scenewright.*` (docs/ARCHITECTURE.md, "Found by place").

An entry point names what would lie in the folder here: a module or a package. One that is broken is left out, with one
line that names its distribution.
"""

from __future__ import annotations

import importlib
import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from types import ModuleType
from typing import TypeVar

PREFIX = "scenewright."
"""How the groups of entry points begin that are ours."""
Taken = TypeVar("Taken")
logger = logging.getLogger("scenewright")


def load_module(module: str) -> ModuleType:
    """Import a module by its name. Who calls this names it, so that its code can be followed."""
    return importlib.import_module(module)


@dataclass(frozen=True)
class PlugIn:
    """One entry point."""

    group: str
    name: str
    module: str
    distribution: str

    def load(self) -> ModuleType:
        """Import what it names. Raises whatever that raises."""
        return load_module(self.module)

    def say_broken(self, reason: str) -> None:
        """Tell that it is left out."""
        logger.warning("%s: its %s %r is left out: %s", self.distribution, self.group, self.name, reason)


def _distributions() -> dict[str, metadata.Distribution]:
    """Return the installed distributions with entry points of ours by name, the first of each on the path.

    Reads the files itself: `metadata.entry_points()` parses those of all distributions, five times as long.
    """
    found: dict[str, metadata.Distribution] = {}
    for folder in dict.fromkeys(sys.path):
        names: list[str] = []
        with suppress(OSError):
            names = sorted(name for name in os.listdir(folder or ".") if name.endswith((".dist-info", ".egg-info")))
        for name in names:
            path = os.path.join(folder, name)
            with suppress(OSError), open(os.path.join(path, "entry_points.txt"), "rb") as file:
                if f"[{PREFIX}".encode() in file.read():
                    distribution = metadata.Distribution.at(path)
                    found.setdefault(distribution.name, distribution)
    return found


@cache
def plugins() -> tuple[PlugIn, ...]:
    """Return every entry point of ours, ordered by distribution and name. Imports none of them."""
    return tuple(
        PlugIn(entry.group, entry.name, entry.module, name)
        for name, distribution in sorted(_distributions().items())
        for entry in sorted(distribution.entry_points, key=lambda entry: (entry.group, entry.name))
        if entry.group.startswith(PREFIX)
    )


def installed(group: str) -> tuple[PlugIn, ...]:
    """Return the entry points of a group."""
    return tuple(plugin for plugin in plugins() if plugin.group == group)


def taken(group: str, take: Callable[[ModuleType], Taken]) -> list[tuple[PlugIn, Taken]]:
    """Import the entry points of a group; return what `take` makes of each. One that raises is left out, and said."""
    found = []
    for plugin in installed(group):
        try:
            found.append((plugin, take(plugin.load())))
        except (Exception, SystemExit) as error:
            plugin.say_broken(f"{type(error).__name__}: {error}")
    return found
