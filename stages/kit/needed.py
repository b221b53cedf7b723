"""Libraries that are not there on every kind of machine: imported where they are needed, or missed by name."""

from __future__ import annotations

import importlib
from types import ModuleType

from scenewright.schemas.errors import MissingDependency


def needed(name: str, purpose: str, extra: str | None = None) -> ModuleType:
    """Import a module for a purpose ("bundle adjustment"), which an `extra` of this project brings or pip alone. Raises
    MissingDependency, which names all."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingDependency(
            f"{name} cannot be imported, which {purpose} needs ({error})",
            hint=f"pip install 'scenewright[{extra}]'"
            if extra
            else f"pip install {name}, where it has a package for this machine",
        ) from None
