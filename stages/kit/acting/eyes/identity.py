"""What a segmentation service says it is, for keys: another model behind an address is another result."""

from __future__ import annotations

from scenewright.stages.kit.acting.eyes.options import SegmenterParameters
from scenewright.stages.kit.services.segmentation_client import connect, read_identity


def identity_of(address: str) -> str:
    """Return what the service at an address says of itself now, empty for no address.

    Raises MissingDependency when it does not answer, BadInput when it is no segmentation service.
    """
    return read_identity(connect(address)) if address else ""


def versions(parameters: SegmenterParameters) -> dict[str, str]:
    """Return the identity of the segmenter that the parameters name, by its address. Raises as `identity_of`."""
    return {f"service {parameters.segmenter}": identity_of(parameters.segmenter)} if parameters.segmenter else {}
