"""What is found by its place: every module of a package is one choice, called as its file. Cheap to import."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

from scenewright.schemas.errors import UsageError


def names_in(package: ModuleType) -> tuple[str, ...]:
    """Return the names of a package's modules in the order of the alphabet; imports none of them."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(package.__path__)))


def module_named(package: ModuleType, name: str) -> ModuleType:
    """Return a module of a package. Raises UsageError for a name that no file has."""
    names = names_in(package)
    if name not in names:
        raise UsageError(f"there is no {name!r}", hint=f"choose of {', '.join(names)}")
    return importlib.import_module(f"{package.__name__}.{name}")
