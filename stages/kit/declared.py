"""What declares itself, found by its place: a new file or folder needs no entry in any table.

Installed packages add more by entry points of a group. Cheap to import, and so must be what it finds: a package that
takes part in `--help` declares itself in its `__init__.py`, and the code behind it stands in another file of that
folder, which is loaded when it is used.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Generic, Protocol, TypeVar

from scenewright.schemas.plugins import taken


class Declaration(Protocol):
    """What a plug-in says of itself."""

    @property
    def name(self) -> str:
        """What people and files call it; unique in its folder."""
        ...

    @property
    def order(self) -> int:
        """Its place among the others of its folder; ties are broken by name."""
        ...


Declared = TypeVar("Declared", bound=Declaration)


@dataclass(frozen=True)
class Found(Generic[Declared]):
    """A declaration and the module or package that makes it."""

    declaration: Declared
    module: str


def found_in(package: str, kind: type[Declared], attribute: str, group: str) -> tuple[Found[Declared], ...]:
    """Return what the modules and packages right below `package` declare as `attribute`, and those that installed
    packages name in the entry points of `group`, in their order.

    Raises RuntimeError for a module below `package` that declares nothing of that kind, and for a name that is taken
    there. An installed one of which that is true is left out, and said.
    """
    found: dict[str, Found[Declared]] = {}

    def take(module: ModuleType) -> None:
        declaration = getattr(module, attribute, None)
        if not isinstance(declaration, kind):
            raise RuntimeError(f"{module.__name__} declares no {attribute}")
        if declaration.name in found:
            raise RuntimeError(f"{module.__name__}: {declaration.name!r} is declared twice")
        found[declaration.name] = Found(declaration, module.__name__)

    for entry in pkgutil.iter_modules(importlib.import_module(package).__path__):
        take(importlib.import_module(f"{package}.{entry.name}"))
    taken(group, take)
    return tuple(sorted(found.values(), key=lambda one: (one.declaration.order, one.declaration.name)))


def module_of(found: Iterable[Found[Declared]], name: str) -> str:
    """Return the module or package of a declaration: what belongs to it lies beside or below. Raises KeyError."""
    return {one.declaration.name: one.module for one in found}[name]


def load_beside(package: str, module: str) -> ModuleType:
    """Import a module that lies in the package of a declaration."""
    return importlib.import_module(f"{package}.{module}")


def declared_in(package: str, kind: type[Declared], attribute: str, group: str = "") -> tuple[Declared, ...]:
    """Return the declarations of `found_in`."""
    return tuple(one.declaration for one in found_in(package, kind, attribute, group))
