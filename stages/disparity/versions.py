"""What decides the disparities beside the code, for the method that needs it: the versions that go into the key."""

from __future__ import annotations

from scenewright.stages.disparity.parameters import NETWORKS, DisparityParameters
from scenewright.stages.kit.library_versions import library_version


def versions(parameters: DisparityParameters) -> dict[str, str]:
    """Return name -> version of the libraries of the chosen method alone."""
    return {"torch": library_version("torch")} if parameters.method in NETWORKS else {}
