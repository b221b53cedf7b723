"""Versions of installed libraries, as keys and manifests record them."""

from __future__ import annotations

from functools import cache
from importlib import metadata


@cache
def library_version(distribution: str) -> str:
    """Return the installed version of a distribution, without its local build tag (`2.13.0+cpu` -> `2.13.0`)."""
    try:
        return metadata.version(distribution).split("+")[0]
    except metadata.PackageNotFoundError:
        return "absent"
