"""What is found by its place: every module of a package is one choice, called as its file. Cheap to import."""

from __future__ import annotations

import pkgutil
from types import ModuleType

from scenewright.schemas.errors import UsageError
from scenewright.schemas.plugins import installed, load_module


def _modules(package: ModuleType) -> dict[str, str]:
    """Return name -> module of what lies in a package and of what installed packages add; ours win."""
    group = f"scenewright.tableware_{package.__name__.rpartition('.')[2]}"
    ours = {module.name: f"{package.__name__}.{module.name}" for module in pkgutil.iter_modules(package.__path__)}
    return {plugin.name: plugin.module for plugin in installed(group)} | ours


def names_in(package: ModuleType) -> tuple[str, ...]:
    """Return the names of a package's modules, and of those that installed packages add in the group of entry points
    `scenewright.tableware_<package>`, in the order of the alphabet; imports none of them."""
    return tuple(sorted(_modules(package)))


def module_named(package: ModuleType, name: str) -> ModuleType:
    """Return a module of a package. Raises UsageError for a name that no file has."""
    modules = _modules(package)
    if name not in modules:
        raise UsageError(f"there is no {name!r}", hint=f"choose one of {', '.join(sorted(modules))}")
    return load_module(modules[name])
