"""Names that a package exports without loading them: `__getattr__ = exported(__name__)` (PEP 562).

They are those that the package imports under `if TYPE_CHECKING:`, so that a type checker reads the same list.
"""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


def exported(package: str) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package: it loads the module of a name when that name is first asked for."""

    def load(name: str) -> Any:
        module = exported_names(package).get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(module), name)

    return load


@cache
def exported_names(package: str) -> dict[str, str]:
    """Return name -> module of what a loaded package exports."""
    tree = ast.parse(Path(sys.modules[package].__file__ or "").read_text(encoding="utf-8"))
    blocks = (node.body for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    imports = (node for body in blocks for node in body if isinstance(node, ast.ImportFrom) and node.module)
    return {alias.name: str(node.module) for node in imports for alias in node.names}
