"""The artifact kinds, found by place: importing this imports every file of schemas/, which registers its kinds."""

import importlib
import pkgutil

import schemas
from schemas.artifact import KINDS

for _module in pkgutil.iter_modules(schemas.__path__):
    if _module.name != "kinds":
        importlib.import_module(f"schemas.{_module.name}")

__all__ = ["KINDS"]
