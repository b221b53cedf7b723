"""Names that a package exports without loading them: `__getattr__ = exported(__name__, _MODULES)` (PEP 562)."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any


def exported(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package: it loads `modules[name]` when that name is first asked for.

    `modules` is a literal of name -> full module name, so that it can be read without running it.
    """

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(modules[name]), name)

    return load
