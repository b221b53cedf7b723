"""What a segmentation service says it is, for keys and episodes: another model behind an address is another result."""

from __future__ import annotations

from scenewright.stages.agent.parameters import EyesParameters
from scenewright.stages.kit.services.segmentation_client import connect, read_identity


def identity_of(address: str) -> str:
    """Return what the service at an address says of itself now, empty for no address.

    Raises MissingDependency when it does not answer, BadInput when it is no segmentation service.
    """
    return read_identity(connect(address)) if address else ""


def versions(parameters: EyesParameters) -> dict[str, str]:
    """Return the identity of the segmenter that the parameters name, by its address."""
    return {f"service {parameters.segmenter}": identity_of(parameters.segmenter)} if parameters.segmenter else {}
