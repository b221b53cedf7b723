"""What a service says it is, for the key of an artifact: the same address may have another model tomorrow."""

from __future__ import annotations

from scenewright.stages.kit.services.segmentation_client import read_identity
from scenewright.stages.segment.backends.service import ServiceParameters
from scenewright.stages.segment.backends.service.backend import connected
from scenewright.stages.segment.parameters import SegmentParameters

LABEL = "2"
"""Version of the words under which segments.json has a service's masks."""


def versions(parameters: SegmentParameters) -> dict[str, str]:
    """Return what the service says of itself now, or what --service-model says it has to be.

    Raises MissingDependency when it does not answer, BadInput when it is no segmentation service.
    """
    assert isinstance(parameters, ServiceParameters)
    address = parameters.backend
    model = parameters.service_model or read_identity(connected(address, parameters))
    return {f"service {address}": model, "service label": LABEL}
