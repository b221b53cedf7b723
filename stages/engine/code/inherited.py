"""What a fork has loaded already: its files may have been edited since, and then its code is not what they say."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable

from scenewright.schemas.errors import MachineFailure

_started = time.time()
_modules: frozenset[str] = frozenset()


def note(modules: Iterable[str]) -> None:
    """Remember what this process was given by the one that it is a fork of."""
    global _modules
    _modules = frozenset(modules)


def refuse_edited(modules: Iterable[str]) -> None:
    """Raise MachineFailure where the file of a module was written since the first of these processes loaded it."""
    for name in _modules.intersection(modules):
        file = getattr(sys.modules[name], "__file__", None)
        if file and os.path.getmtime(file) > _started:
            raise MachineFailure(f"{file}: was edited while the run went on", hint="run it again")
