"""What declares itself, found by its place: a new file or folder needs no entry in any table.

Cheap to import, and so must be what it finds: a package that takes part in `--help` declares itself in its
`__init__.py`, and the code behind it stands in another file of that folder, which is loaded when it is used.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import Protocol, TypeVar


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


def declared_in(package: str, kind: type[Declared], attribute: str) -> tuple[Declared, ...]:
    """Return what the modules and packages right below `package` declare as `attribute`, in their order.

    Raises RuntimeError for a module there that declares nothing of that kind, and for a name that is taken.
    """
    declarations: dict[str, Declared] = {}
    for entry in pkgutil.iter_modules(importlib.import_module(package).__path__):
        declaration = getattr(importlib.import_module(f"{package}.{entry.name}"), attribute, None)
        if not isinstance(declaration, kind):
            raise RuntimeError(f"{package}.{entry.name} declares no {attribute}")
        if declaration.name in declarations:
            raise RuntimeError(f"{package}.{entry.name}: {declaration.name!r} is declared twice")
        declarations[declaration.name] = declaration
    return tuple(sorted(declarations.values(), key=lambda declaration: (declaration.order, declaration.name)))
