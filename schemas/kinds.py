"""The artifact kinds, found by place: importing this imports every file of schemas/, which registers its kinds.

So do the modules that installed packages name in the entry points of `scenewright.kinds`.
"""

import importlib
import pkgutil

import scenewright.schemas
from scenewright.schemas.artifact import KINDS
from scenewright.schemas.plugins import taken

for _module in pkgutil.iter_modules(scenewright.schemas.__path__):
    if _module.name != "kinds":
        importlib.import_module(f"scenewright.schemas.{_module.name}")
taken("scenewright.kinds", lambda module: None)

__all__ = ["KINDS"]
