"""What decides the bytes of an import beside the libraries that are always there: CoACD, where it is used."""

from __future__ import annotations

from importlib import metadata, util

from scenewright.schemas.errors import MissingDependency
from scenewright.stages.library.parameters import AdditionParameters

COACD = "coacd"


def coacd_version() -> str:
    """Return the version of CoACD, `absent` when it is not installed."""
    if util.find_spec(COACD) is None:
        return "absent"
    try:
        return metadata.version(COACD)
    except metadata.PackageNotFoundError:
        return "absent"


def uses_coacd(parameters: AdditionParameters) -> bool:
    """Whether hollow pieces are cut up. Raises MissingDependency when that is asked for and CoACD is not installed."""
    if parameters.decomposition == "coacd" and coacd_version() == "absent":
        raise MissingDependency("coacd is not installed", hint='pip install "coacd>=1.0.14", or --decomposition hulls')
    return parameters.decomposition != "hulls" and coacd_version() != "absent"


def versions(parameters: AdditionParameters) -> dict[str, str]:
    """Return name -> version for the key of the artifact. Raises MissingDependency as `uses_coacd` does."""
    return {COACD: coacd_version() if uses_coacd(parameters) else "unused"}
