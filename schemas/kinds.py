"""The artifact kinds, found by place: importing this imports every file of schemas/, which registers its kinds."""

import importlib
import pkgutil

import scenewright.schemas
from scenewright.schemas.artifact import KINDS

for _module in pkgutil.iter_modules(scenewright.schemas.__path__):
    if _module.name != "kinds":
        importlib.import_module(f"scenewright.schemas.{_module.name}")

__all__ = ["KINDS"]
