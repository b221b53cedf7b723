"""Where the modules of scenewright, and of packages that declare steps or alternatives for it, lie on the disk.

Nothing is imported here. What is loaded already is asked for its folders, since a package may have been given more of
them (`scenewright` itself in a checkout; a user's folder of backends).
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

OURS = "scenewright"


@dataclass
class Places:
    """Files and folders that were looked at, so that whoever keeps an answer knows when it is old."""

    roots: Mapping[str, Sequence[Path]]
    """Package at the top -> its folders."""
    plugins: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Group of entry points -> modules that installed distributions declare in it."""
    loaded: bool = False
    """Whether what this process has loaded counts. Not for another tree."""
    files: set[Path] = field(default_factory=set)
    folders: set[Path] = field(default_factory=set)

    def file(self, name: str) -> Path | None:
        """Return the file of a dotted name; None where it is no module that is followed."""
        top, _, _ = name.partition(".")
        if top not in self.roots or not all(part.isidentifier() for part in name.split(".")):
            return None
        candidates = []
        parent, _, last = name.rpartition(".")
        if not parent:
            candidates = [folder / "__init__.py" for folder in self.roots[top]]
        for folder in self.below(parent) if parent else ():
            if folder.is_dir():
                self.folders.add(folder)
                candidates += [folder / last / "__init__.py", folder / f"{last}.py"]
        found = next((path for path in candidates if path.is_file()), None) or self._loaded_file(name)
        if found is not None:
            self.files.add(found)
        return found

    def below(self, package: str) -> list[Path]:
        """Return the folders in which the modules of a package lie; they need not exist."""
        if package in self.roots:
            folders = list(self.roots[package])
        else:
            parent, _, last = package.rpartition(".")
            folders = [folder / last for folder in self.below(parent)]
        more = getattr(sys.modules.get(package), "__path__", ()) if self.loaded else ()
        return list(dict.fromkeys([*folders, *map(Path, more)]))

    def _loaded_file(self, name: str) -> Path | None:
        """The file of a module that was put into the process by hand."""
        found = getattr(sys.modules.get(name), "__file__", None) if self.loaded else None
        return Path(found) if found else None

    def beneath(self, name: str) -> tuple[str, ...]:
        """Return a module, and all below it where it is a package."""
        found = {name}
        for folder in self.below(name):
            for file in folder.rglob("*.py") if folder.is_dir() else ():
                self.folders.add(file.parent)
                parts = file.relative_to(folder).with_suffix("").parts
                found.add(".".join((name, *(parts[:-1] if parts[-1] == "__init__" else parts))))
        return tuple(sorted(found))


def places_here(plugins: Mapping[str, Sequence[str]], also: Sequence[str] = ()) -> Places:
    """Return the places of this process: scenewright, the packages at the top of what `plugins` names, and `also`."""
    tops = {OURS, *also, *(module.partition(".")[0] for modules in plugins.values() for module in modules)}
    return Places({top: _folders_of(top) for top in sorted(tops)}, plugins, loaded=True)


def _folders_of(top: str) -> list[Path]:
    """Folders of a package at the top, or the folder of a single module."""
    if top in sys.modules and hasattr(sys.modules[top], "__path__"):
        return [Path(folder) for folder in sys.modules[top].__path__]
    spec: importlib.machinery.ModuleSpec | None = importlib.util.find_spec(top)
    return [Path(folder) for folder in spec.submodule_search_locations or ()] if spec else []


def added_folders() -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the packages of scenewright that this process has given more folders than their own, and those folders:
    modules that no installation names."""
    added = []
    for name, module in sorted(sys.modules.items()):
        if name.startswith(f"{OURS}.") and len(folders := tuple(getattr(module, "__path__", ()))) > 1:
            added.append((name, folders))
    return tuple(added)
