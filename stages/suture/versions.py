"""What decides poses and threads beside the code: the network's library, where a network makes the masks."""

from __future__ import annotations

from scenewright.stages.kit.library_versions import library_version
from scenewright.stages.suture.options import MaskOptions


def versions(parameters: MaskOptions) -> dict[str, str]:
    """Return name -> version of what the masks need."""
    return {"torch": library_version("torch")} if parameters.segmentation in ("auto", "network") else {}
